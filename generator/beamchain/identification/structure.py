"""The coupled craft in physical parameters: clamped modes on a hub in free flight,
physical at every value of them.

A log without a prior leaves force and mass open:
the appendage is then a rotational inertia about the axes that are driven.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from beamchain.identification.response import Raw
from beamchain.toolkit import Array, body_mass_matrix

LOOSE = 1e-3  # of the inertia
MOST = 0.999  # of a rigid inertia that the modes may hold where a search starts
TINY = 1e-12
MOST_DELAY = 20.0  # steps
LEAST = 1e-4  # of the seen inertia that a search starts with where modes seem to hold all of it


class Parts(NamedTuple):
    """An appendage: frequencies, damping `(n,)`, participation `(n, 6)`, rigid mass `(6, 6)`,
    the hub's mass `(6, 6)`."""

    frequencies: Array
    damping: Array
    participation: Array
    rigid: Array
    hub: Array


@dataclass(frozen=True, eq=False)
class Body:
    """What is known of the appendage's rigid mass: mass, centre and inertia about it,
    each with a factor to be found."""

    mass: float
    centre: Array
    inertia: Array

    count = 5

    def matrix(self, theta: Array) -> Array:
        """`(6, 6)` for logarithms of the factors on mass, centre and inertia about x, y, z."""
        e = np.diag(np.exp(theta[2:] / 2.0))
        return body_mass_matrix(
            self.mass * np.exp(theta[0]), self.centre * np.exp(theta[1]), e @ self.inertia @ e
        )


@dataclass(frozen=True, eq=False)
class Unknown:
    """Rigid mass of which only the inertia about some axes is seen; all else of it is zero.

    Args:
        axes: `(3, a)` the axes, orthonormal.
        size: [kg m^2] unit of the inertia.
    """

    axes: Array
    size: float

    @property
    def count(self) -> int:
        """Of parameters."""
        a = self.axes.shape[1]
        return a * (a + 1) // 2

    def rest(self, theta: Array) -> Array:
        """`(a, a)` inertia about the axes that no mode takes part in,
        by its root with the diagonal's logarithms."""
        a = self.axes.shape[1]
        root = np.zeros((a, a))
        root[np.tril_indices(a)] = theta
        root[np.diag_indices(a)] = np.exp(np.diag(root))
        return self.size * root @ root.T

    def theta(self, rest: Array) -> Array:
        """The parameters of a rest `(a, a)`; what is negative of it is raised to a little."""
        root = np.asarray(
            np.linalg.cholesky(raise_eigenvalues(rest / self.size, LEAST)), dtype=np.float64
        )
        root[np.diag_indices(root.shape[0])] = np.log(np.diag(root))
        return root[np.tril_indices(root.shape[0])]

    def matrix(self, moments: Array, theta: Array) -> Array:
        """`(6, 6)` with modes of these moments `(n, a)` about the axes."""
        rigid = np.zeros((6, 6))
        rigid[3:, 3:] = self.axes @ (moments.T @ moments + self.rest(theta)) @ self.axes.T
        return rigid


@dataclass(frozen=True, eq=False)
class Structure:
    """Parameters of the coupled craft: logarithms of frequencies and damping, shares, rigid mass,
    and the delay of the torques.

    With a known body, shares X make the participation L = X (1 + X^T X)^(-1/2) R^T of the root R
    R^T of the rigid mass, so that the residual mass R R^T - L^T L is positive whatever X is. With
    an unknown one, the rigid mass is that of the modes and a positive rest.

    Args:
        hub: `(6, 6)` about the mount, in its axes.
        inputs, outputs: `(m, 3)`, `(p, 3)` directions of torques and of rates.
        live: `(n, 6)` which participations are parameters.
        body: rigid mass of the appendage.
        step: [s] unit of the delay.
    """

    hub: Array
    inputs: Array
    outputs: Array
    live: NDArray[np.bool_]
    body: Body | Unknown
    step: float

    @property
    def modes(self) -> int:
        """How many."""
        return self.live.shape[0]

    @property
    def places(self) -> tuple[slice, slice, slice, slice, slice]:
        """Of frequencies, damping, shares, rigid mass and the delay among the parameters."""
        n = self.modes
        x = int(self.live.sum())
        ends = np.cumsum([0, n, n, x, self.body.count, 1]).tolist()
        return tuple(slice(a, b) for a, b in zip(ends, ends[1:], strict=False))  # pyright: ignore[reportReturnType]

    def parts(self, theta: Array) -> Parts:
        """The appendage and the hub at parameters."""
        w, z, x, r, _ = (theta[place] for place in self.places)
        shares = self._shares(x)
        if isinstance(self.body, Unknown):
            moments = self._moments(self.body, shares)
            rigid = self.body.matrix(moments, r)
            rows = np.hstack([np.zeros((self.modes, 3)), moments @ self.body.axes.T])
        else:
            rigid = self.body.matrix(r)
            values, vectors = np.linalg.eigh(np.eye(6) + shares.T @ shares)
            rows = shares @ (vectors / np.sqrt(values)) @ vectors.T @ self._root(rigid).T
        return Parts(np.exp(w), np.exp(z), rows, rigid, self.hub)

    def _shares(self, x: Array) -> Array:
        out = np.zeros((self.modes, 6))
        out[self.live] = x
        return out

    def _moments(self, body: Unknown, shares: Array) -> Array:
        """`(n, a)` about the axes."""
        return shares[:, 3 : 3 + body.axes.shape[1]] * np.sqrt(body.size)

    def _root(self, rigid: Array) -> Array:
        used = self.live.any(axis=0)
        own = np.zeros((6, 6))
        block = rigid[np.ix_(used, used)]
        own[np.ix_(used, used)] = np.linalg.cholesky(block + TINY * np.diag(np.diag(block)))
        return own

    def delay(self, theta: Array) -> float:
        """[s] at parameters."""
        return delay_of_steps(theta[-1], self.step)

    def theta(self, parts: Parts, rigid: Array, delay: float) -> Array:
        """Parameters of frequencies, damping, participation and delay [s],
        the participation cut where it is more than the rigid mass allows.

        The rigid mass and the hub of `parts` are not used;
        `rigid` holds the parameters of the rigid mass.
        """
        shares = np.zeros((self.modes, 6))
        if isinstance(self.body, Unknown):
            axes = self.body.axes
            shares[:, 3 : 3 + axes.shape[1]] = (
                parts.participation[:, 3:] @ axes / np.sqrt(self.body.size)
            )
        else:
            rows = parts.participation @ np.linalg.pinv(self._root(self.body.matrix(rigid))).T
            left, values, right = np.linalg.svd(rows, full_matrices=False)
            values = np.minimum(values, MOST)
            shares = (left * (values / np.sqrt(1.0 - values**2))) @ right
        z = np.log(np.clip(parts.damping, 1e-6, 0.5))
        late = [delay / self.step]
        return np.concatenate([np.log(parts.frequencies), z, shares[self.live], rigid, late])

    def loosen(self, theta: Array) -> Array:
        """The parameters with a little inertia left to no mode, for sensitivities:
        at the limit itself they would vanish."""
        out, (_, _, x, r, _) = theta.copy(), self.places
        shares = self._shares(theta[x])
        if isinstance(self.body, Unknown):
            moments = self._moments(self.body, shares)
            rest = self.body.rest(theta[r])
            least = LOOSE * float(np.trace(moments.T @ moments + rest)) / rest.shape[0]
            out[r] = self.body.theta(raise_eigenvalues(rest, least))
        else:
            left, values, right = np.linalg.svd(shares, full_matrices=False)
            out[x] = ((left * np.minimum(values, np.sqrt(1.0 / LOOSE - 1.0))) @ right)[self.live]
        return out

    def raw(self, theta: Array) -> Raw:
        """What the data see of it."""
        raw = raw_model(self.parts(theta), self.inputs, self.outputs)
        return raw._replace(delay=self.delay(theta))


def delay_of_steps(value: float, step: float) -> float:
    """[s] a delay of so many steps.

    Raises:
        ValueError: it is longer than any that is sought.
    """
    if abs(value) > MOST_DELAY:
        raise ValueError("delay")
    return step * float(value)


def raise_eigenvalues(matrix: Array, least: float) -> Array:
    """A symmetric matrix with no eigenvalue below `least`."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.maximum(values, least)) @ vectors.T


def body_of(matrix: Array) -> tuple[float, Array, Array]:
    """Mass, centre and inertia about it, of a rigid mass `(6, 6)`,
    as `body_mass_matrix` takes them."""
    mass = float(np.trace(matrix[:3, :3])) / 3.0
    coupling = matrix[3:, :3] - matrix[:3, 3:]
    centre = np.array([coupling[2, 1], coupling[0, 2], coupling[1, 0]]) / (2.0 * mass)
    about = matrix[3:, 3:] - body_mass_matrix(mass, centre, np.zeros((3, 3)))[3:, 3:]
    return mass, centre, (about + about.T) / 2.0


class Rotation(NamedTuple):
    """The craft's rotation with free translation eliminated: inertia `(3, 3)`,
    modes' moments `(n, 3)`, modal mass `(n, n)`."""

    inertia: Array
    moments: Array
    modal: Array


def rotation(parts: Parts) -> Rotation:
    """The equations of rotation of the free craft."""
    whole = parts.hub + parts.rigid
    rows = parts.participation
    back = np.linalg.solve(whole[:3, :3], np.hstack([whole[:3, 3:], rows[:, :3].T]))
    inertia = whole[3:, 3:] - whole[3:, :3] @ back[:, :3]
    return Rotation(
        inertia,
        rows[:, 3:] - rows[:, :3] @ back[:, :3],
        np.eye(rows.shape[0]) - rows[:, :3] @ back[:, 3:],
    )


def frozen_inertia(hub: Array, rigid: Array | None = None) -> Array:
    """`(3, 3)` inertia against rotation of the free craft with a hub and a rigid
    appendage, or none."""
    none = np.zeros((6, 6)) if rigid is None else rigid
    return rotation(Parts(np.zeros(0), np.zeros(0), np.zeros((0, 6)), none, hub)).inertia


def raw_model(parts: Parts, inputs: Array, outputs: Array) -> Raw:
    """The free craft's poles and residues of rates per torque."""
    inertia, moments, modal = rotation(parts)
    n = parts.frequencies.size
    w = parts.frequencies
    mass = np.block([[inertia, moments.T], [moments, modal]])
    force = np.zeros((3 + n, 3 + 2 * n + len(inputs)))  # of the states, and of the torques
    force[3:, 3 : 3 + n], force[3:, 3 + n : 3 + 2 * n] = (
        -np.diag(2.0 * parts.damping * w),
        -np.diag(w),
    )
    force[:3, 3 + 2 * n :] = inputs.T
    system = np.vstack([np.linalg.solve(mass, force), np.zeros((n, force.shape[1]))])
    system[3 + n :, 3 : 3 + n] = np.diag(w)  # the last states are frequency times deflection
    system, drive = np.split(system, [3 + 2 * n], axis=1)
    values, vectors = (np.asarray(part, dtype=np.complex128) for part in np.linalg.eig(system))
    left = np.linalg.solve(vectors, drive.astype(np.complex128))
    up = np.flatnonzero(values.imag > 1e-9 * float(np.max(np.abs(values), initial=1e-300)))
    up = up[np.argsort(values[up].imag)]
    if up.size != n:
        raise ValueError("overdamped")
    shapes = (outputs @ vectors[:3, up]).T
    residues = shapes[:, :, None] * left[up][:, None, :]
    top = shapes[np.arange(n), np.argmax(np.abs(shapes), axis=1)]
    top = np.where(np.abs(top) > 0.0, top, 1.0)
    return Raw(
        values[up], residues, shapes / top[:, None], outputs @ np.linalg.solve(inertia, inputs.T)
    )


def clamp(
    raw: Raw, inputs: Array, outputs: Array, axes: Array
) -> tuple[Array, Array, Array, Array]:
    """Modes with the craft's rotation about `axes` `(3, a)` held, from those of the free craft;
    damping is carried over as loss.

    Returns:
        Total inertia `(a, a)`, frequencies, damping `(n,)` and moments `(n, a)`.
    """
    to_out = np.linalg.pinv(outputs @ axes)
    to_in = np.linalg.pinv((inputs @ axes).T)
    rigid = to_out @ raw.rigid @ to_in
    values, vectors = np.linalg.eigh((rigid + rigid.T) / 2.0)
    values = np.maximum(values, 1e-6 * float(values[-1]))
    own = (to_out @ raw.residues @ to_in).real
    powers, directions = np.linalg.eigh(own + own.transpose(0, 2, 1))
    least = LEAST * float(np.max(powers, initial=0.0))  # a mode without any moment would stay so
    rows = np.sqrt(np.maximum(powers[:, -1:], least)) * directions[:, :, -1]
    a = axes.shape[1]
    free = null_space(np.vstack([(vectors * np.sqrt(values)) @ vectors.T, rows]).T)
    turned, swung = free[:a], free[a:]
    squares, modes = np.linalg.eigh(swung.T @ (np.abs(raw.poles)[:, None] ** 2 * swung))
    w = np.sqrt(np.maximum(squares, 1e-12))
    ratio = -raw.poles.real @ (swung @ modes) ** 2 / w
    moments = (turned @ modes).T @ (vectors / np.sqrt(values)) @ vectors.T
    return (vectors / values) @ vectors.T, w, ratio, moments
