"""One step of a linear model, exactly as each integrator takes it: its matrix, its poles, its largest stable step.

`M q'' + D q' + K q = 0` with any symmetric damping. The semi-implicit integrators solve

    (M + h Di + h^2 Ki) v+ = (M - h De) v - h K q,   q+ = q + h v+,

where `Di` is the damping the integrator treats implicitly, `De = D - Di` the rest, and `Ki` the implicit stiffness
("discrete" only; `Ki = K` for joint springs).
A pole z of the step belongs to `a z^2 - (a + c - h^2 k) z + c = 0` with `a = m + h di + h^2 ki`, `c = m - h de` for
some shape x (small letters: x* M x ...). For symmetric matrices it leaves the unit circle at z = -1, which is where
`2 (A + C) - h^2 K` first turns singular: `4 M + 2 h (Di - De) + h^2 (2 Ki - K)`, a quadratic eigenvalue problem in 1/h
whose roots are all real. So the limit needs no search and holds for damping that couples the modes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, linear_sum_assignment

from beamchain.assess.stability import INTEGRATORS
from beamchain.checks import one_of
from beamchain.errors import EngineError
from beamchain.motion import Array
from beamchain.steps.discrete import runge_kutta_limit

Poles = NDArray[np.complex128]

AT_REST = 1e-5  # poles nearer to 1 than this are rigid motion: a double pole at 1 moves by the root of the rounding
MOST_CONFIRMED = 40  # times a step is shortened until the poles of the whole step confirm it
CONFIRMED = 0.98  # by as much
RIGID = 1e-11  # squared frequency, relative to the largest, below which a motion has no spring


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A linear model in units of its own mass matrix.

    Args:
        stiffness: `(nv, nv)` `M^-1 K` [1/s^2].
        damping: `(nv, nv)` `M^-1 D`, all of it [1/s].
        euler_damping: `(nv, nv)` the share of `damping` that Euler integrates implicitly (that of joints).
        discrete_stiffness: `(nv, nv)` the share of `stiffness` that "discrete" integrates implicitly.
        discrete_tendons: `(nv, nv)` the share of fixed tendons, whose springs "discrete" takes implicitly for the force
            of the position alone; None: there are none.
        preload: what pulls at the rest pose, as a sentence; empty: nothing.
    """

    stiffness: Array
    damping: Array
    euler_damping: Array
    discrete_stiffness: Array
    discrete_tendons: Array | None = None
    preload: str = ""

    def poles(self) -> Poles:
        """`(2 nv,)` poles of the continuous system [1/s]."""
        n = self.stiffness.shape[0]
        f = np.block([[np.zeros((n, n)), np.eye(n)], [-self.stiffness, -self.damping]])
        return np.asarray(np.linalg.eigvals(f), dtype=np.complex128)

    def _parts(self, integrator: str) -> tuple[Array, Array, Array]:
        """Implicit damping, explicit damping, implicit stiffness."""
        nothing = np.zeros_like(self.stiffness)
        if integrator == "Euler":
            return self.euler_damping, self.damping - self.euler_damping, nothing
        if integrator != "discrete":
            return self.damping, nothing, nothing
        tendons = 0.0 if self.discrete_tendons is None else self.discrete_tendons
        return self.damping, nothing, self.discrete_stiffness + tendons

    def step(self, integrator: str, timestep: float) -> Array:
        """`(2 nv, 2 nv)` one step in the states (q, h v), so that all entries are pure numbers.

        Args:
            integrator: MuJoCo's name; "RK4" is also what a host with an explicit Runge-Kutta of order 4 takes.
            timestep: [s].
        """
        one_of("integrator", integrator, INTEGRATORS)
        h, n = timestep, self.stiffness.shape[0]
        eye = np.eye(n)
        if integrator == "RK4":
            f = np.block([[np.zeros((n, n)), eye], [-(h**2) * self.stiffness, -h * self.damping]])
            out, term = np.eye(2 * n), np.eye(2 * n)
            for k in range(1, 5):
                term = term @ f / k
                out = out + term
            return np.asarray(out, dtype=np.float64)
        implicit, explicit, spring = self._parts(integrator)
        solved = np.linalg.solve(
            eye + h * implicit + h**2 * spring, np.hstack([h**2 * self.stiffness, eye - h * explicit])
        )
        pull, keep = solved[:, :n], solved[:, n:]
        if integrator == "discrete" and self.discrete_tendons is not None:
            keep = np.linalg.solve(eye + h * implicit + h**2 * self.discrete_stiffness, eye - h * explicit)
        return np.asarray(np.block([[eye - pull, keep], [-pull, keep]]), dtype=np.float64)

    def spectral_radius(self, integrator: str, timestep: float) -> float:
        """Largest modulus of a pole of the step, rigid motion left out."""
        poles = np.linalg.eigvals(self.step(integrator, timestep))
        return float(np.max(np.abs(poles[np.abs(poles - 1.0) > AT_REST]), initial=0.0))

    def largest_step(self, integrator: str) -> float:
        """Largest stable step [s]; infinity where there is none.

        Raises:
            EngineError: the model falls over by itself (negative stiffness or damping): no step is stable.
        """
        one_of("integrator", integrator, INTEGRATORS)
        poles = self.poles()
        fastest = float(np.max(np.abs(poles), initial=0.0))
        if np.any(poles.real > 1e-5 * fastest):
            raise EngineError(
                self.preload
                or f"the model is unstable about its rest pose at any step (a pole at {np.max(poles.real):.3g} 1/s): "
                "a spring or damper is negative, or gravity tips it over; linearise it about a stable pose."
            )
        if integrator == "RK4":
            return min((runge_kutta_limit(p) for p in poles[np.abs(poles) > 1e-5 * fastest]), default=float("inf"))
        implicit, explicit, spring = self._parts(integrator)
        n = self.stiffness.shape[0]
        companion = np.block(
            [
                [np.zeros((n, n)), np.eye(n)],
                [(self.stiffness - 2.0 * spring) / 4.0, (explicit - implicit) / 2.0],
            ]
        )
        inverse = np.linalg.eigvals(companion)
        real = inverse.real[(np.abs(inverse.imag) <= 1e-6 * np.abs(inverse)) & (inverse.real > 1e-9 * fastest)]
        return 1.0 / float(np.max(real)) if real.size else float("inf")

    def step_for_error(self, integrator: str, pole: complex, error: float, limit: float) -> float:
        """Largest step [s], up to `limit`, below which the simulated frequency `|log(z)| / h` of a mode keeps within `error`.

        The step's own map of that mode, damping included, proposes it; the poles of the whole model's step confirm it.

        Args:
            integrator: MuJoCo's name.
            pole: of the mode, with positive imaginary part [1/s].
            error: relative.
            limit: [s].
        """
        limit = min(limit, 3.0 / abs(pole))
        steps = limit * np.geomspace(1e-4, 1.0, 400)
        over = np.abs(np.abs(self._mode(integrator, pole, steps)) / abs(pole) - 1.0) > error
        step = float(steps[max(int(np.argmax(over)) - 1, 0)] if np.any(over) else limit)

        def miss(h: float) -> float:
            return abs(abs(complex(self._mode(integrator, pole, np.array([h]))[0])) / abs(pole) - 1.0) - error

        if np.any(over) and np.argmax(over):
            step = float(brentq(miss, step, float(steps[int(np.argmax(over))]), rtol=1e-10))
        for _ in range(MOST_CONFIRMED):
            if abs(abs(complex(self.shown(integrator, step, np.array([pole]))[0])) / abs(pole) - 1.0) <= error * (
                1.0 + 1e-6
            ):
                break
            step *= CONFIRMED
        return step

    def _mode(self, integrator: str, pole: complex, steps: Array) -> Poles:
        """What steps `(k,)` [s] show of the mode at `pole`, alone: `log(z) / h` [1/s]."""
        if integrator == "RK4":
            s = pole * steps
            z = 1.0 + s * (1.0 + s / 2.0 * (1.0 + s / 3.0 * (1.0 + s / 4.0)))
            return np.asarray(np.log(z) / steps, dtype=np.complex128)
        values, shapes = np.linalg.eig(self.stiffness)
        k = int(np.argmin(np.abs(values - abs(pole) ** 2)))
        x, y = shapes[:, k], np.linalg.inv(shapes)[k]  # y x = 1
        implicit, explicit, spring = (float(np.real(y @ part @ x)) for part in self._parts(integrator))
        held = 0.0
        if integrator == "discrete" and self.discrete_tendons is not None:
            held = float(np.real(y @ self.discrete_tendons @ x))
        own, total, h = max(-2.0 * pole.real, 0.0), implicit + explicit, steps  # the mode's damping, as the pole has it
        share = min(max(implicit / total, 0.0), 1.0) if total > 1e-12 * abs(pole) else 1.0
        implicit, explicit = own * share, own * (1.0 - share)
        lost = h * own + h**2 * (
            spring - held
        )  # z^2 - (2 - lost - pull) z + 1 - lost: no difference of nearly equal numbers
        lost = lost / (1.0 + h * implicit + h**2 * (spring - held))
        pull = h**2 * abs(pole) ** 2 / (1.0 + h * implicit + h**2 * spring)
        half = (lost + pull) / 2.0
        turn = np.sqrt(np.maximum(pull - half**2, 0.0))
        size = np.where(turn > 0.0, 0.5 * np.log1p(-np.minimum(lost, 1.0 - 1e-15)), np.log(np.abs(1.0 - half) + 1e-300))
        return np.asarray((size + 1j * np.arctan2(turn, 1.0 - half)) / h, dtype=np.complex128)

    def shown(self, integrator: str, timestep: float, wanted: Poles) -> Poles:
        """What the simulation shows in place of each of the `wanted` continuous poles: `log(z) / h` [1/s].

        Args:
            integrator: MuJoCo's name.
            timestep: [s].
            wanted: `(k,)` oscillating poles with positive imaginary part.
        """
        z = np.linalg.eigvals(self.step(integrator, timestep)).astype(np.complex128)
        z = z[np.abs(z) > 1e-14]
        s = np.log(z) / timestep
        s = s[s.imag >= -1e-9 * np.abs(s)]
        cost = np.abs(np.log(np.maximum(np.abs(s[None, :]), 1e-300) / np.abs(wanted)[:, None]))
        rows, columns = linear_sum_assignment(np.minimum(cost, 1e3))
        out = np.full(wanted.size, np.nan + 0j)
        out[rows] = s[columns]
        return out
