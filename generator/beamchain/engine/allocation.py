"""Torque on a body distributed over actuators: what is asked for, and what it is in a pose."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.linalg import qr
from scipy.optimize import linprog

from beamchain.checks import Struct, field, finite_array, list_of_names, of_type, unknown
from beamchain.engine.library import mujoco
from beamchain.engine.signals import AXES, Input, actuator_names, base, number_of
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked
from beamchain.warning_codes import Caution

REACHED = 1e-9  # relative, of torque that an allocation gives beside what is commanded
SHOWN = 3  # directions without torque that a sentence names
DECIMALS = 12  # of shares in a direction without torque, whose largest is 1


class Allocation(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Torque on a body about its own axes, distributed over actuators.

    Example:
        >>> import beamchain as bc
        >>> bc.spec.Allocation(actuators=("rw1", "rw2", "rw3"), axes="bus").about
        'xyz'
    """

    actuators: Annotated[
        tuple[str, ...], field("motors of wheels, and thrusters or torquers at sites")
    ]
    axes: Annotated[
        str | None,
        field("body on which the torque acts, about its own axes; left out: the base body"),
    ] = None
    matrix: Annotated[
        tuple[tuple[float, ...], ...] | None,
        field(
            "command of each actuator per N m about each axis, a row per actuator; left out: the "
            "pseudo-inverse of their torques",
            "",
        ),
    ] = None
    about: Annotated[str, field("axes about which torque is commanded")] = "xyz"

    def __post_init__(self) -> None:
        super().__post_init__()
        names = list_of_names("actuators of an allocation", self.actuators)
        if not names:
            raise InputError("actuators of an allocation is empty; name those that share.")
        if twice := [name for name, count in Counter(names).items() if count > 1]:
            raise InputError(
                f"actuators of an allocation name {twice[0]!r} twice; name each of them once."
            )
        if self.axes is not None:
            of_type("axes of an allocation", self.axes, str, "the name of a body")
        of_type("about of an allocation", self.about, str, 'axes of the body, such as "xz"')
        if not self.about or "".join(a for a in AXES if a in self.about) != self.about:
            raise InputError(
                f"about = {self.about!r:.60} of an allocation must be axes of the body in their "
                'order; write "xyz", or for example "xz" where nothing turns the body about y.'
            )
        if self.matrix is not None:
            finite_array("matrix of an allocation", self.matrix, (len(names), len(self.about)))


def allocate(
    actuators: Sequence[str],
    axes: str | None = None,
    matrix: "Sequence[Sequence[float]] | Array | None" = None,
    *,
    about: str = "xyz",
) -> Allocation:
    """Torque on a body as an input of `bc.plant`, distributed over wheels, thrusters and torquers.

    Under the name NAME it gives the inputs `NAME_x`, `NAME_y` and `NAME_z`: the torque on the body
    about its own axes [N m]. A positive command turns the body positively, unlike that of a wheel's
    motor. Directions in which the actuators work against each other without torque stand in
    `plant.allocations[NAME].without_torque` and in the plant's warnings.

    Args:
        actuators: motors on hinges whose body hangs on `axes` (wheels), and actuators at sites on
            it (thrusters and torquers; torque about the body's mass centre). A servo takes no
            torque.
        axes: the body; the base body where left out.
        matrix: `(n, 3)` command of each actuator per N m about each axis, as a flight computer has
            it; the pseudo-inverse of the actuators' torques in the pose where left out.
        about: the axes about which torque is commanded, where the actuators do not turn the body
            about all of them: `"xz"` gives `NAME_x` and `NAME_z`, and `matrix` is `(n, 2)`.

    Raises:
        InputError: a name, an axis or the shape of the matrix is not allowed. What the model cannot
            do, such as torque about an axis, is refused by `bc.plant`.

    Example:
        >>> import beamchain as bc
        >>> torque = bc.allocate(["rw1", "rw2", "rw3", "rw4"], axes="bus")
        >>> torque.actuators
        ('rw1', 'rw2', 'rw3', 'rw4')
    """
    names = list_of_names("actuators", actuators)
    if matrix is None:
        return Allocation(actuators=tuple(names), axes=axes, about=about)
    size = len(about) if isinstance(about, str) else None
    rows = finite_array("matrix", matrix, (len(names), size))
    return Allocation(
        actuators=tuple(names), axes=axes, matrix=tuple(map(tuple, rows.tolist())), about=about
    )


@dataclass(frozen=True, eq=False, repr=False)
class Allocated:
    """What an allocation is at a pose.

    Args:
        actuators: names.
        body: on which the torque acts.
        about: axes about which torque is commanded.
        commands: `(n, axes)` command of each actuator per N m about each of these axes.
        torque: `(3, n)` torque on the body about its own axes per unit command [N m].
        without_torque: directions of commands that give no torque, each as the actuators'
            shares; the largest is 1.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> shipped = files("beamchain") / "examples"
        >>> craft = bc.embed(shipped / "satellite.xml", {"left": shipped / "array.toml"})
        >>> wheels = bc.allocate(["wheel_x", "wheel_y", "wheel_z"], axes="bus")
        >>> plant = bc.plant(craft, {"torque": wheels}, ["attitude"])
        >>> plant.allocations["torque"].commands.diagonal().tolist()
        [-1.0, -1.0, -1.0]
    """

    actuators: tuple[str, ...]
    body: str
    about: str
    commands: Array
    torque: Array
    without_torque: tuple[Mapping[str, float], ...]

    def __repr__(self) -> str:
        return f"<Allocated, {', '.join(self.actuators)} on {self.body!r}>"

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        return {
            "actuators": list(self.actuators),
            "body": self.body,
            "about": self.about,
            "commands": self.commands,
            "torque": self.torque,
            "without_torque": [dict(direction) for direction in self.without_torque],
        }

    def cautions(self, name: str) -> list[str]:
        """What to know of it, under the name of its inputs."""
        out: list[str] = []
        if self.without_torque:
            shown = [
                f"{' : '.join(direction)} = "
                f"{' : '.join(f'{share:.4g}' for share in direction.values())}"
                for direction in self.without_torque[:SHOWN]
            ]
            rest = len(self.without_torque) - len(shown)
            more = f"; {rest} more in allocations[{name!r}].without_torque" if rest else ""
            text = (
                f"allocation {name!r}: its actuators can work against each other without torque on "
                f"{self.body!r}: {'; '.join(shown)}{more}."
            )
            out.append(Caution("allocation-null", text))
        given = self.torque @ self.commands
        for k, axis in enumerate(self.about):
            wanted = np.eye(3)[AXES.index(axis)]
            if np.max(np.abs(given[:, k] - wanted)) > REACHED:
                numbers = ", ".join(f"{value + 0.0:.4g}" for value in given[:, k].round(12))
                text = (
                    f"allocation {name!r}: its matrix answers a command of 1 N m about {axis} with "
                    f"a torque of ({numbers}) N m on {self.body!r}; check its signs and axes."
                )
                out.append(Caution("allocation-matrix", text))
        return out


def allocated(
    model: "mujoco.MjModel", data: "mujoco.MjData", name: str, allocation: Allocation
) -> Allocated:
    """What an allocation is in the pose that `data` has seen."""
    field = f"allocation {name!r}"
    if allocation.axes is None:
        body = base(model)
    else:
        body = number_of(model, "body", allocation.axes, f"axes of {field}")
    known = actuator_names(model)
    columns: list[Array] = []
    for actuator in allocation.actuators:
        if actuator not in known:
            raise unknown(f"actuator of {field}", actuator, known)
        columns.append(_torque(model, data, field, known.index(actuator), body))
    torque = np.array(columns).T
    if allocation.matrix is not None:
        commands = np.array(allocation.matrix, dtype=np.float64)
    else:
        commands = _inverse(torque, allocation, field, str(model.body(body).name))
    return Allocated(
        allocation.actuators,
        str(model.body(body).name),
        allocation.about,
        locked(commands),
        locked(torque),
        tuple(_null_directions(torque, allocation.actuators)),
    )


def largest_torque(model: "mujoco.MjModel", data: "mujoco.MjData", body: int, axis: int) -> float:
    """The largest torque both ways [N m] that the motors, thrusters and torquers on a body have
    about one of its axes, and about no other, within `ctrlrange` and `forcerange`; infinite where
    none turns it about that axis, or nothing limits one that does."""
    columns: list[Array] = []
    bounds: list[tuple[float, float]] = []
    for i in range(model.nu):
        gain = float(model.actuator_gainprm[i, 0])
        try:
            torque = _torque(model, data, "", i, body)
        except InputError:  # it does not turn this body
            continue
        if not torque.any():
            continue
        columns.append(torque / gain)
        limits = [(-np.inf, np.inf)]
        if model.actuator_ctrllimited[i]:
            low, high = sorted((gain * model.actuator_ctrlrange[i]).tolist())
            limits.append((low, high))
        if model.actuator_forcelimited[i]:
            low, high = model.actuator_forcerange[i].tolist()
            limits.append((low, high))
        bounds.append((max(low for low, _ in limits), min(high for _, high in limits)))
    if not columns:
        return np.inf
    # forces f and the torque t: T f = t along the axis
    given = np.column_stack([*columns, -np.eye(3)[axis]])
    most = np.inf
    for sign in (1.0, -1.0):
        cost = [*np.zeros(len(columns)), -sign]
        ways = (0.0, None) if sign > 0.0 else (None, 0.0)
        found = linprog(cost, A_eq=given, b_eq=np.zeros(3), bounds=[*bounds, ways])
        reached = np.inf if found.x is None else abs(float(found.x[-1]))
        most = min(most, reached if reached > REACHED else np.inf)
    return most


def _torque(
    model: "mujoco.MjModel", data: "mujoco.MjData", field: str, number: int, body: int
) -> Array:
    """`(3,)` torque on a body about its own axes per unit command of an actuator."""
    name = actuator_names(model)[number]
    target = int(model.actuator_trnid[number, 0])
    gear = model.actuator_gear[number]
    kind = int(model.actuator_trntype[number])
    held = int(model.body_weldid[body])
    of = str(model.body(body).name)
    why = ""
    world = np.zeros(3)
    if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
        wheel = int(model.jnt_bodyid[target])
        hinge = int(model.jnt_type[target]) == int(mujoco.mjtJoint.mjJNT_HINGE)
        if not hinge or int(model.body_jntnum[wheel]) != 1:
            why = "acts on a joint that is not the only hinge of its body"
        elif int(model.body_weldid[int(model.body_parentid[wheel])]) != held:
            why = f"turns {model.body(wheel).name!r}, which does not hang on {of!r}"
        # what turns the wheel about its axis turns the body the other way
        world = -gear[0] * data.xaxis[target]
    elif kind == int(mujoco.mjtTrn.mjTRN_SITE) and int(model.actuator_trnid[number, 1]) < 0:
        if int(model.body_weldid[int(model.site_bodyid[target])]) != held:
            why = f"acts at site {model.site(target).name!r}, which is not on {of!r}"
        turn = data.site_xmat[target].reshape(3, 3)
        arm = data.site_xpos[target] - data.xipos[body]
        world = turn @ gear[3:] + np.cross(arm, turn @ gear[:3])
    else:
        why = "acts neither on a hinge nor at a site"
    if why:
        raise InputError(
            f"{field}: actuator {name!r} {why}; leave it out, or give the body that it turns as "
            "axes."
        )
    biased = int(model.actuator_biastype[number]) != int(mujoco.mjtBias.mjBIAS_NONE)
    lagging = int(model.actuator_dyntype[number]) == int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
    fixed = int(model.actuator_gaintype[number]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    if (biased and model.actuator_biasprm[number, 1:3].any()) or lagging or not fixed:
        raise InputError(
            f"{field}: actuator {name!r} takes no torque or force but a set point or its like; "
            "leave it out, or make it a <motor>."
        )
    axes = data.xmat[body].reshape(3, 3)
    return np.asarray(model.actuator_gainprm[number, 0] * axes.T @ world, dtype=np.float64)


def _inverse(torque: Array, allocation: Allocation, field: str, body: str) -> Array:
    """`(n, axes)` commands with the least sum of squares that give torque about each axis."""
    inverse = np.asarray(np.linalg.pinv(torque, rcond=REACHED), dtype=np.float64)
    missed = np.abs(torque @ inverse - np.eye(3)).max(axis=0)
    reached = [axis for axis, miss in zip(AXES, missed, strict=True) if miss <= REACHED]
    if lacking := [axis for axis in allocation.about if axis not in reached]:
        rank = int(np.linalg.matrix_rank(torque, tol=REACHED * float(np.abs(torque).max())))
        less = f', or ask for about = "{"".join(reached)}"' if reached else ""
        raise InputError(
            f"{field}: its actuators give torque on {body!r} in {rank} of 3 directions, and not "
            f"about {', '.join(lacking)} alone; add an actuator{less}."
        )
    return inverse[:, [AXES.index(axis) for axis in allocation.about]]


def _null_directions(torque: Array, names: Sequence[str]) -> list[dict[str, float]]:
    """A basis of the commands without torque, each of as few actuators as a pivoted elimination
    leaves: `torque P = Q [R1 R2]`, `x = P [-R1^-1 R2; 1]`."""
    largest = float(np.abs(torque).max(initial=0.0))
    _, r, order = qr(torque, mode="economic", pivoting=True)
    rank = int(np.sum(np.abs(np.diag(r)) > REACHED * largest))
    directions = np.zeros((len(names), len(names) - rank))
    directions[order[:rank]] = -np.linalg.solve(r[:rank, :rank], r[:rank, rank:])
    directions[order[rank:]] = np.eye(len(names) - rank)
    out: list[dict[str, float]] = []
    for column in directions.T:
        size = np.abs(column)
        shares = column / column[int(np.argmax(size > (1.0 - REACHED) * size.max()))]
        out.append(
            {
                name: round(float(share), DECIMALS)
                for name, share in zip(names, shares, strict=True)
                if abs(share) > REACHED
            }
        )
    return out


def torques(model: "mujoco.MjModel", name: str, found: Allocated) -> list[Input]:
    """The inputs of an allocation."""
    known = actuator_names(model)
    numbers = [known.index(actuator) for actuator in found.actuators]
    out: list[Input] = []
    for axis, column in zip(found.about, found.commands.T, strict=True):
        parts = tuple(
            (float(share), Input(known[i], "", i)) for i, share in zip(numbers, column, strict=True)
        )
        out.append(Input(f"{name}_{axis}", "N m", parts=parts))
    return out
