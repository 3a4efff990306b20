"""The craft's promise: the coupled spacecraft with exact appendages against what MuJoCo
has, pose by pose.

The in-band error of `ports.compare.Reference` with the craft's base body for a hub: its motions in
its own axes, all appendages exact (every mode) against all appendages as the model has them, at the
rest pose and at every keyframe.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from beamchain.checks import of_type
from beamchain.craft.assembly import (
    STILLEST,
    Carried,
    Mode,
    comparable,
    extra_damping,
    on_base,
)
from beamchain.engine.library import mujoco
from beamchain.engine.linear import Linear, linear_at
from beamchain.engine.mount import motion
from beamchain.engine.operating_point import base_body, poses, quiet_copy, rest_point
from beamchain.errors import InputError
from beamchain.ports.compare import (
    grid_of,
    maximum_of,
    peak_clusters,
    peaks_at,
    relative_error,
    unresolved_peaks,
    with_damping,
)
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, system_matrix

RANK = 1e-9  # relative singular value below which a motion of the base is held


@dataclass(frozen=True)
class CraftError:
    """What the craft's promise came to.

    Args:
        error: the worst of all poses.
        band: upper end [rad/s].
        poses: error per pose: "rest", then keyframes by name or number.
        motions: which motions of the base body count (0 to 5: x, y, z, rotations).
        body: name of the base body.
    """

    error: float
    band: float
    poses: dict[str, float]
    motions: tuple[int, ...]
    body: str


def peaks_of_craft(craft: Linear) -> Array:
    """Peaks `(k, 2)`, frequency [rad/s] and damping ratio, with the base free,
    and with its own joints held.

    Those of the damped poles, and of the undamped modes where they lie elsewhere.
    """
    free = np.ones(craft.mass.shape[0], dtype=np.bool_)
    held = np.abs(craft.outputs.acceleration).max(axis=0, initial=0.0) <= 0.0
    picks = [np.ix_(pick, pick) for pick in (free, held) if np.any(pick)]
    parts = [(craft.mass[pick], craft.damping[pick], craft.stiffness[pick]) for pick in picks]
    moving = np.vstack([peaks_at(_poles(*part)) for part in parts])
    return np.vstack(
        [moving, unresolved_peaks(np.vstack([_modes(*part) for part in parts]), moving)]
    )


def _poles(mass: Array, damping: Array, stiffness: Array) -> NDArray[np.complex128]:
    n = mass.shape[0]
    rates = np.asarray(np.linalg.solve(mass, np.hstack([stiffness, damping])), dtype=np.float64)
    return np.linalg.eigvals(system_matrix(rates[:, :n], rates[:, n:])).astype(np.complex128)


def _modes(mass: Array, damping: Array, stiffness: Array) -> Array:
    values, shapes = eigh(stiffness, mass)
    moving = values > STILLEST * max(float(np.max(values, initial=0.0)), 1e-300)
    w = np.sqrt(values[moving])
    shapes = shapes[:, moving]
    ratios = np.einsum("ik,ij,jk->k", shapes, damping, shapes) / (2.0 * w)
    return np.column_stack([w, np.clip(ratios, 0.0, 1.0)])


def craft_at(model: "mujoco.MjModel", qpos: Array, body: int) -> Linear:
    """A quiet model at rest at `qpos`; a wrench on `body` is its input, and the body's
    acceleration its output."""
    point = rest_point(model, qpos)
    return on_base(linear_at(point), point, body)


class Pose:
    """The bare, quiet craft at a pose, and the exact answer on it.

    Motions of the base body that are `wanted` but that it cannot make are left out; `band`:
    upper end [rad/s].
    """

    def __init__(
        self,
        craft: "mujoco.MjModel",
        qpos: Array,
        carried: Sequence[Carried],
        band: float,
        wanted: Sequence[int],
    ) -> None:
        body = base_body(craft, carried[0].mount.body)
        #: as it is, and with damping where it has none
        self.bare: Linear = craft_at(craft, qpos, body)
        self.extra: Array = extra_damping(self.bare)
        self.craft: Linear = replace(self.bare, damping=self.bare.damping + self.extra)
        data = rest_point(craft, qpos).data()
        self.jacobians: list[Array] = [port_motion(craft, data, item) for item in carried]
        self.carried: Sequence[Carried] = carried
        self.band: float = band
        base = self.bare.outputs.acceleration
        rows = np.linalg.norm(base, axis=1)
        able = [i for i in range(6) if rows[i] > RANK * rows.max(initial=1e-300)]
        self.motions: tuple[int, ...] = tuple(i for i in wanted if i in able) or tuple(able)
        frozen = self.bare.mass + sum(
            (
                j.T @ item.whole.rigid_mass @ j
                for j, item in zip(self.jacobians, carried, strict=True)
            ),
            np.zeros_like(self.bare.mass),
        )
        # the base body's own joints: all others locked
        joints = np.abs(base).max(axis=0) > 0.0
        locked = frozen[np.ix_(joints, joints)]
        rigid = base[:, joints] @ np.linalg.solve(locked, base[:, joints].T)
        inverse = np.linalg.pinv(rigid, rcond=RANK, hermitian=True)
        scale = np.sqrt(np.diag(inverse))[list(self.motions)]
        self.scale: Array = np.outer(scale, scale)
        self.frozen: float = float(
            np.linalg.norm(rigid[np.ix_(self.motions, self.motions)] * self.scale, 2)
        )

    def accelerance(
        self,
        craft: Linear,
        omega: Array,
        models: Sequence[PortModel] = (),
        roots: Sequence[Array] = (),
    ) -> NDArray[np.complex128]:
        """`(k, n, n)` dimensionless accelerance of a craft's base body in the motions that
        matter, with appendages `models` on its `roots`."""
        hub = craft.picked(inputs=self.motions, outputs=self.motions)
        return np.moveaxis(hub.response(omega, models, roots), -1, 0) * self.scale

    def response(self, models: Sequence[PortModel], omega: Array) -> NDArray[np.complex128]:
        """`(k, n, n)` dimensionless accelerance of the base body with these appendages,
        damped."""
        return self.accelerance(self.craft, omega, models, self.jacobians)

    @cached_property
    def near(self) -> list[PortModel]:
        """The exact appendages with what lies far above the band gathered:
        their peaks are the same."""
        return [with_damping(item.whole.condensed(25.0 * self.band)) for item in self.carried]

    @cached_property
    def whole(self) -> list[PortModel]:
        """The exact appendages, all their modes, damped."""
        return [with_damping(item.whole) for item in self.carried]

    @cached_property
    def known(self) -> tuple[Array, Array, NDArray[np.complex128]]:
        """Peaks of the exact craft, a grid that resolves them, and the exact response there."""
        peaks = self._peaks(self.near)
        omega = grid_of([peaks], self.band)
        return peaks, omega, self.exact(omega)

    def exact(self, omega: Array) -> NDArray[np.complex128]:
        """`response` with the exact appendages, all their modes."""
        return self.response(self.whole, omega)

    def of_models(self, models: Sequence[PortModel]) -> float:
        """In-band error with `models` for appendages."""
        appendages = [with_damping(model) for model in models]
        return self._error(partial(self.response, appendages), self._peaks(appendages))

    def of_mujoco(
        self, model: "mujoco.MjModel", qpos: Array, body: int, old: Sequence[int]
    ) -> float:
        """In-band error of the compiled `model` at `qpos`; `old`:
        the craft's own degrees of freedom in it."""
        ours = comparable(craft_at(model, qpos, body), self.carried, old, self.extra)
        return self._error(partial(self.accelerance, ours), peaks_of_craft(ours))

    def _peaks(self, models: Sequence[PortModel]) -> Array:
        return peaks_of_craft(self.craft.with_appendages(models, self.jacobians))

    def _error(self, response: Callable[[Array], NDArray[np.complex128]], peaks: Array) -> float:
        """In-band error of any `response` that has these `peaks`."""
        known, omega, exact = self.known
        more = peak_clusters(unresolved_peaks(peaks, known), self.band)

        def curve(at: Array) -> Array:
            return relative_error(response(at), self.exact(at), self.frozen)

        values = np.concatenate([relative_error(response(omega), exact, self.frozen), curve(more)])
        return maximum_of(curve, np.concatenate([omega, more]), values)


def modes_at(
    craft: "mujoco.MjModel",
    model: "mujoco.MjModel",
    carried: Sequence[Carried],
    band: float,
    key: str,
) -> tuple[Mode, ...]:
    """Coupled modes up to `band` [rad/s] at a keyframe: exact,
    and MuJoCo's that is nearest in frequency."""
    craft = quiet_copy(craft)
    model = quiet_copy(model)
    known = poses(craft)
    of_type("key", key, str, "the name of a keyframe")
    if key not in known:
        raise InputError(
            f"keyframe {key!r} is not in the spacecraft; choose from {', '.join(known)}."
        )
    pose = Pose(craft, known[key], carried, band, range(6))
    whole = pose.craft.with_appendages(pose.whole, pose.jacobians)
    exact = _modes(whole.mass, whole.damping, whole.stiffness)[:, 0]
    body = base_body(
        model, int(model.body(craft.body(base_body(craft, carried[0].mount.body)).name).id)
    )
    compiled = craft_at(model, poses(model)[key], body)
    ours = _modes(compiled.mass, compiled.damping, compiled.stiffness)[:, 0]
    exact = np.sort(exact[exact <= band])
    first, second = linear_sum_assignment(np.abs(np.log(exact[:, None] / ours[None, :])))
    pairs = dict(zip(first.tolist(), second.tolist(), strict=True))
    return tuple(
        Mode(float(w), float(ours[pairs[i]]) if i in pairs else None, True)
        for i, w in enumerate(exact)
    )


def port_motion(craft: "mujoco.MjModel", data: "mujoco.MjData", item: Carried) -> Array:
    """`(6, nv)` motion of an appendage's root, in its axes, at a pose."""
    body = item.mount.body
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, item.mount.quaternion / np.linalg.norm(item.mount.quaternion))
    frame = data.xmat[body].reshape(3, 3)
    return motion(
        craft, data, body, data.xpos[body] + frame @ item.mount.position, frame @ turn.reshape(3, 3)
    )


def craft_poses(
    craft: "mujoco.MjModel", carried: Sequence[Carried], band: float, wanted: Sequence[int]
) -> dict[str, list[Pose]]:
    """Every pose of the craft with its exact answer, one per base body that carries appendages."""
    craft = quiet_copy(craft)
    groups: dict[int, list[Carried]] = {}
    for item in carried:
        groups.setdefault(base_body(craft, item.mount.body), []).append(item)
    return {
        name: [Pose(craft, qpos, group, band, wanted) for group in groups.values()]
        for name, qpos in poses(craft).items()
    }


def craft_error(
    craft: "mujoco.MjModel",
    model: "mujoco.MjModel",
    carried: Sequence[Carried],
    exact: Mapping[str, list[Pose]],
) -> CraftError:
    """The craft's promise as the compiled model keeps it, against the answers of `craft_poses`."""
    model = quiet_copy(model)
    new = {dof for item in carried for dof in item.dofs}
    old = [i for i in range(model.nv) if i not in new]
    positions = poses(model)
    errors: dict[str, float] = {}
    names: list[str] = []
    for name, several in exact.items():
        for pose in several:
            body = base_body(craft, pose.carried[0].mount.body)
            label = craft.body(body).name
            names.append(label or f"body {body}")
            there = int(model.body(label).id) if label else body
            errors[name] = max(
                errors.get(name, 0.0), pose.of_mujoco(model, positions[name], there, old)
            )
    first = next(iter(exact.values()))[0]
    return CraftError(max(errors.values()), first.band, errors, first.motions, names[0])
