"""Closed forms beside the pendulums of a tank: Abramson's masses, lengths and heights."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import jnp_zeros

import beamchain as bc
from formulas import (
    Slosh,
    body_of,
    cautions_of_fit,
    chain_of,
    heavy,
    limp_model,
    pendulum_chain,
    select,
    weightless,
)

R, H, DENSITY, RATIO, ACCELERATION = 0.7, 1.1, 900.0, 0.03, 2.5
XI = jnp_zeros(1, 12)
TILTED = np.tanh(XI * H / R)
MASS = np.pi * R**2 * H * DENSITY
MASSES = MASS * 2.0 * R * TILTED / (XI * H * (XI**2 - 1.0))
LENGTHS = R / (XI * TILTED)
STAND = H - 2.0 * R / XI * np.tanh(XI * H / (2.0 * R))
SPEED = np.sqrt(ACCELERATION / LENGTHS)
TERMS = jnp_zeros(1, 500)
SERIES = np.sum(np.tanh(TERMS * H / (2.0 * R)) / (TERMS**3 * (TERMS**2 - 1.0)))
ACROSS = MASS * (H**2 / 12.0 - 0.75 * R**2 + 16.0 * R**3 / H * SERIES)  # about the centre
SERIES_CUT = 1e-11  # of the terms beyond the 500th


def tank(**more):
    given = {"radius": R, "height": H, "density": DENSITY, "ratio": RATIO}
    return {"shape": "cylinder", **given, "acceleration": ACCELERATION, **more}


def liquid(**more):
    return Slosh(**tank(**more))


@pytest.mark.parametrize("count", [1, 3])
def test_pendulums_have_mass_length_and_damping_of_the_modes(count):
    made = pendulum_chain(liquid(modes=count))
    assert len(made.links) == count + 1
    assert made.length == H
    assert made.acceleration == ACCELERATION
    assert made.hung
    for k, (link, hinge) in enumerate(zip(made.links[1:], made.hinges, strict=True)):
        m, length = MASSES[k], LENGTHS[k]
        pivot = STAND[k] + length
        arm = pivot - link.com
        assert hinge.x == pytest.approx(pivot, rel=1e-12)
        assert link.start == link.com
        assert link.length == 0.0
        assert arm == pytest.approx(0.999 * length, rel=1e-12)
        # force and moment of a point mass: the first and the second moment about the pivot
        assert link.mass * arm == pytest.approx(m * length, rel=1e-12)
        roll, xz, xy = link.inertia
        assert xz == xy
        assert xy + link.mass * arm**2 == pytest.approx(m * length**2, rel=1e-12)
        assert roll == pytest.approx(1e-6 * xy, rel=1e-12)
        damper = 2.0 * RATIO * SPEED[k] * m * length**2
        assert hinge.damping == pytest.approx({"xy": damper, "xz": damper}, rel=1e-12)
        assert dict(hinge.stiffness) == {"xy": 0.0, "xz": 0.0}


def test_the_fixed_mass_is_what_the_pendulums_leave():
    made = pendulum_chain(liquid(modes=2))
    first, *rest = made.links
    assert (first.start, first.length) == (0.0, H)
    mass = MASS - sum(link.mass for link in rest)
    moment = MASS * H / 2.0 - sum(link.mass * link.com for link in rest)
    second = ACROSS + MASS * (H / 2.0) ** 2
    second -= sum(link.inertia[2] + link.mass * link.com**2 for link in rest)
    assert first.mass == pytest.approx(mass, rel=1e-12)
    assert first.com == pytest.approx(moment / mass, rel=1e-12)
    across = second - moment**2 / mass
    assert first.inertia == pytest.approx((0.0, across, across), rel=SERIES_CUT, abs=1e-12)


def test_a_small_pendulum_has_what_mujoco_asks_for():
    tiny = liquid(radius=1e-3, height=1e-3)
    assert {link.inertia[0] for link in pendulum_chain(tiny).links[1:]} == {2e-15}


def test_a_liquid_that_nothing_accelerates_has_a_slack_part_of_its_frequencies():
    found = limp_model(liquid(), 1e-3)
    assert found.frequencies == pytest.approx(1e-3 * np.repeat(SPEED, 2), rel=1e-12)
    assert found.damping == pytest.approx(np.full(24, RATIO / 1e-3))
    assert found.participation[0] == pytest.approx(
        np.sqrt(MASSES[0]) * np.array([0, 1, 0, 0, 0, STAND[0]])
    )
    roll = sum(1e-6 * m * 1e-3 * length**2 for m, length in zip(MASSES[:2], LENGTHS, strict=False))
    about = ACROSS + MASS * (H / 2.0) ** 2
    wanted = np.diag([MASS, MASS, MASS, roll, about, about])
    wanted[1, 5] = wanted[5, 1] = MASS * H / 2.0
    wanted[2, 4] = wanted[4, 2] = -MASS * H / 2.0
    assert found.rigid_mass == pytest.approx(wanted, rel=SERIES_CUT)


@pytest.mark.parametrize(
    ("mass", "base", "told"),
    [
        (0.99e7, None, False),
        (1.01e7, None, True),
        (1.01e7, 1e9, True),
        (1e4, 101.0, False),
        (1e4, 99.0, True),
    ],
)
def test_a_liquid_as_heavy_as_none_is_told(mass, base, told):
    found = heavy(
        liquid(radius=600.0, height=450.0, density=mass / (np.pi * 600.0**2 * 450.0)), base
    )
    assert [one.code for one in found] == ["heavy-liquid"] * told
    if told:
        assert f"has {mass:.3g} kg" in found[0]
        assert found[0].endswith("write radius = 0.6 and height = 0.45.")
        assert ("times the" in found[0]) == (base is not None)
    if base == 99.0:
        assert ", 101 times the 99 kg that carry it" in found[0]


HUB = bc.Hub(mass=700.0, inertia=(90.0, 80.0, 70.0), offset=(0.2, 0.3, -0.4))


def case(scene=None, hub=HUB, **more):
    """A liquid and its modes that become pendulums."""
    root = bc.spec.Root(hub=hub)
    body = body_of(bc.Spec(name="tank", slosh=liquid(**more), scene=scene, root=root))
    return body, select(body)


def test_a_case_keeps_the_first_modes_of_both_planes():
    body, kept = case(modes=3)
    assert kept.numbers == (1, 2, 3, 4, 5, 6)
    assert kept.counts == {"xy": 3, "xz": 3}
    assert body.promise is None
    assert kept.data.frequencies == pytest.approx(np.repeat(SPEED[:3], 2))
    built, line = chain_of(body, kept)
    assert built.how == "3 pendulums and a fixed mass"
    assert chain_of(*case(modes=1))[0].how == "1 pendulum and a fixed mass"
    assert line.length == H
    for port in ("xy", "xz"):
        model = built.targets[port]
        assert model.frequencies == pytest.approx(SPEED[:3])
        assert np.abs(model.participation[:, 0]) == pytest.approx(np.sqrt(MASSES[:3]))
        assert model.participation[:, 1] / model.participation[:, 0] == pytest.approx(STAND[:3])


def test_the_promise_of_a_case_is_about_what_the_liquid_moves():
    """No inertia about the axis: rotations y and z are its fourth and fifth motion."""
    promise = case(bc.Scene(bandwidth=3.0, axes=("x", "tz", "y")))[0].promise
    assert promise.wanted == [2, 3]
    assert promise.asked == {2, 3, 4}
    assert promise.band == 3.0
    live = [0, 1, 2, 4, 5]
    assert promise.hubs[0] == pytest.approx(HUB.mass_matrix()[np.ix_(live, live)])
    # modes up to 25 times the band stay, those above are one at most for each motion
    kept = promise.exact.frequencies
    inside = np.repeat(SPEED, 2)[np.repeat(SPEED, 2) < 75.0]
    assert kept[: inside.size] == pytest.approx(inside, rel=1e-9)
    bare = case(bc.Scene(bandwidth=3.0), hub=None)[0].promise
    assert len(bare.hubs) == 3


def test_a_tank_without_thrust_is_told_and_a_liquid_too_heavy_for_its_hub():
    def codes(made):
        nothing = SimpleNamespace()
        return [one.code for one in cautions_of_fit(*made, nothing, nothing, nothing)]

    told = codes(case())
    assert told == ["slosh-weightless"]
    light = bc.Hub(mass=MASS / 101.0, inertia=(9.0, 8.0, 7.0))
    told = codes(case(hub=light))
    assert told == ["slosh-weightless", "heavy-liquid"]
    assert str(weightless("here")).startswith("here: without thrust")
