"""From the hinges of an appendage in a compiled spacecraft back to its modes, and from these to
what happens inside it, as matrices.

Theory: docs/theory.md, section 10.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from beamchain.chain.chain import Chain, Tendon
from beamchain.chain.tendons import group_motion, port_rows, springs_as_modes
from beamchain.craft.appendage import Appendage
from beamchain.craft.loads import split_port
from beamchain.engine.library import mujoco
from beamchain.engine.root_motion import Motion, Root
from beamchain.errors import InputError
from beamchain.fitting.exact import SHAPED, reduced_to_kept
from beamchain.fitting.result import Fit
from beamchain.mjcf.write import joint_name
from beamchain.ports.motions import PORT_MOTION, PORTS, Array
from beamchain.structure.recovery_rows import OutputMatrices, RecoveryRows, delivered_outputs
from beamchain.structure.section_loads import MOTION, inside_beam, section_outputs

SAME = 1e-5  # relative: frequencies of the modes as kept, and as found again
MOST_KNOWN = 16  # beams at their stations that are kept for further calls


class Coordinates(NamedTuple):
    """The coordinates of the kept modes per motion of the model.

    Args:
        amplitudes: `(n, nq)` per position.
        rates: `(n, nv)` per rate, or of their rates per acceleration.
    """

    amplitudes: Array
    rates: Array

    def along(self, motion: Motion) -> Motion:
        """A run in these coordinates."""
        return Motion(
            motion.qpos @ self.amplitudes.T,
            motion.qvel @ self.rates.T,
            motion.qacc @ self.rates.T,
            motion.roots,
        )


@dataclass(frozen=True, eq=False)
class RecoveredBody:
    """An appendage whose inside is recovered.

    Args:
        tendons: `(n,)` of the kept modes; in the file, springs may stand on hinges instead.
        turn: `(n, n)` of the tendons' coordinates into those of the modes that were kept.
        outputs: what happens inside it, over the kept modes.
    """

    tendons: tuple[Tendon, ...]
    turn: Array
    outputs: OutputMatrices

    def coordinates(self, model: "mujoco.MjModel", appendage: Appendage) -> Coordinates:
        """The modal coordinates of the appendage in a model, by the force that strain makes.

        The force is that of the stiffness with which `model` was stepped: timing of a tree
        changes it.
        """
        name, prefix = appendage.spec.name, appendage.prefix
        joints = {
            (i, port): int(model.joint(prefix + joint_name(name, i + 1, port)[len(name) + 1 :]).id)
            for i, port in dict.fromkeys(f for tendon in self.tendons for f in tendon.freedoms)
        }
        forces = np.zeros((len(self.tendons), model.nq))
        lengths = np.zeros((len(self.tendons), model.nv))
        for k, tendon in enumerate(self.tendons):
            kind = mujoco.mjtObj.mjOBJ_TENDON
            number = mujoco.mj_name2id(model, kind, prefix + tendon.label)
            stiffness = tendon.stiffness if number < 0 else model.tendon_stiffness[number]
            over = [joints[f] for f in tendon.freedoms]
            forces[k, model.jnt_qposadr[over]] = stiffness * tendon.coefficients
            lengths[k, model.jnt_dofadr[over]] = tendon.coefficients
        # W^2 eta = T K b q
        amplitudes = self.turn @ forces / self.outputs.frequencies[:, None] ** 2
        return Coordinates(amplitudes, self.turn @ lengths)


def root_of(model: "mujoco.MjModel", appendage: Appendage, appendages: Sequence[Appendage]) -> Root:
    """Where an appendage stands in the model, and what its ports carry."""
    prefix = appendage.prefix
    top = int(model.body(f"{prefix}link1").id)
    links = {top}
    port_of: dict[str, str] = {
        name: port for port, names in appendage.carries.items() for name in names
    }
    known = {a.at: a for a in appendages}
    for other in appendages:
        on_port = split_port(other.at, known)
        if on_port is not None and on_port[0] == appendage.at:
            port_of[f"{other.prefix}link1"] = on_port[1]
    count = len(appendage.fit.chain.links)
    names = {f"{prefix}link{i + 1}" for i in range(count)}
    carried: list[tuple[int, int]] = []
    for body in range(top + 1, model.nbody):
        if int(model.body_parentid[body]) not in links:
            continue
        name = model.body(body).name
        if name in names:
            links.add(body)
        elif name in port_of:
            carried.append((body, int(model.site(f"{prefix}{port_of[name]}").id)))
        else:
            raise InputError(
                f"body {name or body!r} hangs on the appendage at {appendage.at}, and on none of "
                "its ports, so that loads inside the appendage cannot be recovered; hang it on a "
                "port (embed --carry)."
            )
    return Root(top, tuple(carried))


# -- bodies ----------------------------------------------------------------------------------------
def _on_tendons(chain: Chain) -> Chain:
    """The chain with a tendon per mode, where its springs stand on hinges."""
    if any(tendon.stiffness > 0.0 for tendon in chain.tendons):
        return chain
    return springs_as_modes(chain, {p: np.zeros(chain.port(p).modes) for p in chain.ports})


def _check_same(appendage: Appendage, found: Array, kept: Array) -> None:
    """The modes that are found again are those that the file holds."""
    if found.shape != kept.shape or np.any(np.abs(found / kept - 1.0) > SAME):
        raise InputError(
            f"the modes of the appendage at {appendage.at} are not those of its specification any "
            "more, so that nothing inside it can be recovered; embed it again."
        )


@lru_cache(maxsize=MOST_KNOWN)
def recovered_beam(appendage: Appendage, stations: tuple[float, ...]) -> RecoveredBody:
    """A beam with loads and motion of its sections at stations [m], as `snapped` leaves them."""
    fit = appendage.fit
    beam, chain = fit.spec.beam, _on_tendons(fit.chain)
    by_label = {tendon.label: tendon for tendon in chain.tendons if tendon.stiffness > 0.0}
    kept = {} if appendage.rigid else fit.kept.counts
    counts = {port: kept.get(port, 0) for port in PORTS}
    x, points = np.array(stations), tuple(fit.spec.further.values())
    ports = [
        inside_beam(
            beam,
            port,
            2 * counts[port] + SHAPED,
            partial(reduced_to_kept, fit.body, fit.kept, port, counts[port]),
            x,
            points,
        )
        for port in PORTS
    ]
    outputs = section_outputs(beam, ports, x, points)
    targets = {port: fit.target[port] for port in PORTS if counts[port]}
    wanted = np.concatenate([np.zeros(0), *(target.frequencies for target in targets.values())])
    _check_same(appendage, outputs.frequencies, wanted)
    tendons = [
        by_label[f"mode{k + 1}_{port}"]
        for port, target in targets.items()
        for k in range(target.modes)
    ]
    turns = [_turn(fit, chain, port, counts[port]) for port in targets]
    return RecoveredBody(tuple(tendons), block_diag(np.zeros((0, 0)), *turns), outputs)


def tip_displacement(model: "mujoco.MjModel", appendage: Appendage, port: str) -> Array:
    """`(nv,)` displacement of a beam's tip in a port per motion of the model, in its own modes:
    the last link of the chain moves otherwise."""
    body = recovered_beam(appendage, (appendage.fit.spec.beam.length,))
    motion = PORT_MOTION[port][:, 0] @ body.outputs.modes[0, MOTION]
    return motion @ body.coordinates(model, appendage).rates


def _turn(fit: Fit, chain: Chain, port: str, count: int) -> Array:
    """`(n, n)` from the coordinates of a port's tendons to those of the modes, of which all beyond
    `count` are attachment modes: where there are fillers, the file has combinations of these.

    By the motion of the further points, `tau_tendons = tau_modes turn`.
    """
    target = fit.target[port]
    turn = np.eye(target.modes)
    if target.modes == count:
        return turn
    tendons = [t for t in chain.tendons if t.stiffness > 0.0 and t.label.endswith(f"_{port}")]
    freedoms = chain.freedoms([port])
    shapes = np.linalg.inv(np.array([t.coefficients for t in tendons]))[:, count : target.modes]
    motion = group_motion([port])
    places = fit.spec.further.values()
    moved = np.vstack([port_rows(chain, freedoms, motion, x) for x in places]) @ shapes
    wanted = target.point_motion([*places])[count:].reshape(target.modes - count, -1).T
    turn[count:, count:] = np.linalg.lstsq(wanted, moved, rcond=None)[0]
    return turn


# -- imported modes --------------------------------------------------------------------------------
def recovered_delivery(appendage: Appendage, rows: RecoveryRows | None) -> RecoveredBody:
    """Imported modes with recovery rows over all modes of their file."""
    space, imported = appendage.fit.space, appendage.fit.spec.imported
    assert space is not None
    assert imported is not None
    data = space.data
    chain = _on_tendons(appendage.fit.chain)
    tendons = [t for t in chain.tendons if t.stiffness > 0.0 and t.is_mode and not appendage.rigid]
    kept, frequencies = np.zeros((len(tendons), data.modes)), np.zeros(len(tendons))
    for k, tendon in enumerate(tendons):
        along, frequencies[k] = _kept_mode(appendage, tendon.label)
        felt = _participation(chain, tendon) @ (along @ data.participation)
        kept[k] = -along if felt < 0.0 else along
    _check_same(appendage, np.sqrt([tendon.stiffness for tendon in tendons]), frequencies)
    outputs = delivered_outputs(data, kept, frequencies, rows, imported.units.si)
    return RecoveredBody(tuple(tendons), np.eye(len(tendons)), outputs)


def _kept_mode(appendage: Appendage, label: str) -> tuple[Array, float]:
    """`(N,)` the mode of a tendon in terms of all modes, and its frequency [rad/s]."""
    fit, space = appendage.fit, appendage.fit.space
    assert space is not None
    data = space.data
    if fit.kept_for == "clamped":
        k = space.in_file(label) - 1
        return np.eye(data.modes)[k], float(data.frequencies[k])
    number, _, port = label.removeprefix("mode").partition("_")
    if not port:
        raise InputError(
            f"the modes of the appendage at {appendage.at} couple its ports and are those of a "
            f'{fit.kept_for} root; rows over the modes of the file need target = "clamped".'
        )
    belongs = np.flatnonzero([mode_port == port for mode_port in data.belongs])
    whole = data.port(port, own=True).replaced(tip=np.eye(data.modes)[belongs])
    count = int(np.sum(np.isin(belongs + 1, space.numbers)))
    model = reduced_to_kept(fit.body, fit.kept, port, count, whole, ())
    assert model.tip is not None
    return model.tip[int(number) - 1], float(model.frequencies[int(number) - 1])


def _participation(chain: Chain, tendon: Tendon) -> Array:
    """`(6,)` participation of a tendon's mode in the chain."""
    beside = [
        t for t in chain.tendons if t.stiffness > 0.0 and set(t.freedoms) == set(tendon.freedoms)
    ]
    rigid, elastic = chain.rows(tendon.freedoms)
    shapes = np.linalg.inv(np.array([t.coefficients for t in beside]))
    return np.asarray(rigid.T @ elastic @ shapes[:, beside.index(tendon)], dtype=np.float64)
