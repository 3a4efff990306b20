"""Study, stability and sweep from Python: the same as the commands behind them."""

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
    assert of_file.rows[0].largest == pytest.approx(
        bc.stability(path("seed_boom")).rows[0].largest, rel=SAME
    )
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


@pytest.mark.slow
def test_study_of_some_models_only():
    told = []
    found = bc.study(
        path("seed_boom"),
        models=["exact, hub"],
        duration=8.0,
        budget=1e-3,
        progress=lambda *a: told.append(a),
    )
    assert found.models == ["exact, hub"]
    assert found.scenario.duration == 8.0
    assert min(p.error for p in found.points) < 0.1
    assert told


@pytest.mark.slow
def test_sweep_is_reproducible():
    spec = bc.read_spec(path("array_uncertain"))
    a = bc.sweep(spec, 3, seed=4)
    b = bc.sweep(path("array_uncertain"), 3, seed=4)
    np.testing.assert_array_equal(a.coupled, b.coupled)
    assert a.coupled.shape[0] == 3


@pytest.mark.slow
def test_study_of_a_rigid_section_on_a_hub_with_products_of_inertia():
    """No torsion, no axial stiffness, no polar inertia; the hub's axes are not principal."""
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    hub = bc.Hub(
        mass=300.0,
        inertia=(100.0, 120.0, 150.0),
        offset=(0.5, 0.0, 0.0),
        products=(30.0, -20.0, 10.0),
    )
    spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),), root=bc.spec.Root(hub=hub))
    found = bc.study(spec, models=["exact, hub"], duration=20.0, budget=0.02)
    assert (
        min(point.error for point in found.points if point.error is not None) < 5e-3
    )  # 0.23 with the principal moments alone
