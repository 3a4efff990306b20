"""Rows over modes that give loads, stresses and accelerations inside an appendage: as a
finite-element program delivers them, and as they are evaluated.

Theory: docs/theory.md, section 10.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from beamchain.checks import finite_array, list_of_names
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked, offset_matrix
from beamchain.structure.modal_data import ModalData

FELT = np.eye(6, 6 + 9)  # of what drives modes, all that a file knows: nothing of a spin
CROSS = np.cross(np.eye(3)[:, None], np.eye(3))  # of two unit vectors
MOST_ROWS = 4000
LARGEST = 1e50  # of any number given, so that products of several stay finite


def _nothing() -> Array:
    return np.zeros((0, 0))


@dataclass(frozen=True, eq=False, repr=False)
class RecoveryRows:
    """Loads, stresses and accelerations inside an imported body, as rows over its modes.

    `y = modes eta + accelerations eta'' + root a`: with u the columns of a recovery matrix for the
    modes, loads, stresses and displacements have `modes = u`, accelerations of points have
    `accelerations = u` and `root` their motion per motion of the root. A row with a point r also
    has the centripetal part of a spin w, `root[:3] . (w x (w x r))`.

    Args:
        names: of the r quantities.
        modes: `(r, n)` per mass-normalised mode of the file, all of them, by ascending frequency;
            of a file of matrices per inner freedom (those beside the boundary), in their order.
        accelerations: `(r, n)` per acceleration of each; zeros where left out.
        root: `(r, 6)` per acceleration of the root in the appendage's axes [m/s^2, rad/s^2];
            zeros where left out.
        points: `(r, 3)` of rows that are accelerations, the place of the point from the root in the
            appendage's axes [m]; zeros, which add nothing, where left out.
        units: of the quantities; empty where left out.
        source: origin of the rows.

    Raises:
        InputError: sizes disagree, or a number is not finite.

    Example:
        >>> import beamchain as bc
        >>> rows = bc.spec.RecoveryRows(
        ...     names=("hinge moment",), modes=[[120.0, -35.0]], units=("N m",)
        ... )
        >>> rows
        <RecoveryRows, 1 quantity over 2 modes>
    """

    names: tuple[str, ...]
    modes: Array = field(default_factory=_nothing)
    accelerations: Array = field(default_factory=_nothing)
    root: Array = field(default_factory=_nothing)
    points: Array = field(default_factory=_nothing)
    units: tuple[str, ...] = ()
    source: str = "recovery rows"

    def __repr__(self) -> str:
        count = len(self.names)
        many = "quantity" if count == 1 else "quantities"
        return f"<RecoveryRows, {count} {many} over {self.modes.shape[1]} modes>"

    def __post_init__(self) -> None:
        names = tuple(list_of_names("names", self.names))
        count = len(names)
        if not 1 <= count <= MOST_ROWS:
            raise InputError(f"{self.source}: {count} rows are named; give 1 to {MOST_ROWS}.")
        if len(set(names)) != count:
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"{self.source}: two rows have the name {twice!r}; name each once.")
        units = tuple(list_of_names("units", self.units)) or ("",) * count
        if len(units) != count:
            raise InputError(
                f"{self.source}: {len(units)} units are given for {count} rows; give one each."
            )
        given = {
            name: self._array(name, getattr(self, name), count)
            for name in ("modes", "accelerations", "root", "points")
        }
        size = max(given[name].shape[-1] for name in ("modes", "accelerations"))
        if size == 0:
            raise InputError(
                f"{self.source}: neither modes nor accelerations are given; give a row of numbers, "
                "one per mode of the file, for each name."
            )
        sizes = {"modes": size, "accelerations": size, "root": 6, "points": 3}
        for name, wide in sizes.items():
            values = given[name]
            if values.size == 0:
                values = np.zeros((count, wide))
            if values.shape != (count, wide):
                raise InputError(
                    f"{self.source}: {name} has the shape {values.shape}; {(count, wide)} is "
                    "needed: a row per name, a column per mode of the file (root: six motions; "
                    "points: x, y, z)."
                )
            object.__setattr__(self, name, locked(values))
        for name, point, root in zip(names, self.points, self.root, strict=True):
            if np.any(point) and not np.any(root[:3]):
                raise InputError(
                    f"{self.source}: row {name!r} has a point, but no motion with the root in "
                    "root; give both of an acceleration, or leave points out."
                )
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "units", units)

    def check_columns(self, modes: int) -> None:
        """There is a column for each of the `modes` of the file.

        Raises:
            InputError: there are more, or fewer.
        """
        if self.modes.shape[1] != modes:
            raise InputError(
                f"{self.source}: the rows have {self.modes.shape[1]} columns, but the file holds "
                f"{modes} modes (or inner freedoms); give a column for every one, in the order of "
                "the file, whether it is kept or not, and none for the boundary."
            )

    def _array(self, name: str, value: object, count: int) -> Array:
        try:
            values = finite_array(name, value, most=LARGEST)
        except InputError as error:
            raise InputError(f"{self.source}: {error}") from None
        return values.reshape(count, -1) if values.size and values.ndim < 2 else values


class RecoveredQuantity(NamedTuple):
    """A recovered quantity: name, names and units of its components, and whether the kept modes
    make it by their accelerations, not by their amplitudes."""

    name: str
    parts: tuple[str, ...]
    units: tuple[str, ...]
    accelerates: bool


@dataclass(frozen=True, eq=False)
class OutputMatrices:
    """Output transformation matrices of an appendage: k components at s stations over its motion.

    `y = C_q eta + C_a eta'' + C_r a + C_w (w, (w, eta')) + (C_s - C_q W^-2 D) d`: with eta the n
    kept modes, a and w acceleration and spin of the root. The last term is the static part of the
    modes left out: of the whole appendage less that of the kept modes, `W^2 eta = D d`. What drives
    them is d: the acceleration that the root feels (6), products of its spin (9), and wrenches (6)
    on every point that may carry something.

    Args:
        quantities: what the components are, in their order.
        frequencies: `(n,)` W of the kept modes [rad/s].
        drives: `(n, d)` D, force on each kept mode; per acceleration `-L`.
        modes: `(s, k, n)` C_q.
        accelerations: `(s, k, n)` C_a.
        root: `(s, k, 6)` C_r.
        spin: `(s, k, 3, 3 + n)` C_w, per product of a spin with a spin or the rate of a mode.
        static: `(s, k, d)` C_s, of the whole appendage under constant drives.
    """

    quantities: tuple[RecoveredQuantity, ...]
    frequencies: Array
    drives: Array
    modes: Array
    accelerations: Array
    root: Array
    spin: Array
    static: Array

    @property
    def left_out(self) -> Array:
        """`(s, k, d)` static part of the modes left out per constant drive."""
        return self.static - self.modes @ (self.drives / self.frequencies[:, None] ** 2)


def crossed(motion: Array) -> Array:
    """`(s, 6, 3, m)`: `w x v` of both halves v of `motion` `(s, 6, m)`, per component of w."""
    count, _, width = motion.shape
    products = np.einsum("jki,shkm->shijm", CROSS, motion.reshape(count, 2, 3, width))
    return products.reshape(count, 6, 3, width)


def delivered_outputs(
    data: ModalData,
    kept: Array,
    frequencies: Array,
    rows: RecoveryRows | None,
    units: tuple[float, float],
) -> OutputMatrices:
    """Recovery rows of imported modes.

    Args:
        data: all modes, mass-normalised, in SI.
        kept: `(n, N)` the kept modes in terms of these.
        frequencies: `(n,)` of the kept modes [rad/s].
        rows: over the modes of the file; without any, only what the modes do at the root.
        units: of the file, metres and kilograms.
    """
    count = data.in_file.shape[1]
    quantities: tuple[RecoveredQuantity, ...] = ()
    modes = accelerations = np.zeros((0, count))
    root, points = np.zeros((0, 6)), np.zeros((0, 3))
    if rows is not None:
        rows.check_columns(count)
        quantities = tuple(
            RecoveredQuantity(name, ("",), (unit,), not np.any(row))
            for name, unit, row in zip(rows.names, rows.units, rows.modes, strict=True)
        )
        # coordinates of the file's own units: energy is M L^2 / T^2 there
        size = 1.0 / (units[0] * np.sqrt(units[1]))
        modes, accelerations = size * rows.modes, size * rows.accelerations
        root, points = rows.root, rows.points
    # c . (w x (w x r)) of the points, along the motion of each row
    turning = np.array([offset_matrix(point)[:, 3:] for point in points]).reshape(-1, 6, 3)
    spin = np.einsum("ri,rijl->rjl", root[:, :3], crossed(turning)[:, :3])
    over = kept @ data.in_file
    yielding = data.participation / data.frequencies[:, None] ** 2  # W^-2 L
    return OutputMatrices(
        quantities=quantities,
        frequencies=frequencies,
        drives=-(kept @ data.participation @ FELT),
        modes=(modes @ over.T)[None],
        accelerations=(accelerations @ over.T)[None],
        root=root[None],
        spin=np.pad(spin, ((0, 0), (0, 0), (0, len(kept))))[None],
        static=-(modes @ data.in_file.T @ yielding @ FELT)[None],
    )
