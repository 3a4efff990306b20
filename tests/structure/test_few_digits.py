"""Modes typed in with few digits: rounding of the table is no fault of it."""

import json

import numpy as np
import pytest

from beamchain import Beam, Equivalent, InputError, Segment, Spec, fit
from modes_of_beam import modes_of_beam
from spec_tables import spec_of

# what goes in comes back through A and B; least squares and light roots lose the most
MUJOCO = 1e-6
DIGITS = (2, 3, 4, 5)


def boom(ratio: float = 1.4, length: float = 2.0) -> Beam:
    section = Equivalent(
        bending_stiffness_xy=500.0,
        bending_stiffness_xz=500.0 * ratio,
        torsion_stiffness=300.0,
        axial_stiffness=1e6,
        linear_mass=20.0 / length,
        polar_inertia=0.3,
    )
    return Beam(segments=[Segment(length=length, section=section)])


def typed(tmp_path, frequencies, participation, mass, **more) -> Spec:
    """A spec whose file holds these numbers as they are."""
    path = tmp_path / "typed.json"
    table = {"frequencies": list(frequencies), "participation": np.array(participation).tolist()}
    path.write_text(json.dumps({**table, "mass": np.array(mass).tolist(), **more}))
    return spec_of({"imported": {"file": str(path)}})


def rounded(values, digits: int) -> np.ndarray:
    return np.vectorize(lambda v: float(f"{v:.{digits - 1}e}"))(values)


@pytest.mark.parametrize(
    ("digits", "kept"),
    [(2, {"xy": 2}), (3, {"xy": 3, "xz": 2, "torsion": 1})],
)
@pytest.mark.slow
def test_a_rounded_table_gives_its_model(tmp_path, kept, digits):
    data = modes_of_beam(boom(), kept)
    w, rows, mass = (
        rounded(v, digits) for v in (data.frequencies, data.participation.T, data.rigid_mass)
    )
    result = fit(typed(tmp_path, w, rows, mass, length=2.0))
    assert result.status.ok
    achieved = result.space.achieved
    rigid = result.measured.rigid_mass
    assert achieved.frequencies == pytest.approx(np.sort(w), rel=MUJOCO)
    scale = np.sqrt(np.diag(mass))
    order = np.argsort(w, kind="stable")
    assert np.abs(achieved.participation / scale) == pytest.approx(
        np.abs(rows.T[order] / scale), abs=MUJOCO
    )
    # the mass may move within its own last digits and those of the participation
    half = 0.5 * 10.0 ** (1 - digits)
    assert np.max(np.abs(rigid - mass) / np.outer(scale, scale)) < 5.0 * half


def test_directions_without_modes_keep_their_mass(tmp_path):
    """Two digits in every number, and one mode that moves along z only:
    x and y have all their mass left."""
    mass = np.diag([20.0, 20.0, 20.0, 0.5, 25.0, 25.0])
    mass[1, 5] = mass[5, 1] = 20.0
    mass[2, 4] = mass[4, 2] = -20.0
    spec = typed(tmp_path, [4.2], [[0.0], [0.0], [3.7], [0.0], [-4.7], [0.0]], mass)
    result = fit(spec)
    assert np.diag(result.measured.rigid_mass)[:3] == pytest.approx([20.0, 20.0, 20.0], rel=1e-9)
    assert result.space.achieved.frequencies == pytest.approx([4.2], rel=MUJOCO)


@pytest.mark.slow
def test_a_residual_below_zero_by_rounding_is_projected_and_told(tmp_path):
    """A point mass of 20 kg at 2 m on a massless rod, rounded up: 4.473^2 > 20."""
    mass = np.diag([20.0, 20.0, 20.0, 0.5, 80.5, 80.5])
    mass[1, 5] = mass[5, 1] = 40.0
    mass[2, 4] = mass[4, 2] = -40.0
    result = fit(typed(tmp_path, [1.234], [[0.0], [4.473], [0.0], [0.0], [0.0], [8.944]], mass))
    # a filler stands above it
    assert result.space.achieved.frequencies[:1] == pytest.approx([1.234], rel=MUJOCO)
    assert any("printed precision" in step for step in result.status.history)
    assert np.linalg.eigvalsh(result.space.full.residual_mass)[0] > -1e-9


def test_few_digits_are_no_excuse_for_a_wrong_table(tmp_path):
    data = modes_of_beam(boom(), {"xy": 2})
    for digits in DIGITS:
        w, rows, mass = (
            rounded(v, digits) for v in (data.frequencies, data.participation.T, data.rigid_mass)
        )
        with pytest.raises(InputError, match="residual mass"):
            fit(typed(tmp_path, w, 1.1 * rows, mass))
