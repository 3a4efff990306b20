"""One identification from its channels: start, physical model, likelihood, what is held out, what is said."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from beamchain.caution import Caution
from beamchain.craft.identification.channels import FEWEST, Channels
from beamchain.craft.identification.delay import aligned
from beamchain.craft.identification.describe import TWO, Estimate
from beamchain.craft.identification.hub import Bare
from beamchain.craft.identification.likelihood import COLOURED, Found, Likelihood, compressed
from beamchain.craft.identification.prior import DAMPING, SMALL, UNKNOWN_DAMPING, Matched, Prior, matched
from beamchain.craft.identification.resolution import resolved
from beamchain.craft.identification.response import Data, Piece, Raw
from beamchain.craft.identification.result import Identification
from beamchain.craft.identification.sanity import check_rigid, folded
from beamchain.craft.identification.start import Started, frozen, started
from beamchain.craft.identification.structure import Body, Parts, Structure, Unknown, body_of, clamped, frozen_inertia
from beamchain.errors import InputError
from beamchain.ports.motions import Array

ITERATIONS = 60
LIKELY = 1e-3  # probability of the gain of one mode more by noise alone, below which it is told
NO_NOISE = 1e-22  # mean square of residuals, relative to the data, that is rounding
NOTHING = 1.2  # error of a prediction over what is predicted, beyond which it is none
LIGHT = 0.01  # of the hub's mass: most that is stated for an appendage of unknown mass
SHARE = 0.05  # of the inertia that no mode holds, which that mass may take


@dataclass(eq=False)
class Run:
    """One identification, step by step.

    Args:
        data, known, prior: what the log holds, the bare craft, and what is believed.
        wanted: number of modes; None: as the criterion says.
        held: the last part of each log, predicted from the rest.
        free_hub: the hub's inertia is estimated too.
    """

    data: Channels
    known: Bare
    prior: Prior | None
    wanted: int | None
    held: float
    free_hub: bool

    def __post_init__(self) -> None:
        self.warnings: list[str] = list(self.data.warnings)
        self.doubtful: Array = np.zeros(0)
        self.widened: float = 1.0
        self.aliased: list[complex] = []
        self.rigid: Array = np.zeros((6, 6)) if self.prior is None else self.prior.parts.rigid

    def result(self, at: str, *, offset: bool) -> Identification:
        """Start, refine, judge; with `offset` the sensors lag behind the torques."""
        data = self.data
        shown, hidden = self._parted()
        inertia = frozen_inertia(self.known.mass, self.rigid)
        guess = data.outputs @ np.linalg.solve(inertia, data.inputs.T)
        if isinstance(data.pieces[0], Piece):
            check_rigid(frozen(shown, guess, data.scale).rigid, data, self.known, self.rigid, roughly=True)
        elif offset:
            raise InputError(
                "offset is for time logs; a delay in a frequency response is in its phase: take it out before."
            )
        if offset:
            lag, data = aligned(data, guess)
            self.data = data
            text = f"the sensors lag {lag:.5g} s behind the torques, as estimated; its uncertainty is not in the intervals."
            self._warn("offset", text)
            shown, hidden = self._parted()
        begun = started(shown, guess, data.scale, self.wanted)
        self._judge_start(begun)
        structure, theta, pairs = self._structure(begun)
        likelihood = self._likelihood(structure, theta, pairs, shown)
        if not self.aliased:
            form = begun.form
            near = compressed(
                lambda x: form.theta(structure.raw(x)), form.theta(begun.raw), begun.matrix, likelihood.belief, theta
            )
            theta = min((theta, near), key=lambda x: likelihood.cost(likelihood.squares(structure.raw(x)), x))
        found, predicted = likelihood.best(theta, ITERATIONS), np.full(len(data.sensed), np.nan)
        likelihood = replace(likelihood, pieces=data.pieces)
        if hidden:
            predicted = self._predicted(structure.raw(found.theta), hidden)
            found = likelihood.best(found.theta, ITERATIONS)
        estimate = self._estimate(structure, likelihood, found, begun, pairs, predicted)
        return _unpredicted(resolved(estimate.result(at), structure, found, likelihood), predicted)

    def _warn(self, code: str, text: str) -> None:
        self.warnings.append(Caution(code, text))

    def _parted(self) -> tuple[list[Data], list[Piece]]:
        """Pieces with their last part not used, and with nothing but it used."""
        pieces = [p for p in self.data.pieces if isinstance(p, Piece)]
        if self.held == 0.0 or not pieces:
            return self.data.pieces, []
        shown, hidden = list[Data](), list[Piece]()
        for log in {p.log for p in pieces}:
            own = [p for p in pieces if p.log == log]
            end = own[0].time[0] + (1.0 - self.held) * (own[-1].time[-1] - own[0].time[0])
            for piece in own:
                late = (piece.time > end)[:, None]
                first = int(np.argmax(late)) if late.any() else piece.time.size
                if first >= FEWEST:
                    shown.append(piece.part(0, first))
                    if late.any():
                        hidden.append(replace(piece, use=piece.use & late))
        return shown, hidden

    def _judge_start(self, begun: Started) -> None:
        check_rigid(begun.raw.rigid, self.data, self.known, self.rigid)
        wanted, free = self.wanted, np.abs(begun.raw.poles)
        if wanted is not None and begun.better > wanted:
            self._warn(
                "model-order",
                f"{wanted} modes were asked for, but the criterion is lower with {begun.better}; "
                "what is left out falsifies the others.",
            )
        if wanted is not None and begun.better < wanted:
            self._warn("model-order", f"{wanted} modes were asked for, but the log supports {begun.better} only.")
        later = next((one for one in begun.orders if one.modes == free.size + 1), None)
        if later is not None and float(chi2.sf(later.gain, begun.each)) < LIKELY:
            apart = np.abs(later.frequencies - free[:, None])
            where = later.frequencies[np.argmax(np.min(apart, axis=0, initial=np.inf) / later.frequencies)]
            self._warn(
                "model-order",
                f"one mode more, near {where:.4g} rad/s on the free craft, would be significant, though the "
                f"criterion is lower with {free.size}: it may be there, or a mode may stand for two.",
            )
            self.doubtful = later.frequencies
            if np.any(np.sum(apart < -TWO * begun.raw.poles.real[:, None], axis=1) > 1):
                self.widened = max(1.0, later.gain / begun.each)
        if not free.size:
            tried = sum(one.modes > 0 for one in begun.orders)
            raise InputError(
                "the log shows no flexible mode: with none the criterion is lowest"
                + (f" ({tried} tried)" if tried else "")
                + "; excite the craft more strongly or for longer, with torque steps shorter than the period sought."
            )

    def _structure(self, begun: Started) -> tuple[Structure, Array, Matched | None]:
        """The physical model, the parameters to begin with, and which modes of the prior they are."""
        data, mass, prior, axes = self.data, self.known.mass, self.prior, self.data.axes
        raw, self.aliased = folded(begun.raw, data.pieces, data.inputs, data.outputs, axes)
        total, w, z, moments = clamped(raw, data.inputs, data.outputs, axes)
        hub = axes.T @ frozen_inertia(mass) @ axes
        if prior is None:
            rest = total - hub - moments.T @ moments
            least = max(float(np.linalg.eigvalsh(rest)[0]), 1e-4 * float(np.trace(total)))
            centre = body_of(mass)[1]
            stated = min(LIGHT * float(mass[0, 0]), SHARE * least / max(float(centre @ centre), 1e-12))
            body = Unknown(axes, stated, float(np.sqrt(SHARE * least / stated)), float(np.trace(total)))
            live = np.zeros((w.size, 6), dtype=np.bool_)
            live[:, 3 : 3 + axes.shape[1]] = True
            structure = Structure(mass, data.inputs, data.outputs, live, body, np.zeros((3, 0)))
            rows = np.hstack([np.zeros((w.size, 3)), moments @ axes.T])
            for _ in range(2):  # the stated mass and the hub's offset take a little of the inertia
                own = body.theta(rest)
                rest = body.rest(own) + total - axes.T @ frozen_inertia(mass, body.matrix(moments, own)) @ axes
            return structure, structure.theta(Parts(w, z, rows, np.zeros((6, 6)), mass), body.theta(rest)), None
        body = Body(*body_of(prior.parts.rigid))
        rigid = np.zeros(Body.count)
        if not self.free_hub:
            there = np.trace(axes.T @ frozen_inertia(mass, prior.parts.rigid) @ axes)
            factor = (np.trace(total) - np.trace(hub)) / (there - np.trace(hub))
            rigid[[0, 2, 3, 4]] = np.log(np.clip(factor, 0.2, 5.0))
        matrix = body.matrix(rigid)
        pairs = matched(prior, w, moments, axes, matrix)
        rows, frequencies = np.zeros((w.size, 6)), w.copy()
        for i, j in enumerate(pairs.of):
            if j < 0:
                rows[i, 3:] = axes @ moments[i]
                continue
            own = pairs.moments[j]
            rows[i] = prior.parts.participation[j] * float(moments[i] @ own) / float(own @ own)
            frequencies[i] = w[i] * prior.parts.frequencies[j] / pairs.frequencies[j]
        live, scaled = _live(prior.parts, pairs, axes), axes if self.free_hub else np.zeros((3, 0))
        structure = Structure(mass, data.inputs, data.outputs, live, body, scaled)
        return structure, structure.theta(Parts(frequencies, z, rows, matrix, mass), rigid), pairs

    def _likelihood(
        self, structure: Structure, theta: Array, pairs: Matched | None, pieces: Sequence[Data]
    ) -> Likelihood:
        if self.prior is None or pairs is None:
            return Likelihood(pieces, structure.raw, self.data.scale)
        parts, widths, of = self.prior.parts, self.prior.widths, np.array(pairs.of)
        paired = of >= 0
        damped = paired & (parts.damping[of] > 0.0)
        scale = np.sqrt(np.maximum(np.diag(parts.rigid), 1e-12))
        rows = parts.participation[of]
        towards = np.sum(structure.parts(theta).participation * rows / scale**2, axis=1, keepdims=True)
        centre = np.where(paired[:, None], np.where(towards < 0.0, -rows, rows), 0.0)
        size = SMALL * scale * np.linalg.norm(rows / scale, axis=1, keepdims=True)
        width = np.where(paired[:, None], widths[2] * (np.abs(rows) + size), scale)
        *_, rigid, hub = structure.places

        def belief(x: Array) -> Array:
            said = structure.parts(x)
            return np.concatenate(
                [
                    ((said.participation - centre) / width)[structure.live],
                    np.log(said.frequencies[paired] / parts.frequencies[of[paired]]) / widths[0],
                    np.log(said.damping[damped] / parts.damping[of[damped]]) / widths[1],
                    np.log(said.damping[~paired] / UNKNOWN_DAMPING) / (3.0 * DAMPING),
                    x[rigid] / widths[3],
                    x[hub] / widths[3],
                ]
            )

        return Likelihood(pieces, structure.raw, self.data.scale, belief)

    def _predicted(self, raw: Raw, hidden: Sequence[Piece]) -> Array:
        """`(p,)` error of what was held out, relative to its own variation: the free response is from the part before."""
        left, size = np.zeros(len(self.data.sensed)), np.zeros(len(self.data.sensed))
        for piece in hidden:
            judged = piece.use
            if not judged.any():
                continue
            before = ~judged & (piece.time < piece.time[judged.any(axis=1)][0])[:, None]
            # a piece that lies in the held part wholly or nearly so has nothing before it: its beginning is its own
            base = replace(piece, use=before if before.any(axis=1).sum() > 4 * raw.poles.size + 8 else judged)
            residual = base.assess(raw, 1.0 / self.data.scale, whole=True)[1]
            left += np.sum(np.where(judged, residual, 0.0) ** 2, axis=0)
            mean = np.sum(np.where(judged, piece.outputs, 0.0), axis=0) / np.maximum(judged.sum(axis=0), 1)
            size += np.sum(np.where(judged, piece.outputs - mean, 0.0) ** 2, axis=0)
        return np.sqrt(left / np.maximum(size, 1e-300))

    def _estimate(
        self,
        structure: Structure,
        likelihood: Likelihood,
        found: Found,
        begun: Started,
        pairs: Matched | None,
        predicted: Array,
    ) -> Estimate:
        raw, weights, data = structure.raw(found.theta), likelihood.weights(found.squares), self.data
        residuals: list[Any] = [piece.assess(raw, weights)[1] for piece in likelihood.pieces]
        level = found.squares / np.maximum(found.counts, 1.0) / data.scale**2
        white = np.where(level < NO_NOISE, np.nan, likelihood.whiteness(residuals))
        coloured = bool(np.any(white < COLOURED))
        squares = np.maximum(level, NO_NOISE) * found.counts * data.scale**2
        spread = self.widened * likelihood.covariance(structure.loosened(found.theta), squares, coloured=coloured)
        if coloured:
            worst = data.sensed[int(np.nanargmin(white))]
            self._warn(
                "coloured-residuals",
                f"the residuals of {worst} are not white (probability {np.nanmin(white):.1g}): noise is coloured or the "
                "model lacks something; intervals are widened by the correlation found.",
            )
        return Estimate(
            data, self.prior, pairs, structure, likelihood, found, spread, residuals, white, predicted, begun.orders,
            self.aliased, self.doubtful, self.warnings,
        )  # fmt: skip


def _unpredicted(result: Identification, predicted: Array) -> Identification:
    """The result with no mode called determined, where the model predicts nothing of what was held out."""
    if not np.all(predicted > NOTHING):  # nan where nothing was held out
        return result
    said = (
        "the model predicts nothing of the last part of the log, which was held out, though it follows the rest: none of its "
        "modes is to be trusted; look for a sensor that fails there, and give a longer log."
    )
    doubted = tuple(replace(m, determined=False, remark=f"it predicts nothing; {m.remark}") for m in result.modes)
    return replace(result, modes=doubted, undetermined=(said, *result.undetermined))


def _live(parts: Parts, pairs: Matched, axes: Array) -> NDArray[np.bool_]:
    """`(n, 6)` elements of participation that may differ from zero: those that rigid mass and prior modes couple."""
    scale = np.sqrt(np.maximum(np.diag(parts.rigid), 1e-300))
    shares = np.abs(parts.participation / scale) > 1e-6
    linked = (np.abs(parts.rigid / np.outer(scale, scale)) > 1e-9) | (shares.T @ shares)
    for _ in range(3):
        linked = linked @ linked
    of, driven = np.array(pairs.of), np.concatenate([np.zeros(3, np.bool_), np.any(np.abs(axes) > 1e-6, axis=1)])
    own = np.where(of[:, None] < 0, driven, shares[of])
    return (own @ linked) & (np.diag(parts.rigid) > 1e-12 * np.max(np.diag(parts.rigid)))
