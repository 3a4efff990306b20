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
from beamchain.plants.blame import _own_direction as own_direction
from beamchain.plants.blame import _owners as owners_of_poles
from beamchain.plants.blame import _Start as StartOfPoles
from beamchain.plants.blame import _start as start_of_poles
from beamchain.plants.blame import instabilities
from beamchain.plants.bounds import _extended as extended_multipliers
from beamchain.plants.bounds import _halves as halves_of_box
from beamchain.plants.bounds import _middle as middle_of
from beamchain.plants.bounds import _narrow as is_narrow
from beamchain.plants.bounds import _without_unknown as unknown_behind
from beamchain.plants.bounds import frequencies as looked_at
from beamchain.plants.closed_loop import _check_algebraic as check_algebraic_loop
from beamchain.plants.closed_loop import _plant_step as step_of_plant
from beamchain.plants.closed_loop import _turn as turn_along
from beamchain.plants.closed_loop import unstable_count
from beamchain.plants.controllers import realise as realise_controller
from beamchain.plants.controllers import realise_fraction
from beamchain.plants.controllers import response as response_of_loop
from beamchain.plants.crossings import crossing as crossing_of_zero
from beamchain.plants.delay_margin import _between as crossings_between
from beamchain.plants.delay_margin import _by_state as loop_by_state
from beamchain.plants.delay_margin import _Crossings as SizeOneCrossings
from beamchain.plants.delay_margin import _crossings as crossings_of_size_one
from beamchain.plants.delay_margin import _driven as states_driven_for
from beamchain.plants.delay_margin import _polished as polished_delay
from beamchain.plants.delay_margin import sampled_delay_margin
from beamchain.plants.disturbed_craft import _check_linear as check_linear_in_speed
from beamchain.plants.disturbed_craft import _joint_force as torque_of_drive
from beamchain.plants.disturbed_craft import disturbed_craft, wheel_inputs
from beamchain.plants.error_indices import deviation_share, largest_deviation, windowed_variance
from beamchain.plants.local_loop import LocalLoop, delay_near, in_box, local_loop
from beamchain.plants.margins import LoopMargins as LoopOfMargins
from beamchain.plants.margins import _figures as margin_figures
from beamchain.plants.margins import _long_delays as long_delays
from beamchain.plants.margins import _of_all as margins_of_all
from beamchain.plants.margins import _peak as peak_of_grid
from beamchain.plants.margins import _refined as refined_bounds
from beamchain.plants.modal_response import ModalResponse
from beamchain.plants.modal_response import _exponential_states as states_of_a_rising_load
from beamchain.plants.multipliers import _between as between_ends
from beamchain.plants.multipliers import _blocks as blocks_of_deltas
from beamchain.plants.multipliers import _complex as from_real_symmetric
from beamchain.plants.multipliers import _hermitian as basis_of_hermitian
from beamchain.plants.multipliers import _moments as moments_of_delta
from beamchain.plants.multipliers import _real as real_symmetric
from beamchain.plants.multipliers import balanced as balanced_channels
from beamchain.plants.multipliers import prove as proof_over
from beamchain.plants.multipliers import solve_program, zero_crossings
from beamchain.plants.pointing import _beyond as beyond_modes_kept
from beamchain.plants.pointing import _check_stable as check_stable_craft
from beamchain.plants.pointing import _imbalances as imbalances_of_wheels
from beamchain.plants.pointing import _settling as settling_of_modes
from beamchain.plants.pointing import _total as total_index
from beamchain.plants.pole_paths import _assigned as assigned_poles
from beamchain.plants.pole_paths import _continued as continued_poles
from beamchain.plants.pole_paths import _moved as pole_moved
from beamchain.plants.pole_paths import _number as number_of_pole
from beamchain.plants.pole_paths import _settled as pole_settled
from beamchain.plants.pole_paths import _shift as shift_of_pole
from beamchain.plants.realisation import _zero_pole_product as zero_pole_product
from beamchain.plants.sampling import sampled as sampled_system
from beamchain.plants.scheduled import _follow as follow_modes
from beamchain.plants.simulated_gain import SteppedController, simulated_gain
from beamchain.plants.simulated_gain import _plan as plan_of_run
from beamchain.plants.simulated_gain import _whole as whole_count
from beamchain.plants.source_errors import _along as contributions_along_their_sum
from beamchain.plants.source_errors import _closed_in as closed_in
from beamchain.plants.source_errors import _integral as nodes_of_density
from beamchain.plants.source_errors import _mode_at as oscillator_nearest
from beamchain.plants.source_errors import _named_shares as named_shares
from beamchain.plants.source_errors import _periodic as periodic_of_harmonics
from beamchain.plants.source_errors import _running_mean as running_mean
from beamchain.plants.source_errors import _snap_times as snap_times
from beamchain.plants.source_errors import (
    branches,
    noise_error,
    snap_error,
    stepper_error,
    stepper_harmonics,
    wheel_error,
    wheel_orders,
)
from beamchain.plants.structured import _power_sum as power_sum
from beamchain.plants.structured import balanced_bounds
from beamchain.plants.structured import bound as structured_bound
from beamchain.plants.systems import growth as growth_of_poles
from beamchain.plants.uncertain_plant import _grid as frequencies_of_curves
from beamchain.plants.uncertain_plant import _with_peak as with_frequency_of_peak
from beamchain.plants.verdicts import _beyond as limited_by_modes_above
from beamchain.plants.verdicts import _limiting as limiting_modes
from beamchain.plants.wheel_run import _amplitudes as amplitudes_in_record
from beamchain.plants.wheel_run import _nutation as nutation_of_craft
from beamchain.plants.wheel_run import _place as place_of_output
from beamchain.plants.wheel_run import run_wheel
from beamchain.plants.wheel_sweep import WheelSweep
from beamchain.plants.wheel_sweep import _high_places as high_places
from beamchain.plants.worst_case import Loops as LoopsOfSamples
from beamchain.plants.worst_case import _reaches as reaches_output
from beamchain.plants.worst_case import _stability_limit as stability_limit
from beamchain.plants.worst_case import ascent
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
    "LinearModel",
    "Link",
    "LocalLoop",
    "LoopOfMargins",
    "LoopsOfSamples",
    "ModalForm",
    "ModalResponse",
    "ModesOfCraft",
    "Nodes",
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
    "SizeOneCrossings",
    "SlewBody",
    "Slosh",
    "StartOfPoles",
    "StepOfCraft",
    "SteppedController",
    "System",
    "Tendons",
    "Turn",
    "WheelSweep",
    "amplitudes_in_record",
    "apart",
    "apparent_pole",
    "as_compared",
    "ascent",
    "assigned_poles",
    "balanced_bounds",
    "balanced_channels",
    "basis_of_hermitian",
    "bent_line",
    "between_ends",
    "beyond_modes_kept",
    "blocks_of_deltas",
    "bodies",
    "body_mass_matrix",
    "branches",
    "change_of_frequencies",
    "check_algebraic_loop",
    "check_inertia",
    "check_linear_in_speed",
    "check_stable_craft",
    "closed_in",
    "clusters",
    "condensed_mass",
    "continued_poles",
    "continuous_poles",
    "contributions_along_their_sum",
    "crossing_of_zero",
    "crossings_between",
    "crossings_of_size_one",
    "culprit",
    "delay_near",
    "deviation_share",
    "disturbed_craft",
    "doubtful",
    "drive_in_hinge",
    "drive_of",
    "driven",
    "equal_parts",
    "extended_multipliers",
    "figure_of_sample",
    "first_moment",
    "follow_modes",
    "form2_many",
    "free_peaks",
    "frequencies_of_curves",
    "from_real_symmetric",
    "growth_of_poles",
    "halves_of_box",
    "high_places",
    "hinge_armature",
    "imbalances_of_wheels",
    "imported_warnings",
    "in_box",
    "independent_parts",
    "instabilities",
    "is_narrow",
    "joined",
    "largest_angle",
    "largest_deviation",
    "limited_by_modes_above",
    "limiting_modes",
    "linear_at",
    "load_of_modes_left_out",
    "local_loop",
    "long_delays",
    "looked_at",
    "loop_by_state",
    "map_by_differences",
    "margin_figures",
    "margins_of_all",
    "maximum_of",
    "middle_of",
    "mode_to_ring",
    "modes_finely_divided",
    "moments_of_delta",
    "momentum_of_mode",
    "motion_at",
    "motion_of_modes",
    "mount",
    "named_output",
    "named_shares",
    "nearest_body",
    "newton_step",
    "nodes_of_density",
    "noise_error",
    "number_of_pole",
    "nutation_of_craft",
    "offset_cautions",
    "oscillator_nearest",
    "own_direction",
    "owners_of_poles",
    "pairs_of_modes",
    "peak_clusters",
    "peak_of_grid",
    "periodic_of_harmonics",
    "phase_of_two",
    "place_of_output",
    "plan_of_run",
    "plane_of_chain",
    "pole_moved",
    "pole_settled",
    "polished_delay",
    "polynomial",
    "port_of_mode",
    "power_sum",
    "proof_over",
    "raise_polar_inertia",
    "reach",
    "reaches_output",
    "real_symmetric",
    "realisable_body",
    "realise",
    "realise_controller",
    "realise_fraction",
    "refined_bounds",
    "resolution",
    "response_of_loop",
    "rest_point",
    "rigid_body",
    "round_down",
    "rounding_of_residual",
    "run_of_drive",
    "run_of_turn",
    "run_wheel",
    "runge_kutta_limit",
    "running_mean",
    "sampled_delay_margin",
    "sampled_system",
    "sections_at",
    "seen",
    "servos_that_chatter",
    "settle_links",
    "settling_of_modes",
    "share",
    "shares_of_energy",
    "shift_of_pole",
    "simulate_hub",
    "simulated_gain",
    "skin_vertices",
    "slow_modes",
    "small_turn",
    "smallness",
    "snap_error",
    "snap_times",
    "solve_program",
    "split",
    "squared_phase",
    "stability_limit",
    "stable_armature",
    "start_of_poles",
    "start_rate",
    "states_driven_for",
    "states_of_a_rising_load",
    "steepest",
    "step_length",
    "step_of_plant",
    "step_pole",
    "step_warnings",
    "stepper_error",
    "stepper_harmonics",
    "structured_bound",
    "sum_of_poles",
    "time_modes",
    "torque_of_drive",
    "total_index",
    "tune",
    "turn",
    "turn_along",
    "turned_by",
    "turns_of_hinge",
    "unit_mass_of_port",
    "unit_of_control",
    "unknown_behind",
    "unstable_count",
    "weights_of_modes",
    "wheel_error",
    "wheel_inputs",
    "wheel_orders",
    "whole_count",
    "windowed_variance",
    "with_frequency_of_peak",
    "worst_sample",
    "zero_crossings",
    "zero_pole_product",
]
