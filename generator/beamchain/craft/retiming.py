"""The command `retime`: a file with timing for another step,
and what its step makes of the spacecraft, read back."""

import copy
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from beamchain.caution import Caution, warnings_record
from beamchain.craft.appendage import Appendage, carried
from beamchain.craft.embedding import marked_appendages
from beamchain.craft.error import Pose, craft_poses
from beamchain.craft.promise import joint_request, kept_band
from beamchain.craft.sampled import craft_sampled_error
from beamchain.craft.step_search import largest_step
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.engine.operating_point import poses, quiet_copy
from beamchain.errors import BeamchainError
from beamchain.ports.compare import keeps_tolerance
from beamchain.steps.retime import time_sentence
from beamchain.steps.retime_file import RetimedFile, retimed_file
from beamchain.steps.sampled import off_by
from beamchain.steps.step_map import TimeError, time_error

UNMARKED = "the file does not say what its appendages are (it was not written by embed)"


@dataclass(frozen=True, eq=False)
class RetimedCraft:
    """A file with timing for a step, and its errors there.

    Args:
        file: text, models, rows of modes, notes.
        timestep: [s]; 0: the timing was taken out.
        craft, appendages: the bare spacecraft and the exact appendages by the marks of the file;
            None: not known.
        unknown: why they are not known.
    """

    file: RetimedFile
    timestep: float
    craft: "mujoco.MjModel | None"
    appendages: tuple[Appendage, ...]
    unknown: str

    @cached_property
    def band(self) -> float | None:
        """The largest band that the scenes of its appendages ask for [rad/s];
        None where none is known."""
        return joint_request([a.spec for a in self.appendages]).band

    @cached_property
    def tolerance(self) -> float | None:
        """The smallest tolerance of scenes with a band; None where none is known."""
        return joint_request([a.spec for a in self.appendages]).tolerance

    @cached_property
    def time_error(self) -> TimeError | None:
        """The largest error of a coupled pole at the step, worst of all poses;
        None where the timing was taken out."""
        if self.timestep == 0.0:
            return None
        return time_error(
            quiet_copy(self.file.model),
            quiet_copy(self.file.plain),
            poses(self.file.model),
            self.band,
        )

    @cached_property
    def sampled_error(self) -> float | None:
        """In-band error of the response at the step, worst of all poses;
        None where the exact appendages are not known."""
        if self.timestep == 0.0 or self.craft is None:
            return None
        errors = craft_sampled_error(self.craft, self.file.model, self._exact_poses)
        return max(error.error for error in errors.values())

    @cached_property
    def largest_step(self) -> float | None:
        """The largest step that keeps the tolerance [s], to 9 %; None where this one does, where
        none would, or where the exact appendages or a tolerance are not known."""
        if self.met is not False or self.craft is None or self.tolerance is None:
            return None
        plain = copy.copy(self.file.plain)
        plain.opt.timestep = self.timestep
        return largest_step(self.craft, plain, self._exact_poses, self.tolerance, self.band)

    @cached_property
    def _exact_poses(self) -> dict[str, list[Pose]]:
        assert self.craft is not None
        request = joint_request([a.spec for a in self.appendages])
        exact = carried(None, self.appendages)
        band = request.band or kept_band(self.appendages)
        return craft_poses(self.craft, exact, band, request.motions)

    @property
    def met(self) -> bool | None:
        """Whether 1.01 times the sampled error is within the tolerance;
        None where either is not known."""
        error = self.sampled_error
        tolerance = self.tolerance
        return None if error is None or tolerance is None else keeps_tolerance(error, tolerance)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Slowed modes, and poles that are not exact."""
        error = self.time_error
        if error is None or error.exact:
            return tuple(self.file.notes)
        return *self.file.notes, Caution("time-error", time_sentence(error))

    def as_dict(self) -> dict[str, Any]:
        """What `retime --json` prints."""
        error = self.time_error
        return {
            "modes": [asdict(row) for row in self.file.rows],
            "time_error": None if error is None else error.as_dict(),
            "sampled_error": self.sampled_error,
            "tolerance": self.tolerance,
            "met": self.met,
            "largest_step": self.largest_step,
            **warnings_record(self.warnings),
        }

    @property
    def headline(self) -> str:
        """The errors in a sentence."""
        error = self.time_error
        if error is None:
            return "the timing was taken out."
        option = self.file.model.opt
        step = f"{NUMBERS[int(option.integrator)]} at {float(option.timestep):g} s"
        exact = "exact in time" if error.exact else "not exact"
        sentence = f"{step}: poles are {exact}, {error.words}"
        if self.sampled_error is None:
            return f"{sentence}; the error of the response is not known, for {self.unknown}."
        sentence += f"; motion off {off_by(self.sampled_error)}"
        if self.tolerance is None:
            return f"{sentence}; no tolerance is asked for."
        side = "within" if self.met else "above"
        sentence += f", {side} the tolerance {self.tolerance:g}"
        if self.largest_step is not None:
            sentence += f", which is kept up to {self.largest_step:.3g} s"
        return f"{sentence}."


def retime_craft(
    path: Path, timestep: float, integrator: str | None, folder: Path, *, joints: bool = False
) -> RetimedCraft:
    """A file of `embed` with timing for a step and integrator, its paths relative to `folder`,
    and its errors there; `joints`: the spacecraft's own sprung joints too."""
    craft, appendages, unknown = None, (), UNMARKED
    if timestep > 0.0:
        try:
            known = marked_appendages(path)
        except BeamchainError as error:
            known, unknown = None, str(error).rstrip(".")
        if known:
            (craft, appendages), unknown = known, ""
    band = joint_request([a.spec for a in appendages]).band
    file = retimed_file(path, timestep, integrator, folder, band, joints=joints)
    return RetimedCraft(file, timestep, craft, appendages, unknown)
