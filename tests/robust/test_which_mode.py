"""Which mode a margin belongs to, which modes a plant leaves out, and what a margin above the kept
modes of its own axis says; what is probably a mistake of the user.

Tests a table as well, `margin_table`, which the command prints."""

import control
import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from beamchain import robust
from beamchain.report.tables.plant import margin_table
from command import call
from mechanics import by_differences

YOKE = (
    '<body name="{0}" pos="0 {1} 0" xyaxes="0 {2} 0 {3} 0 0"><joint name="{0}" axis="1 0 0"/>'
    '<inertial pos="0.1 0 0" mass="7" diaginertia="0.1 0.1 0.1"/><site name="{0}_root"/></body>'
)
CRAFT = (
    '<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>'
    '<inertial pos="0 0 0" mass="1500" diaginertia="1200 900 1400"/>'
    f"{YOKE.format('north', 0.9, 1, -1)}{YOKE.format('south', -0.9, -1, 1)}"
    "</body></worldbody><actuator>"
    '<position name="n" joint="north" kp="6000" kv="60"/>'
    '<position name="s" joint="south" kp="6000" kv="60"/></actuator></mujoco>'
)
WING = bc.Spec(
    name="wing",
    segment=(
        bc.Segment(
            length=10.0,
            section=bc.Equivalent(
                bending_stiffness_xy=4139.0,
                bending_stiffness_xz=1.035e5,
                torsion_stiffness=768.0,
                linear_mass=9.0,
                polar_inertia=3.0,
            ),
        ),
    ),
    damping=bc.Damping(ratio=0.003),
    modes=bc.Modes(xy=3, xz=2, torsion=1),
)
INERTIA = {"x": 9643.0, "y": 970.0, "z": 9836.0}


@pytest.fixture(scope="module")
def embedded():
    return bc.embed(CRAFT, {"north_root": WING, "south_root": WING}, retime=False)


@pytest.fixture(scope="module")
def small():
    """With one mode per wing."""
    bending = WING.replace(modes=bc.Modes(xy=1))
    return bc.embed(CRAFT, {"north_root": bending, "south_root": bending}, retime=False)


@pytest.fixture(scope="module")
def plant(embedded):
    return bc.plant(embedded, ["torque:bus"], ["attitude"])


def controller(**gains):
    """Proportional and derivative, with 0.15 s of dead time."""
    loops = tuple(
        bc.spec.Loop(
            input=f"torque_{axis}",
            output=f"attitude_{axis}",
            numerator=(factor * 0.1 * INERTIA[axis], factor * 0.0036 * INERTIA[axis]),
            denominator=(0.02, 1.0),
            delay=0.15,
        )
        for axis, factor in gains.items()
    )
    return bc.spec.Controller(loop=loops)


def frequencies(plant, word):
    return [w for n, w in zip(plant.modes, plant.frequency, strict=True) if word in n]


@pytest.mark.slow
def test_a_servo_and_the_modes_of_other_axes_do_not_vouch_for_a_margin(plant):
    """About y the wings twist, and one torsion mode is kept; servos and bending are faster."""
    found = bc.margins(plant, controller(y=1.0))
    (loop,) = found.loops
    (torsion,) = frequencies(plant, "torsion")
    assert torsion < loop.gain_frequency < max(plant.frequency)
    assert any(
        text.startswith("torque_y from attitude_y: ")
        and f"gain margin (at {loop.gain_frequency:.4g} rad/s)" in text
        and f"({torsion:.4g} rad/s)" in text
        for text in found.beyond
    )
    # what is left out matters there
    channel = plant.output_names.index("attitude_y"), plant.input_names.index("torque_y")
    assert plant.truncation([loop.gain_frequency])[channel][0] > 0.01


@pytest.mark.parametrize("axis", "xz")
@pytest.mark.slow
def test_the_mode_of_a_gain_margin_is_that_which_grows_beyond_it(plant, axis):
    """The closed loop's growing pole, followed back to the open loop, starts at that mode."""
    (loop,) = bc.margins(plant, controller(**{axis: 1.0})).loops
    beyond = bc.margins(plant, controller(**{axis: 1.02 * loop.gain}))
    assert loop.modes["gain"] in [one.origin for one in beyond.instabilities]
    assert loop.as_dict()["modes"] == dict(loop.modes)


def test_a_mode_faster_than_the_samples_is_named_where_they_show_it(plant):
    """The first mode in xz is faster than pi/T, so that its samples ring at 2 pi/T less its own."""
    (mode,) = frequencies(plant, "mode1_xz")
    period = 2.0 * np.pi / (1.77 * mode)
    assert mode > 1.1 * np.pi / period

    def law(gain):
        system = control.tf([965.0 * gain, 35.0 * gain], [0.3, 1.0])
        return {("torque_x", "attitude_x"): control.c2d(system, period, "tustin")}

    (loop,) = bc.margins(plant, law(1.0)).loops
    assert abs(loop.gain_frequency / (2.0 * np.pi / period - mode) - 1.0) < 0.02
    assert "mode1_xz" in loop.modes["gain"]
    beyond = bc.margins(plant, law(1.02 * loop.gain))
    assert loop.modes["gain"] in [one.origin for one in beyond.instabilities]


def test_without_a_mode_near_none_is_named(plant):
    """A slow loop about y: its phase margin is one of rigid motion."""
    (loop,) = bc.margins(plant, controller(y=1.0)).loops
    assert loop.phase_frequency < 0.5 * min(frequencies(plant, "torsion"))
    assert "phase" not in loop.modes


def test_modes_that_oppose_each_other_are_listed_as_left_out(embedded, plant, tmp_path):
    """Wings that twist against each other turn nothing: MuJoCo has that mode, the plant not."""
    mass, _, stiffness = by_differences(embedded.model)
    squares = eigh((stiffness + stiffness.T) / 2.0, mass, eigvals_only=True)
    flexible = np.sqrt(squares[squares > 1e-3])
    assert flexible.size == len(plant.modes) + len(plant.unreached)
    assert not set(plant.modes) & set(plant.unreached)
    assert sum("torsion" in name for name in plant.unreached) == 1
    file = embedded.write(tmp_path / "flexible.xml")[-1]
    answer = call("plant", file, "--full", "--from", "torque:bus", "--to", "attitude", "-o",
                  tmp_path / "p.npz")  # fmt: skip
    words = " ".join(answer.out.split())
    assert f"no output sees them: {', '.join(plant.unreached)}" in words


@pytest.mark.slow
def test_a_pose_of_several_stands_in_a_column(small):
    poses = [{"north": np.radians(a), "south": np.radians(-a)} for a in (0.0, 45.0)]
    plants = bc.plant(small, ["torque:bus"], ["attitude"], pose=poses)
    rows = margin_table(bc.margins(plants, controller(x=1.0))).rows
    assert [row[:2] for row in rows] == [
        (f"north {a}°,\nsouth {b}°", "torque_x") for a, b in ((0, 0), (45, -45))
    ]


@pytest.mark.slow
def test_worst_margins_of_poses_name_the_worst(small):
    poses = [{"north": np.radians(a), "south": np.radians(-a)} for a in (0.0, 60.0)]
    plants = bc.plant(small, ["torque:bus"], ["attitude"], pose=poses)
    uncertain = bc.spec.UncertainCraft(
        body={"bus": bc.spec.UncertainBody(mass=bc.spec.Uncertainty(relative=0.05))}
    )
    found = robust.worst_margins(plants, uncertain, controller(x=1.0), samples=1)
    assert found.labels == plants.labels
    assert len(found) == len(list(found)) == 2
    least = [each.least().worst for each in found]
    assert found.worst.pose == plants.labels[int(np.argmin(least))]
    assert found[0].pose == plants.labels[0]
    assert found.stable
    assert {row[0] for row in found.table.rows} == {
        label.replace(", ", ",\n") for label in plants.labels
    }
    assert [each["pose"] for each in found.as_dict()["poses"]] == list(plants.labels)


# -- probable mistakes -----------------------------------------------------------------------------
def codes(warnings):
    return [getattr(text, "code", "") for text in warnings]


@pytest.mark.slow
def test_an_appendage_that_runs_through_the_craft_is_noted(embedded):
    """The south wing turned by half a turn; a boom across the top of the bus is fine."""
    turned = CRAFT.replace(YOKE.format("south", -0.9, -1, 1), YOKE.format("south", -0.9, 1, -1))
    assert turned != CRAFT
    assert not {"points-inward", "far-mount"} & set(codes(embedded.warnings))
    bending = WING.replace(modes=bc.Modes(xy=1))
    wings = {"north_root": bending, "south_root": bending}
    said = bc.embed(turned, wings, retime=False).warnings
    (inward,) = [text for text in said if getattr(text, "code", "") == "points-inward"]
    assert "the appendage at south_root" in inward
    across = CRAFT.replace(
        "</body></worldbody>", '<site name="top" pos="-0.5 0 1.3"/></body></worldbody>'
    )
    assert "points-inward" not in codes(bc.embed(across, {"top": bending}, retime=False).warnings)


@pytest.mark.slow
def test_a_place_in_other_units_is_noted():
    """A site at 0.5 m, in mm."""
    craft = CRAFT.replace(
        "</body></worldbody>", '<site name="far" pos="0 500 0"/></body></worldbody>'
    )
    said = bc.embed(craft, {"far": WING.replace(modes=bc.Modes(xy=1))}, retime=False).warnings
    (far,) = [text for text in said if getattr(text, "code", "") == "far-mount"]
    assert "far stands 500 m from the spacecraft's centre of mass" in far


@pytest.mark.slow
def test_a_single_pose_is_called_by_its_joints(small):
    made = bc.plant(small, ["torque:bus"], ["attitude"], pose={"north": np.radians(45.0)})
    assert made.pose == "north 45°"
    found = bc.margins(made, controller(x=1.0))
    assert found.pose == "north 45°"
    assert found.table.title.endswith("north 45°")
    assert bc.plant(small, ["torque:bus"], ["attitude"]).pose == ""
