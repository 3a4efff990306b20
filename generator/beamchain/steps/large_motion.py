"""Where the linear equivalence ends: spin,
slew and acceleration across at which a chain leaves 1 % of a fine one, and the acceleration along
it that lowers its first frequency by 1 %.

Each quantity is compared with that of 60 equal links, both divided by their value in small motion.

Theory: docs/theory.md, section 7.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import brentq, root

from beamchain.chain.baselines import equal_links
from beamchain.chain.chain import Chain
from beamchain.errors import BeamchainError
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.warning_codes import Caution

FINE = 60  # links of the reference
LEFT = 0.01  # relative difference at which a chain has left the reference
MOST_BENT = 0.5  # linear displacement of the mass centre over the length up to which is looked
NEWTON_STEPS = 20
SETTLED = 1e-10  # change of the angles over the angles at which they are taken as found
FASTEST = 30.0  # spin, in first frequencies, up to which is looked


@dataclass(frozen=True, eq=False)
class _Plane:
    """A chain in one bending plane: `h` hinges, `h + 1` links,
    stiffness and armature `(h, h)` over the hinge angles.

    `along`: second moment of each link along x [kg m^2].
    """

    hinges: Array
    stiffness: Array
    armature: Array
    mass: Array
    com: Array
    inertia: Array
    along: Array

    def frequencies(self, rate: float, radius: float, *, flap: bool) -> Array:
        """Frequencies [rad/s] at a spin `rate` [rad/s] about an axis at `radius`
        [m] from the root."""
        m, arms, turned = self._mass_matrix()
        span = self._spans()
        pull = rate**2 * (self.mass[1:] * (radius + self.com[1:]) @ span + self.along[1:])
        k = self.stiffness + turned.T @ (pull[:, None] * turned)
        if not flap:
            k = k - rate**2 * (
                arms.T @ (self.mass[1:, None] * arms) + turned.T @ (self.along[1:, None] * turned)
            )
        squares = np.linalg.eigvals(np.linalg.solve(k, m)).real  # 1 / w^2
        return 1.0 / np.sqrt(np.sort(squares[squares > 0.0])[::-1])

    def _mass_matrix(self) -> tuple[Array, Array, Array]:
        """`(h, h)` over the hinge angles; arms of the mass centres about the hinges, and angles of
        the links from those of the hinges."""
        h = self.hinges.size
        turned = np.tril(np.ones((h, h)))  # angle of link j + 1 from the hinge angles
        arms = self._arms()
        mass = (
            arms.T @ (self.mass[1:, None] * arms)
            + turned.T @ (self.inertia[1:, None] * turned)
            + self.armature
        )
        return mass, arms, turned

    def axial(self) -> float:
        """Acceleration of the root along x that lowers the first frequency by `LEFT` [m/s^2].

        A link is pressed with a G, G = sum_k m_k l_jk. With w the first frequency, it is the least
        a at which

            (K - ((1 - LEFT) w)^2 M) x = a G x
        """
        mass, _, turned = self._mass_matrix()
        pressed = turned.T @ ((self.mass[1:] @ self._spans())[:, None] * turned)
        soft, softened = (np.linalg.solve(self.stiffness, each) for each in (mass, pressed))
        square = (1.0 - LEFT) ** 2 / np.max(np.linalg.eigvals(soft).real)
        left = np.eye(self.hinges.size) - square * soft
        return float(1.0 / np.max(np.linalg.eigvals(np.linalg.solve(left, softened)).real))

    def _spans(self) -> Array:
        """`(h, h)`: length along x of link j before the mass centre of link k, entry (k, j)."""
        return -np.diff(self._arms(), axis=1, append=0.0)

    def _arms(self) -> Array:
        """`(h, h)`: length along x of the mass centre of link k beyond hinge j, entry (k, j); zero
        where the link lies before the hinge."""
        return np.tril(self.com[1:, None] - self.hinges)

    def bent(self, acceleration: float, slew: float) -> tuple[float, float]:
        """Displacement of the mass centre and moment at the root under acceleration or slew."""
        span = self._spans()
        angles = self._balanced(acceleration, slew, span)
        x, y = self._places(angles, span)
        force_x, force_y = self._forces(x, y, acceleration, slew)
        moment = float(np.sum(force_y * x - force_x * y) - slew * np.sum(self.inertia))
        return float(self.mass @ y / np.sum(self.mass)), moment

    def _balanced(self, acceleration: float, slew: float, span: Array) -> Array:
        """Angles of the links at rest under a load,
        by Newton's steps from those of small motion."""
        start = self._linear(acceleration, slew)
        angles = start
        for _ in range(NEWTON_STEPS):
            unbalance = self._unbalance(angles, acceleration, slew, span)
            slopes = self._unbalance_slopes(angles, acceleration, slew, span)
            change = np.linalg.solve(slopes, unbalance)
            angles = angles - change
            if np.max(np.abs(change)) <= SETTLED * np.max(np.abs(angles)):
                return angles
        found = root(lambda a: self._unbalance(a, acceleration, slew, span), start)
        return np.asarray(found.x, dtype=np.float64)

    def _places(self, angles: Array, span: Array) -> tuple[Array, Array]:
        x = np.concatenate([self.com[:1], self.hinges[0] + span @ np.cos(angles)])
        return x, np.concatenate([np.zeros(1), span @ np.sin(angles)])

    def _forces(self, x: Array, y: Array, acceleration: float, slew: float) -> tuple[Array, Array]:
        return self.mass * slew * y, -self.mass * (acceleration + slew * x)

    def _unbalance(self, angles: Array, acceleration: float, slew: float, span: Array) -> Array:
        x, y = self._places(angles, span)
        force_x, force_y = self._forces(x, y, acceleration, slew)
        at_x, at_y = self._hinge_places(angles)
        turning = _outboard(x * force_y - y * force_x - slew * self.inertia)
        moment = turning - at_x * _outboard(force_y) + at_y * _outboard(force_x)
        return self._flexibility @ moment - np.diff(angles, prepend=0.0)

    def _unbalance_slopes(
        self, angles: Array, acceleration: float, slew: float, span: Array
    ) -> Array:
        """`(h, h)`: derivative of `_unbalance` by the angles.

        With x' = -span sin(a), y' = span cos(a) of the mass centres and likewise of the hinges, and
        the forces f_x = m slew y, f_y = -m (acceleration + slew x):

            (x f_y - y f_x)' = -m (acceleration + 2 slew x) x' - 2 m slew y y'
        """
        x, y = self._places(angles, span)
        force_x, force_y = self._forces(x, y, acceleration, slew)
        at_x, at_y = self._hinge_places(angles)
        sine = np.sin(angles)
        cosine = np.cos(angles)
        x_slope = -span * sine
        y_slope = span * cosine
        inner = np.tri(self.hinges.size, k=-1) * np.diff(self.hinges, append=0.0)
        mass, x, y = (values[1:, None] for values in (self.mass, x, y))
        turning = (
            -mass * (acceleration + 2.0 * slew * x) * x_slope - 2.0 * mass * slew * y * y_slope
        )
        sums = np.triu(np.ones((self.hinges.size, self.hinges.size)))
        moment = sums @ turning
        moment -= (
            at_x[:, None] * (sums @ (-slew * mass * x_slope))
            - inner * sine * _outboard(force_y)[:, None]
        )
        moment += (
            at_y[:, None] * (sums @ (slew * mass * y_slope))
            + inner * cosine * _outboard(force_x)[:, None]
        )
        return (
            self._flexibility @ moment - np.eye(self.hinges.size) + np.eye(self.hinges.size, k=-1)
        )

    def _hinge_places(self, angles: Array) -> tuple[Array, Array]:
        links = np.diff(self.hinges)
        x = self.hinges[0] + np.append(0.0, np.cumsum(links * np.cos(angles[:-1])))
        return x, np.append(0.0, np.cumsum(links * np.sin(angles[:-1])))

    @cached_property
    def _flexibility(self) -> Array:
        return np.asarray(np.linalg.inv(self.stiffness), dtype=np.float64)

    def _linear(self, acceleration: float, slew: float) -> Array:
        """Angles of the links in small motion."""
        force = -self.mass[1:] * (acceleration + slew * self.com[1:])
        turn = np.triu(np.ones((self.hinges.size, self.hinges.size))) @ (slew * self.inertia[1:])
        bent = np.linalg.solve(self.stiffness, self._arms().T @ force - turn)
        return np.asarray(np.cumsum(bent), dtype=np.float64)


def _outboard(values: Array) -> Array:
    """`(h,)`: sum of a quantity of the links over all beyond each hinge."""
    return np.cumsum(values[:0:-1])[::-1]


def _plane(chain: Chain, port: str) -> _Plane:
    """The chain in one plane; neighbouring links without a hinge in that plane are one."""
    moving = [i for i, hinge in enumerate(chain.hinges) if port in hinge.stiffness]
    edges = [0, *(i + 1 for i in moving), len(chain.links)]
    axis = 2 if port == "xy" else 1
    rows: list[tuple[float, float, float, float]] = []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        links = chain.links[a:b]
        mass = sum(link.mass for link in links)
        com = sum(link.mass * link.com for link in links) / mass if mass else 0.0
        spread = sum(link.mass * (link.com - com) ** 2 for link in links)
        inertia = spread + sum(link.inertia[axis] for link in links)
        along = spread + sum(
            (link.inertia[1] + link.inertia[2] - link.inertia[0]) / 2.0 for link in links
        )
        rows.append((mass, com, inertia, along))
    mass, com, inertia, along = (np.array(v) for v in zip(*rows, strict=True))
    hinges = np.array([chain.hinges[i].x for i in moving])
    freedoms = chain.freedoms([port])
    tied = chain.rows(freedoms)[1][6 * len(chain.links) :]
    return _Plane(hinges, chain.stiffness(freedoms), tied.T @ tied, mass, com, inertia, along)


@dataclass(frozen=True)
class LargeMotion:
    """How far a chain may be driven in one bending plane before it leaves 1 % of a chain of 60
    links and, along, before the load moves its first frequency by 1 %.

    Args:
        port: the plane.
        spin: rate [rad/s]; infinity: beyond 30 first frequencies.
        acceleration: of the root, across the chain [m/s^2].
        slew: angular acceleration [rad/s^2] about the axis of spin,
            which also accelerates a root away from it.
        bent: displacement of the mass centre over the length at the acceleration limit.
        axial: acceleration of the root along the chain, outwards, that presses it until its first
            frequency, the root held, is 1 % lower [m/s^2]; it buckles at 50 times that or before.
    """

    port: str
    spin: float
    acceleration: float
    slew: float
    bent: float
    axial: float

    def exceeded(
        self, *, spin: float = 0.0, acceleration: float = 0.0, slew: float = 0.0
    ) -> list[str]:
        """Sentences for what a run exceeded; empty where the chain is within 1 %."""
        given = (
            ("spin", spin, "rad/s"),
            ("acceleration", acceleration, "m/s^2"),
            ("slew", slew, "rad/s^2"),
        )
        return [
            Caution(
                "large-motion",
                f"{what} reached {value:.4g} {unit}, beyond the {getattr(self, what):.4g} {unit} "
                f"up to which the chain stays within 1 % of a fine one in {self.port}; move more "
                "slowly or, against bending, keep more modes.",
            )
            for what, value, unit in given
            if abs(value) > getattr(self, what)
        ]

    def as_dict(self) -> dict[str, float | str]:
        """For stability.json."""
        return asdict(self)


def large_motion(
    chain: Chain, beam: Beam, port: str, *, modes: int, radius: float = 0.0
) -> LargeMotion:
    """The large-motion limits of a chain in a bending plane, "xy" or "xz", against 60 equal links.

    `modes`: kept, whose frequencies are compared in spin; `radius`:
    from the axis of spin and slew to the root [m].
    """
    ours = _plane(chain, port)
    theirs = _plane(equal_links(beam, FINE, "midpoint", port), port)
    kept = min(modes, ours.hinges.size)

    def spin_error(rate: float) -> float:
        worst = 0.0
        for flap in (True, False):
            a, b = (
                p.frequencies(rate, radius, flap=flap)[:kept]
                / p.frequencies(0.0, radius, flap=True)[:kept]
                for p in (ours, theirs)
            )
            if a.size < kept or b.size < kept:
                return 1.0  # buckled: one of them has lost a mode
            worst = max(worst, float(np.max(np.abs(a / b - 1.0))))
        return worst

    first = float(ours.frequencies(0.0, radius, flap=True)[0])
    spin = first * _leaves(lambda x: spin_error(x * first), 0.01, FASTEST)

    def bending(load: Callable[[float], tuple[float, float]]) -> tuple[float, float]:
        """Load at which the chain leaves, and how far it is bent there."""
        unit = 1e-6
        small = [np.array(p.bent(*load(unit))) for p in (ours, theirs)]
        per_load = abs(float(small[1][0])) / unit / beam.length
        to = MOST_BENT / per_load

        def error(x: float) -> float:
            a, b = (
                np.array(p.bent(*load(x * to))) / s / x
                for p, s in zip((ours, theirs), small, strict=True)
            )
            return float(np.max(np.abs(a / b - 1.0)))

        share = _leaves(error, 0.01, 1.0)
        return share * to, share * MOST_BENT

    acceleration, bent = bending(lambda x: (x, 0.0))
    # a root at the radius r from the axis moves across the chain with r times the
    # angular acceleration
    slew, _ = bending(lambda x: (radius * x, x))
    return LargeMotion(port, spin, acceleration, slew, bent, theirs.axial())


def _leaves(error: Callable[[float], float], start: float, end: float) -> float:
    """First x at which the error passes 1 %; infinity where it does not."""
    grid = np.geomspace(start, end, 16).tolist()
    beyond = next((i for i, x in enumerate(grid) if error(x) > LEFT), None)
    if not beyond:
        return float("inf") if beyond is None else start
    return float(brentq(lambda x: error(x) - LEFT, grid[beyond - 1], grid[beyond], rtol=1e-4))


def large_limits(
    chain: Chain, beam: Beam, modes: Mapping[str, int], radius: float = 0.0
) -> tuple[dict[str, LargeMotion], tuple[str, ...]]:
    """Large-motion limits per bending plane, the root at `radius` [m], and what failed."""
    out: dict[str, LargeMotion] = {}
    reasons: list[str] = []
    for port in ("xy", "xz"):
        if port in modes and port in chain.ports:
            try:
                out[port] = large_motion(
                    chain, beam, port, modes=modes[port], radius=max(radius, 0.0)
                )
            except BeamchainError as error:
                text = f"large motion in {port} could not be compared: {error}"
                reasons.append(Caution("large-motion-unknown", text))
    return out, tuple(reasons)
