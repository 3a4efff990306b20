"""What making a chain gives: the chain, the targets it was made for, and what is to be said of it."""

from collections.abc import Callable
from dataclasses import dataclass

from beamchain.chain.chain import Chain
from beamchain.chain.cut import Cut
from beamchain.ports.model import PortModel

#: Target with the given number of modes of a port.
TargetOf = Callable[[str, int], PortModel]


@dataclass(frozen=True)
class Status:
    """What became of a fit.

    Args:
        ok: everything asked for was reached.
        message: what was made, in a sentence or two.
        history: what was tried, in order.
    """

    ok: bool
    message: str
    history: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Built:
    """A chain, the targets it was made for, how it came about, and the cut it stands on where one was chosen."""

    chain: Chain
    targets: dict[str, PortModel]
    status: Status
    cut: Cut | None = None
