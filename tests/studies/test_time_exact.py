"""Tests internals of a study (`studies.field`, `run_time`, `scenario`): its model that is exact in
time: its error as simulated, its step, its input, and the spec that gives it."""

import msgspec
import numpy as np
import pytest

import beamchain as bc
from beamchain.engine.rollout import simulate
from beamchain.fitting.spec_text import spec_toml
from beamchain.studies import field
from beamchain.studies import study as studies
from beamchain.studies.field import TIMED, Entry, Task
from beamchain.studies.run_time import (
    Ladder,
    Point,
    climb,
    clock,
    rigid_motion,
    steps_below,
)
from beamchain.studies.scenario import Scenario
from examples import EXAMPLES, example
from mechanics import made_for

SEED = example("seed_boom")
ROUNDING = 1e-9  # of the hub's turn, relative: unit quaternions over 1e-6 rad
SAME = 1e-12


@pytest.fixture(scope="module")
def prepared() -> tuple[Task, Scenario]:
    return studies.prepare(spec_toml(bc.read_spec(SEED)), studies.Options())


def error(prepared: tuple[Task, Scenario], entry: Entry, h: float) -> float:
    """As simulated: at the time after each step, nothing taken off."""
    task, scenario = prepared
    wrench = entry.fed(scenario.profile.mean(h, round(scenario.duration / h)))
    return scenario.error(
        simulate(field.model_of(task, entry, h), entry.integrator, h, wrench).motion, h
    )


# -- the seed's boom -------------------------------------------------------------------------------
@pytest.mark.parametrize(("n", "h", "bound"), [(2, 1.0, 1.5e-3), (3, 0.5, 1.5e-4), (4, 0.25, 3e-5)])
def test_error_as_simulated(prepared, n, h, bound):
    """60 s of the doublet; what is left is the modes that were not kept."""
    assert error(prepared, Entry(TIMED, n, "Euler"), h) < bound


@pytest.mark.parametrize(("n", "h"), [(2, 1.0), (3, 0.5), (4, 0.25)])
def test_finer_steps_gain_nothing(prepared, n, h):
    """The step has no error of its own: one four times finer has the same error,
    to what sampling shows of its peak."""
    entry = Entry(TIMED, n, "Euler")
    assert error(prepared, entry, h / 4.0) == pytest.approx(error(prepared, entry, h), rel=0.2)


def test_same_floor_as_the_chain_at_fine_steps(prepared):
    """RK4 at a step at which it has no error left: another integrator, other springs,
    the same modes."""
    fine = error(prepared, Entry("exact, hub", 3, "RK4"), 0.02)
    assert error(prepared, Entry(TIMED, 3, "Euler"), 0.02) == pytest.approx(fine, rel=0.02)


@pytest.mark.parametrize(("n", "times"), [(2, 10.0), (4, 10.0), (4, 100.0)])
def test_stable_at_steps_beyond_the_old_limit(prepared, n, times):
    """Undriven after a push, 1e4 steps: nothing grows."""
    task, _ = prepared
    h = times * field.largest_step(task, Entry("exact, hub", n, "Euler"))
    entry = Entry(TIMED, n, "Euler")
    wrench = np.zeros((10_000, 6))
    wrench[:4, 5] = 1e-6, -1e-6, -1e-6, 1e-6  # no turn remains
    motion = simulate(field.model_of(task, entry, h), "Euler", h, entry.fed(wrench)).motion[:, 5]
    assert np.max(np.abs(motion[5000:])) < 1.01 * np.max(np.abs(motion[:5000]))


def test_without_the_mean_of_two_inputs_it_is_half_a_step_early(prepared):
    task, scenario = prepared
    h = 0.5
    entry = Entry(TIMED, 3, "Euler")
    wrench = scenario.profile.mean(h, 120)
    motion = simulate(field.model_of(task, entry, h), "Euler", h, wrench).motion
    assert scenario.error(motion, h) > 100.0 * error(prepared, entry, h)


def test_the_rigid_hub_is_at_its_true_time(prepared):
    """Euler under the mean of two inputs turns a rigid hub exactly:
    the model's clock is the end of its step."""
    task, scenario = prepared
    h = 0.5
    entry = Entry(TIMED, 2, "Euler")
    wrench = entry.fed(scenario.profile.mean(h, 120))
    turned = rigid_motion(task, "Euler", h, wrench)[:, 5]
    exact = scenario.response.rigid(scenario.profile, h * np.arange(1.0, 121.0))[:, 5]
    np.testing.assert_allclose(
        turned, exact, rtol=ROUNDING, atol=ROUNDING * float(np.max(np.abs(exact)))
    )
    assert clock(entry) == 0.0
    assert clock(Entry("exact, hub", 2, "Euler")) == 0.5


# -- the field -------------------------------------------------------------------------------------
def test_model_is_made_for_its_step(prepared):
    task, _ = prepared
    entry = Entry(TIMED, 3, "Euler")
    (made,) = made_for(field.model_of(task, entry, 0.5))
    assert made == (0.5, "Euler", 4)
    assert made_for(field.model_of(task, entry)) == [None]


def test_input_is_the_mean_of_two(prepared):
    rows = np.arange(24.0).reshape(4, 6)
    held = bc.HeldInput()
    np.testing.assert_array_equal(Entry(TIMED, 2, "Euler").fed(rows), [held(row) for row in rows])
    np.testing.assert_array_equal(Entry("exact, hub", 2, "Euler").fed(rows), rows)
    assert Entry(TIMED, 2, "Euler").fed(np.zeros((0, 6))).shape == (0, 6)


def test_steps_are_whole_parts_of_the_switching_times(prepared):
    task, scenario = prepared
    for n in range(1, 7):
        entry = Entry(TIMED, n, "Euler")
        limit = field.largest_step(task, entry)
        assert limit > field.largest_step(task, Entry("exact, hub", n, "Euler"))
        for h, count in steps_below(scenario, limit):
            assert scenario.beat / h == pytest.approx(round(scenario.beat / h), rel=SAME)
            assert h * count == pytest.approx(scenario.duration, rel=SAME)


def test_entries_are_eulers(prepared):
    task, _ = prepared
    found = [e for e in field.entries(task) if e.model == TIMED]
    assert {e.integrator for e in found} == {"Euler"}
    assert [e.n for e in found] == [1, 2, 3, 4, 5, 6]
    assert all(e.ours for e in found)


@pytest.mark.slow
def test_measured_like_every_other_model(prepared):
    task, scenario = prepared
    found = climb(task, scenario, Entry(TIMED, 2, "Euler"), 0.02)
    assert min(p.error for p in found.points) < 1.5e-3
    assert all(p.seconds > 0.0 for p in found.points)
    for p in found.points:  # the clock is right, so that there is nothing to take off
        assert p.error_appendage == pytest.approx(p.error, rel=1e-3)


@pytest.mark.slow
def test_in_space_with_damping():
    """Two planes, torsion, damping, a hub offset to the side:
    steps three times beyond RK4's limit reach 1e-3."""
    task, scenario = studies.prepare(
        spec_toml(bc.read_spec(EXAMPLES / "array_uncertain.toml")), studies.Options()
    )
    found = climb(task, scenario, Entry(TIMED, 2, "Euler"), 0.02)
    old = field.largest_step(task, Entry("exact, hub", 2, "RK4"))
    assert max(p.timestep for p in found.points if p.error < 1e-3) > 3.0 * old
    assert min(p.error for p in found.points) < 5e-5


# -- what is recommended ---------------------------------------------------------------------------
@pytest.mark.parametrize("damping", [None, bc.Damping(ratio=0.01, form="hinge")])
def test_recommended_spec(damping):
    spec = bc.read_spec(SEED)
    if damping is not None:
        spec = msgspec.structs.replace(spec, damping=damping)
    _, scenario = studies.prepare(spec_toml(spec), studies.Options())
    point = Point(TIMED, 3, "Euler", 0.5, 1e-4, 1e-4, 2e-4, 2e-6, 0.0, 1.5, 3)
    ladders = (Ladder(Entry(TIMED, 3, "Euler"), [point], ""),)
    found = studies.Study(spec, studies.Options(), {"xy": 2}, scenario, ladders, 0.0)
    given = found.recommended(1e-3, "error")
    assert given is not None
    assert given.scene is not None
    assert given.kept == {"xy": 3}
    assert given.root.target == "hub"
    assert given.fit.springs == "modes"
    assert (given.scene.timestep, given.scene.integrator) == (0.5, "Euler")
    assert given.damping is None or given.damping.form == "modal"
    assert bc.fit(given).status.ok
