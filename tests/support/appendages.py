"""Appendages that the tests share, and an independent transfer-matrix solution to
hold them against.

Nothing here is imported from `beamchain.structure.elements` or `beamchain.structure.exact`: the
references must not share code with what they judge.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mpmath
import numpy as np
import pytest

import beamchain as bc
from beamchain import Beam, Equivalent, Joint, Lump, Material, Rectangle, Round, Segment
from solver import Craft, normal_modes


def close(expected: object, rel: float = 0.0, abs: float = 0.0) -> object:
    """`pytest.approx` without its silent absolute tolerance of 1e-12,
    which swallows small SI numbers whole."""
    return pytest.approx(expected, rel=rel, abs=abs)


STEEL = Material(youngs_modulus=2.06e11, density=7800.0, poissons_ratio=0.3)
SEED_LENGTH, SEED_DIAMETER = 15.0, 0.012


def seed_boom() -> Beam:
    """The 2008 paper's uniform rod: L = 15 m, d = 0.012 m, rho = 7800, E = 2.06e11."""
    return Beam(
        segments=(
            Segment(length=SEED_LENGTH, section=Round(diameter=SEED_DIAMETER), material=STEEL),
        )
    )


def unit_beam() -> Beam:
    """L = 1, EI = 1, mass 1; GJ = EA = 1 and polar inertia 1e-3 so that every port exists."""
    section = Equivalent(
        bending_stiffness_xy=1.0,
        linear_mass=1.0,
        torsion_stiffness=1.0,
        axial_stiffness=1.0,
        polar_inertia=1e-3,
    )
    return Beam(segments=(Segment(length=1.0, section=section),))


def tapered_boom() -> Beam:
    """A solid cone, diameter falling linearly to 40 %."""
    return Beam(
        segments=(
            Segment(
                length=10.0,
                section=Round(diameter=0.05),
                section_end=Round(diameter=0.02),
                material=STEEL,
            ),
        )
    )


def stepped_boom() -> Beam:
    """Three rods of falling diameter."""
    return Beam(
        segments=tuple(
            Segment(length=length, section=Round(diameter=d), material=STEEL)
            for length, d in ((3.0, 0.03), (4.0, 0.024), (3.5, 0.02))
        )
    )


def tip_loaded_boom(ratio: float = 1.0) -> Beam:
    """The unit beam with a tip mass of `ratio` times its own mass."""
    return Beam(segments=unit_beam().segments, lumps=(Lump(x=1.0, mass=ratio),))


def soft_root_boom(stiffness: float = 3.0) -> Beam:
    """The unit beam on a root joint of `stiffness` times EI / L."""
    return Beam(
        segments=unit_beam().segments, joints=(Joint(after_segment=0, stiffness_xy=stiffness),)
    )


def panels() -> Beam:
    """Three stiff panels on compliant hinge lines, with a lump in the middle:
    everything at once."""
    panel = Segment(
        length=2.0,
        section=Equivalent(
            bending_stiffness_xy=4000.0,
            bending_stiffness_xz=9000.0,
            linear_mass=6.0,
            polar_inertia=0.8,
            torsion_stiffness=3000.0,
            axial_stiffness=5e6,
        ),
    )
    joints = tuple(
        Joint(after_segment=i, stiffness_xy=k, stiffness_torsion=2.0 * k)
        for i, k in ((0, 2500.0), (1, 1800.0), (2, 1800.0))
    )
    return Beam(
        segments=(panel,) * 3,
        joints=joints,
        lumps=(Lump(x=3.1, mass=1.7, inertia=(0.05, 0.03, 0.04)),),
    )


def timoshenko_boom() -> Beam:
    """A stocky rectangular bar with shear and rotary inertia."""
    bar = Segment(
        length=2.0,
        section=Rectangle(width_y=0.3, width_z=0.2),
        material=STEEL,
        theory="timoshenko",
        shear_factor=0.85,
    )
    return Beam(segments=(bar,))


#: beams of the kinds that are realisable with up to 7 modes
REALISABLE = {
    "uniform": seed_boom,
    "tapered": tapered_boom,
    "stepped": stepped_boom,
    "tip-loaded 0.1": lambda: tip_loaded_boom(0.1),
    "tip-loaded 1": tip_loaded_boom,
    "tip-loaded 10": lambda: tip_loaded_boom(10.0),
    "soft root": soft_root_boom,
}


@dataclass(frozen=True)
class TransferMatrix:
    """Exact solution of a beam of uniform pieces in one bending plane, in `mpmath`.

    The state (displacement, rotation, moment, shear) runs from the root to the free tip; moment and
    shear are what the outer part exerts on the inner one. Every piece is the matrix exponential of
    its first-order system

        w' = theta + V / kGA,  theta' = M / EI,  M' = -V - omega^2 rho I theta,  V' = -omega^2 m w,

    a joint adds M / stiffness to the rotation, a body takes up its inertia force and moment.

    Args:
        steps: from the root outwards: ("piece", length, EI, mass per length, kGA or None, rho I),
            ("joint", stiffness) or ("body", mass, inertia).
    """

    steps: Sequence[tuple]
    digits: int = 30

    def to_tip(self, omega: float) -> mpmath.matrix:
        """4x4: state at the tip from the state at the root, at `omega` [rad/s]."""
        with mpmath.workdps(self.digits):
            square = mpmath.mpf(omega) ** 2
            total = mpmath.eye(4)
            for kind, *values in self.steps:
                total = _STEPS[kind](square, *values) * total
            return total

    def held(self, omega: float) -> mpmath.mpf:
        """Zero at the frequencies of the clamped beam."""
        return self._determinant(omega, 2, 3)

    def free(self, omega: float) -> mpmath.mpf:
        """Zero at the frequencies of the free beam."""
        return self._determinant(omega, 0, 1)

    def _determinant(self, omega: float, i: int, j: int) -> mpmath.mpf:
        t = self.to_tip(omega)
        with mpmath.workdps(self.digits):  # outside, the products would fall back to 15 digits
            return t[2, i] * t[3, j] - t[2, j] * t[3, i]

    def dynamic_mass(self, omega: float) -> np.ndarray:
        """`(2, 2)`: wrench on the root per unit acceleration of the root."""
        t = self.to_tip(omega)
        with mpmath.workdps(self.digits):
            inner = -(t[2:4, 2:4] ** -1) * t[2:4, 0:2]  # root moment and shear from root motion
            wrench = mpmath.matrix([[-inner[1, 0], -inner[1, 1]], [-inner[0, 0], -inner[0, 1]]])
            out = wrench / -(mpmath.mpf(omega) ** 2)
        return np.array(out.tolist(), dtype=np.float64)


def _piece(square, length, ei, m, kga=None, rho_i=0.0):
    a = mpmath.zeros(4)
    a[0, 1] = 1
    a[0, 3] = 0 if kga is None else 1 / mpmath.mpf(kga)
    a[1, 2] = 1 / mpmath.mpf(ei)
    a[2, 1] = -mpmath.mpf(rho_i) * square
    a[2, 3] = -1
    a[3, 0] = -mpmath.mpf(m) * square
    return mpmath.expm(a * mpmath.mpf(length), method="taylor")


def _joint(square, stiffness):
    out = mpmath.eye(4)
    out[1, 2] = 1 / mpmath.mpf(stiffness)
    return out


def _body(square, mass, inertia=0.0):
    out = mpmath.eye(4)
    out[3, 0] = -mpmath.mpf(mass) * square
    out[2, 1] = -mpmath.mpf(inertia) * square
    return out


_STEPS = {"piece": _piece, "joint": _joint, "body": _body}


def roots_within(
    function: Callable[[float], object], frequencies: Sequence[float], tolerance: float
) -> list[bool]:
    """Whether `function` changes sign within `tolerance` (relative) of each frequency."""
    return [
        bool(function(w * (1.0 - tolerance)) * function(w * (1.0 + tolerance)) < 0)  # type: ignore[operator]
        for w in frequencies
    ]


def sign_changes(function: Callable[[float], object], start: float, end: float, points: int) -> int:
    """Roots of `function` from `start` to `end` that `points` see,
    spread evenly in sqrt(w) as a beam's roots are."""
    values = [
        float(np.sign(float(function(w))))
        for w in np.linspace(np.sqrt(start), np.sqrt(end), points) ** 2
    ]  # type: ignore[arg-type]
    return int(np.sum(np.diff(values) != 0.0))


def dense_port(
    rigid: Sequence[tuple[float, float, float]], hinges: Sequence[tuple[float, float]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rigid mass `(2, 2)`, held frequencies and participation of a planar chain,
    from its mass and stiffness matrices.

    An independent way to what `Chain.port` computes from weighted rows.

    Args:
        rigid: (mass, x of the mass centre, inertia about it) per link.
        hinges: (x, stiffness) between the links.
    """
    craft = Craft()
    craft.links(craft.base, rigid, hinges)
    mass, _, stiffness = craft.matrices()
    frequencies, shapes = normal_modes(mass[6:, 6:], stiffness[6:, 6:])
    return mass[np.ix_([1, 5], [1, 5])], frequencies, shapes.T @ mass[6:, [1, 5]]


def drawn_rods(
    seed: int, modes: int, low: float = 0.3, high: float = 3.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Point masses `(N + 1,)` from the root, massless rods `(N,)` between them and springs
    `(N - 1,)` at the inner masses, with so many modes."""
    rng = np.random.default_rng(seed)
    return tuple(rng.uniform(low, high, size) for size in (modes + 2, modes + 1, modes))


def modes_of_rods(masses: np.ndarray, lengths: np.ndarray, stiffness: np.ndarray) -> bc.ModalData:
    """What such rods do in plane xy, as the modes of an appendage."""
    x = np.concatenate([[0.0], np.cumsum(lengths)])
    craft = Craft()
    craft.body(craft.base, masses[0])
    nodes = [(mass, at, 0.0) for mass, at in zip(masses[1:], x[1:], strict=True)]
    craft.links(craft.base, nodes, list(zip(x[1:-1], stiffness, strict=True)))
    mass, _, springs = craft.matrices()
    frequencies, shapes = normal_modes(mass[6:, 6:], springs[6:, 6:])
    rigid = mass[:6, :6] + np.diag([0.0, 0.0, 0.0, 1e-4 * mass[5, 5], 0.0, 0.0])
    return bc.ModalData(rigid, frequencies, shapes.T @ mass[6:, :6], length=float(x[-1]))
