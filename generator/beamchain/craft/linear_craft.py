"""A craft with its signals, linear at a point: normal modes and modal form, continuous,
sampled, or exact."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from beamchain.craft.appendage import Appendage, carried
from beamchain.craft.bent_line import BentLine
from beamchain.craft.embedded import Embedded
from beamchain.craft.error import PlacedBody, root_of
from beamchain.craft.hanging_liquid import HangingLiquid
from beamchain.craft.loads import carrying_of
from beamchain.craft.loose_ports import loose_craft
from beamchain.craft.modal_form import SAMPLED, ModalForm, modal_form
from beamchain.craft.mode_names import cantilever_names, mode_names
from beamchain.craft.step_slopes import step_slopes
from beamchain.craft.under_load import LoadedTree
from beamchain.engine.combinations import InputNames, OutputNames, inputs_of, outputs_of
from beamchain.engine.library import mujoco
from beamchain.engine.linear import Linear, Signal, linear_at
from beamchain.engine.loaded import Loading, load_at
from beamchain.engine.normal_modes import NormalModes, normal_modes
from beamchain.engine.operating_point import (
    OperatingPoint,
    Pose,
    Rates,
    base_body,
    operating_point,
)
from beamchain.engine.signals import Input, Output
from beamchain.errors import InputError
from beamchain.fitting.exact import exact_appendage
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array

MODES = 40  # of every port of a beam, those of the exact plant
# times the highest kept frequency: modes beyond are gathered with their static response
FAR = 25.0


@dataclass(frozen=True, eq=False)
class LinearCraft:
    """A craft, linear at an operating point, whose model holds the step of a sampled plant.

    `inputs` and `outputs` set and read what `linear` names. `names`: of appendages' modes and
    sprung joints, which take `rows` of a shape. `internal`: the stiffness by which its normal modes
    are told, where a load makes that of `linear` unsymmetric.
    """

    linear: Linear
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    names: tuple[str, ...]
    rows: Array
    point: OperatingPoint
    internal: Array | None = None

    @cached_property
    def modes(self) -> NormalModes:
        """Rigid motions and normal modes."""
        if self.internal is not None:
            return normal_modes(self.linear.mass, self.internal)
        return self.linear.modes()

    @property
    def signals(self) -> tuple[list[str], list[str], list[str], list[str]]:
        """Labels of inputs and outputs, and their units."""
        inputs = self.linear.inputs.signals
        outputs = self.linear.outputs.signals
        return (
            [signal.name for signal in inputs],
            [signal.name for signal in outputs],
            [signal.unit for signal in inputs],
            [signal.unit for signal in outputs],
        )

    @cached_property
    def mode_names(self) -> tuple[str, ...]:
        """Names of the normal modes."""
        return tuple(mode_names(self.modes.shapes, self.names, self.rows))

    def form(
        self,
        sampled: bool = False,
        modes: NormalModes | None = None,
        names: Sequence[str] = (),
        together: bool = False,
    ) -> ModalForm:
        """The craft in modal blocks; sampled: of `(A - 1)/h` and `B/h` of one step of MuJoCo.

        `modes`, `names`: the normal modes in another order; their own where left out. `together`:
        in one block, with the same states in every pose.
        """
        a, b, c, d = self.linear.first_order()
        if sampled:
            after, pushed = step_slopes(self.point, self.linear, self.inputs)
            h = float(self.point.model.opt.timestep)
            a = (after - np.eye(len(after))) / h
            b = pushed / h
        return modal_form(
            modes or self.modes,
            (a, b, c, d),
            self.linear.coordinates,
            names or self.mode_names,
            self.linear.activations.names,
            SAMPLED if sampled else 1.0,
            together,
        )


def linear_craft(
    model: "mujoco.MjModel", pose: Pose, rates: Rates, inputs: InputNames, outputs: OutputNames
) -> LinearCraft:
    """A compiled model with its signals, linear at a point; arguments as in `plant`."""
    point = operating_point(model, pose, rates)
    return craft_with_signals(point, inputs_of(point, inputs), outputs_of(point, outputs))


def craft_with_signals(
    point: OperatingPoint, driven: Sequence[Input], seen: Sequence[Output]
) -> LinearCraft:
    """A craft at a point with these inputs and outputs."""
    linear = linear_at(point, driven, seen)
    names, rows = cantilever_names(point.model, linear.mass, linear.stiffness)
    return LinearCraft(linear, tuple(driven), tuple(seen), tuple(names), rows, point)


def exact_craft(
    embedded: Embedded,
    point: OperatingPoint,
    inputs: InputNames,
    outputs: OutputNames,
    omega: float,
    pose: Pose = None,
    *,
    loaded: bool = False,
) -> LinearCraft:
    """The bare spacecraft with all modes of its appendages,
    at the pose and rates of a point of the whole model.

    `inputs` and `outputs` are names as in `plant`,
    `omega` the highest frequency of interest [rad/s]; `loaded`: under what acts in `pose`.
    """
    items = carried(embedded.model, embedded.appendages)
    bare = _bare_point(embedded, items, point)
    data = bare.data()
    roots = [root_of(bare.model, data, item) for item in items]
    motions: Sequence[Array] = [root.motion for root in roots]
    carrying = carrying_of(bare.model, data, roots)
    if carrying is None:
        driven, seen = _local_signals(bare, inputs, outputs)
        alone = linear_at(bare, driven, seen)
    elif loaded:
        raise InputError(
            "the exact plant under a load is known without bodies on ports; leave loaded out."
        )
    else:
        loose = loose_craft(embedded, roots)
        place = loose.point(bare)
        driven, seen = _local_signals(place, inputs, outputs)
        alone = loose.linear(place, driven, seen)  # over (q, p)
        motions = carrying.roots
    lines = _lines(items, omega) if loaded else []
    if loaded:
        models = [line.model for line in lines]
    else:
        models = [
            _whole(a, item, omega) for a, item in zip(embedded.appendages, items, strict=True)
        ]
    nv = bare.model.nv
    modes = [
        Signal(name, "")
        for a, model in zip(embedded.appendages, models, strict=True)
        for name in _names(a.prefix, model)
    ]
    coordinates = (*alone.coordinates[:nv], *modes)
    linear = alone.with_appendages(models, motions)
    if carrying is not None:
        by_modes = carrying.by_modes(models)
        # (q, p, modes) by (q, modes)
        tied = np.vstack([by_modes, np.eye(by_modes.shape[1])[nv:]])
        linear = linear.in_coordinates(tied, coordinates)
    linear = replace(linear, coordinates=coordinates)
    internal: Array | None = None
    if loaded:
        load = _load(embedded, items, pose)
        mounts = [item.mount for item in items]
        tree = LoadedTree(bare.model, bare.qpos, roots, mounts, lines, load)
        starts = np.cumsum([nv, *(model.modes for model in models)])[:-1]
        linear = tree.loaded(linear, starts.tolist(), omega)
        internal = internal_stiffness(linear.stiffness, load)
    springs = np.diag(linear.stiffness if internal is None else internal)
    sprung = np.flatnonzero(springs > 0.0)
    rows = np.sqrt(springs[sprung])[:, None] * np.eye(springs.size)[sprung]
    names = tuple(linear.coordinates[i].name for i in sprung)
    return LinearCraft(linear, tuple(driven), tuple(seen), names, rows, bare, internal)


def _bare_point(
    embedded: Embedded, items: Sequence[PlacedBody], point: OperatingPoint
) -> OperatingPoint:
    """The point of the spacecraft without appendages at a point of the whole model."""
    new = {dof for item in items for dof in item.dofs}
    old = [i for i in range(embedded.model.nv) if i not in new]
    bare = operating_point(embedded.craft, embedded.bare_qpos(point.qpos))
    return bare._replace(qvel=point.qvel[old])


def _local_signals(
    point: OperatingPoint, inputs: InputNames, outputs: OutputNames
) -> tuple[Sequence[Input], Sequence[Output]]:
    """Signals of a bare spacecraft; none may read what hangs on it."""
    try:
        driven = inputs_of(point, inputs)
        seen = outputs_of(point, outputs)
    except InputError as error:
        raise InputError(
            f"the exact plant has the bare spacecraft's signals only: {error}"
        ) from None
    if far := [output.labels[0] for output in seen if not output.local]:
        raise InputError(
            f"output {far[0]!r} reads what hangs on its body, which the exact plant cannot; leave "
            "it out of outputs."
        )
    return driven, seen


def internal_stiffness(stiffness: Array, load: Loading) -> Array:
    """The stiffness under a load without what it does to a free base: that of the modes."""
    out = stiffness.copy()
    if load.free is not None:
        out[load.free : load.free + 6] = 0.0
    return (out + out.T) / 2.0


def _lines(items: Sequence[PlacedBody], omega: float) -> list[BentLine | HangingLiquid]:
    """How the appendages bend up to a frequency of interest [rad/s]."""
    for item in items:
        if item.line is None:
            raise InputError(
                f"the appendage at {item.mount.at} is imported modes, which do not say how it "
                "stiffens under a load; leave loaded out, or describe it as a beam."
            )
    return [item.line(omega) for item in items if item.line is not None]


def _load(embedded: Embedded, items: Sequence[PlacedBody], pose: Pose) -> Loading:
    """What acts on the bare spacecraft at a pose."""
    craft = embedded.craft
    base = base_body(craft, items[0].mount.body)
    mass = float(craft.body_subtreemass[base])
    mass += sum(float(item.whole.rigid_mass[0, 0]) for item in items)
    return load_at(craft, pose, base, mass)


def _names(prefix: str, model: PortModel) -> list[str]:
    """Names of cantilever modes by the port that they move most."""
    size = np.sqrt(np.diag(model.rigid_mass))
    counts = dict.fromkeys(PORTS, 0)
    out = list[str]()
    for row in np.abs(model.participation / size):
        port = max(PORTS, key=lambda port: float(np.max(row @ np.abs(PORT_MOTION[port]))))
        counts[port] += 1
        out.append(f"{prefix}mode{counts[port]}_{port}")
    return out


def _whole(a: Appendage, item: PlacedBody, omega: float) -> PortModel:
    """An appendage in six motions; beyond the band its modes are gathered,
    their static response kept."""
    top = FAR * max(omega, *item.band.values())
    fit = a.fit
    exact = exact_appendage(fit.body, fit.kept, fit.measured.rigid_mass, MODES)
    return exact.model.condensed(top)
