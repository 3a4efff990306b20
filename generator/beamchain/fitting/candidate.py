"""An appendage and the modes that it would keep, with those that it offers next."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from msgspec import structs

from beamchain.fitting.body import Body, with_inertia
from beamchain.fitting.exact import ExactAppendage, exact_appendage, kept_model
from beamchain.fitting.kept import Kept, numbered, of_ports
from beamchain.fitting.needs import AXES
from beamchain.fitting.options import Modes
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import STANDARD_HUBS, with_damping
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.readers.imported import MOST_MODES as MOST_NAMED
from beamchain.structure.slosh import MOST as MOST_PENDULUMS

TRIED = 8  # modes that couple ports, tried at a time: those that move the hub most
LIGHTEST = 6  # of them, tried without


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


def weights(full: PortModel, hub: Array, band: float, motions: Sequence[int]) -> Array:
    """`(n,)` how much each mode of a damped model can move some `motions` of a hub `(m, m)` in the
    `band` [rad/s], roughly."""
    total = full.rigid_mass + hub
    moved = np.linalg.solve(total, full.participation.T).T * np.sqrt(np.diag(total))
    size = np.sum(moved[:, list(motions)] ** 2, axis=1)
    ratio = band / full.frequencies
    peak = 1.0 / np.maximum(2.0 * full.damping, 1e-6)
    return size * np.minimum(ratio**2 / np.maximum(1.0 - ratio**2, 1e-12), peak)


@dataclass(frozen=True, eq=False)
class Candidate:
    """An appendage and the modes that it would keep.

    Args:
        body: every mode of it; what its specification states of modes is the user's.
        kept: the modes that it would keep.
        measured: what MuJoCo has of a chain with these modes, in six motions, where there is one.
        before: what it grew from by one mode; None where it did not grow.
        added: the mode that was added last, in words; empty where none was.
        newest: frequency of that mode [rad/s].
    """

    body: Body
    kept: Kept
    measured: PortModel | None = None
    before: "Candidate | None" = None
    added: str = ""
    newest: float = 0.0

    @property
    def modes(self) -> int:
        """How many it would keep."""
        return sum(self.kept.counts.values())

    @property
    def stated(self) -> Spec:
        """A specification that states these modes."""
        spec, root = self.body.spec, structs.replace(self.body.spec.root, target=self.kept.target)
        if spec.slosh is not None:
            liquid = structs.replace(spec.slosh, modes=self.modes // 2)
            return structs.replace(spec, slosh=liquid, root=root)
        if self.body.couples:
            assert spec.imported is not None
            imported = structs.replace(spec.imported, modes=self.kept.numbers)
            return structs.replace(spec, imported=imported, modes=None, root=root)
        counts = {port: self.kept.counts.get(port, 0) for port in PORTS}
        return structs.replace(spec, modes=Modes(**counts), root=root)

    @cached_property
    def model(self) -> PortModel:
        """The appendage in six motions, as MuJoCo has it or would."""
        return kept_model(self.body, self.kept) if self.measured is None else self.measured

    @cached_property
    def exact(self) -> ExactAppendage:
        """All its modes."""
        return exact_appendage(self.body, self.kept)

    def offers(self, band: float) -> "dict[str, Candidate]":
        """The same with one mode more, the heaviest first: of the next modes of all ports whose
        number was not typed, by their ports; of modes that couple ports, those that move the hub
        most up to `band` [rad/s], by their numbers; of a liquid a pendulum in both planes."""
        if self.body.spec.slosh is not None:
            return self._pendulum()
        return dict(self._by_number(band) if self.body.couples else self._by_port())

    def part(self, offer: str) -> str:
        """What an offer adds to: a port, or where modes couple the ports the whole appendage."""
        return "" if self.body.couples or self.body.spec.slosh is not None else offer

    def without(self, part: str) -> PortModel:
        """The exact appendage but for a port, which stays as it is; as it is where that is the
        whole."""
        if not part:
            return self.model
        known = self.body.data is not None or self.body.spec.chooses
        ports = dict(self.body.ports if known else self.exact.ports)
        ports.pop(part, None)
        if count := self.kept.counts.get(part):
            ports[part] = self.body.reduced(self.kept.target, part, count)
        return model_in_space(ports, with_inertia(self.body.rigid_mass))

    def droppable(self, band: float, least: Kept) -> tuple[str, ...]:
        """What `dropping` may be asked for: the ports, or of modes that couple them those beyond
        the `least` that move the hub least up to `band` [rad/s], by their numbers."""
        if self.body.spec.slosh is not None:
            return ()
        if not self.body.couples:
            return free_ports(self.body.spec)
        weight = self.weights(band)
        free = (k for k in self.kept.numbers if k not in least.numbers)
        return tuple(map(str, sorted(free, key=lambda k: weight[k - 1])))[:LIGHTEST]

    def dropping(self, key: str, least: Kept) -> "Candidate | None":
        """The same with one mode less of a port, or without a mode; None where it has no more than
        the `least`."""
        if not self.body.couples:
            count = self.kept.counts.get(key, 0) - 1
            if count < least.counts.get(key, 0):
                return None
            counts = {**self.kept.counts, key: count}
            return replace(self, kept=of_ports(self.body, counts, self.kept.target), measured=None)
        numbers = [k for k in self.kept.numbers if k != int(key)]
        if int(key) in least.numbers or len(numbers) == len(self.kept.numbers):
            return None
        return replace(self, kept=numbered(self.body, numbers, self.kept.target), measured=None)

    def _pendulum(self) -> "dict[str, Candidate]":
        given, data, count = self.body.spec.slosh, self.body.data, self.modes // 2 + 1
        assert given is not None
        assert data is not None
        if given.modes is not None or count > MOST_PENDULUMS:
            return {}
        kept = numbered(self.body, range(1, 2 * count + 1))
        return {"pendulum": self._with(kept, f"pendulum {count}", data.frequencies[2 * count - 1])}

    def _by_port(self) -> "Iterator[tuple[str, Candidate]]":
        target = self.kept.target
        for port in free_ports(self.body.spec):
            count = self.kept.counts.get(port, 0) + 1
            body = self.body.with_modes(port, count)
            if body is None:
                continue
            frequencies = body.reduced(target, port, count).frequencies
            if frequencies.size < count:
                continue  # without the hub's inertia there are not so many
            kept = of_ports(body, {**self.kept.counts, port: count}, target)
            added = f"mode {count} in {port}"
            yield port, replace(self._with(kept, added, frequencies[count - 1]), body=body)

    def _by_number(self, band: float) -> "Iterator[tuple[str, Candidate]]":
        numbers, data = self.kept.numbers, self.body.data
        assert data is not None
        if len(numbers) >= MOST_NAMED:
            return
        free, weight = free_ports(self.body.spec), self.weights(band)
        left = [k for k in range(data.modes) if k + 1 not in numbers and data.belongs[k] in free]
        for k in sorted(left, key=lambda k: -weight[k])[:TRIED]:
            kept = numbered(self.body, sorted((*numbers, k + 1)), self.kept.target)
            w = data.frequencies[k]
            yield str(k + 1), self._with(kept, f"mode {k + 1} of the file ({w:.4g} rad/s)", w)

    def weights(self, band: float) -> Array:
        """`(n,)` how much each of all modes moves the hub, or a light one, up to `band` [rad/s] in
        the motions that the scene asks for."""
        exact, scene = self.body.space, self.body.spec.scene
        motions = range(6) if scene is None else [AXES[axis] for axis in scene.axes]
        hub = STANDARD_HUBS[0] * exact.rigid_mass if self.body.hub is None else self.body.hub
        return weights(with_damping(exact, self.body.spec.undamped_ratio), hub, band, motions)

    def _with(self, kept: Kept, added: str, newest: float) -> "Candidate":
        return replace(
            self, kept=kept, measured=None, before=self, added=added, newest=float(newest)
        )
