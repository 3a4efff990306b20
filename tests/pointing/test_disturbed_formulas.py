"""Closed forms beside crafts that are disturbed: inputs of wheels and drives, their runs, and what
a budget says of them."""

from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.linalg import block_diag

import beamchain as bc
from beamchain import pointing
from beamchain.craft.modal_form import ModalForm
from beamchain.engine.linear import Linear
from beamchain.engine.operating_point import operating_point
from beamchain.pointing.pointing import Pointing
from beamchain.pointing.wheel_run import WheelRun
from pointing_doors import (
    amplitudes_in_record,
    appendages_of_craft,
    beyond_modes_kept,
    check_linear_in_speed,
    check_stable_craft,
    disturbed_craft,
    imbalances_of_wheels,
    load_of_snap,
    nutation_of_craft,
    plot_pointing,
    pointing_mode_table,
    pointing_table,
    run_wheel,
    settling_of_modes,
    torque_of_drive,
    wheel_inputs,
)

SPUN = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint name="free"/>
<inertial pos="0.1 0 0.05" mass="50" diaginertia="9 8 7"/>
<body name="rotor" pos="0.2 -0.1 0.4" euler="20 35 0"><joint name="rw" axis="0 0 1" damping="0.01"/>
<inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.2"/></body>
<body name="panel" pos="0 1 0"><joint name="drive" axis="0 1 0" stiffness="60" damping="0.9"/>
<inertial pos="0.2 0 0" mass="4" diaginertia="0.4 0.6 0.7"/></body></body></worldbody>
<sensor><subtreeangmom name="momentum" body="bus"/></sensor></mujoco>"""


def compiled(text=SPUN):
    return mujoco.MjModel.from_xml_string(text)


# -- what a file states ----------------------------------------------------------------------------
def harmonic(order, **given):
    return pointing.WheelHarmonic(order=order, **{"radial_force": 1.0} | given)


def test_equal_orders_add_up_and_what_does_nothing_is_left_out():
    wheel = pointing.WheelDisturbance(
        joint="rw", speeds=(1.0, 2.0), static=2.0, dynamic=3.0,
        harmonic=(
            harmonic(1.0, radial_force=5.0, radial_torque=7.0, axial_force=11.0),
            harmonic(2.0, radial_force=0.0, axial_force=13.0),
            harmonic(3.0, radial_force=0.0),
        ),
    )  # fmt: skip
    found = [(o.order, o.radial_force, o.radial_torque, o.axial_force) for o in wheel.orders]
    assert found == [(1.0, 7.0, 10.0, 11.0), (2.0, 0.0, 0.0, 13.0)]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"speeds": (2.0, 2.0)}, ""),
        ({"speeds": (2.1, 2.0)}, "is no range"),
        ({"speeds": (0.0, 0.0)}, "is no range"),
        ({"speeds": (-1.0, 0.0)}, ""),
        ({"speeds": (1.0, 2.0, 3.0)}, "is no range"),
        ({"harmonic": tuple(harmonic(1.0 + k) for k in range(40))}, ""),
        ({"harmonic": tuple(harmonic(1.0 + k) for k in range(41))}, "41 harmonics"),
        ({"static": 0.0}, "disturbs nothing"),
    ],
)
def test_ranges_and_orders_of_a_wheel(given, words):
    given = {"joint": "rw", "speeds": (1.0, 2.0), "static": 1.0} | given
    if words:
        with pytest.raises(bc.InputError, match=words):
            pointing.WheelDisturbance(**given)
    else:
        pointing.WheelDisturbance(**given)


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ({"step": 0.1}, True),
        ({"step": 0.1, "torque": 1.0, "width": 0.1}, False),
        ({"torque": 1.0}, False),
        ({"width": 0.1, "step": 0.1}, False),
        ({"torque": 1.0, "width": 0.5}, False),  # as long as the time between steps
        ({"torque": 1.0, "width": 0.499}, True),
    ],
)
def test_a_drive_has_steps_or_pulses_shorter_than_their_distance(given, kept):
    if kept:
        pointing.StepperDisturbance(joint="drive", rate=2.0, **given)
    else:
        with pytest.raises(bc.InputError, match="drive"):
            pointing.StepperDisturbance(joint="drive", rate=2.0, **given)


@pytest.mark.parametrize(
    ("frequency", "density", "words"),
    [
        ((1.0, 2.0), (1.0, 1e-12), ""),
        ((1.0,), (1.0,), "1 frequencies and 1 densities"),
        ((1.0, 2.0, 3.0), (1.0, 1.0), "3 frequencies and 2 densities"),
        ((1.0, 1.0), (1.0, 1.0), "goes from 1 to 1 Hz"),
        ((1.0, 2.0), (1.0, 0.0), "density = 0"),
    ],
)
def test_a_density_is_positive_at_ascending_frequencies(frequency, density, words):
    def made():
        return pointing.NoiseDisturbance(input="torque:bus", frequency=frequency, density=density)

    if words:
        with pytest.raises(bc.InputError, match=words):
            made()
    else:
        assert made().density == density


def test_sources_of_one_name_are_numbered():
    noise = pointing.NoiseDisturbance(input="torque:bus", frequency=(1.0, 2.0), density=(1.0, 1.0))
    drive = pointing.StepperDisturbance(joint="drive", rate=2.0, step=0.1)
    made = pointing.Disturbances(psd=(noise, noise), stepper=(drive,))
    assert [name for name, _ in made.named] == [
        "stepper drive", "psd torque:bus 1", "psd torque:bus 2",
    ]  # fmt: skip


# -- a craft with a wheel at any speed -------------------------------------------------------------
def test_inputs_of_a_wheel_push_its_mass_centre_along_its_axis_and_across():
    point = operating_point(compiled(), None, None)
    found = wheel_inputs(point, "rw")
    data = point.data()
    body, axis = point.model.body("rotor").id, data.xaxis[1]
    forces, torques = (np.array([one.wrench for one in part]) for part in (found[:3], found[3:]))
    lines = forces[:, :3]
    np.testing.assert_allclose(lines @ lines.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(lines) == pytest.approx(1.0)
    np.testing.assert_allclose(lines[2], axis, atol=1e-12)
    arm = data.subtree_com[body] - data.xipos[body]
    np.testing.assert_allclose(forces[:, 3:], np.cross(arm, lines), atol=1e-12)
    np.testing.assert_allclose(torques[:, 3:], lines, atol=1e-12)
    assert not torques[:, :3].any()
    assert all(one.body == body for one in found)
    slide = SPUN.replace('name="rw" axis', 'name="rw" type="slide" axis')
    point = operating_point(compiled(slide), None, None)
    with pytest.raises(bc.InputError, match="no hinge"):
        wheel_inputs(point, "rw")
    with pytest.raises(bc.InputError, match="unknown"):
        wheel_inputs(point, "free")


def test_a_craft_is_linear_in_the_speed_of_its_wheel():
    """Against the craft linearised at that speed."""
    model = compiled()
    wheel = pointing.WheelDisturbance(joint="rw", speeds=(-30.0, 20.0), static=1.0)
    drive = pointing.StepperDisturbance(joint="drive", rate=2.0, step=0.1)
    sources = pointing.Disturbances(wheel=(wheel,), stepper=(drive,))
    outputs = ["attitude", "momentum"]
    whole = disturbed_craft(model, sources, outputs, None, {"rw": 4.0})
    assert whole.faster == {"rw": -30.0}
    assert whole.drives == ((0, 1, 2, 3, 4, 5), (6,))
    spinning = whole.spinning(0, "rw")
    for speed in (11.0, -7.0):
        craft = whole.of_wheel(0, "rw", speed)
        truth = Linear.of(model, [], outputs, rates={"rw": speed})
        np.testing.assert_allclose(craft.linear.damping, truth.damping, atol=1e-7)
        np.testing.assert_allclose(craft.linear.outputs.rate, truth.outputs.rate, atol=1e-7)
        np.testing.assert_allclose(craft.linear.outputs.position, truth.outputs.position, atol=1e-6)
        dof = int(model.joint("rw").dofadr[0])
        assert craft.point.qvel[dof] == speed
        a, b, c, d = craft.linear.first_order()
        (a0, b0, c0, d0), (a1, c1) = spinning
        s = 0.4 + 2.0j
        eye = np.eye(len(a))
        wanted = c @ np.linalg.solve(s * eye - a, b) + d
        states = np.linalg.solve(s * eye - a0 - speed * a1, b0)
        np.testing.assert_allclose((c0 + speed * c1) @ states + d0, wanted, rtol=1e-6, atol=1e-9)
    alone = whole.of_source(1).linear.inputs
    assert [signal.name for signal in alone.signals] == ["drive_torque"]
    wanted = np.zeros((model.nv, 1))
    wanted[int(model.joint("drive").dofadr[0])] = 60.0
    np.testing.assert_allclose(alone.force, wanted)


def test_pulses_push_a_joint_and_steps_its_spring():
    point = operating_point(compiled(), None, None)
    dof = int(point.model.joint("drive").dofadr[0])
    for given, size in (({"step": 0.1}, 60.0), ({"torque": 2.0, "width": 0.1}, 1.0)):
        source = pointing.StepperDisturbance(joint="drive", rate=2.0, **given)
        signal, force = torque_of_drive(point, source)
        assert signal.name == "drive_torque"
        assert force[dof] == size
        assert np.count_nonzero(force) == 1
    text = SPUN.replace('stiffness="60"', 'stiffness="1e-3"')
    soft = operating_point(compiled(text), None, None)
    source = pointing.StepperDisturbance(joint="drive", rate=2.0, step=0.1)
    assert torque_of_drive(soft, source)[1][dof] == 1e-3
    with pytest.raises(bc.InputError, match="neither"):
        torque_of_drive(point, pointing.StepperDisturbance(joint="rw", rate=2.0, step=0.1))


WARM = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="50" diaginertia="9 8 7"/>
<body name="boom"><joint name="boom_hinge1_xy" axis="0 0 1"/>
<inertial pos="0.5 0 0" mass="1" diaginertia="1 1 1"/></body>
<body name="near" euler="10 0 20"><joint name="arm_hinge1_xz" axis="0 -1 0"/>
<joint name="arm_hinge1_xy" axis="0 0 1"/><inertial pos="0.5 0 0" mass="1" diaginertia="1 1 1"/>
<body name="far" pos="1.2 0 0"><joint name="arm_hinge2_xy" axis="0 0 1"/>
<inertial pos="0.3 0 0" mass="1" diaginertia="1 1 1"/><site name="arm_tip" pos="0.7 0.1 0.2"/>
</body></body></body></worldbody></mujoco>"""
ROWS = np.array([[0.0] * 6 + [5.0, 0, 0, 0], [0.0] * 6 + [7.0, -2.0, 3.0, 0.4]])


def craft_in_the_sun():
    model = compiled(WARM)
    random = np.random.default_rng(5).normal(size=(model.nv, model.nv))
    return SimpleNamespace(
        point=operating_point(model, None, None),
        names=("boom_mode1_xy", "arm_mode2_xy"),
        rows=ROWS,
        linear=SimpleNamespace(stiffness=random @ random.T + 30.0 * np.eye(model.nv)),
    )


def test_a_thermal_moment_is_a_torque_on_every_hinge_of_its_plane():
    snap = pointing.ThermalSnap(appendage="arm", port="xy", moment=0.3, time_constant=1.0)
    signal, force = load_of_snap(craft_in_the_sun(), snap, ())
    assert signal.name == "arm_thermal_xy"
    assert force.tolist() == [0.0] * 8 + [0.3, 0.3]


def test_a_snap_in_a_mode_holds_its_appendage_in_the_mode_s_load():
    """K q = f with the root held; the site, and so all of the load, moves as far as is stated."""
    craft = craft_in_the_sun()
    snap = pointing.ThermalSnap(appendage="arm_", mode=2, displacement=0.02, time_constant=1.0)
    _, force = load_of_snap(craft, snap, ())
    bent = np.zeros(10)
    bent[7:] = np.linalg.solve(craft.linear.stiffness[7:, 7:], ROWS[1, 7:])
    at_site = np.zeros((3, 10))
    model, data = craft.point.model, craft.point.data()
    mujoco.mj_jacSite(model, data, at_site, None, model.site("arm_tip").id)
    np.testing.assert_allclose(
        force, ROWS[1] * 0.02 / np.linalg.norm(at_site @ bent), rtol=1e-12, atol=0.0
    )


def test_the_tip_of_a_known_beam_is_its_own(monkeypatch):
    """Not that of another appendage, and not that of an imported one, which is a site."""
    tip = np.array([0.0] * 7 + [0.3, -0.8, 1.1])
    monkeypatch.setattr(
        "beamchain.pointing.disturbed_craft.tip_displacement",
        lambda _, appendage, port: tip if (appendage.own, port) == (True, "xy") else 9.0 * tip,
    )
    craft = craft_in_the_sun()
    known = [
        SimpleNamespace(prefix=prefix, own=own, fit=SimpleNamespace(space=space))
        for prefix, own, space in (
            ("boom_", False, None), ("arm_", False, "imported"), ("arm_", True, None),
        )
    ]  # fmt: skip
    snap = pointing.ThermalSnap(appendage="arm_", mode=2, displacement=0.02, time_constant=1.0)
    bent = np.zeros(10)
    bent[7:] = np.linalg.solve(craft.linear.stiffness[7:, 7:], ROWS[1, 7:])
    _, force = load_of_snap(craft, snap, known)
    np.testing.assert_allclose(force, ROWS[1] * 0.02 / abs(tip @ bent), rtol=1e-12, atol=0.0)


@pytest.mark.parametrize(("off", "refused"), [(0.9e-6, False), (1.1e-6, True)])
def test_outputs_that_do_not_grow_with_a_wheel_s_speed_are_refused(off, refused):
    """By 1e-6 of the output's largest slope."""
    one = Linear.of(compiled(), outputs=["attitude"])

    def at(rate):
        outputs = one.outputs._replace(rate=rate, acceleration=np.zeros_like(rate))
        return SimpleNamespace(outputs=outputs)

    still = np.ones((3, 8))
    middle = 2.0 * still
    middle[1, 2] += 2.0 * off
    crafts = [replace(one, outputs=at(rate).outputs) for rate in (still, 3.0 * still, middle)]
    if refused:
        with pytest.raises(bc.InputError, match="attitude_y"):
            check_linear_in_speed("rw", *crafts)
    else:
        check_linear_in_speed("rw", *crafts)


# -- what a budget says ----------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("static", "dynamic", "count"), [(4.9e-4, 1.9e-4, 0), (5.1e-4, 0.0, 1), (0.0, 2.1e-4, 1)]
)
def test_a_wheel_is_no_farther_off_than_wheels_are(static, dynamic, count):
    """1e-4 m of its 5 kg, and 1e-3 rad of its 0.2 kg m^2."""
    wheel = pointing.WheelDisturbance(joint="rw", speeds=(1.0, 2.0), static=static, dynamic=dynamic)
    found = imbalances_of_wheels(compiled(), SimpleNamespace(wheel=(wheel,)))
    assert len(found) == count
    if static > 5e-4:
        assert "its 5 kg 0.0001 m off" in found[0]
    if dynamic > 2e-4:
        assert "by 0.0011 rad" in found[0] or "by 0.001 rad" in found[0]


@pytest.mark.parametrize(
    ("speed", "top", "words"),
    [
        (-3.3, 0.1, ""),
        (-3.4, 0.1, "reach 10.2 rad/s, the modes kept end at 10 rad/s"),
        (1.0, 1.6, "reach 10.05 rad/s"),
        (1.0, 1.59, ""),
    ],
)
def test_what_disturbs_above_the_modes_kept_is_told(speed, top, words):
    """Three times the speed; fillers are no modes that were kept."""
    craft = SimpleNamespace(
        mode_names=("a_mode1_xy", "a_mode2_xy", "a_filler1_xy"),
        modes=SimpleNamespace(frequency=np.array([4.0, 10.0, 99.0])),
    )
    orders = (SimpleNamespace(order=1.0), SimpleNamespace(order=3.0))
    wheel = SimpleNamespace(speeds=(speed, 0.5), orders=orders)
    noise = SimpleNamespace(frequency=(0.1, 0.2, top))
    given = SimpleNamespace(wheel=(wheel,), psd=(noise,))
    found = beyond_modes_kept(SimpleNamespace(craft=craft), given)
    assert len(found) == bool(words)
    assert not words or words in found[0]


def test_snaps_and_drives_alone_reach_no_modes_however_slow():
    modes = SimpleNamespace(frequency=np.array([0.01, 0.05]))
    whole = SimpleNamespace(craft=SimpleNamespace(mode_names=("a_mode1", "a_mode2"), modes=modes))
    assert beyond_modes_kept(whole, SimpleNamespace(wheel=(), psd=())) == []


@pytest.mark.parametrize(
    ("real", "size", "refused"),
    [(1.1e-6, 1.0, True), (0.9e-6, 1.0, False), (0.5, 4.4e-6, True), (0.5, 3.4e-6, False)],
)
def test_a_craft_whose_motion_grows_has_no_budget(real, size, refused):
    """By 1e-6 of its frequency, unless it is rigid: below 1e-6 of the fastest."""
    slow = size * np.array([[real, 1.0], [-1.0, real]])
    a = block_diag(slow, [[-4.0]])
    linear = SimpleNamespace(first_order=lambda: (a, None, None, None))
    whole = SimpleNamespace(craft=SimpleNamespace(linear=linear))
    if refused:
        with pytest.raises(bc.InputError, match="unstable"):
            check_stable_craft(whole)
    else:
        check_stable_craft(whole)


def error_of(name, ape, rpe, shares, speed=None):
    index = [SimpleNamespace(rms=np.array(peak) / 2.0, peak=np.array(peak)) for peak in (ape, rpe)]
    return SimpleNamespace(name=name, ape=index[0], rpe=index[1], speed=speed, shares=shares)


def test_errors_of_all_sources_and_the_mode_that_each_comes_from():
    """An error of 1e-9 of the largest of its unit is rounding, and comes from none; a slow one
    does not deviate from its mean, but comes from a mode."""
    slow = error_of("slow", [3.0, 1e-9], [0.0, 9.0], ({"one": 0.8}, {"two": 0.7}))
    wheel = error_of(
        "wheel", [1.0, 5.0], [4.0, 6.0], ({}, {"three": 0.6, "one": 0.4}), np.array([7.0, 8.0])
    )
    all_of = error_of("", [4.0, 5.0], [4.0, 6.0], None)
    found = pointing_table(
        SimpleNamespace(
            sources=(slow, wheel), outputs=("a", "b"), units=("rad", "rad"), window=1.0,
            ape=all_of.ape, rpe=all_of.rpe,
        )
    )  # fmt: skip
    columns = {column.key: list(column.values) for column in found.columns}
    assert columns["source"] == ["slow", "slow", "wheel", "wheel", "all", "all"]
    assert columns["output"] == ["a", "b"] * 3
    assert columns["ape_peak"] == [3.0, 1e-9, 1.0, 5.0, 4.0, 5.0]
    assert columns["rpe_peak"] == [0.0, 9.0, 4.0, 6.0, 4.0, 6.0]
    assert columns["speed"] == [None, None, 7.0, 8.0, None, None]
    modes = [text.partition(" ")[0] for text in found.columns[-1].values]
    assert modes == ["one", "", "", "three", "", ""]


def test_up_to_five_modes_of_a_hundredth_and_more_are_listed():
    """Of what is more than rounding."""
    shares = {"one": 0.6, "two": -0.2, "three": 0.3, "four": 0.011, "five": 0.0099, "six": 0.02}
    one = error_of("drive", [3.0, 1e-9], [0.0, 0.0], (shares, {"seven": 1.0}))
    two = error_of("wheel", [1.0, 5.0], [0.0, 0.0], ({}, {"eight": 0.7}))
    found = pointing_mode_table(
        SimpleNamespace(sources=(one, two), outputs=("a", "b"), units=("rad", "rad"))
    )
    columns = [list(column.values) for column in found.columns]
    assert [column.key for column in found.columns] == ["source", "output", "mode", "share"]
    assert columns == [
        ["drive"] * 4 + ["wheel"],
        ["a"] * 4 + ["b"],
        ["one", "two", "three", "four", "eight"],
        [0.6, -0.2, 0.3, 0.011, 0.7],
    ]


def test_appendages_are_read_where_the_displacement_of_a_tip_asks_for_them(monkeypatch):
    marked = {"marked": ("craft", ("arm",)), "plain": None}
    monkeypatch.setattr("beamchain.pointing.pointing.marked_appendages", marked.get)
    moved = SimpleNamespace(snap=(SimpleNamespace(displacement=0.1),))
    assert appendages_of_craft("marked", moved) == ("arm",)
    assert appendages_of_craft("plain", moved) == ()
    assert appendages_of_craft(compiled(), moved) == ()
    heated = SimpleNamespace(snap=(SimpleNamespace(displacement=None),))
    assert appendages_of_craft("marked", heated) == ()


@pytest.mark.parametrize(
    ("source", "output", "chosen"),
    [
        (None, None, ("wheel a", 2)),
        ("wheel b", None, ("wheel b", 2)),
        (None, "a", ("wheel b", 0)),
        (None, "b", ("wheel a", 1)),
        ("wheel b", "b", ("wheel b", 1)),
    ],
)
def test_a_run_is_of_the_largest_error_of_any_wheel(source, output, chosen, monkeypatch):
    """Among outputs of the unit of the first; noise is no wheel."""
    monkeypatch.setattr(
        "beamchain.pointing.pointing._simulate", lambda whole, *what: (what[0], what[2], what[1])
    )
    wheels = {
        name: pointing.WheelDisturbance(joint=name[-1], speeds=(1.0, 2.0), static=1e-5)
        for name in ("wheel a", "wheel b")
    }
    noise = pointing.NoiseDisturbance(input="force", frequency=(0.2, 1.0), density=(1e-3, 1e-3))
    peaks = {"wheel a": [1.0, 99.0, 3.0], "noise": [7.0, 700.0, 7.0], "wheel b": [2.0, 98.0, 2.5]}
    errors = tuple(error_of(name, each, each, None) for name, each in peaks.items())
    given = SimpleNamespace(named=[*wheels.items(), ("noise", noise)])
    budget = Pointing(
        ("a", "b", "c"), ("rad", "m", "rad"), 1.0, errors, errors[0].ape, errors[0].rpe, (),
        None, given,
    )  # fmt: skip
    assert budget.simulate(source, output) == (*chosen, wheels[chosen[0]])


def errors_over(speed, *peaks):
    curve = SimpleNamespace(speed=np.array(speed), ape_peak=np.array(peaks).T)
    return SimpleNamespace(name=f"wheel {speed[-1]:g}", curve=curve)


def pictured(*sources):
    ax = Figure().add_subplot()
    budget = SimpleNamespace(sources=sources, outputs=("x", "y"), units=("rad", "rad"))
    assert plot_pointing(budget, ax) is ax
    return ax


@pytest.mark.parametrize(("low", "scale"), [(0.9, "log"), (1.1, "linear"), (-3.0, "linear")])
def test_a_picture_of_errors_has_a_curve_for_each_output_and_a_dot_at_its_top(low, scale):
    """An output that nothing moves has none; a range of ten and more is logarithmic."""
    one = errors_over([low, 5.0, 10.0], [3.0, 1.0, 2.0], [4.0, 7.0, 6.0])
    other = errors_over([low, 4.0], [0.0, 0.0], [8.0, 9.0])
    alone = pictured(one, SimpleNamespace(curve=None))
    lines = [line.get_xydata().tolist() for line in alone.get_lines()]
    first, second = [[low, 3.0], [5.0, 1.0], [10.0, 2.0]], [[low, 4.0], [5.0, 7.0], [10.0, 6.0]]
    assert lines == [first, [[low, 3.0]], second, [[5.0, 7.0]]]
    assert alone.get_legend_handles_labels()[1] == ["x", "y"]
    assert alone.get_xscale() == scale
    both = pictured(one, other)
    assert both.get_legend_handles_labels()[1] == ["wheel 10, x", "wheel 10, y", "wheel 4, y"]
    assert both.get_lines()[-1].get_xydata().tolist() == [[4.0, 9.0]]
    styles = [line.get_linestyle() for line in both.get_lines()[::2]]
    assert styles[0] == styles[1] != styles[2]


def craft_of(modes):
    a = block_diag(*([[0.0, 1.0], [-(w**2), -2.0 * ratio * w]] for _, w, ratio in modes))
    names = tuple(word for name, *_ in modes for word in (name, f"{name}_rate"))
    n = len(names)
    ones = np.ones((n, 1)), np.ones((1, n)), np.zeros((1, 1))
    form = ModalForm(a, *ones, names, ("",) * n, np.ones(n), (0, 0))
    return SimpleNamespace(form=lambda: form)


def test_a_run_waits_for_the_mode_that_has_the_largest_share():
    """1 / (zeta w); of those that decay, the slowest, where no share has one."""
    craft = craft_of([("one", 4.0, 0.05), ("two", 9.0, 0.01), ("three", 3.0, 0.0)])
    assert settling_of_modes(craft, {"one": 0.7, "two": 0.3}) == pytest.approx(1.0 / 0.2)
    assert settling_of_modes(craft, {"three": 0.7, "two": 0.3}) == pytest.approx(1.0 / 0.09)
    assert settling_of_modes(craft, {"rigid motion": 1.0}) == pytest.approx(1.0 / 0.09)
    hardly = craft_of([("one", 4.0, 0.05), ("two", 9.0, 0.9e-6)])
    assert settling_of_modes(hardly, {"rigid motion": 1.0}) == pytest.approx(1.0 / 0.2)
    assert settling_of_modes(craft_of([("three", 3.0, 0.0)]), {"three": 1.0}) == 0.0


# -- runs ------------------------------------------------------------------------------------------
def test_amplitudes_of_driven_frequencies_in_a_record_that_drifts():
    t = 3.0 + np.linspace(0.0, 40.0, 3000)
    record = 0.3 * np.cos(2.0 * t) - 0.4 * np.sin(2.0 * t) + 1.2 * np.sin(5.0 * t)
    record += 7.0 - 0.3 * t + 2.0 * np.cos(3.3 * t)
    assert amplitudes_in_record(t, record, [2.0, 5.0], [3.3]) == pytest.approx([0.5, 1.2])


def test_nutation_and_the_difference_of_a_run():
    turning = craft_of([("one", 4.0, 0.05), ("nutation_1", 0.7, 0.1)])
    assert nutation_of_craft(turning) == pytest.approx([0.7])
    assert WheelRun("", "", 1.0, 2.0, 2.5, (), None, None, 0.1).difference == 0.25
    assert np.isnan(WheelRun("", "", 1.0, 0.0, 2.5, (), None, None, 0.1).difference)


SPRING = """<mujoco><option gravity="0 0 0"/><worldbody><body name="mass">
<joint name="slide" type="slide" axis="1 0 0" stiffness="32" damping="0.8"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody></mujoco>"""


def pushed_craft():
    """The mass on its spring, pushed along x, y and z; its place is the second output."""
    model = compiled(SPRING)
    craft = craft_of([("a", 1.0, 0.1)])
    craft.point, craft.linear = operating_point(model, None, None), Linear.of(model, ["force:mass"])
    craft.outputs = [
        SimpleNamespace(read=lambda data: np.array([data.time])),
        SimpleNamespace(read=lambda data: data.qpos + 0.7),
    ]
    return craft


def test_a_run_of_two_orders_measures_their_amplitudes():
    """F / |k - m w^2 + j d w| of each, from rest; forty steps of the shortest period."""
    craft = pushed_craft()
    acting = np.array([[0.4 - 0.3j, 9.0, 0.0], [2.0j, 0.0, 7.0]])  # along x, and across
    times, values, found, step = run_wheel(craft, np.array([3.0, 9.0]), acting, 1, 5.0)
    assert step == pytest.approx(2.0 * np.pi / 360.0)
    assert times.size == values.size == int(np.ceil(40.0 * np.pi / 3.0 / step))
    assert times[0] == pytest.approx(step * (int(np.ceil(25.0 / step)) + 1))
    wanted = [size / abs(32.0 - 2.0 * w**2 + 0.8j * w) for size, w in ((0.5, 3.0), (2.0, 9.0))]
    assert found == pytest.approx(wanted, rel=5e-3)
    settled = sum(
        (size * np.exp(1j * w * times) / (32.0 - 2.0 * w**2 + 0.8j * w)).real
        for size, w in ((0.4 - 0.3j, 3.0), (2.0j, 9.0))
    )
    late = times > 45.0  # what began with the run has decayed
    np.testing.assert_allclose(values[late], settled[late], atol=0.01 * settled.max())
    one = np.array([[1.0, 0.0, 0.0]])
    count = int(np.ceil(5e7 / 0.5)) + int(np.ceil(40.0 * np.pi / 1e-3 / 0.5))
    with pytest.raises(bc.InputError, match=f"take {count} steps of 0.5 s"):
        run_wheel(craft, np.array([1e-3]), one, 1, 1e7)
    with pytest.raises(bc.InputError, match="more than the 2000000 taken"):
        run_wheel(craft, np.array([1e-4]), one, 1, 1.0)


def test_a_run_pushes_with_nothing_but_the_orders_of_its_wheel():
    """An order that pushes across the spring leaves the mass at rest."""
    across = np.array([[0.0, 1.0j, 2.0]])
    _, values, found, _ = run_wheel(pushed_craft(), np.array([9.0]), across, 1, 0.1)
    assert np.abs(values).max() < 1e-9
    assert found == pytest.approx([0.0], abs=1e-9)
