"""Planar craft made by hand: a hub and appendages whose springs are modal tendons,
and their matrices in numpy.

The appendages' bodies are those of a fitted chain; everything else (mass matrices, modes, tendon
coefficients, the exact motion) is worked out here, apart from the package.
"""

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

import beamchain as bc
from appendages import STEEL, seed_boom
from beamchain import Beam, Round, Segment


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


@dataclass(frozen=True)
class Part:
    """An appendage in the plane: hinge mass matrix Q, coupling P to (x, y, rotation) of its root,
    rows, frequencies."""

    chain: object
    q: np.ndarray
    p: np.ndarray
    rigid: np.ndarray
    rows: np.ndarray
    w: np.ndarray


@cache
def part(kind: str, modes: int) -> Part:
    chain = chain_of(kind, modes)
    at = np.array([h.x for h in chain.hinges])
    n = at.size
    q = np.zeros((n, n))
    p = np.zeros((3, n))
    rigid = np.zeros((3, 3))
    for i, link in enumerate(chain.links):
        m = link.mass
        x = link.com
        inertia = link.inertia[2]
        arm = np.where(np.arange(n) < i, x - at, 0.0)
        turn = np.where(np.arange(n) < i, 1.0, 0.0)
        root = np.array([0.0, 1.0, x])
        q += m * np.outer(arm, arm) + inertia * np.outer(turn, turn)
        p += m * np.outer(root, arm) + inertia * np.outer([0, 0, 1], turn)
        rigid += m * np.outer(root, root) + np.diag([m, 0, inertia])
    k = np.diag([h.stiffness["xy"] for h in chain.hinges])
    square, t = eigh(k, q)
    return Part(chain, q, p, rigid, np.linalg.inv(t), np.sqrt(square))


@dataclass(frozen=True)
class Craft:
    """A craft: MJCF and its matrices over (hub x, y, rotation, hinges of each appendage)."""

    xml: str
    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray

    def model(self, h: float, integrator: str = "Euler") -> mujoco.MjModel:
        model = mujoco.MjModel.from_xml_string(self.xml)
        model.opt.timestep = h
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
        return model

    def continuous(self) -> np.ndarray:
        n = self.mass.shape[0]
        inverse = np.linalg.inv(self.mass)
        return np.block(
            [[np.zeros((n, n)), np.eye(n)], [-inverse @ self.stiffness, -inverse @ self.damping]]
        )

    def poles(self) -> np.ndarray:
        s = np.linalg.eigvals(self.continuous())
        s = s[s.imag > 1e-6 * np.max(np.abs(s))]
        return s[np.argsort(np.abs(s))]

    def frequencies(self) -> np.ndarray:
        squares = eigh(self.stiffness, self.mass, eigvals_only=True)
        return np.sqrt(squares[3:])

    def stepper(self, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Exact map of the state and of a wrench held over the step."""
        f = self.continuous()
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
    out = [part(kind, modes) for kind, modes, _ in parts]
    n = 3 + sum(a.w.size for a in out)
    m = np.zeros((n, n))
    k = np.zeros((n, n))
    d = np.zeros((n, n))
    m[:3, :3] = np.diag([mass, mass, inertia])
    bodies, tendons, first = [], [], 3
    for number_, (a, (_, _, angle)) in enumerate(zip(out, parts, strict=True), 1):
        name = f"boom{number_}"
        cos = np.cos(angle)
        sin = np.sin(angle)
        # motion of the root, in its own axes, by that of the hub
        root = np.array([[cos, sin, 0.0], [-sin, cos, offset], [0.0, 0.0, 1.0]])
        here = slice(first, first + a.w.size)
        w = a.w * scale
        ratios = np.broadcast_to(np.asarray(ratio, dtype=float), w.shape)
        m[:3, :3] += root.T @ a.rigid @ root
        m[:3, here] = root.T @ a.p
        m[here, :3] = m[:3, here].T
        m[here, here] = a.q
        k[here, here] = a.rows.T @ np.diag(w**2) @ a.rows
        d[here, here] = a.rows.T @ np.diag(2 * ratios * w) @ a.rows
        bodies.append(body_text(a.chain, name, (offset * cos, offset * sin), angle))
        for i, row in enumerate(a.rows):
            joints = "".join(
                f'<joint joint="{name}_hinge{j + 1}_xy" coef="{number(c)}"/>'
                for j, c in enumerate(row)
            )
            tendons.append(
                f'<fixed name="{name}_mode{i + 1}_xy" limited="false" '
                f'stiffness="{number(w[i] ** 2)}" damping="{number(2 * ratios[i] * w[i])}" '
                f'armature="0" frictionloss="0" springlength="0">{joints}</fixed>'
            )
        first += a.w.size
    xml = f"""<mujoco model="craft"><compiler angle="radian"/><option gravity="0 0 0">
    <flag contact="disable"/></option>
<worldbody><body name="hub"><joint name="hub_x" type="slide" axis="1 0 0"/>
<joint name="hub_y" type="slide" axis="0 1 0"/>
<joint name="hub_turn" type="hinge" axis="0 0 1"/>
<inertial pos="0 0 0" mass="{number(mass)}"
diaginertia="{number([inertia, inertia, inertia])}"/>{"".join(bodies)}</body></worldbody>
<tendon>{"".join(tendons)}</tendon></mujoco>"""
    return Craft(xml, m, k, d)


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


def uniform_beam_truth(
    modes: int, mass=500.0, inertia=500.0, offset=1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Mass and squared frequencies over (hub y, hub rotation, modes) of the 2008 rod on a hub,
    from the beam's formulas."""
    length, diameter = 15.0, 0.012
    area = np.pi * diameter**2 / 4
    second = np.pi * diameter**4 / 64
    line, bend = 7800.0 * area, 2.06e11 * second
    beam = line * length
    lam = np.array(
        [
            brentq(
                lambda v: np.cos(v) + 1 / np.cosh(v),
                (i + 0.5) * np.pi - 1.0,
                (i + 0.5) * np.pi + 1.0,
            )
            for i in range(modes)
        ]
    )
    sigma = (np.cosh(lam) + np.cos(lam)) / (np.sinh(lam) + np.sin(lam))
    # mass-normalised: integral of phi = 2 sigma/lam, of x phi = 2/lam^2
    force = np.sqrt(beam) * 2 * sigma / lam
    moment = np.sqrt(beam) * length * 2 / lam**2
    rows = np.stack([force, moment + offset * force])
    x = length / 2 + offset
    rigid = np.array(
        [[mass + beam, beam * x], [beam * x, inertia + beam * (length**2 / 12 + x**2)]]
    )
    full = np.block([[rigid, rows], [rows.T, np.eye(modes)]])
    return full, bend / line * (lam / length) ** 4
