"""Chains by constrained least squares: links the user fixed, a payload that the scene attaches, a second plane.

Logarithms keep every number positive, the rigid mass properties are held exactly, the Jacobian is a complex step.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from beamchain.chain.chain import Chain
from beamchain.chain.recursion import Nodes, realise
from beamchain.errors import RealisationError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine
from beamchain.structure.segment import Lump

Numbers = NDArray[Any]  # float64 or complex128

FREE = ("stiffness", "lengths", "masses")
PARTICIPATION_WEIGHT = 0.2  # against 1 for a relative frequency error
REACH = np.log(1e4)  # how far a parameter may leave its start, in log space
GOOD_ENOUGH = 1e-7  # cost below which no further start is tried: residuals of some 1e-4


class RodModes(NamedTuple):
    """Frequencies `(n,)` [rad/s], participation `(n, 2)`, tip displacement `(n,)`."""

    frequencies: Numbers
    participation: Numbers
    tip: Numbers


class Rods(NamedTuple):
    """Rods with inner ends and mass centres `(N,)` [m]; `N - 1` springs [N m/rad]."""

    starts: Numbers
    masses: Numbers
    centres: Numbers
    inertias: Numbers
    stiffness: Numbers


class TipBody(NamedTuple):
    """A rigid body at the tip."""

    mass: float
    inertia: float


@dataclass(frozen=True, eq=False)
class LoadCase:
    """What the chain shall do with one payload at its tip."""

    payload: TipBody
    target: PortModel


@dataclass(frozen=True, eq=False)
class Found:
    """A fit: hinges `(N - 1,)` [m]; `nodes` where the masses were free."""

    positions: Array
    stiffness: Array
    nodes: Nodes | None
    cost: float
    ok: bool
    message: str
    history: tuple[str, ...]


def fit_planar(beam: MassLine, port: str, cases: Sequence[LoadCase], links: Array, free: Sequence[str] = FREE) -> Found:
    """Fit a planar chain from links `(N,)` [m]; `free`: some of `FREE`."""
    starts = _starts(beam, port, links, "lengths" in free)
    best: Found | None = None
    history: list[str] = []
    for label, lengths in starts:
        problem = _Problem(beam, port, cases, lengths, tuple(free))
        try:
            solved = least_squares(
                problem.residuals, problem.start, jac=problem.jacobian,
                bounds=(problem.start - REACH, problem.start + REACH),
                xtol=1e-11, ftol=1e-6, gtol=1e-15, max_nfev=150,
            )  # fmt: skip
            good = bool(solved.status > 0 or solved.cost < GOOD_ENOUGH)
            found = problem.result(solved.x, float(solved.cost), good, tuple(history))
        except (RealisationError, np.linalg.LinAlgError, ValueError) as error:
            history.append(f"start {label}: {error}")
            continue
        history.append(f"start {label}: cost {solved.cost:.3e} after {solved.nfev} evaluations ({solved.message})")
        if best is None or found.cost < best.cost:
            best = found
        if best.cost < GOOD_ENOUGH:
            break
    if best is None:
        raise RealisationError(f"least squares found no physical chain with {links.size} links: {history[-1]}")
    return replace(best, history=tuple(history))


def fit_stiffness(chain: Chain, port: str, target: PortModel, start: Array) -> tuple[Chain, float]:
    """The chain with springs of one port, from `start` `(h,)`, and the worst residual."""
    scale = np.sqrt(np.diag(target.rigid_mass))
    weight = np.linalg.norm(target.participation / scale, axis=1)[:, None]

    def with_springs(theta: Array) -> Chain:
        springs = zip(chain.hinges, np.exp(theta).tolist(), strict=True)
        return replace(chain, hinges=tuple(replace(h, stiffness={**h.stiffness, port: c}) for h, c in springs))

    def residuals(theta: Array) -> Array:
        modes = with_springs(theta).port(port)
        n = target.modes
        gap = (modes.participation[:n] - target.participation) / scale / weight
        return np.concatenate([np.log(modes.frequencies[:n] / target.frequencies), PARTICIPATION_WEIGHT * gap.ravel()])

    first = np.log(start)
    solved = least_squares(residuals, first, bounds=(first - REACH, first + REACH), xtol=1e-12, ftol=1e-12, gtol=1e-14)
    return with_springs(solved.x), float(np.max(np.abs(residuals(solved.x))))


def payload_cases(beam: Beam, port: str, modes: int, payload: TipBody | None) -> list[LoadCase]:
    """The beam alone; with a payload, also with 2 %, 20 % and all of it."""
    out: list[LoadCase] = []
    for factor in (0.0,) if payload is None else (0.0, 0.02, 0.2, 1.0):
        load = TipBody(0.0, 0.0) if payload is None else TipBody(factor * payload.mass, factor * payload.inertia)
        lumps = beam.lumps
        if load.mass > 0.0:
            lumps = (*lumps, Lump(x=beam.length, mass=load.mass, inertia=(load.inertia, load.inertia, load.inertia)))
        loaded = Beam(segments=beam.segments, joints=beam.joints, lumps=lumps)
        out.append(LoadCase(load, loaded.port(port, modes + 2).truncated(modes)))
    return out


def _starts(beam: MassLine, port: str, links: Array, lengths_free: bool) -> list[tuple[str, Array]]:
    """Link lengths to start from: the user's, the exact chain's, graded ones."""
    out = [("given links", links)]
    if lengths_free:
        modes = links.size - 1
        if modes and isinstance(beam, Beam):
            with suppress(RealisationError):
                exact = realise(beam.port(port, modes + 2).truncated(modes)).lengths.copy()
                exact[-1] += beam.length - exact.sum()
                if np.all(exact > 0.0):
                    out.insert(0, ("exact chain", exact))
        graded = np.linspace(1.0, 3.0, links.size)
        out.append(("graded links", graded / graded.sum() * beam.length))
    return out


class _Problem:
    """Parameters (logarithms) -> rods -> residuals."""

    def __init__(
        self, beam: MassLine, port: str, cases: Sequence[LoadCase], lengths: Array, free: tuple[str, ...]
    ) -> None:
        self.beam, self.port, self.cases, self.free = beam, port, list(cases), free
        self.payloads = [case.payload for case in cases]
        self.wanted_frequencies = np.array([case.target.frequencies for case in cases])
        self.wanted_participation = np.array([case.target.participation for case in cases])
        scale = np.array([np.sqrt(np.diag(case.target.rigid_mass)) for case in cases])[:, None, :]
        self.weights = scale * np.linalg.norm(self.wanted_participation / scale, axis=2, keepdims=True)
        self.lengths = lengths
        self.second = 4 if port == "xy" else 5  # rotary inertia of the plane in Moments
        total = beam.moments(0.0, beam.length, closed=True)
        self.rigid = np.array([total.mass, total.first, total.second + total[self.second]])
        edges = np.concatenate([[0.0], np.cumsum(lengths)])
        middles = (edges[:-1] + edges[1:]) / 2.0
        # the compliance between the middles of neighbouring links, the first and last link's own ends included
        bounds = (
            np.concatenate([[0.0], middles[1:-1], [beam.length]]) if lengths.size > 2 else np.array([0.0, beam.length])
        )
        self.stiffness = np.array([1.0 / beam.compliance(float(a), float(b), port) for a, b in pairwise(bounds)])
        parts = [np.log(self.stiffness)]
        if "lengths" in free:
            parts.append(np.log(lengths))
        if "masses" in free:
            pieces = [
                beam.moments(float(a), float(b), closed=b >= beam.length * (1 - 1e-12)).mass for a, b in pairwise(edges)
            ]
            nodes = np.convolve(np.array(pieces), [0.5, 0.5])
            parts.append(np.log(nodes))
        self.start = np.concatenate(parts)

    def unpack(self, theta: Numbers) -> tuple[Numbers, Numbers, Numbers | None]:
        """Stiffness, lengths, and raw node masses where they are free."""
        n = self.stiffness.size
        stiffness = np.exp(theta[:n])
        at = n
        lengths: Numbers = self.lengths
        if "lengths" in self.free:
            lengths = np.exp(theta[at : at + self.lengths.size])
            at += self.lengths.size
            if "masses" not in self.free:  # pieces of the beam: they fill it
                lengths = lengths * (self.beam.length / np.sum(lengths))
        return stiffness, lengths, np.exp(theta[at:]) if "masses" in self.free else None

    def nodes(self, theta: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Node masses (rigid mass properties held exactly), lengths, stiffness."""
        stiffness, lengths, raw = self.unpack(theta)
        assert raw is not None
        x = np.concatenate([np.zeros(1), np.cumsum(lengths)])
        # masses times a parabola in x, the one that makes mass, centre and inertia the beam's own
        unit = x / self.beam.length
        powers = np.vstack([unit**p for p in range(3)])
        system = powers @ (raw[:, None] * powers.T)
        wanted = self.rigid / np.array([1.0, self.beam.length, self.beam.length**2])
        return raw * (np.linalg.solve(system, wanted.astype(system.dtype)) @ powers), lengths, stiffness

    def rods(self, theta: Numbers) -> Rods:
        """The chain of these parameters."""
        if "masses" in self.free:
            masses, lengths, stiffness = self.nodes(theta)
            return nodes_to_rods(masses, lengths, stiffness)
        stiffness, lengths, _ = self.unpack(theta)
        edges = np.concatenate([np.zeros(1), np.cumsum(lengths)])
        table = np.array([self.cumulative(x, last=i == edges.size - 1) for i, x in enumerate(edges)])
        pieces = np.diff(table, axis=0)
        mass, centre = pieces[:, 0], pieces[:, 1] / pieces[:, 0]
        return Rods(edges[:-1], mass, centre, pieces[:, 2] - mass * centre**2, stiffness)

    def cumulative(self, x: complex, last: bool) -> Numbers:
        """Mass, first and second moment from the root to `x`; a complex step moves the edge."""
        at = float(np.real(x))
        m = self.beam.moments(0.0, at, closed=last)
        value = np.array([m.mass, m.first, m.second + m[self.second]])
        slope = np.imag(x)
        if slope == 0.0 or last:
            return value.astype(np.complex128) if np.iscomplexobj(np.asarray(x)) else value
        if not isinstance(self.beam, Beam):
            raise RealisationError("cutting links out of a mass line needs a beam; let the masses be free.")
        density = self.beam.density(at, self.port)
        return value + 1j * slope * density

    def residuals(self, theta: Numbers) -> Numbers:
        """Relative errors of frequencies and weighted participation, all cases."""
        rods = self.rods(theta)
        if np.any(np.real(rods.masses) <= 0.0) or np.any(np.real(rods.inertias) <= 0.0):
            return np.full(sum(3 * c.target.modes for c in self.cases), 1e3, dtype=theta.dtype)
        modes = loaded_modes(rods, self.beam.length, self.payloads)
        n = self.wanted_frequencies.shape[1]
        gap = (modes.participation[:, :n] - self.wanted_participation) / self.weights
        frequency = np.log(modes.frequencies[:, :n] / self.wanted_frequencies)
        return np.concatenate([frequency.ravel(), PARTICIPATION_WEIGHT * gap.ravel()])

    def jacobian(self, theta: Array) -> Array:
        """Complex-step derivative of the residuals."""
        return jacobian(self.residuals, theta)

    def result(self, theta: Array, cost: float, ok: bool, history: tuple[str, ...]) -> Found:
        """The fit as numbers."""
        rods = self.rods(theta)
        if cost > 1e3 or np.any(rods.masses <= 0.0):
            raise RealisationError("a mass turned negative")
        nodes = None
        if "masses" in self.free:
            masses, lengths, stiffness = self.nodes(theta)
            if np.any(masses <= 0.0):
                raise RealisationError("a mass turned negative")
            nodes = Nodes(masses, lengths, stiffness)
        miss = self.residuals(theta)
        worst = float(np.max(np.abs(miss)))
        message = f"least squares, {', '.join(self.free)} free: worst relative residual {worst:.2e}."
        return Found(rods.starts[1:], rods.stiffness, nodes, cost, ok, message, history)


def loaded_modes(rods: Rods, tip: float, payloads: Sequence[TipBody]) -> RodModes:
    """Modes with each of `k` bodies at the tip: each field has a leading axis."""
    hinges = rods.starts[1:]
    flexible = 1.0 / np.sqrt(rods.stiffness)
    outside = np.tri(rods.masses.size, hinges.size, -1)  # hinge j moves rods j+1 and on
    arms = (rods.centres[:, None] - hinges[None, :]) * outside * flexible
    turns = outside * flexible
    tip_arms = (tip - hinges) * flexible
    pulled, turned = rods.masses[:, None] * arms, rods.inertias[:, None] * turns
    total = np.sum(turned, axis=0)
    mass = np.array([p.mass for p in payloads])[:, None, None]
    rotary = np.array([p.inertia for p in payloads])[:, None, None]
    inertia = arms.T @ pulled + turns.T @ turned
    inertia = inertia + mass * np.outer(tip_arms, tip_arms) + rotary * np.outer(flexible, flexible)
    across = np.column_stack([np.sum(pulled, axis=0), rods.centres @ pulled + total])
    across = across + mass * np.outer(tip_arms, [1.0, tip]) + rotary * np.outer(flexible, [0.0, 1.0])
    values, vectors = np.linalg.eig(inertia)
    order = np.argsort(-np.real(values), axis=1)
    values = np.take_along_axis(values, order, axis=1)
    vectors = np.take_along_axis(vectors, order[:, None, :], axis=2)
    if not np.iscomplexobj(inertia):
        values, vectors = np.real(values), np.real(vectors)
    shapes = np.swapaxes(vectors / np.sqrt(np.sum(vectors * vectors, axis=1))[:, None, :], 1, 2)
    frequencies = 1.0 / np.sqrt(values)
    participation = (shapes @ across) * frequencies[:, :, None]
    tips = (shapes @ tip_arms) * frequencies
    signs = np.where(np.real(participation[:, :, 0]) < 0.0, -1.0, 1.0)
    return RodModes(frequencies, participation * signs[:, :, None], tips * signs)


def nodes_to_rods(masses: Numbers, lengths: Numbers, stiffness: Numbers) -> Rods:
    """Rods from masses `(N + 1,)` and lengths `(N,)`; inner nodes shared in halves."""
    x = np.concatenate([np.zeros(1), np.cumsum(lengths)])
    half = np.concatenate([masses[:1], masses[1:-1] / 2.0, masses[-1:]])
    a = np.concatenate([half[:1], half[1:-1]])
    b = np.concatenate([half[1:-1], half[-1:]])
    total = a + b
    return Rods(x[:-1], total, x[:-1] + lengths * b / total, a * b / total * lengths**2, stiffness)


def jacobian(function: Callable[[Numbers], Numbers], at: Array) -> Array:
    """Complex-step Jacobian `(r, p)` of an analytic `function` at `at` `(p,)`."""
    steps = 1e-30 * np.eye(at.size)
    return np.array([np.imag(function(at + 1j * step)) for step in steps]).T / 1e-30
