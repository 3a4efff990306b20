"""From the hinges of an appendage in a compiled spacecraft back to its modes, and from these to
what happens inside it, as matrices.

Theory: docs/theory.md, section 10.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.chain.chain import Chain, Tendon
from beamchain.chain.tendons import group_motion, port_rows, springs_as_modes
from beamchain.craft.appendage import Appendage
from beamchain.craft.loads import split_port
from beamchain.engine.library import mujoco
from beamchain.engine.root_motion import Root
from beamchain.errors import InputError
from beamchain.fitting.body import further_columns
from beamchain.fitting.exact import SHAPED, reduced_to_kept
from beamchain.fitting.hub import port_hub_mass
from beamchain.fitting.result import InSpace
from beamchain.mjcf.write import joint_name
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array, point_columns
from beamchain.structure.section_loads import Inside, inside_beam

SAME = 1e-5  # relative: frequencies of the modes as kept, and as found again


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The modes of an appendage as its file has them.

    Args:
        labels: of the modes.
        rows: `(n, f)` lengths of the modes' tendons per hinge coordinate.
        squares: `(n,)` their stiffness as fitted, frequency squared [1/s^2].
        tendons: names of the modes' tendons; where springs stand on hinges the file has none.
        qpos, dofs: `(f,)` places of the hinge coordinates in the model's.
        turn: `(n, n)` of the tendons' coordinates into those of the modes that were kept.
        frequencies: `(n,)` of the modes that were kept [rad/s].
    """

    labels: tuple[str, ...]
    rows: Array
    squares: Array
    tendons: tuple[str, ...]
    qpos: NDArray[np.intp]
    dofs: NDArray[np.intp]
    turn: Array
    frequencies: Array

    def amplitudes(self, model: "mujoco.MjModel", qpos: Array) -> Array:
        """`(t, n)` modal coordinates, by the force that strain makes, for positions `(t, nq)`.

        The force is that of the stiffness with which `model` was stepped: timing of a tree
        changes it.
        """
        stiffness = self.squares.copy()
        numbers = {str(model.tendon(i).name): i for i in range(model.ntendon)}
        for k, name in enumerate(self.tendons):
            if name in numbers:
                stiffness[k] = model.tendon_stiffness[numbers[name]]
        force = qpos[:, self.qpos] @ self.rows.T * stiffness
        return force @ self.turn.T / self.frequencies**2

    def rates(self, values: Array) -> Array:
        """`(t, n)` rates or accelerations of the modes, of those of the model `(t, nv)`."""
        return values[:, self.dofs] @ self.rows.T @ self.turn.T


class Place(NamedTuple):
    """An appendage in the model.

    Args:
        root: its first link and what its ports carry there.
        ports: number among the further points of the port that carries each of these.
    """

    root: Root
    ports: tuple[int, ...]


def place_of(
    model: "mujoco.MjModel", appendage: Appendage, appendages: Sequence[Appendage]
) -> Place:
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
    ports: list[int] = []
    further = list(appendage.fit.spec.further)
    for body in range(top + 1, model.nbody):
        if int(model.body_parentid[body]) not in links:
            continue
        name = model.body(body).name
        if name in names:
            links.add(body)
        elif name in port_of:
            port = port_of[name]
            carried.append((body, int(model.site(f"{prefix}{port}").id)))
            ports.append(further.index(port))
        else:
            raise InputError(
                f"body {name or body!r} hangs on the appendage at {appendage.at}, and on none of "
                "its ports, so that loads inside the appendage cannot be recovered; hang it on a "
                "port (embed --carry)."
            )
    return Place(Root(top, tuple(carried)), tuple(ports))


# -- modal coordinates -----------------------------------------------------------------------------
def _on_tendons(chain: Chain) -> Chain:
    """The chain with a tendon per mode, where its springs stand on hinges."""
    if any(tendon.stiffness > 0.0 for tendon in chain.tendons):
        return chain
    return springs_as_modes(chain, {p: np.zeros(chain.port(p).modes) for p in chain.ports})


def _coordinates(
    model: "mujoco.MjModel",
    appendage: Appendage,
    tendons: Sequence[Tendon],
    turn: Array,
    frequencies: Array,
) -> Coordinates:
    freedoms = list(dict.fromkeys(f for tendon in tendons for f in tendon.freedoms))
    name = appendage.spec.name
    joints = [
        int(model.joint(appendage.prefix + joint_name(name, i + 1, port)[len(name) + 1 :]).id)
        for i, port in freedoms
    ]
    rows = np.zeros((len(tendons), len(freedoms)))
    for row, tendon in zip(rows, tendons, strict=True):
        row[[freedoms.index(f) for f in tendon.freedoms]] = tendon.coefficients
    return Coordinates(
        tuple(tendon.label for tendon in tendons),
        rows,
        np.array([tendon.stiffness for tendon in tendons]),
        tuple(f"{appendage.prefix}{tendon.label}" for tendon in tendons),
        np.array(model.jnt_qposadr[joints], dtype=np.intp).reshape(-1),
        np.array(model.jnt_dofadr[joints], dtype=np.intp).reshape(-1),
        turn,
        frequencies,
    )


def _check_same(appendage: Appendage, found: Array, kept: Array) -> None:
    """The modes that are found again are those that the file holds."""
    if found.shape != kept.shape or np.any(np.abs(found / kept - 1.0) > SAME):
        raise InputError(
            f"the modes of the appendage at {appendage.at} are not those of its specification any "
            "more, so that nothing inside it can be recovered; embed it again."
        )


# -- beams -----------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class BeamBody:
    """A beam in the model: per port its modes, and what they do at the stations."""

    coordinates: Mapping[str, Coordinates]
    ports: Mapping[str, Inside]


def beam_body(model: "mujoco.MjModel", appendage: Appendage, stations: Array) -> BeamBody:
    """The modes of a beam and what they do at stations `(s,)` [m]."""
    fit = appendage.fit
    chain = _on_tendons(fit.chain)
    by_label = {tendon.label: tendon for tendon in chain.tendons if tendon.stiffness > 0.0}
    coordinates: dict[str, Coordinates] = {}
    ports: dict[str, Inside] = {}
    counts = {} if appendage.rigid else fit.kept.counts
    for port in PORTS:
        count = counts.get(port, 0)
        inside = inside_beam(
            fit.spec.beam,
            port,
            2 * count + SHAPED,
            partial(reduced_to_kept, fit.body, fit.kept, port, count),
            stations,
            tuple(fit.spec.further.values()),
        )
        if inside is None:
            continue
        ports[port] = inside
        if not count:
            continue
        target = fit.target[port]
        _check_same(appendage, inside.frequencies, target.frequencies)
        tendons = [by_label[f"mode{k + 1}_{port}"] for k in range(target.modes)]
        turn = np.eye(target.modes)
        if target.modes > count:
            turn[count:, count:] = _attachment_turn(appendage, chain, port, count)
        coordinates[port] = _coordinates(model, appendage, tendons, turn, inside.frequencies)
    return BeamBody(coordinates, ports)


def tip_displacement(model: "mujoco.MjModel", appendage: Appendage, port: str) -> Array:
    """`(nv,)` displacement of a beam's tip in a port per motion of the model, in its own modes:
    the last link of the chain moves otherwise."""
    tip = appendage.fit.target[port].tip
    body = beam_body(model, appendage, np.array([appendage.fit.spec.beam.length]))
    assert tip is not None
    modes = body.coordinates[port].rates(np.eye(model.nv))
    return np.asarray(modes @ tip[:, 0], dtype=np.float64)


def _attachment_turn(appendage: Appendage, chain: Chain, port: str, count: int) -> Array:
    """`(a, a)` from the coordinates of the last a tendons to those of the attachment modes: where
    there are fillers, the file has combinations of them.

    By the motion of the further points, `tau_tendons = tau_modes turn`.
    """
    fit = appendage.fit
    target = fit.target[port]
    tendons = [t for t in chain.tendons if t.stiffness > 0.0 and t.label.endswith(f"_{port}")]
    freedoms = chain.freedoms([port])
    shapes = np.linalg.inv(np.array([t.coefficients for t in tendons]))[:, count : target.modes]
    motion = group_motion([port])
    places = fit.spec.further.values()
    moved = np.vstack([port_rows(chain, freedoms, motion, x) for x in places]) @ shapes
    assert target.tip is not None
    columns = point_columns(further_columns(fit.spec), target.motions)
    wanted = target.tip[count:, columns].T
    return np.asarray(np.linalg.lstsq(wanted, moved, rcond=None)[0], dtype=np.float64)


# -- imported modes --------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class ImportedBody:
    """Imported modes in the model.

    Args:
        coordinates: of the kept modes; None where the body is rigid.
        kept: `(k, N)` each kept mode in terms of all N modes of the file.
        static: `(N, 6)` coordinates of the file's modes per constant acceleration of the root,
            those that are kept left out.
    """

    coordinates: Coordinates | None
    kept: Array
    static: Array


def imported_body(model: "mujoco.MjModel", appendage: Appendage) -> ImportedBody:
    """The kept modes of an imported body in terms of those of its file, whose coordinates are
    those of mass-normalised modes in SI."""
    space = appendage.fit.space
    assert space is not None
    data = space.data
    chain = _on_tendons(appendage.fit.chain)
    tendons = [t for t in chain.tendons if t.stiffness > 0.0 and t.is_mode]
    if appendage.rigid:
        tendons = []
    by_word = {word: _kept_modes(appendage, space, word) for word in map(_word, _labels(tendons))}
    kept = np.zeros((len(tendons), data.modes))
    frequencies = np.zeros(len(tendons))
    for k, tendon in enumerate(tendons):
        modes = by_word[_word(tendon.label)]
        number = int(tendon.label.removeprefix("mode").partition("_")[0]) - 1
        assert modes.tip is not None
        along = modes.tip[number]
        felt = _participation(chain, tendon) @ (along @ data.participation)
        kept[k] = -along if felt < 0.0 else along
        frequencies[k] = modes.frequencies[number]
    # W^-2 L of all modes less that of the kept ones
    flexible = data.participation / data.frequencies[:, None] ** 2
    held = kept.T @ ((kept @ data.participation) / frequencies[:, None] ** 2)
    coordinates = None
    if tendons:
        turn = np.eye(len(tendons))
        coordinates = _coordinates(model, appendage, tendons, turn, frequencies)
        _check_same(appendage, np.sqrt(coordinates.squares), frequencies)
    in_file = data.in_file
    return ImportedBody(coordinates, kept @ in_file, in_file.T @ (held - flexible))


def _labels(tendons: Sequence[Tendon]) -> list[str]:
    return [tendon.label for tendon in tendons]


def _word(label: str) -> str:
    """The port of a tendon's mode; empty where it moves several."""
    return label.partition("_")[2]


def _kept_modes(appendage: Appendage, space: InSpace, word: str) -> PortModel:
    """The modes that tendons of a port have, in the order of their numbers; `tip` holds them in
    terms of all modes."""
    data = space.data
    target = appendage.fit.kept_for
    if not word:
        if target != "clamped":
            raise InputError(
                f"the modes of the appendage at {appendage.at} couple its ports and are those of a "
                f'{target} root; rows over the modes of the file need target = "clamped".'
            )
        model = data.space()
        return model.replaced(tip=np.eye(data.modes)).picked([k - 1 for k in space.numbers])
    belongs = np.flatnonzero([port == word for port in data.belongs])
    whole = data.port(word, own=True).replaced(tip=np.eye(data.modes)[belongs])
    chosen = [k for k, mode in enumerate(belongs.tolist()) if mode + 1 in space.numbers]
    if target == "clamped":
        return whole.picked(chosen)
    hub = appendage.fit.spec.root.hub
    mass = np.zeros((6, 6)) if hub is None or target == "free" else hub.mass_matrix()
    return whole.reduced(len(chosen), port_hub_mass(mass, word))


def _participation(chain: Chain, tendon: Tendon) -> Array:
    """`(6,)` participation of a tendon's mode in the chain."""
    beside = [
        t for t in chain.tendons if t.stiffness > 0.0 and set(t.freedoms) == set(tendon.freedoms)
    ]
    rigid, elastic = chain.rows(tendon.freedoms)
    shapes = np.linalg.inv(np.array([t.coefficients for t in beside]))
    return np.asarray(rigid.T @ elastic @ shapes[:, beside.index(tendon)], dtype=np.float64)
