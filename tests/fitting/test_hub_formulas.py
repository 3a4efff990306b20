"""Closed forms beside the rigid spacecraft: what it weighs about the root, and what none weighs."""

from types import SimpleNamespace

import numpy as np
import pytest

import beamchain as bc
from formulas import assumed_hub, default_hub, port_hub_mass

MASS, INERTIA, OFFSET = 7.0, (3.0, 4.0, 5.0), (0.3, -0.7, 1.1)
PRODUCTS = (0.2, -0.5, 0.4)


def hub(**given):
    return bc.Hub(
        **{"mass": MASS, "inertia": INERTIA, "offset": OFFSET, "products": PRODUCTS, **given}
    )


def energy(mass, inertia, centre):
    """`(6, 6)` whose quadratic form is twice the energy of a body, by the motion of its centre."""
    columns = []
    for i in range(6):
        v, w = np.eye(6)[i, :3], np.eye(6)[i, 3:]
        columns.append(np.concatenate([v + np.cross(w, centre), w]))
    motion = np.column_stack(columns)
    whole = np.zeros((6, 6))
    whole[:3, :3], whole[3:, 3:] = mass * np.eye(3), inertia
    return motion.T @ whole @ motion


def test_mass_matrix_about_the_root_and_back():
    inertia = np.array([[3.0, 0.2, -0.5], [0.2, 4.0, 0.4], [-0.5, 0.4, 5.0]])
    wanted = energy(MASS, inertia, -np.array(OFFSET))
    assert hub().inertia_matrix() == pytest.approx(inertia)
    assert hub().mass_matrix() == pytest.approx(wanted, rel=1e-13, abs=1e-13)
    back = bc.Hub.from_mass_matrix(wanted)
    assert back.mass == pytest.approx(MASS)
    assert back.inertia == pytest.approx(INERTIA)
    assert back.offset == pytest.approx(OFFSET)
    assert back.products == pytest.approx(PRODUCTS)
    # rounding of one triangle goes by half
    wanted[0, 5] += 2e-6
    off = (back.offset[1] - bc.Hub.from_mass_matrix(wanted).offset[1]) * MASS
    assert abs(off) == pytest.approx(1e-6, rel=1e-6)


def test_each_port_feels_its_own_block():
    whole = np.arange(36.0).reshape(6, 6)
    assert np.array_equal(port_hub_mass(whole, "xy"), [[7.0, 11.0], [31.0, 35.0]])
    # the plane xz turns about -y
    assert np.array_equal(port_hub_mass(whole, "xz"), [[14.0, -16.0], [-26.0, 28.0]])
    assert np.array_equal(port_hub_mass(whole, "torsion"), [[21.0]])
    assert np.array_equal(port_hub_mass(whole, "axial"), [[0.0]])


@pytest.mark.parametrize(("reach", "kept"), [(0.999, True), (1.001, False)])
def test_inertia_that_is_lost_beside_the_offset_is_refused(reach, kept):
    """1e-14 of 2 kg times (1e5^2 + 2e5^2) m^2 is 1e-3 kg m^2."""
    given = {
        "mass": 2.0,
        "inertia": (1e-3, 2e-3, 2e-3),
        "offset": (reach * 1e5, 0.0, -reach * 2e5),
        "products": (0.0, 0.0, 0.0),
    }
    if kept:
        assert hub(**given).mass == 2.0
    else:
        with pytest.raises(bc.InputError, match="is lost beside mass x offset"):
            hub(**given)


@pytest.mark.parametrize(("largest", "kept"), [(6.99, True), (7.01, False)])
def test_an_inertia_that_is_more_than_the_other_two_is_refused(largest, kept):
    given = {"inertia": (3.0, 4.0, largest), "products": (0.0, 0.0, 0.0)}
    if kept:
        assert hub(**given).inertia[2] == largest
    else:
        with pytest.raises(bc.InputError, match="belongs to no rigid body"):
            hub(**given)


@pytest.mark.parametrize(
    ("inertia", "product", "kept"),
    [
        # principal moments 3.5 -+ sqrt(1 / 4 + p^2) and 5: a triangle up to p = sqrt(6)
        ((3.0, 4.0, 5.0), 2.4494, True),
        ((3.0, 4.0, 5.0), -2.4494, True),
        ((3.0, 4.0, 5.0), 2.4496, False),
        ((0.05, 4.0, 4.0), 0.0, True),
        ((3.0, 4.0, 7.0), 0.0, True),  # a plate
        ((4.0, 4.0, 7.0), 4.1, False),  # -0.1
    ],
)
def test_products_that_no_body_has_are_refused(inertia, product, kept):
    given = {"inertia": inertia, "products": (product, 0.0, 0.0)}
    if kept:
        assert hub(**given).inertia_matrix()[1, 0] == product
    else:
        with pytest.raises(bc.InputError, match="belong to no rigid body"):
            hub(**given)


def apparent(least):
    """Symmetric, with a smallest eigenvalue."""
    vectors = np.linalg.qr(np.arange(36.0).reshape(6, 6) % 7.0 - 3.0)[0]
    matrix = (vectors * np.array([least, 1.0, 2.0, 3.0, 4.0, 5.0])) @ vectors.T
    return (matrix + matrix.T) / 2.0


def rows(matrix):
    return tuple(tuple(float(x) for x in row) for row in matrix)


@pytest.mark.parametrize("least", [0.05, 1e-3])
def test_an_apparent_mass_stands_in_place_of_the_body(least):
    matrix = apparent(least)
    assert np.array_equal(hub(apparent=rows(matrix)).mass_matrix(), matrix)


@pytest.mark.parametrize(
    "given",
    [
        rows(apparent(-1e-3)),
        rows(apparent(0.1) + 1e-9 * np.eye(6, k=1)),
        rows(apparent(0.1)[:5, :5]),
        rows(apparent(0.1)[:5]),
        (*rows(apparent(0.1)), (1.0, 2.0)),
        tuple((*row, 0.0) for row in rows(apparent(0.1))),
    ],
)
def test_an_apparent_mass_is_symmetric_positive_and_six_by_six(given):
    with pytest.raises(bc.InputError, match="symmetric positive definite 6 x 6"):
        hub(apparent=given)


def test_a_default_hub_is_a_cube_of_ten_times_the_mass():
    """As wide as a tenth of the length, m a^2 / 6, its face at the root."""
    line = SimpleNamespace(rigid_mass=lambda: np.diag([3.0, 4.0, 5.0, 6.0, 7.0, 8.0]), length=7.0)
    found = default_hub(line)
    assert found.mass == pytest.approx(30.0)
    assert found.inertia == pytest.approx((30.0 * 0.49 / 6.0,) * 3)
    assert found.offset == pytest.approx((0.35, 0.0, 0.0))
    small = SimpleNamespace(rigid_mass=lambda: 1e-7 * np.eye(6), length=1e-3)
    assert default_hub(small).inertia == (1e-12,) * 3
    assert "0.1, 1 and 10 times the appendage's 3 kg" in assumed_hub(line)
    assert "has a hub of 30 kg" in assumed_hub(line)
