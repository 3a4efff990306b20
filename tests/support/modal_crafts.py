"""Planar craft made by hand: a hub and appendages whose springs are modal tendons, as MJCF and in
the tests' own solver.

The appendages' bodies are those of a fitted chain; everything else (mass matrices, modes, tendon
coefficients, the exact motion) is worked out apart from the package.
"""

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from scipy.linalg import expm

import beamchain as bc
import solver
from appendages import STEEL, seed_boom
from beamchain import Beam, Round, Segment
from mechanics import INTEGRATORS, system_matrix

Z = (0.0, 0.0, 1.0)


@cache
def chain_of(kind: str, modes: int):
    """A fitted chain: "seed" (13 kg) or rods of 4 and 36 kg."""
    if kind == "seed":
        beam = seed_boom()
    else:
        diameter, length = {"light": (0.0085, 9.0), "heavy": (0.02, 14.7), "stub": (0.01, 5.0)}[
            kind
        ]
        beam = Beam(
            segments=(Segment(length=length, section=Round(diameter=diameter), material=STEEL),)
        )
    return bc.fit(beam, modes={"xy": modes}).chain


def hang(whole, frame, chain):
    """Put a chain's links on a frame of a craft, its hinges without springs."""
    bodies = [(link.mass, link.com, link.inertia[2]) for link in chain.links]
    whole.links(frame, bodies, [(hinge.x, 0.0) for hinge in chain.hinges])


@cache
def modes_of(kind: str, modes: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies of a chain with its root held, and its modes as rows over its hinges."""
    chain, whole = chain_of(kind, modes), solver.Craft()
    hang(whole, whole.base, chain)
    stiffness = np.diag([hinge.stiffness["xy"] for hinge in chain.hinges])
    w, shapes = solver.normal_modes(whole.matrices()[0][6:, 6:], stiffness)
    return w, np.linalg.inv(shapes)


@dataclass(frozen=True)
class Craft:
    """A craft: MJCF and its matrices over (hub x, y, rotation, hinges of each appendage)."""

    xml: str
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray

    def model(self, h: float, integrator: str = "Euler") -> mujoco.MjModel:
        model = mujoco.MjModel.from_xml_string(self.xml)
        model.opt.timestep = h
        model.opt.integrator = INTEGRATORS[integrator]
        return model

    def poles(self) -> np.ndarray:
        s = np.linalg.eigvals(system_matrix(self.mass, self.damping, self.stiffness))
        s = s[s.imag > 1e-6 * np.max(np.abs(s))]
        return s[np.argsort(np.abs(s))]

    def frequencies(self) -> np.ndarray:
        return solver.normal_modes(self.mass, self.stiffness, 1e-2)[0][3:]

    def stepper(self, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Exact map of the state and of a wrench held over the step."""
        f = system_matrix(self.mass, self.damping, self.stiffness)
        n = self.mass.shape[0]
        g = np.vstack([np.zeros((n, n)), np.linalg.inv(self.mass)])
        both = expm(np.block([[f, g], [np.zeros((n, 3 * n))]]) * h)
        return both[: 2 * n, : 2 * n], both[: 2 * n, 2 * n :]


def number(values) -> str:
    return " ".join(repr(float(v)) for v in np.atleast_1d(values))


def craft(parts, mass, inertia, offset=1.0, ratio=0.0, scale=1.0) -> Craft:
    """A hub with appendages.

    Args:
        parts: `(kind, modes, angle at which it stands off)`.
        mass, inertia: of the hub; offset: of the roots from its centre.
        ratio: damping ratio of every mode; a tuple: per mode.
        scale: factor on all frequencies.
    """
    whole = solver.Craft()
    whole.body(whole.base, mass, inertia=(inertia,) * 3)
    bodies, tendons = [], []
    for count, (kind, modes, angle) in enumerate(parts, 1):
        name, chain, first = f"boom{count}", chain_of(kind, modes), whole.size
        root = offset * np.cos(angle), offset * np.sin(angle)
        hang(whole, whole.base.at((*root, 0.0), solver.rotation(Z, angle)), chain)
        w, own = modes_of(kind, modes)
        w = w * scale
        rates = 2.0 * np.broadcast_to(ratio, w.shape) * w
        rows = np.hstack([np.zeros((w.size, first)), own])
        whole.add("stiffness", rows, np.diag(w**2))
        whole.add("damping", rows, np.diag(rates))
        bodies.append(body_text(chain, name, root, angle))
        for i, row in enumerate(own):
            joints = "".join(
                f'<joint joint="{name}_hinge{j + 1}_xy" coef="{number(c)}"/>'
                for j, c in enumerate(row)
            )
            tendons.append(
                f'<fixed name="{name}_mode{i + 1}_xy" limited="false" '
                f'stiffness="{number(w[i] ** 2)}" damping="{number(rates[i])}" '
                f'armature="0" frictionloss="0" springlength="0">{joints}</fixed>'
            )
    xml = f"""<mujoco model="craft"><compiler angle="radian"/><option gravity="0 0 0">
    <flag contact="disable"/></option>
<worldbody><body name="hub"><joint name="hub_x" type="slide" axis="1 0 0"/>
<joint name="hub_y" type="slide" axis="0 1 0"/>
<joint name="hub_turn" type="hinge" axis="0 0 1"/>
<inertial pos="0 0 0" mass="{number(mass)}"
diaginertia="{number([inertia, inertia, inertia])}"/>{"".join(bodies)}</body></worldbody>
<tendon>{"".join(tendons)}</tendon></mujoco>"""
    plane = np.ix_(*[[0, 1, 5, *range(6, whole.size)]] * 2)
    return Craft(xml, *(matrix[plane] for matrix in whole.matrices()))


def body_text(chain, name, at, angle) -> str:
    text = ""
    starts = [0.0] + [h.x for h in chain.hinges]
    for i in reversed(range(len(chain.links))):
        link = chain.links[i]
        start = starts[i]
        joint = (
            f'<joint name="{name}_hinge{i}_xy" type="hinge" axis="0 0 1" stiffness="0" damping="0" '
            'armature="0"/>'
            if i
            else ""
        )
        place = (
            f'pos="{number(start - starts[i - 1])} 0 0"'
            if i
            else f'pos="{number(at)} 0" '
            f'quat="{number([np.cos(angle / 2), 0, 0, np.sin(angle / 2)])}"'
        )
        text = (
            f'<body name="{name}_link{i + 1}" {place}>{joint}<inertial '
            f'pos="{number(link.com - start)} 0 0" mass="{number(link.mass)}" '
            f'diaginertia="{number(link.inertia)}"/>{text}</body>'
        )
    return text
