"""The cases: a Latin hypercube over all ranges at once, and each range's ends by itself."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from beamchain import Damping, Hub, Joint, Lump, Material, Modes, Round, Segment, Spec
from beamchain.spec import Root
from extremes.truth import Rod

SPREAD = 1440  # cases of the hypercube
SEED = 2008

#: Ranges, by the logarithm to base 10 but for `damping` and `modes`.
RANGES: dict[str, tuple[float, float]] = {
    "length": (-3.0, 3.0),
    "slenderness": (1.0, 4.0),
    "modulus": (3.0, 12.0),
    "density": (0.0, 4.3010299956639813),
    "tip": (-2.0, 4.0),
    "hub": (-3.0, 6.0),
    "damping": (0.0, 0.5),
    "taper": (-2.0, 2.0),
    "joint": (-6.0, 6.0),
    "modes": (1.0, 10.0),
}


@dataclass(frozen=True)
class Case:
    """One appendage and what is asked of it.

    Args:
        name: says which family it belongs to.
        length: [m].
        slenderness: length over the root's (or mean) diameter.
        modulus: [N/m^2].
        density: [kg/m^3].
        tip: tip mass over the beam's own.
        hub: hub mass over the beam's own.
        damping: ratio of every cantilever mode.
        taper: tip diameter over root diameter.
        joint: stiffness of a compliant joint over E I / L at the root; 0: none.
        joint_at: "root" or "middle".
        modes: kept in plane xy.
        target: of the fit.
        space: plane xz and torsion are kept too.
    """

    name: str
    length: float = 2.0
    slenderness: float = 100.0
    modulus: float = 7e10
    density: float = 2700.0
    tip: float = 0.0
    hub: float = 10.0
    damping: float = 0.0
    taper: float = 1.0
    joint: float = 0.0
    joint_at: Literal["root", "middle"] = "root"
    modes: int = 2
    target: Literal["clamped", "hub", "free"] = "clamped"
    space: bool = False

    @property
    def diameters(self) -> tuple[float, float]:
        """At the root and at the tip; their larger one is the length over the slenderness [m]."""
        largest = self.length / self.slenderness
        return largest * min(1.0, 1.0 / self.taper), largest * min(1.0, self.taper)

    @property
    def own_mass(self) -> float:
        """Of the beam without its tip mass [kg]."""
        a, b = self.diameters
        return self.density * np.pi / 12.0 * self.length * (a * a + a * b + b * b)

    @property
    def spring(self) -> tuple[float, float] | None:
        """Place and stiffness of the compliant joint."""
        if self.joint == 0.0:
            return None
        at = 0.0 if self.joint_at == "root" else self.length / 2.0
        ei = self.modulus * np.pi / 64.0 * self.diameters[0] ** 4
        return at, self.joint * ei / self.length

    @property
    def hub_body(self) -> Hub:
        """A cube as wide as a fifth of the length with the root at a face."""
        mass = self.hub * self.own_mass
        inertia = mass * (0.2 * self.length) ** 2 / 6.0
        return Hub(
            mass=mass, inertia=(inertia, inertia, inertia), offset=(0.1 * self.length, 0.0, 0.0)
        )

    def rod(self) -> Rod:
        """For the independent check."""
        a, b = self.diameters
        return Rod(
            self.length, a, b, self.modulus, self.density, self.tip * self.own_mass, self.spring
        )

    def spec(self) -> Spec:
        """For the package.

        Raises:
            InputError: a value is out of what the package takes.
        """
        a, b = self.diameters
        material = Material(youngs_modulus=self.modulus, density=self.density, poissons_ratio=0.3)
        middle = (a + b) / 2.0
        segments = tuple(
            Segment(
                length=self.length / 2.0,
                section=Round(diameter=inner),
                section_end=None if inner == outer else Round(diameter=outer),
                material=material,
            )
            for inner, outer in ((a, middle), (middle, b))
        )
        spring = self.spring
        joints: tuple[Joint, ...] = ()
        if spring is not None:
            joints = (
                Joint(
                    after_segment=0 if self.joint_at == "root" else 1,
                    stiffness_xy=spring[1],
                    stiffness_xz=spring[1],
                ),
            )
        lumps = (Lump(x=self.length, mass=self.tip * self.own_mass),) if self.tip else ()
        extra = self.modes if self.space else 0
        return Spec(
            name="extreme",
            segment=segments,
            joint=joints,
            lump=lumps,
            damping=Damping(ratio=self.damping) if self.damping else None,
            modes=Modes(xy=self.modes, xz=extra, torsion=min(extra, 1)),
            root=Root(target=self.target, hub=self.hub_body),
        )


def cases() -> list[Case]:
    """All cases, always the same ones."""
    return [*_ends(), *_pairs(), *_spread()]


def _ends() -> list[Case]:
    """Each range at both ends and in its middle, all else as usual."""
    usual = Case("ends")
    out: list[Case] = []
    for field, (low, high) in RANGES.items():
        for share in (0.0, 0.5, 1.0):
            value: float = low + share * (high - low)
            if field == "modes":
                out.append(replace(usual, modes=round(value)))
            elif field == "damping":
                out += [replace(usual, damping=value, modes=n) for n in (1, 3)]
            else:
                out += [replace(usual, **{field: 10.0**value}, modes=n) for n in (1, 3)]
    return [replace(c, target=t) for c in out for t in ("clamped", "hub")]


def _pairs() -> list[Case]:
    """Corners of the ranges that act on each other, in space too."""
    out: list[Case] = []
    for length in (1e-3, 1e3):
        for slenderness in (10.0, 1e4):
            for density in (1.0, 2e4):
                out.append(
                    Case(
                        "pairs", length=length, slenderness=slenderness, density=density, space=True
                    )
                )
    for tip in (0.0, 1e4):
        for hub in (1e-3, 1e6):
            for joint in (1e-6, 1e6):
                out.append(Case("pairs", tip=tip, hub=hub, joint=joint, target="hub", modes=3))
    for taper in (1e-2, 1e2):
        for tip in (0.0, 1e4):
            for n in (1, 4, 7, 10):
                out.append(Case("pairs", taper=taper, tip=tip, modes=n))
    return out


def _spread() -> list[Case]:
    """A Latin hypercube: every range is met evenly, all ranges at once."""
    rng = np.random.default_rng(SEED)
    names = list(RANGES)
    grid = np.column_stack([(rng.permutation(SPREAD) + rng.random(SPREAD)) / SPREAD for _ in names])
    out: list[Case] = []
    for i, row in enumerate(grid):
        at = {
            n: low + float(u) * (high - low)
            for n, u, (low, high) in zip(names, row, RANGES.values(), strict=True)
        }
        chance = rng.random(5)
        space = bool(chance[0] < 0.15)
        modes = round(at["modes"])
        out.append(
            Case(
                f"spread {i}",
                length=10.0 ** at["length"],
                slenderness=10.0 ** at["slenderness"],
                modulus=10.0 ** at["modulus"],
                density=10.0 ** at["density"],
                tip=10.0 ** at["tip"] if chance[1] < 0.6 else 0.0,
                hub=10.0 ** at["hub"],
                damping=at["damping"] if chance[2] < 0.5 else 0.0,
                taper=10.0 ** at["taper"] if chance[3] < 0.6 else 1.0,
                joint=10.0 ** at["joint"] if chance[4] < 0.5 else 0.0,
                joint_at=("root", "middle")[i % 2],
                modes=min(modes, 3) if space else modes,
                target=("clamped", "hub", "clamped", "free")[i % 4],
                space=space,
            )
        )
    return out
