"""The estimate put into words and numbers: standard deviations, what is undetermined and why,
what would determine it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.signal import detrend, welch

from beamchain.identification.channels import Channels
from beamchain.identification.initial_model import Order
from beamchain.identification.likelihood import Found, Likelihood, derivatives
from beamchain.identification.prior import Match, Prior
from beamchain.identification.response import Piece, Raw
from beamchain.identification.result import Identification, IdentifiedMode
from beamchain.identification.structure import Body, Parts, Structure, rotation
from beamchain.toolkit import MOTIONS, Array
from beamchain.warning_codes import Caution

USEFUL_FREQUENCY = 0.03  # relative standard deviation beyond which a frequency is not determined
USEFUL_DAMPING = 0.5
SIGNIFICANT = 4.0  # standard deviations of a mode's moment below which it may be none
PUNCTUAL = 1e-3  # steps: a smaller delay is not worth a warning
FROM_LOG = 0.5  # of the prior's width: what the log narrows less comes from the prior
SURPRISE = 3.0  # widths of the prior
TWO = 5.0  # half widths of a resonance, within which the next mode makes it doubtful
CLOSE = 3.0  # half widths, of two resonances that the log may not tell apart
NO_INERTIA = 1e-12  # of a correlation of the rigid mass: no motion has so little
SPECTRUM = 2048  # samples of a stretch
MOVED = ("mass", "mass centre", "inertia", "inertia", "inertia")  # by the parameters of a `Body`


@dataclass(eq=False)
class Estimate:
    """Where a search ended, and what is said of it.

    Args:
        data: channels and pieces.
        prior, pairs: what was believed, and which of its modes were found; None without a prior.
        structure, likelihood, found: the model, and its most likely parameters.
        spread: their covariance.
        residuals: of each piece.
        white, predicted: `(p,)` probability of white residuals, error of the held-out part.
        orders: numbers of modes that were tried.
        aliased: poles that were moved above half the sample rate.
        doubtful: frequencies of the free craft with one mode more.
        warnings: so far.
    """

    data: Channels
    prior: Prior | None
    pairs: Match | None
    structure: Structure
    likelihood: Likelihood
    found: Found
    spread: Array
    residuals: Sequence[Any]
    white: Array
    predicted: Array
    orders: tuple[Order, ...]
    aliased: Sequence[complex]
    doubtful: Array
    warnings: list[str]

    def __post_init__(self) -> None:
        theta = self.found.theta
        pieces = self.data.pieces
        self.parts: Parts = self.structure.parts(theta)
        self.raw: Raw = self.structure.raw(theta)
        w, z, *_ = self.structure.places
        self.sd_w: Array = np.sqrt(np.diag(self.spread)[w])
        self.sd_z: Array = np.sqrt(np.diag(self.spread)[z])
        self.half: float = (
            float(np.pi / np.mean(pieces[0].steps)) if isinstance(pieces[0], Piece) else np.inf
        )
        self.messages: list[str] = []
        self.notes: list[list[str]] = [[] for _ in range(self.structure.modes)]
        self.determined: list[bool] = [True] * self.structure.modes

    def doubt(self, mode: int, why: str) -> None:
        """Note that a mode is not determined."""
        self.notes[mode].append(why)
        self.determined[mode] = False

    def warn(self, code: str, text: str) -> None:
        """One warning more."""
        self.warnings.append(Caution(code, text))

    def result(self, mount: str) -> Identification:
        """The result of the search, at the place `mount` of the craft."""
        moments, sd_moments = self._moments()
        self._doubt_modes(moments, sd_moments)
        modes = self._shown_modes()
        if np.isfinite(self.half):
            self.messages.append(
                f"modes above half the sample rate ({self.half:.4g} rad/s): sampling would show "
                "one folded, as a mode below, which the log alone cannot always tell."
            )
        sd_delay = self._check_delay()
        unseen: list[IdentifiedMode] = []
        if self.prior is not None and self.pairs is not None:
            unseen = self._unseen_modes(self.prior, self.pairs)
            self._check_prior(self.prior, self.pairs)
        self.messages += [
            f"mode at {mode.frequency:.5g} rad/s: {mode.remark}."
            for mode in modes
            if mode.remark and not mode.determined
        ]
        if self.messages:
            count = len(self.messages)
            self.warn(
                "undetermined", f"the log leaves {count} thing(s) undetermined; see `undetermined`."
            )
        every = [*modes, *unseen]
        order = sorted(range(len(every)), key=lambda i: every[i].frequency)
        noise = 1.0 / self.likelihood.weights(self.found.squares)
        return Identification(
            modes=tuple(replace(every[i], number=k + 1) for k, i in enumerate(order)),
            names=self._names(order),
            covariance=self._covariance(),
            rigid=self.parts.rigid,
            order=self.orders,
            whiteness=self._by_channel(self.white),
            warnings=tuple(self.warnings),
            undetermined=tuple(self.messages),
            held_out=self._by_channel(self.predicted),
            noise=self._by_channel(noise),
            spectra=self._spectra(),
            massive=self.prior is not None,
            source=f"log at {mount}",
            advice=self._advice(moments, sd_moments),
            delay=self.raw.delay,
            delay_std=sd_delay,
        )

    def _shown_modes(self) -> list[IdentifiedMode]:
        """The modes of the model, which are not numbered yet."""
        rows, sd_rows = self._rows()
        frequencies, damping = self._nominal()
        return [
            IdentifiedMode(
                number=0,
                frequency=float(frequencies[i]),
                damping=float(damping[i]),
                participation=rows[i],
                frequency_std=float(frequencies[i] * self.sd_w[i]),
                damping_std=float(damping[i] * self.sd_z[i]),
                participation_std=sd_rows[i],
                determined=self.determined[i],
                remark="; ".join(self.notes[i]),
            )
            for i in range(self.structure.modes)
        ]

    def _names(self, order: list[int]) -> tuple[str, ...]:
        """Names of the rows of the covariance; `order`: numbers of all modes by frequency."""
        return tuple(
            f"mode{order.index(i) + 1}.{kind}"
            for kind in ("frequency", "damping", "participation")
            for i in range(self.structure.modes)
        )

    def _advice(self, moments: Array, sd_moments: Array) -> tuple[str, ...]:
        """What a further log should have."""
        # relative standard deviations over those that would be of use
        excess = np.max(
            (
                self.sd_w / USEFUL_FREQUENCY,
                self.sd_z / USEFUL_DAMPING,
                SIGNIFICANT * sd_moments / np.maximum(moments, 1e-300),
            ),
            axis=0,
        )
        ascending = np.argsort(self.parts.frequencies)
        poles = np.abs(self.raw.poles)
        return advice(poles, excess[ascending], self.data.axes, prior=self.prior is not None)

    def _nominal(self) -> tuple[Array, Array]:
        """Frequencies and damping; those of modes that the log does not show are the prior's,
        for where they lie in the likelihood is the noise's."""
        frequencies = self.parts.frequencies.copy()
        damping = self.parts.damping.copy()
        if self.prior is None or self.pairs is None:
            return frequencies, damping
        for i, j in enumerate(self.pairs.of):
            if j in self.pairs.kept:
                frequencies[i] = self.prior.parts.frequencies[j]
                damping[i] = self.prior.parts.damping[j] or damping[i]
        return frequencies, damping

    def _check_delay(self) -> float:
        """The delay's standard deviation [s]; a warning where the delay is not zero."""
        late = self.structure.places[4]
        sd_delay = self.structure.step * float(np.sqrt(self.spread[late, late][0, 0]))
        delay = self.raw.delay
        if abs(delay) > SIGNIFICANT * sd_delay and abs(delay) > PUNCTUAL * self.structure.step:
            what = (
                f"torques act {abs(delay):.4g} s {'later' if delay > 0.0 else 'earlier'} than the "
                f"log says ({delay / self.structure.step:.3g} steps), which is taken into account; "
                "see whether a rate is a mean over its sample (mean_rate_*)."
            )
            self.warn("delay", what)
        return sd_delay

    def _by_channel(self, values: Array) -> dict[str, float]:
        return dict(zip(self.data.sensed, values.tolist(), strict=True))

    def _deviations(self, slopes: Array) -> Array:
        """Standard deviations of what has these derivatives."""
        return np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, self.spread, slopes), 0.0))

    def _moments(self) -> tuple[Array, Array]:
        """Size of each mode's effective moment about the driven axes,
        and its standard deviation."""

        def size(x: Array) -> Array:
            return rotation(self.structure.parts(x)).moments @ self.data.axes

        own = size(self.found.theta)
        slopes = derivatives(size, self.found.theta).transpose(0, 2, 1)
        length = np.linalg.norm(own, axis=1)
        return length, self._deviations(
            np.einsum("ia,iap->ip", own / np.maximum(length, 1e-300)[:, None], slopes)
        )

    def _doubt_modes(self, moments: Array, sd_moments: Array) -> None:
        """What is not determined of each mode."""
        parts = self.parts
        prior = self.prior
        pairs = self.pairs
        w = parts.frequencies
        for i in range(self.structure.modes):
            if moments[i] < SIGNIFICANT * sd_moments[i]:
                self.doubt(i, "its moment does not differ significantly from zero")
            own = (
                prior is None
                or pairs is None
                or pairs.of[i] < 0
                or self.sd_w[i] < FROM_LOG * prior.widths[0]
            )
            if not (self.sd_w[i] < USEFUL_FREQUENCY and own):
                self.doubt(i, "its frequency is not determined")
            if not self.sd_z[i] <= USEFUL_DAMPING:
                self.doubt(i, "its damping is not determined")
            if w[i] > self.half and self.aliased:
                text = (
                    f"it lies above half the sample rate ({self.half:.4g} rad/s): its "
                    "frequency "
                    "may be folded differently"
                )
                self.doubt(i, text)
            if pairs is not None and pairs.of[i] in pairs.kept:
                self.doubt(i, "the log does not show it: it comes from the prior, with its widths")
            if pairs is not None and pairs.of[i] < 0:
                self.notes[i].append(
                    "the prior has no mode like it: participation in force is zero, not known"
                )
        order = np.argsort(w)
        for i, pole in enumerate(self.raw.poles[np.argsort(order)]):
            if int((np.abs(self.doubtful - abs(pole)) < TWO * max(-pole.real, 0.0)).sum()) > 1:
                self.doubt(i, "it may stand for two close modes")
        for a, b in zip(order, order[1:], strict=False):
            band = float(parts.damping[a] * w[a] + parts.damping[b] * w[b])
            blur = float(np.hypot(self.sd_w[a] * w[a], self.sd_w[b] * w[b]))
            if w[b] - w[a] < min(CLOSE * band, 5.0 * blur):
                for i in (a, b):
                    self.doubt(i, "it and its neighbour cannot be told apart")
        if np.any(self.white < 1e-6):  # nan where there is no telling
            self.warn(
                "undetermined",
                "the residuals are far from white, so that a mode may stand for two close ones or "
                "others are missing; intervals hold only if what is missing is small.",
            )

    def _rows(self) -> tuple[Array, Array]:
        """Participation and its deviations, nan where nothing is known;
        sentences on what comes from where."""
        structure = self.structure
        prior = self.prior
        rows = self.parts.participation
        slopes = derivatives(
            lambda x: structure.parts(x).participation.ravel(), structure.loosen(self.found.theta)
        )
        out = self._deviations(slopes).reshape(-1, 6)
        if prior is None or self.pairs is None:
            driven = np.concatenate(
                [np.zeros(3, dtype=bool), np.any(np.abs(self.data.axes) > 1e-9, axis=1)]
            )
            out[:, ~driven] = np.nan
            for note in self.notes:
                note.append(
                    "its frequency is that with the hub's rotation held and its translation free: "
                    "participation in force, which the log does not show, would lower the clamped "
                    "one"
                )
            others = ", ".join(m for m, d in zip(MOTIONS, driven, strict=True) if not d)
            about = ", ".join(axis for axis, d in zip("xyz", driven[3:], strict=True) if d)
            self.messages += [
                f"participation in {others}: the log excites only the hub's rotation about {about} "
                "of the mount and there is no prior; it is set to zero. Moments are those about "
                "the mass centre of the craft, frequencies those with the hub's rotation held and "
                "its translation free: both hold on this craft.",
                "mass of the appendage: without a prior the file of modes has none, and [imported] "
                "reads it when you have added mass, the 6 x 6 rigid mass about the port; or "
                "identify with a prior.",
            ]
            return rows, out
        sources = set[str]()
        for i, j in enumerate(self.pairs.of):
            if j < 0:
                out[i, :3] = np.nan
                continue
            width = prior.widths[2] * np.maximum(np.abs(prior.parts.participation[j]), 1e-300)
            if j in self.pairs.kept:
                out[i] = np.maximum(out[i], width)
            weak = np.flatnonzero(
                structure.live[i] & (np.abs(rows[i]) > 1e-9) & (out[i] > FROM_LOG * width)
            )
            if weak.size:
                text = (
                    f"participation in {', '.join(MOTIONS[k] for k in weak)} comes from the prior"
                )
                sources.add(text)
                self.notes[i].append(text)
            out[i, ~structure.live[i]] = np.nan
        if sources:
            words = "; ".join(sorted(sources))
            self.messages.append(
                f"not determined by the log but taken from the prior, with its width: {words}."
            )
        return rows, out

    def _covariance(self) -> Array:
        """Covariance of frequency, damping and a factor on participation per mode."""
        scale = np.sqrt(np.maximum(np.diag(self.parts.rigid), 1e-300))
        base = self.parts.participation / scale
        base /= np.maximum(np.sum(base**2, axis=1, keepdims=True), 1e-300)

        def values(x: Array) -> Array:
            now = self.structure.parts(x)
            return np.concatenate(
                [now.frequencies, now.damping, np.sum(now.participation / scale * base, axis=1)]
            )

        slopes = derivatives(values, self.found.theta)
        return slopes @ self.spread @ slopes.T

    def _unseen_modes(self, prior: Prior, pairs: Match) -> list[IdentifiedMode]:
        """Modes of the prior that do not turn the craft about a driven axis,
        scaled with the rigid mass so that their residual mass stays positive; sentences on
        them."""
        known = prior.parts
        top = float(self.parts.frequencies.max(initial=0.0))
        scaling = _root(known.rigid, -0.5) @ _root(self.parts.rigid, 0.5)
        out = list[IdentifiedMode]()
        for j in pairs.unseen:
            w = float(known.frequencies[j])
            z = float(known.damping[j])
            row = known.participation[j] @ scaling
            if w <= top or prior.chosen is not None:
                widths = w * prior.widths[0], z * prior.widths[1], np.abs(row) * prior.widths[2]
                remark = "the log does not excite it: all of it comes from the prior"
                out.append(IdentifiedMode(0, w, z, row, *widths, False, remark))
        if out:
            self.messages.append(
                f"{len(out)} mode(s) of the prior do not turn the craft about a driven axis and "
                "stay as the prior has them."
            )
        missed = [float(pairs.frequencies[j]) for j in pairs.missed]
        if beyond := [w for w in missed if w > self.half]:
            self.messages.append(
                f"{len(beyond)} mode(s) of the prior, from {min(beyond):.4g} rad/s, lie above half "
                f"the sample rate ({self.half:.4g} rad/s): this log cannot determine them."
            )
        for w in missed:
            if w <= min(self.half, 1.2 * top):
                text = (
                    f"the prior's mode at {w:.4g} rad/s was not found in the log and is left out."
                )
                self.warn("prior-contradicted", text)
        return out

    def _check_prior(self, prior: Prior, pairs: Match) -> None:
        off = np.abs(self.found.theta[self.structure.places[3]] / prior.widths[3])
        if isinstance(self.structure.body, Body) and off.max() > SURPRISE:
            what = MOVED[int(np.argmax(off))]
            text = f"the appendage's {what} found is {off.max():.2g} widths of the prior off it."
            self.warn("prior-contradicted", text)
        for w, j in zip(self.parts.frequencies, pairs.of, strict=True):
            far = abs(np.log(w / prior.parts.frequencies[j])) / prior.widths[0]
            if j >= 0 and far > SURPRISE:
                self.warn(
                    "prior-contradicted",
                    f"the mode at {w:.5g} rad/s lies {far:.2g} widths off the prior's.",
                )

    def _spectra(self) -> dict[str, tuple[Array, Array, Array, Array]]:
        out = dict[str, tuple[Array, Array, Array, Array]]()
        both = zip(self.data.pieces, self.residuals, strict=True)
        logs = [(piece, left) for piece, left in both if isinstance(piece, Piece)]
        if not logs:
            return out
        piece, left = max(logs, key=lambda one: one[0].time.size)
        n = min(SPECTRUM, piece.time.size)
        rate = 1.0 / float(np.mean(piece.steps))
        for i, name in enumerate(self.data.sensed):
            use = piece.use[:, i]
            measured = np.where(use, piece.outputs[:, i], piece.outputs[use, i].mean())
            three = np.vstack([measured, measured - left[:, i], left[:, i]])
            f, density = welch(detrend(three), rate, nperseg=n)
            out[name] = (2.0 * np.pi * f[1:], *density[:, 1:])
        return out


def advice(
    poles: Array, factors: Sequence[float] | Array, axes: Array, *, prior: bool
) -> tuple[str, ...]:
    """Sentences on a further test, as far as information grows with the square of the excitation.

    Args:
        poles: `(n,)` frequencies of the free craft [rad/s], of the modes in question.
        factors: by which each mode's intervals are too wide; 1 or less where they are good.
        axes: `(3, a)` that were driven.
        prior: whether there was one.
    """
    out = [
        f"for the mode near {w:.4g} rad/s on the free craft: torque steps of {np.pi / w:.3g} s "
        "each way, half its period, keep it swinging; at the excitation that this log has near "
        f"it, {min(factor, 1e6):.3g} times the torque or {min(factor**2, 1e12):.3g} times the "
        "duration would determine it."
        for w, factor in zip(poles, factors, strict=True)
        if factor > 1.0
    ]
    if quiet := " and ".join(
        name for name, row in zip("xyz", axes, strict=True) if not np.any(np.abs(row) > 1e-9)
    ):
        text = (
            f"torque about the mount's {quiet}, with the rates about it, would determine the "
            "moments about it."
        )
        out.append(text)
    if not prior:
        out.append(
            "no torque determines participation in force while the craft floats freely: only a "
            "prior, a thruster's force, or a test with the root held does."
        )
    return tuple(out)


def _root(rigid: Array, power: float) -> Array:
    """A root `S`, `S^T S = rigid` (6, 6), or for the power -1/2 its inverse, zero where nothing
    has inertia.

    `S = C^(1/2) D` with the correlation C and the roots D of the diagonal, so that units do not
    mix, and masses of the same C differ by a factor per motion.
    """
    scale = np.sqrt(np.maximum(np.diag(rigid), 0.0))
    inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    values, vectors = np.linalg.eigh(rigid * np.outer(inverse, inverse))
    there = values > NO_INERTIA
    root = (vectors[:, there] * values[there] ** power) @ vectors[:, there].T
    return root * scale if power > 0.0 else inverse[:, None] * root
