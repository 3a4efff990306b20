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
from beamchain.engine.allocation import Allocated, allocated
from beamchain.engine.allocation import _inverse as inverse_of_torques
from beamchain.engine.allocation import _null_directions as null_directions
from beamchain.engine.allocation import _torque as torque_of_actuator
from beamchain.engine.allocation import torques as torques_of_allocation
from beamchain.engine.bench import (
    Composite,
    Measured,
    ballast_for,
    composite,
    distance,
    mass_of_bodies,
    measure,
    rigid_mass,
    root_body,
)
from beamchain.engine.bench import _freedoms as freedoms_of_block
from beamchain.engine.bench import _in_planes as in_planes
from beamchain.engine.drawn import skin_vertices
from beamchain.engine.driven_hinge import Drive as DriveOfHinge
from beamchain.engine.driven_hinge import Run as RunOfDrive
from beamchain.engine.driven_hinge import Seen, Turn, drive_of, seen
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
from beamchain.engine.linearise import (
    Held,
    check_freedoms,
    implicit_stiffness,
    mass_of_alone,
    runge_kutta_step,
)
from beamchain.engine.linearise import _motor_freedoms as motor_freedoms
from beamchain.engine.loaded import (
    Loading,
    check_pushes,
    key_number,
    load_at,
    loaded_linear,
    loading_at,
    offset_cautions,
)
from beamchain.engine.loaded import _push as push_of_actuators
from beamchain.engine.mount import _carriers as carriers
from beamchain.engine.mount import apparent_hubs, held_joints, mount, rigid_hubs, root_frame
from beamchain.engine.operating_point import rest_point, still_copy
from beamchain.engine.partial_fractions import _accelerance as sum_of_poles
from beamchain.engine.reach import reach, turn
from beamchain.engine.rollout import _rotation as rotation_vectors
from beamchain.engine.rollout import seconds_of
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
from beamchain.engine.slew import _check_steps as check_steps
from beamchain.engine.slew import _hinge as hinge_to_turn
from beamchain.engine.slew import _impulse as impulse
from beamchain.engine.slew import _in_hinge as drive_in_hinge
from beamchain.engine.slew import _long_enough as long_enough
from beamchain.engine.slew import _mode_to_ring as mode_to_ring
from beamchain.engine.slew import _on_hub as drive_on_hub
from beamchain.engine.slew import _run as run_of_push
from beamchain.engine.slew import _without_actuators as without_actuators
from beamchain.engine.slew import simulate as simulate_slew
from beamchain.fitting.fewest import weights as weights_of_modes
from beamchain.fitting.hub import assumed_hub, default_hub, port_hub_mass
from beamchain.fitting.imported import ImportedCase, imported_case, same_planes
from beamchain.fitting.imported import _check_body as check_body
from beamchain.fitting.imported import _first as first_of_ports
from beamchain.fitting.imported import _ratios as damping_of_file
from beamchain.fitting.imported import _roomy as line_with_room
from beamchain.fitting.imported import _visible_modes as visible_modes
from beamchain.fitting.needs import Candidates, Promise, choose, with_polar_inertia
from beamchain.fitting.result import InSpace
from beamchain.fitting.slosh import (
    SloshCase,
    heavy,
    limp_model,
    pendulum_chain,
    slosh_case,
    weightless,
)
from beamchain.fitting.warnings import (
    doubtful,
    fit_warnings,
    imported_warnings,
    rigid_plane,
    step_warnings,
    turn_warning,
)
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
from beamchain.structure.elements import _largest_change as change_of_frequencies
from beamchain.structure.mass_line import spread_mass
from beamchain.structure.planes import rounding_of_residual
from beamchain.structure.readers.nastran_bulk import System
from beamchain.structure.rigid_body import independent_parts, nearest_body, realisable_body
from beamchain.structure.sections_at import Sections, sections_at
from beamchain.structure.slosh import Slosh

__all__ = [
    "Activations",
    "Allocated",
    "Alone",
    "BentLine",
    "Candidates",
    "Carrying",
    "Chain",
    "Compared",
    "Composite",
    "CoupledPort",
    "Craft",
    "Drawn",
    "DriveOfHinge",
    "Held",
    "Hinge",
    "ImportedCase",
    "InSpace",
    "Input",
    "Inputs",
    "LinearModel",
    "Link",
    "Loading",
    "LoopsOfSamples",
    "Measured",
    "ModalForm",
    "ModalResponse",
    "ModesOfCraft",
    "Nodes",
    "Outputs",
    "PlanarChain",
    "PoleRow",
    "Promise",
    "Reference",
    "Room",
    "RunOfDrive",
    "SampleLoops",
    "Sections",
    "Seen",
    "SeenAtPose",
    "Shapes",
    "Signal",
    "Slew",
    "SlewBody",
    "Slosh",
    "SloshCase",
    "StepOfCraft",
    "System",
    "Tendons",
    "Turn",
    "WheelSweep",
    "activation_names",
    "allocated",
    "apart",
    "apparent_hubs",
    "apparent_pole",
    "as_compared",
    "assumed_hub",
    "balanced_bounds",
    "ballast_for",
    "base",
    "bent_line",
    "bodies",
    "body_mass_matrix",
    "carriers",
    "change_of_frequencies",
    "check_body",
    "check_freedoms",
    "check_inertia",
    "check_pushes",
    "check_steps",
    "choose",
    "closed_in",
    "clusters",
    "composite",
    "condensed_mass",
    "continuous_poles",
    "control_names",
    "coordinate_names",
    "culprit",
    "damping_of_file",
    "default_hub",
    "delay_near",
    "deviation_share",
    "distance",
    "doubtful",
    "drive_in_hinge",
    "drive_of",
    "drive_on_hub",
    "driven",
    "equal_parts",
    "figure_of_sample",
    "first_moment",
    "first_of_ports",
    "fit_warnings",
    "form2_many",
    "free_peaks",
    "freedoms_of_block",
    "heavy",
    "held_joints",
    "hinge_armature",
    "hinge_to_turn",
    "implicit_stiffness",
    "imported_case",
    "imported_warnings",
    "impulse",
    "in_planes",
    "independent_parts",
    "inverse_of_torques",
    "joined",
    "key_number",
    "largest_angle",
    "largest_deviation",
    "limiting_modes",
    "limp_model",
    "line_with_room",
    "linear_at",
    "load_at",
    "load_of_modes_left_out",
    "loaded_linear",
    "loading_at",
    "long_enough",
    "map_by_differences",
    "mass_of_alone",
    "mass_of_bodies",
    "maximum_of",
    "measure",
    "mode_to_ring",
    "modes_finely_divided",
    "momentum_of_mode",
    "motion_at",
    "motion_of_modes",
    "motor_freedoms",
    "mount",
    "named_inputs",
    "named_output",
    "nearest_body",
    "newton_step",
    "nodes_of_density",
    "null_directions",
    "offset_cautions",
    "pairs_of_modes",
    "peak_clusters",
    "pendulum_chain",
    "phase_of_two",
    "plane_of_chain",
    "polynomial",
    "port_hub_mass",
    "port_of_mode",
    "push_of_actuators",
    "raise_polar_inertia",
    "reach",
    "realisable_body",
    "realise",
    "resolution",
    "rest_point",
    "rigid_body",
    "rigid_hubs",
    "rigid_mass",
    "rigid_plane",
    "root_body",
    "root_frame",
    "rotation_vectors",
    "round_down",
    "rounding_of_residual",
    "run_of_drive",
    "run_of_push",
    "run_of_turn",
    "runge_kutta_limit",
    "runge_kutta_step",
    "running_mean",
    "same_planes",
    "seconds_of",
    "sections_at",
    "seen",
    "sensor_axes",
    "servos_that_chatter",
    "settle_links",
    "share",
    "shares_of_energy",
    "simulate_hub",
    "simulate_slew",
    "skin_vertices",
    "slopes",
    "slosh_case",
    "slow_modes",
    "small_turn",
    "smallness",
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
    "still_copy",
    "structured_bound",
    "sum_of_poles",
    "time_modes",
    "torque_of_actuator",
    "torques_of_allocation",
    "total_index",
    "tune",
    "turn",
    "turn_warning",
    "turned_by",
    "turns_of_hinge",
    "unit_mass_of_port",
    "unit_of_control",
    "visible_modes",
    "weightless",
    "weights_of_modes",
    "windowed_variance",
    "with_polar_inertia",
    "without_actuators",
    "worst_sample",
]
