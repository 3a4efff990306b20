"""A spacecraft with its appendages: the result of `embed`, and its error."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from beamchain import report
from beamchain.checks import finite_array, one_of, path_of, true_or_false
from beamchain.craft.appendage import Appendage, carried, craft_elements
from beamchain.craft.assembly import Assembly, assembly_at_rest, modes_at_pose
from beamchain.craft.coupled_modes import Mode, slow_modes
from beamchain.craft.cures import changes_of, models_at, more_modes
from beamchain.craft.documents import assemble, compile_document
from beamchain.craft.error import (
    CraftError,
    Pose,
    acting,
    counterpart,
    craft_error,
    craft_poses,
)
from beamchain.craft.histories import Recovery
from beamchain.craft.promise import MOST_MODES, JointRequest, joint_request, kept_band
from beamchain.craft.recording import Recorder
from beamchain.craft.recovery import recover
from beamchain.craft.sampled import craft_sampled_error
from beamchain.craft.timing import craft_time_error, is_worth_timing
from beamchain.engine.bench import Composite, composite
from beamchain.engine.library import mujoco, one_thread, rest
from beamchain.engine.linear import linear_at
from beamchain.engine.linearise import NUMBERS
from beamchain.engine.operating_point import (
    Positions,
    base_body,
    poses,
    poses_between,
    quiet_copy,
    rest_point,
)
from beamchain.errors import BeamchainError, InputError
from beamchain.files import check_name, write_files
from beamchain.mjcf.craft import Craft
from beamchain.ports.compare import keeps_tolerance
from beamchain.ports.motions import Array, first_moment
from beamchain.steps.cures import RUINED, Cure, Names, Setting, find_cure
from beamchain.steps.retime import without_timing
from beamchain.steps.sampled import SampledError, represents
from beamchain.steps.step_map import ShiftedPeak, TimeError, at_step_of, motion_at, shifted_peak
from beamchain.structure.recovery_rows import RecoveryRows

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# of the way from one pose to the next, where timing is read back between them: it is chosen at
# halves, thirds, quarters, ... of the way
BETWEEN = 0.3
IN_FILE = Names(
    'write integrator="{}" in the <option> of the spacecraft',
    'write timestep="{}" in the <option> of the spacecraft',
    "leave out --no-retime (retime=False)",
)
# cached figures of the motion, whatever is told beside it
OF_MOTION = ("_exact_poses", "sampled_poses")
CENTRED = 1e-12  # of the largest coordinate of a mass centre: rounding


@dataclass(frozen=True, eq=False, repr=False)
class Embedded:
    """A spacecraft with its appendages.

    Args:
        appendages: in the order given.
        craft: the bare spacecraft, compiled.
        model: with its appendages, compiled.
        warnings: conditions that would falsify the motion, and decisions that were taken.
        document: the bare spacecraft's document; None for an `MjSpec`.
        steps: modes that were added to meet the tolerance of the whole craft, one line each.
        source: file of the spacecraft, if it was given as one.
        inputs: that file and all others that were read, which `write` does not replace.
        loaded: whether it is proved under its own load, as the argument of `embed` says.
        call: the call that made it, without the appendages by place; None where there was none, or
            it changed what it was given.
        given: the appendages by place of that call.
        retime: whether timing was asked for, as the argument of `embed` says.
        joints: whether timing may change the spacecraft's own joints (`--retime-joints`).
        most: number of modes that an appendage may keep where modes are added (`max_modes`).
        names: how the user changes integrator, step and timing, in the words of a cure.

    Example:
        >>> import beamchain as bc
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> result = bc.embed(craft, {"mount": spec})
        >>> [round(mode.exact, 3) for mode in result.assembly.modes[:2]]
        [3.219, 3.219]
    """

    appendages: tuple[Appendage, ...]
    craft: "mujoco.MjModel"
    model: "mujoco.MjModel"
    warnings: tuple[str, ...]
    document: Craft | None = None
    steps: tuple[str, ...] = ()
    _layout: dict[str, Any] = field(default_factory=dict)
    source: Path | None = None
    inputs: tuple[Path, ...] = ()
    loaded: bool = False
    call: "Callable[..., Embedded] | None" = None
    given: Mapping[str, Any] = field(default_factory=dict)
    retime: bool | None = None
    joints: bool = False
    most: int = MOST_MODES
    names: Names = IN_FILE

    def __repr__(self) -> str:
        return report.embedded_text(self)

    def _repr_html_(self) -> str:
        return report.embedded_html(self)

    @cached_property
    def _asked(self) -> JointRequest:
        """What the scenes of all appendages ask of the spacecraft together."""
        return joint_request([a.spec for a in self.appendages])

    @cached_property
    @one_thread()
    def assembly(self) -> Assembly:
        """Coupled modes and the base body's accelerance at rest, exact and through MuJoCo:
        the promise's view of the rest pose."""
        exact = carried(self.model, self.appendages)
        band = self._asked.band
        pose = self._exact_poses["rest"][0] if self.loaded else None
        return assembly_at_rest(
            self.craft, self.untimed, exact, self.promise, band, self._own, pose
        )

    @cached_property
    def _own(self) -> list[int]:
        """The bare craft's degrees of freedom in the model, in the craft's order."""
        return craft_elements(self.craft, self.model, self.appendages)["dof"]

    @cached_property
    @one_thread()
    def promise(self) -> CraftError:
        """Error of the coupled spacecraft against exact appendages, pose by pose,
        up to the scenes' largest bandwidth.

        If no scene states a bandwidth: in all motions,
        up to where every appendage keeps all modes of its ports. Where it is `loaded`: about the
        pose to which the load bends the appendages, with the stiffness that it adds.
        """
        return craft_error(self.craft, self.untimed, self._exact_poses)

    def bare_qpos(self, qpos: Array) -> Array:
        """Positions of the bare craft in a pose of the model.

        Args:
            qpos: `(nq,)` positions of the model.
        """
        joints = craft_elements(self.craft, self.model, self.appendages)["jnt"]
        parts = np.split(qpos, self.model.jnt_qposadr[1:])
        return np.concatenate([np.zeros(0), *(parts[j] for j in joints)])

    @cached_property
    def _exact_poses(self) -> dict[str, list[Pose]]:
        """Every pose of the bare craft with its exact answer."""
        return self._exact_at(poses, loaded=self.loaded)

    def _exact_at(self, positions: Positions, *, loaded: bool) -> dict[str, list[Pose]]:
        want = self._asked
        exact = carried(self.model, self.appendages)
        band = want.band or kept_band(self.appendages)
        return craft_poses(
            self.craft, exact, band, want.motions, self._own, positions, loaded=loaded
        )

    @one_thread()
    def error_at(self, qpos: Array) -> float:
        """`craft_error` in one pose of the model, without a load: largest relative error of the
        base body's motion up to `band`, against exact appendages.

        Args:
            qpos: `(nq,)` positions of the model.

        Raises:
            InputError: the positions are not as many finite numbers.

        Example:
            >>> import beamchain as bc
            >>> from importlib.resources import files
            >>> shipped = files("beamchain") / "examples"
            >>> craft = bc.embed(shipped / "craft.xml", {"mount": shipped / "array.toml"})
            >>> bool(abs(craft.error_at(craft.model.qpos0) / craft.craft_error - 1.0) < 1e-6)
            True
        """
        qpos = finite_array("qpos", qpos, (self.model.nq,))
        bare = self.bare_qpos(qpos)
        exact = self._exact_at(lambda _: {"pose": bare}, loaded=False)
        return craft_error(self.craft, self.untimed, exact, {"pose": qpos}).error

    @cached_property
    def time_error(self) -> TimeError:
        """The largest error of a coupled pole at the model's own step, worst of all poses.

        `error` is `|z - exp(s h)| / |exp(s h) - 1|` of the pole z of a step of MuJoCo, s the damped
        pole of the same file with timing taken out; up to the scenes' largest bandwidth, or the
        last kept coupled mode.
        """
        return craft_time_error(self.model, self.untimed, self.appendages, self._asked.band)

    @cached_property
    def sampled_poses(self) -> dict[str, SampledError]:
        """The error of the response at the model's own step, pose by pose,
        with the frequency at which it is largest.

        Where appendages carry bodies, their timing is chosen for some poses: then between the
        poses as well.
        """
        timed = any(a.timed is not None for a in self.appendages)
        return self._sampled(self.model, timed=timed)

    def _sampled(self, model: "mujoco.MjModel", *, timed: bool) -> dict[str, SampledError]:
        """The same of the model at any step."""
        errors = craft_sampled_error(self.craft, model, self._exact_poses)
        if timed and any(a.loads for a in self.appendages):
            between = partial(poses_between, share=BETWEEN)
            exact = self._exact_at(between, loaded=False)
            if exact:
                errors |= craft_sampled_error(self.craft, model, exact, between)
        return errors

    @property
    def sampled_error(self) -> float:
        """In-band error of the base body's positions at the samples,
        per wrench held over each step, worst of all poses.

        The file as MuJoCo steps it (inputs through `HeldInput`; RK4: as they are),
        against the exact spacecraft.
        """
        return max(found.error for found in self.sampled_poses.values())

    @one_thread()
    def modes_at(self, key: str, *, beyond: bool = False) -> tuple[Mode, ...]:
        """Coupled modes in the band at the keyframe `key` ("rest": the rest pose),
        exact and from MuJoCo.

        Args:
            key: name of the keyframe.
            beyond: whether to list those up to the highest mode kept, beyond the band.

        Raises:
            InputError: the spacecraft has no such keyframe.
        """
        exact = carried(self.model, self.appendages)
        pose = self._loaded_pose(key)
        craft, model, band = self.craft, self.untimed, self.band
        beyond = true_or_false("beyond", beyond)
        return modes_at_pose(craft, model, exact, band, key, self._own, pose, beyond=beyond)

    @one_thread()
    def shapes_at(self, key: str) -> tuple[Array, Array]:
        """Undamped coupled modes of the model without timing, as MuJoCo has them: frequencies
        `(n,)` ascending [rad/s] and mass-normalised shapes `(nv, n)`.

        Args:
            key: of a keyframe, or "rest": the rest pose; under the load where it is `loaded`.

        Raises:
            InputError: the spacecraft has no such keyframe.
        """
        model = quiet_copy(self.untimed)
        known = poses(model)
        one_of("key", key, known)
        pose = self._loaded_pose(key)
        if pose is None:
            linear = linear_at(rest_point(model, known[key]))
        else:
            body = counterpart(self.craft, model, pose.body)
            linear = pose.compiled(model, known[key], body)
        return slow_modes(linear, self.band)

    def _loaded_pose(self, key: str) -> Pose | None:
        """The exact spacecraft at a keyframe under its load; None where the proof is without."""
        return self._exact_poses.get(key, [None])[0] if self.loaded else None

    @cached_property
    def composite(self) -> Composite:
        """Mass, centre of mass and inertia of the base body with all that it carries,
        in the rest pose."""
        body = base_body(self.craft, self.appendages[0].mount.body)
        return composite(self.model, counterpart(self.craft, self.model, body))

    @cached_property
    def mass_centres(self) -> dict[str, Array]:
        """Mass centre of every appendage by its place, from the origin of the base body, in its
        axes, at rest [m]: where the appendage stands."""
        data = rest(self.craft)
        out: dict[str, Array] = {}
        for a in self.appendages:
            base = base_body(self.craft, a.mount.body)
            mass = a.fit.measured.rigid_mass
            place = a.mount.origin + a.mount.axes @ first_moment(mass) / mass[0, 0]
            centre = (place - data.xpos[base]) @ data.xmat[base].reshape(3, 3)
            centre[np.abs(centre) < CENTRED * np.abs(centre).max()] = 0.0
            out[a.at] = centre
        return out

    @property
    def craft_error(self) -> float:
        """In-band error of the base body's motion, worst of all poses."""
        return self.promise.error

    @property
    def band(self) -> float:
        """Upper end of the band of `craft_error` [rad/s]."""
        return self.promise.band

    @property
    def tolerance(self) -> float | None:
        """Smallest tolerance of the scenes that state a bandwidth; None if there is none."""
        return self._asked.tolerance

    @property
    def met(self) -> bool | None:
        """Whether 1.01 times the spacecraft's error is within the tolerance;
        None without a tolerance.

        The error is `sampled_error`, or `craft_error` where the appendages are rigid; where it is
        `loaded` the larger one. A step that does not represent the band (beyond 2.6 rad per step)
        does not meet it.
        Nor does what a load lets grow, the exact spacecraft or the file.
        """
        if self.promise.growth:
            return False
        if self.tolerance is None:
            return None
        whole = not self.by_step or represents(float(self.model.opt.timestep), self.band)
        return whole and keeps_tolerance(self.decisive, self.tolerance)

    @property
    def decisive(self) -> float:
        """The error that a tolerance is held against."""
        if not self.by_step:
            return self.craft_error
        # that at the step is without the load
        return max(self.sampled_error, self.craft_error if self.loaded else 0.0)

    @property
    def by_step(self) -> bool:
        """Whether the error that counts is that of the file as MuJoCo steps it."""
        return not any(a.rigid for a in self.appendages)

    @property
    def ruined(self) -> bool:
        """Whether the step makes an error above 0.1 where no tolerance is stated."""
        return self.tolerance is None and self.by_step and self.sampled_error > RUINED

    @property
    def missed(self) -> bool:
        """Whether it misses the tolerance, or its step ruins it, and no load lets it grow, which
        nothing that is tried mends."""
        return not self.promise.growth and (self.met is False or self.ruined)

    @cached_property
    @one_thread()
    def cure(self) -> Cure | None:
        """The cheapest change of integrator, step, timing or modes that was tried and keeps the
        tolerance, or without one an error at the step below 0.1; None where it is kept, or nothing
        that was tried helps."""
        if not self.missed:
            return None
        option = self.model.opt
        step = float(option.timestep) if self.by_step else 0.0
        now = Setting(NUMBERS[int(option.integrator)], step, self.retime)
        places = [] if self.call is None else [a.at for a in self.appendages if a.at in self.given]
        wished = changes_of(self.appendages, places, self._exact_poses) if places else {}
        more = more_modes(self.appendages, self.most) if places else {}
        wished |= {words: {} for words in more}
        tried: dict[str, Embedded | None] = {"": self}

        def changed(change: str) -> "Embedded | None":
            if change not in tried:
                assert self.call is not None
                try:
                    allowed = {"max_modes": more[change]} if change in more else {}
                    tried[change] = self.call({**self.given, **wished[change]}, **allowed)
                except BeamchainError:  # there is no such chain
                    tried[change] = None
            return tried[change]

        def error(setting: Setting) -> float:
            one = changed(setting.change)
            return float("inf") if one is None else one._error_at(setting)

        return find_cure(now, error, wished, self.names, self.tolerance)

    def _error_at(self, setting: Setting) -> float:
        """What is held against the tolerance at another step, integrator or timing."""
        if setting.timestep == 0.0:
            return self.craft_error
        if self.tolerance is not None and not represents(setting.timestep, self.band):
            return float("inf")
        plain, timed = models_at(
            setting, self.untimed, self.appendages, self._compiled, joints=self.joints
        )
        error = max(found.error for found in self._sampled(plain, timed=False).values())
        if timed is not None:
            with_it = max(found.error for found in self._sampled(timed, timed=True).values())
            if setting.timing or is_worth_timing(error, with_it, self.tolerance):
                error = with_it
        return max(error, self.craft_error) if self.loaded else error

    def _compiled(self, appendages: tuple[Appendage, ...]) -> "mujoco.MjModel | None":
        """The spacecraft with other appendages; None where it has no document."""
        if self.document is None:
            return None
        return compile_document(self.document, appendages, self._layout)

    @property
    def cause(self) -> ShiftedPeak | None:
        """The resonance whose shift by the step makes the error, and what moves in it; None where
        the tolerance is met, or it is not the step."""
        if self.met is not False or not self.by_step:
            return None
        pose, worst = max(self.sampled_poses.items(), key=lambda item: item[1].error)
        if not np.isfinite(worst.error):
            return None
        places = poses(self.model) | poses_between(self.model, BETWEEN)
        plain = at_step_of(self.untimed, self.model)
        timed, still = (motion_at(quiet_copy(one), places[pose]) for one in (self.model, plain))
        undamped = min(a.spec.undamped_ratio for a in self.appendages)
        peak = shifted_peak(timed, still, worst.frequency, undamped)
        if peak is None or not peak.explains(worst.error, self.craft_error):
            return None
        modes = self.modes_at(pose) if pose in poses(self.model) else ()
        near = min(modes, key=lambda m: abs((m.mujoco or np.inf) - peak.frequency), default=None)
        return peak if near is None or near.mujoco is None else replace(peak, mode=near.words)

    @property
    def headline(self) -> str:
        """The craft's error in a sentence, and the resonance that makes it, if the step does."""
        return report.embedded_headline(self)

    @property
    def loads(self) -> dict[str, list[str]]:
        """What acts at each pose, in words; empty where nothing does, or it is not asked for."""
        return {
            name: [pose.loading.words for pose in several if pose.loading is not None]
            for name, several in (self._exact_poses.items() if self.loaded else ())
        }

    @property
    def loads_left_out(self) -> dict[str, tuple[str, float]]:
        """Keyframes that push the spacecraft and are proved without it: what acts, in words, and
        the in-band change that it makes to the base body's motion in the file."""
        out: dict[str, tuple[str, float]] = {}
        if self.loaded or not (np.any(self.craft.key_ctrl) or np.any(self.craft.key_act)):
            return out
        craft = quiet_copy(self.craft)  # its gravity has a warning of its own
        for (name, base), loading in acting(craft, carried(None, self.appendages)).items():
            pose = next(each for each in self._exact_poses[name] if each.body == base)
            body = counterpart(self.craft, self.untimed, base)
            model = quiet_copy(self.untimed)
            change = pose.changed_by(loading, model, poses(model)[name], body)
            if change > out.get(name, ("", -1.0))[1]:
                out[name] = loading.words, change
        return out

    @property
    def growth(self) -> dict[str, dict[str, float]]:
        """Rates at which the exact spacecraft and the file grow by themselves [1/s], at the poses
        whose load lets them; 0 for one that does not."""
        found = self.promise.growth
        return {name: dict(zip(("exact", "mujoco"), found[name], strict=True)) for name in found}

    @cached_property
    def untimed(self) -> "mujoco.MjModel":
        """The model without timing, which is compared with the exact spacecraft."""
        return (
            without_timing(self.model)
            if any(a.timed is not None for a in self.appendages)
            else self.model
        )

    def to_mjcf(self, folder: str | Path | None = None) -> str:
        """The file's text, with paths relative to `folder`, or absolute paths if it is omitted.

        Raises:
            InputError: the spacecraft was given as an `MjSpec`, which has its own `to_xml`.
        """
        place = None if folder is None else path_of("folder", folder, "the path of a folder")
        return self._file(place).text

    def write(
        self, path: str | Path, *, force: bool = False, also: Mapping[Path, str] | None = None
    ) -> list[Path]:
        """Write the file, and what goes with it; all or none.

        Args:
            path: path of the MJCF file.
            force: replace files that exist; of what was read only the spacecraft's own file.
            also: further files to write with it, content by path.

        Raises:
            OutputError: a file exists and `force` is False, is an appendage's or another output,
                or cannot be written.
        """
        path = path_of("path", path)
        check_name(path)
        content = self._file(path.parent).content
        files: list[tuple[Path, str | bytes]] = [*dict(also or {}).items(), (path, content)]
        update = None if self.source is None else (self.source, path)
        write_files(files, force=force, inputs=self.inputs, update=update)
        return [place for place, _ in files]

    def recorder(self) -> Recorder:
        """What records the states of a run: call it with the data before every step, and give it
        to `recover`."""
        return Recorder(self.model)

    @one_thread()
    def recover(
        self,
        data: "mujoco.MjData | Recorder | Mapping[str, Any]",
        place: str | None = None,
        *,
        x: ArrayLike | None = None,
        static: bool = True,
        rows: RecoveryRows | str | Path | None = None,
    ) -> Recovery:
        """Loads, stresses, displacements and accelerations inside an appendage.

        Accelerations are those of a step of the model's own integrator from the states given, so
        that they hold beside dampers and servos that it takes implicitly; where the file is exact
        in time, of a step with timing taken out. States of another host's integrator want `qacc`.

        Args:
            data: a state of the `model` (MjData), a `recorder` of many, or arrays by name: qpos
                `(t, nq)`, qvel `(t, nv)`, and either qacc `(t, nv)`, which is then taken as given,
                or what acts (ctrl, act, qfrc_applied, xfrc_applied); time `(t,)` [s].
            place: of the appendage, as given to `embed`; may be left out where there is one.
            x: stations along a beam [m]; default: five, from root to tip.
            static: whether to add the static part of the modes left out, so that loads are those
                of the whole beam; False: the kept modes alone.
            rows: recovery rows of imported modes, or their file; default: those that the
                specification names.

        Raises:
            InputError: there is no such place, the arrays do not fit the model, or a station lies
                outside the appendage.

        Example:
            >>> import beamchain as bc, mujoco
            >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
            ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
            ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
            >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
            >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
            >>> flexible = bc.embed(craft, {"mount": spec})
            >>> data = mujoco.MjData(flexible.model)
            >>> data.qfrc_applied[5] = 1.0
            >>> flexible.recover(data, "mount")
            <Recovery at 'mount', 1 instants, 5 stations, 4 modes>
        """
        return recover(
            self.model,
            self.appendages,
            data,
            place=place,
            x=x,
            static=true_or_false("static", static),
            rows=rows,
        )

    @one_thread()
    def as_dict(self) -> dict[str, Any]:
        """What `embed --json` prints."""
        return report.embed_record(self)

    @one_thread()
    def plot(self, ax: "Axes | None" = None, motion: str | None = None) -> "Axes":
        """Plot the accelerance of the hub in one motion, exact and from MuJoCo.
        Returns the axes; shows nothing.

        Args:
            ax: axes to draw into; default: a new figure.
            motion: "tx", "ty", "tz", "x", "y" or "z"; default: the first that matters.

        Raises:
            InputError: the hub does not have that motion, or it does not matter.
        """
        return report.plot_assembly(self.assembly, ax=ax, motion=motion)

    @one_thread()
    def picture(self) -> str:
        """The hub's accelerance where it errs most, exact and from MuJoCo, and the error below it,
        as SVG text."""
        return report.assembly_svg(self.assembly)

    def report(self, craft: str = "craft.xml", output: str = "flexible.xml") -> str:
        """The report as the text of one HTML file.

        Args:
            craft: name of the bare spacecraft's file.
            output: name of the file with the appendages.
        """
        return report.embed_report(self, craft, output)

    def _file(self, folder: Path | None) -> Craft:
        if self.document is None:
            raise InputError(
                "this was made from an MjSpec, which was changed in place (use its own to_xml()), "
                "or proves a file, which is there already."
            )
        return assemble(self.document, self.appendages, folder, self._layout)
