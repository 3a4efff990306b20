"""The command `retime`: a file with timing for another step,
and what its step makes of the spacecraft, read back."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from beamchain.craft.embedded import Embedded
from beamchain.craft.embedding import marked_appendages
from beamchain.craft.promise import joint_request
from beamchain.craft.proof import UNMARKED, proved
from beamchain.engine.operating_point import poses, quiet_copy
from beamchain.errors import BeamchainError
from beamchain.ports.compare import keeps_tolerance
from beamchain.steps.cures import Cure, Names
from beamchain.steps.retime import time_sentence
from beamchain.steps.retime_file import RetimedFile, retimed_file
from beamchain.steps.sampled import represents
from beamchain.steps.step_map import TimeError, time_error
from beamchain.warning_codes import Caution

OF_RETIME = Names("give --integrator {}", "give --timestep {}")


@dataclass(frozen=True, eq=False)
class RetimedCraft:
    """A file with timing for a step, and its errors there.

    Args:
        file: text, models, rows of modes, notes.
        timestep: [s]; 0: the timing was taken out.
        proof: the file against the exact appendages that its marks name; None: not known.
        unknown: why they are not known.
    """

    file: RetimedFile
    timestep: float
    proof: Embedded | None
    unknown: str

    @property
    def band(self) -> float | None:
        """The largest band that the scenes of its appendages ask for [rad/s];
        None where none is known."""
        if self.proof is None:
            return None
        return joint_request([a.spec for a in self.proof.appendages]).band

    @property
    def tolerance(self) -> float | None:
        """The smallest tolerance of scenes with a band; None where none is known."""
        return None if self.proof is None else self.proof.tolerance

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

    @property
    def sampled_error(self) -> float | None:
        """In-band error of the response at the step, worst of all poses;
        None where the exact appendages are not known."""
        if self.timestep == 0.0 or self.proof is None:
            return None
        return self.proof.sampled_error

    @property
    def cure(self) -> Cure | None:
        """What was tried and keeps the tolerance; None where this step does, where nothing that
        was tried does, or where the exact appendages are not known."""
        return None if self.timestep == 0.0 or self.proof is None else self.proof.cure

    @property
    def met(self) -> bool | None:
        """Whether 1.01 times the sampled error is within the tolerance, and the step represents the
        band; None where either is not known."""
        error = self.sampled_error
        tolerance = self.tolerance
        if self.proof is None or error is None or tolerance is None:
            return None
        return represents(self.timestep, self.proof.band) and keeps_tolerance(error, tolerance)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Slowed modes, and poles that are not exact."""
        error = self.time_error
        if error is None or error.exact:
            return tuple(self.file.notes)
        return *self.file.notes, Caution("time-error", time_sentence(error))


def retime_craft(
    path: Path, timestep: float, integrator: str | None, folder: Path, *, joints: bool = False
) -> RetimedCraft:
    """A file of `embed` with timing for a step and integrator, its paths relative to `folder`,
    and its errors there; `joints`: the spacecraft's own sprung joints too."""
    if timestep == 0.0:
        return RetimedCraft(retimed_file(path, timestep, integrator, folder), timestep, None, "")
    try:
        known = marked_appendages(path)
        unknown = "" if known else UNMARKED
    except BeamchainError as error:
        known, unknown = None, str(error).rstrip(".")
    band = joint_request([a.spec for a in known[1]]).band if known else None
    file = retimed_file(path, timestep, integrator, folder, band, joints=joints)
    try:
        proof = proved(*known, file.model) if known else None
        proof = proof and replace(proof, retime=True, joints=joints, names=OF_RETIME)
    except BeamchainError as error:
        proof, unknown = None, str(error).rstrip(".")
    return RetimedCraft(file, timestep, proof, unknown)
