"""`[imported]` of SPEC.toml: which file holds the modes, and how its point, axes and units are to be taken."""

from dataclasses import replace
from pathlib import Path
from typing import Self

import msgspec
import numpy as np

from beamchain.checks import Struct, number, own_numbers, positive, whole
from beamchain.errors import InputError
from beamchain.structure.mass_line import default_length
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers import READERS, read_modes

Triple = tuple[float, float, float]
MOST_MODES = 200


class Units(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Units of the file: metres per unit of length, kilograms per unit of mass (mm, tonne: 1e-3, 1e3)."""

    length: float = 1.0
    mass: float = 1.0

    def __post_init__(self) -> None:
        own_numbers(self)
        positive("length", self.length, "m")
        positive("mass", self.mass, "kg")


class Imported(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Modes somebody else computed, instead of [[segment]].

    Args:
        file: .f06, .op2, .toml, .json, .npz or .mat.
        reference: the port, from the file's reference point, in the file's axes and units.
        axes: rows: appendage x, y, z in the file's axes.
        units: of the file.
        modes: numbers from 1; all where left out.
        subcase: where the file holds several.
        length: root to tip [m]; from the rigid mass, and said so, where left out.
    """

    file: str
    reference: Triple = (0.0, 0.0, 0.0)
    axes: tuple[Triple, Triple, Triple] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    units: Units = Units()
    modes: tuple[int, ...] | None = None
    subcase: int | None = None
    length: float | None = None

    def __post_init__(self) -> None:
        own_numbers(self)
        if Path(self.file).suffix.lower() not in READERS:
            raise InputError(f"file = {self.file!r} has an unknown ending; beamchain reads {', '.join(READERS)}.")
        for i, value in enumerate(self.reference):
            number(f"reference[{i}]", value, "units of the file")
        for i, row in enumerate(self.axes):
            for j, value in enumerate(row):
                number(f"axes[{i}][{j}]", value, "")
        for i, value in enumerate(self.modes or ()):
            whole(f"modes[{i}]", value, 1, 10_000)
        if self.modes is not None and not 1 <= len(self.modes) <= MOST_MODES:
            raise InputError(
                f"modes holds {len(self.modes)} numbers; name 1 to {MOST_MODES}, or leave modes out for all."
            )
        if self.length is not None:
            positive("length", self.length, "m")

    def beside(self, folder: Path) -> Self:
        """The same with the file's path taken from a folder."""
        path = Path(self.file)
        return self if path.is_absolute() else msgspec.structs.replace(self, file=str(folder / path))

    def read(self) -> ModalData:
        """All modes of the file, in SI, appendage axes, about the port; `modes` is not applied yet."""
        data = read_modes(
            self.file, reference=self.reference, axes=np.array(self.axes),
            units={"length": self.units.length, "mass": self.units.mass}, subcase=self.subcase,
        )  # fmt: skip
        return with_length(data, self.length)


def with_length(data: ModalData, length: float | None) -> ModalData:
    """The data with a length: the user's, the file's, or one from the rigid mass, which is said."""
    if length is not None:
        return replace(data, length=length, steps=(*data.steps, f"length {length:.6g} m as given"))
    if data.length is not None:
        return data
    own = default_length(data.rigid_mass)
    words = "from mass centre and radius of gyration, as of a uniform beam, for drawing and for sharing out the mass"
    return replace(data, length=own, steps=(*data.steps, f"length {own:.6g} m {words}; not given (imported.length)"))
