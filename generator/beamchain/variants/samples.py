"""Samples of an uncertain craft as plain data, what a worker of a sweep makes: fields,
coupled frequencies, modal gains."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from beamchain.craft.linear_craft import linear_craft
from beamchain.craft.quantities import quantities
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import mass_matrix
from beamchain.engine.model_fields import FIELDS, DrawnFields, put_fields
from beamchain.engine.model_rows import along
from beamchain.engine.signals import base
from beamchain.errors import BeamchainError, InputError
from beamchain.fitting.quantity import Quantity, drawn_fields, draws
from beamchain.fitting.uncertain import Correlation, UncertainCraft, UncertainModes
from beamchain.ports.motions import Array
from beamchain.steps.modal import FILLER, modal_tendons, timing_marks
from beamchain.steps.retime import without_timing
from beamchain.variants.refit import Refit
from beamchain.variants.timing import DrawTiming, drawn_masses, participation_of, with_participation

SINGULAR = 1e-10  # relative: a mass matrix nearer to singular is none
TOO_MUCH = (
    "its participation takes more mass than the appendage has beside its modes; give a smaller "
    "uncertainty."
)
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
    def untimed(self) -> "mujoco.MjModel":
        """The nominal model without timing."""
        out = without_timing(self.model)
        mujoco.mj_setConst(out, mujoco.MjData(out))
        return out

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """All that is uncertain, at its nominal value: of modes, bodies and joints,
        then of structures."""
        structural = [q for refit in self.refits for q in refit.quantities]
        return (*self.quantities_on(self.untimed), *structural)

    def quantities_on(self, model: "mujoco.MjModel") -> tuple[Quantity, ...]:
        """The uncertain quantities of modes, bodies and joints of an untimed model,
        whose chains may be others than the nominal ones."""
        return quantities(model, self.uncertain, self.modes, self.correlations)

    @cached_property
    def modes_counted(self) -> int:
        """Number of coupled modes of the nominal craft."""
        return normal_shapes(self.untimed, mass_matrix(self.untimed))[0].size

    def draw(self, seed: int, indices: Sequence[int]) -> "Samples":
        """Samples of the nominal chains."""
        return self._samples(self.model, self.untimed, self.participation, seed, indices)

    def fit_and_draw(self, seed: int, index: int) -> "Samples":
        """One sample, its structures fitted again."""
        model = copy(self.untimed)
        participation = dict(self.participation)
        structural = [draws(refit.quantities, [index], seed, ()) for refit in self.refits]
        for refit, drawn in zip(self.refits, structural, strict=True):
            refitted = refit.into(model, drawn[0])
            participation = {port: refitted[port] for port in participation}
        mujoco.mj_setConst(model, mujoco.MjData(model))
        out = self._samples(model, model, participation, seed, [index])
        if not out.indices:
            return out
        values = np.hstack([out.arrays["values"], *structural])
        return out._replace(arrays=out.arrays | {"values": values})

    def _samples(
        self,
        timed: "mujoco.MjModel",
        model: "mujoco.MjModel",
        participation: Mapping[str, Array],
        seed: int,
        indices: Sequence[int],
    ) -> "Samples":
        """Samples of one untimed `model`, exact in time as the nominal one; `timed`: with timing
        that may be carried over to them."""
        uncertain = self.quantities_on(model)
        correlations = (*self.correlations, *self.uncertain.correlation)
        values = draws(uncertain, indices, seed, correlations)
        fields = drawn_fields(model, uncertain, values)
        masses = drawn_masses(fields)
        shapes, left_out = self._shapes(fields, masses[0], indices)
        good = [i for i, index in enumerate(indices) if index not in left_out]
        if not good:
            return Samples([], {}, left_out)
        values, fields = values[good], fields.of_draws(good)
        mark = next((mark for mark in timing_marks(self.model) if mark is not None), None)
        if mark is not None:
            timing = DrawTiming.of(timed, mark.timestep, mark.integrator)
            timing.write(fields, masses[:, good] if masses.shape[1] > 1 else masses)
        arrays = {"values": values, "coupled": np.array([w for w, _ in shapes])}
        arrays |= {f"field {name}": rows for name, rows in _all_fields(fields).items()}
        for i, gain in enumerate(self.gains):
            arrays[f"gain {i}"] = np.array([gain.sizes(*each) for each in shapes])
        factors = {
            q.owner: column
            for q, column in zip(uncertain, values.T, strict=True)
            if q.kind == "participation"
        }
        for port, rows in participation.items():
            arrays[f"port {port}"] = _scale_participation(rows, port, factors, len(good))
        return Samples([indices[i] for i in good], arrays, left_out)

    def _shapes(
        self, fields: DrawnFields, masses: Array, indices: Sequence[int]
    ) -> tuple[list[tuple[Array, Array]], dict[int, str]]:
        """Coupled modes of the draws as `normal_shapes` has them, and why others have none;
        `masses` `(k, nv, nv)` or `(1, nv, nv)`."""
        modal = modal_tendons(fields.model)
        participation = participation_of(fields, modal)
        scratch = copy(fields.model)
        shapes: list[tuple[Array, Array]] = []
        left_out: dict[int, str] = {}
        for i, index in enumerate(indices):
            put_fields(scratch, fields.of(i))
            mass = with_participation(masses[i % len(masses)], modal.rows, participation[i])
            if not _is_positive(mass):
                left_out[index] = TOO_MUCH
                continue
            w, of_modes = normal_shapes(scratch, mass)
            if w.size != self.modes_counted:
                left_out[index] = (
                    f"{w.size} coupled modes where the nominal craft has {self.modes_counted}"
                )
            else:
                shapes.append((w, of_modes))
        return shapes, left_out


def _is_positive(mass: Array) -> bool:
    """Whether a mass matrix is one."""
    size = np.sqrt(np.diag(mass).clip(1e-300))
    return float(np.linalg.eigvalsh(mass / np.outer(size, size))[0]) >= SINGULAR


def _all_fields(fields: DrawnFields) -> dict[str, Array]:
    """All fields `(k, ...)` that may differ from the nominal ones, with what MuJoCo derives."""
    model = copy(fields.model)
    data = mujoco.MjData(model)
    rows: dict[str, list[Array]] = {name: [] for name in FIELDS}
    for i in range(fields.count):
        put_fields(model, fields.of(i))
        mujoco.mj_setConst(model, data)
        for name in FIELDS:
            rows[name].append(np.array(getattr(model, name), dtype=np.float64))
    return {name: np.array(values) for name, values in rows.items()}


def _scale_participation(rows: Array, port: str, factors: Mapping[str, Array], count: int) -> Array:
    """`(count, n, motions)` participation of a port's modes, `(n, motions)` by the factors
    `(count,)` drawn for their tendons."""
    scale = np.ones((count, len(rows)))
    for k in range(len(rows)):
        for owner, factor in factors.items():
            if owner.endswith(f"mode{k + 1}_{port}"):
                scale[:, k] = factor
    return rows * scale[:, :, None]


class Samples(NamedTuple):
    """Those that became variants, by number; their arrays by name; why others did not."""

    indices: list[int]
    arrays: dict[str, Array]
    left_out: dict[int, str]


def join_samples(jobs: Sequence[Samples]) -> Samples:
    """Those of several jobs."""
    indices = [index for job in jobs for index in job.indices]
    good = [job.arrays for job in jobs if job.indices]
    arrays = {name: np.concatenate([job[name] for job in good]) for name in (good or [{}])[0]}
    return Samples(indices, arrays, {i: why for job in jobs for i, why in job.left_out.items()})


@one_thread()
def vary(case: Case, seed: int, first: int, end: int) -> Samples:
    """One job: samples `first` to `end`."""
    if not case.refits:
        return case.draw(seed, range(first, end))
    done: list[Samples] = []
    for index in range(first, end):
        try:
            done.append(case.fit_and_draw(seed, index))
        except BeamchainError as error:
            done.append(Samples([], {}, {index: str(error)}))
    return join_samples(done)
