"""Doors to formulas of uncertain plants and worst cases that no public name reaches alone."""

from beamchain.robust.bounds import _extended as extended_multipliers
from beamchain.robust.bounds import _halves as halves_of_box
from beamchain.robust.bounds import _middle as middle_of
from beamchain.robust.bounds import _narrow as is_narrow
from beamchain.robust.bounds import _without_unknown as unknown_behind
from beamchain.robust.bounds import frequencies as looked_at
from beamchain.robust.delta_channels import channels as channels_of_craft
from beamchain.robust.interval_loop import LocalLoop, delay_near, in_box, local_loop
from beamchain.robust.least_margins import figure as figure_of_sample
from beamchain.robust.least_margins import smallness
from beamchain.robust.multipliers import _between as between_ends
from beamchain.robust.multipliers import _blocks as blocks_of_deltas
from beamchain.robust.multipliers import _complex as from_real_symmetric
from beamchain.robust.multipliers import _hermitian as basis_of_hermitian
from beamchain.robust.multipliers import _moments as moments_of_delta
from beamchain.robust.multipliers import _of_block as positive_block
from beamchain.robust.multipliers import _real as real_symmetric
from beamchain.robust.multipliers import balanced as balanced_channels
from beamchain.robust.multipliers import prove as proof_over
from beamchain.robust.multipliers import solve_program, zero_crossings
from beamchain.robust.plots import drawn_figure, plot_steps, plot_worst, worst_figure
from beamchain.robust.search import Search, stability_limit
from beamchain.robust.search import _beside as samples_beside
from beamchain.robust.simulated_gain import SteppedController, simulated_gain
from beamchain.robust.simulated_gain import _measure as measured_in_mujoco
from beamchain.robust.simulated_gain import _plan as plan_of_run
from beamchain.robust.simulated_gain import _whole as whole_count
from beamchain.robust.tables import worst_margin_table, worst_table
from beamchain.robust.uncertain_loop import Figure, Reach, Sample, UncertainLoop, upper

__all__ = [
    "Figure",
    "LocalLoop",
    "Reach",
    "Sample",
    "Search",
    "SteppedController",
    "UncertainLoop",
    "balanced_channels",
    "basis_of_hermitian",
    "between_ends",
    "blocks_of_deltas",
    "channels_of_craft",
    "delay_near",
    "drawn_figure",
    "extended_multipliers",
    "figure_of_sample",
    "from_real_symmetric",
    "halves_of_box",
    "in_box",
    "is_narrow",
    "local_loop",
    "looked_at",
    "measured_in_mujoco",
    "middle_of",
    "moments_of_delta",
    "plan_of_run",
    "plot_steps",
    "plot_worst",
    "positive_block",
    "proof_over",
    "real_symmetric",
    "samples_beside",
    "simulated_gain",
    "smallness",
    "solve_program",
    "stability_limit",
    "unknown_behind",
    "upper",
    "whole_count",
    "worst_figure",
    "worst_margin_table",
    "worst_table",
    "zero_crossings",
]
