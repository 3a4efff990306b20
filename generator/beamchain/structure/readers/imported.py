"""`[imported]` of SPEC.toml: the file that holds the modes; its reference point, axes and units."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Self

import msgspec
import numpy as np

from beamchain.checks import Struct, field, whole_number
from beamchain.errors import InputError
from beamchain.ports.motions import Array, mean_mass
from beamchain.structure.mass_line import default_length, spread_mass, uniform_length
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers import READERS, read_modes
from beamchain.structure.readers.superelement import InterfaceGrid

Triple = tuple[float, float, float]
MOST_MODES = 200
CENTRED = 1e-9  # of the radius of gyration: a mass centre on the root, but for rounding


class Units(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Units of the file."""

    length: Annotated[
        float | None,
        field("metres per unit of length, 1e-3 for mm; 1 where left out", "m", above=0.0),
    ] = None
    mass: Annotated[
        float | None,
        field("kilograms per unit of mass, 1e3 for t; 1 where left out", "kg", above=0.0),
    ] = None

    @property
    def si(self) -> tuple[float, float]:
        """Metres and kilograms per unit; 1 where left out."""
        return (
            1.0 if self.length is None else self.length,
            1.0 if self.mass is None else self.mass,
        )


class Imported(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Modes from a finite-element program, in place of [[segment]].

    Example:
        >>> import beamchain as bc
        >>> bc.spec.Imported(file="wing.op4", reference=(0.2, 0.0, 0.0)).file
        'wing.op4'
    """

    file: Annotated[
        str,
        field("path of the modes or matrices: .f06, .op2, .op4, .pch, .toml, .json, .npz or .mat"),
    ]
    asm: Annotated[
        str | None,
        field(
            "path of the bulk data with the interface grids of a superelement (.asm, .pch); the "
            ".asm beside the file where left out"
        ),
    ] = None
    grids: Annotated[
        tuple[InterfaceGrid, ...],
        field("interface grids of a superelement, where no asm holds them"),
    ] = ()
    ports: Annotated[
        dict[str, int],
        field("interface grids of a superelement that the root does not hold, by name"),
    ] = msgspec.field(default_factory=dict[str, int])
    reference: Annotated[
        Triple,
        field(
            "root of the appendage from the reference point of the file, in its axes",
            "units of the file",
        ),
    ] = (0.0, 0.0, 0.0)
    axes: Annotated[
        tuple[Triple, Triple, Triple],
        field("rows: x, y and z of the appendage in the axes of the file", ""),
    ] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    units: Annotated[Units, field("units of the file")] = Units()
    modes: Annotated[
        tuple[int, ...] | None, field("numbers of the modes to keep, from 1; all where left out")
    ] = None
    recovery: Annotated[
        str | None,
        field(
            "path of recovery rows, .npz or .toml: loads, stresses and accelerations per mode of "
            "the file"
        ),
    ] = None
    subcase: Annotated[int | None, field("subcase, where the file holds several")] = None
    length: Annotated[
        float | None,
        field(
            "distance from root to tip; estimated from the rigid mass where left out",
            "m",
            above=0.0,
        ),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if Path(self.file).suffix.lower() not in READERS:
            raise InputError(
                f"file = {self.file!r} has an unknown ending; beamchain reads {', '.join(READERS)}."
            )
        for name, grid in self.ports.items():
            if not re.fullmatch(r"[a-z][a-z0-9_]{0,62}", name):
                raise InputError(
                    f"ports: {name!r} must start with a small letter and hold only a-z, 0-9 and _; "
                    "for example ports = { mast = 45 }."
                )
            whole_number(f"ports.{name}", grid, 1, 999_999_999)
        for i, value in enumerate(self.modes or ()):
            whole_number(f"modes[{i}]", value, 1, 10_000)
        if self.modes is not None and not 1 <= len(self.modes) <= MOST_MODES:
            raise InputError(
                f"modes holds {len(self.modes)} numbers; name 1 to {MOST_MODES}, or leave modes "
                "out for all."
            )

    def beside(self, folder: Path) -> Self:
        """The same with the files' paths taken from a folder."""

        def placed(path: str | None) -> str | None:
            return None if path is None else str(folder / path)  # an absolute path stays as it is

        return msgspec.structs.replace(
            self,
            file=str(folder / self.file),
            asm=placed(self.asm),
            recovery=placed(self.recovery),
        )

    def read(self) -> ModalData:
        """All modes of the file, in SI, appendage axes, about the port;
        `modes` is not applied yet."""
        metres, kilograms = self.units.si
        data = read_modes(
            self.file,
            reference=self.reference,
            axes=np.array(self.axes),
            units={"length": metres, "mass": kilograms},
            subcase=self.subcase,
            asm=self.asm,
            grids=self.grids,
            ports=self.ports,
        )
        if not data.states_line:
            check_outwards(data, np.array(self.axes), self.length)
        return with_length(data, self.length)


def with_length(data: ModalData, length: float | None) -> ModalData:
    """The data with a length: the user's, the file's, or one from the rigid mass.

    `steps` says when it is not the file's.
    """
    if length is not None:
        step = f"length {length:.6g} m as given"
        return replace(data, length=length, steps=(*data.steps, step))
    if data.length is not None:
        return data
    if not data.states_line:
        check_outwards(data)
    estimated = default_length(data.rigid_mass)
    step = (
        f"length {estimated:.6g} m from mass centre and radius of gyration, for drawing and for "
        "sharing out the mass; not given (imported.length)"
    )
    return replace(data, length=estimated, steps=(*data.steps, step))


def check_outwards(data: ModalData, axes: Array | None = None, length: float | None = None) -> None:
    """The mass centre lies on the side of the root to which x points, and not beside x where no
    mass along x has the moments.

    Args:
        data: modes and rigid mass.
        axes: `(3, 3)` rows of the present axes in those of the file, which are the same where left
            out.
        length: of the appendage, where one is stated [m].

    Raises:
        InputError: it does not; the message proposes `axes` in which it does.
    """
    mass = mean_mass(data.rigid_mass)
    # the block m [c x]
    cross = data.rigid_mass[3:, :3] / mass
    centre = np.array(
        [cross[2, 1] - cross[1, 2], cross[0, 2] - cross[2, 0], cross[1, 0] - cross[0, 1]]
    )
    centre /= 2.0
    gyration = float(np.sqrt(np.trace(data.rigid_mass[3:, 3:]) / mass))
    # a body that is centred on its root has no outward side
    if np.linalg.norm(centre) <= CENTRED * gyration:
        return
    if centre[0] > 0.0:
        if np.max(np.abs(centre[1:])) <= centre[0] or _has_line(data.rigid_mass, length):
            return
        fault = "farther beside x than along it, and no mass along x has its inertia"
    else:
        fault = "not outwards along x"
    where = ", ".join(f"{axis} = {x:.6g}" for axis, x in zip("xyz", centre, strict=True))
    turned = proposed_axes(centre) @ (np.eye(3) if axes is None else axes)
    proposed = [[round(float(x), 9) + 0.0 for x in row] for row in turned]
    raise InputError(
        f"{data.source}: the mass centre lies at {where} m from the root, {fault}; x "
        "must point from the root outwards: check reference (the port), and if that is right give "
        f"axes = {proposed}."
    )


def _has_line(rigid_mass: Array, length: float | None) -> bool:
    """Whether mass along x has the moments of a body, on the stated length or that of a uniform
    piece."""
    for tried in {uniform_length(rigid_mass), length or uniform_length(rigid_mass)}:
        try:
            spread_mass(rigid_mass, tried)
        except InputError:
            continue
        return True
    return False


def proposed_axes(centre: Array) -> Array:
    """`(3, 3)` rows of axes, along the present ones, of which x comes nearest to a direction
    `(3,)`; z stays where it can."""
    k = int(np.argmax(np.abs(centre)))
    x = np.zeros(3)
    x[k] = 1.0 if centre[k] >= 0.0 else -1.0
    z = np.array([1.0, 0.0, 0.0] if k == 2 else [0.0, 0.0, 1.0])
    return np.vstack([x, np.cross(z, x), z])
