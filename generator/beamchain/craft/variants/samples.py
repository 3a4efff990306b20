"""Samples of an uncertain craft as plain data, what a worker of a sweep makes: fields, coupled frequencies, modal gains."""

from base64 import b64decode, b64encode
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from beamchain.craft.plants.craft_modes import linear_craft
from beamchain.craft.plants.signals import base
from beamchain.craft.variants.fields import FIELDS, Maker, apply
from beamchain.craft.variants.quantities import Quantity, draws, quantities
from beamchain.craft.variants.refit import Refit
from beamchain.engine.forces import along
from beamchain.engine.library import mujoco, one_thread
from beamchain.errors import BeamchainError, InputError, RealisationError
from beamchain.fitting.uncertain import Correlation, UncertainCraft, UncertainModes
from beamchain.ports.motions import Array
from beamchain.steps.modal import FILLER

ZERO = 1e-12  # relative: squares of frequencies below it are of springs that others make superfluous


@dataclass(frozen=True, eq=False)
class Gain:
    """A pair of signals, as `torque:bus=attitude`, whose modal gains, over `s^2 + 2 zeta w s + w^2`, are followed.

    `force` `(nv, m)` is what the inputs do to the degrees of freedom, `position` and `rate` `(p, nv)` what the outputs read.
    """

    name: str
    unit: str
    force: Array
    position: Array
    rate: Array

    def sizes(self, frequency: Array, shapes: Array) -> Array:
        """`(n,)` largest singular value of the gain of each mode; damping left out."""
        position, rate, force = (
            np.linalg.norm(rows @ shapes, axis=0) for rows in (self.position, self.rate, self.force.T)
        )
        return np.asarray(np.hypot(position, frequency * rate) * force, dtype=np.float64)


def gain(model: "mujoco.MjModel", pair: str) -> Gain:
    """The signals of `INPUT=OUTPUT`, named as for `bc.plant`."""
    source, sign, seen = pair.partition("=")
    if not sign or not source or not seen:
        raise InputError(
            f"gain = {pair!r} is not INPUT=OUTPUT; write for example torque:{model.body(base(model)).name}=attitude."
        )
    craft = linear_craft(model, None, None, [source], [seen])
    linear = craft.linear
    if np.any(linear.of_acceleration) or not np.any(linear.force):
        raise InputError(
            f"gain = {pair!r}: only forces and torques (also motors') to positions and rates have modal gains of one "
            "number; give attitude, rate, motion:SITE, or a sensor of such."
        )
    out = dict.fromkeys(unit for one in craft.outputs for unit in one.units)
    into = dict.fromkeys(one.unit or "1" for one in craft.inputs)
    unit = f"{' or '.join(f'({one})' if '/' in one else one for one in out)}/s^2 per {' or '.join(into)}"
    return Gain(pair, unit, linear.force, linear.of_position, linear.of_rate)


def usual_gain(model: "mujoco.MjModel") -> tuple[str, ...]:
    """A torque on the base to its attitude, where the base is free and named."""
    body = base(model)
    joint = int(model.body_jntadr[body])
    free = joint >= 0 and int(model.jnt_type[joint]) == 0
    return (f"torque:{model.body(body).name}=attitude",) if free and model.body(body).name else ()


def normal_shapes(model: "mujoco.MjModel", mass: Array) -> tuple[Array, Array]:
    """`(n,)` coupled frequencies of an untimed model [rad/s], ascending, and `(nv, n)` shapes of unit modal mass.

    Fillers, which only hold what the kept modes leave free, are not counted. `mass`: `(nv, nv)`, at rest.
    """
    tendons, joints = (np.atleast_2d(k.T)[0] for k in (model.tendon_stiffness, model.jnt_stiffness))
    sprung, joints = np.flatnonzero(tendons > 0.0), joints[model.dof_jntid]
    rows = [np.sqrt(tendons[i]) * along(model, int(i)) for i in sprung]
    springs = np.vstack([*rows, np.diag(np.sqrt(joints.clip(0.0)))[joints > 0.0]])
    spread = np.linalg.solve(mass, springs.T)
    flexible = springs @ spread
    squares, vectors = np.linalg.eigh((flexible + flexible.T) / 2.0)
    keep = squares > ZERO * max(float(np.max(squares, initial=0.0)), 1e-300)
    fillers = sum(FILLER.search(str(model.tendon(int(i)).name)) is not None for i in sprung)
    w = np.sqrt(squares[keep])[: max(int(np.sum(keep)) - fillers, 0)]
    return w, np.asarray((spread @ vectors[:, keep])[:, : w.size] / w, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Case:
    """An uncertain craft.

    Args:
        model: nominal, compiled, timed or not; its arrays are what varies.
        uncertain: of the craft.
        modes: of the appendages' specifications, by prefix.
        correlations: of theirs, names with prefixes.
        refits: appendages whose structure is uncertain.
        gains: pairs of signals whose modal gains are followed.
        participation: of a single appendage, per port; empty where there are several, or modes that couple ports.
    """

    model: "mujoco.MjModel"
    uncertain: UncertainCraft
    modes: Mapping[str, UncertainModes] = field(default_factory=dict[str, UncertainModes])
    correlations: tuple[Correlation, ...] = ()
    refits: tuple[Refit, ...] = ()
    gains: tuple[Gain, ...] = ()
    participation: Mapping[str, Array] = field(default_factory=dict[str, Array])

    @cached_property
    def maker(self) -> Maker:
        """What makes the variants."""
        return Maker(self.model, refitted=bool(self.refits))

    @cached_property
    def found(self) -> tuple[Quantity, ...]:
        """The uncertain quantities of modes, bodies and joints, at their nominal values."""
        return self.quantities(self.maker.model)

    def quantities(self, model: "mujoco.MjModel") -> tuple[Quantity, ...]:
        """The same of a model with other chains."""
        return quantities(model, self.uncertain, self.modes, self.correlations)

    @cached_property
    def together(self) -> tuple[Correlation, ...]:
        """All correlations."""
        return (*self.correlations, *self.uncertain.correlation)

    def sample(self, seed: int, index: int) -> dict[str, Any]:
        """The arrays of one sample."""
        model, found, rows = copy(self.maker.model), self.found, dict(self.participation)
        for refit in self.refits:
            participation = refit.into(model, seed, index)
            rows = {port: participation[port] for port in rows}
        if self.refits:
            mujoco.mj_setConst(model, self.maker.data)
            found = self.quantities(model)
        values = draws(found, [index], seed, self.together)[0]
        apply(model, found, values, self.maker.data)
        mass = self.maker.mass(model)
        w, shapes = normal_shapes(model, mass)
        if w.size != self.modes_counted:
            raise RealisationError(f"{w.size} coupled modes where the nominal craft has {self.modes_counted}")
        self.maker.time(model, mass)
        factor = {q.owner: value for q, value in zip(found, values, strict=True) if q.kind == "participation"}
        for port, row in rows.items():
            names = [f"mode{k + 1}_{port}" for k in range(len(row))]
            scale = [next((p for owner, p in factor.items() if owner.endswith(name)), 1.0) for name in names]
            rows[port] = row * np.array(scale)[:, None]
        return {
            "values": values,
            "coupled": w,
            **{f"field {name}": np.asarray(getattr(model, name), dtype=np.float64) for name in FIELDS},
            **{f"gain {i}": gain.sizes(w, shapes) for i, gain in enumerate(self.gains)},
            **{f"port {port}": row for port, row in rows.items()},
        }

    @cached_property
    def modes_counted(self) -> int:
        """Number of coupled modes of the nominal craft."""
        return normal_shapes(self.maker.model, self.maker.mass(self.maker.model))[0].size


def vary(case: Case, seed: int, first: int, end: int) -> dict[str, Any]:
    """One job: samples `first` to `end`, as text that `unpacked` reads."""
    rows: dict[int, dict[str, Any]] = {}
    why: dict[str, str] = {}
    with one_thread():
        for index in range(first, end):
            try:
                rows[index] = case.sample(seed, index)
            except BeamchainError as error:
                why[str(index)] = str(error)
    names = next(iter(rows.values()), {})
    packed = {name: _packed(np.array([row[name] for row in rows.values()])) for name in names}
    return {"samples": list(rows), "why": why, "arrays": packed}


def _packed(values: Array) -> list[Any]:
    return [list(values.shape), b64encode(values.astype("<f8").tobytes()).decode("ascii")]


def unpacked(packed: list[Any]) -> Array:
    """An array that a job has made."""
    return np.frombuffer(b64decode(packed[1]), dtype="<f8").reshape(packed[0]).astype(np.float64)
