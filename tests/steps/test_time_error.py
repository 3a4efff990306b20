"""The two errors that timing states, of random craft,
against differences of `mj_step` and finite elements."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import beamchain as bc
import stepped
from modes_of_beam import modes_of_beam

SEEDS = (5, 8, 17)
SAME = 0.1  # relative: what a grid of frequencies and differences of mj_step leave
POLES = 2e-7  # below it, differences of mj_step tell nothing
RESPONSE = 2e-5  # the same of the response
STEPS = 20_000
# beating of undamped modes, not growth: what grows by 1e-3 per step is 5e8 times as large by then
GROWTH = 3.0


@pytest.fixture(scope="module", params=SEEDS)
def both(request):
    drawn = stepped.draw(request.param)
    return drawn, stepped.embedded(drawn, retime=True)


@pytest.mark.slow
def test_the_error_of_the_poles_is_that_of_mj_step(both):
    drawn, made = both
    found, (error, frequency) = (
        made.time_error,
        stepped.time_error(made.model, made.untimed, drawn.band),
    )
    assert found.error == pytest.approx(error, rel=SAME, abs=POLES)
    assert (found.step, found.integrator, found.pose) == (drawn.step, drawn.integrator, "rest")
    if error > 10 * POLES:
        assert found.frequency == pytest.approx(frequency, rel=1e-3)
    said = [w for w in made.warnings if w.code in ("exact-in-time", "time-error")]
    assert [w.code for w in said] == (["exact-in-time"] if error < 1e-6 else ["time-error"])
    assert ("exact in time" in said[0]) == (found.error < 1e-6)


@pytest.mark.slow
def test_the_error_of_the_response_is_that_of_the_run(both):
    drawn, made = both
    error, _ = stepped.sampled_error(drawn, made.model)
    assert made.sampled_error == pytest.approx(error, rel=SAME, abs=RESPONSE)
    assert made.met is (1.01 * made.sampled_error <= 0.01)
    record = made.as_dict()
    assert (record["sampled_error"], record["met"]) == (made.sampled_error, made.met)
    keys = {"error", "frequency", "pose", "step", "integrator", "damped_by"}
    assert set(record["time_error"]) == keys


@pytest.mark.slow
def test_nothing_grows(both):
    _, made = both
    z = np.linalg.eigvals(stepped.stepped(made.model)[0])
    assert np.max(np.abs(z[np.abs(z - 1.0) > 1e-4]), initial=0.0) < 1.0 + 1e-7
    assert stepped.grows(made.model, STEPS) < GROWTH


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
@pytest.mark.slow
def test_timing_that_gains_less_than_a_third_is_left_out_unless_asked_for(integrator):
    """Implicit integrators cannot place the pole of a mode so damped: timing changes nothing."""
    drawn = stepped.draw(5)
    option = re.sub(
        'timestep="[^"]*" integrator="[^"]*"',
        f'timestep="0.005" integrator="{integrator}"',
        drawn.text,
    )
    one = {"first": drawn.specs["first"]}
    drawn = replace(drawn, text=option, specs=one, step=0.005, integrator=integrator, ratio=0.05)
    plain, timed, default = (stepped.embedded(drawn, retime=r) for r in (False, True, None))
    without, with_timing = (stepped.sampled_error(drawn, e.model)[0] for e in (plain, timed))
    gains = with_timing <= 2.0 / 3.0 * without
    assert gains is (integrator == "Euler")
    assert timed.appendages[0].timed is not None
    assert (default.appendages[0].timed is not None) is gains
    assert default.sampled_error == pytest.approx(min(with_timing, without), rel=SAME)


@pytest.mark.parametrize(
    ("ratio", "integrator"),
    [
        (0.002, "Euler"),
        (0.05, "implicitfast"),
    ],
)
def test_imported_modes_with_a_step_state_what_the_file_does(ratio, integrator):
    section = bc.Equivalent(
        bending_stiffness_xy=900.0,
        bending_stiffness_xz=1600.0,
        torsion_stiffness=300.0,
        axial_stiffness=1e6,
        linear_mass=4.0,
        polar_inertia=0.3,
    )
    beam = bc.Beam(segments=[bc.Segment(length=3.0, section=section)])
    modes = modes_of_beam(beam, {"xy": 5, "torsion": 3})
    options = {
        "modes": {"xy": 3, "torsion": 1},
        "root": bc.spec.Root(hub=bc.Hub(mass=60.0, inertia=(20.0, 25.0, 30.0))),
        "damping": ratio,
    }
    timed, other = (
        bc.fit(modes, scene=bc.Scene(integrator=integrator, timestep=step), **options)
        for step in (0.004, None)
    )
    model = mujoco.MjModel.from_xml_string(timed.scene_mjcf())
    plain = mujoco.MjModel.from_xml_string(other.scene_mjcf())
    plain.opt.timestep = model.opt.timestep
    error, frequency = stepped.time_error(model, plain, np.inf)
    assert model.opt.timestep == 0.004
    assert timed.time_error.error == pytest.approx(error, rel=1e-3, abs=POLES)
    if error > 10 * POLES:
        assert timed.time_error.frequency == pytest.approx(frequency, rel=1e-3)
    warned = any("does not keep every pole" in text for text in timed.warnings)
    assert warned == (timed.time_error.error >= 1e-6)
