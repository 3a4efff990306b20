"""What is believed of the appendage before the log: its modes and rigid mass from a specification,
with their widths."""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from beamchain import ModalData, Spec
from beamchain.errors import InputError
from beamchain.identification.structure import Parts, rotation
from beamchain.toolkit import PORT_MOTION, PORTS, Array, as_spec

WIDTH = 0.3  # relative standard deviation of what the prior says, where it has no [uncertain]
DAMPING = 1.0  # the same of the logarithm of damping
# of a mode's whole participation: width of an element that the prior has as nearly zero, over WIDTH
SMALL = 0.1
UNKNOWN_DAMPING = 0.005  # where the prior has none
FAR = np.log(2.5)  # a prior mode whose frequency is off by more is another one
# part of the craft's inertia below which a prior mode does not turn the craft about an axis
SEEN = 1e-6


class Prior(NamedTuple):
    """A prior.

    Args:
        parts: modes and rigid mass; `hub` is that of the craft.
        widths: relative, of frequency, damping, participation and rigid mass.
        spec: the specification.
        chosen: modes that the specification itself keeps.
    """

    parts: Parts
    widths: tuple[float, ...]
    spec: Spec
    chosen: int | None


def read_prior(prior: Any, hub: Array) -> Prior:
    """The prior of a specification, its path, a beam or imported modes.

    Raises:
        InputError: it is none of these, or has no mode.
    """
    spec = as_spec(prior)
    data = (
        prior
        if isinstance(prior, ModalData)
        else spec.imported.read()
        if spec.imported is not None
        else None
    )
    if data is not None:
        kept = spec.imported.modes if spec.imported is not None else None
        data = data if kept is None else data.selected(kept)
        parts = Parts(data.frequencies, data.damping, data.participation, data.rigid_mass, hub)
        return Prior(parts, _widths(spec), spec, data.modes)
    rows = list[Array]()
    w = list[float]()
    z = list[float]()
    for port in PORTS:
        try:
            model = spec.with_ratios(port, spec.beam.port(port, modes=8).truncated(8))
        except InputError:
            continue  # rigid in this port
        w += model.frequencies.tolist()
        z += model.damping.tolist()
        rows += list(model.participation @ PORT_MOTION[port].T)
    if not w:
        raise InputError(
            f"prior {spec.name!r} has no elastic mode; give it the stiffness of a bending plane or "
            "torsion."
        )
    order = np.argsort(w, kind="stable")
    parts = Parts(
        np.array(w)[order], np.array(z)[order], np.array(rows)[order], spec.beam.rigid_mass(), hub
    )
    return Prior(parts, _widths(spec), spec, None)


def _widths(spec: Spec) -> tuple[float, ...]:
    def width(kind: str, other: float) -> float:
        return getattr(getattr(spec.uncertain, kind, None), "relative", None) or other

    return tuple(
        width(*one)
        for one in (
            ("frequency", WIDTH),
            ("damping", DAMPING),
            ("participation", WIDTH),
            ("density", WIDTH),
        )
    )


def visible_modes(parts: Parts, axes: Array) -> list[int]:
    """Modes that turn the craft about the axes."""
    turned = rotation(parts)
    root = np.linalg.cholesky(axes.T @ turned.inertia @ axes)
    share = np.linalg.norm(np.linalg.solve(root, (turned.moments @ axes).T), axis=0)
    return [j for j in range(parts.frequencies.size) if share[j] ** 2 > SEEN]


def free_modes(parts: Parts, axes: Array, which: list[int]) -> tuple[Array, Array]:
    """Frequencies and moments `(n, a)` of some modes, rotation held and translation free,
    in the order of the clamped ones."""
    turned = rotation(parts)
    squares, shapes = eigh(
        np.diag(parts.frequencies[which] ** 2), turned.modal[np.ix_(which, which)]
    )
    order = np.argsort(linear_sum_assignment(-np.abs(shapes.T))[1])
    return np.sqrt(squares)[order], ((shapes.T @ turned.moments[which]) @ axes)[order]


class Match(NamedTuple):
    """Prior modes and those of the model.

    Args:
        of: prior number of each mode of the model (-1: none).
        unseen: prior modes that do not turn the craft about a driven axis.
        missed: those that do, and are not in the model.
        frequencies, moments: of all prior modes, rotation held and translation free.
        kept: those in the model though the log does not show them.
    """

    of: list[int]
    unseen: list[int]
    missed: list[int]
    frequencies: Array
    moments: Array
    kept: tuple[int, ...] = ()

    def joined(self, mode: int, *, kept: bool) -> "Match":
        """With a missed mode of the prior as the last one of the model."""
        return self._replace(
            of=[*self.of, mode],
            missed=[j for j in self.missed if j != mode],
            kept=(*self.kept, mode) if kept else self.kept,
        )


def match_modes(
    prior: Prior, frequencies: Array, moments: Array, axes: Array, rigid: Array
) -> Match:
    """Which prior mode each found one is, by frequencies and moments `(n, a)` with rotation held
    and translation free.

    `rigid` `(6, 6)` is the rigid mass that the data suggest.
    """
    whole = prior.parts._replace(rigid=rigid)
    root = np.linalg.cholesky(axes.T @ rotation(whole).inertia @ axes)
    visible = visible_modes(whole, axes)
    w = np.array(whole.frequencies)
    own = rotation(whole).moments @ axes
    if visible:
        w[visible], own[visible] = free_modes(whole, axes, visible)
    known = np.linalg.solve(root, own[visible].T)
    found = np.linalg.solve(root, moments.T)
    share = np.linalg.norm(known, axis=0)
    size = np.linalg.norm(found, axis=0)[:, None]
    alike = np.abs(found.T @ known) / np.maximum(size * share, 1e-300)
    cost = (
        (np.log(frequencies[:, None] / w[visible]) / WIDTH) ** 2
        + np.log(size / share) ** 2
        + 8.0 * (1.0 - alike)
    )
    of = [-1] * frequencies.size
    for i, c in zip(*linear_sum_assignment(cost), strict=True):
        if abs(np.log(frequencies[i] / w[visible[c]])) < FAR:
            of[i] = visible[c]
    unseen = [j for j in range(w.size) if j not in visible]
    return Match(of, unseen, [j for j in visible if j not in of], w, own)
