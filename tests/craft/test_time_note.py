"""What `embed` says of timing where the file without it is unstable at the spacecraft's step."""

import beamchain as bc

CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.5"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="{}" diaginertia="60 90 120"/><site name="left" pos="0 0.5 0"
 xyaxes="0 1 0 -1 0 0"/><site name="right" pos="0 -0.5 0" xyaxes="0 -1 0 1 0 0"/></body></worldbody>
</mujoco>"""


def test_a_file_that_is_unstable_without_timing_is_called_so():
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    wing = bc.Spec(
        segment=(bc.Segment(length=8.0, section=section),), damping=bc.Damping(ratio=0.01)
    )
    made = bc.embed(CRAFT.format(60), {"left": wing, "right": wing}, retime=True)
    note = next(said for said in made.warnings if "with timing" in said)
    assert "; without: unstable at this step." in note
