"""The reference in large motion: right against an oracle without chains, linear where motion is small, and said so."""

import json
import pickle

import numpy as np
import pytest
from test_study import SEED
from typer.testing import CliRunner

import beamchain as bc
from beamchain.cli import app
from beamchain.engine.rollout import simulate
from beamchain.errors import EngineError, RealisationError
from beamchain.fitting.spec_text import spec_toml
from beamchain.report.study_html import scenario_sentence
from beamchain.studies import field
from beamchain.studies import study as studies
from beamchain.studies.field import Entry
from beamchain.studies.fine_chain import LINEAR, WANTED, nonlinear
from beamchain.studies.run_time import rigid_motion
from beamchain.studies.scenario import Figures, added, at_zero, between
from elastica import Elastica

AMPLITUDE, SMALL = 3.0, 1e-3  # N m; large motion changes 1.3e-3 and 1e-10 of the largest elastic motion
ORACLE = 2e-5  # of the largest elastic motion: two WANTED, for reference and oracle
SQUARE = 0.02  # what large motion changes grows with the square of the load, but for the next even power
ROUNDING = 1e-12


@pytest.fixture(scope="module")
def text():
    return spec_toml(bc.read_spec(SEED))


@pytest.fixture(scope="module")
def large(text):
    return studies.prepare(text, studies.Options(amplitude=AMPLITUDE))


@pytest.fixture(scope="module")
def small(text):
    return studies.prepare(text, studies.Options(amplitude=SMALL))


@pytest.mark.slow
def test_large_motion_against_the_elastica(large, small):
    """What large motion changes, by Galerkin in the rod's angle: its truncation falls out, as it is there in both."""
    task, scenario = large
    at = np.linspace(0.2, 20.0, 100)
    rod = Elastica(
        task.hub.mass, task.hub.inertia[2], task.hub.offset[0], 15.0, 7800.0 * np.pi * 0.006**2,
        2.06e11 * np.pi * 0.006**4 / 4.0, 6,
    )  # fmt: skip
    turns = [rod.turn([(2.0, a), (4.0, -a), (20.0, 0.0)], at) / a for a in (AMPLITUDE, SMALL)]
    expected = AMPLITUDE * (turns[0] - turns[1])
    found = (scenario.motion(at) - AMPLITUDE / SMALL * small[1].motion(at))[:, 5]
    assert np.max(np.abs(expected)) > 20.0 * ORACLE * scenario.largest[0]
    assert np.max(np.abs(found - expected)) < ORACLE * scenario.largest[0]


@pytest.mark.slow
def test_converged_in_links_and_step(large):
    figures = large[1].large.figures
    assert figures.met
    assert max(figures.change, figures.step_change) <= WANTED
    assert figures.small_motion < 1e-3  # the chains alone, without the exact linear response
    assert figures.nonlinear > 10.0 * LINEAR


@pytest.mark.slow
def test_small_motion_is_linear(small):
    _, scenario = small
    assert scenario.large is None
    assert scenario.nonlinear < 1e-8
    at = np.linspace(0.0, 60.0, 50)
    np.testing.assert_array_equal(
        scenario.motion(at),
        scenario.response.elastic(scenario.profile, at) + scenario.response.rigid(scenario.profile, at),
    )


@pytest.mark.slow
def test_the_limit_of_small_amplitude(text, large):
    """Smaller loads approach the linear reference with their square."""
    _, smaller = studies.prepare(text, studies.Options(amplitude=AMPLITUDE / 3.0))
    assert large[1].nonlinear / smaller.nonlinear == pytest.approx(9.0, rel=SQUARE)


@pytest.mark.slow
def test_a_good_chain_is_judged_by_large_motion(large):
    """A chain of six modes is near the large-motion reference, and far from the linear one."""
    task, scenario = large
    h = 0.05
    wrench = scenario.profile.mean(h, 1200)
    motion = simulate(field.model_of(task, Entry("exact, hub", 6, "RK4")), "RK4", h, wrench).motion
    linear = studies.Scenario(
        scenario.profile, 60.0, scenario.watched, scenario.response, scenario.largest, scenario.beat
    )
    error = scenario.error(motion, h)
    assert linear.error(motion, h) > 1e-3
    assert error < 2e-4
    own = scenario.error(motion, h, rigid_motion(task, "RK4", h, wrench))
    assert own == pytest.approx(error, rel=0.05)  # RK4 has no error of its own in turning a rigid body


@pytest.mark.slow
def test_reference_reaches_the_workers_whole(large):
    at = np.linspace(0.0, 60.0, 7)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(large[1])).motion(at), large[1].motion(at))


@pytest.mark.slow
def test_the_reference_is_named(large, small, text):
    spec = bc.read_spec(SEED)
    growth = studies.Growth((), None, (), None)
    for (task, scenario), kind, word in (
        (large, "large motion", "20, 28, 40 links"),
        (small, "linear", "linear motion"),
    ):
        found = studies.Study(spec, studies.Options(), task.kept, scenario, (), growth, 0.0)
        assert found.as_dict()["reference"]["kind"] == kind
        assert word in scenario_sentence(found)


def test_motions_add_up():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 5, 6))
    np.testing.assert_allclose(between(a, added(a, b)), b, atol=ROUNDING)
    spun = a.copy()
    spun[:, 3:] *= 1.0 + 2.0 * np.pi / np.linalg.norm(a[:, 3:], axis=1)[:, None]  # a turn more is the same attitude
    np.testing.assert_allclose(between(a, spun)[:, 3:], 0.0, atol=ROUNDING)


def test_extrapolation():
    where = [0.1, 0.05, 0.02]
    np.testing.assert_allclose(
        at_zero(where, [np.array([3.0 + 2.0 * x - 7.0 * x * x]) for x in where]), 3.0, rtol=1e-12
    )


def test_command_refuses_two_loads(tmp_path):
    profile = tmp_path / "p.csv"
    profile.write_text("time,mz\n0,1\n1,0\n")
    call = ["study", str(SEED), "-o", str(tmp_path / "o"), "--profile", str(profile), "--amplitude", "2"]
    result = CliRunner().invoke(app, call)
    assert isinstance(result.exception, bc.BeamchainError)
    assert "leave one out" in str(result.exception)
    call = ["study", str(SEED), "-o", str(tmp_path / "o"), "--amplitude", "-2"]
    assert isinstance(CliRunner().invoke(app, call).exception, bc.BeamchainError)


def test_a_load_that_throws_the_appendage_about_is_refused(text):
    with pytest.raises(EngineError, match="smaller load"):
        studies.prepare(text, studies.Options(amplitude=1e7))


def test_default_load_stays_linear_on_a_heavy_hub(text):
    """A hub of a million beams hardly moves: the doublet is chosen by what the appendage does."""
    heavy = text.replace("500", "5000000")
    task, scenario = studies.prepare(heavy, studies.Options())
    assert task.hub.mass == 5e6
    assert scenario.large is None
    assert scenario.nonlinear < LINEAR
    unlimited = nonlinear(task, scenario.scaled(10.0))
    assert unlimited > LINEAR  # a larger power of ten would not do


@pytest.mark.slow
def test_where_no_coarse_chain_exists_the_report_says_so(text, small, monkeypatch):
    def refuse(*_args):
        raise RealisationError("no such chain")

    monkeypatch.setattr(field, "model_of", refuse)
    task, scenario = small
    assert np.isnan(nonlinear(task, scenario))
    unknown = studies.replace(scenario, nonlinear=float("nan"))
    found = studies.Study(
        bc.read_spec(SEED), studies.Options(), task.kept, unknown, (), studies.Growth((), None, (), None), 0.0
    )
    assert "could not be simulated" in scenario_sentence(found)


@pytest.mark.slow
def test_command_in_large_motion(tmp_path):
    profile = tmp_path / "p.csv"
    profile.write_text("time,mz\n0,2\n2,-2\n4,0\n")
    out = tmp_path / "o"
    call = ["study", str(SEED), "-o", str(out), "--profile", str(profile), "--budget", "0.01", "--model", "exact, hub",
            "--workers", "2", "--json"]  # fmt: skip
    result = CliRunner().invoke(app, call)
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    assert record["reference"]["kind"] == "large motion"
    assert record["reference"]["change"] <= record["reference"]["wanted"]
    assert "in large motion" in (out / "study.html").read_text()
    assert min(p["error"] for p in record["points"]) < 1e-3


def test_the_reference_says_how_far_it_may_be_off():
    good = Figures(1e-3, (14, 20, 28), 2e-6, 1e-8, 1e-3, 1e-5)
    assert (good.error, good.met) == (2e-6, True)
    missing = Figures(1e-3, (14, 20, 28), 2e-6, 1e-8, 0.4, 1e-5)  # chains that are wrong in small motion already
    assert (missing.error, missing.met) == (4e-4, False)


def test_rivals_of_a_damped_appendage_are_damped_as_it_is():
    """Every kept mode of the equal links has its own ratio, through the tendons' rates in modal coordinates."""
    task = studies.make_task(spec_toml(bc.read_spec(SEED.parent / "array_uncertain.toml")))
    chain = field.chain_of(task, Entry("equal links, midpoint", 10, "RK4"))
    found = {tendon.label: tendon for tendon in chain.tendons}
    assert len(found) == 3 * field.DAMPED
    for port in ("xy", "xz", "torsion"):
        damped = chain.damped(port)
        w = damped.frequencies
        for k in range(field.DAMPED):
            assert found[f"mode{k + 1}_{port}"].damping == pytest.approx(2.0 * 0.005 * w[k])
            assert found[f"mode{k + 1}_{port}"].stiffness == 0.0
        assert damped.damping[: field.DAMPED] == pytest.approx(np.full(field.DAMPED, 0.005), rel=1e-9)
