"""What an appendage keeps while modes are added to it, and what it would be with one more."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import msgspec

from beamchain.craft.appendage import Appendage, carried
from beamchain.errors import InputError
from beamchain.fitting.body import Body
from beamchain.fitting.exact import exact_appendage, kept_counts
from beamchain.fitting.fewest import weights
from beamchain.fitting.options import Modes
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import with_damping
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.readers.imported import MOST_MODES as MOST_NAMED
from beamchain.structure.slosh import MOST, Slosh

TRIED = 16  # modes of an imported appendage that are tried at a time: those that move the hub most


def candidate(a: Appendage) -> "Candidate":
    """An appendage as it was fitted."""
    if a.fit.spec.slosh is not None:
        return Liquid(a, a.fit.spec.slosh.kept)
    if a.fit.space is not None and any(len(ports) > 1 for ports in a.fit.space.data.groups):
        return Coupled(a, a.fit.space.numbers)
    return PerPort(a, kept_counts(a.fit))


def model_of(a: Appendage) -> PortModel:
    """An appendage in six motions as MuJoCo has it; one that carries, as its chain was asked to
    be, with the motion of its ports."""
    if not a.loads:
        return a.fit.measured.space
    return model_in_space(_kept(a), a.fit.measured.rigid_mass)


def _kept(a: Appendage) -> Mapping[str, PortModel]:
    """The model of every port that the chain keeps."""
    if not a.loads:
        return a.fit.achieved
    return {port: a.spec.with_ratios(port, model) for port, model in a.fit.target.items()}


def free_ports(spec: Spec) -> tuple[str, ...]:
    """Ports whose number of modes was not typed."""
    typed = spec.modes is not None and not spec.chooses
    if (
        spec.slosh is not None
        or typed
        or (spec.imported is not None and spec.imported.modes is not None)
    ):
        return ()
    given = {} if spec.modes is None else spec.modes.given()
    return tuple(port for port in PORTS if port not in given)


@dataclass(frozen=True, eq=False)
class PerPort:
    """An appendage whose ports are independent: a beam, or imported modes that keep to their ports.

    `changed`: models of the ports that differ from the fit's; `last`:
    port that the last mode was added to.
    """

    a: Appendage
    counts: dict[str, int]
    changed: dict[str, PortModel] = field(default_factory=dict)
    last: str = ""

    @property
    def modes(self) -> int:
        """How many it would keep."""
        return sum(self.counts.values())

    @property
    def grown(self) -> bool:
        """Whether that is more than its fit keeps."""
        return bool(self.changed)

    @property
    def newest(self) -> float:
        """Frequency of the mode that was added last [rad/s]."""
        return float(self.changed[self.last].frequencies[-1])

    @property
    def added(self) -> str:
        """The mode that was added last, in words."""
        return f"mode {self.counts[self.last]} in {self.last}"

    @cached_property
    def model(self) -> PortModel:
        """The appendage in six motions, as MuJoCo has it or would."""
        if not self.changed:
            return model_of(self.a)
        return model_in_space({**_kept(self.a), **self.changed}, self._rigid_mass)

    @property
    def spec(self) -> Spec:
        """What asks for these modes."""
        modes = Modes(**{port: self.counts.get(port, 0) for port in PORTS})
        return msgspec.structs.replace(self.a.spec, modes=modes)

    def further(self, band: float) -> dict[str, "Candidate"]:
        """By port, the same with one mode more; empty where none may be added.
        `band` as of `Coupled.further`."""
        del band
        out: dict[str, Candidate] = {}
        root = msgspec.structs.replace(self.a.spec.root, hub=self.a.hub)
        spec = msgspec.structs.replace(self.a.spec, root=root)
        for port in free_ports(spec):
            count = self.counts.get(port, 0) + 1
            full = self._whole(port, count)
            if full is None or count > full.modes:
                continue
            model = Body(spec, {port: full}).reduced(self.a.fit.kept_for, port, count)
            counts = {**self.counts, port: count}
            changed = {**self.changed, port: model}
            out[port] = replace(self, counts=counts, changed=changed, last=port)
        return out

    def alone(self, key: str) -> PortModel:
        """The exact appendage, but for one port, which stays as it is."""
        ports = dict(self._exact)
        ports.pop(key, None)
        if (now := self.changed.get(key, _kept(self.a).get(key))) is not None:
            ports[key] = now
        return model_in_space(ports, self._rigid_mass)

    @property
    def _rigid_mass(self) -> Array:
        """`(6, 6)` a chain of few ports may miss that of imported modes in the others."""
        fit = self.a.fit
        if fit.space is None:
            return fit.measured.rigid_mass
        return carried(None, [self.a])[0].whole.rigid_mass

    def _whole(self, port: str, count: int) -> PortModel | None:
        """All modes of a port, at least some more than `count` of a beam;
        None where it is rigid."""
        fit = self.a.fit
        if fit.space is not None:
            return fit.space.data.port(port, own=True) if port in fit.space.data.belongs else None
        if port in fit.full:
            return fit.full[port]
        try:
            model = self.a.spec.beam.port(port, 2 * count + 4, list(self.a.spec.further.values()))
        except InputError:
            return None
        return self.a.spec.with_ratios(port, model)

    @cached_property
    def _exact(self) -> Mapping[str, PortModel]:
        """Every mode, damped, of each port that is not rigid."""
        fit = self.a.fit
        if fit.space is None:
            return exact_appendage(fit).ports
        return {
            port: fit.space.data.port(port, own=True)
            for port in dict.fromkeys(fit.space.data.belongs)
        }


@dataclass(frozen=True, eq=False)
class Coupled:
    """Imported modes that move in several ports at once, kept by their `numbers` in the file;
    `last`: added last."""

    a: Appendage
    numbers: tuple[int, ...]
    last: int = 0

    @property
    def modes(self) -> int:
        """How many it would keep."""
        return len(self.numbers)

    @property
    def grown(self) -> bool:
        """Whether that is more than its fit keeps."""
        return bool(self.last)

    @property
    def newest(self) -> float:
        """Frequency of the mode that was added last [rad/s]."""
        return float(self._exact.frequencies[self.last - 1])

    @property
    def added(self) -> str:
        """The mode that was added last, in words."""
        return f"mode {self.last} of the file ({self.newest:.4g} rad/s)"

    @cached_property
    def model(self) -> PortModel:
        """The appendage in six motions, as MuJoCo has it or would."""
        return self._only(self.numbers) if self.last else self.a.fit.measured.space

    @property
    def spec(self) -> Spec:
        """What asks for these modes."""
        imported = self.a.spec.imported
        assert imported is not None
        imported = msgspec.structs.replace(imported, modes=self.numbers)
        return msgspec.structs.replace(self.a.spec, imported=imported, modes=None)

    def further(self, band: float) -> dict[str, "Candidate"]:
        """By number, the same with one mode more:
        of those that move the hub most up to `band` [rad/s]."""
        space = self.a.fit.space
        free = free_ports(self.a.spec)
        if space is None or len(self.numbers) >= MOST_NAMED:
            return {}
        left = [
            k
            for k, port in enumerate(space.data.belongs, 1)
            if k not in self.numbers and port in free
        ]
        exact = with_damping(self._exact, self.a.spec.undamped_ratio)
        heavy = weights(exact, self.a.hub.mass_matrix(), band)
        left.sort(key=lambda k: -heavy[k - 1])
        return {
            str(k): replace(self, numbers=tuple(sorted((*self.numbers, k))), last=k)
            for k in left[:TRIED]
        }

    def alone(self, key: str) -> PortModel:
        """The exact appendage without one of its modes."""
        return self._only([k for k in range(1, self._exact.modes + 1) if k != int(key)])

    @cached_property
    def _exact(self) -> PortModel:
        return carried(None, [self.a])[0].whole

    def _only(self, numbers: "tuple[int, ...] | list[int]") -> PortModel:
        return self._exact.picked([k - 1 for k in numbers])


@dataclass(frozen=True, eq=False)
class Liquid:
    """The liquid of a tank, of which `count` lateral modes of each plane are pendulums."""

    a: Appendage
    count: int

    @property
    def modes(self) -> int:
        """How many it would keep."""
        return 2 * self.count

    @property
    def grown(self) -> bool:
        """Whether that is more than its fit keeps."""
        return self.count > self._liquid.kept

    @property
    def newest(self) -> float:
        """Frequency of the modes that were added last [rad/s]."""
        return float(self._exact.frequencies[2 * self.count - 1])

    @property
    def added(self) -> str:
        """The modes that were added last, in words."""
        return f"pendulum {self.count}"

    @cached_property
    def model(self) -> PortModel:
        """The liquid in six motions, as MuJoCo has it or would."""
        return self._exact.picked(list(range(2 * self.count))) if self.grown else model_of(self.a)

    @property
    def spec(self) -> Spec:
        """What asks for these modes."""
        liquid = msgspec.structs.replace(self._liquid, modes=self.count)
        return msgspec.structs.replace(self.a.spec, slosh=liquid)

    def further(self, band: float) -> dict[str, "Candidate"]:
        """The same with a pendulum more, where their number was not typed."""
        del band
        given = self.a.spec.slosh
        if given is None or given.modes is not None or self.count >= MOST:
            return {}
        return {"pendulum": replace(self, count=self.count + 1)}

    def alone(self, key: str) -> PortModel:
        """The liquid as it is: nothing of it is exact but its pendulums."""
        del key
        return self.model

    @property
    def _liquid(self) -> Slosh:
        assert self.a.fit.spec.slosh is not None
        return self.a.fit.spec.slosh

    @cached_property
    def _exact(self) -> PortModel:
        return carried(None, [self.a])[0].whole


#: An appendage and the modes it would keep.
Candidate = PerPort | Coupled | Liquid
