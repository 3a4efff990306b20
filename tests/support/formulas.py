"""Doors to formulas that no public name reaches alone, so that closed forms stand beside them."""

from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.chain.links import bodies, raise_polar_inertia, settle_links, share
from beamchain.chain.recursion import Nodes, realise, split
from beamchain.craft.recovery import _left_out as load_of_modes_left_out
from beamchain.engine.partial_fractions import _accelerance as sum_of_poles
from beamchain.engine.signals import _small_turn as small_turn
from beamchain.fitting.needs import Promise
from beamchain.identification.resolution import resolution
from beamchain.plants.pointing import _total as total_index
from beamchain.ports.compare import as_compared, maximum_of, peak_clusters
from beamchain.ports.coupled import CoupledPort
from beamchain.report.outlines import Drawn
from beamchain.report.replay import _steepest as steepest
from beamchain.steps.driven import driven, run_of_turn
from beamchain.steps.integrators import (
    apparent_pole,
    continuous_poles,
    hinge_armature,
    largest_angle,
    polynomial,
    runge_kutta_limit,
    stable_armature,
    start_rate,
    step_pole,
    time_modes,
)
from beamchain.steps.large_motion import _Plane as PlanarChain
from beamchain.steps.modal import condensed_mass
from beamchain.structure.elements import _largest_change as change_of_frequencies
from beamchain.structure.planes import rounding_of_residual
from beamchain.structure.readers.nastran_bulk import System
from beamchain.structure.rigid_body import independent_parts, nearest_body
from beamchain.structure.sections_at import Sections
from beamchain.structure.slosh import Slosh

__all__ = [
    "Chain",
    "CoupledPort",
    "Drawn",
    "Hinge",
    "Link",
    "Nodes",
    "PlanarChain",
    "Promise",
    "Sections",
    "Slosh",
    "System",
    "apparent_pole",
    "as_compared",
    "bodies",
    "change_of_frequencies",
    "condensed_mass",
    "continuous_poles",
    "driven",
    "hinge_armature",
    "independent_parts",
    "largest_angle",
    "load_of_modes_left_out",
    "maximum_of",
    "nearest_body",
    "peak_clusters",
    "polynomial",
    "raise_polar_inertia",
    "realise",
    "resolution",
    "rounding_of_residual",
    "run_of_turn",
    "runge_kutta_limit",
    "settle_links",
    "share",
    "small_turn",
    "split",
    "stable_armature",
    "start_rate",
    "steepest",
    "step_pole",
    "sum_of_poles",
    "time_modes",
    "total_index",
]
