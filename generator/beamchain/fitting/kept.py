"""What is kept of an appendage, and how a scene decided."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from beamchain.errors import InputError
from beamchain.fitting.body import Body
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.modal_data import ModalData


@dataclass(frozen=True)
class LeftOut:
    """Something the model does without: what, why, and the in-band error it costs."""

    what: str
    why: str
    cost: float


@dataclass(frozen=True, eq=False)
class Choice:
    """The smallest model that keeps the promise, or the best there is.

    Args:
        modes: kept per port; ports without modes are rigid.
        target: which modes: "clamped", "free" or "hub".
        error: in-band error of the reduced models.
        met: 1.01 times the error stays within the tolerance.
        left_out: the ledger.
        cannot: what the model cannot answer.
        reasoning: how the choice was made, a line each.
    """

    modes: dict[str, int]
    target: str
    error: float
    met: bool
    left_out: tuple[LeftOut, ...]
    cannot: tuple[str, ...]
    reasoning: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Kept:
    """The modes that a chain shall have.

    Args:
        target: the root's boundary condition whose modes they are: "clamped", "free" or "hub".
        counts: how many of each port, ports without modes left out.
        whole: all modes where they are imported or those of a liquid, and `numbers`: of those that
            are kept, from 1.
        choice: how the scene decided; None where the modes are stated.
    """

    target: str
    counts: Mapping[str, int]
    whole: ModalData | None = None
    numbers: tuple[int, ...] = ()
    choice: Choice | None = None

    @cached_property
    def data(self) -> ModalData | None:
        """The kept modes themselves, where they are imported or those of a liquid."""
        if self.whole is None or len(self.numbers) == self.whole.modes:
            return self.whole
        return self.whole.selected(self.numbers) if self.numbers else self.whole.frozen()

    @property
    def blocks(self) -> tuple[tuple[str, ...], ...]:
        """Ports that the bench frees, those that modes or mass couple together; a planar boom is
        tested as the paper does."""
        if self.data is not None:
            return self.data.blocks
        return (("xy",),) if tuple(self.counts) == ("xy",) else tuple((port,) for port in PORTS)

    def of_chain(self, targets: Mapping[str, PortModel]) -> "Kept":
        """The modes of a beam that its chain came to have, by the models of its ports."""
        if self.whole is not None:
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


def numbered(body: Body, numbers: Sequence[int], target: str = "clamped") -> Kept:
    """The modes of these numbers in the file, from 1."""
    assert body.data is not None
    belongs = [body.data.belongs[k - 1] for k in numbers]
    counts = {port: belongs.count(port) for port in PORTS if port in belongs}
    return Kept(target, counts, body.data, tuple(sorted(numbers)))


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


def of_ports(body: Body, counts: Mapping[str, int], target: str = "clamped") -> Kept:
    """The first modes of each port."""
    counts = {port: counts[port] for port in PORTS if counts.get(port)}
    if body.data is None:
        return Kept(target, counts)
    return numbered(body, first_of_ports(body.data, counts), target)
