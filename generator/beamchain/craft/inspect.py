"""Modes, masses and step limits of any MuJoCo model, from its own linearisation."""

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain import report
from beamchain.craft.disturbances import left_out
from beamchain.craft.mode_names import cantilever_names, strain_holders, strain_shares
from beamchain.engine.bench import Composite, composite
from beamchain.engine.library import mujoco
from beamchain.engine.linear import linear_at
from beamchain.engine.linearise import NUMBERS, compile_model
from beamchain.engine.operating_point import quiet_copy, rest_point
from beamchain.ports.motions import Array, system_matrix
from beamchain.steps.budget import linear_model
from beamchain.steps.integrators import AT_REST
from beamchain.steps.limits import StepLimits, oscillations, step_limits
from beamchain.steps.modal import TimingMark, timing_marks
from beamchain.steps.poles import PoleRow, mismatch, pole_rows
from beamchain.steps.retime import retime
from beamchain.steps.saturation import servos_that_chatter

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Inspection:
    """What MuJoCo makes of a model about its rest pose.

    `composite`: of every body that moves in the world, with all that hangs on it; `frequencies`
    [rad/s] and `damping` `(n,)` of the oscillating modes; `moving`: of each the shares of the
    strain energy, as of `strain_holders`; `springs`, `tendons`: name, stiffness,
    damping (armature) of what has a spring; `limits`: timing taken out; `shown`: the modes as the
    model's own step shows them, where anything is exact in time; `has_overdamped`: whether
    something that is held does not oscillate.
    """

    name: str
    bodies: int
    joints: int
    dofs: int
    mass: float
    composite: list[Composite]
    frequencies: Array
    damping: Array
    moving: list[dict[tuple[str, str], float]]
    springs: list[tuple[str, float, float]]
    tendons: list[tuple[str, float, float, float]]
    integrator: str
    timestep: float
    limits: StepLimits
    made_for: list[TimingMark]
    shown: list[PoleRow]
    warnings: list[str]
    has_overdamped: bool = False

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return report.inspection_record(self)


def inspect_model(source: "str | Path | mujoco.MjModel") -> Inspection:
    """Inspect a model: path, MJCF text or compiled."""
    model = compile_model(source)
    plain = copy.copy(model)
    made = [mark for mark in timing_marks(model) if mark is not None]
    if made:
        retime(plain, 0.0)
    linear = linear_model(plain)
    found = np.linalg.eig(system_matrix(linear.stiffness, linear.damping))
    poles, shapes = (each.astype(np.complex128) for each in found)
    frequencies, ratios = oscillations(poles)
    fastest = float(np.max(np.abs(poles), initial=0.0))
    damping = np.asarray(model.dof_damping)[model.jnt_dofadr]
    springs = [
        (model.joint(j).name or f"joint {j}", stiffness, float(damping[j]))
        for j in range(model.njnt)
        if (stiffness := float(model.jnt_stiffness[j])) > 0.0
    ]
    tendons = [
        (
            model.tendon(i).name or f"tendon {i}",
            stiffness,
            float(model.tendon_damping[i]),
            float(model.tendon_armature[i]),
        )
        for i in range(model.ntendon)
        if (stiffness := float(model.tendon_stiffness[i])) > 0.0
    ]
    return Inspection(
        name=model.names[: model.names.index(b"\0")].decode(),
        bodies=model.nbody - 1,
        joints=model.njnt,
        dofs=model.nv,
        mass=float(np.sum(model.body_mass)),
        composite=[
            composite(model, i)
            for i in range(1, model.nbody)
            if model.body_parentid[i] == 0 and model.body_dofnum[i]
        ],
        frequencies=frequencies,
        damping=ratios,
        moving=_moving(plain, poles, shapes[: model.nv], frequencies, ratios),
        springs=springs,
        tendons=tendons,
        integrator=NUMBERS[int(model.opt.integrator)],
        timestep=float(model.opt.timestep),
        limits=step_limits(linear),
        made_for=made,
        shown=pole_rows(model) if made else [],
        warnings=[
            *mismatch(model),
            *left_out(model, "the modes and steps"),
            *servos_that_chatter(model),
        ],
        has_overdamped=2 * len(frequencies) < int(np.sum(np.abs(poles) > AT_REST * fastest)),
    )


def _moving(
    model: "mujoco.MjModel", poles: Complex, shapes: Complex, frequencies: Array, ratios: Array
) -> list[dict[tuple[str, str], float]]:
    """What holds the strain energy of the modes with some frequencies [rad/s] and damping ratios,
    by the `shapes` `(nv, k)` of all `poles` `(k,)`: a damper of the craft may turn these from the
    undamped ones."""
    rest = linear_at(rest_point(quiet_copy(model)))
    names, rows = cantilever_names(model, rest.mass, rest.stiffness)
    wanted = frequencies * (1j * np.sqrt(1.0 - ratios**2) - ratios)
    nearest = [int(np.argmin(np.abs(poles - pole))) for pole in wanted]
    share = strain_shares(rows, shapes[:, nearest])
    return [strain_holders(names, each) for each in share.T]
