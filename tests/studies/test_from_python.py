"""Stability from Python: the same as the command behind it."""

import numpy as np
import pytest

import beamchain as bc
from examples import example as path
from limits import inspected

SAME = 1e-12  # the same computation twice


@pytest.mark.slow
def test_stability_of_a_spec_and_of_its_file():
    of_file = bc.stability(path("seed_boom"))
    of_spec = bc.stability(bc.read_spec(path("seed_boom")))
    for a, b in zip(of_file.rows, of_spec.rows, strict=True):
        assert (a.name, a.integrator) == (b.name, b.integrator)
        assert a.largest == pytest.approx(b.largest, rel=SAME)
    assert list(of_spec.large) == ["xy"]


def test_stability_of_a_model(tmp_path):
    fit = bc.fit(bc.read_spec(path("seed_boom")))
    (tmp_path / "boom.xml").write_text(fit.scene_mjcf())
    found = bc.stability(tmp_path / "boom.xml")
    assert found.large == {}
    modes = inspected(tmp_path / "boom.xml")["modes"]
    np.testing.assert_allclose(
        found.budgets[0].frequencies, [mode["frequency"] for mode in modes], rtol=SAME
    )
