"""Bodies from mass matrices: mass, centre and second moments, and what is left of one when others are taken away."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamchain.chain.bodies import Body, from_mass_matrix, remainder


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_body_and_its_matrices(seed):
    rng = np.random.default_rng(seed)
    points, mass = rng.normal(size=(6, 3)), rng.uniform(0.1, 2.0, 6)
    centre = mass @ points / mass.sum()
    spread = np.einsum("p,pi,pj->ij", mass, points - centre, points - centre)
    body = Body(float(mass.sum()), centre, spread)
    back, miss = from_mass_matrix(body.mass_matrix())
    assert miss < 1e-13
    assert back.centre == pytest.approx(centre, abs=1e-12)
    assert back.spread == pytest.approx(spread, abs=1e-11)
    homogeneous = np.column_stack([points, np.ones(6)])
    assert body.pseudo() == pytest.approx(np.einsum("p,pi,pj->ij", mass, homogeneous, homogeneous), abs=1e-11)
    same, least, moved = remainder(body.pseudo(), centre, 1.0, body.mass)
    assert least > -1e-12
    assert moved < 1e-12
    assert same.spread == pytest.approx(spread, abs=1e-11)


def test_a_lamina_s_deficit_is_repaired_and_told():
    flat = Body(2.0, np.zeros(3), np.diag([0.3, 0.1, -1e-8]))
    body, least, moved = remainder(flat.pseudo(), np.zeros(3), 0.3, 2.0)
    assert least < 0.0
    assert 1e-9 < moved < 1e-6
    a, b, c = sorted(body.principal()[0])
    assert a + b >= c
