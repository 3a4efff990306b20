"""Closed forms beside the formulas of plants."""

import numpy as np
import pytest

from beamchain.plants.error_indices import ErrorIndex
from formulas import total_index


def index(rms, peak):
    return ErrorIndex(np.array([rms]), np.array([peak]))


def test_peaks_that_may_meet_add_up_and_random_errors_add_squares():
    # periodic 1 + 2, transient 4; random 3 sigma of sqrt(3^2 + 4^2) = 5
    indices = [index(0.5, 1.0), index(1.2, 2.0), index(np.nan, 4.0)]
    random = [index(3.0, 9.0), index(4.0, 12.0)]
    total = total_index(indices + random, ["wheel", "wheel", "snap", "psd", "psd"])
    assert total.peak == pytest.approx([7.0 + 15.0], rel=1e-14)
    assert total.rms == pytest.approx([np.sqrt(0.25 + 1.44 + 25.0)], rel=1e-14)
    assert np.isnan(total_index(indices[2:], ["snap"]).rms[0])
