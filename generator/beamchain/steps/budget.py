"""The step budget of any MuJoCo model: how far each integrator may step,
and what it does to every mode."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from beamchain.engine import linearise as engine
from beamchain.engine.constraints import without_constraints
from beamchain.engine.library import mujoco
from beamchain.engine.model_rows import along_all
from beamchain.engine.operating_point import LIMITS
from beamchain.errors import EngineError
from beamchain.ports.motions import Array
from beamchain.steps.integrators import Complex
from beamchain.steps.limits import LinearModel, oscillating, step_limits
from beamchain.steps.modal import timing_marks
from beamchain.steps.retime import without_timing

HOST = "host RK4"  # a host that drives MuJoCo with its own explicit Runge-Kutta of order 4

AT_REST = 1e-9  # rad/s^2 or m/s^2: what balances to rounding does not accelerate


@dataclass(frozen=True, eq=False)
class Budget:
    """Steps that a model allows; per integrator of the installed MuJoCo and for a host with RK4.

    Args:
        frequencies, ratios: `(n,)` of its oscillating modes [rad/s], damping ratios; without
            timing, where it was made exact in time.
        largest_step: [s]; infinity: no limit.
        accuracy: steps for 1 % and 0.1 % error of the lowest frequency [s].
        shown: `(n, 2)` frequency [rad/s] and damping ratio that the simulation shows at
            `timestep`; NaN: unstable.
    """

    name: str  #: of the model
    frequencies: Array
    ratios: Array
    largest_step: dict[str, float]
    accuracy: dict[str, tuple[float, float]]
    timestep: float
    shown: dict[str, Array]

    def added(self, integrator: str) -> Array:
        """`(n,)` damping ratio that the integrator adds to each mode at `timestep`."""
        return self.shown[integrator][:, 1] - self.ratios

    def as_dict(self) -> dict[str, Any]:
        """For stability.json."""
        return {
            "name": self.name,
            "omega_max": float(np.max(self.frequencies, initial=0.0)),
            "largest_step": self.largest_step,
            "accuracy": {k: {"1%": a, "0.1%": b} for k, (a, b) in self.accuracy.items()},
            "timestep": self.timestep,
            "modes": [
                {
                    "frequency": w,
                    "damping": z,
                    "shown": {
                        k: {"frequency": v[i, 0], "damping": v[i, 1]} for k, v in self.shown.items()
                    },
                }
                for i, (w, z) in enumerate(zip(self.frequencies, self.ratios, strict=True))
            ],
        }


def linear_model(model: "mujoco.MjModel", data: "mujoco.MjData | None" = None) -> LinearModel:
    """The linear model behind a MuJoCo model about a state, the initial one where left out;
    constraints are left out."""
    nv = model.nv
    if nv and _holds_nothing(model):  # differences would show nothing but their own rounding
        nothing = np.zeros((nv, nv))
        return LinearModel(nothing, nothing, nothing, nothing)
    model = without_constraints(model)
    for name in LIMITS:  # what grows comes to the range of a force, and chatters there
        getattr(model, name)[:] = 0
    linear = engine.linearise(model, data)
    if data is None:
        data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pull = preload_sentence(model, data)  # before differences leave their traces in the data
    own = engine.dense_mass(model, data)
    joints = model.dof_damping * engine.euler_damps_implicitly(model)
    spring = linear.stiffness
    if "discrete" in engine.integrators_of(model):
        spring = engine.implicit_stiffness(model, data, linear.damping)
    euler = np.asarray(np.linalg.solve(own, np.diag(joints)), dtype=np.float64)
    rows = along_all(model)
    held = rows.T @ (model.tendon_stiffness[:, None] * rows)
    tendons = np.asarray(np.linalg.solve(own, held), dtype=np.float64)
    return LinearModel(linear.stiffness, linear.damping, euler, spring, tendons, pull)


def preload_sentence(model: "mujoco.MjModel", data: "mujoco.MjData") -> str:
    """A sentence where springs pull in the pose that is linearised about."""
    pull = preload(model, data)
    return pull and (
        f"{pull} in the pose that is linearised about, which therefore is no pose of rest; write "
        "its springref (or its tendon's springlength) so that it is slack there."
    )


def preload(model: "mujoco.MjModel", data: "mujoco.MjData") -> str:
    """The joint whose spring pulls hardest where nothing balances it, and how hard."""
    force = np.abs(np.asarray(data.qfrc_spring))
    if not force.any() or not np.any(np.abs(np.asarray(data.qacc)) > AT_REST):
        return ""
    worst = int(np.argmax(force))
    joint = model.joint(int(model.dof_jntid[worst]))
    unit = "N" if int(joint.type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE) else "N m"
    return (
        f"the spring of joint {joint.name!r} is preloaded: it pulls with "
        f"{float(force[worst]):.4g} {unit}"
    )


def _holds_nothing(model: "mujoco.MjModel") -> bool:
    """No spring, damper, servo, medium or gravity: a rigid free-flyer."""
    parts = (
        model.jnt_stiffness,
        model.tendon_stiffness,
        model.dof_damping,
        model.tendon_damping,
        model.actuator_biasprm,
        model.opt.gravity,
        model.opt.density,
        model.opt.viscosity,
    )
    return not any(np.any(np.asarray(part) != 0.0) for part in parts)


def _own_poles(model: "mujoco.MjModel", timed: Complex) -> Complex:
    """The structure's own oscillating poles: those of the model without timing, one for each of
    the `timed` ones, by frequency."""
    if not any(timing_marks(model)):
        return timed
    plain = oscillating(linear_model(without_timing(model)).poles())
    return plain if plain.size == timed.size else timed


def budget(
    source: "str | Path | mujoco.MjModel", *, timestep: float | None = None, name: str | None = None
) -> Budget:
    """The step budget of a model about its rest pose; refused where nothing oscillates in it,
    or it falls over by itself.

    `timestep` [s] at which the added damping is stated and the `name` shown are the model's
    own where left out.
    """
    model = engine.compile_model(source)
    linear = linear_model(model)
    wanted = oscillating(linear.poles())
    limits = step_limits(linear)
    if wanted.size == 0:
        if limits.omega_max == 0.0:
            raise EngineError(
                "nothing oscillates in the model: no sprung joint; any step is stable as far as it "
                "goes."
            )
        steps = ", ".join(
            f"{name} {step:.4g} s"
            for name, step in limits.largest_step.items()
            if np.isfinite(step)
        )
        raise EngineError(
            "nothing oscillates in the model: every sprung mode is overdamped (fastest rate "
            f"{limits.omega_max:.4g} 1/s), so that there is no frequency to keep; largest stable "
            f"steps: {steps}."
        )
    h = float(model.opt.timestep) if timestep is None else timestep
    own = _own_poles(model, wanted)
    frequencies = np.abs(own)
    ratios = np.clip(-own.real / np.abs(own), 0.0, None)
    ratios = np.where(ratios < 1e-9, 0.0, ratios)
    integrators = engine.integrators_of(model)
    largest = {integrator: limits.largest_step[integrator] for integrator in integrators}
    accuracy = {integrator: limits.accuracy[integrator] for integrator in integrators}
    shown: dict[str, Array] = {}
    for integrator in integrators:
        s = linear.shown(integrator, h, wanted)
        seen = np.column_stack([np.abs(s), -s.real / np.abs(s)])
        shown[integrator] = seen if h < largest[integrator] else np.full_like(seen, np.nan)
    largest[HOST], accuracy[HOST] = largest["RK4"], accuracy["RK4"]
    title = name or model.names[: model.names.index(b"\0")].decode()
    return Budget(title, frequencies, ratios, largest, accuracy, h, shown)
