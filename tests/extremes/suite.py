"""Runs the cases: each passes its tolerances by the independent check, is refused with a reason,
or has failed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from joblib import Parallel, delayed, parallel_config
from numpy.typing import NDArray

from beamchain import BeamchainError, Fit, fit
from extremes.cases import Case
from extremes.compiled import frequencies
from extremes.truth import Rod

Array = NDArray[np.float64]

FREQUENCY = 1e-6  # relative: a natural frequency of the beam lies as near to each of MuJoCo's
PARTICIPATION = 1e-4  # relative to its own norm, of the outer product, however weak the mode
# relative to the geometric means of the diagonal; behind a joint softened by 1e-6 digits are lost
MASS = 1e-7
DAMPING = 1e-3  # relative, of every ratio
TORSION = 1e-8  # relative, against the closed form of the prismatic rod

PASSED, REFUSED, FAILED = "passed", "refused", "failed"


@dataclass(frozen=True)
class Row:
    """What became of a case.

    Args:
        case: the case.
        verdict: "passed", "refused" or "failed".
        reason: of a refusal or failure; of a pass, what was said where fewer modes came out.
        modes: kept in plane xy.
    """

    case: Case
    verdict: str
    reason: str
    modes: int

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        values = {name: getattr(self.case, name) for name in self.case.__dataclass_fields__}
        return {**values, "verdict": self.verdict, "reason": self.reason, "modes_kept": self.modes}


@dataclass(frozen=True, eq=False)
class Extremes:
    """All rows, with their counts."""

    rows: list[Row]

    def count(self, verdict: str) -> int:
        """Rows with a verdict."""
        return sum(row.verdict == verdict for row in self.rows)

    @property
    def failed(self) -> int:
        """Silent failures."""
        return self.count(FAILED)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "cases": len(self.rows),
            "passed": self.count(PASSED),
            "refused": self.count(REFUSED),
            "failed": self.failed,
            "rows": [row.as_dict() for row in self.rows],
        }


def run(
    chosen: Sequence[Case], say: Callable[[int], None] = lambda _: None, processes: int = 1
) -> Extremes:
    """Run cases.

    Args:
        chosen: which.
        say: told how many are done.
        processes: that share the work.
    """
    rows: list[Row] = []
    jobs = (delayed(verdict)(case) for case in chosen)
    with parallel_config("loky", n_jobs=processes, inner_max_num_threads=1):
        for row in Parallel(return_as="generator")(jobs):
            rows.append(row)
            say(len(rows))
    return Extremes(rows)


def verdict(case: Case) -> Row:
    """Fit one case and judge it."""
    try:
        result = fit(case.spec())
    except BeamchainError as error:
        return Row(case, REFUSED, str(error), 0)
    except Exception as error:
        return Row(case, FAILED, f"{type(error).__name__}: {error}", 0)
    try:
        judged = judge(case, result)
    except Exception as error:  # a file that cannot be judged cannot be used either
        judged = f"{type(error).__name__}: {error}"
    kept = result.target["xy"].modes
    if judged:
        return Row(case, FAILED, judged, kept)
    return Row(case, PASSED, "" if result.status.ok else result.status.message, kept)


def judge(case: Case, result: Fit) -> str:
    """What is wrong with a fit by the independent check; empty: nothing.

    MuJoCo compiles the files the user gets; its mass matrix and springs are read from there. What
    the package read through A and B, and printed, is held against the same truth.
    """
    rod = case.rod()
    held = mujoco.MjModel.from_xml_string(result.to_mjcf())
    scene = mujoco.MjModel.from_xml_string(result.scene_mjcf())
    for model in (held, scene):
        data = mujoco.MjData(model)
        before = mujoco.get_mju_user_warning()
        # else it goes to MUJOCO_LOG.TXT in the working folder
        mujoco.set_mju_user_warning(lambda message: None)
        mujoco.mj_step(model, data)
        mujoco.set_mju_user_warning(before)
        if np.any(data.warning.number):
            return "MuJoCo warns in the first step at rest"
    wanted = {
        "xy": case.modes,
        **({"xz": case.modes, "torsion": min(case.modes, 1)} if case.space else {}),
    }
    for port, count in wanted.items():
        modes = result.target[port].modes
        if modes < count and result.status.ok:
            return f"{port} keeps {modes} of {count} modes without saying so"
    for port in [p for p in ("xy", "xz") if p in wanted]:
        modes = result.target[port].modes
        ours = frequencies(held, port)
        wrong = _plane(case, rod, result, scene, port, ours[:modes])
        if wrong:
            return f"{port}: {wrong}"
    if "torsion" in wanted and case.target == "clamped" and case.taper == 1.0 and case.joint == 0.0:
        truth = np.pi / 2.0 * np.sqrt(case.modulus / 2.6 / case.density) / case.length
        seen = float(frequencies(held, "torsion")[0])
        if abs(seen / truth - 1.0) > TORSION:
            return f"torsion is off by {seen / truth - 1.0:.1e}"
    return _mass(rod, scene, result.spec.name) or _damping(case, result)


def _plane(
    case: Case, rod: Rod, result: Fit, scene: "mujoco.MjModel", port: str, ours: Array
) -> str:
    """One bending plane of the exact chain."""
    achieved = result.achieved[port]
    n = ours.size
    if case.target == "clamped":
        inside, outer, below = rod.check_poles(ours**2, FREQUENCY)
        size = np.sqrt(np.diag(rod.rigid()))
        for k in range(n):
            if not inside[k] or below[k] != k + 1:
                return (
                    f"held mode {k + 1} of MuJoCo is not the beam's ({below[k]} of its modes "
                    "lie below)"
                )
            row = achieved.participation[k] / size
            true = outer[k] / np.outer(size, size)
            miss = float(np.linalg.norm(np.outer(row, row) - true) / np.linalg.norm(true))
            if miss > PARTICIPATION:
                return f"participation of mode {k + 1}, read through A and B, is off by {miss:.1e}"
        read = achieved.frequencies[:n]
        what = "held"
    else:
        hub = case.hub_body
        arm = hub.offset[0]
        mass = np.array(
            [[hub.mass, -hub.mass * arm], [-hub.mass * arm, hub.inertia[2] + hub.mass * arm**2]]
        )
        if case.target == "free":
            mass = np.zeros((2, 2))
            coupled = frequencies(scene, port, f"{result.spec.name}_link1")[:n]
        else:
            coupled = frequencies(scene, port, "hub")[:n]
        inside, _, below = rod.check_poles(coupled**2, FREQUENCY, mass)
        for k in range(n):
            if not inside[k] or below[k] != k + 1:
                return (
                    f"{case.target} mode {k + 1} of MuJoCo is not the beam's ({below[k]} of "
                    "its "
                    "modes lie below)"
                )
        ours = coupled
        read = achieved.with_hub(mass).free_frequencies[:n]
        what = "coupled"
    miss = float(np.max(np.abs(read / ours[: read.size] - 1.0)))
    return (
        f"{what} frequencies read through A and B are off by {miss:.1e}"
        if miss > FREQUENCY or read.size < n
        else ""
    )


def _mass(rod: Rod, scene: "mujoco.MjModel", name: str) -> str:
    """Total mass, first and second moment about the root of the compiled bodies."""
    data = mujoco.MjData(scene)
    mujoco.mj_forward(scene, data)
    origin = data.body(f"{name}_link1").xpos
    out = np.zeros((2, 2))
    for i in range(scene.nbody):
        if scene.body(i).name.startswith(f"{name}_"):
            m = float(scene.body_mass[i])
            x = float(data.xipos[i, 0] - origin[0])
            out += [[m, m * x], [m * x, m * x * x + float(scene.body_inertia[i, 2])]]
    truth = rod.rigid()
    miss = float(np.max(np.abs(out - truth) / np.sqrt(np.outer(np.diag(truth), np.diag(truth)))))
    return f"rigid mass is off by {miss:.1e}" if miss > MASS else ""


def _damping(case: Case, result: Fit) -> str:
    """Every kept mode's ratio, as MuJoCo reads it back."""
    if case.damping == 0.0:
        return ""
    for port, achieved in result.achieved.items():
        kept = achieved.damping[: result.target[port].modes]
        miss = float(np.max(np.abs(kept / case.damping - 1.0)))
        if miss > DAMPING:
            return f"{port}: a damping ratio is off by {miss:.1e}"
    return ""
