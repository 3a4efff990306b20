"""Factors on a beam's stiffness, mass and joints that agree best with identified modes, as far as these determine them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec import structs
from scipy.optimize import least_squares

from beamchain.craft.identification.prior import Prior, free_modes, read_prior
from beamchain.craft.identification.structure import Parts, frozen_inertia, turning
from beamchain.fitting.spec import Spec
from beamchain.fitting.varied import scaled_segment
from beamchain.ports.motions import Array

UNKNOWN = 0.25  # relative standard deviation beyond which a factor is not determined
BELIEF = 1.0  # of the logarithms, so that what nothing determines stays at 1
JOINTS = ("stiffness_xy", "stiffness_xz", "stiffness_torsion")
MISFIT = 3.0  # standard deviations beyond which the beam itself is wrong
ROUGH = 0.03  # the same where a search starts
FLOOR = 1e-4  # relative accuracy to which a beam model is taken


@dataclass(frozen=True, eq=False)
class Update:
    """Scale factors of the prior beam.

    Args:
        factors: by name (stiffness, mass, joint_stiffness): the factor; 1 where it is not determined.
        std: their standard deviations; nan where not determined.
        ratio, ratio_std: of stiffness over mass.
        misfit: `(n,)` relative deviation of each identified frequency from the updated beam's.
        undetermined: sentences.
    """

    factors: dict[str, float]
    std: dict[str, float]
    ratio: float
    ratio_std: float
    misfit: Array
    undetermined: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "factors": self.factors,
            "std": self.std,
            "stiffness_over_mass": {"factor": self.ratio, "std": self.ratio_std},
            "misfit": self.misfit,
            "undetermined": list(self.undetermined),
        }


def scaled(spec: Spec, logs: Array) -> Spec:
    """The specification with logarithms of factors on stiffness, mass and, where there are joints, their stiffness."""
    e = np.exp(logs).tolist()
    changes: dict[str, Any] = {"segment": tuple(scaled_segment(s, e[0], e[1]) for s in spec.segment)}
    if len(e) > 2:
        changes["joint"] = tuple(
            structs.replace(j, **{n: v * e[2] for n in JOINTS if (v := getattr(j, n)) is not None}) for j in spec.joint
        )
    return structs.replace(spec, **changes)


def seen_of(parts: Parts, axes: Array, which: list[int]) -> Array:
    """Logarithms of frequencies and moments of some modes, rotation held and translation free, and of the inertia gained."""
    w, moments = free_modes(parts, axes, which)
    gained = float(np.trace(axes.T @ (turning(parts).inertia - frozen_inertia(parts.hub)) @ axes))
    return np.log(np.maximum(np.concatenate([w, np.linalg.norm(moments, axis=1), [gained]]), 1e-300))


def update(
    prior: Prior, of: list[int], wanted: Array, covariance: Array, axes: Array | None, moments: bool
) -> Update | None:
    """Factors on the prior beam.

    Args:
        prior: with a beam.
        of: prior mode of each identified one, -1 where there is none.
        wanted: logarithms of the frequencies, then of moments and of the inertia gained (where `moments`).
        covariance: of these.
        axes: `(3, a)`; None: the frequencies are those with the root held.
        moments: whether anything but frequencies is known.
    """
    if prior.spec.imported is not None or not any(j >= 0 for j in of):
        return None
    names = ["stiffness", "mass", *(["joint_stiffness"] if prior.spec.joint else [])]
    pick = [i for i, j in enumerate(of) if j >= 0]
    known = [*pick, *([len(of) + i for i in pick] + [2 * len(of)] if moments else [])]
    target = wanted[known]
    noise = np.linalg.cholesky(covariance[np.ix_(known, known)] + FLOOR**2 * np.eye(len(known)))

    def model(logs: Array) -> Array:
        parts = read_prior(scaled(prior.spec, logs), prior.parts.hub).parts
        if axes is None:
            return np.log(parts.frequencies[[of[i] for i in pick]])
        return seen_of(parts, axes, [of[i] for i in pick])[: len(known)]

    def residual(logs: Array) -> Array:
        left = [np.linalg.solve(noise, model(logs) - target), 1e-3 * logs / BELIEF]
        return np.concatenate(left, dtype=np.float64)

    def rough(logs: Array) -> Array:
        return np.concatenate([(model(logs) - target) / ROUGH, 1e-3 * logs / BELIEF])

    steps = np.ones(len(names))
    near = least_squares(rough, 0.0 * steps, diff_step=1e-4 * steps, max_nfev=15)
    # the median rather than the mean of contradictory modes
    found = least_squares(residual, near.x, loss="soft_l1", diff_step=1e-5 * steps, x_scale=1e-2, max_nfev=15)
    logs = np.asarray(found.x)
    left = residual(logs)[: len(known)]
    jacobian = np.array(
        [(residual(logs + step) - residual(logs - step)) / 2e-3 for step in 1e-3 * np.eye(len(names))]
    ).T[: len(known)]
    grown = max(1.0, float(left @ left) / max(len(known) - 1, 1))
    spread = np.linalg.inv(jacobian.T @ jacobian / grown + np.eye(len(names)) / BELIEF**2)
    sd = np.sqrt(np.diag(spread))
    ratio = np.zeros(len(names))
    ratio[:2] = 1.0, -1.0
    misfit = np.full(len(of), np.nan)
    misfit[pick] = np.expm1((target - model(logs))[: len(pick)])
    said = list[str]()
    open_ones = [name for name, s in zip(names, sd, strict=True) if s > UNKNOWN]
    ratio_sd = float(np.sqrt(ratio @ spread @ ratio))
    if open_ones:
        only = (
            "; only stiffness over mass can" if {"stiffness", "mass"} <= set(open_ones) and ratio_sd < UNKNOWN else ""
        )
        said.append(f"the beam's {' and '.join(open_ones)} cannot be told from these data{only}.")
    said += [
        f"mode {i + 1} lies {100 * misfit[i]:.2g} % off the updated beam, more than its accuracy: an error of the beam model, "
        "not of the factors."
        for i, value in zip(pick, left[: len(pick)], strict=True)
        if abs(value) > MISFIT
    ]
    values, told = np.exp(logs), float(np.exp(ratio @ logs))
    return Update(
        {n: 1.0 if n in open_ones else float(v) for n, v in zip(names, values, strict=True)},
        {n: np.nan if n in open_ones else float(v) for n, v in zip(names, values * sd, strict=True)},
        told,
        told * ratio_sd,
        misfit,
        tuple(said),
    )
