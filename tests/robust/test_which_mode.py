"""Which mode a margin belongs to, which modes a plant leaves out, and what a margin above the kept
modes of its own axis says; what is probably a mistake of the user.

Tests a table as well, `margin_table`, which the command prints."""

import re

import control
import msgspec
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
    found = bc.margins(plant, controller(x=1.0, y=1.0))
    loop = next(loop for loop in found.loops if loop.input == "torque_y")
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
    answer = call("plant", file, "--input", "torque:bus", "--output", "attitude", "-o",
                  tmp_path / "p.npz", "--no-report")  # fmt: skip
    words = " ".join(answer.out.split())
    assert f"no output sees them: {', '.join(plant.unreached)}" in words


@pytest.mark.slow
def test_a_pose_of_several_stands_in_a_column(embedded):
    poses = [{"north": np.radians(a), "south": np.radians(-a)} for a in (0.0, 45.0)]
    plants = bc.plant(embedded, ["torque:bus"], ["attitude"], pose=poses)
    rows = margin_table(bc.margins(plants, controller(x=1.0, z=1.0))).rows
    assert [row[:2] for row in rows] == [
        (f"north {a}°,\nsouth {b}°", f"torque_{axis}")
        for a, b in ((0, 0), (45, -45))
        for axis in "xz"
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    "gains",
    [
        pytest.param({"x": 1.0}, marks=pytest.mark.slow),
        {"x": 1.0, "z": 1.0},
        pytest.param({"x": 1.2, "y": 0.9, "z": 1.0}, marks=pytest.mark.slow),
    ],
)
def test_all_loops_at_once_are_never_better_than_one(plant, gains):
    """The nominal figures are those of `bc.margins`, for one loop alone too."""
    uncertain = robust.uncertain(
        plant,
        bc.spec.UncertainCraft(
            body={"bus": bc.spec.UncertainBody(mass=bc.spec.Uncertainty(relative=0.05))}
        ),
    )
    loops = controller(**gains)
    found = uncertain.worst_margins(loops, samples=2)
    known = bc.margins(plant, loops)
    disks = [row for row in found.margins if row.kind == "disk" and row.at != found[-1].at]
    assert len(disks) == len(gains)
    at_once = found.all_at_once
    # loops of different axes hardly couple: they are equal then, but for rounding
    assert at_once.nominal <= min(row.nominal for row in disks) * (1.0 + 1e-9)
    assert at_once.worst <= min(row.worst for row in disks) * (1.0 + 1e-9)
    np.testing.assert_allclose(at_once.nominal, known.all_at_once.value, rtol=1e-6)
    np.testing.assert_allclose(
        [row.nominal for row in disks], [loop.disk for loop in known.loops], rtol=1e-6
    )


@pytest.mark.slow
def test_worst_margins_of_poses_name_the_worst(embedded):
    poses = [{"north": np.radians(a), "south": np.radians(-a)} for a in (0.0, 60.0)]
    plants = bc.plant(embedded, ["torque:bus"], ["attitude"], pose=poses)
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


@pytest.mark.slow  # the reason of many growing poles
def test_a_delay_in_milliseconds_is_noted(plant):
    """0.15 s is a small part of the period at the crossover, 150 s more than all of it."""
    good = controller(x=1.0)
    late = msgspec.structs.replace(good.loop[0], delay=150.0)
    wrong = msgspec.structs.replace(good, loop=(late, *good.loop[1:]))
    assert codes(bc.margins(plant, good).warnings) == []
    found = bc.margins(plant, wrong)
    assert codes(found.warnings) == ["long-delay"]
    assert "torque_x: delay = 150 s" in found.warnings[0]
    # the period it states is that at which the loop has the gain 1
    period = float(re.search(r"crossover \(([\d.]+) s", found.warnings[0])[1])
    s = 2j * np.pi / period
    channel = plant.output_names.index("attitude_x"), plant.input_names.index("torque_x")
    law = np.polyval(good.loop[0].numerator, s) / np.polyval(good.loop[0].denominator, s)
    assert abs(abs(law * plant(s)[channel]) - 1.0) < 0.03


@pytest.mark.slow
def test_a_wrong_sign_is_asked_for(plant):
    wrong = bc.margins(plant, controller(x=-1.0))
    assert any("is the sign of the numerators right?" in i.sentence for i in wrong.instabilities)


@pytest.mark.slow
def test_the_sign_of_a_late_loop_is_not_asked_for(plant):
    late = bc.margins(plant, controller(x=100.0))
    assert late.instabilities
    assert not any("sign of the numerators" in one.sentence for one in late.instabilities)


@pytest.mark.slow
def test_an_appendage_that_runs_through_the_craft_is_noted(embedded):
    """The south wing turned by half a turn; a boom across the top of the bus is fine."""
    turned = CRAFT.replace(YOKE.format("south", -0.9, -1, 1), YOKE.format("south", -0.9, 1, -1))
    assert turned != CRAFT
    assert "points-inward" not in codes(embedded.warnings)
    bending = msgspec.structs.replace(WING, modes=bc.Modes(xy=1))
    wings = {"north_root": bending, "south_root": bending}
    said = bc.embed(turned, wings, retime=False).warnings
    (inward,) = [text for text in said if getattr(text, "code", "") == "points-inward"]
    assert "the appendage at south_root" in inward
    across = CRAFT.replace(
        "</body></worldbody>", '<site name="top" pos="-0.5 0 1.3"/></body></worldbody>'
    )
    assert "points-inward" not in codes(bc.embed(across, {"top": bending}, retime=False).warnings)


@pytest.mark.parametrize(("place", "noted"), [(500.0, True), (15.0, False)])
@pytest.mark.slow
def test_a_place_in_other_units_is_noted(place, noted):
    """A site at 0.5 m, in mm; and one on a long arm, which is meant."""
    craft = CRAFT.replace(
        "</body></worldbody>", f'<site name="far" pos="0 {place} 0"/></body></worldbody>'
    )
    said = bc.embed(craft, {"far": WING}, retime=False).warnings
    far = [text for text in said if getattr(text, "code", "") == "far-mount"]
    assert len(far) == noted
    assert not far or f"far stands {place:.4g} m from the spacecraft's centre of mass" in far[0]


@pytest.mark.slow
def test_a_single_pose_is_called_by_its_joints(embedded, tmp_path):
    made = bc.plant(embedded, ["torque:bus"], ["attitude"], pose={"north": np.radians(45.0)})
    assert made.pose == "north 45°"
    found = bc.margins(made, controller(x=1.0))
    assert found.pose == "north 45°"
    assert found.table.title.endswith("north 45°")
    assert bc.plant(embedded, ["torque:bus"], ["attitude"]).pose == ""
