"""An appendage on a spacecraft, what it keeps while modes are added, and what it offers next."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from msgspec import structs

from beamchain.craft.appendage import Appendage, placed_body
from beamchain.craft.error import PlacedBody
from beamchain.craft.loads import Load
from beamchain.engine.mount import Mount
from beamchain.errors import InputError
from beamchain.fitting.body import Body
from beamchain.fitting.exact import ExactAppendage, exact_appendage, kept_model
from beamchain.fitting.fewest import weights
from beamchain.fitting.options import Modes
from beamchain.fitting.result import Fit
from beamchain.fitting.select import Kept, first_of_ports, numbered
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import with_damping
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS
from beamchain.structure.readers.imported import MOST_MODES as MOST_NAMED
from beamchain.structure.slosh import MOST

TRIED = 16  # modes of an imported appendage that are tried at a time: those that move the hub most


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
class Candidate:
    """An appendage and the modes that it would keep.

    Args:
        at: site or body.
        mount: the place in the bare spacecraft.
        loads: what its ports carry.
        body: every mode of it; its specification is the user's, on the hub that it meets.
        kept: the modes that it would keep.
        fit: the chain that has these modes, where there is one.
        added: the mode that was added last, in words; empty where none was.
        newest: frequency of that mode [rad/s].
    """

    at: str
    mount: Mount
    loads: tuple[Load, ...]
    body: Body
    kept: Kept
    fit: Fit | None = None
    added: str = ""
    newest: float = 0.0

    @classmethod
    def of(cls, a: Appendage, spec: Spec | None = None) -> "Candidate":
        """An appendage as it was fitted; `spec`: in place of its own."""
        root = structs.replace((spec or a.spec).root, hub=a.hub)
        body = replace(a.fit.body, spec=structs.replace(spec or a.spec, root=root))
        return cls(a.at, a.mount, a.loads, body, a.fit.kept, a.fit)

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
        """The appendage in six motions, as MuJoCo has it or would; one that carries, as its chain
        was asked to be, with the motion of its ports."""
        if self.fit is not None and not self.loads:
            return self.fit.measured.space
        return kept_model(self.body, self.kept)

    @property
    def placed(self) -> PlacedBody:
        """All its modes, on the spacecraft."""
        return placed_body(self.mount, self.body, self.exact, self.loads)

    @cached_property
    def exact(self) -> ExactAppendage:
        """All its modes."""
        return exact_appendage(self.body, self.kept)

    def offers(self, band: float) -> "dict[str, Candidate]":
        """The same with one mode more, by what it is called in `without`: of the next modes of all
        ports whose number was not typed; of modes that move several ports, those that move the hub
        most up to `band` [rad/s]; of a liquid a pendulum in both planes."""
        if self.body.spec.slosh is not None:
            return self._pendulum()
        return dict(self._by_number(band) if self.body.couples else self._by_port())

    def without(self, offer: str) -> PortModel:
        """The exact appendage but for what an offer adds to, which stays as it is."""
        exact = self.exact
        if self.body.spec.slosh is not None:
            return self.model
        if self.body.couples:
            return exact.model.picked([k for k in range(exact.model.modes) if k + 1 != int(offer)])
        ports = dict(exact.ports if self.body.data is None else self.body.ports)
        ports.pop(offer, None)
        if count := self.kept.counts.get(offer):
            ports[offer] = self.body.reduced(self.kept.target, offer, count)
        return model_in_space(ports, exact.model.rigid_mass)

    def _pendulum(self) -> "dict[str, Candidate]":
        given, data, count = self.body.spec.slosh, self.body.data, self.modes // 2 + 1
        assert given is not None
        assert data is not None
        if given.modes is not None or count > MOST:
            return {}
        kept = numbered(self.body, range(1, 2 * count + 1))
        return {"pendulum": self._with(kept, f"pendulum {count}", data.frequencies[2 * count - 1])}

    def _by_port(self) -> "Iterator[tuple[str, Candidate]]":
        target = self.kept.target
        for port in free_ports(self.body.spec):
            count = self.kept.counts.get(port, 0) + 1
            counts = {**self.kept.counts, port: count}
            whole = self._whole(port, count)
            if whole is None or count > whole.modes:
                continue
            body = replace(self.body, ports={**self.body.ports, port: whole})
            kept = Kept(target, counts)
            if body.data is not None:
                kept = numbered(body, first_of_ports(body.data, counts), target)
            newest = body.reduced(target, port, count).frequencies[-1]
            yield port, replace(self._with(kept, f"mode {count} in {port}", newest), body=body)

    def _by_number(self, band: float) -> "Iterator[tuple[str, Candidate]]":
        numbers, data, hub = self.kept.numbers, self.body.data, self.body.hub
        assert data is not None
        assert hub is not None
        if len(numbers) >= MOST_NAMED:
            return
        free = free_ports(self.body.spec)
        left = [k for k in range(data.modes) if k + 1 not in numbers and data.belongs[k] in free]
        exact = with_damping(self.exact.model, self.body.spec.undamped_ratio)
        heavy = weights(exact, hub, band)
        for k in sorted(left, key=lambda k: -heavy[k])[:TRIED]:
            kept = numbered(self.body, tuple(sorted((*numbers, k + 1))), self.kept.target)
            w = data.frequencies[k]
            yield str(k + 1), self._with(kept, f"mode {k + 1} of the file ({w:.4g} rad/s)", w)

    def _with(self, kept: Kept, added: str, newest: float) -> "Candidate":
        return replace(self, kept=kept, fit=None, added=added, newest=float(newest))

    def _whole(self, port: str, count: int) -> PortModel | None:
        """All modes of a port, of a beam at least some more than `count`;
        None where it is rigid."""
        if self.body.data is not None or port in self.body.ports:
            return self.body.ports.get(port)
        spec = self.body.spec
        try:
            model = spec.beam.port(port, 2 * count + 4, list(spec.further.values()))
        except InputError:
            return None
        return spec.with_ratios(port, model)
