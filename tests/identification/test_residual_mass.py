"""Modes of the prior that a log does not excite, beside a rigid mass that the log changes: what is
left of the rigid mass stays positive, and where it does not, the command says so."""

import json

import numpy as np
import pytest

import beamchain as bc
from beamchain import identification
from command import call

TALL = 0.999  # of the rigid motion along z and about y: what the prior's first two modes move
CRAFT = """<mujoco><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
<site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>"""
OMEGA = np.linspace(0.2, 8.0, 300)


def prior() -> bc.ModalData:
    mass, centre, inertia = 2.4, 4.0, 51.2
    rigid = np.diag([mass, mass, mass, 0.1, inertia, inertia])
    rigid[1, 5] = rigid[5, 1] = mass * centre
    rigid[2, 4] = rigid[4, 2] = -mass * centre
    turn = np.array([[np.cos(1.0), np.sin(1.0)], [-np.sin(1.0), np.cos(1.0)]])
    rows = np.zeros((3, 6))
    rows[:2, 2:5:2] = TALL * turn @ np.linalg.cholesky(rigid[2:5:2, 2:5:2]).T
    rows[2, [1, 5]] = 0.8, 5.0
    return bc.ModalData(
        rigid_mass=rigid,
        frequencies=np.array([0.9, 1.5, 2.0]),
        participation=rows,
        damping=np.full(3, 0.005),
    )


def log(inertia: float) -> dict[str, np.ndarray]:
    """Of an appendage of this inertia about z [kg m^2], 25 of which swing at 2 rad/s."""
    s = 1j * OMEGA
    left = 90.0 + inertia - 25.0 * s**2 / (s**2 + 0.02 * s + 4.0)
    return {"omega": OMEGA, "rate_z/torque_z": 1.0 / (s * left)}


@pytest.mark.parametrize("inertia", [40.0, 70.0])
@pytest.mark.slow
def test_modes_that_are_not_excited_leave_a_positive_mass(inertia):
    found = identification.identify(log(inertia), CRAFT, "mount", prior=prior())
    rows = np.array([mode.participation for mode in found.modes])
    scale = np.sqrt(np.diag(found.rigid))
    left = (found.rigid - rows.T @ rows) / np.outer(scale, scale)
    assert len(found.modes) == 3
    assert np.linalg.eigvalsh(left)[0] > 0.0
    # they take the same share of the new mass as of the old one
    share = np.linalg.eigvals(
        np.linalg.solve(found.rigid[2:5:2, 2:5:2], (rows[:2].T @ rows[:2])[2:5:2, 2:5:2])
    )
    np.testing.assert_allclose(share.real, TALL**2, rtol=1e-9)
    assert found.data().modes == 3
    assert not found.refused


@pytest.mark.slow
def test_a_file_that_is_refused_is_said_to_be(tmp_path, monkeypatch):
    def by_diagonal(rigid: np.ndarray, power: float) -> np.ndarray:
        return np.diag(np.diag(rigid) ** power)

    monkeypatch.setattr("beamchain.identification.diagnostics._root", by_diagonal)
    (tmp_path / "craft.xml").write_text(CRAFT, encoding="utf-8")
    known = prior()
    document = {
        "frequencies": known.frequencies.tolist(),
        "damping": known.damping.tolist(),
        "participation": known.participation.T.tolist(),
        "mass": known.rigid_mass.tolist(),
        "digits": 15,
    }
    (tmp_path / "prior.json").write_text(json.dumps(document), encoding="utf-8")
    (tmp_path / "prior.toml").write_text('[imported]\nfile = "prior.json"\n', encoding="utf-8")
    response = log(40.0)
    columns = [OMEGA, response["rate_z/torque_z"].real, response["rate_z/torque_z"].imag]
    np.savetxt(
        tmp_path / "log.csv",
        np.transpose(columns),
        delimiter=",",
        header="omega,rate_z/torque_z re,rate_z/torque_z im",
        comments="",
        fmt="%.17g",
    )
    names = {
        name: str(tmp_path / name) for name in ("log.csv", "craft.xml", "prior.toml", "m.toml")
    }
    done = call(
        "identify",
        names["log.csv"],
        "--craft",
        names["craft.xml"],
        "--mount",
        "mount",
        "--prior",
        names["prior.toml"],
        "-o",
        names["m.toml"],
    )
    assert done.status == 3
    record = json.loads((tmp_path / "m.json").read_text())
    said = {item["code"]: item["message"] for item in record["warnings"]}
    assert "residual mass" in said["modes-refused"]
    (tmp_path / "spec.toml").write_text('[imported]\nfile = "m.toml"\n', encoding="utf-8")
    with pytest.raises(bc.InputError, match="residual mass"):  # as it was said
        bc.fit(tmp_path / "spec.toml")
