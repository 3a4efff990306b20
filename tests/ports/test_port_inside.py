"""Tests internals, `ports.motions` and `ports.compose`: roots of matrices, conventions,
locked copies, ports from rows."""

import numpy as np
import pytest

from appendages import close
from beamchain import PortModel
from beamchain.ports.compare import tolerance_statement
from beamchain.ports.compose import model_in_space
from beamchain.ports.motions import PORT_MOTION, locked, offset_matrix, square_root
from beamchain.ports.rows import Rows

ROUNDING = 1e-12  # one small eigenproblem or solve there and back


def test_square_root_is_a_root():
    rng = np.random.default_rng(0)
    a = rng.normal(size=(4, 2))
    semidefinite = a @ a.T  # rank 2: rounding may leave it slightly negative
    root = square_root(semidefinite)
    assert root.T @ root == close(semidefinite, abs=1e-14)


def test_two_points_on_a_spring_become_a_port_model():
    # m1 at the port, m2 behind a spring k and a damper c: held sqrt(k / m2), free
    # sqrt(k (m1 + m2) / (m1 m2))
    m1, m2, k, c = 3.0, 2.0, 50.0, 0.4
    rigid = np.sqrt([[m1], [m2]])
    elastic = np.array([[0.0], [np.sqrt(m2)]])
    springs, point = np.array([[0.0], [np.sqrt(k)]]), np.array([[1.0]])
    port = PortModel.from_rows(Rows(rigid, elastic, springs, np.array([[c]]), point))
    assert port.damping_matrix == close(np.array([[c / m2]]), rel=ROUNDING)
    assert port.ratios == close([c / m2 / 10.0], rel=ROUNDING)
    scaled = PortModel.from_rows(Rows(rigid, elastic / np.sqrt(k)))
    assert scaled.frequencies == close(port.frequencies, rel=ROUNDING)
    assert port.rigid_mass == close(np.array([[5.0]]), rel=ROUNDING)
    assert port.frequencies == close([5.0], rel=ROUNDING)
    assert port.participation == close(np.array([[np.sqrt(m2)]]), rel=ROUNDING)
    assert port.free_frequencies == close([np.sqrt(k * 5.0 / 6.0)], rel=ROUNDING)
    assert port.tip == close(np.array([[1.0 / np.sqrt(m2)]]), rel=ROUNDING)


def test_port_motions_are_the_four_of_a_straight_appendage():
    assert set(PORT_MOTION) == {"xy", "xz", "torsion", "axial"}
    assert np.array_equal(PORT_MOTION["xy"], np.eye(6)[:, [1, 5]])
    # rotation about -y
    assert np.array_equal(PORT_MOTION["xz"], np.eye(6)[:, [2, 4]] * [1.0, -1.0])
    assert np.array_equal(PORT_MOTION["torsion"], np.eye(6)[:, [3]])
    assert np.array_equal(PORT_MOTION["axial"], np.eye(6)[:, [0]])
    assert not any(motion.flags.writeable for motion in PORT_MOTION.values())


def test_a_point_moves_with_its_body_and_its_turn():
    point, velocity, rate = np.random.default_rng(1).normal(size=(3, 3))
    found = offset_matrix(point) @ np.concatenate([velocity, rate])
    assert found == close(np.concatenate([velocity + np.cross(rate, point), rate]), rel=ROUNDING)


def test_independent_ports_are_one_model_in_space():
    bending = PortModel(np.eye(2), np.array([3.0, 5.0]), np.array([[0.4, 0.2], [0.1, 0.3]]))
    twist = PortModel(np.array([[1.0]]), np.array([4.0]), np.array([[0.3]]))
    both = model_in_space({"xz": bending, "torsion": twist}, np.eye(6))
    assert both.labels == ("xz", "torsion", "xz")
    assert both.participation.tolist() == [
        [0, 0, 0.4, 0, -0.2, 0],
        [0, 0, 0, 0.3, 0, 0],
        [0, 0, 0.1, 0, -0.3, 0],
    ]


@pytest.mark.parametrize(
    ("error", "word"), [(0.99, "within"), (0.991, "too near"), (1.0, "too near"), (1.001, "above")]
)
def test_how_an_error_stands_to_its_tolerance(error, word):
    """1.01 times the error must keep it."""
    assert tolerance_statement(error * 1e-3, 1e-3).startswith(f"{word} the tolerance 0.001")


def test_locked_copies():
    values = [1, 2]
    assert locked(values).dtype == np.float64
    assert not locked(values).flags.writeable
