"""`identify`: from logs of a spacecraft's motion to the modes of its appendage, with what the logs do not determine."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.linalg import orth
from scipy.stats import chi2

from beamchain.caution import Caution
from beamchain.checks import number, one_of, whole_number
from beamchain.errors import InputError
from beamchain.identification.covariance import COLOURED, covariance, whiteness
from beamchain.identification.describe import TWO, described
from beamchain.identification.hub import Bare, bare, directions
from beamchain.identification.likelihood import Found, Likelihood, compressed, derivatives
from beamchain.identification.logs import SENSED, TORQUES, read_logs
from beamchain.identification.pieces import FEWEST, Cut, active, cut
from beamchain.identification.prior import DAMPING, SMALL, Matched, Prior, matched, read_prior
from beamchain.identification.resolution import resolved
from beamchain.identification.response import Piece, Raw, Spectrum
from beamchain.identification.result import Identification
from beamchain.identification.sanity import check_rigid, check_swapped, folded
from beamchain.identification.start import MOST_MODES, Started, frozen, started
from beamchain.identification.structure import Body, Parts, Structure, Unknown, clamped, turning
from beamchain.identification.tables import from_table
from beamchain.ports.motions import Array

if TYPE_CHECKING:
    from beamchain.engine.library import mujoco

ITERATIONS = 60
LIKELY = 1e-3  # probability of the gain of one mode more by noise alone, below which it is told
NO_NOISE = 1e-22  # mean square of residuals, relative to the data, that is rounding
LIGHT = 0.01  # of the hub's mass: most that is stated for an appendage of unknown mass
SHARE = 0.05  # of the inertia that no mode holds, which that mass may take


class Channels(NamedTuple):
    """What the log has: pieces, names, directions in the mount's axes, the driven axes `(3, a)`."""

    pieces: list[Piece | Spectrum]
    torques: tuple[str, ...]
    sensed: tuple[str, ...]
    inputs: Array
    outputs: Array
    axes: Array
    scale: Array
    warnings: list[str]


def identify(
    logs: Any,
    craft: "str | Path | mujoco.MjSpec | mujoco.MjModel",
    at: str,
    *,
    prior: Any = None,
    modes: int | None = None,
    axes: str | Sequence[str] | None = None,
    map: Mapping[str, str] | None = None,
    hub: str | None = None,
    held_out: float = 0.2,
    offset: bool = False,
) -> Identification:
    """Modes of an appendage from logs of the spacecraft that carries it, with their covariance.

    Small motions in free flight: the hub's mass properties are those of `craft`, torques are held from sample to sample.
    A first model is built mode by mode, then the likelihood of the exact sampled coupled model is maximised in frequency,
    damping and participation; residual masses are positive at every step. A log of rotation determines moments of
    participation about the axes that were driven; the other rows, and the part of the frequency that depends on them (the craft
    translates freely), come from the prior, with a relative standard deviation of 0.3 where it states none in [uncertain].
    Without a prior they are zero and listed: frequencies are then those with the hub's rotation held and its translation free.

    Args:
        logs: a path (.csv, .parquet, .npz, .mat; .uff), a mapping of arrays, or a list of those. Time logs: `time` [s],
            `torque_x|y|z` [N m] on the hub in its axes or an actuator's name, `rate_*` [rad/s], `attitude_*` [rad] (small). Frequency responses:
            `frequency` [Hz] or `omega` [rad/s], and `rate_z/torque_z re`, `... im`.
        craft: the bare rigid spacecraft: path or text of MJCF, MjSpec or MjModel.
        at: its site or body that carries the appendage, whose x axis points outwards.
        prior: SPEC.toml, Spec, beam or modes.
        modes: how many; None: as the Bayesian information criterion says.
        axes: letters of the hub's axes that are used; all that were driven where left out.
        map: column names of the log, and what they mean.
        hub: "estimate": the hub's inertia about the driven axes is known only as the prior is; needs a prior.
        held_out: the last part of each log, predicted from the rest and then used too.
        offset: the sensors lag behind the torques by an unknown constant time.

    Returns:
        An `Identification`: `modes`, `covariance`, `undetermined`, `warnings`, `data()`, `write(path)`.

    Raises:
        InputError: a log cannot be read, contradicts itself or the craft, or nothing in it excites the craft.

    Example:
        >>> import beamchain as bc
        >>> import numpy as np
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> omega = np.linspace(0.2, 8.0, 300)
        >>> s = 1j * omega
        >>> inertia = 130.0 - 36.0 * s**2 / (s**2 + 0.02 * s + 4.0)  # 36 kg m^2 swing at 2 rad/s
        >>> log = {"omega": omega, "rate_z/torque_z": 1.0 / (s * inertia)}
        >>> found = bc.identify(log, craft, "mount")
        >>> len(found.modes)
        1
    """
    known = bare(craft, at)
    held = number("held_out", held_out, "", cure="Give the part of the log that is predicted, 0 to 0.5.")
    if not 0.0 <= held <= 0.5:
        raise InputError(
            f"held_out = {held_out!r} must lie between 0 and 0.5; 0.2 predicts the last fifth of each log."
        )
    if modes is not None:
        whole_number("modes", modes, 1, MOST_MODES - 1)
    if hub is not None:
        one_of("hub", hub, ("estimate",))
        if prior is None:
            raise InputError(
                'hub = "estimate" needs a prior: a log determines only the sum of the hub\'s inertia and the '
                "appendage's."
            )
    times, spectra, tables = read_logs(logs, map, list(known.actuators))
    before = None if prior is None else read_prior(prior, known.mass)
    if tables:
        if times or spectra or before is None:
            raise InputError(
                f"{tables[0].source} holds frequencies only, which need a prior for the participation and no "
                "other log beside them."
            )
        return from_table(tables[0], before, at)
    if bool(times) == bool(spectra):
        raise InputError("time logs and frequency responses cannot be used together; give one kind.")
    wanted = _axes(axes)
    data = _of_time(times, known, wanted, before) if times else _of_spectra(spectra, known, wanted, before)
    return _Run(data, known, before, modes, held, hub == "estimate", offset, at).result()


def _axes(axes: str | Sequence[str] | None) -> tuple[str, ...]:
    letters = tuple("xyz" if axes is None else axes)
    for letter in letters:
        one_of("axes", letter, "xyz")
    if not letters:
        raise InputError("axes is empty; name at least one of x, y, z.")
    return letters


def _driven(known: Bare, torques: Sequence[str], sensed: Sequence[str], prior: Prior | None) -> tuple[Array, list[str]]:
    """Axes `(3, a)` that are driven, and the sensors that are used: without a prior those about driven axes only."""
    inputs = directions(known, tuple(torques))
    axes = orth(inputs.T, rcond=1e-6)
    if axes.shape[1] == np.linalg.matrix_rank(np.abs(inputs) > 1e-9):
        used = np.flatnonzero(np.any(np.abs(inputs) > 1e-9, axis=0))
        axes = np.eye(3)[:, used] if used.size == axes.shape[1] else axes
    elsewhere = [n for n in sensed if np.linalg.norm(directions(known, (n,)) @ axes) < 1.0 - 1e-6]
    kept = [n for n in sensed if prior is not None or n not in elsewhere]
    if not [n for n in kept if n not in elsewhere]:
        raise InputError(
            f"the torques ({', '.join(torques)}) act about other axes than those sensed ({', '.join(sensed)}); "
            "the log must hold the "
            "rate or attitude about an axis that is driven."
        )
    return axes, kept


def _of_time(logs: Any, known: Bare, wanted: Sequence[str], prior: Prior | None) -> Channels:
    torques = [n for n in dict.fromkeys(n for log in logs for n in log.torques) if n not in TORQUES or n[-1] in wanted]
    sensed = [n for n in SENSED if n[-1] in wanted and any(n in log.sensed for log in logs)]
    if not torques or not sensed:
        raise InputError(
            f"axes = {''.join(wanted)!r} leaves no torque or no sensor of the log; it has "
            f"{', '.join([*logs[0].torques, *logs[0].sensed])}."
        )
    torques = active(logs, torques)
    axes, sensed = _driven(known, torques, sensed, prior)
    made: Cut = cut(logs, torques, sensed)
    scale = np.sqrt(
        np.mean([np.var(p.outputs, axis=0) * p.time.size for p in made.pieces], axis=0)
        / np.mean([p.time.size for p in made.pieces])
    )
    for name, size in zip(sensed, scale, strict=True):
        if not size > 0.0:
            raise InputError(
                f"{name} is constant throughout the log; the sensor shows no motion: check the column and its "
                "unit (rad/s)."
            )
    check_swapped(made)
    return Channels(
        [*made.pieces],
        tuple(torques),
        tuple(sensed),
        directions(known, made.torques),
        directions(known, made.sensed),
        axes,
        scale,
        made.warnings,
    )


def _of_spectra(spectra: Any, known: Bare, wanted: Sequence[str], prior: Prior | None) -> Channels:
    own = [
        r
        for r in spectra
        if r.sensed[-1] in wanted and (r.torque in known.actuators or (r.torque in TORQUES and r.torque[-1] in wanted))
    ]
    if not own:
        raise InputError(
            "no frequency response of the log is from a torque (torque_x|y|z or an actuator of the craft) "
            "about the wanted axes."
        )
    torques = tuple(dict.fromkeys(r.torque for r in own))
    axes, kept = _driven(known, torques, [f"rate_{a}" for a in dict.fromkeys(r.sensed[-1] for r in own)], prior)
    pieces: list[Piece | Spectrum] = [
        Spectrum(r.omega, r.value, kept.index(f"rate_{r.sensed[-1]}"), torques.index(r.torque), r.order, r.accuracy)
        for r in own
        if f"rate_{r.sensed[-1]}" in kept
    ]
    return Channels(
        pieces,
        torques,
        tuple(kept),
        directions(known, torques),
        directions(known, tuple(kept)),
        axes,
        np.ones(len(kept)),
        [],
    )


class _Run:
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
        if offset:
            raise InputError("offset = True is not available for this log; align the columns before.")

    def result(self) -> Identification:
        """Start, refine, judge."""
        data = self.data
        shown, hidden = self._parted()
        inertia = turning(Parts(np.zeros(0), np.zeros(0), np.zeros((0, 6)), self._rigid(), self.known.mass)).inertia
        guess = data.outputs @ np.linalg.solve(inertia, data.inputs.T)
        check_rigid(frozen(shown, guess, data.scale).rigid, data, self.known, self._rigid(), roughly=True)
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
        likelihood = replace_pieces(likelihood, data.pieces)
        found = likelihood.best(first.theta, ITERATIONS) if hidden else first
        return self._described(structure, likelihood, found, begun, pairs, predicted)

    def _rigid(self) -> Array:
        return np.zeros((6, 6)) if self.prior is None else self.prior.parts.rigid

    def _parted(self) -> tuple[list[Piece | Spectrum], list[Piece]]:
        """Pieces with their last part not used, and with nothing but it used."""
        data = self.data
        if self.held == 0.0 or not isinstance(data.pieces[0], Piece):
            return data.pieces, []
        shown, hidden = list[Piece | Spectrum](), list[Piece]()
        for log in {p.log for p in data.pieces}:
            own = [p for p in data.pieces if isinstance(p, Piece) and p.log == log]
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
        hub = turning(Parts(np.zeros(0), np.zeros(0), np.zeros((0, 6)), np.zeros((6, 6)), known.mass)).inertia
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
                now = turning(
                    Parts(np.zeros(0), np.zeros(0), np.zeros((0, 6)), body.matrix(moments, own), known.mass)
                ).inertia
                rest = body.rest(own) + total - data.axes.T @ now @ data.axes
            return structure, structure.theta(Parts(w, z, rows, np.zeros((6, 6)), known.mass), body.theta(rest)), None
        rigid = np.zeros(Body.count)
        there = data.axes.T @ turning(Parts(w[:0], z[:0], rows6(0), prior.parts.rigid, known.mass)).inertia @ data.axes
        bare_there = data.axes.T @ hub @ data.axes
        factor = (np.trace(total) - np.trace(bare_there)) / (np.trace(there) - np.trace(bare_there))
        rigid[[0, 2, 3, 4]] = np.log(np.clip(factor, 0.2, 5.0)) if not self.free_hub else 0.0
        matrix = prior.body.matrix(rigid)
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
        structure = Structure(
            known.mass, data.inputs, data.outputs, live, prior.body, data.axes if self.free_hub else none
        )
        return structure, structure.theta(Parts(frequencies, z, first, matrix, known.mass), rigid), pairs

    def _likelihood(
        self, structure: Structure, theta: Array, pairs: Matched | None, pieces: Sequence[Piece | Spectrum]
    ) -> Likelihood:
        if self.prior is None or pairs is None:
            return Likelihood(pieces, structure.raw, lambda _: np.zeros(0), self.data.scale)
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

        return Likelihood(pieces, structure.raw, belief, self.data.scale)

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
        residuals = [piece.assess(raw, weights)[1] for piece in likelihood.pieces]
        white = whiteness(likelihood, residuals)
        level = found.squares / np.maximum(found.counts, 1.0) / self.data.scale**2
        white = np.where(level < NO_NOISE, np.nan, white)
        coloured = bool(np.any(white < COLOURED))
        squares = np.maximum(level, NO_NOISE) * found.counts * self.data.scale**2
        spread = self.widened * covariance(likelihood, found.theta, squares, coloured=coloured)
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
        return resolved(result, structure, found, likelihood)


def rows6(n: int) -> Array:
    """No participation of `n` modes."""
    return np.zeros((n, 6))


def replace_pieces(likelihood: Likelihood, pieces: Sequence[Piece | Spectrum]) -> Likelihood:
    """The same of other pieces."""
    return Likelihood(pieces, likelihood.model, likelihood.belief, likelihood.scale)


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
