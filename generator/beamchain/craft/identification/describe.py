"""The estimate put into words and numbers: standard deviations, what is undetermined and why, spectra of the residuals."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import detrend, welch

from beamchain.caution import Caution
from beamchain.craft.identification.advice import advice
from beamchain.craft.identification.likelihood import Found, derivatives, inverse
from beamchain.craft.identification.prior import WIDTH, Matched, Prior
from beamchain.craft.identification.response import Piece, Raw
from beamchain.craft.identification.result import Identification, IdentifiedMode
from beamchain.craft.identification.start import Order
from beamchain.craft.identification.structure import Body, Parts, Structure, Unknown, stated, turning
from beamchain.craft.identification.update import Update, seen_of, update
from beamchain.ports.motions import Array

USEFUL_FREQUENCY = 0.03  # relative standard deviation beyond which a frequency is not determined
USEFUL_DAMPING = 0.5
SIGNIFICANT = 4.0  # standard deviations of a mode's moment below which it may be none
TOLD = 0.5  # of the prior's width: what the log narrows less comes from the prior
SURPRISE = 3.0  # widths of the prior
TWO = 5.0  # half widths of a resonance, within which the next mode makes it doubtful
CLOSE = 3.0  # half widths, of two resonances that the log may not tell apart
MOTIONS = ("x", "y", "z", "rotation x", "rotation y", "rotation z")
SPECTRUM = 2048  # samples of a stretch


def described(
    structure: Structure,
    found: Found,
    spread: Array,
    belief: Array,
    orders: Sequence[Order],
    pairs: Matched | None,
    prior: Prior | None,
    aliased: Sequence[complex],
    doubtful: Array,
    white: Array,
    predicted: Array,
    warnings: list[str],
    data: Any,
    residuals: Sequence[Array],
    raw: Raw,
    noise: Array,
    at: str,
) -> Identification:
    """The result of a search; arguments as `identify` has them."""
    parts = structure.parts(found.theta)
    n = structure.modes
    place = structure.places
    flat = derivatives(lambda x: structure.parts(x).participation.ravel(), structure.loosened(found.theta))
    sd_rows = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", flat, spread, flat), 0.0)).reshape(n, 6)
    sd_w, sd_z = (np.sqrt(np.diag(spread)[p]) for p in place[:2])
    said, notes = list[str](), [list[str]() for _ in range(n)]
    moments, sd_moments = _moments(structure, found.theta, spread, data.axes)
    determined = [True] * n
    half = float(np.pi / np.mean(data.pieces[0].steps)) if isinstance(data.pieces[0], Piece) else np.inf
    for i in range(n):
        if moments[i] < SIGNIFICANT * sd_moments[i]:
            notes[i].append("its moment does not differ significantly from zero")
            determined[i] = False
        told = sd_w[i] < USEFUL_FREQUENCY and (
            pairs is None or pairs.of[i] < 0 or sd_w[i] < TOLD * prior_width(prior, 0)
        )
        if not told:
            notes[i].append("its frequency is not determined")
        if sd_z[i] > USEFUL_DAMPING:
            notes[i].append("its damping is not determined")
        determined[i] &= told and sd_z[i] <= USEFUL_DAMPING
        if parts.frequencies[i] > half and aliased:
            notes[i].append(
                f"it lies above half the sample rate ({half:.4g} rad/s): its frequency may be folded differently"
            )
            determined[i] = False
        if pairs is not None and pairs.of[i] < 0:
            notes[i].append("the prior has no mode like it: participation in force is zero, not known")
    for i, pole in enumerate(raw.poles[np.argsort(np.argsort(parts.frequencies))]):
        near = np.abs(doubtful - abs(pole)) < TWO * max(-pole.real, 0.0)
        if int(near.sum()) > 1:
            notes[i].append("it may stand for two close modes")
            determined[i] = False
    _close(parts, sd_w, notes, determined, warnings, float(np.nanmin(white)) if np.any(np.isfinite(white)) else 1.0)
    rows, sd_rows = _rows(structure, parts, sd_rows, pairs, prior, data.axes, said, notes)
    names, matrix = _covariance(structure, found.theta, spread, parts)
    modes = [
        IdentifiedMode(
            0,
            float(parts.frequencies[i]),
            float(parts.damping[i]),
            rows[i],
            float(parts.frequencies[i] * sd_w[i]),
            float(parts.damping[i] * sd_z[i]),
            sd_rows[i],
            determined[i],
            "; ".join(notes[i]),
        )
        for i in range(n)
    ]
    if np.isfinite(half):
        said.append(
            f"modes above half the sample rate ({half:.4g} rad/s): sampling would show one folded, as a mode "
            "below, which the log alone "
            "cannot always tell."
        )
    if pairs is not None and prior is not None:
        modes += _unseen(prior, pairs, parts, half, said, warnings)
    for mode in modes[:n]:
        if mode.remark and not mode.determined:
            said.append(f"mode at {mode.frequency:.5g} rad/s: {mode.remark}.")
    order = sorted(range(len(modes)), key=lambda i: modes[i].frequency)
    numbers = {old: new + 1 for new, old in enumerate(order)}
    renamed = tuple(f"mode{numbers[i]}.{kind}" for i, kind in names)
    modes = [replace(modes[i], number=k + 1) for k, i in enumerate(order)]
    if prior is not None and pairs is not None:
        _surprises(prior, pairs, parts, structure, found, warnings)
    updated = _update(structure, found, spread, belief, pairs, prior, data.axes)
    if updated is not None:
        said += updated.undetermined
    if said:
        warnings.append(
            Caution("undetermined", f"the log leaves {len(said)} thing(s) undetermined; see `undetermined`.")
        )
    given, length = None, None
    if isinstance(structure.body, Unknown):
        rigid, rows, length = stated(parts, data.axes)
        given = (rigid, rows[order])
    wide = [
        float(
            max(
                sd_w[k] / USEFUL_FREQUENCY,
                sd_z[k] / USEFUL_DAMPING,
                SIGNIFICANT * sd_moments[k] / max(moments[k], 1e-300),
            )
        )
        for k in np.argsort(parts.frequencies)
    ]
    advised = advice(np.abs(raw.poles), wide, data.axes, prior=prior is not None)
    return Identification(
        tuple(modes),
        renamed,
        matrix,
        parts.rigid,
        tuple(orders),
        dict(zip(data.sensed, white.tolist(), strict=True)),
        tuple(warnings),
        tuple(said),
        updated,
        dict(zip(data.sensed, predicted.tolist(), strict=True)),
        dict(zip(data.sensed, noise.tolist(), strict=True)),
        _spectra(data, residuals),
        length,
        f"log at {at}",
        given,
        advised,
    )


def prior_width(prior: Prior | None, which: int) -> float:
    """Relative width of what the prior says of frequency, damping, participation, rigid mass."""
    return WIDTH if prior is None else prior.widths[which]


def _moments(structure: Structure, theta: Array, spread: Array, axes: Array) -> tuple[Array, Array]:
    """Size of each mode's effective moment about the driven axes, and its standard deviation."""

    def size(x: Array) -> Array:
        return turning(structure.parts(x)).moments @ axes

    own = size(theta)
    slopes = derivatives(lambda x: size(x).ravel(), theta).reshape(*own.shape, theta.size)
    length = np.linalg.norm(own, axis=1)
    along = np.einsum("ia,iap->ip", own / np.maximum(length, 1e-300)[:, None], slopes)
    return length, np.sqrt(np.maximum(np.einsum("ip,pq,iq->i", along, spread, along), 0.0))


def _close(
    parts: Parts, sd: Array, notes: list[list[str]], determined: list[bool], warnings: list[str], white: float
) -> None:
    order = np.argsort(parts.frequencies)
    for a, b in zip(order, order[1:], strict=False):
        apart = float(parts.frequencies[b] - parts.frequencies[a])
        band = float(parts.damping[a] * parts.frequencies[a] + parts.damping[b] * parts.frequencies[b])
        blur = float(np.hypot(sd[a] * parts.frequencies[a], sd[b] * parts.frequencies[b]))
        if apart < CLOSE * band and apart < 5.0 * blur:
            for i in (a, b):
                notes[i].append("it and its neighbour cannot be told apart")
                determined[i] = False
    if white < 1e-6:
        warnings.append(
            Caution(
                "undetermined",
                "the residuals are far from white, so that a mode may stand for two close ones or others are missing; "
                "intervals hold only if what is missing is small.",
            )
        )


def _rows(
    structure: Structure,
    parts: Parts,
    sd: Array,
    pairs: Matched | None,
    prior: Prior | None,
    axes: Array,
    said: list[str],
    notes: list[list[str]],
) -> tuple[Array, Array]:
    """Participation and its deviations, nan where nothing is known; sentences on what comes from where."""
    rows, out = parts.participation.copy(), sd.copy()
    if isinstance(structure.body, Unknown) or prior is None or pairs is None:
        driven = np.concatenate([np.zeros(3, dtype=bool), np.any(np.abs(axes) > 1e-9, axis=1)])
        out[:, ~driven] = np.nan
        for note in notes:
            note.append(
                "its frequency is that with the hub's rotation held and its translation free: participation in "
                "force, which the log "
                "does not show, would lower the clamped one"
            )
        others = ", ".join(m for m, d in zip(MOTIONS, driven, strict=True) if not d)
        said.append(
            f"participation in {others}: the log excites only the hub's rotation about "
            f"{', '.join('xyz'[i] for i in range(3) if driven[3 + i])} "
            "of the mount and there is no prior; it is set to zero. Moments are those about the mass centre of "
            "the craft, frequencies those "
            "with the hub's rotation held and its translation free: both hold on this craft."
        )
        said.append(
            "mass and length of the appendage: the file of modes states a nearly massless, very long one with "
            "the inertia found, which pushes as "
            "little as a chain allows; it serves on this craft only, and not for pictures. Give a prior for both."
        )
        return rows, out
    own = prior.widths[2]
    for i, j in enumerate(pairs.of):
        if j < 0:
            out[i, :3] = np.nan
            continue
        width = own * np.maximum(np.abs(prior.parts.participation[j]), 1e-300)
        weak = [k for k in range(6) if structure.live[i, k] and abs(rows[i, k]) > 1e-9 and out[i, k] > TOLD * width[k]]
        if weak:
            notes[i].append(f"participation in {', '.join(MOTIONS[k] for k in weak)} comes from the prior")
        out[i, ~structure.live[i]] = np.nan
    told = sorted({word for note in notes for one in note if "comes from the prior" in one for word in [one]})
    if told:
        said.append("not determined by the log but taken from the prior, with its width: " + "; ".join(told) + ".")
    return rows, out


def _covariance(structure: Structure, theta: Array, spread: Array, parts: Parts) -> tuple[list[tuple[int, str]], Array]:
    """Covariance of frequency, damping and a factor on participation per mode."""
    n = structure.modes
    scale = np.sqrt(np.maximum(np.diag(parts.rigid), 1e-300))
    base = parts.participation / scale

    def values(x: Array) -> Array:
        now = structure.parts(x)
        factor = np.einsum("ij,ij->i", now.participation / scale, base) / np.maximum(
            np.einsum("ij,ij->i", base, base), 1e-300
        )
        return np.concatenate([now.frequencies, now.damping, factor])

    slopes = derivatives(values, theta)
    names = [(i, kind) for kind in ("frequency", "damping", "participation") for i in range(n)]
    return names, slopes @ spread @ slopes.T


def _unseen(
    prior: Prior, pairs: Matched, parts: Parts, half: float, said: list[str], warnings: list[str]
) -> list[IdentifiedMode]:
    """Modes of the prior that do not turn the craft about a driven axis, scaled with the rigid mass; sentences on them."""
    out = list[IdentifiedMode]()
    top = float(parts.frequencies.max(initial=0.0))
    before, now = (np.sqrt(np.maximum(np.diag(m), 1e-300)) for m in (prior.parts.rigid, parts.rigid))
    kept = [j for j in pairs.unseen if prior.parts.frequencies[j] <= top or prior.chosen is not None]
    for j in kept:
        w, z = float(prior.parts.frequencies[j]), float(prior.parts.damping[j])
        row = prior.parts.participation[j] * (now / before)
        out.append(
            IdentifiedMode(
                0,
                w,
                z,
                row,
                w * prior.widths[0],
                z * prior.widths[1],
                np.abs(row) * prior.widths[2],
                False,
                "the log does not excite it: all of it comes from the prior",
            )
        )
    if kept:
        said.append(
            f"{len(kept)} mode(s) of the prior do not turn the craft about a driven axis and stay as the prior "
            "has them."
        )
    beyond = [float(pairs.frequencies[j]) for j in pairs.missed if pairs.frequencies[j] > half]
    if beyond:
        said.append(
            f"{len(beyond)} mode(s) of the prior, from {min(beyond):.4g} rad/s, lie above half the sample rate "
            f"({half:.4g} rad/s): this log cannot determine them."
        )
    for w in (float(pairs.frequencies[j]) for j in pairs.missed):
        if w <= min(half, 1.2 * top):
            warnings.append(
                Caution(
                    "prior-contradicted", f"the prior's mode at {w:.4g} rad/s was not found in the log and is left out."
                )
            )
    return out


def _surprises(
    prior: Prior, pairs: Matched, parts: Parts, structure: Structure, found: Found, warnings: list[str]
) -> None:
    off = found.theta[structure.places[3]] / prior.widths[3]
    if isinstance(structure.body, Body) and np.max(np.abs(off)) > SURPRISE:
        what = ("mass", "mass centre", "inertia", "inertia", "inertia")[int(np.argmax(np.abs(off)))]
        warnings.append(
            Caution(
                "prior-contradicted",
                f"the appendage's {what} found is {np.max(np.abs(off)):.2g} widths of the prior off it.",
            )
        )
    for i, j in enumerate(pairs.of):
        if j >= 0:
            far = abs(np.log(parts.frequencies[i] / prior.parts.frequencies[j])) / prior.widths[0]
            if far > SURPRISE:
                warnings.append(
                    Caution(
                        "prior-contradicted",
                        f"the mode at {parts.frequencies[i]:.5g} rad/s lies {far:.2g} widths off the prior's.",
                    )
                )


def _update(
    structure: Structure,
    found: Found,
    spread: Array,
    belief: Array,
    pairs: Matched | None,
    prior: Prior | None,
    axes: Array,
) -> Update | None:
    """The beam's factors from what the log alone says of frequencies with free translation, moments and inertia."""
    if prior is None or pairs is None or prior.spec.imported is not None:
        return None

    which = list(range(structure.modes))

    def values(x: Array) -> Array:
        return seen_of(structure.parts(x), axes, which)

    slopes = derivatives(values, found.theta)
    alone = inverse(inverse(spread) - (1.0 - 1e-6) * belief)
    return update(
        prior, pairs.of, values(found.theta), slopes @ alone @ slopes.T, axes, moments=structure.scaled.shape[1] == 0
    )


def _spectra(data: Any, residuals: Sequence[Array]) -> dict[str, tuple[Array, Array, Array, Array]]:
    out = dict[str, tuple[Array, Array, Array, Array]]()
    if not isinstance(data.pieces[0], Piece):
        return out
    which = int(np.argmax([p.time.size for p in data.pieces]))
    piece, left = data.pieces[which], residuals[which]
    n = min(SPECTRUM, piece.time.size)
    rate = 1.0 / float(np.mean(piece.steps))
    for i, name in enumerate(data.sensed):
        use = piece.use[:, i]
        measured = np.where(use, piece.outputs[:, i], piece.outputs[use, i].mean())
        (f, a), (_, b), (_, c) = (
            welch(detrend(v), rate, nperseg=n) for v in (measured, measured - left[:, i], left[:, i])
        )
        out[name] = (2.0 * np.pi * f[1:], a[1:], b[1:], c[1:])
    return out
