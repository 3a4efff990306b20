"""The whole spacecraft at rest: its coupled modes and the accelerance of its base body,
exact and through MuJoCo. It is the promise's view of one pose.

The reference knows nothing of chains: the spacecraft's own mass and stiffness, and on it every
appendage as the beam it is, all its cantilever modes hung on the port's Jacobian,

    M = [[M_craft + sum J^T M_rigid J, J^T L^T], [L J, 1]],   K = diag(K_craft, W^2).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from beamchain.checks import of_type
from beamchain.craft.coupled_modes import Mode, coupled_modes
from beamchain.craft.error import (
    CraftError,
    PlacedBody,
    Pose,
    counterpart,
    on_base,
    peaks_of_craft,
)
from beamchain.engine.library import mujoco
from beamchain.engine.linear import Linear, linear_at
from beamchain.engine.linearise import linearise
from beamchain.engine.operating_point import poses, quiet_copy, rest_point
from beamchain.errors import InputError
from beamchain.ports.compare import grid_of, relative_error
from beamchain.ports.motions import Array

Response = NDArray[np.complex128]
DRAWN = 1.3  # of the band: how far the accelerance is drawn


@dataclass(frozen=True, eq=False)
class Assembly:
    """What the proof found.

    Args:
        modes: coupled modes, ascending; exact ones that the chains leave out only up to `band`.
        band: up to here kept modes are judged: what was asked for,
            or the highest kept cantilever frequency [rad/s].
        common: end of the in-band error: what was asked for,
            or where the first kept port has no more modes [rad/s].
        omega: `(k,)` [rad/s].
        exact, achieved: `(m, m, k)` accelerance of the hub's moving motions.
        motions: which of the six motions of the hub (x, y, z, rotations) those are:
            what was asked for.
        error: `(k,)` the in-band error before its maximum is taken.
        in_band: the in-band error up to `common`.
        hub: name of the body.
    """

    modes: tuple[Mode, ...]
    band: float
    common: float
    omega: Array
    exact: Response
    achieved: Response
    motions: tuple[int, ...]
    error: Array
    in_band: float
    hub: str

    @property
    def worst(self) -> float:
        """Largest relative frequency error of the kept modes within the band."""
        return max((abs(m.error) for m in self.judged if m.error is not None), default=0.0)

    @property
    def judged(self) -> tuple[Mode, ...]:
        """The kept modes within the band."""
        return tuple(mode for mode in self._in_band if mode.kept)

    @property
    def left_out(self) -> tuple[Mode, ...]:
        """The modes within the band that are not kept."""
        return tuple(mode for mode in self._in_band if not mode.kept)

    @property
    def _in_band(self) -> tuple[Mode, ...]:
        return tuple(m for m in self.modes if m.exact is not None and m.exact <= self.band)


def assembly_at_rest(
    craft: "mujoco.MjModel",
    model: "mujoco.MjModel",
    carried: Sequence[PlacedBody],
    promise: CraftError,
    band: float | None,
    own: Sequence[int] | None = None,
    loaded: Pose | None = None,
) -> Assembly:
    """The MuJoCo model at rest beside the exact assembly of the bare `craft` and what it carries.

    MuJoCo's modes and accelerance are those of `mjd_transitionFD`. `band`: frequencies that
    matter end here [rad/s]; None: where the kept modes end; `own`: the bare craft's degrees of
    freedom in the model; `loaded`: the pose under its load, whose slopes are then its own.
    """
    craft = quiet_copy(craft)
    model = quiet_copy(model)
    rest = poses(model)["rest"]
    pose = loaded or Pose(craft, poses(craft)["rest"], carried, promise.band, promise.motions, own)
    body = counterpart(craft, model, pose.body)
    band = band or max(w for item in carried for w in item.band.values())
    if pose.loading is None:
        compiled = pose.comparable(_transition(model, body))
    else:
        compiled = pose.compiled(model, rest, body)
    modes = coupled_modes(pose, compiled, band)
    peaks = [pose.peaks, peaks_of_craft(compiled)]
    omega = grid_of(peaks, DRAWN * max(band, promise.band))
    exact = pose.exact(omega)
    achieved = pose.accelerance(compiled, omega)
    return Assembly(
        modes=modes,
        band=band,
        common=promise.band,
        omega=omega,
        exact=np.moveaxis(exact / pose.scale, 0, -1),
        achieved=np.moveaxis(achieved / pose.scale, 0, -1),
        motions=pose.motions,
        error=relative_error(achieved, exact, pose.frozen),
        in_band=promise.poses["rest"],
        hub=craft.body(pose.body).name or f"body {pose.body}",
    )


def modes_at_pose(
    craft: "mujoco.MjModel",
    model: "mujoco.MjModel",
    carried: Sequence[PlacedBody],
    band: float,
    key: str,
    own: Sequence[int] | None = None,
    loaded: Pose | None = None,
    *,
    beyond: bool = False,
) -> tuple[Mode, ...]:
    """Coupled modes up to `band` [rad/s] at a keyframe, exact and MuJoCo's.

    `loaded`: the pose under its load; `beyond`: up to the highest mode kept, where that is more.
    """
    craft = quiet_copy(craft)
    model = quiet_copy(model)
    known = poses(craft)
    of_type("key", key, str, "the name of a keyframe")
    if key not in known:
        raise InputError(
            f"keyframe {key!r} is not in the spacecraft; choose from {', '.join(known)}."
        )
    pose = loaded or Pose(craft, known[key], carried, band, range(6), own)
    body = counterpart(craft, model, pose.body)
    modes = coupled_modes(pose, pose.compiled(model, poses(model)[key], body), band)
    exact = [(mode, mode.exact) for mode in modes if mode.exact is not None]
    top = max([band, *(omega for mode, omega in exact if mode.kept and beyond)])
    return tuple(mode for mode, omega in exact if omega <= top)


def _transition(model: "mujoco.MjModel", body: int) -> Linear:
    """A model at rest with the stiffness and damping that `mjd_transitionFD` gives: the proof."""
    point = rest_point(model)
    found = linearise(model)
    exact = linear_at(point)
    stiffness = exact.mass @ found.stiffness
    proof = replace(
        exact, damping=exact.mass @ found.damping, stiffness=(stiffness + stiffness.T) / 2.0
    )
    return on_base(proof, point, body)
