"""A planar hub with an inextensible elastic rod in large motion, by Galerkin in the rod's angle: an oracle without chains.

The angle is `psi + sum q_k g_k(s)`, g polynomials that vanish at the root; positions are integrals of its cosine and
sine (Gauss points, exact for polynomials); Lagrange's equations by DOP853. No rotary inertia of sections.
"""

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp

POINTS = 40


class Elastica:
    """Hub (mass, inertia, root at `arm` on its x axis) with a uniform rod."""

    def __init__(self, mass, inertia, arm, length, per_length, bending, terms):
        self.mass, self.inertia, self.arm, self.terms = mass, inertia, arm, terms
        x, w = legendre.leggauss(POINTS)
        self.s, self.w = (x + 1.0) * length / 2.0, w * length / 2.0 * per_length
        # running integral of the interpolating polynomial: Legendre coefficients by quadrature, then integrated
        values = np.array([legendre.legval(x, np.eye(POINTS)[k]) for k in range(POINTS)])
        to_coefficients = (2.0 * np.arange(POINTS)[:, None] + 1.0) / 2.0 * values * w
        integrals = np.array([legendre.legval(x, legendre.legint(np.eye(POINTS)[k], lbnd=-1)) for k in range(POINTS)])
        self.run = integrals.T @ to_coefficients * length / 2.0
        shapes = [np.polynomial.Polynomial([0.0, 1.0]) * legendre.Legendre.basis(k, [0.0, 1.0]).convert(
            kind=np.polynomial.Polynomial) for k in range(terms)]  # fmt: skip
        u = self.s / length
        self.g = np.array([g(u) for g in shapes]).T
        slope = np.array([g.deriv()(u) for g in shapes]).T / length
        self.stiffness = bending * (slope.T * (w * length / 2.0)) @ slope

    def rates(self, state, moment):
        n = self.terms + 3
        q, v = state[:n], state[n:]
        psi, omega = q[2], v[2]
        angle, turning = psi + self.g @ q[3:], omega + self.g @ v[3:]
        sine, cosine = np.sin(angle), np.cos(angle)
        shapes = np.column_stack([np.ones(POINTS), self.g])  # d angle / d (psi, q)
        jx, jy = np.zeros((POINTS, n)), np.zeros((POINTS, n))
        jx[:, 0], jy[:, 1] = 1.0, 1.0
        jx[:, 2:] = self.run @ (-sine[:, None] * shapes)
        jy[:, 2:] = self.run @ (cosine[:, None] * shapes)
        jx[:, 2] -= self.arm * np.sin(psi)
        jy[:, 2] += self.arm * np.cos(psi)
        drift_x = -self.run @ (cosine * turning**2) - self.arm * np.cos(psi) * omega**2
        drift_y = -self.run @ (sine * turning**2) - self.arm * np.sin(psi) * omega**2
        m = jx.T @ (self.w[:, None] * jx) + jy.T @ (self.w[:, None] * jy)
        m[:3, :3] += np.diag([self.mass, self.mass, self.inertia])
        force = -(jx.T @ (self.w * drift_x) + jy.T @ (self.w * drift_y))
        force[2] += moment
        force[3:] -= self.stiffness @ q[3:]
        return np.concatenate([v, np.linalg.solve(m, force)])

    def turn(self, stretches, at):
        """`(t,)` angle of the hub at `at`, from rest, under (end, moment) stretches."""
        state, start, out = np.zeros(2 * (self.terms + 3)), 0.0, []
        for end, moment in stretches:
            inside = at[(at > start) & (at <= end)]
            solved = solve_ivp(
                lambda _, y, m=moment: self.rates(y, m), (start, end), state, t_eval=np.union1d(inside, [end]), method="DOP853",
                rtol=1e-9, atol=1e-12,
            )  # fmt: skip
            out.append(solved.y[2, : inside.size])
            state, start = solved.y[:, -1], end
        return np.concatenate(out)
