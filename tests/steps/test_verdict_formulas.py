"""Culprits, poles that a step shows, cures and draws, beside small models by hand."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from beamchain.steps.modal import TimingMark
from formulas import (
    FreeAppendage,
    Names,
    Setting,
    Tendons,
    TreeDraws,
    culprit,
    driven,
    elements_of_step,
    find_cure,
    growing_frequencies,
    inertia_words,
    mismatch,
    modes_of_tendons,
    phase_limit,
    pole_rows,
    round_down,
    run_of_turn,
    stable_step,
)

H = 0.05


def two_slides(joints, between, damper, *, integrator="implicitfast", servo=""):
    """Masses 2 and 5 on springs and dampers, a tendon between them."""
    (k, d), (other, drag) = joints
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="{H}" integrator="{integrator}"/><worldbody>
        <body><joint name="a" type="slide" axis="1 0 0" stiffness="{k}" damping="{d}"/>
        <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
        <body><joint name="b" type="slide" axis="1 0 0" stiffness="{other}" damping="{drag}"/>
        <inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/></body></worldbody>
        <tendon><fixed name="between" stiffness="{between}" damping="{damper}"
        springlength="0 0"><joint joint="a" coef="2"/><joint joint="b" coef="-1"/></fixed></tendon>
        <actuator>{servo}</actuator></mujoco>"""
    )


ROW = np.array([2.0, -1.0])
MASS = np.diag([2.0, 5.0])


def growing(k, explicit, implicit, mass=MASS):
    """The worst pole of a step, and its positions and rates."""
    left = np.linalg.inv(mass + H * implicit)
    faster = np.hstack([-H * left @ k, -H * left @ (explicit + implicit)])
    change = np.vstack([H * faster + np.hstack([np.zeros((2, 2)), H * np.eye(2)]), faster])
    values, vectors = np.linalg.eig(np.eye(4) + change)
    worst = np.argmax(np.abs(values))
    return abs(values[worst]), vectors[:2, worst], vectors[2:, worst]


@pytest.mark.parametrize(
    ("joints", "between", "damper"),
    [
        (((60.0, 0.2), (900.0, 0.1)), 900.0, 0.0),
        (((4000.0, 0.2), (900.0, 0.1)), 300.0, 0.5),
        (((60.0, 0.2), (900.0, 0.1)), 200.0, 30.0),
    ],
)
def test_what_carries_most_of_the_energy_of_what_grows(joints, between, damper):
    model = two_slides(joints, between, damper, integrator="Euler")
    found = culprit(model, np.zeros(2))
    springs, dampers = (np.array([joint[i] for joint in joints]) for i in (0, 1))
    tendon = np.outer(ROW, ROW)
    k = np.diag(springs) + between * tendon
    growth, shape, rate = growing(k, damper * tendon, np.diag(dampers))
    assert growth > 1.0
    energies = {
        "a": springs[0] * abs(shape[0]) ** 2,
        "b": springs[1] * abs(shape[1]) ** 2,
        "between": between * abs(ROW @ shape) ** 2,
    }
    damped = H * damper * abs(ROW @ rate) ** 2  # Euler takes those of joints at the end
    whole = energies | {"between": energies["between"] + damped}
    name = max(whole, key=whole.get)
    assert (found.name, found.kind) == (name, "spring")
    assert found.share == pytest.approx(whole[name] / sum(whole.values()), rel=1e-6)
    assert found.growth == pytest.approx(growth)
    # Rayleigh's quotient with masses of one
    root = np.diag([2.0, 5.0]) ** 0.5
    unit = np.diag(1.0 / np.diag(root))
    squares, turn = np.linalg.eigh(unit @ k @ unit)
    y = turn.T @ root @ shape
    assert found.frequency == pytest.approx(
        np.sqrt(squares @ np.abs(y) ** 2 / np.sum(np.abs(y) ** 2))
    )
    assert found.damps == (name == "between" and damped > energies["between"])
    assert found.moves == {"a": "2 kg", "b": "5 kg", "between": ""}[name]
    motions = growing_frequencies(model, np.zeros(2))
    assert np.min(np.abs(motions - found.frequency)) < 1e-6


@pytest.mark.parametrize(("armature", "named"), [(1.05, "drive"), (0.7, "wing_mode1_xy")])
def test_an_appendage_that_is_stable_without_the_springs_around_it_is_not_to_blame(armature, named):
    """It has most of the strain energy of what grows all the same."""
    k = np.array([6000.0, 30000.0])  # of the drive and of the mode behind it
    heavier = armature * k[1] * H**2 / 4.0  # stable whatever it stands on from 1 on
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="{H}"/><worldbody>
        <body><joint name="drive" type="slide" stiffness="{k[0]}"/>
        <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><body>
        <joint name="wing" type="slide"/><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>
        </body></body></worldbody><tendon><fixed name="wing_mode1_xy" stiffness="{k[1]}"
        armature="{heavier}" springlength="0 0"><joint joint="wing" coef="1"/></fixed></tendon>
        </mujoco>"""
    )
    mass, nothing = np.array([[7.0, 5.0], [5.0, 5.0 + heavier]]), np.zeros((2, 2))
    alone, *_ = growing(np.diag([0.0, k[1]]), nothing, nothing, mass)
    assert (alone > 1.01) == (named != "drive")
    growth, shape, _ = growing(np.diag(k), nothing, nothing, mass)
    energies = k * np.abs(shape) ** 2
    assert growth > 1.01
    assert energies[1] > 2.0 * energies[0]
    found = culprit(model, np.zeros(2))
    assert (found.name, found.growth) == (named, pytest.approx(growth))
    assert found.share == pytest.approx(energies[int(named != "drive")] / energies.sum())


def test_a_servo_is_named_by_its_joint_and_nothing_by_the_spacecraft():
    servo = '<position name="s" joint="a" kp="3000" kv="4" gear="2"/>'
    found = culprit(two_slides(((0, 0), (0, 0)), 0.0, 0.0, servo=servo), np.zeros(2))
    assert (found.name, found.kind, found.moves) == ("a", "servo", "2 kg")
    assert found.share == pytest.approx(1.0)
    heavy = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint type="slide" stiffness="1e9"/>
        <inertial pos="0 0 0" mass="40" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
    )
    assert culprit(heavy, np.zeros(1)).moves == "40 kg"
    none = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint type="slide"/>
        <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
    )
    found = culprit(none, np.zeros(1))
    assert (found.name, found.share, found.moves) == ("of the spacecraft", 0.0, "")


def test_what_holds_or_damps_little_is_an_element_too():
    servo = '<general name="s" joint="b" biastype="affine" biasprm="0 {} {}"/>'
    for position, rate in ((0.0, -0.04), (-0.04, 0.0), (-3.0, -0.04)):
        acts = servo.format(position, rate)
        found = elements_of_step(two_slides(((0, 0.03), (0.05, 0)), 0, 0, servo=acts), np.zeros(2))
        numbers = [(one.name, one.kind, one.stiffness, one.damping) for one in found]
        assert numbers == [
            ("a", "spring", 0.0, 0.03),
            ("b", "spring", 0.05, 0.0),
            ("between", "spring", 0.0, 0.0),
            ("b", "servo", -position, -rate),
        ]
        rows = np.array([one.row for one in found])
        assert rows.tolist() == [[1.0, 0.0], [0.0, 1.0], ROW.tolist(), [0.0, 1.0]]
    assert len(elements_of_step(two_slides(((0, 0), (0, 0)), 0, 0), np.zeros(2))) == 1


def test_a_hinge_moves_an_inertia():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint type="hinge"/>
        <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
    )
    assert inertia_words(model, 0, 0.12345) == "0.123 kg m^2"


@pytest.mark.parametrize(("limit", "step"), [(0.0371, 0.1), (0.0371, 0.04), (0.00123, 3.0)])
def test_a_stable_step_is_nine_tenths_of_the_largest_in_two_digits(limit, step):
    found = stable_step(lambda h: h > limit, step)
    # halves until nothing grows, then 64 parts of that
    low = step / 2.0 ** np.ceil(np.log2(step / limit))
    largest = low + np.floor((limit - low) / (low / 64.0)) * low / 64.0
    digits = 10.0 ** (np.floor(np.log10(0.9 * largest)) - 1.0)
    assert found == pytest.approx(np.floor(0.9 * largest / digits) * digits)


def test_a_step_that_grows_at_any_length_has_no_stable_one():
    assert stable_step(lambda h: True, 0.1) == 0.0
    assert stable_step(lambda h: h > 1e-6, 0.5) == pytest.approx(8.9e-7)
    assert stable_step(lambda h: h > 0.9e-6, 0.5) == 0.0


# -- poles -----------------------------------------------------------------------------------------
def timed(stiffness, armature, damping, mark, *, integrator="Euler", h=H):
    """A unit mass on a modal tendon that was made exact for a step."""
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="{h}" integrator="{integrator}"/><worldbody>
        <body><joint name="a" type="slide" axis="1 0 0"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody><tendon>
        <fixed name="x_mode1_xy" stiffness="{stiffness}" damping="{damping}" armature="{armature}"
        springlength="0 0" solimplimit="{mark}"><joint joint="a" coef="1"/></fixed></tendon>
        </mujoco>"""
    )


def exact_mass(turn):
    return (turn / 2.0 / np.sin(turn / 2.0)) ** 2


def test_an_undamped_mode_that_was_made_exact_shows_its_own_pole():
    w = 11.0
    model = timed(w**2, exact_mass(w * H) - 1.0, 0.0, f"{H} 0 2 0 {w**2}")
    (row,) = pole_rows(model)
    assert (row.frequency, row.achieved_frequency) == pytest.approx((w, w))
    assert (row.ratio, row.achieved_ratio) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert row.step_error < 1e-9
    assert not row.slowed
    assert phase_limit(model) == 2.6
    assert mismatch(model) == []
    # without timing: 2 asin(w h / 2)
    plain = timed(w**2, 0.0, 0.3, "0.9 0.95 0.001 0.5 2")
    (row,) = pole_rows(plain)
    left = np.roots([1.0, H**2 * w**2 + 0.3 * H - 2.0, 1.0 - 0.3 * H])
    s = np.log(left[np.argmax(left.imag)]) / H
    assert row.ratio == pytest.approx(0.15 / w)
    assert row.achieved_frequency == pytest.approx(abs(s))
    assert row.achieved_ratio == pytest.approx(-s.real / abs(s))
    exact = np.exp(H * complex(-0.15, np.sqrt(w**2 - 0.0225)))
    assert row.step_error == pytest.approx(np.min(np.abs(left - exact)) / abs(exact - 1.0))
    assert phase_limit(plain) == np.inf


def test_a_mode_that_was_slowed_tells_the_phase_limit():
    # shown at 2.2 rad per step: k h^2 / m = 4 sin^2 1.1
    for turn, limit in ((2.7, 2.2), (2.59, 2.6)):
        k = (turn / H) ** 2
        mass = turn**2 / (4.0 * np.sin(1.1) ** 2)
        model = timed(k, mass - 1.0, 0.0, f"{H} 0 2 0 {k}")
        assert phase_limit(model) == pytest.approx(limit)
        (row,) = pole_rows(model)
        assert row.slowed == (turn == 2.7)
        assert row.achieved_frequency == pytest.approx(2.2 / H)


def test_a_step_that_parts_a_pair_shows_the_larger():
    w = 2.2 / H
    (row,) = pole_rows(timed(w**2, 0.0, 0.0, "0.9 0.95 0.001 0.5 2"))
    z = np.roots([1.0, 2.2**2 - 2.0, 1.0])
    largest = z[np.argmax(np.abs(z))]
    assert row.achieved_frequency == pytest.approx(abs(np.log(complex(largest))) / H)
    assert row.achieved_ratio < 0.0


def test_what_another_step_makes_of_a_mode_is_said():
    w = 11.0
    k, more = w**2, exact_mass(w * H) - 1.0
    shorter = timed(k, more, 0.0, f"{H} 0 2 0 {k}", h=0.04)
    shown = 2.0 * np.arcsin(0.04 * w / 2.0 / np.sqrt(1.0 + more)) / 0.04
    (said,) = mismatch(shorter)
    assert f"off by up to {abs(shown / w - 1.0):.2g};" in said
    assert "made exact for Euler at 0.05 s, but the model runs Euler at 0.04 s" in said
    for turn, unstable in ((1.999, False), (2.001, True), (3.0, True)):  # w h; from 2 on it grows
        longer = timed(k, more, 0.0, f"{H} 0 2 0 {k}", h=turn * np.sqrt(1.0 + more) / w)
        assert ("that is unstable" in mismatch(longer)[0]) is unstable
    (said,) = mismatch(timed(k, more, 0.0, f"{H} 0 2 0 {k}", integrator="implicitfast"))
    assert "runs implicitfast at 0.05 s" in said
    assert mismatch(timed(k, more, 0.0, f"{H} 2 2 0 {k}", integrator="implicitfast")) == []


# -- cures -----------------------------------------------------------------------------------------
NAMES = Names("write {}", "step {}", "time it")
COST = {"Euler": 1.0, "implicitfast": 1.1, "RK4": 3.8}


def test_the_cheapest_integrator_at_the_same_step_cures_first():
    now = Setting("implicitfast", 0.02)
    errors = {"Euler": 0.03, "RK4": 0.001, "implicitfast": 0.04}
    found = find_cure(now, lambda s: errors[s.integrator] * bool(s.timestep), [], NAMES, 0.01)
    assert found.setting == Setting("RK4", 0.02)
    assert found.words.startswith("Write RK4: tried, the motion is then off by 1.00e-03, ")
    assert found.as_dict()["timestep"] == 0.02
    # a mode more costs 1.2, and RK4 3.8
    found = find_cure(
        now, lambda s: 0.0 if s.change else errors[s.integrator], ["Keep 3"], NAMES, 0.01
    )
    assert found.setting.change == "Keep 3"
    assert found.setting.cost == pytest.approx(1.1 * 1.2 / 0.02)


@pytest.mark.parametrize("tolerance", [0.01, None])
def test_a_shorter_step_is_the_largest_that_keeps_the_tolerance(tolerance):
    share = {"Euler": 1.0, "implicitfast": 4.0, "RK4": 300.0}
    limit = tolerance or 0.1

    def error(setting):
        return share[setting.integrator] * limit * (setting.timestep / 0.0031) ** 2

    found = find_cure(Setting("implicitfast", 0.2), error, [], NAMES, tolerance)
    assert found.setting.integrator == "Euler"
    step = found.setting.timestep
    assert error(found.setting) < limit / 1.01
    assert error(found.setting._replace(timestep=1.2 * step)) > limit
    assert found.words.startswith(f"Write Euler and step {step:g}: tried")
    assert find_cure(Setting("Euler", 0.2), lambda s: 1.0, [], NAMES, tolerance) is None
    # no step of less than 1e-4 of it
    short = find_cure(Setting("Euler", 0.2), lambda s: float(s.timestep > 1.9e-5), [], NAMES, 0.1)
    assert short is None


def test_a_change_and_a_shorter_step_cure_together():
    """More modes leave 4e-3 in continuous time, and a step of 0.005 s as much again."""

    def error(setting):
        return 1.0 if not setting.change else 4e-3 * (1.0 + (setting.timestep / 5e-3) ** 2)

    now = Setting("implicitfast", 0.02)
    found = find_cure(now, error, ["Keep 3"], NAMES, 0.01).setting
    assert found.change == "Keep 3"
    assert error(found) <= 0.01 < error(found._replace(timestep=1.2 * found.timestep))


def test_timing_that_was_refused_is_tried():
    now = Setting("Euler", 0.02, timing=False)
    found = find_cure(now, lambda s: 0.5 * (s.timing is False and s.timestep > 0), [], NAMES, 0.01)
    assert found.setting == Setting("Euler", 0.02, timing=None)
    assert found.words.startswith("Time it:")


def test_settings_cost_what_their_steps_and_modes_cost():
    assert Setting("RK4", 0.5).cost == pytest.approx(7.6)
    assert Setting("implicitfast", 0.0, None, "more").cost == pytest.approx(1.1 * 1.2)
    assert round_down(0.01999) == 0.019


# -- driven ----------------------------------------------------------------------------------------
def test_a_root_off_the_axis_feels_the_turn_that_speeds_up():
    spacing, spin, change = 1e-3, 0.8, 0.5
    time = spacing * np.arange(400)
    motion = np.zeros((400, 6))
    motion[:, 5] = spin * time + change * time**2 / 2.0
    motion[:, 1] = 0.7 * time**2
    offset = np.array([0.6, -0.4, 0.2])
    run = driven(motion, spacing, offset)
    # at every instant: acceleration of the centre in turned axes, w' x r and w x (w x r)
    rate = spin + change * time[1:-1]
    turned = motion[1:-1, 5]
    along = 1.4 * np.cos(turned) + change * offset[0] - rate**2 * offset[1]
    assert run.acceleration["xy"] == pytest.approx(np.max(np.abs(along)), rel=1e-5)
    assert run.acceleration["xz"] == pytest.approx(0.0, abs=1e-9)
    assert run.slew == pytest.approx({"xy": change, "xz": 0.0}, abs=1e-6)
    assert run.spin == pytest.approx(spin + change * (time[-1] - spacing / 2.0), rel=1e-6)


def test_a_turn_about_the_appendage_itself_does_not_spin_it():
    run = run_of_turn(0.7, 0.3, np.eye(3)[0], (0.5, 0.4, -0.6))
    # x cross r = (0, -z, y)
    assert run.spin == 0.0
    assert run.acceleration == pytest.approx({"xy": 0.3 * 0.6, "xz": 0.3 * 0.4})
    assert run.slew == {"xy": 0.0, "xz": 0.0}
    # about an axis between x and y only the part across spins it
    run = run_of_turn(0.7, 0.3, np.array([0.6, 0.8, 0.0]), (0.5, 0.4, -0.6))
    assert run.spin == pytest.approx(0.8 * 0.7)
    assert run.acceleration == pytest.approx(
        {"xy": 0.3 * 0.6 * 0.6, "xz": 0.3 * abs(0.6 * 0.4 - 0.8 * 0.5)}
    )
    assert run.slew == pytest.approx({"xy": 0.0, "xz": 0.3 * 0.8})
    run = run_of_turn(0.7, 0.3, np.eye(3)[1], (0.5, 0.4, -0.6))
    assert run.spin == 0.7
    assert run.acceleration == pytest.approx({"xy": 0.0, "xz": 0.3 * 0.5})
    assert run.slew == {"xy": 0.0, "xz": 0.3}


# -- trees -----------------------------------------------------------------------------------------
FREE = np.array([[0.5, 0.1], [0.1, 0.4]])


@pytest.mark.parametrize(
    ("integrator", "late", "limit"),
    [("Euler", 0.5, 0.25), ("implicitfast", -0.5, 0.25), ("RK4", 0.0, 0.125)],
)
def test_draws_of_a_tree_keep_their_factor_where_that_is_safe(integrator, late, limit):
    factor = np.array([0.05, 0.06, 0.04])
    nominal = np.array([80.0, 60.0, 50.0])
    softer, more = np.array([0.98, 1.0, 1.02]), np.array([1.1, 0.9, 1.2])
    gap = (factor - limit) * H**2 * softer * nominal
    parts = (
        FreeAppendage(np.array([0, 2]), FREE, FREE),
        FreeAppendage(np.array([1]), FREE[:1, :1], FREE[:1, :1]),
    )
    made = TreeDraws(integrator, H, factor, gap, softer, more, parts)
    stiffness = np.array([nominal, 0.8 * nominal, 60.0 * nominal])
    damping = np.array([[0.3, 0.2, 0.1]] * 3)
    found = made.drawn(stiffness, damping, np.ones((3, 3)))
    assert found.stiffness == pytest.approx(stiffness * softer)
    assert found.damping == pytest.approx(damping * more)
    squares = H**2 * stiffness * softer
    damped = late * H * damping * more
    own = np.maximum(factor * squares + damped, 0.0)
    assert found.armature[:2] == pytest.approx(own[:2])

    def left(armature, at):
        spare = np.diag(armature - limit * squares[2, at] - damped[2, at])
        return np.linalg.eigvalsh(0.98 * (FREE if len(at) > 1 else FREE[:1, :1]) + spare)[0]

    for at in ([0, 2], [1]):
        start = (factor * squares + damped)[2, at]
        assert left(start, at) < 0.0
        sure = np.maximum(gap[at], (factor[at] - limit) * squares[2, at])
        way = sure + limit * squares[2, at] + damped[2, at] - start
        share = (found.armature[2, at] - start) / way
        assert share == pytest.approx([share[0]] * len(at))
        assert share[0] * 2**10 == pytest.approx(round(share[0] * 2**10), abs=1e-6)
        assert left(found.armature[2, at], at) > -1e-8
        assert left(found.armature[2, at] - way / 2**10, at) < 0.0


@pytest.mark.parametrize(
    ("integrator", "late", "limit"),
    [("Euler", 0.5, 0.25), ("implicitfast", -0.5, 0.25), ("RK4", 0.0, 0.125)],
)
def test_draws_are_of_what_the_nominal_tree_was_given(monkeypatch, integrator, late, limit):
    model = SimpleNamespace(tendon_armature=np.array([0.0, 0.1, 0.2]))
    modal = SimpleNamespace(
        index=np.array([2, 0]), stiffness=np.array([80.0, 50.0]), damping=np.array([0.4, 0.0])
    )

    timed = SimpleNamespace(
        tendon_armature=np.array([0.03, 0.1, 0.25]),
        tendon_stiffness=np.array([51.0, 9.0, 78.0]),
        tendon_damping=np.array([0.0, 9.0, 0.44]),
    )
    monkeypatch.setattr("beamchain.steps.tree_draws.appendages_alone", lambda *_: ["alone"])
    found = TreeDraws.of(model, modal, timed, TimingMark(H, integrator, 5))
    assert (found.integrator, found.timestep) == (integrator, H)
    squares = H**2 * np.array([78.0, 51.0])
    own = np.array([0.05 - late * H * 0.44, 0.03])
    assert found.factor == pytest.approx(own / squares)
    assert found.gap == pytest.approx(own - limit * squares)
    assert found.stiffness == pytest.approx([78.0 / 80.0, 51.0 / 50.0])
    assert found.damping == pytest.approx([1.1, 1.0])
    assert found.parts == ("alone",)


def test_modes_of_timed_tendons_as_they_are_said():
    w, damping = np.array([3.0, 60.0]), np.array([0.4, 2.0])
    modal = SimpleNamespace(names=("a", "b"), frequency=w, stiffness=w**2, damping=damping)
    tendons = Tendons(1.1 * w**2, 1.2 * damping, np.array([0.3, 0.7]))
    slow, fast = modes_of_tendons(modal, tendons, "Euler", H)
    assert (slow.name, fast.name) == ("a", "b")
    assert slow.pole == pytest.approx(-0.2 + 1j * np.sqrt(9.0 - 0.04))
    assert (slow.ratio, fast.ratio) == pytest.approx((0.2 / 3.0, 1.0 / 60.0))
    assert (slow.mass, fast.mass) == pytest.approx((1.3, 1.7))
    assert (slow.damping, fast.damping) == pytest.approx((0.48, 2.4))
    assert (slow.slowed, fast.slowed) == (False, True)


def test_a_damped_motion_and_a_drifting_one_do_not_grow():
    """At 1 and 2 rad/s of ratio a quarter, at 0.05 s."""
    model = two_slides(((2.0, 1.0), (20.0, 5.0)), 0.0, 0.0)
    assert growing_frequencies(model, np.zeros(2)).size == 0
    assert growing_frequencies(two_slides(((0, 0), (0, 0)), 0.0, 0.0), np.zeros(2)).size == 0
