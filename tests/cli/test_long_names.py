"""Names of thousands of letters are shortened in what an error says of them."""

import pytest

import beamchain as bc

CRAFT = """<mujoco><worldbody><body name="{name}"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/><site name="{name}"/></body></worldbody>
</mujoco>"""
LONG = "begin" + 5000 * "a" + "end"
SECTION = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
BOOM = bc.Spec(segment=(bc.Segment(length=8.0, section=SECTION),))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: bc.embed(CRAFT.format(name=LONG), {"mount": BOOM}),
        lambda: bc.embed(CRAFT.format(name="mount"), {LONG: BOOM}),
        lambda: bc.read_spec(f"{LONG}.toml"),
        lambda: bc.plant(CRAFT.format(name="bus"), [f"torque:{LONG}"]),
    ],
    ids=["site in the file", "place", "path", "input"],
)
def test_a_long_name_is_shortened(wrong):
    with pytest.raises(bc.BeamchainError, match=r"begina+\.\.\.") as caught:
        wrong()
    assert len(str(caught.value)) < 1000
