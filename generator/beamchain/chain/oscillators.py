"""The oscillator form: one rigid root body that carries a slider, rotor or screw per mode. Exact at the port, 6 x 6.

A mode that pushes without a twist about its own line of force is a point mass on a slide: mass `|f|^2` on the line that
the moment `g = p x f` gives. A mode without force is a body on a hinge. A mode whose moment has a part along its force
(a screw) is a body on a hinge perpendicular to the force, its product of inertia giving that part. Masses can be
shared: where the sliders of different directions together weigh more than the appendage, they ride in one another.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import eigh

from beamchain.chain.bodies import Body, from_mass_matrix, remainder
from beamchain.chain.stacks import Slide, Stack, place, stacked
from beamchain.errors import RealisationError
from beamchain.motion import Array, locked
from beamchain.port import PortModel

Kind = Literal["slider", "rotor", "screw"]

FAR = 30.0  # radii of gyration from the mass centre: a slider further out becomes a hinged body
HEAVY = 100.0  # excess of such a body, whose force needs next to no mass
EXCESS = (1.0, 0.3, 0.1, 0.03, 0.01)  # mass of a hinged body beyond what its force needs, relative; tried in turn
LIGHT = 1e-9  # of the appendage's mass: a rotor's
SMALL = 1e-6  # a slider's size squared, of the appendage's
THIN = 1e-9  # second moment of a hinged body where it needs none, of what it has
LEAST = 1e-14  # kg m^2: least second moment of a moving body; MuJoCo takes inertias from 1e-15
COARSE = 0.1  # of the appendage: most that few printed digits excuse
ROUNDING = 1e-9  # what computing the remainder may lose, relative, beside the print's own precision


@dataclass(frozen=True, eq=False)
class Oscillator:
    """One mode as a body on one joint.

    Args:
        mode: number, from 1.
        kind: "slider", "rotor" or "screw".
        axis: `(3,)` of the slide or hinge, unit vector.
        point: `(3,)` a point of the hinge axis; a slider's place [m].
        body: what moves beside the oscillators that ride in it; None: nothing of its own.
        stiffness: [N/m] or [N m/rad].
        damping: [N s/m] or [N m s/rad].
        inside: index of the oscillator it rides in; None: the root body.
    """

    mode: int
    kind: Kind
    axis: Array
    point: Array
    body: Body | None
    stiffness: float
    damping: float
    inside: int | None = None

    @property
    def unit_motion(self) -> Array:
        """`(6,)` motion of a point at the port fixed to the body, per unit of the joint."""
        if self.kind == "slider":
            return np.concatenate([self.axis, np.zeros(3)])
        return np.concatenate([np.cross(self.point, self.axis), self.axis])


@dataclass(frozen=True, eq=False)
class Oscillators:
    """A root body and its oscillators.

    Args:
        root: welded to the hub.
        items: one per mode; an oscillator stands after the one it rides in.
        length: root to tip along x, for drawing [m].
        repair: how far the root body's moments were moved to be a body's, relative (printed laminae).
        leak: largest part of a mode that was left out, relative.
    """

    root: Body
    items: tuple[Oscillator, ...]
    length: float
    repair: float
    leak: float

    def rigid_mass(self) -> Array:
        """`(6, 6)` about the port."""
        return self.root.mass_matrix() + sum(
            (item.body.mass_matrix() for item in self.items if item.body is not None), np.zeros((6, 6))
        )

    def space(self) -> PortModel:
        """How the whole pushes back at the port, from its bodies and joints: six motions."""
        n = len(self.items)
        mass = np.zeros((6 + n, 6 + n))
        mass[:6, :6] = self.root.mass_matrix()
        for i, item in enumerate(self.items):
            if item.body is None:
                continue
            moves = np.zeros((6, 6 + n))
            moves[:, :6] = np.eye(6)
            j: int | None = i
            while j is not None:
                moves[:, 6 + j] = self.items[j].unit_motion
                j = self.items[j].inside
            mass += moves.T @ item.body.mass_matrix() @ moves
        springs = np.diag([item.stiffness for item in self.items])
        dampers = np.diag([item.damping for item in self.items])
        inverse, shapes = eigh(mass[6:, 6:], springs)
        inverse, shapes = inverse[::-1], shapes[:, ::-1]
        w = 1.0 / np.sqrt(inverse)
        shapes = shapes * w
        ratios = np.einsum("ik,ij,jk->k", shapes, dampers, shapes) / (2.0 * w)
        return PortModel(mass[:6, :6], w, shapes.T @ mass[6:, :6], ratios)


def realise_oscillators(
    rigid_mass: Array,
    frequencies: Array,
    participation: Array,
    damping: Array,
    *,
    numbers: Sequence[int],
    length: float,
    precision: float,
) -> Oscillators:
    """The oscillators of given modes.

    Args:
        rigid_mass: `(6, 6)` about the port.
        frequencies: `(n,)` [rad/s].
        participation: `(n, 6)`.
        damping: `(n,)` ratios.
        numbers: of the modes, for names.
        length: root to tip [m].
        precision: relative, of the numbers.

    Raises:
        RealisationError: the rigid mass is no rigid body's, or what the modes leave of it is none.
    """
    total, miss = from_mass_matrix(rigid_mass)
    tolerance = max(min(20.0 * precision, COARSE), ROUNDING)
    if miss > tolerance:
        raise RealisationError(
            f"the rigid mass matrix differs by {miss:.1e} from a rigid body's (its mass depends on the direction, as "
            "when an a-set leaves freedoms out), which no set of bodies can be; give the mass of the grid point "
            "weight generator."
        )
    worst = -np.inf
    # first a star around the mass centre; then with free places where most is left; then with shared masses
    for nest, centred in ((False, True), (False, False), (True, False)):
        for excess in EXCESS:
            builder = _Builder(total, precision, excess)
            for k in range(frequencies.size):
                builder.add(int(numbers[k]), float(frequencies[k]), participation[k], float(damping[k]))
            items = builder.finish(nest=nest, centred=centred)
            left = total.pseudo() - sum((i.body.pseudo() for i in items if i.body is not None), np.zeros((4, 4)))
            root, least, repair = remainder(left, total.centre, builder.size, total.mass)
            if least >= -tolerance:
                return Oscillators(root, items, length, repair, builder.leak)
            worst = max(worst, least)
            if not builder.hinged:
                break  # the excess mass plays no part
    raise RealisationError(
        f"oscillators for these {frequencies.size} modes leave less than nothing of the appendage (pseudo-inertia "
        f'{worst:.2g} of its own): keep fewer modes (imported.modes), or use form = "chain".'
    )


class _Builder:
    """Collects bodies; positions are taken from the mass centre, where the numbers are best conditioned."""

    def __init__(self, total: Body, precision: float, excess: float) -> None:
        self.total, self.precision, self.excess = total, precision, excess
        spread = np.clip(np.linalg.eigvalsh(total.spread), 0.0, None)
        self.size = float(np.sqrt(max(spread.sum() / total.mass, 1e-30)))
        self.flat = total.spread / total.mass + 1e-9 * self.size**2 * np.eye(3)
        self.slides: list[Slide] = []
        self.others: list[Oscillator] = []
        self.hinged = False
        self.leak = 0.0

    def add(self, mode: int, omega: float, row: Array, ratio: float) -> None:
        """One more mode."""
        f, g = row[:3], row[3:] - np.cross(self.total.centre, row[:3])
        force = float(np.linalg.norm(f))
        size = float(np.hypot(force, np.linalg.norm(g) / self.size))
        if size == 0.0:
            raise RealisationError(f"mode {mode} has no participation at all; leave it out (imported.modes).")
        if force > 1e-9 * size:
            along = f / force
            pitch = float(g @ along) / force
            at = np.cross(f, g) / force**2
            if abs(pitch) <= max(self.precision, 1e-12) * self.size and np.linalg.norm(at) <= FAR * self.size:
                self.leak = max(self.leak, abs(pitch) * force / self.size / size)
                # along its own line a slider is free: nearest to the mass, so that a lamina stays one
                weight = np.linalg.inv(self.flat)
                at = at - along * float(along @ weight @ at) / float(along @ weight @ along)
                self.slides.append(Slide(mode, omega, ratio, force**2, along, at))
                return
        self.leak = max(self.leak, 0.0 if force > 1e-9 * size else force / size)
        self.others.append(self._hinged(mode, omega, ratio, f if force > 1e-9 * size else np.zeros(3), g))
        self.hinged |= self.others[-1].kind == "screw"

    def _hinged(self, mode: int, omega: float, ratio: float, f: Array, g: Array) -> Oscillator:
        """A body on a hinge perpendicular to the force; see the module's head.

        With e1 along the force, e2 along the hinge, e3 = e1 x e2, the body's mass m, its centre at `rho e3` from the
        hinge and `J = I22 + m rho^2`: force `m rho / sqrt(J)` along e1, moment about the mass centre of the whole
        `x f + I22 / sqrt(J)` along e2 (x: the body's centre along e3) and `I12 / sqrt(J)` along e1.
        """
        force = float(np.linalg.norm(f))
        if force == 0.0:
            e2 = g / np.linalg.norm(g)
            e1 = self._across(e2)
        else:
            e1 = f / force
            across = g - (g @ e1) * e1
            e2 = (
                across / np.linalg.norm(across)
                if np.linalg.norm(across) > 1e-9 * force * self.size
                else self._across(e1)
            )
        e3 = np.cross(e1, e2)
        basis = np.array([e1, e2, e3])
        twist, moment = float(g @ e1), float(g @ e2)
        near = force > 0.0 and moment / force <= FAR * self.size  # near enough to choose how much turns
        mass = max((1.0 + (self.excess if near else HEAVY)) * force**2, LIGHT * self.total.mass)
        ratio_j = mass / (mass - force**2)
        long = twist**2 * ratio_j  # second moment along the hinge that the product of inertia needs
        place_e3 = 0.0
        if near:
            i22 = max(0.25 * long, SMALL * self.size**2 * mass)
            place_e3 = moment / force - np.sqrt(i22 / ratio_j) / force
        else:
            i22 = moment**2 * ratio_j
        inertia = i22 * ratio_j
        root = float(np.sqrt(inertia))
        spread = np.zeros((3, 3))
        thin = max(THIN * i22, LEAST)
        if abs(twist) > 0.0:
            product = twist * root
            first = i22 - min(thin, 0.5 * i22)
            spread[0, 0], spread[2, 2] = first, i22 - first
            spread[0, 1] = spread[1, 0] = -product
            spread[1, 1] = product**2 / first + thin
        else:
            inside = (
                basis[[0, 2]] @ self.total.spread @ basis[[0, 2]].T
            )  # as the appendage itself lies around the hinge
            values, vectors = np.linalg.eigh(inside)
            values = np.clip(values, 0.0, None)
            inside = (vectors * values) @ vectors.T if values.sum() > 0.0 else np.eye(2)
            spread[np.ix_([0, 2], [0, 2])] = inside * (i22 / np.trace(inside))
            spread[1, 1] = thin
        centre = self.total.centre + place_e3 * e3
        arm = force * root / mass
        kind: Kind = "screw" if abs(twist) > self.precision * abs(moment) else "rotor"
        return Oscillator(
            mode, kind, locked(e2), locked(centre - arm * e3), Body(mass, centre, basis.T @ spread @ basis),
            inertia * omega**2, 2.0 * ratio * omega * inertia,
        )  # fmt: skip

    def _across(self, direction: Array) -> Array:
        """A unit vector perpendicular to `direction`, along which the mass is spread most."""
        off = np.eye(3) - np.outer(direction, direction)
        return np.linalg.eigh(off @ (self.total.spread + 1e-12 * np.trace(self.total.spread) * np.eye(3)) @ off)[1][
            :, -1
        ]

    def _small(self, mass: float) -> Array:
        """Second moments of a slider: the appendage's own, much smaller."""
        own = (self.flat - 1e-9 * self.size**2 * np.eye(3)) * mass
        values, vectors = np.linalg.eigh(own * SMALL)
        order = np.sort(values)
        floor = np.where(values >= order[1], LEAST, 0.0)  # two directions are enough for three inertias
        return (vectors * np.maximum(values, floor)) @ vectors.T

    def finish(self, *, nest: bool, centred: bool) -> tuple[Oscillator, ...]:
        """All oscillators.

        Args:
            nest: sliders may ride in one another.
            centred: along its own axis a slider stands nearest to the mass centre; else where most mass is left.
        """
        reach = FAR * self.size
        stacks: list[Stack] = stacked(self.slides, self.precision, reach) if nest else [[s] for s in self.slides]
        placed = [(stack, place(stack, reach) or []) for stack in stacks]
        own = [(m, at, s.axis) for stack, places in placed for s, (m, at) in zip(stack, places, strict=True)]
        items: list[Oscillator] = []
        for stack, places in placed:
            above: int | None = None
            for slide, (mass, at) in zip(stack, places, strict=True):
                if not centred and above is None:
                    at = at + slide.axis * (self._left(slide.axis, own) - float(slide.axis @ at))
                centre = self.total.centre + at
                items.append(
                    Oscillator(
                        slide.mode, "slider", locked(slide.axis), locked(centre),
                        Body(mass, centre, self._small(mass)) if mass > 0.0 else None,
                        slide.mass * slide.omega**2, 2.0 * slide.ratio * slide.omega * slide.mass, above,
                    )
                )  # fmt: skip
                above = len(items) - 1
        return (*items, *self.others)

    def _left(self, axis: Array, own: Sequence[tuple[float, Array, Array]]) -> float:
        """Mass centre along `axis`, from that of the whole, of what does not have to stand somewhere along it."""
        fixed = [(mass * (1.0 - float(axis @ other) ** 2), float(axis @ at)) for mass, at, other in own]
        left = self.total.mass - sum(mass for mass, _ in fixed)
        return -sum(mass * x for mass, x in fixed) / left if left > 1e-9 * self.total.mass else 0.0
