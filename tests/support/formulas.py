"""Doors to formulas that no public name reaches alone, so that closed forms stand beside them."""

from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.chain.links import bodies, raise_polar_inertia, settle_links, share
from beamchain.chain.recursion import Nodes, realise
from beamchain.craft.recovery import _left_out as load_of_modes_left_out
from beamchain.fitting.needs import Promise
from beamchain.identification.resolution import resolution
from beamchain.plants.pointing import _total as total_index
from beamchain.ports.compare import as_compared, maximum_of, peak_clusters
from beamchain.ports.coupled import CoupledPort
from beamchain.report.outlines import Drawn
from beamchain.report.replay import _steepest as steepest
from beamchain.steps.integrators import step_pole

__all__ = [
    "Chain",
    "CoupledPort",
    "Drawn",
    "Hinge",
    "Link",
    "Nodes",
    "Promise",
    "as_compared",
    "bodies",
    "load_of_modes_left_out",
    "maximum_of",
    "peak_clusters",
    "raise_polar_inertia",
    "realise",
    "resolution",
    "settle_links",
    "share",
    "steepest",
    "step_pole",
    "total_index",
]
