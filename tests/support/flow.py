"""Potential flow in a cylinder by Galerkin's method with polynomials: the truth for liquids.

Laplace's equation for `phi(r, x) cos(alpha)` in `0 < r < R`, `0 < x < h`, with no Bessel function
in it: products of r times a polynomial of r^2 and a polynomial of x. It converges exponentially.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh


def _basis(points, count):
    """Legendre polynomials at points of [-1, 1], and their slopes."""
    eye = np.eye(count)
    values = np.array([legendre.legval(points, row) for row in eye])
    slopes = np.array([legendre.legval(points, legendre.legder(row)) for row in eye])
    return values, slopes


@dataclass
class Flow:
    """A liquid of density 1: lateral motion y and pitch about the bottom's centre."""

    radius: float
    height: float
    across: int = 18
    along: int = 18

    def __post_init__(self):
        radius, height = self.radius, self.height
        t, w = legendre.leggauss(60)
        r, wr = radius * (1.0 + t) / 2.0, w * radius / 2.0
        x, wx = height * (1.0 + t) / 2.0, w * height / 2.0

        def radial(r):
            value, slope = _basis(2.0 * (r / radius) ** 2 - 1.0, self.across)
            return r * value, value + r * slope * 4.0 * r / radius**2

        def axial(x):
            value, slope = _basis(2.0 * x / height - 1.0, self.along)
            return value, slope * 2.0 / height

        f, df = radial(r)
        g, dg = axial(x)
        stretch = np.einsum("ir,jr,r->ij", df, df, wr * r) + np.einsum("ir,jr,r->ij", f, f, wr / r)
        lying = np.einsum("ir,jr,r->ij", f, f, wr * r)
        standing = np.einsum("ix,jx,x->ij", g, g, wx)
        bending = np.einsum("ix,jx,x->ij", dg, dg, wx)
        size = self.across * self.along
        self.stiff = np.pi * (
            np.einsum("ij,kl->ikjl", stretch, standing) + np.einsum("ij,kl->ikjl", lying, bending)
        ).reshape(size, size)
        edge = radial(np.array([radius]))[0][:, 0]
        bottom, top = axial(np.array([0.0]))[0][:, 0], axial(np.array([height]))[0][:, 0]
        self.surface = np.pi * np.einsum("ij,k,l->ikjl", lying, top, top).reshape(size, size)
        arm = np.einsum("ir,r->i", f, wr * r * r)
        # normal velocity of the walls, n_y and x n_y - y n_x, n outwards of the liquid
        sway = np.outer(edge * radius, g @ wx)
        pitch = np.outer(edge * radius, g @ (wx * x)) + np.outer(arm, bottom)
        self.walls = np.pi * np.stack([sway.ravel(), pitch.ravel()], axis=1)
        lid = np.pi * np.outer(arm, top).ravel()
        self.locked = self.walls - np.stack([np.zeros(size), lid], axis=1)  # with a lid that moves
        self.aside = lid  # of the surface

    @property
    def mass(self):
        return np.pi * self.radius**2 * self.height

    def rigid(self):
        """`(2, 2)` mass matrix under a locked surface."""
        return self.locked.T @ np.linalg.solve(self.stiff, self.locked)

    def modes(self, count):
        """`w^2 / a`, masses and heights of the first modes of the surface with the tank held."""
        # a^2 phi T = kappa^-1 A phi: the surface is of low rank
        values, shapes = eigh(self.surface, self.stiff)
        kappa = 1.0 / values[::-1][:count]
        shapes = shapes[:, ::-1][:, :count] * np.sqrt(
            kappa
        )  # of unit kinetic energy of the surface
        # momentum of a mode: of the locked flow with the surface's motion d phi / dx = kappa phi
        locked = np.linalg.solve(self.stiff, self.locked)
        parts = (locked.T @ self.surface @ shapes) * np.sqrt(kappa)
        return kappa, parts[0] ** 2, parts[1] / parts[0]

    def dynamic_mass(self, s, acceleration):
        """`(2, 2)` wrench per acceleration of the tank in a uniform field along -x that does not
        turn with it."""
        flow = self.walls.T @ np.linalg.solve(
            self.stiff + s**2 / acceleration * self.surface, self.walls
        )
        weight = acceleration * self.mass * (self.height / 2.0 + self.radius**2 / 4.0 / self.height)
        return flow - np.diag([0.0, weight]) / s**2
