"""What torques would determine, before a test: the least variances (Cramer and Rao) that a log of them allows."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beamchain.checks import positive
from beamchain.craft.identification.channels import active, driven, even
from beamchain.craft.identification.describe import SIGNIFICANT, USEFUL_DAMPING, USEFUL_FREQUENCY, advice
from beamchain.craft.identification.hub import bare, directions
from beamchain.craft.identification.likelihood import derivatives, inverse
from beamchain.craft.identification.logs import read_torques
from beamchain.craft.identification.prior import UNKNOWN_DAMPING, read_prior, seen_modes
from beamchain.craft.identification.response import Piece, Raw
from beamchain.craft.identification.structure import Parts, seen
from beamchain.errors import InputError
from beamchain.ports.motions import Array

if TYPE_CHECKING:
    from beamchain.engine.library import mujoco

RATES = ("rate_x", "rate_y", "rate_z")


@dataclass(frozen=True, eq=False)
class Planned:
    """What a test would determine of the prior's modes that its torques move.

    Args:
        frequency: `(n,)` of the prior, root held [rad/s].
        damping: `(n,)` ratios.
        deviations: `(n, 3)` least relative standard deviations of frequency, damping and participation.
        determined: per mode, whether an identification would call it so.
        advice: sentences on what else the test needs.
    """

    frequency: Array
    damping: Array
    deviations: Array
    determined: tuple[bool, ...]
    advice: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        names = ("frequency", "damping", "determined", "frequency_std", "damping_std", "participation_std")
        w, z, std = self.frequency, self.damping, self.deviations.T
        columns = (w, z, self.determined, w * std[0], z * std[1], std[2])
        rows = zip(*(np.asarray(column).tolist() for column in columns), strict=True)
        return {"modes": [dict(zip(names, row, strict=True)) for row in rows], "advice": list(self.advice)}


def planned(
    torques: "str | Path | Mapping[str, Any]",
    craft: "str | Path | mujoco.MjSpec | mujoco.MjModel",
    at: str,
    *,
    prior: Any,
    noise: float,
    map: Mapping[str, str] | None = None,
) -> Planned:
    """What a log of these torques would determine of an appendage like the prior.

    The modes' frequencies, damping ratios and factors on their participation are found together with a factor on the
    rigid mass, the initial motion and the gyros' bias; nothing is believed beforehand. Rates are sampled with the torques.

    Args:
        torques: path or mapping of columns: `time` [s], and `torque_x|y|z` [N m] or an actuator's name.
        craft: the bare spacecraft, as in `bc.identify`.
        at: its site or body that carries the appendage.
        prior: SPEC.toml, Spec, beam or modes.
        noise: standard deviation of a gyro's sample [rad/s].
        map: column names of the file, and what they mean.

    Raises:
        InputError: the torques cannot be read or excite nothing, or the prior has no mode that they move.

    Example:
        >>> import beamchain as bc, numpy as np
        >>> from beamchain.craft.identification.planned import planned
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> beam = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> time = np.arange(0.0, 100.0, 0.05)
        >>> plan = {"time": time, "torque_z": np.sign(np.sin(2.0 * time))}
        >>> planned(plan, craft, "mount", prior=beam, noise=1e-6).determined[:2]
        (True, True)
    """
    sigma = positive("noise", noise, "rad/s")
    known = bare(craft, at)
    before = read_prior(prior, known.mass)
    log = read_torques(torques, map, list(known.actuators), RATES)
    names = active([log], list(log.torques))
    axes, sensors = driven(known, names, RATES, before)
    inputs = directions(known, names)
    sensors = [n for n in sensors if np.linalg.norm(directions(known, (n,)) @ axes) > 1e-6]
    outputs = directions(known, sensors)
    parts = before.parts
    which = seen_modes(parts, axes)
    if not which:
        raise InputError(f"the prior has no mode that {', '.join(names)} would move; drive another axis.")
    n = len(which)
    damping = np.where(parts.damping[which] > 0.0, parts.damping[which], UNKNOWN_DAMPING)

    def model(x: Array) -> Raw:
        own = Parts(
            parts.frequencies[which] * np.exp(x[:n]),
            damping * np.exp(x[n : 2 * n]),
            parts.participation[which] * np.exp(x[2 * n : 3 * n, None]),
            parts.rigid * np.exp(x[3 * n]),
            parts.hub,
        )
        return seen(own, inputs, outputs)

    nominal = model(np.zeros(3 * n + 1))
    drive, nothing = np.column_stack([log.torques[k] for k in names]), np.zeros((log.time.size, len(sensors)))
    piece = Piece(log.time, drive, nothing, nothing == 0.0, (False,) * len(sensors), even(log.time))
    piece = replace(piece, outputs=piece.forced(nominal))  # the free motion that is found beside it is none then
    weights = np.full(len(sensors), 1.0 / sigma)
    said, _ = piece.assess(nominal, weights, derivatives(lambda x: model(x).flat(), np.zeros(3 * n + 1)))
    deviations = np.sqrt(np.diag(inverse(said.matrix)))[: 3 * n].reshape(3, n).T
    limits = np.array([USEFUL_FREQUENCY, USEFUL_DAMPING, 1.0 / SIGNIFICANT])
    factors = np.max(deviations / limits, axis=1)
    free = np.sort(np.abs(nominal.poles))
    order = np.argsort(parts.frequencies[which])
    told = list(advice(free, factors[order].tolist(), axes, prior=True))
    half = np.pi / float(np.median(np.diff(log.time)))
    if free[-1] > half:
        told.append(f"modes above {half:.4g} rad/s, half the sample rate, would be folded; sample faster.")
    return Planned(parts.frequencies[which], damping, deviations, tuple(bool(f <= 1.0) for f in factors), tuple(told))
