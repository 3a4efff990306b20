"""Channels through which uncertain quantities act on a linear craft: `w = delta z` per channel,
theory in docs/theory.md.

A channel takes a combination z of positions, rates, accelerations, inputs and other channels,
and gives a generalised force.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from beamchain import Linear
from beamchain.toolkit import (
    AXES,
    OF_MODES,
    Array,
    Input,
    Inputs,
    LinearCraft,
    OperatingPoint,
    Outputs,
    Quantity,
    Signal,
    along,
    mujoco,
)

Through = Mapping[int, float]
ACROSS = ((1, 2), (0, 2), (0, 1))  # components of `omega x e_i` that are not zero


class Channels:
    """Channels of a craft with so many degrees of freedom and inputs, collected one by one."""

    def __init__(self, nv: int, inputs: int) -> None:
        self.of: list[int] = []
        self._forces: list[Array] = []
        self._rows: list[list[Array]] = []
        self._through: list[Through] = []
        self._sizes = {"position": nv, "rate": nv, "acceleration": nv, "input": inputs}

    def add(
        self,
        quantity: int,
        force: Array,
        through: Through | None = None,
        feedback: float = 0.0,
        **rows: Array,
    ) -> int:
        """One more channel of a quantity, with the generalised force `(nv,)` for w = 1; its number.

        Its z takes `through` of the w of other channels, `feedback` of its own w, and `rows` of
        `position`, `rate`, `acceleration` and `input`.
        """
        number = len(self.of)
        self._rows.append([rows.get(word, np.zeros(size)) for word, size in self._sizes.items()])
        self._through.append({**(through or {}), number: feedback})
        self._forces.append(force)
        self.of.append(quantity)
        return number

    def add_to(self, linear: Linear, order: Sequence[int], reach: Array) -> Linear:
        """The craft with the channels before its inputs and outputs, in this order,
        z times `reach`."""
        count = len(self.of)
        pick = list(order)
        through = np.zeros((count, count))
        for i, weights in enumerate(self._through):
            for j, value in weights.items():
                through[i, j] = value
        scale = reach[pick, None]
        y0, y1, y2, yu = (np.array(part)[pick] * scale for part in zip(*self._rows, strict=True))
        inputs = linear.inputs
        outputs = linear.outputs
        activations = linear.activations
        of_channels = np.hstack([through[np.ix_(pick, pick)] * scale, yu])
        of_outputs = np.pad(outputs.feedthrough, ((0, 0), (count, 0)))
        return replace(
            linear,
            inputs=Inputs(
                (*(Signal(f"w{k + 1}", "") for k in range(count)), *inputs.signals),
                np.hstack([np.array(self._forces).T[:, pick], inputs.force]),
            ),
            outputs=Outputs(
                (*(Signal(f"z{k + 1}", "") for k in range(count)), *outputs.signals),
                position=np.vstack([y0, outputs.position]),
                rate=np.vstack([y1, outputs.rate]),
                acceleration=np.vstack([y2, outputs.acceleration]),
                feedthrough=np.vstack([of_channels, of_outputs]),
            ),
            activations=activations._replace(
                feed=np.pad(activations.feed, ((0, 0), (count, 0))),
                seen=np.pad(activations.seen, ((count, 0), (0, 0))),
            ),
        )


def channels(craft: LinearCraft, uncertain: Sequence[Quantity]) -> Channels:
    """The channels of all quantities of a craft."""
    model = craft.point.model
    out = Channels(craft.point.model.nv, len(craft.inputs))
    owners: dict[tuple[str, int], dict[str, int]] = {}
    for i, q in enumerate(uncertain):
        joint = q.kind in ("stiffness", "damping") and not q.of_mode(model)
        kind = "joint" if joint else "mode" if q.kind in OF_MODES else "body"
        owners.setdefault((kind, q.index), {})[q.kind] = i
    for (kind, index), numbers in owners.items():
        if kind == "mode":
            _add_mode(out, model, index, numbers)
        elif kind == "joint":
            line = np.eye(model.nv)[int(model.jnt_dofadr[index])]
            for name, i in numbers.items():
                out.add(i, -line, **{"position" if name == "stiffness" else "rate": line})
        else:
            _add_body(out, craft.point, craft.inputs, index, numbers)
    return out


def _add_mode(
    out: Channels, model: "mujoco.MjModel", tendon: int, numbers: Mapping[str, int]
) -> None:
    """`f = -(E/p^2 - E0)` along the tendon, `E = eta'' + w (w eta + 2 zeta eta')`,
    in nested channels."""
    line = along(model, tendon)
    w = float(np.sqrt(model.tendon_stiffness[tendon]))
    twice = float(model.tendon_damping[tendon]) / w  # 2 zeta
    # what the channels add to z_2 = w eta + 2 zeta eta', and to E = eta'' + w z_2
    to_z2 = dict[int, float]()
    to_e = dict[int, float]()
    if "frequency" in numbers:
        # z_1 = eta
        z1 = out.add(numbers["frequency"], -w * line, position=line)
        to_z2[z1] = 1.0
    if "damping" in numbers:
        # z_zeta = 2 eta'
        z_zeta = out.add(numbers["damping"], -w * line, rate=2.0 * line)
        to_z2[z_zeta] = 1.0
    if "frequency" in numbers:
        # z_2 = w eta + 2 zeta eta' + w_1 + w_zeta
        z2 = out.add(numbers["frequency"], -line, to_z2, position=w * line, rate=twice * line)
        to_e[z2] = 1.0
    to_e |= dict.fromkeys(to_z2, w)
    if "participation" in numbers:
        # z_3 = E - w_3, z_4 = z_3 - w_4
        number = numbers["participation"]
        rows = {"position": w**2 * line, "rate": w * twice * line, "acceleration": line}
        z3 = out.add(number, line, to_e, feedback=-1.0, **rows)
        out.add(number, line, {**to_e, z3: -1.0}, feedback=-1.0, **rows)


def _add_body(
    out: Channels,
    point: OperatingPoint,
    inputs: Sequence[Input],
    body: int,
    numbers: Mapping[str, int],
) -> None:
    """Mass on the motion of the mass centre,
    the centre once in that motion and once in the arm of its force."""
    model = point.model
    data = point.data()
    translation = np.zeros((3, model.nv))
    rotation = np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, translation, rotation, body)
    axes = data.xmat[body].reshape(3, 3)
    mass = float(model.body_mass[body])
    moved = axes.T @ translation
    turned = axes.T @ rotation
    # what each input does to the mass centre, in the body's axes
    pushed = np.zeros((3, len(inputs)))
    for column, signal in enumerate(inputs):
        for weight, part in signal.simple:
            if part.centre and part.body == body and part.wrench is not None:
                pushed[:, column] += weight * axes.T @ part.wrench[:3]
    centres = [
        (numbers[f"centre_{axis}"], k) for k, axis in enumerate(AXES) if f"centre_{axis}" in numbers
    ]
    # `omega x e_k` per degree of freedom
    swung = {k: np.cross(turned, np.eye(3)[k], axisa=0).T for _, k in centres}
    # what the channels add to the force at the mass centre
    added: list[dict[int, float]] = [{}, {}, {}]
    for i, k in centres:
        for part in ACROSS[k]:
            added[part][out.add(i, -mass * moved[part], acceleration=swung[k][part])] = -mass
    if "mass" in numbers:
        for part, before in enumerate(added):
            through = {channel: -value / mass for channel, value in before.items()}
            before[out.add(numbers["mass"], -moved[part], through, acceleration=moved[part])] = -1.0
    for i, k in centres:
        for part in ACROSS[k]:
            out.add(
                i, swung[k][part], added[part], acceleration=-mass * moved[part], input=pushed[part]
            )
    for kind, i in numbers.items():
        if kind.startswith("inertia"):
            first, second = (turned[AXES.index(axis)] for axis in kind[-2:])
            # f = -I_ab (J_a^T J_b + J_b^T J_a) q''
            out.add(i, -first, acceleration=second)
            if kind[-1] != kind[-2]:
                out.add(i, -second, acceleration=first)
