"""Large motion of a chain beside energies of its links and balances of moments."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh

from beamchain.errors import BeamchainError
from formulas import (
    Chain,
    Hinge,
    LargeMotion,
    Link,
    PlanarChain,
    large_limits,
    large_motion,
    leaves_at,
    plane_of_chain,
)

AT = np.array([0.2, 0.9, 1.5])
MASS, COM = np.array([1.0, 1.2, 0.8, 0.5]), np.array([0.1, 0.6, 1.1, 1.9])
INERTIA, ALONG = np.array([0.01, 0.02, 0.03, 0.02]), np.array([0.02, 0.05, 0.04, 0.06])
SPRINGS = np.array([[30.0, 2.0, 0.5], [2.0, 22.0, 1.0], [0.5, 1.0, 9.0]])
ARMATURE = np.array([[0.3, 0.05, 0.0], [0.05, 0.2, 0.02], [0.0, 0.02, 0.1]])


def chain(springs=SPRINGS):
    return PlanarChain(AT, springs, ARMATURE, MASS, COM, INERTIA, ALONG)


def places(turned):
    """Mass centres of the links and their angles, at angles of the hinges."""
    angles = np.cumsum(turned)
    joints = np.diff(AT)
    x = [COM[0]]
    y = [0.0]
    at = np.array([AT[0], 0.0])
    for j, angle in enumerate(angles):
        along = np.array([np.cos(angle), np.sin(angle)])
        x.append(at[0] + (COM[j + 1] - AT[j]) * along[0])
        y.append(at[1] + (COM[j + 1] - AT[j]) * along[1])
        at = at + (joints[j] if j < 2 else 0.0) * along
    return np.array(x), np.array(y), np.append(0.0, angles)


def second(function, size=2e-3):
    """Second derivatives at rest."""
    moves = size * np.eye(3)
    return np.array(
        [
            [
                (function(a + b) - function(a - b) - function(b - a) + function(-a - b))
                / (4.0 * size**2)
                for b in moves
            ]
            for a in moves
        ]
    )


def inertia_of_angles():
    arms = np.array([[(COM[k + 1] - AT[j]) if j <= k else 0.0 for j in range(3)] for k in range(3)])
    turned = np.tri(3)
    return arms.T @ np.diag(MASS[1:]) @ arms + turned.T @ np.diag(INERTIA[1:]) @ turned + ARMATURE


@pytest.mark.parametrize("flap", [True, False])
def test_spin_stiffens_a_chain_by_the_energy_of_what_it_pulls(flap):
    spin, radius = 2.0, 0.25

    def energy(turned):
        # of all mass: -W^2 r^2 / 2, r its distance from the axis of spin
        x, y, angles = places(turned)
        square = (radius + x) ** 2 + (0.0 if flap else y**2)
        own = ALONG * (np.cos(angles) ** 2 if flap else 1.0)
        return -(spin**2) * np.sum(MASS * square + own) / 2.0

    wanted = eigh(SPRINGS + second(energy), inertia_of_angles(), eigvals_only=True)
    got = chain().frequencies(spin, radius, flap=flap)
    assert got == pytest.approx(np.sqrt(wanted), rel=1e-5)
    still = eigh(SPRINGS, inertia_of_angles(), eigvals_only=True)
    assert chain().frequencies(0.0, radius, flap=flap) == pytest.approx(np.sqrt(still))


def test_a_chain_whose_root_is_inside_the_axis_loses_modes_in_spin():
    # pulled inwards: fewer modes than hinges, the slowest first
    got = chain().frequencies(12.0, -1.5, flap=False)
    assert 0 < got.size < 3
    assert got.tolist() == sorted(got)


def test_a_push_along_the_chain_lowers_its_first_frequency_by_a_hundredth():
    pressed = second(lambda turned: MASS @ places(turned)[0])
    mass = inertia_of_angles()
    first = eigh(SPRINGS, mass, eigvals_only=True)[0]
    softer = eigh(SPRINGS + chain().axial() * pressed, mass, eigvals_only=True)[0]
    assert np.sqrt(softer / first) == pytest.approx(0.99, rel=1e-7)


@pytest.mark.parametrize(("acceleration", "slew"), [(3.0, 0.0), (2.0, 1.5), (-1.0, 4.0)])
def test_slopes_of_the_balance_are_its_differences(acceleration, slew):
    made = chain()
    span = np.array(
        [
            [
                COM[k + 1] - AT[k] if j == k else (AT[j + 1] - AT[j] if j < k else 0.0)
                for j in range(3)
            ]
            for k in range(3)
        ]
    )
    angles = np.array([-0.3, 0.5, 0.9])
    moves = 1e-6 * np.eye(3)
    wanted = np.transpose(
        [
            made._unbalance(angles + move, acceleration, slew, span)
            - made._unbalance(angles - move, acceleration, slew, span)
            for move in moves
        ]
    )
    got = made._unbalance_slopes(angles, acceleration, slew, span)
    assert got == pytest.approx(wanted / 2e-6, rel=1e-6, abs=1e-8)


def test_small_loads_bend_a_chain_by_its_flexibility():
    # moments of the hinges: forces times arms, and what the links' own inertia takes
    arms = np.array([[(COM[k + 1] - AT[j]) if j <= k else 0.0 for j in range(3)] for k in range(3)])
    for acceleration, slew in ((1e-5, 0.0), (0.0, 1e-5), (2e-5, 1e-5)):
        force = -MASS * (acceleration + slew * COM)
        moment = arms.T @ force[1:] - slew * np.array([INERTIA[k:].sum() for k in (1, 2, 3)])
        turned = np.linalg.solve(SPRINGS, moment)
        displacement, root = chain().bent(acceleration, slew)
        assert displacement == pytest.approx(MASS @ places(turned)[1] / MASS.sum(), rel=1e-6)
        assert root == pytest.approx(force @ COM - slew * INERTIA.sum(), rel=1e-6)
        assert chain()._linear(acceleration, slew) == pytest.approx(np.cumsum(turned))


# -- limits ----------------------------------------------------------------------------------------
def test_where_an_error_passes_a_hundredth():
    assert leaves_at(lambda x: 0.04 * x**2, 0.01, 10.0) == pytest.approx(0.5, rel=1e-4)
    assert leaves_at(lambda x: x, 0.02, 10.0) == 0.02  # beyond it from the start
    assert leaves_at(lambda x: 1e-3 * x, 0.01, 9.9) == np.inf
    assert leaves_at(lambda x: 1e-3 * x, 0.01, 10.1) == pytest.approx(10.0, rel=1e-4)
    seen = []
    leaves_at(lambda x: seen.append(x) or 0.0, 0.01, 10.0)
    assert seen == pytest.approx(np.geomspace(0.01, 10.0, 16))


def equal(count):
    """Links of a beam with L = EI = m = 1, hinges in their middles."""
    x = (np.arange(count) + 0.5) / count
    edges = np.array([0.0, *x, 1.0])
    mass = np.diff(edges)
    links = [
        Link(a, b - a, b - a, (a + b) / 2.0, (1e-9, (b - a) ** 3 / 12.0, (b - a) ** 3 / 12.0))
        for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]
    return Chain(tuple(links), tuple(Hinge(at, {"xy": float(count)}) for at in x), mass.sum())


def test_limits_of_two_links_against_many(monkeypatch):
    beam, radius = SimpleNamespace(length=1.0), 0.7
    coarse, fine = equal(2), equal(7)
    monkeypatch.setattr("beamchain.steps.large_motion.equal_links", lambda *_: fine)
    found = large_motion(coarse, beam, "xy", modes=2, radius=radius)
    ours, theirs = plane_of_chain(coarse, "xy"), plane_of_chain(fine, "xy")

    def off(function):
        a, b = (np.asarray(function(one)) for one in (ours, theirs))
        return np.max(np.abs(a / b - 1.0))

    def spun(spin):
        return max(
            off(
                lambda one, flap=flap: (
                    one.frequencies(spin, radius, flap=flap)[:2]
                    / one.frequencies(0.0, radius, flap=True)[:2]
                )
            )
            for flap in (True, False)
        )

    def bent(acceleration, slew):
        small = 1e-6 / max(acceleration, slew)
        return off(
            lambda one: (
                np.array(one.bent(acceleration, slew))
                / one.bent(small * acceleration, small * slew)
                * small
            )
        )

    assert spun(found.spin) == pytest.approx(0.01, rel=2e-3)
    assert bent(found.acceleration, 0.0) == pytest.approx(0.01, rel=2e-3)
    assert bent(radius * found.slew, found.slew) == pytest.approx(0.01, rel=2e-3)
    assert found.port == "xy"
    linear = abs(theirs.bent(1e-6, 0.0)[0]) / 1e-6 * found.acceleration / beam.length
    assert found.bent == pytest.approx(linear, rel=1e-6)
    assert found.axial == pytest.approx(theirs.axial())


def test_limits_are_those_of_the_planes_that_bend_and_a_root_on_the_axis_or_outside(monkeypatch):
    asked = []

    def limits(chain, beam, port, *, modes, radius):
        asked.append((port, modes, radius))
        if port == "xz":
            raise BeamchainError("no.")
        return port

    monkeypatch.setattr("beamchain.steps.large_motion.large_motion", limits)
    both = SimpleNamespace(ports=("xy", "xz"))
    found, reasons = large_limits(both, None, {"xy": 2, "xz": 3}, -3.0)
    assert found == {"xy": "xy"}
    assert list(reasons) == ["large motion in xz could not be compared: no."]
    assert large_limits(both, None, {"xy": 4}, 0.4)[0] == {"xy": "xy"}
    assert asked == [("xy", 2, 0.0), ("xz", 3, 0.0), ("xy", 4, 0.4)]


def test_a_run_exceeds_a_limit_only_beyond_it():
    made = LargeMotion("xz", 2.0, 3.0, 4.0, 0.1, 5.0)
    assert made.exceeded(spin=-2.0, acceleration=3.0, slew=-4.0) == []
    said = made.exceeded(spin=-2.01, acceleration=3.01, slew=4.5)
    assert [text.split()[0] for text in said] == ["spin", "acceleration", "slew"]
    assert said[2].startswith("slew reached 4.5 rad/s^2, beyond the 4 rad/s^2")
