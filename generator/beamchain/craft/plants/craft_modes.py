"""A craft with its signals, linear at a point: normal modes and modal form, continuous, sampled, or exact."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from beamchain.craft.appendage import Appendage, carried
from beamchain.craft.assembly import Carried
from beamchain.craft.embedded import Embedded
from beamchain.craft.error import port_motion
from beamchain.craft.plants.modal_form import SAMPLED, ModalForm, modal_form
from beamchain.craft.plants.normal_modes import NormalModes, cantilever_names, dof_names, mode_names, normal_modes
from beamchain.craft.plants.operating_point import At, OperatingPoint, Rates, operating_point
from beamchain.craft.plants.second_order import SecondOrder, second_order, step_slopes
from beamchain.craft.plants.signals import Input, Names, Output, actuator_names, inputs_of, outputs_of
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.ports.compose import in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array

MODES = 40  # of every port of a beam, those of the exact plant
FAR = 25.0  # times the highest kept frequency: modes beyond are gathered with their static response


@dataclass(frozen=True, eq=False)
class LinearCraft:
    """A craft, linear at an operating point, whose model holds the step of a sampled plant.

    `labels`: name and unit of every degree of freedom. `names`: of appendages' modes and sprung joints, which take `rows` of
    a shape. `lags`: names of the actuators with a state.
    """

    linear: SecondOrder
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    labels: tuple[tuple[str, str], ...]
    names: tuple[str, ...]
    rows: Array
    lags: tuple[str, ...]
    point: OperatingPoint

    @cached_property
    def modes(self) -> NormalModes:
        """Rigid motions and normal modes."""
        return normal_modes(self.linear.mass, self.linear.stiffness)

    @property
    def signals(self) -> tuple[list[str], list[str], list[str], list[str]]:
        """Labels of inputs and outputs, and their units."""
        labels, units = ([w for one in self.outputs for w in getattr(one, words)] for words in ("labels", "units"))
        return [i.label for i in self.inputs], labels, [i.unit for i in self.inputs], units

    @cached_property
    def mode_names(self) -> tuple[str, ...]:
        """Names of the normal modes."""
        return tuple(mode_names(self.modes.shapes, self.names, self.rows))

    def form(self, sampled: bool = False, modes: NormalModes | None = None, names: Sequence[str] = ()) -> ModalForm:
        """The craft in modal blocks; sampled: of `(A - 1)/h` and `B/h` of one step of MuJoCo.

        `modes`, `names`: the normal modes in another order; their own where left out.
        """
        system = self.linear.first_order
        if sampled:
            a, b = step_slopes(self.point, self.linear, self.inputs)
            h = float(self.point.model.opt.timestep)
            system = (a - np.eye(a.shape[0])) / h, b / h, *system[2:]
        noise, words = SAMPLED if sampled else 1.0, names or self.mode_names
        return modal_form(modes or self.modes, system, self.labels, words, self.lags, noise)


def linear_craft(model: "mujoco.MjModel", at: At, rates: Rates, inputs: Names, outputs: Names) -> LinearCraft:
    """A compiled model with its signals, linear at a point; arguments as in `plant`."""
    point = operating_point(model, at, rates)
    driven, seen = inputs_of(point, inputs), outputs_of(point, outputs)
    linear = second_order(point, driven, seen)
    ready = point.model
    names, rows = cantilever_names(ready, linear.mass, linear.stiffness)
    signals, labels = (tuple(driven), tuple(seen)), tuple(dof_names(ready))
    return LinearCraft(linear, *signals, labels, tuple(names), rows, _lags(ready), point)


def exact_craft(embedded: Embedded, point: OperatingPoint, inputs: Names, outputs: Names, omega: float) -> LinearCraft:
    """The bare spacecraft with all modes of its appendages, at the pose and rates of a point of the whole model.

    `inputs` and `outputs` are names as in `plant`, `omega` the highest frequency of interest [rad/s].
    """
    items = carried(embedded.model, embedded.appendages)
    new = {dof for item in items for dof in item.dofs}
    old = [i for i in range(embedded.model.nv) if i not in new]
    poses = zip(np.split(point.qpos, embedded.model.jnt_qposadr[1:]), embedded.model.jnt_dofadr, strict=True)
    bare = operating_point(embedded.craft, np.concatenate([pose for pose, dof in poses if int(dof) not in new]))
    bare = OperatingPoint(bare.model, bare.qpos, point.qvel[old])
    try:
        driven, seen = inputs_of(bare, inputs), outputs_of(bare, outputs)
    except InputError as error:
        raise InputError(f"the exact plant has the bare spacecraft's signals only: {error}") from None
    if far := [output.labels[0] for output in seen if not output.local]:
        raise InputError(
            f"output {far[0]!r} reads what hangs on its body, which the exact plant cannot; leave it out of outputs."
        )
    data, labels = bare.data(), dof_names(bare.model)
    jacobians = [port_motion(bare.model, data, item) for item in items]
    models = [_whole(a, item, omega) for a, item in zip(embedded.appendages, items, strict=True)]
    linear = second_order(bare, driven, seen).with_appendages(jacobians, models)
    for a, model in zip(embedded.appendages, models, strict=True):
        labels += [(name, "") for name in _names(a.prefix, model)]
    springs = np.diag(linear.stiffness)
    sprung = np.flatnonzero(springs > 0.0)
    rows = np.diag(np.sqrt(np.maximum(springs, 0.0)))[sprung]
    names = tuple(labels[i][0] for i in sprung)
    return LinearCraft(linear, tuple(driven), tuple(seen), tuple(labels), names, rows, _lags(bare.model), bare)


def _lags(model: "mujoco.MjModel") -> tuple[str, ...]:
    """Names of the actuators with a state, once per state."""
    names = actuator_names(model)
    return tuple(names[i] for i in range(model.nu) for _ in range(int(model.actuator_actnum[i])))


def _names(prefix: str, model: PortModel) -> list[str]:
    """Names of cantilever modes by the port that they move most."""
    size, counts, out = np.sqrt(np.diag(model.rigid_mass)), dict.fromkeys(PORTS, 0), list[str]()
    for row in np.abs(model.participation / size):
        port = max(PORTS, key=lambda port: float(np.max(row @ np.abs(PORT_MOTION[port]))))
        counts[port] += 1
        out.append(f"{prefix}mode{counts[port]}_{port}")
    return out


def _whole(a: Appendage, item: Carried, omega: float) -> PortModel:
    """An appendage in six motions; beyond the band its modes are gathered, their static response kept."""
    top = FAR * max(omega, *item.band.values())
    if a.fit.space is not None:
        return item.whole.condensed(top)
    ports: dict[str, PortModel] = {}
    for port in PORTS:
        try:
            ports[port] = a.fit.spec.with_ratios(port, a.fit.spec.beam.port(port, MODES))
        except InputError:
            continue  # rigid there
    return in_space(ports, item.whole.rigid_mass).condensed(top)
