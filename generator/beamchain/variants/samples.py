"""Samples of an uncertain craft as plain data, what a worker of a sweep makes: fields,
coupled frequencies, modal gains."""

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from beamchain.craft.linear_craft import linear_craft
from beamchain.craft.model_fields import FIELDS, Maker, apply
from beamchain.craft.quantities import Quantity, draws, quantities
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.model_rows import along
from beamchain.engine.signals import base
from beamchain.errors import BeamchainError, InputError, RealisationError
from beamchain.fitting.uncertain import Correlation, UncertainCraft, UncertainModes
from beamchain.ports.motions import Array
from beamchain.steps.modal import FILLER
from beamchain.variants.refit import Refit

# relative: squares of frequencies below it are of springs that others make superfluous
ZERO = 1e-12


@dataclass(frozen=True, eq=False)
class Gain:
    """A pair of signals, as `torque:bus=attitude`, whose modal gains,
    over `s^2 + 2 zeta w s + w^2`, are followed.

    `force` `(nv, m)` is what the inputs do to the degrees of freedom,
    `position` and `rate` `(p, nv)` what the outputs read.
    """

    name: str
    unit: str
    force: Array
    position: Array
    rate: Array

    def sizes(self, frequency: Array, shapes: Array) -> Array:
        """`(n,)` largest singular value of the gain of each mode; damping left out."""
        # (C0 phi + s C1 phi) (phi^T B) at s = j w: of rank one, |C0 phi + j w C1 phi| |phi^T B|
        position = np.linalg.norm(self.position @ shapes, axis=0)
        rate = np.linalg.norm(self.rate @ shapes, axis=0)
        force = np.linalg.norm(self.force.T @ shapes, axis=0)
        return np.asarray(np.hypot(position, frequency * rate) * force, dtype=np.float64)


def gain(model: "mujoco.MjModel", pair: str) -> Gain:
    """The signals of `INPUT=OUTPUT`, named as for `bc.plant`."""
    source, sign, output = pair.partition("=")
    if not sign or not source or not output:
        raise InputError(
            f"gain = {pair!r} is not INPUT=OUTPUT; write for example "
            f"torque:{model.body(base(model)).name}=attitude."
        )
    craft = linear_craft(model, None, None, [source], [output])
    linear = craft.linear
    if np.any(linear.outputs.acceleration) or not np.any(linear.inputs.force):
        raise InputError(
            f"gain = {pair!r}: only forces and torques (also motors') to positions and rates have "
            "modal gains of one number; give attitude, rate, motion:SITE, or a sensor of such."
        )
    output_units = dict.fromkeys(unit for output in craft.outputs for unit in output.units)
    input_units = dict.fromkeys(signal.unit or "1" for signal in craft.inputs)
    tops = [f"({unit})" if "/" in unit else unit for unit in output_units]
    unit = f"{' or '.join(tops)}/s^2 per {' or '.join(input_units)}"
    return Gain(pair, unit, linear.inputs.force, linear.outputs.position, linear.outputs.rate)


def usual_gain(model: "mujoco.MjModel") -> tuple[str, ...]:
    """A torque on the base to its attitude, where the base is free and named."""
    body = base(model)
    joint = int(model.body_jntadr[body])
    free = joint >= 0 and int(model.jnt_type[joint]) == 0
    return (f"torque:{model.body(body).name}=attitude",) if free and model.body(body).name else ()


def normal_shapes(model: "mujoco.MjModel", mass: Array) -> tuple[Array, Array]:
    """`(n,)` coupled frequencies of an untimed model [rad/s], ascending,
    and `(nv, n)` shapes of unit modal mass.

    Fillers, which only hold what the kept modes leave free, are not counted: of as many modes as
    there are filler tendons, those with the largest share of their strain energy in these.
    `mass`: `(nv, nv)`, at rest.
    """
    tendons = np.atleast_2d(model.tendon_stiffness.T)[0]
    joints = np.atleast_2d(model.jnt_stiffness.T)[0][model.dof_jntid]
    sprung = np.flatnonzero(tendons > 0.0)
    filler = [FILLER.search(str(model.tendon(int(i)).name)) is not None for i in sprung]
    of_tendons = [np.sqrt(tendons[i]) * along(model, int(i)) for i in sprung]
    of_joints = np.diag(np.sqrt(joints.clip(0.0)))[joints > 0.0]
    springs = np.vstack([*of_tendons, of_joints])
    # K = S^T S: the eigenvectors v of S M^-1 S^T are the springs' shares, v_i^2 of the energy
    spread = np.linalg.solve(mass, springs.T)
    flexible = springs @ spread
    squares, vectors = np.linalg.eigh((flexible + flexible.T) / 2.0)
    taut = np.flatnonzero(squares > ZERO * max(float(np.max(squares, initial=0.0)), 1e-300))
    held_by_fillers = np.sum(vectors[: len(filler), taut][filler] ** 2, axis=0)
    count = max(taut.size - sum(filler), 0)
    keep = np.sort(taut[np.argsort(held_by_fillers, kind="stable")[:count]])
    w = np.sqrt(squares[keep])
    return w, np.asarray(spread @ vectors[:, keep] / w, dtype=np.float64)


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
        participation: of a single appendage, per port; empty where there are several,
            or modes that couple ports.
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
    def quantities(self) -> tuple[Quantity, ...]:
        """All that is uncertain, at its nominal value: of modes, bodies and joints,
        then of structures."""
        structural = [q for refit in self.refits for q in refit.quantities]
        return (*self.model_quantities, *structural)

    @cached_property
    def model_quantities(self) -> tuple[Quantity, ...]:
        """Those of the nominal model."""
        return self.quantities_on(self.maker.model)

    def check_quantities(self) -> None:
        """Refuse unknown names and impossible ranges; the sentence names what is wrong."""
        self.quantities_on(self.maker.model)

    def quantities_on(self, model: "mujoco.MjModel") -> tuple[Quantity, ...]:
        """The uncertain quantities of modes, bodies and joints of an untimed model,
        whose chains may be others than the nominal ones."""
        return quantities(model, self.uncertain, self.modes, self.correlations)

    @cached_property
    def all_correlations(self) -> tuple[Correlation, ...]:
        """Those of the appendages and of the craft."""
        return (*self.correlations, *self.uncertain.correlation)

    def sample(self, seed: int, index: int) -> dict[str, Any]:
        """The arrays of one sample."""
        model = copy(self.maker.model)
        participation = dict(self.participation)
        structural = [refit.draw(seed, index) for refit in self.refits]
        for refit in self.refits:
            refitted = refit.into(model, seed, index)
            participation = {port: refitted[port] for port in participation}
        if self.refits:
            mujoco.mj_setConst(model, self.maker.data)
        on_model = self.quantities_on(model) if self.refits else self.model_quantities
        values = draws(on_model, [index], seed, self.all_correlations)[0]
        apply(model, on_model, values, self.maker.data)
        mass = self.maker.mass(model)
        w, shapes = normal_shapes(model, mass)
        if w.size != self.modes_counted:
            raise RealisationError(
                f"{w.size} coupled modes where the nominal craft has {self.modes_counted}"
            )
        self.maker.time(model, mass)
        factors = {
            q.owner: value
            for q, value in zip(on_model, values, strict=True)
            if q.kind == "participation"
        }
        arrays = {"values": np.concatenate([values, *structural]), "coupled": w}
        for name in FIELDS:
            arrays[f"field {name}"] = np.asarray(getattr(model, name), dtype=np.float64)
        for i, gain in enumerate(self.gains):
            arrays[f"gain {i}"] = gain.sizes(w, shapes)
        for port, rows in participation.items():
            arrays[f"port {port}"] = _scale_participation(rows, port, factors)
        return arrays

    @cached_property
    def modes_counted(self) -> int:
        """Number of coupled modes of the nominal craft."""
        return normal_shapes(self.maker.model, self.maker.mass(self.maker.model))[0].size


def _scale_participation(rows: Array, port: str, factors: Mapping[str, float]) -> Array:
    """Participation `(n, motions)` of a port's modes by the factors drawn for their tendons."""
    scale = np.ones(len(rows))
    for k in range(len(rows)):
        for owner, factor in factors.items():
            if owner.endswith(f"mode{k + 1}_{port}"):
                scale[k] = factor
    return rows * scale[:, None]


def vary(case: Case, seed: int, first: int, end: int) -> dict[str, Any]:
    """One job: samples `first` to `end`."""
    rows: dict[int, dict[str, Any]] = {}
    why: dict[int, str] = {}
    with one_thread():
        for index in range(first, end):
            try:
                rows[index] = case.sample(seed, index)
            except BeamchainError as error:
                why[index] = str(error)
    names = next(iter(rows.values()), {})
    arrays = {
        name: np.array([row[name] for row in rows.values()], dtype=np.float64) for name in names
    }
    return {"samples": list(rows), "why": why, "arrays": arrays}
