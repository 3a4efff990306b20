"""Doors to formulas that no public name reaches alone, so that closed forms stand beside them."""

from beamchain.chain.baselines import rigid_link
from beamchain.chain.build import BuildOptions, build_exact, with_real_polar
from beamchain.chain.build import _check_masses as check_masses
from beamchain.chain.build import _counts as hinge_counts
from beamchain.chain.build import _modes_of as modes_to_give
from beamchain.chain.build import _required_hinges as required_hinges
from beamchain.chain.build import _shared_nodes as shared_nodes
from beamchain.chain.build import assemble as assembled_chain
from beamchain.chain.chain import Chain, Hinge, Link, Tendon
from beamchain.chain.cut import _best as best_cut
from beamchain.chain.cut import _climb as climb
from beamchain.chain.cut import _even as even_cut
from beamchain.chain.cut import _fewest as fewest_hinges
from beamchain.chain.cut import _margin_sentence as margin_sentence
from beamchain.chain.cut import _merge_close as merge_close
from beamchain.chain.cut import _patterns as patterns_of_cuts
from beamchain.chain.cut import choose_cut
from beamchain.chain.links import _without_rounding as without_rounding
from beamchain.chain.links import (
    bodies,
    polar_inertias,
    raise_polar_inertia,
    real_polar,
    settle_links,
    share,
)
from beamchain.chain.recursion import Nodes, realise, split
from beamchain.chain.residual_margin import Effort, HingeDemand, Margins, shortest_link
from beamchain.chain.residual_margin import _whitening as whitening
from beamchain.chain.tendons import (
    ModeGroup,
    damped_modes,
    given_modes,
    joint_damping,
    modal_matrix,
    port_rows,
    springs_as_modes,
)
from beamchain.chain.tendons import _armatures as armatures_of
from beamchain.chain.tendons import _fillers as fillers_of
from beamchain.chain.tendons import _nearest_flexibility as nearest_flexibility
from beamchain.chain.tendons import _nearest_turn as nearest_turn
from beamchain.chain.tendons import _next_pace as next_pace
from beamchain.chain.tendons import _stiffen_attachments as stiffen_attachments
from beamchain.chain.tendons import _unfelt as unfelt_motions
from beamchain.control.closed_loop import _check_algebraic as check_algebraic_loop
from beamchain.control.closed_loop import _plant_step as step_of_plant
from beamchain.control.closed_loop import _turn as turn_along
from beamchain.control.closed_loop import unstable_count
from beamchain.control.controllers import loop_response as response_of_loop
from beamchain.control.controllers import realise as realise_controller
from beamchain.control.controllers import realise_fraction
from beamchain.control.delay_margin import _between as crossings_between
from beamchain.control.delay_margin import _by_state as loop_by_state
from beamchain.control.delay_margin import _Crossings as SizeOneCrossings
from beamchain.control.delay_margin import _crossings as crossings_of_size_one
from beamchain.control.delay_margin import _driven as states_driven_for
from beamchain.control.delay_margin import _polished as polished_delay
from beamchain.control.delay_margin import sampled_delay_margin
from beamchain.control.instability_causes import _from_open as way_from_open
from beamchain.control.instability_causes import _own_direction as own_direction
from beamchain.control.instability_causes import _owners as owners_of_poles
from beamchain.control.instability_causes import _Start as StartOfPoles
from beamchain.control.instability_causes import _start as start_of_poles
from beamchain.control.instability_causes import instabilities
from beamchain.control.margins import LoopMargins as LoopOfMargins
from beamchain.control.margins import _figures as margin_figures
from beamchain.control.margins import _long_delays as long_delays
from beamchain.control.margins import _of_all as margins_of_all
from beamchain.control.margins import _refined as refined_bounds
from beamchain.control.mu import _power_sum as power_sum
from beamchain.control.mu import balanced_bounds
from beamchain.control.mu import bound as structured_bound
from beamchain.control.plant import _held_input as with_held_input
from beamchain.control.pole_paths import _assigned as assigned_poles
from beamchain.control.pole_paths import _continued as continued_poles
from beamchain.control.pole_paths import _moved as pole_moved
from beamchain.control.pole_paths import _number as number_of_pole
from beamchain.control.pole_paths import _rate as rate_of_pole
from beamchain.control.pole_paths import _settled as pole_settled
from beamchain.control.realisation import _zero_pole_product as zero_pole_product
from beamchain.control.sampling import sampled as sampled_system
from beamchain.control.scheduled import _follow as follow_modes
from beamchain.control.systems import growth as growth_of_poles
from beamchain.control.verdicts import _beyond as limited_by_modes_above
from beamchain.control.verdicts import _limiting as limiting_modes
from beamchain.craft.appendage import carried as carried_by_craft
from beamchain.craft.appendage import lightest as lightest_of_bodies
from beamchain.craft.appendage import motion_warnings
from beamchain.craft.assembly import Assembly, assembly_at_rest, modes_at_pose
from beamchain.craft.bent_line import BentLine, bent_line, turned_by
from beamchain.craft.bent_line import _lowest as lowest_modes
from beamchain.craft.bent_line import _motion as motion_of_modes
from beamchain.craft.bent_line import _numbers as ranks_of_modes
from beamchain.craft.coupled_modes import Mode as ModeOfCraft
from beamchain.craft.coupled_modes import _clusters as clusters
from beamchain.craft.coupled_modes import _holders as holders_of_shape
from beamchain.craft.coupled_modes import _Modes as ModesOfCraft
from beamchain.craft.coupled_modes import _momentum as momentum_of_mode
from beamchain.craft.coupled_modes import _pairs as pairs_of_modes
from beamchain.craft.coupled_modes import _phase as phase_of_two
from beamchain.craft.coupled_modes import _port as port_of_mode
from beamchain.craft.coupled_modes import _shares as shares_of_energy
from beamchain.craft.coupled_modes import _spans as spans_of_motion
from beamchain.craft.coupled_modes import coupled_modes, mode_words, slow_modes
from beamchain.craft.cures import changes_of, more_modes
from beamchain.craft.cures import models_at as models_at_setting
from beamchain.craft.disturbances import _cure as cure_of_step
from beamchain.craft.disturbances import disturbances
from beamchain.craft.documents import AppendageRequest, layout_of
from beamchain.craft.documents import assemble as assemble_document
from beamchain.craft.embedded import Embedded
from beamchain.craft.embedding import _load_warnings as warnings_of_loads
from beamchain.craft.embedding import _owner as owner_of_place
from beamchain.craft.embedding import marked_appendages
from beamchain.craft.error import (
    CraftError,
    PlacedBody,
    Pose,
    PoseUnderLoad,
    acting,
    counterpart,
    craft_error,
    extra_damping,
    growth,
    lacking_damping,
    loadings_of,
    peaks_of_craft,
)
from beamchain.craft.error import by_base as mounts_by_base
from beamchain.craft.exchange import Exchange
from beamchain.craft.fits import _far as far_mount
from beamchain.craft.fits import _points_inward as points_inward
from beamchain.craft.fits import fit_all
from beamchain.craft.hanging_liquid import hanging_liquid, springs_at_stated
from beamchain.craft.histories import History, Recovery
from beamchain.craft.inspect import inspect_model
from beamchain.craft.linear_craft import _load as load_on_exact
from beamchain.craft.linear_craft import _names as names_of_models
from beamchain.craft.linear_craft import exact_craft, internal_stiffness, linear_craft
from beamchain.craft.liquid import liquid_cautions, with_liquids_sprung
from beamchain.craft.loads import Item as AppendageOnLoad
from beamchain.craft.loads import Load as LoadOfPort
from beamchain.craft.loads import (
    Root,
    base_place,
    carries_of,
    carrying_of,
    hanging_notes,
    loads_of,
    split_port,
)
from beamchain.craft.loose_ports import loose_craft
from beamchain.craft.modal_form import ModalForm, column_range, modal_form
from beamchain.craft.mode_names import cantilever_names, mode_names
from beamchain.craft.moving_modes import moving_modes
from beamchain.craft.plant_load import check_standing, liquid_prefixes
from beamchain.craft.poses import Way, pose_label, poses_of
from beamchain.craft.promise import Placed, candidate_of, fits_that_keep, joint_request
from beamchain.craft.promise import _realised as realised_or_before
from beamchain.craft.proof import _bent_keyframes as bent_keyframes
from beamchain.craft.proof import _check_ports as check_ports_of_file
from beamchain.craft.proof import _elements as elements_of_file
from beamchain.craft.proof import _with_poses_of as bare_at_poses_of
from beamchain.craft.quantities import _check_inertia as check_inertia
from beamchain.craft.quantities import inertia_matrix, quantities
from beamchain.craft.recording import run_of as run_of_data
from beamchain.craft.recovered_body import (
    RecoveredBody,
    recovered_beam,
    recovered_delivery,
    root_of,
    tip_displacement,
)
from beamchain.craft.recovered_body import _check_same as check_same_modes
from beamchain.craft.recovered_body import _participation as participation_of_tendon
from beamchain.craft.recovered_body import _turn as turn_into_modes
from beamchain.craft.recovery import _histories as histories_of_values
from beamchain.craft.recovery import _stations as stations_of
from beamchain.craft.recovery import _values as values_of_outputs
from beamchain.craft.recovery import _wrenches as wrenches_on_points
from beamchain.craft.recovery import appendage_at
from beamchain.craft.retiming import RetimedCraft, retime_craft
from beamchain.craft.slews import SlewBody, SlewRow
from beamchain.craft.slews import _apart as apart
from beamchain.craft.slews import _divided as finely_divided
from beamchain.craft.slews import _drift as drift_of_momentum
from beamchain.craft.slews import _drives as drives_of_craft
from beamchain.craft.slews import _Model as ModelOfSlew
from beamchain.craft.slews import _more as modes_finely_divided
from beamchain.craft.slews import _parts as equal_parts
from beamchain.craft.slews import _Reference as Reference
from beamchain.craft.slews import _rk4_words as rk4_words
from beamchain.craft.slews import _Scene as SceneOfSlews
from beamchain.craft.slews import _Trial as Trial
from beamchain.craft.slews import _turns as turns_of_hinge
from beamchain.craft.slews import _warnings as slew_warnings
from beamchain.craft.slews import _wished as wished_hinges
from beamchain.craft.slews import slews as slews_of_file
from beamchain.craft.stability import study_fit
from beamchain.craft.step_slopes import step_slopes
from beamchain.craft.timing import _stiffness_change as change_of_stiffness
from beamchain.craft.timing import decide_timing, is_worth_timing, response_change, time_notes
from beamchain.craft.timing import step_error as error_of_step
from beamchain.craft.under_load import LoadedTree
from beamchain.engine.allocation import Allocated, allocated, largest_torque
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
from beamchain.engine.displacement import reach, spacecraft_body, turn
from beamchain.engine.draw import draw_frames
from beamchain.engine.driven_hinge import Drive, Seen, Turn, drive_of, seen
from beamchain.engine.driven_hinge import Drive as DriveOfHinge
from beamchain.engine.driven_hinge import Run as RunOfDrive
from beamchain.engine.driven_hinge import Run as StatesOfRun
from beamchain.engine.driven_hinge import run as run_of_drive
from beamchain.engine.geometry import skin_vertices
from beamchain.engine.jobs import check_workers
from beamchain.engine.linear import (
    Activations,
    Inputs,
    Outputs,
    PortLoads,
    Signal,
    activation_names,
    coordinate_names,
    linear_at,
    port_motion,
    rigid_body,
    slopes,
)
from beamchain.engine.linearise import (
    Held,
    check_freedoms,
    implicit_stiffness,
    mass_of_alone,
    runge_kutta_change,
)
from beamchain.engine.linearise import _motor_freedoms as motor_freedoms
from beamchain.engine.linearise import _rounding as rounding_of_differences
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
from beamchain.engine.normal_modes import NormalModes, normal_modes
from beamchain.engine.operating_point import OperatingPoint, rest_point, still_copy
from beamchain.engine.partial_fractions import PartialFractions, partial_fractions
from beamchain.engine.partial_fractions import _fractions as fractions_of
from beamchain.engine.rollout import _rotation as rotation_vectors
from beamchain.engine.rollout import seconds_of
from beamchain.engine.rollout import simulate as simulate_hub
from beamchain.engine.root_motion import RootMotion
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
from beamchain.engine.slew import _impulse as impulse_of_halves
from beamchain.engine.slew import _in_hinge as drive_in_hinge
from beamchain.engine.slew import _long_enough as long_enough
from beamchain.engine.slew import _mode_to_ring as mode_to_ring
from beamchain.engine.slew import _on_hub as drive_on_hub
from beamchain.engine.slew import _run as run_of_push
from beamchain.engine.slew import _without_actuators as without_actuators
from beamchain.engine.slew import simulate as simulate_slew
from beamchain.fitting.body import Body, body_of, with_polar_inertia
from beamchain.fitting.body import _modes_below as half_waves
from beamchain.fitting.body import _ports_of_beam as ports_of_beam
from beamchain.fitting.body import _ratios as damping_of_file
from beamchain.fitting.candidate import Candidate, free_ports
from beamchain.fitting.candidate import weights as weights_of_modes
from beamchain.fitting.cure import _one_mode_more as one_mode_more
from beamchain.fitting.cure import cure_of
from beamchain.fitting.document import put_timing, safe_step
from beamchain.fitting.exact import exact_appendage, kept_model, reduced_to_kept
from beamchain.fitting.grow import Step, grow, prune
from beamchain.fitting.grow import _best as best_mode
from beamchain.fitting.hub import assumed_hub, default_hub, port_hub_mass
from beamchain.fitting.kept import Kept, first_of_ports, numbered, of_ports
from beamchain.fitting.look import look_of
from beamchain.fitting.needs import Promise
from beamchain.fitting.proof import _cautions as cautions_of_fit
from beamchain.fitting.proof import _in_space as compared_in_space
from beamchain.fitting.proof import needs_hub
from beamchain.fitting.proof import step_limits as limits_of_chain
from beamchain.fitting.quantity import Quantity, drawn_fields, draws
from beamchain.fitting.quantity import apply as apply_draw
from beamchain.fitting.realise import _band as fillers_above
from beamchain.fitting.realise import _check_body as check_body
from beamchain.fitting.realise import _check_free as check_free_modes
from beamchain.fitting.realise import _couple_ports as couple_ports
from beamchain.fitting.realise import _damps_modes as damps_modes
from beamchain.fitting.realise import _departs as departs
from beamchain.fitting.realise import _left_out as modes_left_out
from beamchain.fitting.realise import _needs_time as needs_time
from beamchain.fitting.realise import _of_ports as chain_of_ports
from beamchain.fitting.realise import _roomy as line_with_room
from beamchain.fitting.realise import _springs as where_springs_stand
from beamchain.fitting.realise import _visible_modes as visible_modes
from beamchain.fitting.realise import chain_of, same_planes
from beamchain.fitting.result import InSpace
from beamchain.fitting.select import select
from beamchain.fitting.slosh import heavy, limp_model, pendulum_chain, weightless
from beamchain.fitting.uncertain import score
from beamchain.fitting.warnings import (
    doubtful,
    fit_warnings,
    imported_warnings,
    rigid_plane,
    step_warnings,
    turn_warning,
)
from beamchain.mjcf.craft import craft_from_text
from beamchain.ports.compare import (
    band_grid,
    compared_ratios,
    free_peaks,
    grid_of,
    largest_norm_ratio,
    maximum_of,
    norm_ratios,
    peak_clusters,
    peaks_at,
    peaks_of,
    relative_error,
    small_inverse,
    spectral_norms,
    unresolved_peaks,
    with_damping,
)
from beamchain.ports.compose import joined
from beamchain.ports.model import Shapes
from beamchain.ports.motions import body_mass_matrix, first_moment
from beamchain.report.headlines import (
    cause_sentence,
    cure_sentence,
    embedded_headline,
    modes_sentence,
    strain_words,
    tip_sentence,
)
from beamchain.steps.cures import Names, Setting, find_cure, round_down
from beamchain.steps.dominant_element import culprit, inertia_words, stable_step
from beamchain.steps.driven import driven, run_of_turn
from beamchain.steps.elements import elements as elements_of_step
from beamchain.steps.forms import Craft, appendage_poles, form2, form2_many, form4, tune
from beamchain.steps.forms import _Step as StepOfCraft
from beamchain.steps.forms import stability as squared_phase
from beamchain.steps.integrators import (
    apparent_pole,
    continuous_poles,
    hinge_armature,
    map_modes,
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
from beamchain.steps.retime import _grows as grows_retimed
from beamchain.steps.retime import _is_unit as are_of_unit_mass
from beamchain.steps.retime import retime_by, write_values
from beamchain.steps.retime_file import retimed_file
from beamchain.steps.sampled import (
    Exact,
    SampledError,
    exact_response,
    judged_part,
    off_by,
    represents,
    sampled_error,
    step_response,
)
from beamchain.steps.sampled import _peaks as peaks_of_poles
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
from beamchain.steps.tree_response import ResponseResidual, Tendons, outer_motions
from beamchain.steps.tree_response import Seen as SeenAtPose
from beamchain.steps.tree_time import FreeAppendage, appendages_alone, tree_form, tuned_poses
from beamchain.steps.tree_time import _modes as modes_of_tendons
from beamchain.steps.tree_time import _nearest as nearest_response
from beamchain.steps.tree_time import _newton_step as newton_step
from beamchain.steps.tree_time import _step_length as step_length
from beamchain.steps.tree_time import _TendonBounds as Room
from beamchain.steps.turn import turn_error
from beamchain.structure.discretise import Parts, sampled_model
from beamchain.structure.discretise import _body as body_in_port
from beamchain.structure.discretise import _edges as edges_of_pieces
from beamchain.structure.discretise import _join_equal_neighbours as joined_neighbours
from beamchain.structure.discretise import _largest_change as change_of_lowest
from beamchain.structure.discretise import _pieces as pieces_of_beam
from beamchain.structure.discretise import _taper_cuts as taper_cuts
from beamchain.structure.elements import (
    MotionRows,
    Piece,
    PointBody,
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
    MassLine,
    MassPiece,
    Moments,
    default_length,
    mass_line_of_pieces,
    spread_mass,
    uniform_length,
)
from beamchain.structure.mass_line import _mass_beside_axis as mass_beside_axis
from beamchain.structure.mass_line import _of_moments as of_moments
from beamchain.structure.profile import Properties
from beamchain.structure.readers.craig_bampton import Boundary, from_matrices
from beamchain.structure.readers.craig_bampton import _almost_body as almost_body
from beamchain.structure.readers.craig_bampton import _is_noisy as is_noisy
from beamchain.structure.readers.craig_bampton import _is_soft as is_soft
from beamchain.structure.readers.craig_bampton import _largest_forces as largest_forces
from beamchain.structure.readers.craig_bampton import _largest_inner as largest_inner
from beamchain.structure.readers.craig_bampton import _noise_of_freedoms as noise_of_freedoms
from beamchain.structure.readers.craig_bampton import _partition as partition
from beamchain.structure.readers.craig_bampton import _rigid_motion as rigid_motion_of_inner
from beamchain.structure.readers.imported import check_outwards, proposed_axes, with_length
from beamchain.structure.readers.nastran_bulk import System, dmig_matrices, read_bulk
from beamchain.structure.readers.nastran_f06 import _compare as compare_with_print
from beamchain.structure.readers.nastran_f06 import _frequencies as frequencies_of_print
from beamchain.structure.readers.nastran_f06 import _mass as mass_of_print
from beamchain.structure.readers.nastran_op2 import Eigenvalues
from beamchain.structure.readers.nastran_op2 import _chosen as chosen_table
from beamchain.structure.readers.nastran_op2 import _modal_data as data_of_tables
from beamchain.structure.readers.nastran_op4 import _text_header as header_of_text
from beamchain.structure.readers.nastran_op4 import read_op4
from beamchain.structure.readers.own_format import _digits as digits_of_numbers
from beamchain.structure.readers.recovery_file import read_recovery
from beamchain.structure.recovery_rows import (
    OutputMatrices,
    crossed,
    delivered_outputs,
)
from beamchain.structure.rigid_body import (
    body_departure,
    independent_parts,
    nearest_body,
    noise_of_motions,
    realisable_body,
    within_body,
)
from beamchain.structure.section import soft_modulus
from beamchain.structure.section_loads import Inside, section_outputs, snapped
from beamchain.structure.section_loads import _drives as drives_of_modes
from beamchain.structure.section_loads import _momentum as momentum_beyond
from beamchain.structure.section_loads import _rigid_load as rigid_load
from beamchain.structure.sections_at import Sections, sections_at
from beamchain.structure.settle_modes import (
    near_groups,
    rounding_of_residual,
    settle_rigid_mass,
    turn_into_planes,
)
from beamchain.structure.slosh import Slosh
from beamchain.variants.fields import Modes as DrawnModes
from beamchain.variants.refit import Refit
from beamchain.variants.samples import Gain as GainOfModes
from beamchain.variants.samples import Samples, normal_shapes, usual_gain
from beamchain.variants.samples import _is_positive as is_positive
from beamchain.variants.samples import _scale_participation as scaled_participation
from beamchain.variants.samples import gain as gain_of_pair
from beamchain.variants.samples import vary as vary_samples
from beamchain.variants.sweep import Sweep
from beamchain.variants.sweep import _correlations as correlations_of_craft
from beamchain.variants.sweep import _draw as drawn_samples
from beamchain.variants.sweep import _nominal_fit as nominal_fit
from beamchain.variants.sweep import _spread as spread_of
from beamchain.variants.sweep import _varied_fields as varied_fields
from beamchain.variants.timing import (
    DrawTiming,
    drawn_masses,
    participation_of,
    with_participation,
)

__all__ = [
    "Activations",
    "Allocated",
    "AppendageOnLoad",
    "AppendageRequest",
    "Assembly",
    "BentLine",
    "Body",
    "Boundary",
    "BuildOptions",
    "Candidate",
    "Chain",
    "Composite",
    "Craft",
    "CraftError",
    "DrawTiming",
    "DrawnModes",
    "Drive",
    "DriveOfHinge",
    "Effort",
    "Eigenvalues",
    "Embedded",
    "Exact",
    "Exchange",
    "FreeAppendage",
    "GainOfModes",
    "Held",
    "Hinge",
    "HingeDemand",
    "History",
    "InSpace",
    "Input",
    "Inputs",
    "Inside",
    "Kept",
    "LargeMotion",
    "LinearModel",
    "Link",
    "LoadOfPort",
    "LoadedTree",
    "Loading",
    "LoopOfMargins",
    "Margins",
    "MassBesideAxis",
    "MassLine",
    "MassPiece",
    "Measured",
    "ModalForm",
    "ModeGroup",
    "ModeOfCraft",
    "ModelOfSlew",
    "ModesOfCraft",
    "Moments",
    "Motion",
    "MotionRows",
    "Names",
    "Nodes",
    "NormalModes",
    "OperatingPoint",
    "OutputMatrices",
    "Outputs",
    "PartialFractions",
    "Parts",
    "Piece",
    "PlaceOfHinge",
    "Placed",
    "PlacedBody",
    "PlanarChain",
    "PointBody",
    "PoleRow",
    "PortLoads",
    "Pose",
    "PoseUnderLoad",
    "Promise",
    "Properties",
    "Quantity",
    "RecoveredBody",
    "Recovery",
    "Reference",
    "Refit",
    "ResponseResidual",
    "RetimedCraft",
    "Room",
    "Root",
    "RootMotion",
    "RunOfDrive",
    "SampledError",
    "Samples",
    "SceneOfSlews",
    "Sections",
    "Seen",
    "SeenAtPose",
    "Setting",
    "Shapes",
    "ShiftedPeak",
    "Signal",
    "SizeOneCrossings",
    "Slew",
    "SlewBody",
    "SlewRow",
    "Slosh",
    "Spring",
    "StartOfPoles",
    "StatesOfRun",
    "Step",
    "StepOfCraft",
    "Sweep",
    "System",
    "Tendon",
    "Tendons",
    "TimeError",
    "TreeDraws",
    "Trial",
    "Turn",
    "Way",
    "acting",
    "activation_names",
    "allocated",
    "almost_body",
    "apart",
    "apparent_hubs",
    "apparent_pole",
    "appendage_at",
    "appendage_poles",
    "appendages_alone",
    "apply_draw",
    "are_of_unit_mass",
    "armatures_of",
    "assemble",
    "assemble_document",
    "assemble_lowest",
    "assembled_chain",
    "assembly_at_rest",
    "assigned_poles",
    "assumed_hub",
    "balanced_bounds",
    "ballast_for",
    "band_grid",
    "bare_at_poses_of",
    "base",
    "base_place",
    "bent_keyframes",
    "bent_line",
    "best_cut",
    "best_mode",
    "bodies",
    "body_departure",
    "body_in_port",
    "body_mass_matrix",
    "body_of",
    "build_exact",
    "candidate_of",
    "cantilever_names",
    "carried_by_craft",
    "carriers",
    "carries_of",
    "carrying_of",
    "cause_sentence",
    "cautions_of_fit",
    "chain_of",
    "chain_of_ports",
    "change_of_frequencies",
    "change_of_lowest",
    "change_of_stiffness",
    "changes_of",
    "check_algebraic_loop",
    "check_body",
    "check_free_modes",
    "check_freedoms",
    "check_inertia",
    "check_masses",
    "check_outwards",
    "check_ports_of_file",
    "check_pushes",
    "check_same_modes",
    "check_standing",
    "check_steps",
    "check_workers",
    "choose_cut",
    "choose_step",
    "chosen_table",
    "climb",
    "clusters",
    "column_range",
    "compare_with_print",
    "compared_in_space",
    "compared_ratios",
    "composite",
    "condensed_mass",
    "continued_poles",
    "continuous_poles",
    "control_names",
    "coordinate_names",
    "correlations_of_craft",
    "counterpart",
    "couple_ports",
    "coupled_limits",
    "coupled_modes",
    "craft_error",
    "craft_from_text",
    "crossed",
    "crossings_between",
    "crossings_of_size_one",
    "culprit",
    "cure_of",
    "cure_of_step",
    "cure_sentence",
    "damped_by",
    "damped_modes",
    "damping_of_file",
    "damps_modes",
    "data_of_tables",
    "decide_timing",
    "default_hub",
    "default_length",
    "delivered_outputs",
    "departs",
    "digits_of_numbers",
    "distance",
    "disturbances",
    "dmig_matrices",
    "doubtful",
    "draw_frames",
    "drawn_fields",
    "drawn_masses",
    "drawn_samples",
    "draws",
    "drift_of_momentum",
    "drive_in_hinge",
    "drive_of",
    "drive_on_hub",
    "driven",
    "drives_of_craft",
    "drives_of_modes",
    "edges_of_pieces",
    "elements_of_file",
    "elements_of_step",
    "embedded_headline",
    "equal_parts",
    "error_of_step",
    "even_cut",
    "exact_appendage",
    "exact_craft",
    "exact_response",
    "extra_damping",
    "far_mount",
    "fewest_hinges",
    "fillers_above",
    "fillers_of",
    "find_cure",
    "finely_divided",
    "first_moment",
    "first_of_ports",
    "fit_all",
    "fit_warnings",
    "fits_that_keep",
    "follow_modes",
    "form2",
    "form2_many",
    "form4",
    "fractions_of",
    "free_peaks",
    "free_ports",
    "freedoms_of_block",
    "frequencies_of_print",
    "from_matrices",
    "gain_of_pair",
    "given_modes",
    "grid_of",
    "grow",
    "growing_frequencies",
    "growing_poses",
    "grows_retimed",
    "growth",
    "growth_of_poles",
    "half_waves",
    "hanging_liquid",
    "hanging_notes",
    "has_just_passed",
    "header_of_text",
    "heavy",
    "held_joints",
    "hinge_armature",
    "hinge_counts",
    "hinge_to_turn",
    "histories_of_values",
    "holders_of_shape",
    "implicit_stiffness",
    "imported_warnings",
    "impulse",
    "impulse_of_halves",
    "in_planes",
    "independent_parts",
    "inertia_matrix",
    "inertia_words",
    "inspect_model",
    "instabilities",
    "internal_stiffness",
    "inverse_of_torques",
    "inverse_stiffness_root",
    "is_noisy",
    "is_positive",
    "is_soft",
    "is_stop",
    "is_worth_timing",
    "joined",
    "joined_neighbours",
    "joint_damping",
    "joint_request",
    "judged_part",
    "kept_model",
    "key_number",
    "lacking_damping",
    "large_limits",
    "large_motion",
    "largest_forces",
    "largest_inner",
    "largest_norm_ratio",
    "largest_torque",
    "last_kept",
    "layout_of",
    "leaves_at",
    "legendre_series",
    "lightest_of_bodies",
    "limited_by_modes_above",
    "limiting_modes",
    "limits_of_chain",
    "limp_model",
    "line_with_room",
    "linear_at",
    "linear_craft",
    "liquid_cautions",
    "liquid_prefixes",
    "load_at",
    "load_on_exact",
    "loaded_linear",
    "loading_at",
    "loadings_of",
    "loads_of",
    "long_delays",
    "long_enough",
    "look_of",
    "loop_by_state",
    "loose_craft",
    "lowest_modes",
    "lowest_wrong",
    "made_for",
    "map_by_differences",
    "map_modes",
    "margin_figures",
    "margin_sentence",
    "margins_of_all",
    "marked_appendages",
    "mass_beside_axis",
    "mass_line_of_pieces",
    "mass_of_alone",
    "mass_of_bodies",
    "mass_of_print",
    "maximum_of",
    "measure",
    "merge_close",
    "mismatch",
    "modal_form",
    "modal_matrix",
    "modal_tendons",
    "mode_names",
    "mode_to_ring",
    "mode_words",
    "models_at_setting",
    "modes_at_pose",
    "modes_finely_divided",
    "modes_left_out",
    "modes_of_tendons",
    "modes_sentence",
    "modes_to_give",
    "momentum_beyond",
    "momentum_of_mode",
    "more_modes",
    "motion_at",
    "motion_of_modes",
    "motion_warnings",
    "motor_freedoms",
    "mount",
    "mounts_by_base",
    "moving_modes",
    "named_inputs",
    "named_output",
    "names_of_models",
    "near_groups",
    "nearest_body",
    "nearest_flexibility",
    "nearest_response",
    "nearest_turn",
    "needs_hub",
    "needs_time",
    "new_directions",
    "newton_step",
    "next_pace",
    "noise_of_freedoms",
    "noise_of_motions",
    "nominal_fit",
    "norm_ratios",
    "normal_modes",
    "normal_shapes",
    "null_directions",
    "number_of_pole",
    "numbered",
    "of_moments",
    "of_ports",
    "off_by",
    "offset_cautions",
    "one_mode_more",
    "oscillating",
    "oscillations",
    "outer_motions",
    "own_direction",
    "owner_of_place",
    "owners_of_poles",
    "pairs_of_modes",
    "partial_fractions",
    "participation_of",
    "participation_of_tendon",
    "partition",
    "patterns_of_cuts",
    "peak_clusters",
    "peaks_at",
    "peaks_of",
    "peaks_of_craft",
    "peaks_of_poles",
    "pendulum_chain",
    "phase_limit",
    "phase_of_two",
    "pieces_of_beam",
    "place_poles",
    "plane_of_chain",
    "points_inward",
    "polar_inertias",
    "pole_moved",
    "pole_pairs",
    "pole_rows",
    "pole_settled",
    "polished_delay",
    "polynomial",
    "port_hub_mass",
    "port_motion",
    "port_of_mode",
    "port_rows",
    "ports_of_beam",
    "pose_label",
    "poses_of",
    "power_sum",
    "proposed_axes",
    "prune",
    "push_of_actuators",
    "put_timing",
    "quantities",
    "raise_polar_inertia",
    "ranks_of_modes",
    "rate_of_pole",
    "reach",
    "read_bulk",
    "read_op4",
    "read_recovery",
    "real_polar",
    "realisable_body",
    "realise",
    "realise_controller",
    "realise_fraction",
    "realised_or_before",
    "recovered_beam",
    "recovered_delivery",
    "reduced_to_kept",
    "refined_bounds",
    "relative_error",
    "represents",
    "required_hinges",
    "response_change",
    "response_of_loop",
    "rest_point",
    "retime_by",
    "retime_craft",
    "retimed_file",
    "rigid_body",
    "rigid_hubs",
    "rigid_link",
    "rigid_load",
    "rigid_mass",
    "rigid_motion_of_inner",
    "rigid_plane",
    "rk4_words",
    "root_body",
    "root_frame",
    "root_of",
    "rotation_vectors",
    "round_down",
    "rounded_up",
    "rounding_of_differences",
    "rounding_of_residual",
    "run_of_data",
    "run_of_drive",
    "run_of_push",
    "run_of_turn",
    "runge_kutta_change",
    "runge_kutta_limit",
    "safe_step",
    "same_planes",
    "sampled_delay_margin",
    "sampled_error",
    "sampled_model",
    "sampled_system",
    "scaled_participation",
    "score",
    "seconds_of",
    "section_outputs",
    "sections_at",
    "seen",
    "select",
    "sensor_axes",
    "servos_that_chatter",
    "settle_links",
    "settle_rigid_mass",
    "shapes_of_fewer",
    "share",
    "shared_nodes",
    "shares_of_energy",
    "shifted_peak",
    "shortest_link",
    "simulate_hub",
    "simulate_slew",
    "skin_vertices",
    "slew_warnings",
    "slews_of_file",
    "slopes",
    "slow_modes",
    "small_inverse",
    "small_turn",
    "snapped",
    "soft_modulus",
    "spacecraft_body",
    "spans_of_motion",
    "spectral_norms",
    "split",
    "split_port",
    "spread_mass",
    "spread_of",
    "springs_as_modes",
    "springs_at_stated",
    "squared_phase",
    "stable_armature",
    "stable_step",
    "start_of_poles",
    "start_rate",
    "states_driven_for",
    "stations_of",
    "step_length",
    "step_limits",
    "step_of_plant",
    "step_pole",
    "step_response",
    "step_slopes",
    "step_warnings",
    "stiffen_attachments",
    "stiffness_before",
    "still_copy",
    "stop_ahead",
    "strain_words",
    "structured_bound",
    "study_fit",
    "sums_behind",
    "taper_cuts",
    "time_error",
    "time_modes",
    "time_notes",
    "tip_displacement",
    "tip_sentence",
    "torque_of_actuator",
    "torques_of_allocation",
    "tree_form",
    "tune",
    "tuned_poses",
    "turn",
    "turn_along",
    "turn_error",
    "turn_into_modes",
    "turn_into_planes",
    "turn_warning",
    "turned_by",
    "turns_of_hinge",
    "unfelt_motions",
    "uniform_length",
    "unit_mass_of_port",
    "unit_of_control",
    "unresolved_peaks",
    "unstable_count",
    "usual_gain",
    "values_of_outputs",
    "varied_fields",
    "vary_samples",
    "visible_modes",
    "warnings_of_loads",
    "way_from_open",
    "weightless",
    "weights_of_modes",
    "where_springs_stand",
    "whitening",
    "wished_hinges",
    "with_damping",
    "with_held_input",
    "with_length",
    "with_liquids_sprung",
    "with_participation",
    "with_polar_inertia",
    "with_real_polar",
    "within_body",
    "without_actuators",
    "without_rounding",
    "wrenches_on_points",
    "write_values",
    "zero_pole_product",
]
