"""The modal tendons of a compiled model, and the step they were written for.

Modes are fixed tendons `PREFIX_mode<k>_<port>` and `PREFIX_filler<k>`, as long as the mode's
amplitude, of modal mass 1. One that was made exact in time says so in `solimplimit`, which MuJoCo
reads for limited tendons only:

    solimplimit = "timestep  integrator  form  damping  stiffness"

damping and stiffness as they were; form 5 plus the relative change of stiffness. Attaching,
including, replicating, MJX and Warp keep all five to the last bit.
"""

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.engine.model_rows import along, wraps
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked

Ints = NDArray[np.intp]

PATTERN = re.compile(r"(?:.+_)?(?:mode|filler)\d+(?:_(?:xy|xz|torsion|axial)\d*)?$")
FILLER = re.compile(r"(?:^|_)filler\d+(?:_(?:xy|xz|torsion|axial)\d*)?$")
JOINT = 1  # mjWRAP_JOINT
FREE_BALL = 1  # mjJNT_FREE is 0, mjJNT_BALL 1; slide and hinge come after
HINGE_OR_SLIDE = (2, 3)
UNMARKED = (0.9, 0.95, 0.001, 0.5, 2.0)  # MuJoCo's own solimplimit
TREE = 5  # the form that changes stiffness as well
FORMS = (2, 4, TREE)
MOST_STIFFER = 0.25  # relative change of stiffness that a mark of form 5 may state
UNTOUCHED = 1e-12  # relative difference of two stiffnesses that is rounding


class TimingMark(NamedTuple):
    """Step [s], integrator and form that a model was made exact for."""

    timestep: float
    integrator: str
    form: int

    @property
    def words(self) -> str:
        """What the first line of a timed file says."""
        return f"timed for {self.integrator} at {self.timestep:g} s"


@dataclass(frozen=True, eq=False)
class Modal:
    """The modal tendons of a model; `stiffness` [1/s^2] and `damping` [1/s] are those before they
    were retimed."""

    index: Ints
    names: tuple[str, ...]
    rows: Array
    stiffness: Array
    damping: Array
    made_for: tuple[TimingMark | None, ...]

    @property
    def frequency(self) -> Array:
        """`(n,)` of the held appendage's modes [rad/s]."""
        return np.sqrt(self.stiffness)


def modal_tendons(model: "mujoco.MjModel") -> Modal:
    """Unlimited tendons with such a name and a spring, over hinges and slides only."""
    named = [
        i
        for i in range(model.ntendon)
        if PATTERN.fullmatch(model.tendon(i).name) and not model.tendon_limited[i]
    ]
    own = np.array(
        [i for i in named if model.tendon_stiffness[i] > 0.0 and _plain(model, i)], dtype=np.intp
    )
    marks = tuple(_mark(model, i) for i in own)
    timed = np.array([mark is not None for mark in marks], dtype=np.bool_)
    stiffened = np.array([mark is not None and mark.form == TREE for mark in marks], dtype=np.bool_)
    before = model.tendon_solimp_lim[own]
    stiffness = np.array(model.tendon_stiffness[own], dtype=np.float64)
    return Modal(
        own,
        tuple(str(model.tendon(int(i)).name) for i in own),
        locked(np.array([along(model, i) for i in own]).reshape(own.size, model.nv)),
        locked(stiffness_before(stiffness, before, stiffened)),
        locked(np.where(timed, before[:, 3], model.tendon_damping[own])),
        marks,
    )


def timing_marks(model: "mujoco.MjModel") -> list[TimingMark | None]:
    """What the modal tendons were made exact for, each answer once."""
    return list(dict.fromkeys(modal_tendons(model).made_for))


def condensed_mass(mass: Array, rows: Array) -> tuple[Array, Array]:
    """`C = (B M^-1 B^T)^-1` `(..., n, n)` of masses `(..., nv, nv)`, and `M^-1 B^T C`
    `(..., nv, n)`, the motion per mode."""
    columns = np.broadcast_to(rows.T, (*mass.shape[:-1], len(rows)))
    spread = np.linalg.solve(mass, columns)
    flexible = rows @ spread
    c = np.linalg.inv((flexible + np.swapaxes(flexible, -1, -2)) / 2.0)
    c = (c + np.swapaxes(c, -1, -2)) / 2.0
    return c, np.asarray(spread @ c, dtype=np.float64)


def participating(mass: Array, participation: Array) -> Array:
    """`(k, n, n)` condensed mass of modes of other participations, `(k, n)` over the nominal ones:

        P C P + 1 - P^2

    since their rows are `P^-1 B` and their armatures `1 - P^2`."""
    both = participation[:, :, None] * participation[:, None, :]
    return both * mass + (1.0 - participation**2)[:, :, None] * np.eye(mass.shape[-1])


def foreign(what: str) -> InputError:
    """The answer to a model without modal tendons."""
    return InputError(
        f"the model has no modal tendons (NAME_mode1_xy, ...), so that {what} is not possible; "
        "only appendages written by beamchain with springs on modal tendons can be made exact in "
        "time."
    )


def made_for(values: Array) -> TimingMark | None:
    """What five numbers in a place for `solimp` were written for; None: they are no mark."""
    step, number, mark, *_ = (float(v) for v in values)
    form = round(mark) if np.isfinite(mark) else 0
    known = form in FORMS and abs(mark - form) <= (MOST_STIFFER if form == TREE else 0.0)
    if not (step > 0.0 and number in NUMBERS and known):
        return None
    return TimingMark(step, NUMBERS[int(number)], form)


def stiffness_before(stiffness: Array, marks: Array, changed: NDArray[np.bool_]) -> Array:
    """`(n,)` stiffness before form 5 `changed` some of it; `marks` `(n, 5)`.

    What was changed since then is changed by the same factor; untouched, it is what it was to the
    last bit.
    """
    stiffer = np.where(changed, 1.0 + (marks[:, 2] - TREE), 1.0)
    untouched = np.abs(stiffness - marks[:, 4] * stiffer) <= UNTOUCHED * stiffness
    return np.where(changed & untouched, marks[:, 4], stiffness / stiffer)


def _mark(model: "mujoco.MjModel", i: int) -> TimingMark | None:
    return made_for(model.tendon_solimp_lim[i])


def _plain(model: "mujoco.MjModel", i: int) -> bool:
    """Whether a tendon is a fixed one over hinges and slides."""
    on = wraps(model, i)
    return all(
        model.wrap_type[w] == JOINT and model.jnt_type[model.wrap_objid[w]] > FREE_BALL for w in on
    )
