"""Rows that turn modes of a finite-element program into loads, stresses and accelerations."""

from dataclasses import dataclass, field

import numpy as np

from beamchain.checks import finite_array, list_of_names
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked

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
