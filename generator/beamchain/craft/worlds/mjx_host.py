"""The host "mjx": MuJoCo's steps in JAX, one compiled program for all worlds and their own fields."""

from collections.abc import Mapping
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from beamchain.craft.worlds.hosts import LARGEST, Flags, Ids
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.ports.motions import Array

jax: Any = import_module("jax")
jnp: Any = import_module("jax.numpy")
mjx: Any = import_module("mujoco.mjx")

WORKING = 4  # states that the compiled program holds of a world


def make(model: "mujoco.MjModel", count: int, stage: int) -> "Mjx":
    """The host."""
    return Mjx(model, count, stage)


def put(model: "mujoco.MjModel") -> Any:
    """The model in JAX.

    Raises:
        InputError: MJX does not do what the model needs.
    """
    try:
        return mjx.put_model(model)
    except NotImplementedError as error:
        raise InputError(f"MJX does not run this model: {error}; use host='mujoco'.") from None


def settled(model: "mujoco.MjModel") -> Any:
    """The initial state in JAX, its types those that a step gives, which in doubles differ from those of `put_data`."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    there = mjx.put_data(model, data)
    return jax.tree.map(_typed, there, jax.eval_shape(mjx.step, put(model), there))


def bytes_of(model: "mujoco.MjModel") -> float:
    """What MJX needs for one world [bytes]."""
    shapes = jax.eval_shape(lambda: mjx.make_data(put(model)))
    return WORKING * sum(float(np.prod(leaf.shape)) * leaf.dtype.itemsize for leaf in jax.tree.leaves(shapes))


class Mjx:
    """Worlds on JAX's device, in JAX's precision: float32, or float64 with `jax.config.update("jax_enable_x64", True)`."""

    def __init__(self, model: "mujoco.MjModel", count: int, stage: int) -> None:
        self._model, self._own, self._stage = put(model), dict[str, Any](), stage
        self._start = settled(model)
        self._state = jax.tree.map(partial(_repeated, count), self._start)

    @property
    def qpos(self) -> Array:
        """As `Host.qpos`."""
        return np.asarray(self._state.qpos, dtype=np.float64)

    @property
    def qvel(self) -> Array:
        """As `Host.qvel`."""
        return np.asarray(self._state.qvel, dtype=np.float64)

    @property
    def sensors(self) -> Array:
        """As `Host.sensors`."""
        if not self._stage:
            return np.zeros((len(self._state.qpos), 0))
        return np.asarray(_sensed(self._model, self._own, self._state), dtype=np.float64)

    def put(self, fields: Mapping[str, Array], ids: Ids) -> None:
        """As `Host.put`; fields that MJX does not read are left out."""
        for name, values in fields.items():
            nominal = getattr(self._model, name, None)
            if nominal is not None:
                given = jnp.asarray(values, jnp.asarray(nominal).dtype)
                self._own[name] = self._own[name].at[ids].set(given) if name in self._own else given

    def step(self, first: Array, then: Array, count: int) -> Flags:
        """As `Host.step`."""
        kind = self._state.qpos.dtype
        self._state, bad = _stepped(
            self._model, self._own, self._state, jnp.asarray(first, kind), jnp.asarray(then, kind), count=count
        )
        return np.asarray(bad)

    def reset(self, ids: Ids, qpos: Array, qvel: Array) -> None:
        """As `Host.reset`."""
        kind = self._state.qpos.dtype
        shape = (len(ids), -1)
        place, rate = (np.broadcast_to(v, (len(ids), np.shape(v)[-1])).reshape(shape) for v in (qpos, qvel))
        self._state = _restarted(
            self._state, self._start, jnp.asarray(ids), jnp.asarray(place, kind), jnp.asarray(rate, kind)
        )

    def state(self) -> Any:
        """As `Host.state`; JAX's arrays never change."""
        return self._state

    def restore(self, state: Any) -> None:
        """As `Host.restore`."""
        self._state = state


def _typed(values: Any, like: Any) -> Any:
    return jnp.asarray(values, like.dtype)


def _repeated(count: int, values: Any) -> Any:
    return jnp.repeat(values[None], count, axis=0)


def _many(one: Any, model: Any, own: dict[str, Any], *rest: Any) -> Any:
    """`one(model, *rest)` for all worlds, the model with the fields of each."""

    def of_each(fields: dict[str, Any], *each: Any) -> Any:
        return one(model.tree_replace(fields), *each)

    return jax.vmap(of_each)(own, *rest)


@partial(jax.jit, static_argnames="count")
def _stepped(model: Any, own: dict[str, Any], state: Any, first: Any, then: Any, count: int) -> Any:
    def one(mine: Any, data: Any, a: Any, b: Any) -> Any:
        def again(_: int, now: Any) -> Any:
            return mjx.step(mine, now)

        data = mjx.step(mine, data.replace(ctrl=a))
        if count > 1:
            data = jax.lax.fori_loop(1, count, again, data.replace(ctrl=b))
        return data, ~(jnp.max(jnp.abs(jnp.concatenate([data.qpos, data.qvel]))) < LARGEST)

    return _many(one, model, own, state, first, then)


@jax.jit
def _sensed(model: Any, own: dict[str, Any], state: Any) -> Any:
    def one(mine: Any, data: Any) -> Any:
        return mjx.forward(mine, data).sensordata

    return _many(one, model, own, state)


@jax.jit
def _restarted(state: Any, start: Any, ids: Any, qpos: Any, qvel: Any) -> Any:
    def one(now: Any, then: Any) -> Any:
        return now.at[ids].set(then)

    state = jax.tree.map(one, state, start)
    return state.replace(qpos=state.qpos.at[ids].set(qpos), qvel=state.qvel.at[ids].set(qvel))
