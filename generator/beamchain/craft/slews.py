"""Large slews of a spacecraft's own hinges, joint by joint: what the chains of its appendages hold,
and what the step of the integrator does to the motion.

Theory: docs/theory.md, section 9.
"""

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from beamchain.craft.appendage import PROBE, Appendage, craft_elements, moved_bodies
from beamchain.craft.documents import read_bare
from beamchain.craft.embedding import EmbeddedFile, marked_craft
from beamchain.craft.promise import joint_request
from beamchain.engine.driven_hinge import Drive, Run, Seen, Turn, drive_of, run, seen
from beamchain.engine.library import hangs_on, mujoco
from beamchain.engine.linearise import INTEGRATORS, NUMBERS, compile_model
from beamchain.engine.operating_point import base_body, quiet_copy
from beamchain.errors import BeamchainError, EngineError, InputError
from beamchain.fitting.options import Modes
from beamchain.fitting.spec import Spec
from beamchain.mjcf.relocate import relocate
from beamchain.ports.motions import PORTS, Array
from beamchain.steps.budget import linear_model
from beamchain.steps.dominant_element import culprit
from beamchain.steps.limits import step_limits
from beamchain.steps.retime import retime, without_timing
from beamchain.warning_codes import Caution

Say = Callable[[str], None]

#: angles [rad] and durations, in periods of the slowest coupled mode at rest
TURNS = ((np.pi / 2.0, 5.0), (np.pi / 2.0, 10.0), (np.pi, 10.0))
RINGING = 1.0  # periods that are looked at after the turn
SAMPLES = 400  # of a slew
FINE = 1600  # steps per period of the slowest mode, at least, under RK4
DIVIDED = 3  # times as many modes has a finely divided appendage, per port,
FINEST = 6  # but at most so many: chains of more are no better in large motion
SHARE_OF_LIMIT = 0.7  # of RK4's stability limit: a step up to which no mode is slowed for it
MOST_OF_LIMIT = 0.98  # of that limit: stable still
MOST_STEPS = 400_000  # of one simulation
MOST_HINGES = 6
NOTHING = 1e-9  # rad and m: less elastic motion has no share to speak of
ORDER = 4  # of RK4's error in the step


@dataclass(frozen=True)
class SlewBody:
    """A body of the spacecraft, or a port of an appendage, in a slew: the largest differences of
    its attitude [rad] and place [m] at any time.

    Args:
        name: of the body; of the site, for a port.
        elastic_attitude, elastic_place: flexible less rigid craft, under the same torques.
        chain_attitude, chain_place: the file less the craft with finely divided appendages, both
            under RK4: what the chains are off.
        step_attitude, step_place: the file at its own step and integrator less the file under RK4:
            what the step is off.
    """

    name: str
    elastic_attitude: float
    elastic_place: float
    chain_attitude: float
    chain_place: float
    step_attitude: float
    step_place: float

    @property
    def chain_share(self) -> float:
        """What the chains are off, over the elastic motion; attitude or place, the larger."""
        turned = _over(self.chain_attitude, self.elastic_attitude)
        return max(turned, _over(self.chain_place, self.elastic_place))

    @property
    def step_share(self) -> float:
        """What the step is off in attitude, over the elastic part of it."""
        return _over(self.step_attitude, self.elastic_attitude)


def _over(error: float, size: float) -> float:
    return error / size if size > NOTHING else 0.0


@dataclass(frozen=True)
class SlewRow:
    """A slew of one hinge by the torques that it takes on the rigid craft.

    Args:
        joint: its name.
        angle: [rad].
        duration: [s].
        rate: largest, of the hinge [rad/s].
        integrator, timestep: the file's own.
        bodies: what moves, the bus first.
        momentum: largest change of the angular momentum about the centre of mass at the own step,
            over the largest that what is behind the hinge has; None on a base that is held.
        momentum_rk4: the same under RK4.
        energy: largest error of the energy at the own step, over its largest value.
        step_rk4: of RK4 [s].
        error_rk4: its own error in attitude, of the worst body, from twice or half the step [rad].
    """

    joint: str
    angle: float
    duration: float
    rate: float
    integrator: str
    timestep: float
    bodies: tuple[SlewBody, ...]
    momentum: float | None
    momentum_rk4: float | None
    energy: float
    step_rk4: float
    error_rk4: float

    @property
    def chain_share(self) -> float:
        """What the chains are off, over the elastic motion, worst body."""
        return max(body.chain_share for body in self.bodies)

    @property
    def step_share(self) -> float:
        """What the step is off in attitude, over the elastic part of it, worst body."""
        return max(body.step_share for body in self.bodies)

    def as_dict(self) -> dict[str, Any]:
        """For stability.json."""
        shares = ("chain_share", "step_share")
        own = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "bodies"}
        bodies = [
            {**vars(body), **{name: getattr(body, name) for name in shares}} for body in self.bodies
        ]
        return {**own, **{name: getattr(self, name) for name in shares}, "bodies": bodies}


@dataclass(frozen=True, eq=False)
class Slews:
    """The slews of a file, warnings, and which integrator to take."""

    rows: list[SlewRow] = field(default_factory=list[SlewRow])
    warnings: list[str] = field(default_factory=list[str])


class _Reference(NamedTuple):
    """A model to be run with RK4, the step, and the largest that is stable [s]."""

    model: "mujoco.MjModel"
    step: float
    limit: float

    def compared(self) -> "_Reference":
        """The same at twice the step, or at half of it where twice is near the largest: there the
        error does not yet fall with the fourth power of the step."""
        is_far = 2.0 * self.step <= SHARE_OF_LIMIT * self.limit
        return self._replace(step=self.step * (2.0 if is_far else 0.5))


class _Model(NamedTuple):
    """A model of the craft, and where the bare craft's joints and bodies are in it."""

    model: "mujoco.MjModel"
    joints: list[int]
    bodies: list[int]

    def under_rk4(self, timestep: float) -> _Reference:
        """It is run with RK4 at a step, modes too fast for it slowed; at a shorter one where
        something else, such as the kv of a servo, is too fast for it."""
        model = copy.copy(self.model)
        limit = _rk4_limit(model)
        if timestep <= SHARE_OF_LIMIT * limit:
            return _Reference(model, timestep, limit)
        try:
            retime(model, timestep, "RK4")
        except InputError:  # nothing can be slowed
            return _Reference(model, SHARE_OF_LIMIT * limit, limit)
        limit = _rk4_limit(model)  # of modes that are slowed: 1.4 steps
        stable = timestep <= MOST_OF_LIMIT * limit
        return _Reference(model, timestep if stable else SHARE_OF_LIMIT * limit, limit)


def _rk4_limit(model: "mujoco.MjModel") -> float:
    """The largest stable step of RK4 [s]."""
    return float(step_limits(linear_model(model)).largest_step["RK4"]) if model.nv else np.inf


def slews(
    path: Path,
    model: "mujoco.MjModel",
    slowest: float,
    say: Say = lambda _: None,
    joints: Sequence[str] = (),
) -> Slews:
    """Slew the hinges of a file that `embed` wrote, one by one.

    Slewed are the spacecraft's own hinges without a spring behind which, or on whose
    appendage-carried bodies, something flexible moves; all other joints get the torques that hold
    them on the rigid craft. From rest, by 90 degrees in 5 and 10 periods of the slowest coupled
    mode and by 180 degrees in 10, or as far as the hinge's range allows.

    Args:
        path: of the file.
        model: it, compiled.
        slowest: frequency of its slowest mode [rad/s].
        say: told what is being simulated.
        joints: names of the hinges to slew; all where it is empty.

    Raises:
        InputError: a name is none of a hinge that can be slewed.
    """
    try:
        original, wanted = read_bare(path)
        if not wanted or not _drives(compile_model(relocate(original, None).text)):
            _wished(model, [], joints)
            return Slews()
        say("dividing the appendages finely")
        marked = marked_craft(original, wanted)
        hinges = _hinges(marked)
        wished = _wished(marked.craft, hinges, joints)
        if not hinges:
            return Slews()
        scene = _Scene(marked, model, 2.0 * np.pi / slowest)
    except _NoHingeError:
        raise
    except BeamchainError as error:
        text = f"slews of the craft's own hinges could not be simulated: {error}"
        return Slews(warnings=[Caution("large-motion-unknown", text)])
    rows: list[SlewRow] = []
    warnings: list[str] = []
    for number, joint in enumerate(wished):
        name = scene.bare.joint(joint).name or f"joint {joint}"
        own: list[SlewRow] = []
        try:
            turns = _turns(scene.bare, joint, scene.period)
            for turn in turns:
                angle = np.degrees(turn.angle)
                place = f"hinge {number + 1} of {len(wished)}, slew {len(own) + 1} of {len(turns)}"
                say(f"slewing {name} by {angle:.0f} degrees in {turn.duration:.3g} s ({place})")
                own.append(scene.slew(joint, name, turn))
        except BeamchainError as error:
            warnings.append(Caution("large-motion-unknown", f"slew of {name}: {error}"))
        rows += own
    if not joints and (left := hinges[MOST_HINGES:]):
        names = ", ".join(scene.bare.joint(j).name for j in left)
        text = f"only the first {MOST_HINGES} hinges were slewed, not {names}; give joints."
        warnings.append(Caution("large-motion-unknown", text))
    warnings += _warnings(rows, scene.tolerance)
    return Slews(rows, warnings)


class _NoHingeError(InputError):
    """A hinge that was asked for cannot be slewed."""


def _wished(craft: "mujoco.MjModel", hinges: Sequence[int], joints: Sequence[str]) -> Sequence[int]:
    """The hinges that were asked for by name, else the first few."""
    known = {str(craft.joint(j).name): j for j in hinges}
    for name in joints:
        if name not in known:
            can = ", ".join(filter(None, known))
            cure = f"those are: {can}." if can else "the file has none; leave joints out."
            raise _NoHingeError(f"joints = {name!r}: no hinge of that name is slewed; {cure}")
    return [known[name] for name in joints] or hinges[:MOST_HINGES]


def _drives(craft: "mujoco.MjModel") -> list[int]:
    """Hinges of a bare craft between bodies, without a spring."""
    return [
        j
        for j in range(craft.njnt)
        if int(craft.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE)
        and int(craft.jnt_bodyid[j]) != base_body(craft, int(craft.jnt_bodyid[j]))
        and float(np.ravel(craft.jnt_stiffness[j])[0]) == 0.0
    ]


def _hinges(marked: EmbeddedFile) -> list[int]:
    """Those to slew: with an appendage behind them, or on a body that an appendage carries."""
    craft = marked.craft
    tops = [craft.body(name).id for name in moved_bodies(marked.appendages)]
    out: list[int] = []
    for j in _drives(craft):
        body = int(craft.jnt_bodyid[j])
        has_behind = any(hangs_on(craft, a.mount.body, body) for a in marked.appendages)
        if has_behind or any(hangs_on(craft, body, top) for top in tops):
            out.append(j)
    return out


def _turns(craft: "mujoco.MjModel", joint: int, period: float) -> list[Turn]:
    """The turns of a hinge from the pose of rest, forwards or backwards, within its range."""
    most, sign = np.inf, 1.0
    if craft.jnt_limited[joint]:
        low, high = craft.jnt_range[joint] - craft.qpos0[craft.jnt_qposadr[joint]]
        most, sign = (high, 1.0) if high >= -low else (-low, -1.0)
    out: list[Turn] = []
    for angle, periods in TURNS:
        turn = Turn(sign * min(angle, most), periods * period)
        if most > 0.0 and turn not in out and (angle <= most or angle < np.pi):
            out.append(turn)
    return out


def _divided(a: Appendage) -> Spec:
    """The specification of an appendage of several times as many modes, up to `FINEST`.

    Imported ones stay as they are: what else their bodies could do is not known.
    """
    if a.spec.imported is not None:
        return a.spec
    kept = {port: target.modes for port, target in a.fit.target.items()}
    static = len(a.spec.further)
    counts = {port: _more(count, static, port) for port, count in kept.items()}
    scene = a.spec.scene
    if scene is not None:
        scene = msgspec.structs.replace(scene, bandwidth=None)
    modes = Modes(**{port: counts.get(port, 0) for port in PORTS})
    return msgspec.structs.replace(a.spec, modes=modes, scene=scene)


def _more(kept: int, static: int, port: str) -> int:
    """Number of modes of a finely divided port, another one than that of the file; of those kept
    some are static shapes of loads."""
    shapes = static * (2 if port in ("xy", "xz") else 1)
    modes = max(kept - shapes, 1)
    return FINEST - 1 if modes == FINEST else min(DIVIDED * modes, FINEST)


class _Scene:
    """A file, its rigid twin and the same craft finely divided, ready to be slewed."""

    def __init__(self, marked: EmbeddedFile, model: "mujoco.MjModel", period: float) -> None:
        self.period = period
        self.bare = marked.craft
        self.tolerance = joint_request([a.spec for a in marked.appendages]).tolerance
        self.timestep = float(model.opt.timestep)
        self.integrator = NUMBERS[int(model.opt.integrator)]
        self.own = quiet_copy(model)
        finer = 2.0 if self.integrator == "RK4" else 1.0  # it is no judge of itself
        wanted = min(self.timestep / finer, period / FINE)
        fine = marked.with_specs({a.at: _divided(a) for a in marked.appendages})
        self.file = self._placed(marked, without_timing(model))
        self.fine = self._placed(fine, fine.compiled())
        rigid = marked.as_rigid()
        self.twin = self._placed(rigid, rigid.compiled())
        self.reference = self.file.under_rk4(wanted)
        self.divided = self.fine.under_rk4(period / FINE)
        self.step = self.reference.step
        self.other = self.reference.compared()
        if self.step == wanted:
            self.other = self.file.under_rk4(2.0 * wanted)
        self.limited = _rk4_words(self.divided) if self.divided.step < period / FINE else ""
        self.held = [
            j
            for j in range(self.bare.njnt)
            if int(self.bare.jnt_type[j]) >= int(mujoco.mjtJoint.mjJNT_SLIDE)
            and int(self.bare.jnt_bodyid[j]) != base_body(self.bare, int(self.bare.jnt_bodyid[j]))
        ]
        self.bodies = self._seen_bodies(marked)
        on_ports = {a.at for a in marked.appendages}
        ports = [
            f"{a.prefix}{port}"
            for a in marked.appendages
            for port in a.spec.further
            if not a.carries.get(port) and f"{a.at}:{port}" not in on_ports
        ]
        self.ports = [name for name in ports if all(_site(m, name) >= 0 for m in self._models)]

    @property
    def _models(self) -> "tuple[mujoco.MjModel, ...]":
        return self.file.model, self.fine.model, self.twin.model

    def _placed(self, marked: EmbeddedFile, model: "mujoco.MjModel") -> _Model:
        elements = craft_elements(self.bare, model, marked.appendages)
        if len(elements["jnt"]) != self.bare.njnt:
            raise EngineError(
                f"the file has {len(elements['jnt'])} joints that are no appendage's, by its marks "
                f"{self.bare.njnt}."
            )
        return _Model(quiet_copy(model), elements["jnt"], elements["body"])

    def _seen_bodies(self, marked: EmbeddedFile) -> list[int]:
        """Numbers of the bare craft's bodies that are looked at, the base first: what is carried,
        and what turns with a drive."""
        real = craft_elements(self.bare, self.bare, ())["body"]
        self._plain = plain = [i for i in real if not self.bare.body(i).name.startswith(PROBE)]
        carried = {self.bare.body(name).id for name in moved_bodies(marked.appendages)}
        turning = {int(self.bare.jnt_bodyid[j]) for j in _hinges(marked)}
        base = base_body(self.bare, next(iter(turning)))
        return [plain.index(base), *(plain.index(i) for i in sorted(carried | turning))]

    def slew(self, joint: int, name: str, turn: Turn) -> SlewRow:
        """One slew in all models."""
        self._check_length(turn)
        trial = self._trial(joint, turn)
        fine = self._run_rk4(self.fine, joint, trial.drive, self.divided)
        other = self._run_rk4(self.file, joint, trial.drive, self.other)
        spacing = trial.drive.spacing
        longer = _parts(spacing, self.step) / _parts(spacing, self.other.step)
        parts = (
            _apart(trial.file, trial.twin),
            _apart(trial.file, fine),
            _apart(trial.own, trial.file),
        )
        numbers = [self._plain[i] for i in self.bodies]
        labels = [self.bare.body(i).name or f"body {i}" for i in numbers] + self.ports
        bodies = tuple(
            SlewBody(label, *(float(v[i]) for part in parts for v in part))
            for i, label in enumerate(labels)
        )
        is_free = int(self.bare.body_dofnum[self._plain[self.bodies[0]]]) == 6
        return SlewRow(
            joint=name,
            angle=turn.angle,
            duration=turn.duration,
            rate=turn.rate,
            integrator=self.integrator,
            timestep=self.timestep,
            bodies=bodies,
            momentum=_drift(trial.own) if is_free else None,
            momentum_rk4=_drift(trial.file) if is_free else None,
            energy=_largest(trial.own.energy - trial.file.energy) / _largest(trial.file.energy),
            step_rk4=self.step,
            error_rk4=float(np.max(_apart(other, trial.file)[0])) / abs(longer**ORDER - 1.0),
        )

    def _check_length(self, turn: Turn) -> None:
        """Refuse a slew of more steps than are made."""
        end = turn.duration + RINGING * self.period
        step = min(self.step, self.divided.step, self.timestep)
        if end / step > MOST_STEPS:
            raise EngineError(
                f"a slew of {turn.duration:.4g} s takes more than {MOST_STEPS} steps of "
                f"{step:.3g} s{self.limited}; it was not simulated."
            )

    def _trial(self, joint: int, turn: Turn) -> "_Trial":
        """The rigid twin, the file under RK4, and the file as it is."""
        end = turn.duration + RINGING * self.period
        stride = max(round(end / SAMPLES / self.timestep), 1)
        spacing = stride * self.timestep
        drive = drive_of(
            self.twin.model,
            self.twin.joints[joint],
            [self.twin.joints[j] for j in self.held],
            turn,
            spacing=spacing,
            samples=int(np.ceil(end / spacing)) + 1,
        )
        states = Run(drive.qpos, drive.qvel)
        own = self.file._replace(model=self.own)
        return _Trial(
            drive,
            self._look(self.twin, joint, states),
            self._run_rk4(self.file, joint, drive, self.reference),
            self._run(own, joint, drive, self.timestep, self.integrator),
        )

    def _run_rk4(self, placed: _Model, joint: int, drive: Drive, reference: _Reference) -> Seen:
        prepared = placed._replace(model=reference.model)
        return self._run(prepared, joint, drive, reference.step, "RK4")

    def _run(self, placed: _Model, joint: int, drive: Drive, step: float, integrator: str) -> Seen:
        """A model under the torques of a drive, seen from outside."""
        is_own = placed.model is self.own
        model = copy.copy(placed.model)
        per_sample = _parts(drive.spacing, step)
        states = run(
            model,
            [placed.joints[j] for j in self.held],
            drive,
            integrator,
            per_sample,
            # as a model that is exact in time wants it; it makes any other of second order
            mean_input=is_own and integrator != "RK4",
        )
        return self._look(placed, joint, states)

    def _look(self, placed: _Model, joint: int, states: Run) -> Seen:
        behind = int(placed.model.jnt_bodyid[placed.joints[joint]])
        bodies = [placed.bodies[i] for i in self.bodies]
        return seen(
            placed.model, states, bodies, [_site(placed.model, n) for n in self.ports], behind
        )


class _Trial(NamedTuple):
    """A drive; the rigid twin, the file under RK4 and the file at its own step, under it."""

    drive: Drive
    twin: Seen
    file: Seen
    own: Seen


def _rk4_words(reference: _Reference) -> str:
    """What keeps RK4 from a step at which no mode of an appendage does."""
    model = copy.copy(reference.model)
    model.opt.integrator, model.opt.timestep = INTEGRATORS["RK4"], 1.1 * reference.limit
    found = culprit(model, np.array(model.qpos0))
    by = f"the kv of {found.words}" if found.damps and found.kind == "servo" else found.words
    return f" (RK4 is stable up to {reference.limit:.2g} s: {by})"


def _parts(whole: float, step: float) -> int:
    """Number of equal steps, at most so long, in a time."""
    return int(np.ceil(whole / step * (1.0 - 1e-9)))


def _site(model: "mujoco.MjModel", name: str) -> int:
    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name))


def _apart(one: Seen, other: Seen) -> tuple[Array, Array]:
    """Largest differences of attitude [rad] and place [m] of every body."""
    turned = np.swapaxes(one.rotations, -1, -2) @ other.rotations
    # |R - R^T| of a rotation by a is sin(a) sqrt(8): exact where a is small, and there it counts
    skew = np.linalg.norm(turned - np.swapaxes(turned, -1, -2), axis=(-2, -1)) / np.sqrt(8.0)
    cosine = (np.trace(turned, axis1=-2, axis2=-1) - 1.0) / 2.0
    places = np.linalg.norm(one.places - other.places, axis=-1)
    return np.max(np.arctan2(skew, cosine), axis=0), np.max(places, axis=0)


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values)))


def _drift(found: Seen) -> float:
    """Change of the angular momentum, zero at first, over the largest behind the hinge."""
    return float(np.max(np.linalg.norm(found.momentum, axis=1))) / _largest(found.share)


def _warnings(rows: Sequence[SlewRow], tolerance: float | None) -> list[str]:
    """The worst slew, where an error exceeds the scene's tolerance."""
    if not rows or tolerance is None:
        return []
    out: list[str] = []
    chain = max(rows, key=lambda row: row.chain_share)
    if chain.chain_share > tolerance:
        text = (
            f"{_words(chain)}: the chains are off by {chain.chain_share:.2g} of the elastic "
            f"motion, more than the tolerance {tolerance:g}; keep more modes, or turn more slowly."
        )
        out.append(Caution("slew-chain", text))
    step = max(rows, key=lambda row: row.step_share)
    if step.step_share > tolerance:
        text = (
            f"{_words(step)}: the step of {step.integrator} at {step.timestep:g} s is off by "
            f"{step.step_share:.2g} times the elastic part of an attitude, more than the tolerance "
            f"{tolerance:g}; integrate such slews with RK4."
        )
        out.append(Caution("slew-step", text))
    return out


def _words(row: SlewRow) -> str:
    return f"{row.joint} by {np.degrees(row.angle):.3g} degrees in {row.duration:.3g} s"
