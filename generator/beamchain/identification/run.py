"""One identification from its channels: start, physical model, likelihood, what is held out,
what is said."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from beamchain.errors import InputError
from beamchain.identification.channels import FEWEST, MARGIN, Channels
from beamchain.identification.diagnostics import TWO, Estimate
from beamchain.identification.hub import Bare
from beamchain.identification.initial_model import (
    InitialModel,
    candidates,
    initial_model,
    rigid_model,
    time_unit,
)
from beamchain.identification.likelihood import COLOURED, Found, Likelihood, fit_raw_numbers
from beamchain.identification.prior import (
    DAMPING,
    SMALL,
    UNKNOWN_DAMPING,
    Match,
    Prior,
    match_modes,
)
from beamchain.identification.resolution import add_resolution
from beamchain.identification.response import Data, Piece, Raw, Spectrum
from beamchain.identification.result import Identification
from beamchain.identification.sanity import check_rigid, unalias
from beamchain.identification.structure import (
    Body,
    Parts,
    Structure,
    Unknown,
    body_of,
    clamp,
    frozen_inertia,
)
from beamchain.toolkit import Array
from beamchain.warning_codes import Caution

ITERATIONS = 60
LIKELY = 1e-3  # probability of the gain of one mode more by noise alone, below which it is told
NO_NOISE = 1e-22  # mean square of residuals, relative to the data, that is rounding
FEW_ITERATIONS = 8  # to see whether a mode of the prior is there
ABOVE = 1.2  # times the highest mode found, up to which a beam's modes may be missed
REACH = 2.0  # widths of the prior within which a mode is sought
TRIALS = 3  # frequencies at which a missed mode is tried
AGAINST = 9.0  # rise of minus twice the log likelihood by which a prior's mode is contradicted
NOTHING = 1.2  # error of a prediction over what is predicted, beyond which it is none


@dataclass(eq=False)
class Run:
    """One identification, step by step.

    Args:
        data, known, prior: what the log holds, the bare craft, and what is believed.
        wanted: number of modes; None: as the criterion says.
        held: the last part of each log, predicted from the rest.
    """

    data: Channels
    known: Bare
    prior: Prior | None
    wanted: int | None
    held: float

    def __post_init__(self) -> None:
        self.warnings: list[str] = list(self.data.warnings)
        self.doubtful: Array = np.zeros(0)
        self.widened: float = 1.0
        self.aliased: list[complex] = []
        self.rigid: Array = np.zeros((6, 6)) if self.prior is None else self.prior.parts.rigid

    def result(self, mount: str) -> Identification:
        """Start, refine, judge."""
        data = self.data
        shown, hidden = self._split()
        inertia = frozen_inertia(self.known.mass, self.rigid)
        guess = data.outputs @ np.linalg.solve(inertia, data.inputs.T)
        if isinstance(data.pieces[0], Piece):
            check_rigid(
                rigid_model(shown, guess, data.scale).rigid,
                data,
                self.known,
                self.rigid,
                roughly=True,
            )
        initial = initial_model(shown, guess, data.scale, self.wanted)
        steps = int(np.ceil(abs(initial.raw.delay) / time_unit(data.pieces)))
        if steps > MARGIN:
            pieces = [p.trimmed(steps + 1) if isinstance(p, Piece) else p for p in data.pieces]
            data = self.data = data._replace(pieces=pieces)
            shown, hidden = self._split()
            initial = initial_model(shown, guess, data.scale, self.wanted)
        self._check_order(initial)
        structure, theta, pairs = self._structure(initial)
        likelihood = self._likelihood(structure, theta, pairs, shown)
        if not self.aliased:
            form = initial.form
            near = fit_raw_numbers(
                lambda x: form.theta(structure.raw(x)),
                form.theta(initial.raw),
                initial.matrix,
                likelihood.belief,
                theta,
            )
            theta = min(
                (theta, near),
                key=lambda x: likelihood.cost(likelihood.squares(structure.raw(x)), x),
            )
        found = likelihood.best(theta, ITERATIONS)
        if pairs is not None:
            for mode in self._within_reach(structure, found, pairs):
                structure, likelihood, found, pairs = self._with_missed(
                    structure, likelihood, found, pairs, mode
                )
            if not hidden:
                found = likelihood.best(found.theta, ITERATIONS)
        predicted = np.full(len(data.sensed), np.nan)
        likelihood = replace(likelihood, pieces=data.pieces)
        if hidden:
            predicted = self._prediction_errors(structure.raw(found.theta), hidden)
            found = likelihood.best(found.theta, ITERATIONS)
        estimate = self._estimate(structure, likelihood, found, initial, pairs, predicted)
        return _doubt_all(
            add_resolution(estimate.result(mount), structure, found, likelihood), predicted
        )

    def _warn(self, code: str, text: str) -> None:
        self.warnings.append(Caution(code, text))

    def _split(self) -> tuple[list[Data], list[Piece]]:
        """Pieces with their last part not used, and with nothing but it used."""
        pieces = [p for p in self.data.pieces if isinstance(p, Piece)]
        if self.held == 0.0 or not pieces:
            return self.data.pieces, []
        shown = list[Data]()
        hidden = list[Piece]()
        for log in {p.log for p in pieces}:
            of_log = [p for p in pieces if p.log == log]
            left = round((1.0 - self.held) * sum(p.time.size for p in of_log))
            for piece in of_log:
                first = min(left, piece.time.size)  # that is held out
                left -= first
                if first >= FEWEST:
                    shown.append(piece.part(0, first))
                use = piece.use.copy()
                use[:first] = False
                if use.any():
                    hidden.append(replace(piece, use=use))
        return (shown, hidden) if shown else (self.data.pieces, [])

    def _check_order(self, initial: InitialModel) -> None:
        check_rigid(initial.raw.rigid, self.data, self.known, self.rigid)
        wanted = self.wanted
        free = np.abs(initial.raw.poles)
        if wanted is not None and initial.better > wanted:
            self._warn(
                "model-order",
                f"{wanted} modes were asked for, but the criterion is lower with {initial.better}; "
                "what is left out falsifies the others.",
            )
        if wanted is not None and initial.better < wanted:
            self._warn(
                "model-order",
                f"{wanted} modes were asked for, but the log supports {initial.better} only.",
            )
        later = next((one for one in initial.orders if one.modes == free.size + 1), None)
        if later is not None and float(chi2.sf(later.gain, initial.each)) < LIKELY:
            apart = np.abs(later.frequencies - free[:, None])
            where = later.frequencies[
                np.argmax(np.min(apart, axis=0, initial=np.inf) / later.frequencies)
            ]
            self._warn(
                "model-order",
                f"one mode more, near {where:.4g} rad/s on the free craft, would be significant, "
                f"though the criterion is lower with {free.size}: it may be there, or a mode may "
                "stand for two.",
            )
            self.doubtful = later.frequencies
            if np.any(np.sum(apart < -TWO * initial.raw.poles.real[:, None], axis=1) > 1):
                self.widened = max(1.0, later.gain / initial.each)
        if not free.size:
            tried = sum(one.modes > 0 for one in initial.orders)
            raise InputError(
                "the log shows no flexible mode: with none the criterion is lowest"
                + (f" ({tried} tried)" if tried else "")
                + "; excite the craft more strongly or for longer, with torque steps shorter than "
                "the period sought."
            )

    def _structure(self, initial: InitialModel) -> tuple[Structure, Array, Match | None]:
        """The physical model, the parameters to begin with,
        and which modes of the prior they are."""
        data = self.data
        mass = self.known.mass
        prior = self.prior
        axes = self.data.axes
        step = time_unit(data.pieces)
        raw, self.aliased = unalias(initial.raw, data.pieces, data.inputs, data.outputs, axes)
        total, w, z, moments = clamp(raw, data.inputs, data.outputs, axes)
        hub = axes.T @ frozen_inertia(mass) @ axes
        if prior is None:
            body = Unknown(axes, float(np.trace(total)))
            live = np.zeros((w.size, 6), dtype=np.bool_)
            live[:, 3 : 3 + axes.shape[1]] = True
            structure = Structure(mass, data.inputs, data.outputs, live, body, step)
            rows = np.hstack([np.zeros((w.size, 3)), moments @ axes.T])
            rest = body.theta(total - hub - moments.T @ moments)
            parts = Parts(w, z, rows, np.zeros((6, 6)), mass)
            return structure, structure.theta(parts, rest, raw.delay), None
        body = Body(*body_of(prior.parts.rigid))
        rigid = np.zeros(Body.count)
        there = np.trace(axes.T @ frozen_inertia(mass, prior.parts.rigid) @ axes)
        factor = (np.trace(total) - np.trace(hub)) / (there - np.trace(hub))
        rigid[[0, 2, 3, 4]] = np.log(np.clip(factor, 0.2, 5.0))
        matrix = body.matrix(rigid)
        pairs = match_modes(prior, w, moments, axes, matrix)
        rows = np.zeros((w.size, 6))
        frequencies = w.copy()
        for i, j in enumerate(pairs.of):
            if j < 0:
                rows[i, 3:] = axes @ moments[i]
                continue
            moment = pairs.moments[j]
            rows[i] = (
                prior.parts.participation[j] * float(moments[i] @ moment) / float(moment @ moment)
            )
            frequencies[i] = w[i] * prior.parts.frequencies[j] / pairs.frequencies[j]
        structure = Structure(
            mass, data.inputs, data.outputs, _live_elements(prior.parts, pairs, axes), body, step
        )
        parts = Parts(frequencies, z, rows, matrix, mass)
        return structure, structure.theta(parts, rigid, raw.delay), pairs

    def _within_reach(self, structure: Structure, found: Found, pairs: Match) -> list[int]:
        """Modes of the prior that turn the craft, were not found, and that the log could show."""
        assert self.prior is not None
        first = self.data.pieces[0]
        highest = np.pi / float(np.mean(first.steps)) if isinstance(first, Piece) else np.inf
        if self.prior.chosen is None:
            top = float(structure.parts(found.theta).frequencies.max(initial=0.0))
            highest = min(highest, ABOVE * top)
        return [j for j in pairs.missed if pairs.frequencies[j] <= highest]

    def _with_missed(
        self,
        structure: Structure,
        likelihood: Likelihood,
        found: Found,
        pairs: Match,
        mode: int,
    ) -> tuple[Structure, Likelihood, Found, Match]:
        """The model with one mode more, which the prior has: where the log shows it within the
        prior's width, or else where the prior says, to keep its share of the motion.

        The search for the initial model prices a mode with free residues; with the prior's
        participation a weaker one is recognised. A mode that the log contradicts is left out.
        """
        assert self.prior is not None
        prior = self.prior.parts
        parts = structure.parts(found.theta)
        rigid = found.theta[structure.places[3]]
        delay = structure.delay(found.theta)
        more = pairs.joined(mode, kept=True)
        live = _live_elements(prior, more, self.data.axes)
        wider = replace(structure, live=live)
        damping = prior.damping[mode] or UNKNOWN_DAMPING

        def start(frequency: float) -> Array:
            longer = Parts(
                np.append(parts.frequencies, frequency),
                np.append(parts.damping, damping),
                np.vstack([parts.participation, prior.participation[mode]]),
                parts.rigid,
                parts.hub,
            )
            return wider.theta(longer, rigid, delay)

        whole = float(prior.frequencies[mode])
        theta = start(whole)
        among = self._likelihood(wider, theta, more, likelihood.pieces)
        raw = structure.raw(found.theta)
        coupled = np.abs(wider.raw(theta).poles)
        new = int(np.argmax(np.min(np.abs(np.log(coupled[:, None] / np.abs(raw.poles))), axis=1)))
        poles = candidates(likelihood.pieces, raw, self.data.scale)
        reach = REACH * self.prior.widths[0]
        near = [
            whole * abs(pole) / coupled[new]
            for pole in poles
            if abs(np.log(abs(pole) / coupled[new])) < reach
        ]
        there = among.best(theta, FEW_ITERATIONS)
        elsewhere = [among.best(start(w), FEW_ITERATIONS) for w in near[:TRIALS]]
        best = min([there, *elsewhere], key=lambda one: one.cost)
        best = among.best(best.theta, ITERATIONS)
        # a mode has frequency, damping and size, of which Bayes's criterion prices each; and the
        # best of many places is the best by chance too
        places = max(_lines(likelihood.pieces, coupled[new], reach), 1.0)
        price = 3.0 * np.log(float(found.counts.sum())) + 2.0 * np.log(places)
        if likelihood.data_cost(found) - among.data_cost(best) > price:
            return wider, among, best, pairs.joined(mode, kept=False)
        there = among.best(there.theta, ITERATIONS)
        if there.cost - found.cost > AGAINST:
            return structure, likelihood, found, pairs
        return wider, among, there, more

    def _likelihood(
        self, structure: Structure, theta: Array, pairs: Match | None, pieces: Sequence[Data]
    ) -> Likelihood:
        if self.prior is None or pairs is None:
            return Likelihood(pieces, structure.raw, self.data.scale)
        parts = self.prior.parts
        widths = self.prior.widths
        of = np.array(pairs.of)
        paired = of >= 0
        damped = paired & (parts.damping[of] > 0.0)
        scale = np.sqrt(np.maximum(np.diag(parts.rigid), 1e-12))
        rows = parts.participation[of]
        towards = np.sum(
            structure.parts(theta).participation * rows / scale**2, axis=1, keepdims=True
        )
        centre = np.where(paired[:, None], np.where(towards < 0.0, -rows, rows), 0.0)
        size = SMALL * scale * np.linalg.norm(rows / scale, axis=1, keepdims=True)
        width = np.where(paired[:, None], widths[2] * (np.abs(rows) + size), scale)
        rigid = structure.places[3]

        def belief(x: Array) -> Array:
            parts_now = structure.parts(x)
            return np.concatenate(
                [
                    ((parts_now.participation - centre) / width)[structure.live],
                    np.log(parts_now.frequencies[paired] / parts.frequencies[of[paired]])
                    / widths[0],
                    np.log(parts_now.damping[damped] / parts.damping[of[damped]]) / widths[1],
                    np.log(parts_now.damping[~paired] / UNKNOWN_DAMPING) / (3.0 * DAMPING),
                    x[rigid] / widths[3],
                ]
            )

        return Likelihood(pieces, structure.raw, self.data.scale, belief)

    def _prediction_errors(self, raw: Raw, hidden: Sequence[Piece]) -> Array:
        """`(p,)` error of what was held out, relative to its own variation:
        the free response is from the part before."""
        left = np.zeros(len(self.data.sensed))
        size = np.zeros(len(self.data.sensed))
        for piece in hidden:
            judged = piece.use
            before = ~judged & (piece.time < piece.time[judged.any(axis=1)][0])[:, None]
            # a piece that lies in the held part wholly or nearly so has nothing before it: its
            # beginning is its own, and of few samples that would explain all
            enough = 4 * raw.poles.size + 8
            if before.any(axis=1).sum() <= enough:
                before = judged
            if before.any(axis=1).sum() <= enough:
                continue
            base = replace(piece, use=before)
            residual = base.assess(raw, 1.0 / self.data.scale, whole=True)[1]
            left += np.sum(np.where(judged, residual, 0.0) ** 2, axis=0)
            mean = np.sum(np.where(judged, piece.outputs, 0.0), axis=0) / np.maximum(
                judged.sum(axis=0), 1
            )
            size += np.sum(np.where(judged, piece.outputs - mean, 0.0) ** 2, axis=0)
        predicted = np.full(size.size, np.nan)  # stays so where nothing of a sensor is held out
        return np.sqrt(np.divide(left, size, out=predicted, where=size > 0.0))

    def _estimate(
        self,
        structure: Structure,
        likelihood: Likelihood,
        found: Found,
        initial: InitialModel,
        pairs: Match | None,
        predicted: Array,
    ) -> Estimate:
        raw = structure.raw(found.theta)
        weights = likelihood.weights(found.squares)
        data = self.data
        residuals: list[Any] = [piece.assess(raw, weights)[1] for piece in likelihood.pieces]
        level = found.squares / np.maximum(found.counts, 1.0) / data.scale**2
        white = np.where(level < NO_NOISE, np.nan, likelihood.whiteness(residuals))
        coloured = bool(np.any(white < COLOURED))
        squares = np.maximum(level, NO_NOISE) * found.counts * data.scale**2
        spread = self.widened * likelihood.covariance(
            structure.loosen(found.theta), squares, coloured=coloured
        )
        if pairs is not None and self.prior is not None:
            spread = _with_prior_widths(spread, structure, pairs, self.prior)
        if coloured:
            worst = data.sensed[int(np.nanargmin(white))]
            self._warn(
                "coloured-residuals",
                f"the residuals of {worst} are not white (probability {np.nanmin(white):.1g}): "
                "noise is coloured or the model lacks something; intervals are widened by the "
                "correlation found.",
            )
        return Estimate(
            data=data,
            prior=self.prior,
            pairs=pairs,
            structure=structure,
            likelihood=likelihood,
            found=found,
            spread=spread,
            residuals=residuals,
            white=white,
            predicted=predicted,
            orders=initial.orders,
            aliased=self.aliased,
            doubtful=self.doubtful,
            warnings=self.warnings,
        )


def _doubt_all(result: Identification, predicted: Array) -> Identification:
    """The result with no mode called determined,
    where the model predicts nothing of what was held out."""
    if not np.fmin.reduce(predicted) > NOTHING:  # nan where nothing was held out
        return result
    sentence = (
        "the model predicts nothing of the last part of the log, which was held out, though it "
        "follows the rest: none of its modes is to be trusted; look for a sensor that fails there, "
        "and give a longer log."
    )
    doubted = tuple(
        replace(m, determined=False, remark=f"it predicts nothing; {m.remark}")
        for m in result.modes
    )
    return replace(result, modes=doubted, undetermined=(sentence, *result.undetermined))


def _lines(pieces: Sequence[Data], omega: float, reach: float) -> float:
    """Number of frequencies that the data tell apart between omega / e^reach and omega e^reach."""
    low = omega * np.exp(-reach)
    high = omega * np.exp(reach)
    duration = sum(float(p.time[-1] - p.time[0]) for p in pieces if isinstance(p, Piece))
    lines = [p.omega for p in pieces if isinstance(p, Spectrum)]
    return (high - low) * duration / (2.0 * np.pi) + sum(
        float(np.sum((line > low) & (line < high))) for line in lines
    )


def _with_prior_widths(spread: Array, structure: Structure, pairs: Match, prior: Prior) -> Array:
    """The covariance with the prior's widths of frequency and damping
    of modes that the log does not show: near one peak of the noise they would seem narrower."""
    out = spread.copy()
    rows = [i for i, j in enumerate(pairs.of) if j in pairs.kept]
    for place, width in zip(structure.places[:2], prior.widths[:2], strict=True):
        at = place.start + np.array(rows, dtype=np.intp)
        out[at, at] = np.maximum(out[at, at], width**2)
    return out


def _live_elements(parts: Parts, pairs: Match, axes: Array) -> NDArray[np.bool_]:
    """`(n, 6)` elements of participation that may differ from zero:
    those that rigid mass and prior modes couple."""
    scale = np.sqrt(np.maximum(np.diag(parts.rigid), 1e-300))
    shares = np.abs(parts.participation / scale) > 1e-6
    linked = (np.abs(parts.rigid / np.outer(scale, scale)) > 1e-9) | (shares.T @ shares)
    for _ in range(3):
        linked = linked @ linked
    of = np.array(pairs.of)
    driven = np.concatenate([np.zeros(3, np.bool_), np.any(np.abs(axes) > 1e-6, axis=1)])
    own = np.where(of[:, None] < 0, driven, shares[of])
    return (own @ linked) & (np.diag(parts.rigid) > 1e-12 * np.max(np.diag(parts.rigid)))
