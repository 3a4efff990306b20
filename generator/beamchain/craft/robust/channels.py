"""Channels through which uncertain quantities act on a linear craft: `w = delta z` per channel, theory in docs/theory.md.

A channel takes a combination z of positions, rates, accelerations, inputs and other channels, and gives a generalised force.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from beamchain.craft.plants.craft_modes import LinearCraft
from beamchain.craft.plants.operating_point import OperatingPoint
from beamchain.craft.plants.second_order import SecondOrder
from beamchain.craft.plants.signals import Input
from beamchain.craft.variants.quantities import AXES, Quantity
from beamchain.engine.forces import along
from beamchain.engine.library import mujoco
from beamchain.fitting.uncertain import OF_MODES
from beamchain.ports.motions import Array

Through = Mapping[int, float]
ACROSS = ((1, 2), (0, 2), (0, 1))  # components of `omega x e_i` that are not zero


class Channels:
    """Channels of a craft with so many degrees of freedom and inputs, collected one by one."""

    def __init__(self, nv: int, inputs: int) -> None:
        self.of: list[int] = []
        self._forces, self._rows, self._through = list[Array](), list[list[Array]](), list[Through]()
        self._sizes = {"position": nv, "rate": nv, "acceleration": nv, "input": inputs}

    def add(self, quantity: int, force: Array, through: Through | None = None, own: float = 0.0, **rows: Array) -> int:
        """One more channel of a quantity, with the generalised force `(nv,)` for w = 1; its number.

        Its z takes `through` of the w of other channels, `own` of its own, and `rows` of `position`, `rate`,
        `acceleration` and `input`.
        """
        number = len(self.of)
        self._rows.append([rows.get(word, np.zeros(size)) for word, size in self._sizes.items()])
        self._through.append({**(through or {}), number: own})
        self._forces.append(force)
        self.of.append(quantity)
        return number

    def put(self, linear: SecondOrder, order: Sequence[int], reach: Array) -> SecondOrder:
        """The craft with the channels before its inputs and outputs, in this order, z times `reach`."""
        count, pick = len(self.of), list(order)
        through = np.zeros((count, count))
        for i, those in enumerate(self._through):
            for j, value in those.items():
                through[i, j] = value
        scale = reach[pick, None]
        y0, y1, y2, yu = (np.array(part)[pick] * scale for part in zip(*self._rows, strict=True))
        direct = np.hstack([through[np.ix_(pick, pick)] * scale, yu])
        return replace(
            linear,
            force=np.hstack([np.array(self._forces).T[:, pick], linear.force]),
            feed=np.pad(linear.feed, ((0, 0), (count, 0))),
            of_position=np.vstack([y0, linear.of_position]),
            of_rate=np.vstack([y1, linear.of_rate]),
            of_acceleration=np.vstack([y2, linear.of_acceleration]),
            of_activation=np.pad(linear.of_activation, ((count, 0), (0, 0))),
            of_input=np.vstack([direct, np.pad(linear.of_input, ((0, 0), (count, 0)))]),
        )


def channels(craft: LinearCraft, found: Sequence[Quantity]) -> Channels:
    """The channels of all quantities of a craft."""
    model, out = craft.point.model, Channels(craft.point.model.nv, len(craft.inputs))
    owners: dict[tuple[str, int], dict[str, int]] = {}
    for i, q in enumerate(found):
        joint = q.kind in ("stiffness", "damping") and not q.of_mode(model)
        kind = "joint" if joint else "mode" if q.kind in OF_MODES else "body"
        owners.setdefault((kind, q.index), {})[q.kind] = i
    for (kind, index), those in owners.items():
        if kind == "mode":
            _mode(out, model, index, those)
        elif kind == "joint":
            line = np.eye(model.nv)[int(model.jnt_dofadr[index])]
            for name, i in those.items():
                out.add(i, -line, **{"position" if name == "stiffness" else "rate": line})
        else:
            _body(out, craft.point, craft.inputs, index, those)
    return out


def _mode(out: Channels, model: "mujoco.MjModel", tendon: int, those: Mapping[str, int]) -> None:
    """`f = -(E/p^2 - E0)` along the tendon, `E = eta'' + w (w eta + 2 zeta eta')`, in nested channels."""
    line, w = along(model, tendon), float(np.sqrt(model.tendon_stiffness[tendon]))
    twice = float(model.tendon_damping[tendon]) / w  # 2 zeta
    inner, more = dict[int, float](), dict[int, float]()  # what the channels add to w eta + 2 zeta eta', and to E
    if "frequency" in those:
        inner[out.add(those["frequency"], -w * line, position=line)] = 1.0
    if "damping" in those:
        inner[out.add(those["damping"], -w * line, rate=2.0 * line)] = 1.0
    if "frequency" in those:
        more[out.add(those["frequency"], -line, inner, position=w * line, rate=twice * line)] = 1.0
    more |= dict.fromkeys(inner, w)
    if "participation" in those:
        rows = {"position": w**2 * line, "rate": w * twice * line, "acceleration": line}
        first = out.add(those["participation"], line, more, own=-1.0, **rows)
        out.add(those["participation"], line, {**more, first: -1.0}, own=-1.0, **rows)


def _body(out: Channels, point: OperatingPoint, inputs: Sequence[Input], body: int, those: Mapping[str, int]) -> None:
    """Mass on the motion of the mass centre, the centre once in that motion and once in the arm of its force."""
    model, data = point.model, point.data()
    jacobians = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, *jacobians, body)
    axes, mass = data.xmat[body].reshape(3, 3), float(model.body_mass[body])
    moved, turned = (axes.T @ jacobian for jacobian in jacobians)
    pushed = np.array([axes.T @ i.wrench[:3] if i.centre and i.body == body and i.wrench is not None else np.zeros(3)
                       for i in inputs]).reshape(len(inputs), 3).T  # fmt: skip
    centres = [(those[f"centre_{axis}"], k) for k, axis in enumerate(AXES) if f"centre_{axis}" in those]
    swung = {k: np.cross(turned, np.eye(3)[k], axisa=0).T for _, k in centres}  # `omega x e_k` per degree of freedom
    added: list[dict[int, float]] = [{}, {}, {}]  # what the channels add to the force at the mass centre
    for i, k in centres:
        for part in ACROSS[k]:
            added[part][out.add(i, -mass * moved[part], acceleration=swung[k][part])] = -mass
    if "mass" in those:
        for part, before in enumerate(added):
            through = {channel: -value / mass for channel, value in before.items()}
            before[out.add(those["mass"], -moved[part], through, acceleration=moved[part])] = -1.0
    for i, k in centres:
        for part in ACROSS[k]:
            out.add(i, swung[k][part], added[part], acceleration=-mass * moved[part], input=pushed[part])
    for kind, i in those.items():
        if kind.startswith("inertia"):
            one, two = (turned[AXES.index(axis)] for axis in kind[-2:])
            out.add(i, -one, acceleration=two)
            if kind[-1] != kind[-2]:
                out.add(i, -two, acceleration=one)
