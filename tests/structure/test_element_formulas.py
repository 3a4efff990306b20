"""Unit loads beside the rows of motion of an appendage cut in pieces."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from formulas import (
    MotionRows,
    Piece,
    PointBody,
    Spring,
    assemble,
    assemble_lowest,
    inverse_stiffness_root,
    legendre_series,
    new_directions,
    shapes_of_fewer,
    sums_behind,
)

STARTS, LENGTHS = (0.0, 0.7, 2.0), (0.7, 1.3, 0.5)
STIFFNESS, SHEARED = (3.0, 5.0, 0.8), (7.0, np.inf, 4.0)
MASS, ROTARY = (2.0, 0.5, 1.1), (0.3, 0.0, 0.2)
HINGES = ((0.0, 6.0), (2.0, 9.0))  # place and stiffness
BODIES = ((0.7, 1.7, 0.6), (2.5, 0.4, 0.9))  # place, mass and inertia
STATIONS = (2.5, 0.7)  # the tip, and one more
POINTS = 6  # of Gauss in each piece


def line_of(functions=4, *, bending=True, sheared=True, rotary=True):
    one = np.ones(POINTS)
    pieces = [
        Piece(
            start,
            length,
            ei * one,
            mass * one,
            one * shear if sheared and np.isfinite(shear) else None,
            one * turned if rotary and turned else None,
        )
        for start, length, ei, mass, shear, turned in zip(
            STARTS, LENGTHS, STIFFNESS, MASS, SHEARED, ROTARY, strict=True
        )
    ]
    return MotionRows(
        pieces,
        hinges=[Spring(*hinge) for hinge in HINGES],
        bodies=[PointBody(*body) for body in BODIES],
        functions=functions,
        bending=bending,
        stations=STATIONS[1:],
    )


def gauss_places():
    xi, weights = leggauss(POINTS)
    places = [a + h * (1.0 + xi) / 2.0 for a, h in zip(STARTS, LENGTHS, strict=True)]
    return np.concatenate(places), np.outer(LENGTHS, weights / 2.0).ravel()


def under_unit_load(x, at, *, moment, sheared=True):
    """Displacement and rotation at `x` under a unit force or moment at `at`, by integrals."""
    xi, weights = leggauss(4)
    move = turn = 0.0
    for start, length, ei, shear in zip(STARTS, LENGTHS, STIFFNESS, SHEARED, strict=True):
        end = min(start + length, x, at)
        if end <= start:
            continue
        s, w = start + (end - start) * (1.0 + xi) / 2.0, (end - start) * weights / 2.0
        bent = (np.ones(4) if moment else at - s) / ei
        turn += w @ bent
        move += w @ (bent * (x - s))
        if not moment and sheared:
            move += (end - start) / shear
    for place, stiffness in HINGES:
        if place < min(x, at):  # a point at a hinge is before it
            angle = (1.0 if moment else at - place) / stiffness
            turn += angle
            move += angle * (x - place)
    return move, turn


@pytest.mark.parametrize("sheared", [True, False])
@pytest.mark.parametrize("rotary", [True, False])
def test_motion_under_loads_at_the_ends_is_that_of_unit_loads(sheared, rotary):
    line = line_of(sheared=sheared, rotary=rotary)
    rows, ends = line.rows(np.eye(line.size))
    places, weights = gauss_places()
    masses = np.repeat(MASS, POINTS)
    inertias = np.repeat(ROTARY, POINTS)
    for k, at in enumerate(STATIONS):
        for moment in (False, True):
            wanted = [
                under_unit_load(x, at, moment=moment, sheared=sheared)
                for x in (*(body[0] for body in BODIES), *places)
            ]
            move, turn = np.array(wanted).T
            parts = [turn[:2] * np.sqrt([0.6, 0.9])]
            if rotary:
                parts.append(turn[2:] * np.sqrt(weights * inertias))
            parts += [move[:2] * np.sqrt([1.7, 0.4]), move[2:] * np.sqrt(weights * masses)]
            found = rows.T @ ends[:, 2 * k + moment]
            assert found == pytest.approx(np.concatenate(parts), rel=1e-11, abs=1e-13)
            of_ends = [under_unit_load(x, at, moment=moment, sheared=sheared) for x in STATIONS]
            assert ends.T @ ends[:, 2 * k + moment] == pytest.approx(np.ravel(of_ends), rel=1e-11)


def test_twist_under_moments_at_the_ends_is_that_of_unit_moments():
    line = line_of(bending=False, sheared=False)
    rows, ends = line.rows(np.eye(line.size))
    places, weights = gauss_places()
    for k, at in enumerate(STATIONS):
        turn = np.array(
            [under_unit_load(x, at, moment=True)[1] for x in (0.7, 2.5, *places, *STATIONS)]
        )
        roots = np.sqrt([1.7, 0.4, *(weights * np.repeat(MASS, POINTS))])
        assert rows.T @ ends[:, k] == pytest.approx(roots * turn[:-2], rel=1e-11)
        assert ends.T @ ends[:, k] == pytest.approx(turn[-2:], rel=1e-11)


@pytest.mark.parametrize(
    "how",
    [{}, {"sheared": False}, {"rotary": False}, {"bending": False, "sheared": False}],
    ids=["whole", "no shear", "no rotary inertia", "torsion"],
)
def test_loads_are_the_transpose_of_the_rows(how):
    line = line_of(**how)
    rows, ends = line.rows(np.eye(line.size))
    random = np.random.default_rng(3)
    forces, tip = random.normal(size=(2, rows.shape[1])), random.normal(size=(2, ends.shape[1]))
    wanted = forces @ rows.T + tip @ ends.T
    assert line.loads(forces, tip) == pytest.approx(wanted, rel=1e-11, abs=1e-12)
    coordinates = random.normal(size=(3, line.size))
    found = line.rows(coordinates)
    assert found[0] == pytest.approx(coordinates @ rows, rel=1e-11, abs=1e-12)
    assert found[1] == pytest.approx(coordinates @ ends, rel=1e-11, abs=1e-12)


def test_rigid_rows_and_shapes_are_at_bodies_and_points():
    places, weights = gauss_places()
    line = line_of()
    turned = np.sqrt([0.6, 0.9, *(weights * np.repeat(ROTARY, POINTS))])
    moved = np.sqrt([1.7, 0.4, *(weights * np.repeat(MASS, POINTS))])
    at = np.array([0.7, 2.5, *places])
    nothing = np.zeros(at.size)
    assert line.rigid == pytest.approx(
        np.array([[*nothing, *moved], [*turned, *(moved * at)]]), rel=1e-13
    )
    # in the mass matrix: that of three rods and two bodies
    mass = sum(m * h for m, h in zip(MASS, LENGTHS, strict=True)) + 2.1
    assert (line.rigid @ line.rigid.T)[0, 0] == pytest.approx(mass)
    values = np.random.default_rng(1).normal(size=(2, 2 * at.size))
    shapes = line.shapes(values)
    assert shapes.x == pytest.approx(np.array([*at, *at]))
    assert shapes.moved == pytest.approx(np.array([*nothing, *moved]))
    assert shapes.turned == pytest.approx(np.array([*turned, *nothing]))
    assert shapes.bending
    q = np.linalg.qr(np.random.default_rng(2).normal(size=(2 * at.size, 5)))[0]
    told = shapes_of_fewer(line, q, values @ q)
    assert told.values == pytest.approx(values @ q @ q.T)
    plain = line_of(rotary=False).shapes(values[:, : at.size + 2])
    assert plain.x == pytest.approx(np.array([0.7, 2.5, *at]))
    twisted = line_of(bending=False, sheared=False).shapes(values)
    assert (twisted.moved, twisted.turned) == (pytest.approx(moved), pytest.approx(nothing))
    assert line_of(bending=False, sheared=False).rigid == pytest.approx(moved[None])
    assert not twisted.bending


def test_integrals_of_legendre_s_polynomials():
    values, once, twice, ends = legendre_series(3, 5)
    xi = leggauss(5)[0]
    # 1, x, (3 x^2 - 1) / 2; integrated from -1
    assert values == pytest.approx(np.column_stack([xi**0, xi, (3.0 * xi**2 - 1.0) / 2.0]))
    first = [xi + 1.0, (xi**2 - 1.0) / 2.0, (xi**3 - xi) / 2.0]
    assert once == pytest.approx(np.column_stack(first))
    second = [(xi + 1.0) ** 2 / 2.0, xi**3 / 6.0 - xi / 2.0 - 1.0 / 3.0, (xi**2 - 1.0) ** 2 / 8.0]
    assert twice == pytest.approx(np.column_stack(second))
    assert ends == pytest.approx([2.0, -2.0 / 3.0, 0.0], abs=1e-15)


def test_root_of_a_stiffness_makes_it_one():
    random = np.random.default_rng(0)
    strain, weight = random.normal(size=(6, 3)), random.uniform(0.5, 2.0, (2, 6))
    for root, w in zip(inverse_stiffness_root(strain, weight), weight, strict=True):
        assert root.T @ (strain.T * w) @ strain @ root == pytest.approx(np.eye(3), abs=1e-12)


def test_sums_of_what_is_behind():
    assert sums_behind(np.array([[1.0, 2.0, 4.0, 8.0]])).tolist() == [[14.0, 12.0, 8.0]]


def test_new_directions_are_those_outside_the_space():
    random = np.random.default_rng(7)
    every = np.linalg.qr(random.normal(size=(6, 6)))[0]
    space, outside = every[:2], every[2:]
    inside = random.normal(size=(4, 2)) @ space
    sizes = np.array([[1e-3], [1.0], [1e3], [1.0]])
    mixed = np.vstack([random.normal(size=(3, 3)) @ outside[:3], np.zeros((1, 6))])
    mixed[2] = mixed[0] - 2.0 * mixed[1]  # depends on the other two
    found = new_directions(space, sizes * (mixed + inside))
    assert found.shape == (2, 6)
    assert found @ found.T == pytest.approx(np.eye(2), abs=1e-13)
    assert found @ space.T == pytest.approx(np.zeros((2, 2)), abs=1e-13)
    # span what the first two did
    assert mixed[:2] @ found.T @ found == pytest.approx(mixed[:2], abs=1e-12)
    # a remainder of 1e-11 counts, a smaller one is rounding
    for part, count in ((2e-11, 1), (0.5e-11, 0)):
        assert len(new_directions(space, space[:1] + part * outside[:1])) == count


def uniform(count, functions, *, bending):
    one = np.ones(functions + 5)
    pieces = [Piece(k / count, 1.0 / count, 2.0 * one, 8.0 * one) for k in range(count)]
    return MotionRows(
        pieces, hinges=[], bodies=[], functions=functions, bending=bending, stations=[]
    )


@pytest.mark.parametrize("shaped", [False, True])
def test_lowest_frequencies_of_many_pieces_are_those_of_a_rod(shaped):
    # sqrt(GJ / i) = 1/2; held at the root: odd multiples of pi / 2, free: multiples of pi
    model = assemble_lowest(uniform(40, 3, bending=False), 4, shaped=shaped)
    assert model.frequencies[:4] == pytest.approx(np.pi / 4.0 * np.array([1, 3, 5, 7]), rel=1e-8)
    assert model.free_frequencies[:4] == pytest.approx(np.pi / 2.0 * np.arange(1, 5), rel=1e-8)
    assert model.modes < 120  # coordinates
    # participation squared: 8 i L / ((2 n - 1) pi)^2; the tip turns by sqrt(2 / (i L))
    assert model.participation[:4, 0] ** 2 == pytest.approx(
        8.0 * 8.0 / (np.pi * np.array([1, 3, 5, 7])) ** 2, rel=1e-8
    )
    assert np.abs(model.tip[:4, 0]) == pytest.approx([0.5] * 4, rel=1e-8)
    assert (model.shapes is not None) == shaped


def test_lowest_modes_of_many_pieces_are_those_of_a_beam():
    # cos b cosh b = -1; sqrt(EI / m) = 1/2
    b = np.array([1.8751040687119611, 4.6940911329741746, 7.854757438237613])
    for model in (
        assemble_lowest(uniform(30, 4, bending=True), 3),
        assemble(uniform(2, 14, bending=True)),
    ):
        assert model.frequencies[:3] == pytest.approx(0.5 * b**2, rel=1e-9)
        assert np.abs(model.tip[:3, 0]) == pytest.approx([2.0 / np.sqrt(8.0)] * 3, rel=1e-8)
