"""The tests' own solver against closed forms; `tests/hosts/test_opensees.py` has another program
beside it."""

import numpy as np
import pytest
from scipy.linalg import eigh, eigvals
from scipy.optimize import brentq

from solver import Craft, Modes, Section, body_mass, cross, mesh, normal_modes, rotation
from uniform_beam import free_roots, held_roots

LENGTH, ELEMENTS = 3.0, 24
SECTION = Section(axial=5e6, torsion=700.0, bending_y=900.0, bending_z=2500.0, mass=1.7, polar=0.02)
FINE = 1e-5  # relative: cubic elements, three modes
LINEAR = 5e-4  # of twist and stretch, whose elements are linear: (pi / 2 / 24)^2 / 24 and less
ROUNDING = 1e-11


def held(craft):
    """Frequencies with the base held [rad/s]."""
    mass, _, stiffness = (matrix[6:, 6:] for matrix in craft.matrices())
    return normal_modes(mass, stiffness)[0]


def cantilever(tension=0.0, tip=0.0):
    craft = Craft()
    end = craft.beam(craft.base, LENGTH, ELEMENTS, SECTION, tension=tension)[-1]
    craft.body(end, tip)
    return craft


def near(found, wanted, rel):
    """Every wanted number is among the found ones."""
    off = np.abs(np.asarray(found)[:, None] / np.asarray(wanted) - 1.0).min(axis=0)
    assert off.max() < rel


def test_cantilever():
    found = held(cantilever())
    for bending in (SECTION.bending_y, SECTION.bending_z):
        near(found, (held_roots(3) / LENGTH) ** 2 * np.sqrt(bending / SECTION.mass), FINE)
    quarter = np.pi / 2.0 / LENGTH
    near(found, [quarter * np.sqrt(SECTION.torsion / SECTION.polar)], LINEAR)
    near(found, [quarter * np.sqrt(SECTION.axial / SECTION.mass)], LINEAR)


def test_what_moves_freely_gets_exactly_zero():
    mass, _, stiffness = cantilever().matrices()
    w, shapes = normal_modes(mass, stiffness, shift=1.0)
    assert np.array_equal(w[:7] > 0.0, [False] * 6 + [True])
    for bending in (SECTION.bending_y, SECTION.bending_z):
        near(w, (free_roots(2) / LENGTH) ** 2 * np.sqrt(bending / SECTION.mass), FINE)
    slow = shapes[:, :20]
    np.testing.assert_allclose(slow.T @ mass @ slow, np.eye(20), atol=ROUNDING)


def test_body_at_the_tip():
    tip = 4.0
    share = tip / (SECTION.mass * LENGTH)

    def characteristic(z):
        return (
            1.0
            + np.cos(z) * np.cosh(z)
            + share * z * (np.cos(z) * np.sinh(z) - np.sin(z) * np.cosh(z))
        )

    z = np.array([brentq(characteristic, 0.5, 1.9), brentq(characteristic, 3.2, 4.6)])
    found = held(cantilever(tip=tip))
    near(found, (z / LENGTH) ** 2 * np.sqrt(SECTION.bending_y / SECTION.mass), FINE)


def test_column_buckles_at_eulers_load():
    stiffness, pressed = (mesh(LENGTH, ELEMENTS, SECTION, -force)[1] for force in (0.0, 1.0))
    lost = (stiffness - pressed)[6:, 6:]
    load = 1.0 / np.max(eigh(lost, stiffness[6:, 6:], eigvals_only=True))
    assert load == pytest.approx(np.pi**2 * SECTION.bending_y / (4.0 * LENGTH**2), rel=FINE)


def test_hanging_rod_is_a_pendulum():
    gravity = 0.01  # little, so that the rod does not bend
    weight = SECTION.mass * gravity
    craft = Craft()
    pivot = craft.hinge(craft.base, (0.0, 1.0, 0.0))
    craft.beam(pivot, LENGTH, ELEMENTS, SECTION, tension=lambda x: weight * (LENGTH - x))
    mass, _, stiffness = (matrix[6:, 6:] for matrix in craft.matrices())
    slowest = normal_modes(mass, stiffness)[0][0]
    assert slowest**2 == pytest.approx(1.5 * gravity / LENGTH, rel=1e-3)


def test_damping_is_the_ratio_of_every_mode():
    craft = Craft()
    craft.beam(craft.base, LENGTH, 6, SECTION, ratio=0.03)
    mass, damping, stiffness = (matrix[6:, 6:] for matrix in craft.matrices())
    n = len(mass)
    rates = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    poles = eigvals(np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), rates]))
    np.testing.assert_allclose(-poles.real / np.abs(poles), 0.03, rtol=1e-6)


def test_kinetic_energy_is_that_of_its_points():
    """Two bodies of four points each, an elbow bent and turning."""
    rng = np.random.default_rng(0)
    weights, points = rng.uniform(1.0, 3.0, (2, 4)), rng.normal(size=(2, 4, 3))
    axis, angle, offset, rate = np.array([0.0, 0.6, 0.8]), 0.7, np.array([0.4, -0.2, 0.9]), 1.3
    turn = rotation((1.0, 0.0, 0.0), 0.5)
    craft = Craft()
    behind = craft.hinge(craft.base.at(offset, turn), axis, angle)
    for frame, m, r in zip((craft.base, behind), weights, points, strict=True):
        centre = m @ r / m.sum()
        inertia = sum(-mass * cross(p) @ cross(p) for mass, p in zip(m, r - centre, strict=True))
        craft.body(frame, m.sum(), centre, inertia)
    v, w = rng.normal(size=(2, 3))
    speeds = np.concatenate([v, w, [rate]])
    energy = 0.5 * weights[0] @ np.sum((v + np.cross(w, points[0])) ** 2, axis=1)
    out = points[1] @ (turn @ rotation(axis, angle)).T
    fast = v + np.cross(w, offset + out) + rate * np.cross(turn @ axis, out)
    energy += 0.5 * weights[1] @ np.sum(fast**2, axis=1)
    mass = craft.matrices()[0]
    assert 0.5 * speeds @ mass @ speeds == pytest.approx(energy, rel=ROUNDING)


def test_wheel_nutates():
    spin, across, rate, inertia = 0.4, 0.3, 50.0, 7.0
    craft = Craft()
    craft.body(craft.base, 20.0, inertia=(inertia,) * 3)
    craft.wheel(craft.base, (0.0, 0.0, 1.0), 2.0, spin, across, rate)
    mass, damping, _ = craft.matrices()
    poles = eigvals(-np.linalg.solve(mass, damping))
    assert np.max(poles.imag) == pytest.approx(spin * rate / (inertia + across), rel=ROUNDING)
    assert np.max(np.abs(poles.real)) < ROUNDING


def test_modes_push_back_as_their_mesh_does():
    """On a turned mount of a free bus, with a body at the tip."""
    mass, stiffness = mesh(LENGTH, 5, SECTION)
    squares, shapes = eigh(stiffness[6:, 6:], mass[6:, 6:])
    crafts = Craft(), Craft()
    rigid = crafts[0]
    places = LENGTH / 5.0 * np.arange(6)
    follow = np.vstack([rigid.base.at((x, 0.0, 0.0)).rows for x in places])
    found = Modes(
        np.sqrt(squares),
        0.0,
        shapes.T @ (mass @ follow)[6:],
        follow.T @ mass @ follow,
        shapes[-6:].T,
        LENGTH,
    )
    for craft in crafts:
        craft.body(craft.base, 50.0, (0.1, 0.0, 0.2), (9.0, 8.0, 7.0))
        mount = craft.base.at((0.3, 0.1, -0.2), rotation((0.0, 0.6, 0.8), 1.1))
        tip = craft.modes(mount, found)[0] if craft is rigid else None
        craft.body(tip or craft.beam(mount, LENGTH, 5, SECTION)[-1], 3.0, inertia=(0.1, 0.2, 0.3))
    s = 4.0j
    pushed = []
    for craft in crafts:
        mass, _, stiffness = craft.matrices()
        push = np.eye(craft.size, 6)
        pushed.append(np.linalg.solve(s**2 * mass + stiffness, push)[:6])
    np.testing.assert_allclose(*pushed, rtol=1e-8, atol=1e-8 * np.abs(pushed[0]).max())


def test_inertia_of_a_body_beside_the_origin():
    """Parallel axes, by hand."""
    found = body_mass(2.0, (3.0, 0.0, 0.0), (0.1, 0.2, 0.3))
    np.testing.assert_allclose(np.diag(found), [2.0, 2.0, 2.0, 0.1, 18.2, 18.3])
    assert found[1, 5] == pytest.approx(6.0)
    assert found[2, 4] == pytest.approx(-6.0)
