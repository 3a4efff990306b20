"""The coupled craft in physical parameters: clamped modes on a hub in free flight, physical at every value of them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from beamchain.craft.identification.response import Raw
from beamchain.ports.motions import Array, body_mass_matrix

LOOSE = 1e-3  # of the inertia
MOST = 0.999  # of a rigid inertia that the modes may hold where a search starts
TINY = 1e-12
LEAST = 1e-4  # of the seen inertia that a search starts with where modes seem to hold all of it


class Parts(NamedTuple):
    """An appendage: frequencies, damping `(n,)`, participation `(n, 6)`, rigid mass `(6, 6)`, the hub's mass `(6, 6)`."""

    frequencies: Array
    damping: Array
    participation: Array
    rigid: Array
    hub: Array


@dataclass(frozen=True, eq=False)
class Body:
    """What is known of the appendage's rigid mass: mass, centre and inertia about it, each with a factor to be found."""

    mass: float
    centre: Array
    inertia: Array

    count = 5

    def matrix(self, theta: Array) -> Array:
        """`(6, 6)` for logarithms of the factors on mass, centre and inertia about x, y, z."""
        e = np.diag(np.exp(theta[2:] / 2.0))
        return body_mass_matrix(self.mass * np.exp(theta[0]), self.centre * np.exp(theta[1]), e @ self.inertia @ e)


@dataclass(frozen=True, eq=False)
class Unknown:
    """Rigid mass of which only the inertia about some axes is seen: the rest is as little as there can be.

    Args:
        axes: `(3, a)` the axes, orthonormal.
        mass, centre: [kg], [m] along x, stated, not found.
        size: [kg m^2] unit of the inertia.
    """

    axes: Array
    mass: float
    centre: float
    size: float

    @property
    def count(self) -> int:
        """Of parameters."""
        a = self.axes.shape[1]
        return a * (a + 1) // 2

    def rest(self, theta: Array) -> Array:
        """`(a, a)` inertia about the axes that no mode takes part in, by its root with the diagonal's logarithms."""
        a = self.axes.shape[1]
        root = np.zeros((a, a))
        root[np.tril_indices(a)] = theta
        root[np.diag_indices(a)] = np.exp(np.diag(root))
        return self.size * root @ root.T

    def theta(self, rest: Array) -> Array:
        """The parameters of a rest `(a, a)`; what is negative of it is raised to a little."""
        values, vectors = np.linalg.eigh(rest / self.size)
        root = np.linalg.cholesky((vectors * np.maximum(values, LEAST)) @ vectors.T)
        root[np.diag_indices(root.shape[0])] = np.log(np.diag(root))
        return root[np.tril_indices(root.shape[0])]

    @property
    def arm(self) -> Array:
        """`(a, a)` what the stated mass adds to the inertia about the axes."""
        square = self.mass * self.centre**2
        return self.axes.T @ np.diag([0.0, square, square]) @ self.axes

    def matrix(self, moments: Array, theta: Array) -> Array:
        """`(6, 6)` with modes of these moments `(n, a)` about the axes."""
        seen = moments.T @ moments + self.rest(theta)
        other = np.eye(3) - self.axes @ self.axes.T
        about = self.axes @ seen @ self.axes.T + np.trace(seen) / seen.shape[0] * other
        return body_mass_matrix(self.mass, np.array([self.centre, 0.0, 0.0]), about)


@dataclass(frozen=True, eq=False)
class Structure:
    """Parameters of the coupled craft: logarithms of frequencies and damping, shares, rigid mass, factors on the hub.

    With a known body, shares X make the participation L = X (1 + X^T X)^(-1/2) R^T of the root R R^T of the rigid mass,
    so that the residual mass R R^T - L^T L is positive whatever X is. With an unknown one, the rigid mass is that
    of the modes and a positive rest.

    Args:
        hub: `(6, 6)` about the mount, in its axes.
        inputs, outputs: `(m, 3)`, `(p, 3)` directions of torques and of rates.
        live: `(n, 6)` which participations are parameters.
        body: rigid mass of the appendage.
        scaled: `(3, b)` axes about which the hub's inertia is a parameter too.
    """

    hub: Array
    inputs: Array
    outputs: Array
    live: NDArray[np.bool_]
    body: Body | Unknown
    scaled: Array

    @property
    def modes(self) -> int:
        """How many."""
        return self.live.shape[0]

    @property
    def places(self) -> tuple[slice, slice, slice, slice, slice]:
        """Of frequencies, damping, shares, rigid mass and hub among the parameters."""
        n, x = self.modes, int(self.live.sum())
        ends = np.cumsum([0, n, n, x, self.body.count, self.scaled.shape[1]]).tolist()
        return tuple(slice(a, b) for a, b in zip(ends, ends[1:], strict=False))  # pyright: ignore[reportReturnType]

    def parts(self, theta: Array) -> Parts:
        """The appendage and the hub at parameters."""
        w, z, x, r, h = (theta[place] for place in self.places)
        shares = np.zeros((self.modes, 6))
        shares[self.live] = x
        if isinstance(self.body, Unknown):
            moments = shares[:, 3 : 3 + self.body.axes.shape[1]] * np.sqrt(self.body.size)
            rigid = self.body.matrix(moments, r)
            rows = np.hstack([np.zeros((self.modes, 3)), moments @ self.body.axes.T])
        else:
            rigid = self.body.matrix(r)
            values, vectors = np.linalg.eigh(np.eye(6) + shares.T @ shares)
            rows = shares @ (vectors / np.sqrt(values)) @ vectors.T @ self._root(rigid).T
        turn = np.eye(6)
        turn[3:, 3:] += (self.scaled * (np.exp(h / 2.0) - 1.0)) @ self.scaled.T
        return Parts(np.exp(w), np.exp(z), rows, rigid, _about_centre(self.hub, turn))

    def _root(self, rigid: Array) -> Array:
        used = self.live.any(axis=0)
        own = np.zeros((6, 6))
        block = rigid[np.ix_(used, used)]
        own[np.ix_(used, used)] = np.linalg.cholesky(block + TINY * np.diag(np.diag(block)))
        return own

    def theta(self, parts: Parts, rigid: Array) -> Array:
        """Parameters of frequencies, damping and participation, the last cut where it is more than the rigid mass allows.

        Args:
            parts: what is wanted; its rigid mass and hub are not used.
            rigid: parameters of the rigid mass.
        """
        shares = np.zeros((self.modes, 6))
        if isinstance(self.body, Unknown):
            axes = self.body.axes
            shares[:, 3 : 3 + axes.shape[1]] = parts.participation[:, 3:] @ axes / np.sqrt(self.body.size)
        else:
            rows = parts.participation @ np.linalg.pinv(self._root(self.body.matrix(rigid))).T
            left, values, right = np.linalg.svd(rows, full_matrices=False)
            values = np.minimum(values, MOST)
            shares = (left * (values / np.sqrt(1.0 - values**2))) @ right
        z = np.log(np.clip(parts.damping, 1e-6, 0.5))
        return np.concatenate([np.log(parts.frequencies), z, shares[self.live], rigid, np.zeros(self.scaled.shape[1])])

    def loosened(self, theta: Array) -> Array:
        """The parameters with a little inertia left to no mode, for sensitivities: at the limit itself they would vanish."""
        out, (_, _, x, r, _) = theta.copy(), self.places
        shares = np.zeros((self.modes, 6))
        shares[self.live] = theta[x]
        if isinstance(self.body, Unknown):
            moments = shares[:, 3 : 3 + self.body.axes.shape[1]] * np.sqrt(self.body.size)
            rest = self.body.rest(theta[r])
            least = LOOSE * float(np.trace(moments.T @ moments + rest)) / rest.shape[0]
            values, vectors = np.linalg.eigh(rest)
            out[r] = self.body.theta((vectors * np.maximum(values, least)) @ vectors.T)
        else:
            left, values, right = np.linalg.svd(shares, full_matrices=False)
            out[x] = ((left * np.minimum(values, np.sqrt(1.0 / LOOSE - 1.0))) @ right)[self.live]
        return out

    def raw(self, theta: Array) -> Raw:
        """What the data see of it."""
        return seen(self.parts(theta), self.inputs, self.outputs)


def _square_root(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def _about_centre(mass: Array, turn: Array) -> Array:
    """A hub's mass matrix with its inertia about the mass centre changed by a congruence."""
    m = mass[0, 0]
    x, y, z = np.array([mass[1, 5], mass[2, 3], mass[0, 4]]) / m
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    out = mass.copy()
    own = mass[3:, 3:] + m * cross @ cross
    out[3:, 3:] += turn[3:, 3:] @ own @ turn[3:, 3:].T - own
    return out


class Turning(NamedTuple):
    """The craft's rotation with free translation eliminated: inertia `(3, 3)`, modes' moments `(n, 3)`, modal mass `(n, n)`."""

    inertia: Array
    moments: Array
    modal: Array


def turning(parts: Parts) -> Turning:
    """The equations of rotation of the free craft."""
    whole, rows = parts.hub + parts.rigid, parts.participation
    back = np.linalg.solve(whole[:3, :3], np.hstack([whole[:3, 3:], rows[:, :3].T]))
    inertia = whole[3:, 3:] - whole[3:, :3] @ back[:, :3]
    return Turning(inertia, rows[:, 3:] - rows[:, :3] @ back[:, :3], np.eye(rows.shape[0]) - rows[:, :3] @ back[:, 3:])


def frozen_inertia(hub: Array, rigid: Array | None = None) -> Array:
    """`(3, 3)` inertia against rotation of the free craft with a hub and a rigid appendage, or none."""
    none = np.zeros((6, 6)) if rigid is None else rigid
    return turning(Parts(np.zeros(0), np.zeros(0), np.zeros((0, 6)), none, hub)).inertia


def seen(parts: Parts, inputs: Array, outputs: Array) -> Raw:
    """The free craft's poles and residues of rates per torque."""
    inertia, moments, modal = turning(parts)
    n, w = parts.frequencies.size, parts.frequencies
    mass = np.block([[inertia, moments.T], [moments, modal]])
    force = np.zeros((3 + n, 3 + 2 * n))
    force[3:, 3 : 3 + n], force[3:, 3 + n :] = -np.diag(2.0 * parts.damping * w), -np.diag(w)
    system = np.vstack([np.linalg.solve(mass, force), np.zeros((n, 3 + 2 * n))])
    system[3 + n :, 3 : 3 + n] = np.diag(w)  # the last states are frequency times deflection
    drive = np.vstack(
        [np.linalg.solve(mass, np.vstack([inputs.T, np.zeros((n, inputs.shape[0]))])), np.zeros((n, inputs.shape[0]))]
    )
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
    return Raw(values[up], residues, shapes / top[:, None], outputs @ np.linalg.solve(inertia, inputs.T))


def clamped(raw: Raw, inputs: Array, outputs: Array, axes: Array) -> tuple[Array, Array, Array, Array]:
    """Modes with the craft's rotation about `axes` held, from those of the free craft; damping is carried over as loss.

    Args:
        raw: of the data.
        inputs, outputs: `(m, 3)`, `(p, 3)` directions.
        axes: `(3, a)`.

    Returns:
        Total inertia `(a, a)`, frequencies, damping `(n,)` and moments `(n, a)`.
    """
    to_out, to_in = np.linalg.pinv(outputs @ axes), np.linalg.pinv((inputs @ axes).T)
    rigid = to_out @ raw.rigid @ to_in
    values, vectors = np.linalg.eigh((rigid + rigid.T) / 2.0)
    values = np.maximum(values, 1e-6 * float(values[-1]))
    inertia = (vectors / values) @ vectors.T
    own = [2.0 * (to_out @ g @ to_in).real for g in raw.residues]
    powers, directions = np.linalg.eigh(
        np.array([(g + g.T) / 2.0 for g in own]).reshape(-1, axes.shape[1], axes.shape[1])
    )
    least = LEAST * float(np.max(powers, initial=0.0))  # a mode without any moment would stay so
    rows = np.sqrt(np.maximum(powers[:, -1:], least)) * directions[:, :, -1]
    n, a = raw.poles.size, axes.shape[1]
    frozen = _square_root((vectors * values) @ vectors.T)
    port = np.vstack([frozen, rows])
    free = null_space(port.T)
    omega = np.abs(raw.poles)
    stiffness = np.diag(np.concatenate([np.zeros(a), omega**2]))
    damping = np.diag(np.concatenate([np.zeros(a), -2.0 * raw.poles.real]))
    squares, modes = np.linalg.eigh(free.T @ stiffness @ free)
    shapes = free @ modes
    w = np.sqrt(np.maximum(squares, 1e-12))
    ratio = np.einsum("ik,ij,jk->k", shapes, damping, shapes) / (2.0 * w)
    moments = shapes.T @ np.vstack([np.linalg.inv(frozen), np.zeros((n, a))])
    return inertia, w, ratio, moments
