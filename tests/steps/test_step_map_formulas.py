"""Poles of a step and of exact motion, paired and judged, beside small models by hand."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from beamchain.steps.dominant_element import culprit
from beamchain.steps.step_map import grows
from formulas import (
    Motion,
    ShiftedPeak,
    TimeError,
    cause_sentence,
    damped_by,
    growing_frequencies,
    growing_poses,
    last_kept,
    lowest_wrong,
    motion_at,
    pole_pairs,
    shifted_peak,
    time_error,
)

H = 0.04


def of_poles(continuous=(), stepped=(), h=H):
    return SimpleNamespace(
        continuous_poles=lambda: np.array(continuous, dtype=complex),
        step_poles=lambda: np.array(stepped, dtype=complex) - 1.0,
        timestep=h,
    )


def test_poles_of_a_step_are_paired_with_those_that_are_wanted():
    # s h: rigid, slow, middle and one that turns too far, which is slowed to 2.6 rad
    slow, middle, fast = -0.02 + 0.3j, -0.1 + 1.1j, -0.2 + 5.2j
    near = [np.exp(slow * 1.01), np.exp(middle * 0.95), np.exp(fast / 2.0 * 1.03)]
    found = pole_pairs(
        of_poles(stepped=[near[2], 1.0, near[0], near[1], 1.0]),
        of_poles([fast, 0.0, middle, slow, 9e-6j]),
    )
    wanted = np.array([slow, middle, fast])
    assert found.wanted == pytest.approx(wanted / H)
    assert found.shown == pytest.approx(np.array(near) - 1.0)
    z = np.exp(wanted)
    assert found.error == pytest.approx(np.abs(near - z) / np.abs(z - 1.0))


def test_poles_are_paired_by_the_squares_of_what_they_are_off():
    """Off by 1 and 0.8 of their size, or crossed by 0 and 1.4."""
    aim = 0.1j * np.array([1.0, 2.0])
    stepped = 0.1j * np.array([2.0, 1.2 + 1j * np.sqrt(1.92)])
    found = pole_pairs(of_poles(stepped=1.0 + stepped[::-1]), of_poles(np.log1p(aim)[::-1]))
    assert found.shown == pytest.approx(stepped)
    assert found.error == pytest.approx([1.0, 0.8])


def test_a_mode_that_turns_too_far_is_not_taken_for_the_slow_one_it_looks_like():
    """Where another step has the slow one, to which the fast one's exact pole leads as well."""
    slow = -0.1 - 1.1j
    there = 0.9 * slow
    fast = there + 2j * np.pi
    slowed = np.exp(fast * 2.6 / fast.imag)
    found = pole_pairs(of_poles(stepped=[np.exp(there), slowed]), of_poles([fast, slow]))
    assert found.wanted == pytest.approx(np.array([slow, fast]) / H)
    assert found.shown == pytest.approx(np.array([np.exp(there), slowed]) - 1.0)


def test_pairs_are_those_of_the_least_squares():
    """One exact and one off by 0.5, 0.25 in all, or off by 0.4 and 0.35, 0.2825 in all, of which
    the sum of cubes were the smaller one."""
    wanted = np.array([0.7, 0.5])
    along = (0.25**2 + 0.2**2 - 0.105**2) / (2.0 * 0.2)
    third = 0.5 + along + 1j * np.sqrt(0.25**2 - along**2)
    found = pole_pairs(of_poles(stepped=[third, 0.7]), of_poles(np.log(wanted)))
    assert found.wanted == pytest.approx(np.log(wanted) / H)
    assert found.shown == pytest.approx(np.array([0.7, third]) - 1.0)
    assert found.error == pytest.approx([0.0, 0.5], abs=1e-12)
    swapped = np.abs(np.array([third, 0.7]) - wanted) / (1.0 - wanted)
    assert swapped == pytest.approx([0.35, 0.4])


@pytest.mark.parametrize(("ratio", "undamped"), [(0.02, 0.005), (0.0, 0.005), (2e-6, 0.005)])
def test_what_a_step_makes_of_the_response_at_a_resonance(ratio, undamped):
    w = np.array([3.0, 8.0])
    ratios = np.array([0.1, ratio])
    wanted = w * (1j * np.sqrt(1.0 - ratios**2) - ratios)
    shown = np.array([0.97, 1.04]) * wanted - np.array([0.0, 0.03])
    both = [wanted * H, np.conj(wanted) * H]
    stepped = np.concatenate([np.exp(shown * H), np.exp(np.conj(shown) * H)])
    found = shifted_peak(of_poles(stepped=stepped), of_poles(np.concatenate(both)), 7.0, undamped)
    s, moved = wanted[1], shown[1]
    compared = {0.02: 0.02, 0.0: 0.005, 2e-6: 1e-5}[ratio]
    assert found.frequency == pytest.approx(8.0)
    assert found.ratio == pytest.approx(ratio, abs=1e-12)
    assert found.shift == pytest.approx(abs(moved) / 8.0 - 1.0)
    lost = -moved.real / abs(moved)
    assert found.damped == pytest.approx(lost / 0.02 - 1.0 if ratio == 0.02 else 0.0, abs=1e-9)
    drag = (compared - ratio) * 8.0
    assert found.change == pytest.approx(abs(moved - s) / abs(7j + drag - moved), rel=1e-6)
    # the slower, which the step shows at 2.91
    assert shifted_peak(
        of_poles(stepped=stepped), of_poles(np.concatenate(both)), 2.9, undamped
    ).frequency == pytest.approx(3.0)
    assert shifted_peak(of_poles(stepped=[0.5]), of_poles([-0.7]), 2.9, undamped) is None


def test_a_slow_mode_rings_too():
    """Of 0.05 rad/s, shown 3 % slower."""
    wanted = 0.05 * (1j * np.sqrt(1.0 - 0.02**2) - 0.02)
    both = of_poles(stepped=np.exp(0.97 * H * np.array([wanted, np.conj(wanted)])))
    found = shifted_peak(both, of_poles(H * np.array([wanted, np.conj(wanted)])), 0.04, 0.005)
    assert found.frequency == pytest.approx(0.05)
    assert found.shift == pytest.approx(-0.03)


def test_the_mode_that_the_step_shows_nearest_to_a_frequency():
    # 3 rad/s is shown at 3.9, which is nearer to 3.95 than 4.5 and what is shown of it, 4.6
    wanted, shown = np.array([3.0, 4.5]) * (1j - 0.01), np.array([3.9, 4.6]) * (1j - 0.01)
    both = of_poles(stepped=np.exp(H * np.append(shown, np.conj(shown))))
    plain = of_poles(H * np.append(wanted, np.conj(wanted)))
    found = shifted_peak(both, plain, 3.95, 0.005)
    assert found.frequency == pytest.approx(3.0, rel=1e-3)
    assert found.shift == pytest.approx(0.3)


def test_a_shifted_peak_explains_half_of_an_error_or_more():
    peak = ShiftedPeak(8.0, 0.02, 0.013, -0.2, 0.5, "mode 2")
    assert peak.explains(1.0, 0.1)
    assert not peak.explains(1.01, 0.1)
    assert peak.explains(0.4, 0.2)
    assert not peak.explains(0.4, 0.21)
    assert cause_sentence(SimpleNamespace(cause=peak)) == (
        "The error comes from the resonance at 8 rad/s (mode 2), whose frequency the step shifts "
        "by +0.013 of itself and whose damping ratio, 0.02, by -0.2 of itself: that changes its "
        "response there by 0.5."
    )


# -- models ----------------------------------------------------------------------------------------
def slides(*bodies, tendons="", integrator="Euler", h=H):
    """Bodies on slides of their own: mass, stiffness and damping of each."""
    made = "".join(
        f"""<body><joint name="{"abcd"[i]}" type="slide" axis="1 0 0" stiffness="{k}"
        damping="{d}"/><inertial pos="0 0 0" mass="{m}" diaginertia="1 1 1"/></body>"""
        for i, (m, k, d) in enumerate(bodies)
    )
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="{h}" integrator="{integrator}"/>
        <worldbody>{made}</worldbody><tendon>{tendons}</tendon></mujoco>"""
    )


def tendon(name, stiffness, damping, **coefs):
    joints = "".join(f'<joint joint="{joint}" coef="{coef}"/>' for joint, coef in coefs.items())
    return (
        f'<fixed name="{name}" stiffness="{stiffness}" damping="{damping}" springlength="0 0">'
        f"{joints}</fixed>"
    )


def test_motions_without_springs_come_first_and_those_without_dampers_before_them():
    # masses 2 and 5 with a damper between them: together they move freely
    model = slides((2.0, 0.0, 0.0), (5.0, 0.0, 0.0), (3.0, 24.0, 0.0),
                   tendons=tendon("damper", 0.0, 0.7, a=1.0, b=-1.0))  # fmt: skip
    found = motion_at(model)
    assert found.loose == 1
    assert found.squares == pytest.approx([0.0, 0.0, 8.0])
    assert np.abs(found.shapes[:, 0]) == pytest.approx([7.0**-0.5, 7.0**-0.5, 0.0])
    # the reduced mass of 2 and 5
    assert found.damping == pytest.approx(np.diag([0.0, 0.7 / (10.0 / 7.0), 0.0]))
    assert found.shapes.T @ np.diag([2.0, 5.0, 3.0]) @ found.shapes == pytest.approx(np.eye(3))


def test_poses_that_grow_the_worst_first(monkeypatch):
    growth = {0: 1.0 + 2e-6, 1: 1.0 + 5e-7, 2: 1.4, 3: 0.7}
    one, nothing = np.eye(1), np.zeros((1, 1))

    def motion(_, qpos):
        change = np.diag([growth[qpos], -0.6]) - np.eye(2)
        return Motion(one, np.zeros(1), nothing, nothing, 1, H, "Euler", change, np.ones((2, 1)))

    monkeypatch.setattr("beamchain.steps.step_map.motion_at", motion)
    assert growing_poses(None, {"a": 0, "b": 1, "c": 2, "d": 3}) == ["c", "a"]


def test_the_last_kept_mode_has_most_of_its_energy_in_kept_springs():
    # alone on its mass each: 5, 6, 7 and 8 rad/s
    bodies = [(2.0, 50.0, 0.0), (2.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 128.0, 0.0)]
    made = slides(
        *bodies,
        tendons=tendon("x_mode1_xy", 72.0, 0.0, b=1.0) + tendon("x_filler2", 98.0, 0.0, c=1.0),
    )
    assert last_kept(made, motion_at(made)) == pytest.approx(6.0)
    # shared with a spring of a joint: 40 or 33 of 72 through a lever of a half
    for share, kept in ((40.0, 6.0), (33.0, 0.0)):
        shared = slides(
            (2.0, 0.0, 0.0), (2.0, 72.0 - share, 0.0),
            tendons=tendon("x_mode1_xy", 4.0 * share, 0.0, b=0.5),
        )  # fmt: skip
        assert last_kept(shared, motion_at(shared)) == pytest.approx(kept)
    plain = slides(*bodies)
    assert last_kept(plain, motion_at(plain)) == pytest.approx(8.0)
    assert last_kept(plain, motion_at(plain), {0, 2}) == pytest.approx(5.0)
    assert last_kept(plain, motion_at(plain), {1}) == 0.0
    soft = slides((2.0, 0.08, 0.0), (2.0, 0.0, 0.0))
    assert last_kept(soft, motion_at(soft)) == pytest.approx(0.2)


@pytest.mark.parametrize(("share", "name"), [(0.55, "b"), (0.45, "")])
def test_what_takes_most_of_the_energy_that_a_pole_loses(share, name):
    model = slides(
        (2.0, 50.0, 0.9), (2.0, 0.0, share),
        tendons=tendon("x_mode1_xy", 72.0 * 4.0, 4.0 * (1.0 - share), b=0.5),
    )  # fmt: skip
    motion = motion_at(model)
    assert damped_by(model, np.zeros(2), motion, -0.2 + 6j) == name
    assert damped_by(model, np.zeros(2), motion, -0.2 + 5j) == "a"
    real = slides((2.0, 0.0, 40.0), (5.0, 0.0, 10.0))
    for rate, joint in ((-20.0, "a"), (-2.0, "b")):
        assert damped_by(real, np.zeros(2), motion_at(real), rate) == joint
    still = slides((2.0, 50.0, 0.0))
    assert damped_by(still, np.zeros(1), motion_at(still), 5j) == ""


def euler_error(w, drag):
    """Of the pole of a mode on a damped joint, relative to exp(s h) - 1."""
    left = 1.0 + H * drag
    z = np.roots([1.0, H**2 * w**2 / left - 1.0 - 1.0 / left, 1.0 / left])
    s = complex(-drag / 2.0, np.sqrt(w**2 - drag**2 / 4.0))
    return np.min(np.abs(z - np.exp(s * H))) / abs(np.exp(s * H) - 1.0), abs(s)


def test_the_worst_pole_of_a_step_in_a_band():
    model = slides((2.0, 50.0, 0.2), (2.0, 72.0, 0.3), (2.0, 450.0, 0.1))
    places = {"turned": np.ones(3)}
    for band, w, drag, name in (
        (5.5, 5.0, 0.1, "a"),
        (10.0, 6.0, 0.15, "b"),
        (None, 15.0, 0.05, "c"),
    ):
        found = time_error(model, model, places, band)
        error, size = euler_error(w, drag)
        assert found.error == pytest.approx(error, rel=1e-6)
        assert found.frequency == pytest.approx(size)
        assert found.damped_by == name
        assert (found.pose, found.step, found.integrator) == ("turned", H, "Euler")
        assert not found.exact
    assert time_error(model, model, places, 4.9).words == "no pole lies in the band"
    assert euler_error(5.0, 0.1)[0] < 1e-3 < euler_error(15.0, 0.05)[0]
    wrong = lowest_wrong(model, model, places)
    assert (wrong.error, wrong.frequency) == pytest.approx(euler_error(15.0, 0.05))
    assert wrong.damped_by == "c"
    # w h = 0.04: errors of (w h)^2 / 24
    assert lowest_wrong(slides((2.0, 2.0, 0.0)), slides((2.0, 2.0, 0.0)), {"rest": [0.0]}) is None
    made = slides((2.0, 2.0, 0.0), (2.0, 72.0, 0.0))
    assert lowest_wrong(made, made, {"rest": np.zeros(2)}).frequency == pytest.approx(6.0)


def test_a_file_is_exact_in_time_below_a_millionth():
    assert TimeError(0.99e-6, 2.0, "rest", H, "Euler").exact
    assert not TimeError(1.01e-6, 2.0, "rest", H, "Euler").exact
    assert TimeError(0.012, 2.0, "rest", H, "Euler", "a").words.startswith(
        "the pole at 2 rad/s, damped by 'a', is off by 0.012 of |z - 1| in "
    )


def sliders(more="", step=0.02):
    """Three masses of 2, 4 and 5 kg on slides, each in its own way."""
    bodies = "".join(
        f'<body pos="{9 * i} 0 0"><joint type="slide" {given}/><inertial pos="0 0 0" mass="{mass}" '
        'diaginertia="1 1 1"/></body>'
        for i, (mass, given) in enumerate(((2, ""), (4, ""), (5, 'damping="3"')))
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step}" gravity="0 0 0"/><worldbody>{bodies}{more}</worldbody>'
        "</mujoco>"
    )


def test_what_a_damper_alone_holds_decays_and_what_nothing_holds_does_not():
    motion = motion_at(sliders())
    assert motion.loose == 2
    poles = np.sort(motion.continuous_poles().real) / 0.02
    assert poles == pytest.approx([-3.0 / 5.0, *[0.0] * 5], abs=1e-9)


@pytest.mark.parametrize(("share", "unstable"), [(0.9995, False), (1.0002, True)])
def test_a_step_just_beyond_the_limit_makes_a_motion_grow(share, unstable):
    """2 / w of an undamped spring; there it grows by a few per cent a step."""
    spring = '<body><joint type="slide" stiffness="50"/><inertial pos="0 0 0" mass="2" '
    model = sliders(f'{spring}diaginertia="1 1 1"/></body>', share * 2.0 / 5.0)
    assert grows(model, model.qpos0) is unstable
    assert motion_at(model).growth < 1.05
    assert growing_frequencies(model, model.qpos0) == pytest.approx([5.0] * unstable)


def test_what_carries_a_motion_that_grows_has_its_share_of_the_energy():
    """A mass of 2 kg between a joint's spring of 50 N/m and a tendon's of 30 N/m."""
    w = np.sqrt(80.0 / 2.0)
    step = 2.02 / w
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
<option timestep="{step}" gravity="0 0 0"/><worldbody>
<body><joint name="held" type="slide" stiffness="50"/><inertial pos="0 0 0" mass="2"
diaginertia="1 1 1"/></body></worldbody><tendon><fixed name="rope" stiffness="30">
<joint joint="held" coef="1"/></fixed></tendon></mujoco>""")
    found = culprit(model, model.qpos0)
    assert (found.name, found.kind, found.damps) == ("held", "spring", False)
    assert found.share == pytest.approx(50.0 / 80.0)
    assert found.frequency == pytest.approx(w)
    half = 2.02**2 / 2.0 - 1.0  # z^2 + 2 half z + 1 = 0
    assert found.growth == pytest.approx(half + np.sqrt(half**2 - 1.0))
    assert "2 kg" in found.moves
