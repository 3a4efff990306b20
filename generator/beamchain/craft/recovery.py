"""Loads, stresses, displacements and accelerations inside an appendage, recovered from a run.

Theory: docs/theory.md, section 10.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from beamchain.checks import finite_array, of_type, unknown
from beamchain.craft.appendage import Appendage
from beamchain.craft.histories import History, Recovery
from beamchain.craft.recording import run_of
from beamchain.craft.recovered_body import recovered_beam, recovered_delivery, root_of
from beamchain.engine.library import mujoco
from beamchain.engine.root_motion import Motion, RootMotion, motion_of
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps.modal import TREE, modal_tendons
from beamchain.steps.retime import without_timing
from beamchain.steps.step_map import at_step_of
from beamchain.structure.readers.recovery_file import read_recovery
from beamchain.structure.recovery_rows import OutputMatrices, RecoveryRows
from beamchain.structure.section_loads import AXES, BEYOND, snapped
from beamchain.structure.sections_at import sections_at

STATIONS = 5  # evenly spaced from root to tip, where none are given
MOST_STATIONS = 1000
STATIC = "modes left out"  # what a value comes from that no kept mode makes
CARRIED = "rigid motion and modes left out"
RIGID = "motion of the root"


def appendage_at(appendages: Sequence[Appendage], place: object) -> Appendage:
    """The appendage at a place; None: the only one."""
    if place is None and len(appendages) == 1:
        return appendages[0]
    for appendage in appendages:
        if appendage.at == place:
            return appendage
    raise unknown("place", place, [a.at for a in appendages])


def recover(
    model: "mujoco.MjModel",
    appendages: Sequence[Appendage],
    data: object,
    *,
    place: object,
    x: ArrayLike | None,
    static: bool,
    rows: object,
) -> Recovery:
    """What a run of a model did inside the appendage at a place; arguments as of
    `Embedded.recover`."""
    appendage = appendage_at(appendages, place)
    if appendage.spec.slosh is not None:
        raise InputError(
            f"place = {appendage.at!r} is the liquid in a tank, which has no sections; read what "
            "it puts on the spacecraft by [sensors] root_load = true."
        )
    spec, space = appendage.fit.spec, appendage.fit.space
    root = root_of(model, appendage, appendages)
    delivered = _rows_of(appendage, rows)
    stations = _stations(appendage, x)
    run = run_of(model, data)
    moved, exact = _moved_by(model)
    motion = motion_of(moved, run, [root], exact)
    if space is None:
        body = recovered_beam(appendage, tuple(stations.tolist()))
    else:
        body = recovered_delivery(appendage, delivered)
    modal = body.coordinates(moved, appendage).along(motion)
    names = tuple(tendon.label for tendon in body.tendons)
    on_ports = [str(model.site(site).name) for _, site in root.carried]
    points = [appendage.prefix + port for port in spec.further]
    carried = _wrenches(motion.roots[0], on_ports, points)
    values = _values(body.outputs, modal, carried, static=static)
    in_file: tuple[int, ...] = ()
    if space is not None and appendage.fit.kept_for == "clamped":
        in_file = tuple(space.in_file(name) for name in names)
    return Recovery(
        appendage.at,
        run.time,
        stations,
        names,
        modal.qpos,
        modal.qacc,
        _histories(body.outputs, values, motion.roots[0].load, stations),
        static,
        sections_at(spec.beam, stations) if space is None else None,
        names=() if space is None else tuple(q.name for q in body.outputs.quantities),
        in_file=in_file,
    )


def _moved_by(model: "mujoco.MjModel") -> "tuple[mujoco.MjModel, list[int]]":
    """The model whose equations the positions of a run follow, and the modal tendons that its
    steps take exactly.

    Exact in time, positions are those of the same file with timing taken out. The timing of a tree
    changes stiffness as well, so that its positions are in balance in the file as it is alone.
    """
    modal = modal_tendons(model)
    forms = {mark.form for mark in modal.made_for if mark is not None}
    if not forms or TREE in forms:
        return model, []
    return at_step_of(without_timing(model), model), modal.index.tolist()


def _stations(appendage: Appendage, x: ArrayLike | None) -> Array:
    if appendage.fit.space is not None:
        if x is not None:
            raise InputError(
                f"x is given, but the appendage at {appendage.at} is imported modes, which know no "
                "sections along x; give recovery rows (rows=...) and leave x out."
            )
        return np.zeros(0)
    beam = appendage.fit.spec.beam
    if x is None:
        return snapped(beam, np.linspace(0.0, beam.length, STATIONS))
    stations = np.atleast_1d(finite_array("x", x, (), (None,), unit="m"))
    outside = (stations < 0.0) | (stations > beam.length * (1.0 + BEYOND))
    if np.any(outside):
        raise InputError(
            f"x = {float(stations[outside][0])!r} m lies outside the appendage at {appendage.at}, "
            f"which goes from 0 to {beam.length!r} m."
        )
    if not 1 <= stations.size <= MOST_STATIONS:
        raise InputError(f"x holds {stations.size} stations; give 1 to {MOST_STATIONS}.")
    return snapped(beam, np.minimum(stations, beam.length))


def _rows_of(appendage: Appendage, rows: object) -> RecoveryRows | None:
    """The rows that are given, or that the specification names; None: there are none."""
    imported = appendage.fit.spec.imported
    if rows is None:
        path = None if imported is None else imported.recovery
        return None if path is None else read_recovery(path)
    if appendage.fit.space is None:
        raise InputError(
            f"rows are given, but the appendage at {appendage.at} is a beam, whose loads follow "
            "from its sections; leave rows out and give stations x."
        )
    if isinstance(rows, str | Path):
        return read_recovery(rows)
    of_type("rows", rows, RecoveryRows, "a RecoveryRows, or the path of an .npz or .toml file")
    assert isinstance(rows, RecoveryRows)
    return rows


# -- output matrices on a run ----------------------------------------------------------------------
def _wrenches(root: RootMotion, ports: Sequence[str], points: Sequence[str]) -> Array:
    """`(t, c, 6)` on each of c points, of what bodies put on `ports`, the point of each."""
    on = np.array([[port == point for port in ports] for point in points], dtype=np.float64)
    return np.einsum("cp,tpi->tci", on.reshape(len(points), len(ports)), root.carried)


def _values(outputs: OutputMatrices, modal: Motion, carried: Array, *, static: bool) -> Array:
    """`(t, s, k)` of the components along a run in modal coordinates, by the formula of
    `OutputMatrices`; `carried` `(t, c, 6)`: wrenches on the points."""
    (root,) = modal.roots
    spin = root.spin[:, :, None]
    turned = spin * np.hstack([root.spin, modal.qvel])[:, None]
    values = np.tensordot(modal.qpos, outputs.modes, (1, 2))
    values += np.tensordot(modal.qacc, outputs.accelerations, (1, 2))
    values += np.tensordot(root.acceleration, outputs.root, (1, 2))
    values += np.tensordot(turned, outputs.spin, ((1, 2), (2, 3)))
    if static:
        count = len(values)
        felt = root.acceleration - np.pad(root.gravity, ((0, 0), (0, 3)))
        squares = (spin * root.spin[:, None]).reshape(count, 9)
        drives = np.hstack([felt, squares, carried.reshape(count, -1)])
        values += np.tensordot(drives, outputs.left_out, (1, 2))
    return values


def _histories(
    outputs: OutputMatrices, values: Array, load: Array, stations: Array
) -> dict[str, History]:
    """Histories of values `(t, s, k)`, and of the root's load `(t, 6)`, of which a mode makes
    `L W^2`."""
    none = np.zeros(0)
    at_root = -(outputs.drives[:, :6].T) * outputs.frequencies**2
    out: dict[str, History] = {}
    for name, unit, part in (("force", "N", slice(3)), ("moment", "N m", slice(3, 6))):
        units, own = (unit,) * 3, load[:, None, part]
        out[f"root {name}"] = History(
            f"root {name}", AXES, units, own, at_root[None, part], "amplitudes", CARRIED, none
        )
    first = 0
    for name, parts, units, accelerates in outputs.quantities:
        part = slice(first, first + len(parts))
        factors = outputs.accelerations if accelerates else outputs.modes
        follows, rest = ("accelerations", RIGID) if accelerates else ("amplitudes", STATIC)
        out[name] = History(
            name, parts, units, values[:, :, part], factors[:, part], follows, rest, stations
        )
        first = part.stop
    return out
