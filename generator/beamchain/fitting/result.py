"""The result of a fit: the chain, its verification through MuJoCo, and its files."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element
from scipy.spatial.transform import Rotation

from beamchain import report
from beamchain.chain.chain import Chain
from beamchain.chain.cut import Cut
from beamchain.chain.tendons import group_motion
from beamchain.engine.bench import Measured, ballast_for
from beamchain.engine.library import mujoco, rest
from beamchain.engine.linear import rigid_body
from beamchain.engine.linearise import compile_model
from beamchain.engine.mount import motion
from beamchain.errors import InputError
from beamchain.files import check_outputs, to_json, write_files
from beamchain.fitting.body import Body
from beamchain.fitting.document import appendage_tree, put_timing, scene_step
from beamchain.fitting.exact import ExactAppendage, exact_appendage
from beamchain.fitting.hub import Hub, default_hub
from beamchain.fitting.kept import Choice, Kept, LeftOut
from beamchain.fitting.look import Look, look_of
from beamchain.fitting.needs import AXES
from beamchain.fitting.options import Scene
from beamchain.fitting.spec import Spec
from beamchain.fitting.warnings import step_warnings, turn_warning
from beamchain.mjcf import write
from beamchain.ports.compare import Comparison, keeps_tolerance, spectral_norm, with_damping
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.steps.budget import linear_model
from beamchain.steps.cures import RUINED, Cure
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.large_motion import LargeMotion, large_limits
from beamchain.steps.limits import StepChoice, StepLimits, choose_step, coupled_limits, step_limits
from beamchain.steps.modal import modal_tendons, timing_marks
from beamchain.steps.poles import PoleRow, pole_rows
from beamchain.steps.retime import time_sentence
from beamchain.steps.sampled import Exact, SampledError, represents, sampled_error
from beamchain.steps.step_map import (
    WRONG,
    ShiftedPeak,
    TimeError,
    lowest_wrong,
    motion_at,
    shifted_peak,
    time_error,
)
from beamchain.steps.turn import central_inertia, turn_error
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine
from beamchain.structure.modal_data import ModalData
from beamchain.warning_codes import Caution

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Result = TypeVar("Result", bound=Any)


def with_known(result: Result, names: Sequence[str], **changes: Any) -> Result:
    """A copy of a result with other fields, which change none of the figures of these `names`:
    those that were worked out stay."""
    made = replace(result, **changes)
    for name in names:
        if name in vars(result):
            object.__setattr__(made, name, vars(result)[name])
    return made


class ModeRow(NamedTuple):
    """A kept mode: its target values, and the values read back from MuJoCo. Errors are relative."""

    port: str  #: "xy", "xz", "torsion" or "axial"
    number: int  #: from 1
    frequency_rad_s: float  #: wanted
    achieved_rad_s: float  #: read back from MuJoCo
    damping_ratio: float  #: read back
    frequency_error: float  #: of what was read back, relative to what was wanted
    participation_error: float  #: the same of the participation


@dataclass(frozen=True, eq=False)
class InSpace:
    """A fit in all six motions of the root at once, including the coupling between ports.

    Args:
        data: the imported modes, about the port, in SI; its `steps` list the changes made to them.
        why: the reason for its hinges.
        full: all imported modes.
        target: the required modes.
        achieved: read back through `mjd_transitionFD`.
        error: achieved against target; in band, against all modes.
        live: motions in which the appendage has inertia; the models hold these only.
        numbers: of the kept modes in `data`, from 1.
    """

    data: ModalData
    why: str
    full: PortModel
    target: PortModel
    achieved: PortModel
    error: Comparison
    live: tuple[int, ...]
    numbers: tuple[int, ...] = ()

    @property
    def couples(self) -> bool:
        """Whether kept modes couple ports, so that they are numbered together."""
        if not self.numbers:
            return False
        return any(len(ports) > 1 for ports in self.data.selected(self.numbers).groups)

    def in_file(self, label: str) -> int:
        """Number in the file, from 1, of the mode of a tendon: "mode7" of all that are kept,
        "mode2_xy" of those of the port."""
        number, _, port = label.removeprefix("mode").partition("_")
        own = [k for k in self.numbers if not port or self.data.belongs[k - 1] == port]
        return own[int(number) - 1]

    @property
    def kept_words(self) -> str:
        """The kept modes by their numbers in the file."""
        return report.kept_words(self)


@dataclass(frozen=True)
class Status:
    """What became of a fit."""

    ok: bool  #: everything that was asked for is met
    message: str  #: what was made, and what is missing, in sentences
    history: tuple[str, ...]  #: what was tried before


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """An appendage as a hinge chain, verified through MuJoCo.

    Args:
        spec: the specification.
        body: the appendage with every mode that is known of it, which is the reference.
        kept: which of them the chain has, and how a scene chose them.
        chain: the fitted chain.
        line: how the appendage's mass lies along x.
        target: per port, the reduced model the chain was made for.
        achieved: per port, read back through `mjd_transitionFD`.
        readback_error: per port, achieved against target: the error of the file, not of the model;
            in band, against the whole beam.
        measured: results of the test bench.
        limits: step limits on the hub of the spec, or without a hub.
        how: what holds its modes, such as "springs on the hinges".
        seconds: times to model, realise, write and verify [s].
        bandwidth: per port, of the in-band error [rad/s].
        promise: in-band error of the achieved model on the hub, in the motions of the scene;
            None without a bandwidth.
        missing: per port with fewer modes than asked for, how many it keeps, and why.
        history: what was changed of imported modes, and tried before.
        left_out: what the chain leaves out, why, and the error that this causes.
        cautions: warnings about the drop-in file; `warnings` adds those about scene.xml.
        cut: the hinge positions, if they were chosen for modal tendons.
        space: the fit in all six motions at once, if the modes were imported.
        at_step: whether it is judged at its step; False: by itself, for a spacecraft with its own.
        cure: what was tried and keeps the tolerance, where the fit misses it.

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> found = bc.fit(spec, modes={"xy": 2, "xz": 0})
        >>> found.status.ok
        True
        >>> found.modes[0]._fields[:3]
        ('port', 'number', 'frequency_rad_s')
    """

    spec: Spec
    body: Body
    kept: Kept
    chain: Chain
    line: MassLine
    target: dict[str, PortModel]
    achieved: dict[str, PortModel]
    readback_error: dict[str, Comparison]
    measured: Measured
    limits: StepLimits
    how: str
    seconds: dict[str, float]
    bandwidth: dict[str, float]
    promise: float | None = None
    missing: tuple[str, ...] = ()
    history: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    cautions: tuple[str, ...] = ()
    cut: Cut | None = None
    space: InSpace | None = None
    at_step: bool = False
    cure: Cure | None = None

    def __repr__(self) -> str:
        return report.fit_text(self)

    def _repr_html_(self) -> str:
        return report.fit_html(self)

    @property
    def full(self) -> dict[str, PortModel]:
        """Per port, all modes that are known of it."""
        ports = self.body.ports if self.body.data is None else self.target
        return {port: self.body.view(port) for port in ports}

    @property
    def kept_for(self) -> str:
        """The target whose modes are kept: "clamped", "free" or "hub"."""
        return self.kept.target

    @property
    def choice(self) -> Choice | None:
        """How the modes were chosen for the scene; None where the spec states them."""
        return self.kept.choice

    @cached_property
    def _exact(self) -> ExactAppendage:
        """The exact appendage in six motions."""
        return exact_appendage(self.body, self.kept, self.measured.rigid_mass)

    @property
    def beam(self) -> Beam | None:
        """The beam that was fitted; None for imported modes and a liquid."""
        return self.spec.beam if self.spec.is_beam else None

    @property
    def tendon_damped(self) -> bool:
        """Whether its modes are damped by tendons, whose damping Euler treats explicitly."""
        return any(tendon.damping > 0.0 for tendon in self.chain.tendons)

    @property
    def tendon_sprung(self) -> bool:
        """Whether its modes have their stiffness on tendons."""
        return any(tendon.stiffness > 0.0 for tendon in self.chain.tendons)

    @property
    def hub(self) -> Hub:
        """The hub of scene.xml: that of the spec, or one of ten times the appendage's mass."""
        return self.spec.root.hub or default_hub(self.line)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the files, as shown by `beamchain fit` and in the report."""
        scene = self.spec.scene
        if not self.achieved:
            return self.cautions
        if scene is None:
            return (*self.cautions, *self._time_warnings) if self.spec.exact_step else self.cautions
        out = (*self.cautions, *turn_warning(self.turn_error, scene, scene.integrator, self.step))
        if self.spec.exact_step and self.tendon_sprung and scene.integrator in SCHEMES:
            return (*out, *self._time_warnings)
        return (*out, *step_warnings(scene, self.step, self.scene_limits, self.steps))

    @property
    def step(self) -> float:
        """Step of scene.xml [s]."""
        return scene_step(self.spec, self.limits)

    @property
    def _time_warnings(self) -> list[str]:
        """What the stated step does that is not exact: poles that are off,
        modes that are slowed."""
        off, (written, plain) = self.time_error, self._scenes
        # RK4 is not made exact
        if off is None or off.exact or (off.integrator == "RK4" and off.error < WRONG):
            return []
        first = lowest_wrong(written, plain, {"rest": np.array(written.qpos0)})
        more = (
            ""
            if first is None
            else f" From {first.frequency:.4g} rad/s on, poles are off by more than 1e-3."
        )
        return [Caution("time-error", f"scene.xml: {time_sentence(off)}{more}")]

    @property
    def scene_limits(self) -> StepLimits:
        """Step limits on the hub of scene.xml."""
        if self.spec.root.hub is not None:
            return self.limits
        model, live = self.measured.motion, self.measured.live
        hub = self.hub.mass_matrix()[np.ix_(live, live)]
        return coupled_limits(model, hub, tendon=self.tendon_damped, sprung=self.tendon_sprung)

    @cached_property
    def large_motion(self) -> tuple[dict[str, LargeMotion], tuple[str, ...]]:
        """Large-motion limits per bending plane, and the reasons if one could not be computed."""
        if not self.spec.is_beam:
            why = (
                "large motion is compared with a chain of 60 links of the beam, which imported "
                "modes do not have."
            )
            if self.spec.slosh is not None:
                why = (
                    "a liquid is a pendulum up to angles of some 10 degrees between its surface "
                    "and the bottom; beyond, it breaks, which no pendulum does."
                )
            return {}, (Caution("large-motion-unknown", why),)
        modes = {port: target.modes for port, target in self.target.items()}
        hub = self.spec.root.hub
        return large_limits(self.chain, self.spec.beam, modes, hub.offset[0] if hub else 0.0)

    @cached_property
    def turn_error(self) -> float | None:
        """Relative error of the rigid craft's rates after one radian of free rotation;
        None without rates or hub."""
        scene, hub = self.spec.scene, self.hub_mass
        if scene is None or scene.rates is None or hub is None:
            return None
        return turn_error(
            central_inertia(hub + self.measured.rigid_mass),
            scene.rates,
            self.step,
            scene.integrator,
        )

    @cached_property
    def hub_mass(self) -> Array | None:
        """`(6, 6)` mass matrix of the spec's hub about the root; None without one."""
        return None if self.spec.root.hub is None else self.spec.root.hub.mass_matrix()

    @property
    def modes(self) -> list[ModeRow]:
        """The kept modes, port by port, slowest first;
        `pandas.DataFrame(fit.modes)` makes a table of them."""
        rows: list[ModeRow] = []
        for port, error in self.readback_error.items():
            target = self.target[port].frequencies
            achieved = self.achieved[port]
            for k in np.argsort(error.matches[:, 1]):
                i, j = (int(index) for index in error.matches[k])
                off = float(error.frequency_errors[k]), float(error.participation_errors[k])
                found = float(achieved.frequencies[i]), float(achieved.damping[i])
                rows.append(ModeRow(port, j + 1, float(target[j]), *found, *off))
        return rows

    @property
    def worst_port(self) -> str | None:
        """The port with the largest in-band error; None where the appendage is rigid."""
        in_band = {p: e.accelerance_in_band or 0.0 for p, e in self.readback_error.items()}
        return max(in_band, key=lambda port: in_band[port], default=None)

    @property
    def in_band_error(self) -> float | None:
        """In-band error of the model for what the scene requires; without a scene,
        that of the worst port by itself."""
        port = self.worst_port
        return (
            self.promise
            if self.promise is not None or port is None
            else self.readback_error[port].accelerance_in_band
        )

    @property
    def headline(self) -> str:
        """The model's error in a sentence, and the tip's if that is above 1 %."""
        return report.fit_headline(self)

    @property
    def tip_error(self) -> dict[str, Array]:
        """Per port `(n,)`: relative error of the tip displacement (or angle) in each kept mode, and
        behind them in the static shapes of further points."""
        out: dict[str, Array] = {}
        for port, target in self.target.items():
            ours = self.chain.port(port)
            if ours.tip is not None and target.tip is not None:
                k = min(ours.modes, target.modes)
                out[port] = ours.tip[:k, 0] / target.tip[:k, 0] - 1.0
        return out

    @cached_property
    def steps(self) -> tuple[StepChoice, ...]:
        """Integrators, each with its largest step within the tolerance, cheapest first;
        empty without a bandwidth.

        The one step that a file was made for, where it has timing.
        """
        scene = self.spec.scene
        if scene is None or scene.bandwidth is None or not self.achieved:
            return ()
        # the file is made for one step
        if self.time_error is not None and any(timing_marks(self._scenes[0])):
            return (StepChoice(scene.integrator, self.spec.exact_step, "the file's own", 1.0),)
        model, live = self.measured.motion, self.measured.live
        hub = self.hub_mass[np.ix_(live, live)] if self.hub_mass is not None else model.rigid_mass
        keep = [i for i, motion in enumerate(live) if motion in {AXES[axis] for axis in scene.axes}]
        if not keep:  # nothing that is asked for moves the appendage
            return ()
        return choose_step(
            model,
            hub,
            keep,
            scene.bandwidth,
            scene.tolerance,
            tendon=self.tendon_damped,
            sprung=self.tendon_sprung,
            undamped=self.spec.undamped_ratio,
        )

    @cached_property
    def look(self) -> Look:
        """The drawn surfaces, and how far they miss each kept mode; no surfaces where
        `scene.visuals` is "boxes" or false, shapes touch, or modes were imported."""
        return look_of(self)

    def appendage(self, *, timed: bool = True) -> Element:
        """The drop-in MJCF as an lxml tree.

        Args:
            timed: exact in time for the spec's step, if it states one; False: without timing.
        """
        tree = etree.fromstring(self._untimed)
        if timed:
            put_timing(tree, self.spec, sprung=self.tendon_sprung, form=2)
        return tree

    @cached_property
    def _untimed(self) -> bytes:
        """The document without timing; text, since a `Fit` has to be pickled."""
        tree = appendage_tree(self.spec, self.chain, self.look.skins)
        tips = tree.xpath(f"//site[@name='{self.spec.name}_tip']")
        if tips and (tip := report.tip_sentence(self)) is not None:
            tips[0].addprevious(etree.Comment(f" {tip} "))
        return etree.tostring(tree)

    @cached_property
    def _scenes(self) -> "tuple[mujoco.MjModel, mujoco.MjModel]":
        """scene.xml, compiled, as it is written and with timing taken out."""
        return compile_model(self.scene_mjcf()), compile_model(write.document_text(self._scene()))

    @cached_property
    def time(self) -> list[PoleRow]:
        """Modes of scene.xml without timing, and their poles under its integrator at its step."""
        return pole_rows(*self._scenes) if self.achieved else []

    @cached_property
    def time_error(self) -> TimeError | None:
        """The largest error of a coupled pole of scene.xml at its step; None without a stated step.

        `error` is `|z - exp(s h)| / |exp(s h) - 1|` of the pole z of a step of MuJoCo, s the
        damped pole of the same file with timing taken out; up to the scene's bandwidth, or the
        last kept coupled mode.
        """
        if not self.spec.exact_step or not self.achieved:
            return None
        written, plain = self._scenes
        band = None if self.spec.scene is None else self.spec.scene.bandwidth
        return time_error(written, plain, {"rest": np.array(plain.qpos0)}, band)

    @property
    def sampled_error(self) -> float | None:
        """In-band error of the hub's positions at the samples, per wrench held over each step;
        None without a stated step. Without a bandwidth of the scene, in motions of the ports that
        have modes.

        scene.xml as MuJoCo steps it (inputs through `HeldInput`; RK4: as they are),
        against the exact appendage on its hub.
        """
        return None if self._sampled is None else self._sampled.error

    @cached_property
    def _sampled(self) -> SampledError | None:
        """The same with the frequency at which it is largest."""
        if not self.spec.exact_step or not self.achieved:
            return None
        scene = self.spec.scene
        band = (scene.bandwidth if scene else None) or min(self.bandwidth.values())
        model = self._scenes[0]
        hub = self.hub.mass_matrix()
        whole = self._exact.model
        if scene is None or scene.bandwidth is None:  # as `in_band_error`: ports with modes
            moved = np.any(group_motion(list(self.bandwidth)), axis=1)
            keep = np.flatnonzero(moved).tolist()
        else:
            keep = sorted({AXES[axis] for axis in scene.axes})
        exact, compared = (
            rigid_body(hub).with_appendages([one], [np.eye(6)]).picked(keep, keep)
            for one in (whole, with_damping(whole, self.spec.undamped_ratio))
        )
        s = np.sqrt(np.diag(hub + whole.rigid_mass))[keep]
        rigid = np.linalg.inv(hub + whole.rigid_mass)[np.ix_(keep, keep)] * np.outer(s, s)
        data = rest(model)
        root = int(model.body(f"{self.spec.name}_link1").id)
        rows = motion(model, data, root, data.xpos[root], data.xmat[root].reshape(3, 3))[keep]
        return sampled_error(
            Exact(exact, compared, band, own=6),
            motion_at(model),
            rows,
            scale=np.outer(s, s),
            frozen=spectral_norm(np.asarray(rigid, dtype=np.float64)),
        )

    @property
    def cause(self) -> ShiftedPeak | None:
        """The resonance whose shift by the stated step makes the error, under the name of the
        tendon that it strains most; None where the tolerance is met, or it is not the step."""
        worst = self._sampled
        if self.met is not False or worst is None or not np.isfinite(worst.error):
            return None
        plain = self._scenes[1]
        timed, still = motion_at(self._scenes[0]), motion_at(plain)
        peak = shifted_peak(timed, still, worst.frequency, self.spec.undamped_ratio)
        if peak is None or not peak.explains(worst.error, self.in_band_error or 0.0):
            return None
        modal = modal_tendons(plain)
        if not modal.names:
            return peak
        nearest = int(np.argmin(np.abs(np.sqrt(np.abs(still.squares)) - peak.frequency)))
        shape = still.shapes[:, nearest]
        energy = modal.stiffness * (modal.rows @ shape) ** 2
        return replace(peak, mode=modal.names[int(np.argmax(energy))])

    @property
    def met(self) -> bool | None:
        """Whether 1.01 times the error is within the scene's tolerance; None without a bandwidth.

        The error is `sampled_error` where a step is stated (a `scene.timestep`
        that was typed), and `in_band_error` otherwise; both where the specification has no hub,
        since `sampled_error` is that of one hub. A step that does not represent the bandwidth
        (beyond 2.6 rad per step) does not meet it.
        """
        scene = self.spec.scene
        if scene is None or scene.bandwidth is None or self.decisive is None:
            return None
        return keeps_tolerance(self.decisive, scene.tolerance)

    @property
    def decisive(self) -> float | None:
        """The error that a tolerance is held against, infinite where the step does not represent
        the bandwidth; without a bandwidth `sampled_error`."""
        scene = self.spec.scene
        if scene is None or scene.bandwidth is None:
            return self.sampled_error
        if not represents(self.spec.exact_step, scene.bandwidth):
            return float("inf")
        one_hub = self.spec.root.hub is not None and self.sampled_error is not None
        errors = [self.sampled_error] if one_hub else [self.sampled_error, self.in_band_error]
        return max((error for error in errors if error is not None), default=None)

    @property
    def ruined(self) -> bool:
        """Whether the stated step makes an error above 0.1 where no tolerance is stated."""
        return self.met is None and (self.sampled_error or 0.0) > RUINED

    @property
    def missed(self) -> bool:
        """Whether it misses the tolerance, or its step ruins it, where it is judged at its step."""
        return self.at_step and (self.met is False or self.ruined)

    @cached_property
    def status(self) -> Status:
        """Whether everything that was asked for is met, in sentences what was made and what is
        missing, and what was tried before."""
        ok = not self.missing
        if self.promise is not None and self.spec.scene is not None:
            # the promise is what a scene asks for, however it is kept
            ok = (ok or self.spec.chooses) and keeps_tolerance(
                self.promise, self.spec.scene.tolerance
            )
        return Status(ok and not self.missed, report.fit_message(self), self.history)

    @cached_property
    def written_limits(self) -> StepLimits:
        """Step limits of the files as they are written: of scene.xml, where they have timing;
        else `limits`."""
        timed = self.spec.exact_step and self.achieved and self._scenes[0].ntendon
        return (
            step_limits(linear_model(self._scenes[0]))
            if timed and any(timing_marks(self._scenes[0]))
            else self.limits
        )

    def to_mjcf(self) -> str:
        """The drop-in MJCF file as text; it begins with what it is, what it reproduces and how to
        check it."""
        root = self.appendage()
        first = next(root.iterchildren("*"))  # behind the words of its timing
        for line in report.file_lines(self):
            first.addprevious(etree.Comment(f" {line.replace('--', '- -')} "))
        return write.document_text(root)

    def scene_mjcf(self) -> str:
        """A free-flying hub with the appendage on it, as text; default hub:
        ten times the appendage's mass."""
        root = self._scene()
        put_timing(root, self.spec, sprung=self.tendon_sprung, form=4)
        return write.document_text(root)

    def _scene(self) -> Element:
        """The same without timing."""
        scene = self.spec.scene or Scene()
        hub = self.hub
        # the hub is given in the appendage's axes; in the scene its axes are those of the place
        turn = Rotation.from_quat(self.spec.turn, scalar_first=True).as_matrix()
        root = write.scene_document(
            self.appendage(timed=False),
            self.spec.name,
            mass=hub.mass,
            inertia=turn @ hub.inertia_matrix() @ turn.T,
            offset=turn @ hub.offset,
            timestep=self.step,
            integrator=scene.integrator,
            contacts=scene.contacts,
        )
        if self.spec.slosh is not None:
            mass = hub.mass + float(self.chain.mass)
            write.add_burn(root, mass * self.spec.slosh.acceleration, turn[:, 0])
        return root

    def bench_mjcf(self) -> str:
        """The appendage on the test bench: its root free in every kept port, as text."""
        ports = [port for port in PORTS if port in self.achieved]
        return write.document_text(
            write.bench_document(self.appendage(timed=False), ports, 0.01, ballast_for(self.chain))
        )

    def attach(self, spec: "mujoco.MjSpec", site: str) -> None:
        """Attach the appendage; its names get no prefix.

        Args:
            spec: the spacecraft, an `mujoco.MjSpec`; changed in place.
            site: name of one of its sites, whose x axis points outwards (of a tank, the axis that
                `slosh.axis` names).

        Raises:
            InputError: `spec` is not an `MjSpec`, has no such site, or already has the appendage.
        """
        if not isinstance(spec, mujoco.MjSpec):
            raise InputError(
                f"attach needs an mujoco.MjSpec, not a {type(spec).__name__}: "
                "mujoco.MjSpec.from_file(path), attach, then compile(); or bc.embed for a file."
            )
        if spec.body(f"{self.spec.name}_link1") is not None:
            raise InputError(
                f"the model already has an appendage {self.spec.name!r}; fit this one under "
                "another name: name=..."
            )
        place = spec.site(site)
        if place is None:
            known = ", ".join(s.name for s in spec.sites if s.name) or "none"
            raise InputError(f"site {site!r} is not in the model; its sites are: {known}.")
        # MuJoCo warns of an empty prefix: take the name off every element,
        # and have MuJoCo put it back
        prefix = f"{self.spec.name}_"
        child = mujoco.MjSpec.from_string(self.to_mjcf().replace(f'"{prefix}', '"'))
        spec.attach(child, site=place, prefix=prefix)

    def plot(self, ax: "Axes | None" = None, port: str | None = None) -> "Axes":
        """Plot the accelerance of a port: beam, and chain read back from MuJoCo.
        Returns the axes; shows nothing.

        Args:
            ax: axes to draw into; default: a new figure.
            port: default: the first kept one.
        """
        return report.plot_accelerance(self, ax=ax, port=port)

    def as_dict(self) -> dict[str, Any]:
        """The content of fit.json."""
        return report.fit_record(self)

    def write(self, folder: str | Path, *, force: bool = False) -> list[Path]:
        """Write appendage.xml, scene.xml, pictures,
        report.html and fit.json (last) into `folder`; all or none.

        Raises:
            OutputError: a file exists and `force` is False, or the folder cannot be written.
        """
        folder = Path(folder)
        # before the page, which takes longest
        first = ("appendage.xml", "scene.xml", "report.html", "fit.json")
        check_outputs([folder / name for name in first], force=force)
        page, pictures = report.fit_report(self)
        files: dict[Path, str | bytes] = {
            folder / "appendage.xml": self.to_mjcf(),
            folder / "scene.xml": self.scene_mjcf(),
            **{folder / name: content for name, content in pictures.items()},
            folder / "report.html": page,
            folder / "fit.json": to_json(self.as_dict()),
        }
        write_files(files, force=force)
        return list(files)


def exact_of(fit: Fit) -> ExactAppendage:
    """The exact appendage of a fit in six motions, worked out once."""
    return fit._exact
