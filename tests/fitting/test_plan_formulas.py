"""Closed forms beside the plan of a beam's modes: which targets are tried, what is asked of the
chain, the band of its fillers, the steps that take a tendon per mode."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from beamchain import PortModel
from beamchain.errors import RealisationError
from formulas import (
    Body,
    Kept,
    Step,
    chain_of_ports,
    check_free_modes,
    fillers_above,
    needs_hub,
    needs_time,
    select,
)

RIGID = np.array([[8.0, 20.0], [20.0, 70.0]])
W = {"xy": np.array([2.0, 5.0, 11.0]), "xz": np.array([3.0, 9.0])}
ROWS = {
    "xy": np.array([[2.0, 6.5], [1.1, 0.9], [0.5, 0.2]]),
    "xz": np.array([[1.9, 6.0], [1.3, 1.1]]),
}
FULL = {port: PortModel(RIGID, W[port], ROWS[port]) for port in W}


def boom(**more):
    section = bc.Equivalent(bending_stiffness_xy=400.0, bending_stiffness_xz=300.0, linear_mass=1.6)
    return bc.Spec(name="boom", segment=(bc.Segment(length=5.0, section=section),), **more)


def body_of(spec):
    return Body(spec, {port: spec.with_ratios(port, model) for port, model in FULL.items()})


POINTS = (bc.spec.Port(name="b", x=2.0), bc.spec.Port(name="a", x=1.0))


# -- what a body is --------------------------------------------------------------------------------
def test_modes_couple_ports_where_one_moves_several():
    assert not body_of(boom()).couples
    for groups, couples in (
        ((), False),
        ((("xy",), ("xz",)), False),
        ((("xy",), ("xz", "xy")), True),
    ):
        assert Body(boom(), {}, SimpleNamespace(groups=groups)).couples is couples


def test_modes_beyond_25_bands_are_gathered_there():
    w = 0.4 * np.array([24.9, 25.1, 26.0, 29.0])
    rows = np.array([[0.1, 0.2], [0.3, -0.1], [0.2, 0.3], [-0.2, 0.5]])
    body = Body(boom(scene=bc.Scene(bandwidth=0.4)), {"xz": PortModel(RIGID, w, rows)})
    found = body.in_band["xz"]
    assert found.frequencies == pytest.approx([0.4 * 24.9, 10.0, 10.0])
    wanted = (rows[1:].T / w[1:] ** 2) @ rows[1:]
    assert found.participation[1:].T @ found.participation[1:] / 100.0 == pytest.approx(wanted)


# -- which modes -----------------------------------------------------------------------------------
HUB = bc.Hub(mass=30.0, inertia=(20.0, 25.0, 28.0))


@pytest.mark.parametrize(
    ("more", "tried"),
    [
        ({}, ["clamped"]),
        ({"root": bc.spec.Root(hub=HUB)}, ["clamped", "hub"]),
        ({"root": bc.spec.Root(target="free")}, ["free"]),
        ({"root": bc.spec.Root(target="auto")}, ["clamped"]),
        ({"root": bc.spec.Root(hub=HUB), "port": POINTS}, ["clamped"]),
    ],
)
def test_targets_that_are_tried(more, tried, monkeypatch):
    """Further points need clamped modes, those of a hub need the hub. The second is as good as it
    can be, the first is pruned to nothing."""
    asked = []

    def grow(judges, items, tolerance, may_keep):
        ((name, judge),), (item,) = judges.items(), items
        asked.append((name, judge.asked, judge.band, item.kept.target, item.kept.counts, tolerance))
        more = {n: replace(item, kept=replace(item.kept, counts={"xy": n})) for n in (1, 8, 9)}
        assert [may_keep(0, one) for one in more.values()] == [True, True, False]
        return [more[1]], [Step(0, f"mode 1 in xy for {item.kept.target}", 3.0, 2.0)]

    def prune(judge, item, least, tolerance):
        assert (judge.band, least.counts, tolerance) == (2.5, {}, 0.02)
        return item if item.kept.target == tried[-1] else replace(item, kept=least)

    monkeypatch.setattr("beamchain.fitting.select.grow", grow)
    monkeypatch.setattr("beamchain.fitting.select.prune", prune)
    scene = bc.Scene(bandwidth=2.5, tolerance=0.02, axes=("z", "ty"))
    known = {
        port: one.replaced(tip=np.zeros((one.modes, 6)), points=(9.0, 1.0, 2.0))
        for port, one in FULL.items()
    }
    body = Body(boom(scene=scene, **more), known)
    body.promise.of_models = lambda models, tolerance=None: 0.5 if models[0].modes else 0.6
    kept = select(body)
    assert asked == [("hub", {1, 5}, 2.5, target, {}, 0.02) for target in tried]
    assert (kept.counts, kept.target) == ({"xy": 1}, tried[-1])
    lines = kept.choice.reasoning
    assert [line.split()[1] for line in lines[: len(tried)]] == [f'"{name}":' for name in tried]
    assert lines[len(tried) :] == (
        f'chosen: target "{tried[-1]}", 1 flexible modes',
        f"mode 1 in xy for {tried[-1]}: in-band error 3.00e+00 -> 2.00e+00",
    )


def test_further_points_are_attached_in_the_order_in_which_they_are_stated():
    """Their motions stand in the port model by x, two each, the tip's first."""
    model = SimpleNamespace(
        motions=2, modes=9, frequencies=W["xy"], attached=lambda count, rows: (count, rows)
    )
    model.points = (5.0, 1.0, 2.0)
    model.point_columns = partial(PortModel.point_columns, model)
    body = Body(boom(modes=bc.Modes(xy=3), port=POINTS), {"xy": model})
    assert body.reduced("clamped", "xy", 3) == (3, [4, 5, 2, 3])
    kept = select(body)
    assert (kept.counts, kept.target, kept.choice) == ({"xy": 3}, "clamped", None)


# -- what is asked of the chain --------------------------------------------------------------------
@pytest.mark.parametrize("target", ["clamped", "free"])
def test_what_a_plan_asks_of_its_chain(target, monkeypatch):
    monkeypatch.setattr("beamchain.fitting.realise.build_exact", lambda *asked: asked)
    spec = boom(
        modes=bc.Modes(xy=2, xz=2),
        damping=bc.Damping(ratio={"xy": (0.01, 0.03), "xz": (0.02,)}),
        scene=bc.Scene(bandwidth=99.0),
        fit=bc.spec.FitOptions(springs="modes", cuts=(0.4, 1.1)),
    )
    kept = Kept(target, {"xy": 2, "xz": 2})
    line, counts, target_of, wishes = chain_of_ports(body_of(spec), kept, "line")
    assert line == "line"
    assert counts == {"xy": 2, "xz": 2}
    if target == "clamped":
        assert target_of("xy", 2).frequencies.tolist() == [2.0, 5.0]
    assert target_of("xy", 2).damping.tolist() == [0.01, 0.03]
    assert (wishes.springs, wishes.per_mode, wishes.lines) == ("modes", True, (0.4, 1.1))
    assert (wishes.further, wishes.cut) == ((), None)
    assert (wishes.band, wishes.neutral) == (99.0, target == "free")
    assert wishes.left_out["xz"].frequencies.size == 0  # all of these are kept
    rest = wishes.left_out["xy"]
    assert (rest.ports, rest.frequencies.tolist()) == (("xy",), [11.0])
    assert rest.rows.tolist() == [[0.5, 0.2]]


def test_of_a_chain_with_further_points_nothing_is_left_out(monkeypatch):
    monkeypatch.setattr("beamchain.fitting.realise.build_exact", lambda *asked: asked[-1])
    spec = boom(modes=bc.Modes(xy=2), port=POINTS, scene=bc.Scene(tip=True))
    wishes = chain_of_ports(body_of(spec), Kept("clamped", {"xy": 2}), spec.beam.line)
    assert wishes.further == (5.0, 2.0, 1.0)
    assert wishes.left_out == {}
    assert not wishes.per_mode


def last_on(hub, port, count):
    """Highest frequency of `M q'' + K q = 0` of hub and modes."""
    rows = ROWS[port][:count]
    mass = np.block([[np.diag(hub) + RIGID, rows.T], [rows, np.eye(count)]])
    stiffness = np.diag([0.0, 0.0, *W[port][:count] ** 2])
    return np.sqrt(eigh(stiffness, mass, eigvals_only=True)[-1])


@pytest.mark.parametrize(
    ("target", "hub", "bandwidth", "wanted"),
    [
        ("clamped", None, None, 0.0),
        ("clamped", None, 2.5, 2.5),
        ("clamped", "hub", 2.5, max(last_on([9.0, 7.0], "xy", 2), last_on([9.0, 6.0], "xz", 1))),
        ("hub", "hub", 90.0, 90.0),
        ("free", "hub", None, max(last_on([0.0] * 2, "xy", 2), last_on([0.0] * 2, "xz", 1))),
        ("free", None, 2.5, max(last_on([0.0] * 2, "xy", 2), last_on([0.0] * 2, "xz", 1))),
    ],
)
def test_fillers_of_a_beam_stand_above_the_band_and_the_last_mode(target, hub, bandwidth, wanted):
    stated = bc.Hub(mass=9.0, inertia=(5.0, 6.0, 7.0)) if hub else None
    scene = None if bandwidth is None else bc.Scene(bandwidth=bandwidth)
    spec = boom(modes=bc.Modes(xy=2, xz=1), root=bc.spec.Root(hub=stated), scene=scene)
    found = fillers_above(body_of(spec), Kept(target, {"xy": 2, "xz": 1}))
    assert found == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(("left", "refused"), [(0.9e-9, True), (1.1e-9, False)])
def test_free_modes_leave_a_billionth_of_the_mass_at_the_root(left, refused):
    """In the lightest of its directions."""
    rows = np.array([[0.0, 3.0 * np.sqrt(1.0 - left)], [1.0, 0.0]])
    target = PortModel(np.diag([4.0, 9.0]), np.array([1.0, 2.0]), rows)
    if refused:
        with pytest.raises(RealisationError, match="too light"):
            check_free_modes(target)
    else:
        check_free_modes(target)


@pytest.mark.parametrize(("left", "empty"), [(0.9e-5, True), (1.1e-5, False)])
def test_modes_that_leave_no_mass_at_the_root(left, empty):
    rows = np.array([[0.0, 3.0 * np.sqrt(1.0 - left)], [1.0, 0.0]])
    model = PortModel(np.diag([4.0, 9.0]), np.array([1.0, 2.0]), rows)
    assert needs_hub(SimpleNamespace(exact=False), model) is empty
    assert not needs_hub(SimpleNamespace(exact=True), model)


@pytest.mark.parametrize(
    ("integrator", "turn", "needed"),
    [
        ("Euler", 0.1, True),
        ("implicitfast", 0.1, True),
        ("discrete", 9.0, False),
        ("RK4", 1.99, False),
        ("RK4", 2.01, True),
    ],
)
def test_a_step_takes_tendons_to_be_exact_or_to_slow_what_rk4_cannot_follow(
    integrator, turn, needed
):
    """Two radians in a step at the fastest of the free modes, here 5 / sqrt(1 - 1/4)."""
    models = {
        "xy": PortModel(np.diag([4.0, 9.0]), np.array([5.0]), np.array([[1.0, 0.0]])),
        "xz": PortModel(np.diag([4.0, 9.0]), np.array([5.1]), np.array([[0.1, 0.0]])),
    }
    step = turn / (5.0 / float(np.sqrt(0.75)))
    spec = SimpleNamespace(exact_step=step, integrator=integrator)
    body = SimpleNamespace(spec=spec, reduced=lambda _, port, __: models[port])
    assert bool(needs_time(body, Kept("clamped", {"xy": 1, "xz": 1}))) is needed
