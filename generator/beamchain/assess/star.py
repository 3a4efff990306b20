"""The oscillator form as a competitor of a study: the beam's cantilever modes, each a body on one joint.

Exact at the port like the clamped chain of as many modes, and linear in what bends: no geometric stiffening.
"""

from collections.abc import Mapping

import numpy as np
from lxml.etree import _Element as Element

from beamchain.chain.oscillators import Oscillators, realise_oscillators
from beamchain.mjcf.oscillators import oscillators
from beamchain.motion import Array
from beamchain.port import PortModel, in_space

ROUNDING = 1e-12  # relative, of computed modes


def star(full: Mapping[str, PortModel], counts: Mapping[str, int], rigid_mass: Array, length: float) -> Oscillators:
    """The oscillators of the first modes per port.

    Args:
        full: all modes per port, with their damping ratios.
        counts: modes kept per port.
        rigid_mass: `(6, 6)` of the appendage about its root, its polar inertia included.
        length: root to tip [m].

    Raises:
        RealisationError: the modes leave less than nothing of the appendage.
    """
    whole = in_space({port: full[port].truncated(count) for port, count in counts.items()}, rigid_mass)
    numbers = range(1, whole.modes + 1)
    return realise_oscillators(
        whole.rigid_mass, whole.frequencies, whole.participation, whole.damping, numbers=numbers, length=length,
        precision=ROUNDING,
    )  # fmt: skip


def star_tree(made: Oscillators) -> Element:
    """Its bodies as MJCF, nothing drawn."""
    return oscillators(made, "appendage", visuals=False)


def fastest(made: Oscillators, hub: Array) -> tuple[float, float]:
    """Fastest frequency on a hub `(6, 6)` about the root [rad/s], and the largest damping ratio of the modes."""
    own = made.space()
    return float(np.max(own.with_hub(hub).free_frequencies)), float(np.max(own.damping))
