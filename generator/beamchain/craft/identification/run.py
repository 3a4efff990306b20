"""One identification from its channels: start, physical model, likelihood, what is held out, what is said."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import chi2

from beamchain.caution import Caution
from beamchain.craft.identification.channels import Channels
from beamchain.craft.identification.delay import aligned
from beamchain.craft.identification.describe import TWO, described
from beamchain.craft.identification.hub import Bare
from beamchain.craft.identification.likelihood import COLOURED, Found, Likelihood, compressed, derivatives
from beamchain.craft.identification.pieces import FEWEST
from beamchain.craft.identification.prior import DAMPING, SMALL, Matched, Prior, matched
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


class Run:
    """One identification, step by step."""

    def __init__(
        self,
        data: Channels,
        known: Bare,
        prior: Prior | None,
        modes: int | None,
        held: float,
        free_hub: bool,
        offset: bool,
        at: str,
    ) -> None:
        self.data, self.known, self.prior, self.wanted, self.at = data, known, prior, modes, at
        self.held, self.free_hub, self.offset = held, free_hub, offset
        self.warnings = list(data.warnings)
        self.doubtful, self.widened = np.zeros(0), 1.0
        self.aliased = list[complex]()
        if offset and not isinstance(data.pieces[0], Piece):
            raise InputError(
                "offset is for time logs; a delay in a frequency response is in its phase: take it out before."
            )

    def result(self) -> Identification:
        """Start, refine, judge."""
        data = self.data
        shown, hidden = self._parted()
        inertia = frozen_inertia(self.known.mass, self._rigid())
        guess = data.outputs @ np.linalg.solve(inertia, data.inputs.T)
        if isinstance(data.pieces[0], Piece):
            check_rigid(frozen(shown, guess, data.scale).rigid, data, self.known, self._rigid(), roughly=True)
        if self.offset:
            lag, self.data = aligned(data, guess)
            text = f"the sensors lag {lag:.5g} s behind the torques, as estimated; its uncertainty is not in the intervals."
            self.warnings.append(Caution("offset", text))
            data = self.data
            shown, hidden = self._parted()
        begun = started(shown, guess, data.scale, self.wanted)
        self._judge_start(begun)
        structure, theta, pairs = self._structure(begun)
        likelihood = self._likelihood(structure, theta, pairs, shown)
        if not self.aliased:
            wanted = begun.form.theta(begun.raw)
            near = compressed(
                lambda x: begun.form.theta(structure.raw(x)), wanted, begun.matrix, likelihood.belief, theta
            )
            theta = min((theta, near), key=lambda x: likelihood.cost(likelihood.squares(structure.raw(x)), x))
        first = likelihood.best(theta, ITERATIONS)
        predicted = self._predicted(structure.raw(first.theta), hidden) if hidden else np.full(len(data.sensed), np.nan)
        likelihood = replace(likelihood, pieces=data.pieces)
        found = likelihood.best(first.theta, ITERATIONS) if hidden else first
        return self._described(structure, likelihood, found, begun, pairs, predicted)

    def _rigid(self) -> Array:
        return np.zeros((6, 6)) if self.prior is None else self.prior.parts.rigid

    def _parted(self) -> tuple[list[Data], list[Piece]]:
        """Pieces with their last part not used, and with nothing but it used."""
        data = self.data
        if self.held == 0.0 or not isinstance(data.pieces[0], Piece):
            return data.pieces, []
        shown, hidden = list[Data](), list[Piece]()
        pieces = [p for p in data.pieces if isinstance(p, Piece)]
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
        data = self.data
        check_rigid(begun.raw.rigid, data, self.known, self._rigid())
        tried = [one for one in begun.orders if one.modes]
        if self.wanted is not None and begun.better > self.wanted:
            self.warnings.append(
                Caution(
                    "model-order",
                    f"{self.wanted} modes were asked for, but the criterion is lower with {begun.better}; "
                    "what is left out falsifies the others.",
                )
            )
        if self.wanted is not None and len(begun.orders) and begun.better < self.wanted:
            self.warnings.append(
                Caution("model-order", f"{self.wanted} modes were asked for, but the log supports {begun.better} only.")
            )
        later = next((one for one in begun.orders if one.modes == begun.raw.poles.size + 1), None)
        if later is not None and float(chi2.sf(later.gain, begun.each)) < LIKELY:
            where = later.frequencies[
                np.argmax([np.min(np.abs(w - np.abs(begun.raw.poles)), initial=np.inf) / w for w in later.frequencies])
            ]
            self.warnings.append(
                Caution(
                    "model-order",
                    f"one mode more, near {where:.4g} rad/s on the free craft, would be significant, though the "
                    f"criterion is lower with {begun.raw.poles.size}: it may be there, or a mode may stand for two.",
                )
            )
            self.doubtful = later.frequencies
            half = -TWO * begun.raw.poles.real
            if np.any(np.sum(np.abs(later.frequencies - np.abs(begun.raw.poles)[:, None]) < half[:, None], axis=1) > 1):
                self.widened = max(1.0, later.gain / begun.each)
        if not begun.raw.poles.size:
            raise InputError(
                "the log shows no flexible mode: with none the criterion is lowest"
                + (f" ({len(tried)} tried)" if tried else "")
                + "; excite the craft more strongly or for longer, with torque steps shorter than the period sought."
            )

    def _structure(self, begun: Started) -> tuple[Structure, Array, Matched | None]:
        data, known, prior = self.data, self.known, self.prior
        raw, self.aliased = folded(begun.raw, data.pieces, data.inputs, data.outputs, data.axes)
        total, w, z, moments = clamped(raw, data.inputs, data.outputs, data.axes)
        none = np.zeros((3, 0))
        hub = frozen_inertia(known.mass)
        if prior is None:
            rest = total - data.axes.T @ hub @ data.axes - moments.T @ moments
            least = max(float(np.linalg.eigvalsh(rest)[0]), 1e-4 * float(np.trace(total)))
            centre = np.array([known.mass[1, 5], known.mass[2, 3], known.mass[0, 4]]) / known.mass[0, 0]
            mass = min(LIGHT * float(known.mass[0, 0]), SHARE * least / max(float(centre @ centre), 1e-12))
            body = Unknown(data.axes, mass, float(np.sqrt(SHARE * least / mass)), float(np.trace(total)))
            live = np.zeros((w.size, 6), dtype=np.bool_)
            live[:, 3 : 3 + data.axes.shape[1]] = True
            structure = Structure(known.mass, data.inputs, data.outputs, live, body, none)
            rows = np.hstack([np.zeros((w.size, 3)), moments @ data.axes.T])
            for _ in range(2):  # the stated mass and the hub's offset take a little of the inertia
                own = body.theta(rest)
                now = frozen_inertia(known.mass, body.matrix(moments, own))
                rest = body.rest(own) + total - data.axes.T @ now @ data.axes
            return structure, structure.theta(Parts(w, z, rows, np.zeros((6, 6)), known.mass), body.theta(rest)), None
        rigid = np.zeros(Body.count)
        there = data.axes.T @ frozen_inertia(known.mass, prior.parts.rigid) @ data.axes
        bare_there = data.axes.T @ hub @ data.axes
        factor = (np.trace(total) - np.trace(bare_there)) / (np.trace(there) - np.trace(bare_there))
        rigid[[0, 2, 3, 4]] = np.log(np.clip(factor, 0.2, 5.0)) if not self.free_hub else 0.0
        body = Body(*body_of(prior.parts.rigid))
        matrix = body.matrix(rigid)
        pairs = matched(prior, w, moments, data.axes, matrix)
        first = np.zeros((w.size, 6))
        frequencies = w.copy()
        for i, j in enumerate(pairs.of):
            if j < 0:
                first[i, 3:] = data.axes @ moments[i]
                continue
            own = pairs.moments[j]
            first[i] = prior.parts.participation[j] * float(moments[i] @ own) / float(own @ own)
            frequencies[i] = w[i] * prior.parts.frequencies[j] / pairs.frequencies[j]
        live = _live(prior.parts, pairs, data.axes)
        scaled = data.axes if self.free_hub else none
        structure = Structure(known.mass, data.inputs, data.outputs, live, body, scaled)
        return structure, structure.theta(Parts(frequencies, z, first, matrix, known.mass), rigid), pairs

    def _likelihood(
        self, structure: Structure, theta: Array, pairs: Matched | None, pieces: Sequence[Data]
    ) -> Likelihood:
        if self.prior is None or pairs is None:
            return Likelihood(pieces, structure.raw, self.data.scale)
        prior, widths = self.prior, self.prior.widths
        parts, of = prior.parts, pairs.of
        scale = np.sqrt(np.maximum(np.diag(parts.rigid), 1e-12))
        n = structure.modes
        start = structure.parts(theta).participation
        centre, width = np.zeros((n, 6)), np.ones((n, 6))
        for i, j in enumerate(of):
            if j >= 0:
                sign = np.sign(float(start[i] @ (parts.participation[j] / scale**2))) or 1.0
                centre[i] = sign * parts.participation[j]
                size = SMALL * scale * float(np.linalg.norm(parts.participation[j] / scale))
                width[i] = widths[2] * (np.abs(centre[i]) + size)
            else:
                width[i] = scale
        place = structure.places

        def belief(x: Array) -> Array:
            said = structure.parts(x)
            out = [((said.participation - centre) / width)[structure.live]]
            for i, j in enumerate(of):
                if j >= 0:
                    out.append(np.log(said.frequencies[i : i + 1] / parts.frequencies[j]) / widths[0])
                    if parts.damping[j] > 0.0:
                        out.append(np.log(said.damping[i : i + 1] / parts.damping[j]) / widths[1])
                else:
                    out.append(np.log(said.damping[i : i + 1] / 0.005) / (3.0 * DAMPING))
            return np.concatenate([*out, x[place[3]] / widths[3], x[place[4]] / widths[3]])

        return Likelihood(pieces, structure.raw, self.data.scale, belief)

    def _predicted(self, raw: Raw, hidden: Sequence[Piece]) -> Array:
        """`(p,)` error of what was held out, relative to its own variation: the free response is from the part before."""
        left, size = np.zeros(len(self.data.sensed)), np.zeros(len(self.data.sensed))
        for piece in hidden:
            if not piece.use.any():
                continue
            before = ~piece.use & (piece.time < piece.time[piece.use.any(axis=1)][0])[:, None]
            judged = piece.use
            # a piece that lies in the held part wholly or nearly so has nothing before it: its beginning is its own
            base = replace(piece, use=before if before.any(axis=1).sum() > 4 * raw.poles.size + 8 else judged)
            residual = base.assess(raw, 1.0 / self.data.scale, whole=True)[1]
            left += np.sum(np.where(judged, residual, 0.0) ** 2, axis=0)
            mean = np.sum(np.where(judged, piece.outputs, 0.0), axis=0) / np.maximum(judged.sum(axis=0), 1)
            size += np.sum(np.where(judged, piece.outputs - mean, 0.0) ** 2, axis=0)
        return np.sqrt(left / np.maximum(size, 1e-300))

    def _described(
        self,
        structure: Structure,
        likelihood: Likelihood,
        found: Found,
        begun: Started,
        pairs: Matched | None,
        predicted: Array,
    ) -> Identification:
        raw = structure.raw(found.theta)
        weights = likelihood.weights(found.squares)
        residuals: list[Any] = [piece.assess(raw, weights)[1] for piece in likelihood.pieces]
        white = likelihood.whiteness(residuals)
        level = found.squares / np.maximum(found.counts, 1.0) / self.data.scale**2
        white = np.where(level < NO_NOISE, np.nan, white)
        coloured = bool(np.any(white < COLOURED))
        squares = np.maximum(level, NO_NOISE) * found.counts * self.data.scale**2
        spread = self.widened * likelihood.covariance(structure.loosened(found.theta), squares, coloured=coloured)
        if coloured:
            worst = self.data.sensed[int(np.nanargmin(white))]
            self.warnings.append(
                Caution(
                    "coloured-residuals",
                    f"the residuals of {worst} are not white (probability {np.nanmin(white):.1g}): "
                    "noise is coloured or the model lacks something; intervals are widened by the correlation found.",
                )
            )
        only_belief = derivatives(likelihood.belief, found.theta)
        result = described(
            structure=structure,
            found=found,
            spread=spread,
            belief=only_belief.T @ only_belief,
            orders=begun.orders,
            pairs=pairs,
            prior=self.prior,
            aliased=self.aliased,
            doubtful=self.doubtful,
            white=white,
            predicted=predicted,
            warnings=self.warnings,
            data=self.data,
            residuals=residuals,
            at=self.at,
            raw=raw,
            noise=1.0 / weights,
        )
        return _unpredicted(resolved(result, structure, found, likelihood), predicted)


def _unpredicted(result: Identification, predicted: Array) -> Identification:
    """The result with no mode called determined, where the model predicts nothing of what was held out."""
    if not np.all(predicted > NOTHING):  # nan where nothing was held out
        return result
    said = (
        "the model predicts nothing of the last part of the log, which was held out, though it follows the rest: none of its "
        "modes is to be trusted; look for a sensor that fails there, and give a longer log."
    )
    doubted = tuple(
        replace(mode, determined=False, remark=f"it predicts nothing; {mode.remark}") for mode in result.modes
    )
    return replace(result, modes=doubted, undetermined=(said, *result.undetermined))


def _live(parts: Parts, pairs: Matched, axes: Array) -> Any:
    """`(n, 6)` elements of participation that may differ from zero: those that rigid mass and prior modes couple."""
    scale = np.sqrt(np.maximum(np.diag(parts.rigid), 1e-300))
    there = np.diag(parts.rigid) > 1e-12 * np.max(np.diag(parts.rigid))
    shares = parts.participation / scale
    linked = np.abs(parts.rigid / np.outer(scale, scale)) > 1e-9
    linked |= (np.abs(shares).T > 1e-6).astype(int) @ (np.abs(shares) > 1e-6).astype(int) > 0
    for _ in range(3):
        linked = linked.astype(int) @ linked.astype(int) > 0
    out = np.zeros((len(pairs.of), 6), dtype=np.bool_)
    for i, j in enumerate(pairs.of):
        own = (
            np.abs(shares[j]) > 1e-6
            if j >= 0
            else np.concatenate([np.zeros(3), np.any(np.abs(axes) > 1e-6, axis=1)]) > 0
        )
        out[i] = np.any(linked[own], axis=0) & there
    return out
