"""Doors to formulas that no public name reaches alone, so that closed forms stand beside them."""

from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.chain.links import bodies, raise_polar_inertia, settle_links, share
from beamchain.chain.recursion import Nodes, realise, split
from beamchain.craft.bent_line import BentLine, bent_line, turned_by
from beamchain.craft.bent_line import _motion as motion_of_modes
from beamchain.craft.coupled_modes import _clusters as clusters
from beamchain.craft.coupled_modes import _Modes as ModesOfCraft
from beamchain.craft.coupled_modes import _momentum as momentum_of_mode
from beamchain.craft.coupled_modes import _pairs as pairs_of_modes
from beamchain.craft.coupled_modes import _phase as phase_of_two
from beamchain.craft.coupled_modes import _port as port_of_mode
from beamchain.craft.coupled_modes import _shares as shares_of_energy
from beamchain.craft.coupled_modes import slow_modes
from beamchain.craft.modal_form import ModalForm
from beamchain.craft.quantities import _check_inertia as check_inertia
from beamchain.craft.recovery import _left_out as load_of_modes_left_out
from beamchain.craft.slews import SlewBody
from beamchain.craft.slews import _apart as apart
from beamchain.craft.slews import _more as modes_finely_divided
from beamchain.craft.slews import _parts as equal_parts
from beamchain.craft.slews import _Reference as Reference
from beamchain.craft.slews import _turns as turns_of_hinge
from beamchain.engine.drawn import skin_vertices
from beamchain.engine.driven_hinge import Drive, Seen, Turn, drive_of, seen
from beamchain.engine.driven_hinge import Run as StatesOfRun
from beamchain.engine.driven_hinge import run as run_of_drive
from beamchain.engine.linear import (
    Activations,
    Carrying,
    Inputs,
    Outputs,
    Signal,
    activation_names,
    coordinate_names,
    linear_at,
    rigid_body,
    slopes,
)
from beamchain.engine.loaded import offset_cautions
from beamchain.engine.mount import mount
from beamchain.engine.operating_point import rest_point
from beamchain.engine.partial_fractions import _accelerance as sum_of_poles
from beamchain.engine.reach import reach, turn
from beamchain.engine.rollout import simulate as simulate_hub
from beamchain.engine.signals import (
    Input,
    base,
    control_names,
    named_inputs,
    named_output,
    sensor_axes,
)
from beamchain.engine.signals import _small_turn as small_turn
from beamchain.engine.signals import _unit as unit_of_control
from beamchain.engine.slew import Slew
from beamchain.engine.slew import _hinge as hinge_to_turn
from beamchain.engine.slew import _impulse as impulse_of_halves
from beamchain.engine.slew import _in_hinge as drive_in_hinge
from beamchain.engine.slew import _long_enough as long_enough
from beamchain.engine.slew import _mode_to_ring as mode_to_ring
from beamchain.engine.slew import _on_hub as drive_on_hub
from beamchain.engine.slew import _without_actuators as without_actuators
from beamchain.engine.slew import simulate as simulate_slew
from beamchain.fitting.fewest import weights as weights_of_modes
from beamchain.fitting.hub import assumed_hub, default_hub, port_hub_mass
from beamchain.fitting.needs import Candidates, Promise, with_polar_inertia
from beamchain.fitting.needs import choose as choose_modes
from beamchain.fitting.warnings import doubtful, imported_warnings, step_warnings
from beamchain.identification.resolution import resolution
from beamchain.plants.error_indices import deviation_share, largest_deviation, windowed_variance
from beamchain.plants.local_loop import delay_near
from beamchain.plants.modal_response import ModalResponse
from beamchain.plants.modal_response import _exponential_states as states_of_a_rising_load
from beamchain.plants.pointing import _total as total_index
from beamchain.plants.source_errors import _closed_in as closed_in
from beamchain.plants.source_errors import _integral as nodes_of_density
from beamchain.plants.source_errors import _running_mean as running_mean
from beamchain.plants.structured import balanced_bounds
from beamchain.plants.structured import bound as structured_bound
from beamchain.plants.verdicts import _limiting as limiting_modes
from beamchain.plants.wheel_sweep import WheelSweep
from beamchain.plants.worst_case import Loops as LoopsOfSamples
from beamchain.plants.worst_case import search as worst_sample
from beamchain.plants.worst_margins import SampleLoops, smallness
from beamchain.plants.worst_margins import figure as figure_of_sample
from beamchain.ports.compare import as_compared, free_peaks, maximum_of, peak_clusters
from beamchain.ports.compose import joined
from beamchain.ports.coupled import CoupledPort
from beamchain.ports.model import Shapes
from beamchain.ports.motions import body_mass_matrix, first_moment
from beamchain.report.outlines import Drawn
from beamchain.report.replay import _steepest as steepest
from beamchain.steps.culprit import culprit
from beamchain.steps.cures import round_down
from beamchain.steps.driven import driven, run_of_turn
from beamchain.steps.forms import Craft, form2_many, tune
from beamchain.steps.forms import _Step as StepOfCraft
from beamchain.steps.forms import stability as squared_phase
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
from beamchain.steps.large_motion import _plane as plane_of_chain
from beamchain.steps.limits import LinearModel
from beamchain.steps.limits import normalise as unit_mass_of_port
from beamchain.steps.modal import condensed_mass
from beamchain.steps.poles import PoleRow
from beamchain.steps.saturation import servos_that_chatter
from beamchain.steps.step_map import _by_differences as map_by_differences
from beamchain.steps.step_map import motion_at
from beamchain.steps.tree_response import Compared, Tendons
from beamchain.steps.tree_response import Seen as SeenAtPose
from beamchain.steps.tree_time import Alone
from beamchain.steps.tree_time import _newton_step as newton_step
from beamchain.steps.tree_time import _Room as Room
from beamchain.steps.tree_time import _step_length as step_length
from beamchain.structure.elements import (
    Body,
    MotionRows,
    Piece,
    Spring,
    assemble,
    assemble_lowest,
    inverse_stiffness_root,
    legendre_series,
)
from beamchain.structure.elements import _largest_change as change_of_frequencies
from beamchain.structure.elements import _new_directions as new_directions
from beamchain.structure.elements import _shapes_of_fewer as shapes_of_fewer
from beamchain.structure.elements import _sums_behind as sums_behind
from beamchain.structure.mass_line import (
    MassBesideAxis,
    MassPiece,
    SpreadMass,
    default_length,
    mass_line_of_pieces,
    spread_mass,
    uniform_length,
)
from beamchain.structure.mass_line import _mass_beside_axis as mass_beside_axis
from beamchain.structure.planes import rounding_of_residual
from beamchain.structure.readers.nastran_bulk import System
from beamchain.structure.rigid_body import independent_parts, nearest_body, realisable_body
from beamchain.structure.section import soft_modulus
from beamchain.structure.sections_at import Sections, sections_at
from beamchain.structure.slosh import Slosh

__all__ = [
    "Activations",
    "Alone",
    "BentLine",
    "Body",
    "Candidates",
    "Carrying",
    "Chain",
    "Compared",
    "CoupledPort",
    "Craft",
    "Drawn",
    "Drive",
    "Hinge",
    "Input",
    "Inputs",
    "LinearModel",
    "Link",
    "LoopsOfSamples",
    "MassBesideAxis",
    "MassPiece",
    "ModalForm",
    "ModalResponse",
    "ModesOfCraft",
    "MotionRows",
    "Nodes",
    "Outputs",
    "Piece",
    "PlanarChain",
    "PoleRow",
    "Promise",
    "Reference",
    "Room",
    "SampleLoops",
    "Sections",
    "Seen",
    "SeenAtPose",
    "Shapes",
    "Signal",
    "Slew",
    "SlewBody",
    "Slosh",
    "SpreadMass",
    "Spring",
    "StatesOfRun",
    "StepOfCraft",
    "System",
    "Tendons",
    "Turn",
    "WheelSweep",
    "activation_names",
    "apart",
    "apparent_pole",
    "as_compared",
    "assemble",
    "assemble_lowest",
    "assumed_hub",
    "balanced_bounds",
    "base",
    "bent_line",
    "bodies",
    "body_mass_matrix",
    "change_of_frequencies",
    "check_inertia",
    "choose_modes",
    "closed_in",
    "clusters",
    "condensed_mass",
    "continuous_poles",
    "control_names",
    "coordinate_names",
    "culprit",
    "default_hub",
    "default_length",
    "delay_near",
    "deviation_share",
    "doubtful",
    "drive_in_hinge",
    "drive_of",
    "drive_on_hub",
    "driven",
    "equal_parts",
    "figure_of_sample",
    "first_moment",
    "form2_many",
    "free_peaks",
    "hinge_armature",
    "hinge_to_turn",
    "imported_warnings",
    "impulse_of_halves",
    "independent_parts",
    "inverse_stiffness_root",
    "joined",
    "largest_angle",
    "largest_deviation",
    "legendre_series",
    "limiting_modes",
    "linear_at",
    "load_of_modes_left_out",
    "long_enough",
    "map_by_differences",
    "mass_beside_axis",
    "mass_line_of_pieces",
    "maximum_of",
    "mode_to_ring",
    "modes_finely_divided",
    "momentum_of_mode",
    "motion_at",
    "motion_of_modes",
    "mount",
    "named_inputs",
    "named_output",
    "nearest_body",
    "new_directions",
    "newton_step",
    "nodes_of_density",
    "offset_cautions",
    "pairs_of_modes",
    "peak_clusters",
    "phase_of_two",
    "plane_of_chain",
    "polynomial",
    "port_hub_mass",
    "port_of_mode",
    "raise_polar_inertia",
    "reach",
    "realisable_body",
    "realise",
    "resolution",
    "rest_point",
    "rigid_body",
    "round_down",
    "rounding_of_residual",
    "run_of_drive",
    "run_of_turn",
    "runge_kutta_limit",
    "running_mean",
    "sections_at",
    "seen",
    "sensor_axes",
    "servos_that_chatter",
    "settle_links",
    "shapes_of_fewer",
    "share",
    "shares_of_energy",
    "simulate_hub",
    "simulate_slew",
    "skin_vertices",
    "slopes",
    "slow_modes",
    "small_turn",
    "smallness",
    "soft_modulus",
    "split",
    "spread_mass",
    "squared_phase",
    "stable_armature",
    "start_rate",
    "states_of_a_rising_load",
    "steepest",
    "step_length",
    "step_pole",
    "step_warnings",
    "structured_bound",
    "sum_of_poles",
    "sums_behind",
    "time_modes",
    "total_index",
    "tune",
    "turn",
    "turned_by",
    "turns_of_hinge",
    "uniform_length",
    "unit_mass_of_port",
    "unit_of_control",
    "weights_of_modes",
    "windowed_variance",
    "with_polar_inertia",
    "without_actuators",
    "worst_sample",
]
