"""The host "mjx": MuJoCo's steps in JAX, one compiled program for all worlds and their own fields;
and its derivatives."""

# pyright: reportUnknownLambdaType=false
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from beamchain import retime
from beamchain.errors import InputError
from beamchain.toolkit import (
    NUMBERS,
    SCHEMES,
    TENDONS,
    Array,
    carries_bodies,
    ctrl_bounds,
    foreign,
    modal_tendons,
    mujoco,
    runs_exact,
    with_fields,
    without_timing,
)
from beamchain.worlds.hosts import LARGEST, Flags, Ids

jax: Any = import_module("jax")
jnp: Any = import_module("jax.numpy")
mjx: Any = import_module("mujoco.mjx")

WORKING = 4  # states that the compiled program holds of a world


def _model_in_jax(model: "mujoco.MjModel") -> Any:
    try:
        return mjx.put_model(model)
    except NotImplementedError as error:
        raise InputError(f"MJX does not run this model: {error}; use host='mujoco'.") from None


def _start_of(model: "mujoco.MjModel") -> Any:
    """The initial state in JAX, its types those that a step gives,
    which in doubles differ from those of `put_data`."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    there = mjx.put_data(model, data)
    stepped = jax.eval_shape(mjx.step, _model_in_jax(model), there)
    return jax.tree.map(lambda values, like: jnp.asarray(values, like.dtype), there, stepped)


def bytes_of(model: "mujoco.MjModel") -> float:
    """What MJX needs for one world [bytes]."""
    shapes = jax.eval_shape(lambda: mjx.make_data(_model_in_jax(model)))
    return WORKING * sum(
        float(np.prod(leaf.shape)) * leaf.dtype.itemsize for leaf in jax.tree.leaves(shapes)
    )


class Host:
    """Worlds on JAX's device, in JAX's precision: float32, or float64 with
    `jax.config.update("jax_enable_x64", True)`."""

    def __init__(self, model: "mujoco.MjModel", count: int, stage: int) -> None:
        self._model = _model_in_jax(model)
        self._fields: dict[str, Any] = {}
        self._stage = stage
        self._start = _start_of(model)
        self._state = jax.tree.map(
            lambda values: jnp.repeat(values[None], count, axis=0), self._start
        )

    @property
    def qpos(self) -> Array:
        return np.asarray(self._state.qpos, dtype=np.float64)

    @property
    def qvel(self) -> Array:
        return np.asarray(self._state.qvel, dtype=np.float64)

    @property
    def sensors(self) -> Array:
        if not self._stage:
            return np.zeros((len(self._state.qpos), 0))
        return np.asarray(_read_sensors(self._model, self._fields, self._state), dtype=np.float64)

    def write_fields(self, fields: Mapping[str, Array], ids: Ids) -> None:
        """As `Batch.write_fields`; fields that MJX does not read are left out."""
        for name, values in fields.items():
            nominal = getattr(self._model, name, None)
            if nominal is not None:
                given = jnp.asarray(values, jnp.asarray(nominal).dtype)
                self._fields[name] = (
                    self._fields[name].at[ids].set(given) if name in self._fields else given
                )

    def step(self, first: Array, then: Array, count: int) -> Flags:
        inputs = (jnp.asarray(ctrl, self._state.qpos.dtype) for ctrl in (first, then))
        self._state, bad = _step(self._model, self._fields, self._state, *inputs, count=count)
        return np.asarray(bad)

    def reset(self, ids: Ids, qpos: Array, qvel: Array) -> None:
        there = (
            jnp.asarray(np.broadcast_to(v, (len(ids), v.shape[-1])), self._state.qpos.dtype)
            for v in (qpos, qvel)
        )
        self._state = _restart(self._state, self._start, jnp.asarray(ids), *there)

    def state(self) -> Any:
        return self._state  # JAX's arrays never change

    def restore(self, state: Any) -> None:
        self._state = state


def _map_worlds(function: Any, model: Any, fields: dict[str, Any], *rest: Any) -> Any:
    """`function(model, *rest)` for all worlds, the model with the fields of each."""
    return jax.vmap(lambda new, *each: function(model.tree_replace(new), *each))(fields, *rest)


@partial(jax.jit, static_argnames="count")
def _step(model: Any, fields: dict[str, Any], state: Any, first: Any, then: Any, count: int) -> Any:
    def advance(world: Any, data: Any, a: Any, b: Any) -> Any:
        data = mjx.step(world, data.replace(ctrl=a))
        if count > 1:
            data = jax.lax.fori_loop(
                1, count, lambda _, now: mjx.step(world, now), data.replace(ctrl=b)
            )
        return data, ~(jnp.max(jnp.abs(jnp.concatenate([data.qpos, data.qvel]))) < LARGEST)

    return _map_worlds(advance, model, fields, state, first, then)


@jax.jit
def _read_sensors(model: Any, fields: dict[str, Any], state: Any) -> Any:
    return _map_worlds(
        lambda world, data: mjx.forward(world, data).sensordata, model, fields, state
    )


@jax.jit
def _restart(state: Any, start: Any, ids: Any, qpos: Any, qvel: Any) -> Any:
    state = jax.tree.map(lambda now, then: now.at[ids].set(then), state, start)
    return state.replace(qpos=state.qpos.at[ids].set(qpos), qvel=state.qvel.at[ids].set(qvel))


def response(
    model: "mujoco.MjModel", read: Callable[[Any, Any], dict[str, Any]]
) -> Callable[..., dict[str, Any]]:
    """See `Worlds.response`; `read` makes the named arrays of positions and rates."""
    plain = without_timing(model)
    modal = modal_tendons(plain)
    if not modal.names:
        raise foreign("a derivative with respect to its modes")
    if carries_bodies(plain, modal, None):
        raise InputError(
            "response() is not made for appendages that carry bodies; the worlds themselves step, "
            "and draws of modes change them."
        )
    exact = runs_exact(model)
    h = float(model.opt.timestep)
    name = NUMBERS[int(model.opt.integrator)]
    phase = retime(with_fields(plain, {}), h).phase if exact else np.inf
    base = _model_in_jax(plain)
    start = _start_of(plain)
    tendons = {field: jnp.asarray(getattr(plain, field)) for field in TENDONS[:3]}
    bounds = [jnp.asarray(ends) for ends in ctrl_bounds(plain)]
    nominal = jnp.asarray(modal.frequency), jnp.asarray(modal.damping / (2.0 * modal.frequency))

    def respond(ctrl: Any, frequency: Any = None, damping: Any = None) -> dict[str, Any]:
        w = nominal[0] if frequency is None else jnp.asarray(frequency)
        ratio = nominal[1] if damping is None else jnp.asarray(damping)
        mass, drag = (
            _exact_mass_and_damping(name, w, ratio, h, phase)
            if exact
            else (jnp.ones_like(w), 2.0 * ratio * w)
        )
        new = zip(tendons, (w**2, drag, mass - 1.0), strict=True)
        here = base.tree_replace(
            {field: tendons[field].at[modal.index].set(values) for field, values in new}
        )

        def advance(carry: tuple[Any, Any], now: Any) -> Any:
            data, before = carry
            data = mjx.step(here, data.replace(ctrl=(now + before) / 2.0 if exact else now))
            return (data, now), (data.qpos, data.qvel)

        ctrl = jnp.clip(jnp.asarray(ctrl, start.qpos.dtype), *bounds)
        _, (qpos, qvel) = jax.lax.scan(advance, (start, jnp.zeros_like(ctrl[0])), ctrl)
        return read(qpos, qvel)

    return respond


def _exact_mass_and_damping(
    name: str, w: Any, ratio: Any, h: float, phase: float
) -> tuple[Any, Any]:
    """Mass and damping as of `steps.integrators.timed`, for modes that oscillate."""
    back = h * jnp.minimum(1.0, phase / (w * h))
    x = -ratio * w * back
    y = w * jnp.sqrt(1.0 - ratio**2) * back
    mass = (h * w) ** 2 / (jnp.expm1(x) ** 2 + 4.0 * jnp.exp(x) * jnp.sin(y / 2.0) ** 2)
    drag = -mass * jnp.expm1(2.0 * x) / h
    mass = mass * jnp.exp(2.0 * x) if SCHEMES[name].implicit_damping else mass
    return jnp.maximum(mass, 1.0), jnp.maximum(drag, 0.0)
