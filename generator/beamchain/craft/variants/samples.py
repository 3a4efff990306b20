"""Samples of an uncertain craft as plain data: what a worker of a sweep makes."""

from base64 import b64decode, b64encode
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from beamchain.craft.variants.fields import FIELDS, Maker, apply
from beamchain.craft.variants.quantities import Quantity, draws, quantities
from beamchain.craft.variants.refit import Refit
from beamchain.craft.variants.spread import Gain, normal_shapes
from beamchain.engine.library import mujoco, one_thread
from beamchain.errors import BeamchainError, RealisationError
from beamchain.fitting.uncertain import Correlation, UncertainCraft, UncertainModes
from beamchain.ports.motions import Array


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
        """The arrays of one sample.

        Raises:
            BeamchainError: it cannot be made.
        """
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
