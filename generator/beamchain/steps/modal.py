"""The modal tendons of a compiled model: which they are, their numbers, and the step they were written for.

An appendage's modes are fixed tendons `PREFIX_mode<k>_<port>` (`PREFIX_mode<k>` where modes couple ports) and
`PREFIX_filler<k>`, each as long as its mode's amplitude: stiffness `w^2`, damping `2 zeta w`, modal mass 1.

**The mark.** A tendon that was made exact in time says so in its `solimplimit`, which MuJoCo reads for limited tendons
only; these have `limited="false"`. Its five numbers are

    solimplimit = "timestep  integrator  form  damping  stiffness"

the step [s], MuJoCo's number of the integrator, the form (2, 3 or 4), and the tendon's damping and stiffness as they were.
It travels with the element: `<attach>`, `MjSpec.attach`, `<include>`, pasted text, `<replicate>`, MJX and Warp keep all
five, to the last bit, and no default class reaches a number that is written out (measured with MuJoCo 3.13, 3.17 and 4.0; only
`to_xml`, which writes every number so, rounds them to 6 digits).
"""

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.forces import along, wraps
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked

Ints = NDArray[np.intp]

PATTERN = re.compile(r"(?:.+_)?(?:mode|filler)\d+(?:_(?:xy|xz|torsion|axial)\d*)?$")
JOINT = 1  # mjWRAP_JOINT
FREE_BALL = 1  # mjJNT_FREE is 0, mjJNT_BALL 1; slide and hinge come after
UNMARKED = (0.9, 0.95, 0.001, 0.5, 2.0)  # MuJoCo's own solimplimit
FORMS = (2, 3, 4)


class MadeFor(NamedTuple):
    """What a model was made exact for.

    Args:
        timestep: [s].
    """

    timestep: float
    integrator: str
    form: int


@dataclass(frozen=True, eq=False)
class Modal:
    """The modal tendons of a model, as they are now.

    Args:
        index: `(n,)` tendon numbers.
        rows: `(n, nv)` coefficients over the model's degrees of freedom.
        stiffness: `(n,)` [1/s^2].
        damping: `(n,)` as it was before the model was made exact in time [1/s].
    """

    index: Ints
    names: tuple[str, ...]
    rows: Array
    stiffness: Array
    damping: Array
    made_for: tuple[MadeFor | None, ...]

    @property
    def frequency(self) -> Array:
        """`(n,)` of the held appendage's modes [rad/s] (form 3: of the craft's)."""
        return np.sqrt(self.stiffness)

    def groups(self) -> list[Ints]:
        """Rows that span the same joints: what coefficients can be exchanged between."""
        spans: dict[bytes, list[int]] = {}
        for i, row in enumerate(self.rows):
            spans.setdefault((row != 0.0).tobytes(), []).append(i)
        return [np.array(group, dtype=np.intp) for group in spans.values()]


def modal_tendons(model: "mujoco.MjModel") -> Modal:
    """The modal tendons of a model, found by name; none where it has none.

    A tendon that has the name, but is limited, runs through sites, has no spring or holds an unnamed sort of joint, is not one.
    """
    own = [
        i
        for i in range(model.ntendon)
        if PATTERN.fullmatch(model.tendon(i).name) and not model.tendon_limited[i] and model.tendon_stiffness[i] > 0.0
    ]
    own = [i for i in own if _plain(model, i)]
    made_for = tuple(_mark(model, i) for i in own)
    before = [
        None if mark is None else float(model.tendon_solimp_lim[i, 3]) for i, mark in zip(own, made_for, strict=True)
    ]
    return Modal(
        np.array(own, dtype=np.intp),
        tuple(str(model.tendon(i).name) for i in own),
        locked(np.array([along(model, i) for i in own]).reshape(len(own), model.nv)),
        locked([float(model.tendon_stiffness[i]) for i in own]),
        locked([float(model.tendon_damping[i]) if c is None else c for i, c in zip(own, before, strict=True)]),
        made_for,
    )


def made_for(model: "mujoco.MjModel") -> list[MadeFor | None]:
    """What the modal tendons of a model were made exact for, each answer once; empty where it has no modal tendons."""
    return list(dict.fromkeys(modal_tendons(model).made_for))


def condensed(mass: Array, rows: Array) -> tuple[Array, Array]:
    """The mass matrix that modal coordinates feel while the rest of the craft follows freely, and how it follows.

    Args:
        mass: `(nv, nv)`.
        rows: `(n, nv)` tendon coefficients, independent.

    Returns:
        `(n, n)` `C = (B M^-1 B^T)^-1`, and `(nv, n)` the motion `M^-1 B^T C` of all degrees of freedom per unit of
        each modal coordinate, so that `y^T C y` is twice the kinetic energy of the modal rates y.
    """
    spread = np.linalg.solve(mass, rows.T)
    flexible = rows @ spread
    c = np.linalg.inv((flexible + flexible.T) / 2.0)
    c = (c + c.T) / 2.0
    return c, np.asarray(spread @ c, dtype=np.float64)


def foreign(what: str) -> InputError:
    """The answer to a model without modal tendons."""
    return InputError(
        f"the model has no modal tendons (NAME_mode1_xy, ...), so that {what} is not possible; only appendages written "
        "by beamchain with springs on modal tendons can be made exact in time."
    )


def _mark(model: "mujoco.MjModel", i: int) -> MadeFor | None:
    step, number, form, *_ = (float(v) for v in model.tendon_solimp_lim[i])
    if not (step > 0.0 and number in NUMBERS and form in FORMS):
        return None
    return MadeFor(step, NUMBERS[int(number)], int(form))


def _plain(model: "mujoco.MjModel", i: int) -> bool:
    """Whether a tendon is a fixed one over hinges and slides."""
    on = wraps(model, i)
    return all(model.wrap_type[w] == JOINT and model.jnt_type[model.wrap_objid[w]] > FREE_BALL for w in on)
