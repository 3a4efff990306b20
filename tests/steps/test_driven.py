"""Tests internals: `steps.driven`, `report.replay.turn_limits` and `run_limits`,
`studies.study._load_warnings`: what a run puts an appendage through.

The sentences that come of it are tested through the public door in test_run_limits.py.
"""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_run_limits import SEED, craft, seed_fit

import beamchain as bc
from beamchain.engine.slew import Slew
from beamchain.report.pages.study import answer, study_page
from beamchain.report.replay import run_limits, turn_limits
from beamchain.report.tables.study import reach_table
from beamchain.steps.deployment import Run
from beamchain.steps.driven import Driven, driven, keyframes, limit_sentences, run_of_turn
from beamchain.steps.large_motion import LargeMotion
from beamchain.studies import study as studies
from mechanics import compiled

DIFFERENCES = 1e-5  # second differences over a thousandth of a turn
FORCES = 1e-10  # MuJoCo's own kinematics against a formula


def test_steady_spin_of_a_hub():
    """Turning at w about z, its centre at rest: the root at (2, 0, 0) moves at w^2 r along x,
    nothing across."""
    rate, spacing = 0.7, 1e-3
    t = spacing * np.arange(2000)
    motion = np.zeros((t.size, 6))
    motion[:, 5] = rate * t
    run = driven(motion, spacing, np.array([2.0, 0.0, 0.0]))
    assert run.spin == pytest.approx(rate, rel=DIFFERENCES)
    assert max(*run.acceleration.values(), *run.slew.values()) < 1e-6


def test_accelerated_turn_and_thrust_in_the_hubs_own_axes():
    """A hub turned by 90 degrees about z, then pushed along the world's x: across the appendage,
    which points along y."""
    slew, push, spacing = 0.3, 0.2, 1e-3
    t = spacing * np.arange(1000)
    motion = np.zeros((t.size, 6))
    motion[:, 5] = np.pi / 2.0
    motion[:, 0] = 0.5 * push * t**2
    run = driven(motion, spacing, np.zeros(3))
    assert run.acceleration["xy"] == pytest.approx(push, rel=DIFFERENCES)
    assert run.acceleration["xz"] == pytest.approx(0.0, abs=1e-9)
    motion[:] = 0.0
    motion[:, 4] = 0.5 * slew * t**2
    run = driven(motion, spacing, np.array([2.0, 0.0, 0.0]))
    assert run.slew["xz"] == pytest.approx(slew, rel=DIFFERENCES)
    # less what centripetal acceleration turns
    assert run.acceleration["xz"] == pytest.approx(2.0 * slew, rel=1e-3)
    assert run.slew["xy"] == pytest.approx(0.0, abs=1e-9)
    assert run_of_turn(0.0, slew, np.eye(3)[1], (2.0, 0.0, 0.0)) == Driven(
        0.0, {"xy": 0.0, "xz": 0.6}, {"xy": 0.0, "xz": slew}
    )


def test_attitudes_beyond_half_a_turn_are_followed():
    spacing = 1e-2
    t = spacing * np.arange(2000)
    motion = np.zeros((t.size, 6))
    # wraps at half a turn
    motion[:, 3:] = Rotation.from_rotvec(np.outer(0.5 * t, [0.0, 0.0, 1.0])).as_rotvec()
    assert driven(motion, spacing, np.zeros(3)).spin == pytest.approx(0.5, rel=DIFFERENCES)


def test_keyframes_of_a_model():
    model = compiled(
        craft(
            ("still", "0 0 0", 0.0), ("spin", "0.5 0.3 0.4", 0.0), ("kick", "0 0 0", 5.0)
        ).replace(
            '<site name="mount" pos="1 0 0"/>',
            "<site name='mount' pos='1 0 0'/><body name='root' pos='1 0 0'><geom size='1' "
            "mass='0'/></body>",
        )
    )
    found = keyframes(model, "root")
    assert list(found) == ["spin", "kick"]
    assert found["spin"].spin == pytest.approx(0.5, rel=FORCES)
    assert found["kick"].slew["xy"] == pytest.approx(5.0 / 500.0, rel=FORCES)
    assert found["kick"].acceleration["xy"] == pytest.approx(5.0 / 500.0, rel=FORCES)


def test_exceeded_names_the_plane_and_the_limit():
    limits = {"xz": LargeMotion("xz", 0.2, 0.5, 0.05, 0.3, 0.01)}
    assert (
        limit_sentences(limits, Driven(0.1, {"xy": 9.0, "xz": 0.4}, {"xy": 9.0, "xz": 0.04})) == []
    )
    said = limit_sentences(limits, Driven(0.3, {"xy": 0.0, "xz": 0.6}, {"xy": 0.0, "xz": 0.0}))
    assert [("spin" in s, "0.2 rad/s" in s, "xz" in s) for s in said] == [
        (True, True, True),
        (False, False, True),
    ]


def test_a_rendered_turn_warns():
    fit = seed_fit()
    model = compiled(fit.scene_mjcf())

    def said_of(seconds):
        slew = Slew(np.zeros(1), model.qpos0[None], "hub", 2, 0.7, seconds, 1.0, ())
        return turn_limits(model, slew, {f"{fit.spec.name}_link1": fit})

    assert said_of(100.0) == []
    said = said_of(5.0)  # 0.28 rad/s, 0.112 rad/s^2
    assert ["spin" in s for s in said].count(True) == 1
    assert any(s.startswith("slew reached 0.112 rad/s^2") for s in said)


def test_a_filmed_run_quotes_what_its_positions_go_through():
    """The hub turns at a rate that grows by 0.112 rad/s^2 to 0.28 rad/s."""
    fit = seed_fit()
    model = compiled(fit.scene_mjcf())
    times = np.linspace(0.0, 2.5, 251)
    angles = 0.056 * times**2
    positions = np.tile(model.qpos0, (times.size, 1))
    positions[:, [3, 6]] = np.column_stack([np.cos(angles / 2.0), np.sin(angles / 2.0)])
    run = Run(times, positions, positions, positions, (), ())
    said = run_limits(model, run, {f"{fit.spec.name}_link1": fit})
    (spin,) = (s for s in said if "spin" in s)
    assert float(re.search(r"spin reached ([\d.]+)", spin)[1]) == pytest.approx(0.28, rel=0.01)
    assert any(s.startswith("slew reached 0.112 rad/s^2") for s in said)


@pytest.mark.slow
def test_study_warns_where_no_chain_reaches_a_target():
    spec = bc.read_spec(SEED)
    task, scenario = studies.prepare(studies.spec_toml(spec), studies.Options(duration=10.0))
    loud = studies.replace(
        scenario, profile=studies.parse_profile("time,mz\n0,60\n2,-60\n4,0\n", "p")
    )
    point = studies.Point("exact, hub", 2, "RK4", 0.1, 0.2, 0.2, 1.0, 0.01, 0.0, 1.5, 3)
    rival = studies.Point(
        "equal links, midpoint", 57, "RK4", 0.001, 5e-3, 5e-3, 9.0, 0.01, 0.0, 9.0, 3
    )
    ladders = tuple(studies.Ladder(studies.Entry(*p[:3]), [p], "") for p in (point, rival))
    found = studies.Study(spec, studies.Options(), task.kept, loud, ladders, 0.0)
    assert found.best(1e-2, "error") is None
    assert any(s.startswith("exact, hub, n = 2: slew") for s in studies._load_warnings(task, found))
    assert "exact, hub with n = 2 comes to 0.2: study more modes" in answer(found)
    rows = reach_table(found).rows
    assert [r[1] for r in rows[:2]] == ["none of ours within the budget", "equal links, midpoint"]


@pytest.mark.slow
def test_study_warns_of_a_load_beyond_the_chain():
    profile = "time,mz\n0,60\n2,-60\n4,0\n"  # 0.1 rad/s^2 on the hub
    options = studies.Options(profile=profile, duration=10.0, budget=1e-3, models=("exact, hub",))
    spec = bc.read_spec(SEED)
    task, scenario = studies.prepare(studies.spec_toml(spec), studies.Options(duration=10.0))
    loud = studies.replace(scenario, profile=studies.parse_profile(profile, "p"))
    rows = [(0.1, 1e-3, 1.0)]
    points = [
        studies.Point("exact, hub", 2, "RK4", h, e, e, s, s / 100, 0.0, 1.5, 3) for h, e, s in rows
    ]
    ladders = (studies.Ladder(studies.Entry("exact, hub", 2, "RK4"), points, ""),)
    quiet = studies.Study(spec, options, task.kept, scenario, ladders, 0.0)
    assert studies._load_warnings(task, quiet) == ()
    said = studies._load_warnings(task, studies.replace(quiet, scenario=loud))
    assert any(s.startswith("exact, hub, n = 2: slew reached") for s in said)
    warned = studies.replace(quiet, warnings=said)
    assert [one["message"] for one in warned.as_dict()["warnings"]] == list(said)
    assert said[0].split("/s^2")[0] in study_page(warned)[0]
