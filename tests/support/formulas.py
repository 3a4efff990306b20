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
from beamchain.engine.driven_hinge import Seen, Turn, drive_of, seen
from beamchain.engine.driven_hinge import run as run_of_drive
from beamchain.engine.linear import Carrying, linear_at, rigid_body
from beamchain.engine.loaded import offset_cautions
from beamchain.engine.mount import mount
from beamchain.engine.operating_point import rest_point
from beamchain.engine.partial_fractions import _accelerance as sum_of_poles
from beamchain.engine.reach import reach, turn
from beamchain.engine.rollout import simulate as simulate_hub
from beamchain.engine.signals import _small_turn as small_turn
from beamchain.engine.signals import _unit as unit_of_control
from beamchain.engine.signals import named_output
from beamchain.engine.slew import _in_hinge as drive_in_hinge
from beamchain.engine.slew import _mode_to_ring as mode_to_ring
from beamchain.fitting.fewest import weights as weights_of_modes
from beamchain.fitting.needs import Promise
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
from beamchain.steps.culprit import culprit, inertia_words, stable_step
from beamchain.steps.cures import Names, Setting, find_cure, round_down
from beamchain.steps.driven import driven, run_of_turn
from beamchain.steps.forms import Craft, appendage_poles, form2, form2_many, form4, tune
from beamchain.steps.forms import _Step as StepOfCraft
from beamchain.steps.forms import stability as squared_phase
from beamchain.steps.integrators import (
    apparent_pole,
    continuous_poles,
    hinge_armature,
    largest_angle,
    place_poles,
    polynomial,
    runge_kutta_limit,
    stable_armature,
    start_rate,
    step_pole,
    time_modes,
)
from beamchain.steps.large_motion import LargeMotion, large_limits, large_motion
from beamchain.steps.large_motion import _leaves as leaves_at
from beamchain.steps.large_motion import _Plane as PlanarChain
from beamchain.steps.large_motion import _plane as plane_of_chain
from beamchain.steps.latch import Hinge as PlaceOfHinge
from beamchain.steps.latch import _has_just_passed as has_just_passed
from beamchain.steps.latch import _is_stop as is_stop
from beamchain.steps.latch import _round_up as rounded_up
from beamchain.steps.latch import _stop_ahead as stop_ahead
from beamchain.steps.limits import (
    LinearModel,
    choose_step,
    coupled_limits,
    oscillating,
    oscillations,
    step_limits,
)
from beamchain.steps.limits import normalise as unit_mass_of_port
from beamchain.steps.modal import condensed_mass, made_for, modal_tendons, stiffness_before
from beamchain.steps.poles import PoleRow, growing_frequencies, mismatch, phase_limit, pole_rows
from beamchain.steps.sampled import _peaks as peaks_of_poles
from beamchain.steps.sampled import (
    exact_response,
    judged_part,
    off_by,
    represents,
    sampled_error,
    step_response,
)
from beamchain.steps.saturation import servos_that_chatter
from beamchain.steps.step_map import (
    Motion,
    ShiftedPeak,
    TimeError,
    damped_by,
    growing_poses,
    last_kept,
    lowest_wrong,
    motion_at,
    pole_pairs,
    shifted_peak,
    time_error,
)
from beamchain.steps.step_map import _by_differences as map_by_differences
from beamchain.steps.tree_draws import TreeDraws
from beamchain.steps.tree_response import Compared, Tendons
from beamchain.steps.tree_response import Seen as SeenAtPose
from beamchain.steps.tree_time import Alone, appendages_alone, tuned_poses
from beamchain.steps.tree_time import _modes as modes_of_tendons
from beamchain.steps.tree_time import _newton_step as newton_step
from beamchain.steps.tree_time import _Room as Room
from beamchain.steps.tree_time import _step_length as step_length
from beamchain.structure.elements import _largest_change as change_of_frequencies
from beamchain.structure.planes import rounding_of_residual
from beamchain.structure.readers.nastran_bulk import System
from beamchain.structure.rigid_body import independent_parts, nearest_body, realisable_body
from beamchain.structure.sections_at import Sections, sections_at
from beamchain.structure.slosh import Slosh

__all__ = [
    "Alone",
    "BentLine",
    "Carrying",
    "Chain",
    "Compared",
    "CoupledPort",
    "Craft",
    "Drawn",
    "Hinge",
    "LargeMotion",
    "LinearModel",
    "Link",
    "LoopsOfSamples",
    "ModalForm",
    "ModalResponse",
    "ModesOfCraft",
    "Motion",
    "Names",
    "Nodes",
    "PlaceOfHinge",
    "PlanarChain",
    "PoleRow",
    "Promise",
    "Reference",
    "Room",
    "SampleLoops",
    "Sections",
    "Seen",
    "SeenAtPose",
    "Setting",
    "Shapes",
    "ShiftedPeak",
    "SlewBody",
    "Slosh",
    "StepOfCraft",
    "System",
    "Tendons",
    "TimeError",
    "TreeDraws",
    "Turn",
    "WheelSweep",
    "apart",
    "apparent_pole",
    "appendage_poles",
    "appendages_alone",
    "as_compared",
    "balanced_bounds",
    "bent_line",
    "bodies",
    "body_mass_matrix",
    "change_of_frequencies",
    "check_inertia",
    "choose_step",
    "closed_in",
    "clusters",
    "condensed_mass",
    "continuous_poles",
    "coupled_limits",
    "culprit",
    "damped_by",
    "delay_near",
    "deviation_share",
    "doubtful",
    "drive_in_hinge",
    "drive_of",
    "driven",
    "equal_parts",
    "exact_response",
    "figure_of_sample",
    "find_cure",
    "first_moment",
    "form2",
    "form2_many",
    "form4",
    "free_peaks",
    "growing_frequencies",
    "growing_poses",
    "has_just_passed",
    "hinge_armature",
    "imported_warnings",
    "independent_parts",
    "inertia_words",
    "is_stop",
    "joined",
    "judged_part",
    "large_limits",
    "large_motion",
    "largest_angle",
    "largest_deviation",
    "last_kept",
    "leaves_at",
    "limiting_modes",
    "linear_at",
    "load_of_modes_left_out",
    "lowest_wrong",
    "made_for",
    "map_by_differences",
    "maximum_of",
    "mismatch",
    "modal_tendons",
    "mode_to_ring",
    "modes_finely_divided",
    "modes_of_tendons",
    "momentum_of_mode",
    "motion_at",
    "motion_of_modes",
    "mount",
    "named_output",
    "nearest_body",
    "newton_step",
    "nodes_of_density",
    "off_by",
    "offset_cautions",
    "oscillating",
    "oscillations",
    "pairs_of_modes",
    "peak_clusters",
    "peaks_of_poles",
    "phase_limit",
    "phase_of_two",
    "place_poles",
    "plane_of_chain",
    "pole_pairs",
    "pole_rows",
    "polynomial",
    "port_of_mode",
    "raise_polar_inertia",
    "reach",
    "realisable_body",
    "realise",
    "represents",
    "resolution",
    "rest_point",
    "rigid_body",
    "round_down",
    "rounded_up",
    "rounding_of_residual",
    "run_of_drive",
    "run_of_turn",
    "runge_kutta_limit",
    "running_mean",
    "sampled_error",
    "sections_at",
    "seen",
    "servos_that_chatter",
    "settle_links",
    "share",
    "shares_of_energy",
    "shifted_peak",
    "simulate_hub",
    "skin_vertices",
    "slow_modes",
    "small_turn",
    "smallness",
    "split",
    "squared_phase",
    "stable_armature",
    "stable_step",
    "start_rate",
    "states_of_a_rising_load",
    "steepest",
    "step_length",
    "step_limits",
    "step_pole",
    "step_response",
    "step_warnings",
    "stiffness_before",
    "stop_ahead",
    "structured_bound",
    "sum_of_poles",
    "time_error",
    "time_modes",
    "total_index",
    "tune",
    "tuned_poses",
    "turn",
    "turned_by",
    "turns_of_hinge",
    "unit_mass_of_port",
    "unit_of_control",
    "weights_of_modes",
    "windowed_variance",
    "worst_sample",
]
