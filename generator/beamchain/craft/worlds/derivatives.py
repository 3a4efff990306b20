"""Responses that JAX can differentiate with respect to the frequencies and damping ratios of modes, on MJX."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from beamchain.craft.timing import without_time
from beamchain.craft.worlds.fields import TENDONS, runs_exact, with_fields
from beamchain.craft.worlds.mjx_host import put, settled
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.errors import InputError
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.modal import foreign, modal_tendons
from beamchain.steps.retime import retime

jax: Any = import_module("jax")
jnp: Any = import_module("jax.numpy")
mjx: Any = import_module("mujoco.mjx")

Response = Callable[..., dict[str, Any]]


def response(model: "mujoco.MjModel", read: Callable[[Any, Any], dict[str, Any]]) -> Response:
    """See `Worlds.response`; `read` makes the named arrays of positions and rates."""
    plain = without_time(model)
    modal = modal_tendons(plain)
    if not modal.names:
        raise foreign("a derivative with respect to its modes")
    exact, h = runs_exact(model), float(model.opt.timestep)
    name = NUMBERS[int(model.opt.integrator)]
    phase = retime(with_fields(plain, {}), h, form=2).phase if exact else np.inf
    base, start = put(plain), settled(plain)
    own = {field: jnp.asarray(getattr(plain, field)) for field in TENDONS[:3]}
    nominal = jnp.asarray(modal.frequency), jnp.asarray(modal.damping / (2.0 * modal.frequency))

    def respond(ctrl: Any, frequency: Any = None, damping: Any = None) -> dict[str, Any]:
        w = nominal[0] if frequency is None else jnp.asarray(frequency)
        ratio = nominal[1] if damping is None else jnp.asarray(damping)
        stiffness, drag, armature = w**2, 2.0 * ratio * w, jnp.zeros_like(w)
        if exact:
            mass, drag = _timed(name, w, ratio, h, phase)
            armature = mass - 1.0
        mine = {
            field: own[field].at[modal.index].set(new)
            for field, new in zip(TENDONS, (stiffness, drag, armature), strict=False)
        }
        here = base.tree_replace(mine)

        def one(carry: tuple[Any, Any], now: Any) -> Any:
            data, before = carry
            data = mjx.step(here, data.replace(ctrl=(now + before) / 2.0 if exact else now))
            return (data, now), (data.qpos, data.qvel)

        ctrl = jnp.asarray(ctrl, start.qpos.dtype)
        _, (qpos, qvel) = jax.lax.scan(one, (start, jnp.zeros_like(ctrl[0])), ctrl)
        return read(qpos, qvel)

    return respond


def _timed(name: str, w: Any, ratio: Any, h: float, phase: float) -> tuple[Any, Any]:
    """Mass and damping as of `steps.integrators.timed`, for modes that oscillate."""
    if not SCHEMES[name].exact:
        raise InputError(f"modes cannot be made exact in time under {name}; use Euler or implicitfast.")
    back = h * jnp.minimum(1.0, phase / (w * h))
    x, y = -ratio * w * back, w * jnp.sqrt(1.0 - ratio**2) * back
    mass = (h * w) ** 2 / (jnp.expm1(x) ** 2 + 4.0 * jnp.exp(x) * jnp.sin(y / 2.0) ** 2)
    drag = -mass * jnp.expm1(2.0 * x) / h
    mass = mass * jnp.exp(2.0 * x) if SCHEMES[name].implicit_damping else mass
    return jnp.maximum(mass, 1.0), jnp.maximum(drag, 0.0)
