"""Doors to formulas of pointing budgets that no public name reaches alone."""

from beamchain.pointing.disturbed_craft import _check_linear as check_linear_in_speed
from beamchain.pointing.disturbed_craft import _joint_force as torque_of_drive
from beamchain.pointing.disturbed_craft import _thermal_force as load_of_snap
from beamchain.pointing.disturbed_craft import disturbed_craft, wheel_inputs
from beamchain.pointing.error_indices import (
    closed_in,
    deviation_share,
    largest_deviation,
    windowed_variance,
)
from beamchain.pointing.modal_response import ModalResponse
from beamchain.pointing.modal_response import rising_states as states_of_a_rising_load
from beamchain.pointing.plots import plot_pointing
from beamchain.pointing.pointing import _appendages as appendages_of_craft
from beamchain.pointing.pointing import _beyond as beyond_modes_kept
from beamchain.pointing.pointing import _check_stable as check_stable_craft
from beamchain.pointing.pointing import _imbalances as imbalances_of_wheels
from beamchain.pointing.pointing import _settling as settling_of_modes
from beamchain.pointing.pointing import _total as total_index
from beamchain.pointing.source_errors import _along as contributions_along_their_sum
from beamchain.pointing.source_errors import _integral as nodes_of_density
from beamchain.pointing.source_errors import _named_shares as named_shares
from beamchain.pointing.source_errors import _periodic as periodic_of_harmonics
from beamchain.pointing.source_errors import _running_mean as running_mean
from beamchain.pointing.source_errors import _snap_times as snap_times
from beamchain.pointing.source_errors import (
    branches,
    noise_error,
    snap_error,
    stepper_error,
    stepper_harmonics,
    wheel_error,
    wheel_orders,
)
from beamchain.pointing.tables import pointing_mode_table, pointing_table
from beamchain.pointing.wheel_run import _amplitudes as amplitudes_in_record
from beamchain.pointing.wheel_run import _nutation as nutation_of_craft
from beamchain.pointing.wheel_run import run_wheel
from beamchain.pointing.wheel_sweep import WheelSweep
from beamchain.pointing.wheel_sweep import _high_places as high_places

__all__ = [
    "ModalResponse",
    "WheelSweep",
    "amplitudes_in_record",
    "appendages_of_craft",
    "beyond_modes_kept",
    "branches",
    "check_linear_in_speed",
    "check_stable_craft",
    "closed_in",
    "contributions_along_their_sum",
    "deviation_share",
    "disturbed_craft",
    "high_places",
    "imbalances_of_wheels",
    "largest_deviation",
    "load_of_snap",
    "named_shares",
    "nodes_of_density",
    "noise_error",
    "nutation_of_craft",
    "periodic_of_harmonics",
    "plot_pointing",
    "pointing_mode_table",
    "pointing_table",
    "run_wheel",
    "running_mean",
    "settling_of_modes",
    "snap_error",
    "snap_times",
    "states_of_a_rising_load",
    "stepper_error",
    "stepper_harmonics",
    "torque_of_drive",
    "total_index",
    "wheel_error",
    "wheel_inputs",
    "wheel_orders",
    "windowed_variance",
]
