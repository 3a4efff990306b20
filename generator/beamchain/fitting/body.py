"""An elastic appendage: every mode that is known of it, whatever it was described by."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from beamchain.errors import InputError
from beamchain.fitting.hub import port_hub_mass
from beamchain.fitting.needs import AXES, FAR, MOST, Promise
from beamchain.fitting.options import Damping
from beamchain.fitting.spec import Spec
from beamchain.mjcf.write import check_hub
from beamchain.ports.compare import with_damping
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.beam import Beam
from beamchain.structure.modal_data import ModalData
from beamchain.structure.readers.imported import with_length

TOO_MANY = 2000  # modes below the bandwidth that are looked through
REFERENCE_MODES = 40  # most modes of the whole beam that are converged for a scene


@dataclass(frozen=True, eq=False)
class Body:
    """An elastic appendage with every mode that is known of it.

    Args:
        spec: its specification.
        ports: per port in which it is flexible, the modes that belong there, damped.
        data: its modes in space, damped, where they are imported or those of a liquid; None for a
            beam, whose ports are independent.
    """

    spec: Spec
    ports: Mapping[str, PortModel]
    data: ModalData | None = None
    _reduced: dict[tuple[str, str, int], PortModel] = field(
        default_factory=dict, init=False, repr=False
    )

    @property
    def hub(self) -> Array | None:
        """`(6, 6)` of the hub that the specification states, about the root; None without one."""
        return None if self.spec.root.hub is None else self.spec.root.hub.mass_matrix()

    def port_hub(self, port: str) -> Array | None:
        """`(m, m)` of that hub in the motions of a port; None without one."""
        return None if self.hub is None else port_hub_mass(self.hub, port)

    @cached_property
    def rigid_mass(self) -> Array:
        """`(6, 6)` about the root."""
        return self.spec.beam.rigid_mass() if self.data is None else self.data.rigid_mass

    @property
    def length(self) -> float:
        """From the root to the tip [m]."""
        return self.spec.beam.length if self.data is None else self.data.line().length

    @property
    def live(self) -> tuple[int, ...]:
        """Motions in which the appendage has inertia (0 to 5); a beam's chain has some in all."""
        return tuple(range(6)) if self.data is None else tuple(self.data.live)

    @property
    def couples(self) -> bool:
        """Whether a mode moves several ports."""
        return self.data is not None and any(len(ports) > 1 for ports in self.data.groups)

    @cached_property
    def space(self) -> PortModel:
        """Every imported mode, or every one of a liquid, in six motions of the root."""
        assert self.data is not None
        return self.in_six_motions(self.data.space())

    def in_six_motions(self, model: PortModel) -> PortModel:
        """A model in the live motions, in all six."""
        rows = np.zeros((model.modes, 6))
        rows[:, self.live] = model.participation
        return PortModel(with_inertia(self.rigid_mass), model.frequencies, rows, model.damping)

    def view(self, port: str) -> PortModel:
        """Every mode that moves a port, damped, whether it belongs there or not."""
        return self.ports[port] if self.data is None else self.data.port(port)

    def reduced(self, target: str, port: str, count: int) -> PortModel:
        """A port's model with `count` modes for a target, damped; of a beam that carries at further
        points, the static responses to loads there stand behind them."""
        key = target, port, count
        if key not in self._reduced:
            full, points = self.ports[port], tuple(self.spec.further.values())
            model = reduced_port(full, target, count, hub=self.port_hub(port), points=points)
            self._reduced[key] = (
                self.spec.with_ratios(port, model)
                if points
                else model.replaced(damping=full.damping[: model.modes])
            )
        return self._reduced[key]

    def with_modes(self, port: str, count: int) -> "Body | None":
        """The same where at least `count` modes of a port are known; None where there are not so
        many, or it is rigid there."""
        known = self.ports.get(port)
        if known is not None or self.data is not None:
            return self if known is not None and count <= known.modes else None
        try:
            model = self.spec.beam.port(port, 2 * count + 4, list(self.spec.further.values()))
        except InputError:
            return None
        return replace(self, ports={**self.ports, port: self.spec.with_ratios(port, model)})

    @cached_property
    def in_band(self) -> dict[str, PortModel]:
        """Per port every mode, damped as errors compare it; those far above the scene's band act
        through their static flexibility only."""
        far = FAR * self._bandwidth
        return {
            port: with_damping(model, self.spec.undamped_ratio).condensed(far)
            for port, model in self.ports.items()
        }

    @cached_property
    def promise(self) -> Promise | None:
        """The in-band error in the live motions, where the scene states a bandwidth."""
        scene, motions = self.spec.scene, list(self.live)
        if scene is None or not self._bandwidth:
            return None
        if self.data is None:
            exact = model_in_space(self.in_band, with_inertia(self.rigid_mass))
        else:
            exact = with_damping(self.data.space(), self.spec.undamped_ratio)
            exact = exact.condensed(FAR * self._bandwidth)
        return Promise(
            exact,
            None if self.hub is None else self.hub[np.ix_(motions, motions)],
            motions=motions,
            wanted=[AXES[axis] for axis in scene.axes],
            bandwidth=self._bandwidth,
            undamped=self.spec.undamped_ratio,
        )

    @property
    def _bandwidth(self) -> float:
        """The scene's [rad/s]; 0 where none is stated."""
        return (None if self.spec.scene is None else self.spec.scene.bandwidth) or 0.0


def body_of(spec: Spec, data: ModalData | None = None) -> Body:
    """The appendage of a specification; `data`: its imported modes, else read from its file."""
    if spec.root.target == "hub" and spec.root.hub is None:
        raise InputError(
            'target = "hub" needs the hub; add hub = { mass = 500.0, inertia = [400.0, 400.0, '
            '500.0] }, or use target = "clamped" (`beamchain embed` reads the hub from the '
            "spacecraft)."
        )
    if spec.is_beam:
        if spec.root.hub is not None:
            check_hub(spec.root.hub.mass, spec.root.hub.inertia_matrix())
        return Body(spec, _ports_of_beam(spec))
    if spec.slosh is not None:
        data = spec.slosh.data()
    else:
        assert spec.imported is not None
        data = with_length((data or spec.imported.read()).untangled(), None)
        if spec.damping is not None:
            data = replace(data, damping=_ratios(spec.damping, data))
    return Body(
        spec, {port: data.port(port, own=True) for port in PORTS if port in data.belongs}, data
    )


def _ports_of_beam(spec: Spec) -> dict[str, PortModel]:
    """Per port every mode of the beam that the reference has, damped: of the ports kept,
    or for a scene of all in which it is flexible."""
    beam, stations = spec.beam, list(spec.further.values())
    out: dict[str, PortModel] = {}
    if not spec.chooses:
        for port, count in spec.kept.items():
            out[port] = spec.with_ratios(port, beam.port(port, 2 * count + 4, stations))
        return out
    assert spec.scene is not None
    assert spec.scene.bandwidth is not None
    for port in PORTS:
        count = _modes_below(beam, port, spec.scene.bandwidth)
        if count > TOO_MANY:
            raise InputError(
                f"scene.bandwidth = {spec.scene.bandwidth!r} rad/s lies above some {count:.3g} "
                f"modes of the appendage in {port}, where {TOO_MANY} can be looked through; lower "
                "it, or check the appendage's sizes and units."
            )
        try:
            model = beam.port(port, 2 * MOST, stations)
        except InputError:
            continue  # rigid there
        inside = int(np.sum(model.frequencies <= FAR * spec.scene.bandwidth))
        if inside > 2 * MOST:
            model = beam.port(port, min(inside, REFERENCE_MODES), stations)
        out[port] = spec.with_ratios(port, model)
    return out


def _modes_below(beam: Beam, port: str, omega: float) -> float:
    """About how many modes of a port lie below `omega` [rad/s]: half waves along the appendage."""
    waves = 0.0
    for segment in beam.segments:
        at = segment.at(np.array([0.5]))
        stiffness, inertia, power = {
            "xy": (at.bending_xy, at.mass, 0.25),
            "xz": (at.bending_xz, at.mass, 0.25),
            "torsion": (at.torsion, at.polar, 0.5),
            "axial": (at.axial, at.mass, 0.5),
        }[port]
        if np.all(stiffness > 0.0):
            waves += (
                segment.length * float((inertia / stiffness)[0]) ** power * omega ** (2.0 * power)
            )
    return waves / float(np.pi)


def _ratios(damping: Damping, data: ModalData) -> Array:
    """`(n,)` damping ratio of every mode of the file."""
    if isinstance(damping.ratio, tuple):
        if len(damping.ratio) > data.modes:
            raise InputError(
                f"damping.ratio holds {len(damping.ratio)} values, but {data.source} has "
                f"{data.modes} modes; give one per mode of the file, in its order."
            )
        return damping.ratios("", data.modes)
    ratios = np.zeros(data.modes)
    for port in PORTS:
        own = [k for k, b in enumerate(data.belongs) if b == port]
        ratios[own] = damping.ratios(port, len(own))
    return ratios


def reduced_port(
    full: PortModel, target: str, count: int, *, hub: Array | None, points: Sequence[float]
) -> PortModel:
    """`count` of all modes of a port, for a target on a hub `(m, m)`; where there are further
    `points`, x [m], the static responses to loads there stand behind them."""
    if count and points:
        return full.attached(count, full.point_columns(points))
    return full.for_target(target, count, hub)


def with_inertia(mass: Array, of_chain: Array | None = None) -> Array:
    """`(6, 6)` with what an appendage states none of: the chain's, or before there is one that of
    its other motions and a trace of polar inertia."""
    if of_chain is None:
        mass = with_polar_inertia(mass)
        of_chain = np.max(np.diag(mass)[:3]) * np.eye(6)
    lacking = np.diag(mass) <= 0.0
    return mass + np.diag(np.where(lacking, np.diag(of_chain), 0.0))


def with_polar_inertia(rigid_mass: Array) -> Array:
    """`(6, 6)` with a trace of polar inertia where an appendage states none."""
    mass = np.array(rigid_mass)
    rotary = np.diag(mass)[3:]
    return mass + np.diag([0.0] * 3 + list(np.maximum(1e-9 * rotary.max() - rotary, 0.0)))
