"""What is kept of an appendage: the modes that are stated, or the fewest that its scene needs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs

from beamchain.errors import InputError
from beamchain.fitting.body import Body, body_of
from beamchain.fitting.fewest import fewest
from beamchain.fitting.needs import Candidates, Choice, choose
from beamchain.fitting.options import Modes
from beamchain.fitting.spec import Spec
from beamchain.ports.compare import with_damping
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.modal_data import ModalData


@dataclass(frozen=True, eq=False)
class Kept:
    """The modes that a chain shall have.

    Args:
        target: the root's boundary condition whose modes they are: "clamped", "free" or "hub".
        counts: how many of each port, ports without modes left out.
        data: the modes themselves, and `numbers`: theirs in the file, from 1, where they are
            imported or those of a liquid.
        choice: how the scene decided; None where the modes are stated.
    """

    target: str
    counts: Mapping[str, int]
    data: ModalData | None = None
    numbers: tuple[int, ...] = ()
    choice: Choice | None = None

    @property
    def blocks(self) -> tuple[tuple[str, ...], ...]:
        """Ports that the bench frees, those that modes or mass couple together; a planar boom is
        tested as the paper does."""
        if self.data is not None:
            return self.data.blocks
        return (("xy",),) if tuple(self.counts) == ("xy",) else tuple((port,) for port in PORTS)

    def of_chain(self, targets: Mapping[str, PortModel]) -> "Kept":
        """The modes of a beam that its chain came to have, by the models of its ports."""
        if self.data is not None:
            return self
        counts = {p: min(n, targets[p].modes) for p, n in self.counts.items() if p in targets}
        return replace(self, counts=counts)

    def hub(self, body: Body) -> Array:
        """`(6, 6)` the hub on which a free or hub target is exact, about the root: a free one's has
        no mass."""
        return np.zeros((6, 6)) if body.hub is None or self.target == "free" else body.hub

    def in_space(self, body: Body) -> PortModel:
        """The kept modes of a file in its live motions: themselves, or for another target than the
        clamped one as many modes of all on the hub of that target."""
        assert body.data is not None
        assert self.data is not None
        own = self.data.space()
        if self.target == "clamped" or not own.modes:
            return own
        hub = self.hub(body)[np.ix_(body.live, body.live)]
        return body.data.space().reduced(own.modes, hub)

    @property
    def coupled_ports(self) -> tuple[str, ...]:
        """The first ports that kept modes couple; empty where all are independent."""
        groups = self.data.groups if self.data is not None and self.data.modes else ()
        return next((ports for ports in groups if len(ports) > 1), ())


def select(body: Body, target: str | None = None) -> Kept:
    """The modes of an appendage that are kept; `target`: of those that the scene chooses, in place
    of the specification's."""
    spec = body.spec
    if spec.slosh is not None:
        return numbered(body, range(1, 2 * spec.slosh.kept + 1))
    named = None if spec.imported is None else spec.imported.modes
    if named is not None and spec.modes is not None:
        raise InputError(
            "[modes] and imported.modes are both given; name the modes by number "
            "(imported.modes) or count them per port ([modes])."
        )
    if not spec.chooses or named is not None:
        return _stated(body)
    fixed = {} if spec.modes is None else spec.modes.given()
    if body.couples:
        assert body.data is not None
        assert body.promise is not None
        assert spec.scene is not None
        first_of_ports(body.data, fixed)  # refuses more than there are
        numbers, choice = fewest(
            body.promise,
            with_damping(body.data.space(), spec.undamped_ratio),
            body.data.belongs,
            spec.scene.tolerance,
            fixed,
            spec.scene.tip,
        )
        return numbered(body, numbers, choice=choice)
    choice = _chosen(body, fixed, target or spec.root.target)
    counts = {port: count for port, count in choice.modes.items() if count}
    if body.data is None:
        return Kept(choice.target, counts, choice=choice)
    return numbered(body, first_of_ports(body.data, counts), choice.target, choice)


def everything(spec: Spec) -> Spec:
    """The spec with every port kept.

    All cantilever modes up to three times the scene's bandwidth, one to five each and no fewer than
    the scene needs; of imported modes all.
    """
    if not spec.chooses or spec.scene is None or spec.scene.bandwidth is None:
        raise InputError(
            "nothing is left out without scene.bandwidth; give [scene] bandwidth, or state [modes]."
        )
    if spec.imported is not None:
        every = tuple(range(1, spec.imported.read().modes + 1))
        return structs.replace(
            spec, imported=structs.replace(spec.imported, modes=every), modes=None
        )
    body = body_of(spec)
    needed = select(body).counts
    counts = {
        port: max(
            needed.get(port, 0),
            int(np.clip(np.sum(model.frequencies <= 3.0 * spec.scene.bandwidth), 1, 5)),
        )
        for port, model in body.ports.items()
    }
    return structs.replace(spec, modes=Modes(**counts))


def _stated(body: Body) -> Kept:
    """The modes that a specification states; of imported ones all where it states none."""
    spec, data = body.spec, body.data
    target = "clamped" if spec.root.target in (None, "auto") else str(spec.root.target)
    if data is None:
        _check_counts(body)
        return Kept(target, dict(spec.kept))
    numbers = None if spec.imported is None else spec.imported.modes
    if numbers is None and spec.modes is not None:
        numbers = first_of_ports(data, spec.modes.counts())
    kept = numbered(body, range(1, data.modes + 1) if numbers is None else numbers, target)
    if target != "clamped":
        first = tuple(range(1, len(kept.numbers) + 1))
        lowest = first if kept.coupled_ports else first_of_ports(data, kept.counts)
        if kept.numbers != lowest:
            raise InputError(
                f'modes {list(kept.numbers)} of the file and root.target = "{target}" do not go '
                f"together: that target takes the lowest modes, here {list(lowest)}; write "
                f'imported.modes = {list(lowest)}, or target = "clamped".'
            )
    return kept


def numbered(
    body: Body,
    numbers: "tuple[int, ...] | range",
    target: str = "clamped",
    choice: Choice | None = None,
) -> Kept:
    """The modes of these numbers in the file, from 1."""
    assert body.data is not None
    data = body.data
    if len(numbers) < data.modes:
        data = data.selected(tuple(numbers)) if numbers else data.frozen()
    counts = {port: data.belongs.count(port) for port in PORTS if port in data.belongs}
    return Kept(target, counts, data, tuple(sorted(numbers)), choice)


def _chosen(body: Body, fixed: Mapping[str, int], wanted: str | None) -> Choice:
    """The fewest modes of independent ports that keep the promise, for the `wanted` target or the
    best; `fixed`: ports whose number was typed."""
    spec, promise = body.spec, body.promise_of_ports
    assert promise is not None
    assert spec.scene is not None
    _check_counts(body)
    for port, count in fixed.items():
        if count and port not in body.ports:
            raise InputError(
                f"modes.{port} = {count} but the appendage is rigid there; set it to 0."
            )
    able = ["clamped", "free" if body.hub is None else "hub"]
    able = able[:1] if spec.further else able
    targets = able if wanted in (None, "auto") else [str(wanted)]
    frequencies = {port: model.frequencies for port, model in body.ports.items()}
    candidates = Candidates(body.in_band, frequencies, body.reduced)
    return choose(promise, candidates, targets, spec.scene.tolerance, fixed, spec.scene.tip)


def _check_counts(body: Body) -> None:
    """Every port has as many modes as were typed."""
    for port, count in ({} if body.spec.modes is None else body.spec.modes.given()).items():
        if port in body.ports and count > body.ports[port].modes:
            raise InputError(
                f"modes.{port} = {count}, but the appendage has only {body.ports[port].modes} "
                "there; ask for fewer."
            )


def first_of_ports(data: ModalData, counts: Mapping[str, int]) -> tuple[int, ...]:
    """Numbers of the first modes of each port."""
    numbers: list[int] = []
    for port, count in counts.items():
        own = [k + 1 for k, b in enumerate(data.belongs) if b == port]
        if len(own) < count:
            raise InputError(
                f"modes.{port} = {count}, but only {len(own)} of the imported modes move mainly in "
                f"{port}; ask for fewer, or import more modes."
            )
        numbers += own[:count]
    return tuple(sorted(numbers))
