"""Closed forms beside the formulas of a choice of modes."""

import json
import tomllib
from dataclasses import dataclass, field
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from lxml import etree
from scipy.optimize import brentq

import beamchain as bc
from beamchain import PortModel
from beamchain.fitting.cure import with_modal_damping
from beamchain.fitting.fit import _with_integrator as with_integrator
from beamchain.fitting.spec import schema
from beamchain.fitting.spec_text import spec_toml
from beamchain.structure.readers.imported import Imported
from beamchain.structure.section import SOFT
from beamchain.warning_codes import Caution
from every_mode import everything
from formulas import (
    Body,
    Kept,
    Promise,
    body_of,
    cure_of,
    departs,
    doubtful,
    exact_appendage,
    imported_warnings,
    one_mode_more,
    ports_of_beam,
    put_timing,
    reduced_to_kept,
    safe_step,
    select,
    step_warnings,
    weights_of_modes,
)


@pytest.mark.parametrize(("hub", "coupled"), [(1e3, False), (1e-3, True)])
def test_a_heavy_hub_uncouples_what_a_light_one_does_not(hub, coupled):
    # 1e-11 off the diagonal of ones: 1e-14 of a hub of 1e3, 1e-11 of one of 1e-3; 1e-12 couples
    rigid = np.array([[1.0, 1e-11], [1e-11, 1.0]])
    exact = PortModel(rigid, np.array([2.0]), np.array([[0.5, 0.0]]))
    promise = Promise(exact, hub * np.eye(2), [0, 3], [0], 1.0, 0.01)  # along x, and about it
    assert promise.reaches("axial")
    assert promise.reaches("torsion") is coupled


def test_a_mode_weighs_what_it_carries_at_its_peak_or_beyond_the_band():
    """In the band 1 / (2 ratio), beyond it r^2 / (1 - r^2) with r = band / w, times the share of
    its effective mass in that of appendage and hub."""
    full = PortModel(
        np.diag([4.0, 2.0]),
        np.array([0.5, 2.0, 4.0]),
        np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]]),
        np.array([0.01, 0.01, 0.0]),
    )
    found = weights_of_modes(full, np.diag([6.0, 3.0]), 1.0, [0, 1])
    wanted = [0.1 * 50.0, 0.2 / 3.0, (0.025 + 0.05) / 15.0]
    assert found == pytest.approx(wanted, rel=1e-12)
    # in one motion alone, what else it carries does not count
    found = weights_of_modes(full, np.diag([6.0, 3.0]), 1.0, [1])
    assert found == pytest.approx([0.0, 0.2 / 3.0, 0.05 / 15.0], rel=1e-12)
    # unless it moves along: by the inverse of [[10, 2], [2, 5]]
    found = weights_of_modes(full, np.array([[6.0, 2.0], [2.0, 3.0]]), 1.0, [1])
    assert found[0] == pytest.approx((2.0 / 46.0) ** 2 * 5.0 * 50.0, rel=1e-12)


def delivery(mass, length):
    arm = length / 2.0
    rigid = np.diag(
        [mass] * 3 + [1e-3 * mass * length**2, mass * arm**2 * 1.5, mass * arm**2 * 1.5]
    )
    rigid[1, 5] = rigid[5, 1] = mass * arm
    rigid[2, 4] = rigid[4, 2] = -mass * arm
    row = np.zeros((1, 6))
    row[0, 1] = 0.5 * np.sqrt(mass)
    return bc.ModalData(rigid, np.array([1.0]), row, length=length)


@pytest.mark.parametrize(
    ("mass", "length", "told"),
    [
        (5.0, 199.0, False),
        (5.0, 201.0, True),  # longer than any appendage
        (0.011, 10.0, False),
        (0.009, 10.0, True),  # below 1 g/m
    ],
)
def test_a_file_in_other_units_is_asked_about(mass, length, told):
    said = imported_warnings(delivery(mass, length), [1])
    assert told == any(one.code == "file-units" for one in said)


# -- slips of units --------------------------------------------------------------------------------
def codes(length, section, youngs_modulus=7e10, density=2700.0, damping=None):
    material = bc.Material(youngs_modulus=youngs_modulus, density=density)
    part = bc.Segment(length=length, section=section, material=material)
    return {one.code for one in doubtful([part], damping)}


@pytest.mark.parametrize(
    ("code", "just", "not_yet"),
    [
        ("light-material", {"density": 4.9}, {"density": 5.1}),
        ("soft-material", {"youngs_modulus": 0.9 * SOFT}, {"youngs_modulus": 1.1 * SOFT}),
        # a square of side d: bending over axial stiffness d^2 / 12
        ("stocky-beam", {"length": 9.9 * 0.5}, {"length": 10.1 * 0.5}),
        ("high-damping", {"damping": 0.1}, {"damping": 0.099}),
        ("least-damping", {"damping": 0.95e-5}, {"damping": 1.05e-5}),
    ],
)
def test_a_doubtful_number_is_told_from_its_threshold_on(code, just, not_yet):
    for change, told in ((just, True), (not_yet, False)):
        given = {"length": 20.0, "section": bc.Rectangle(width_y=0.5, width_z=0.5), **change}
        if "damping" in given:
            given["damping"] = bc.Damping(ratio=given["damping"])
        assert (code in codes(**given)) == told


@pytest.mark.parametrize(
    ("length", "y", "z", "told"),
    [
        (8.0, 2.1, 0.1, True),  # a quarter of the length
        (8.0, 1.9, 0.1, False),
        (2.0, 0.9, 0.1, False),  # nothing below 1 m
        (2.0, 1.1, 0.1, True),
        (8.0, 7.9, 0.04, False),  # a panel may be as wide as it is long
        (8.0, 8.1, 0.04, True),
    ],
)
def test_a_wide_section_is_doubted_unless_it_is_a_panel(length, y, z, told):
    section = bc.Rectangle(width_y=y, width_z=z)
    assert ("huge-section" in codes(length, section)) == told


def test_the_depth_of_a_stocky_beam_is_that_of_the_kept_planes():
    material = bc.Material(youngs_modulus=7e10, density=2700.0)
    flat = bc.Rectangle(width_y=0.5, width_z=0.01)
    part = bc.Segment(length=4.0, section=flat, material=material)
    for ports, told in ((("xy", "xz"), True), (("xz",), False), (("torsion",), False)):
        assert any(one.code == "stocky-beam" for one in doubtful([part], ports=ports)) == told


@pytest.mark.parametrize(
    ("step", "code"), [(0.011, "unstable-step"), (0.009, "inaccurate-step"), (0.004, None)]
)
def test_a_step_is_told_where_it_is_unstable_or_inaccurate(step, code):
    limits = SimpleNamespace(largest_step={"Euler": 0.01, "RK4": 1.0})
    choices = [
        SimpleNamespace(integrator="RK4", step=0.5),
        SimpleNamespace(integrator="Euler", step=0.005),
    ]
    scene = bc.Scene(integrator="Euler", tolerance=0.01)
    found = [one.code for one in step_warnings(scene, step, limits, choices)]
    assert found == ([] if code is None else [code])


@pytest.mark.parametrize(
    ("largest", "step"),
    [
        # a fifth, and 1, 2 or 5 times a power of ten
        (0.05 * (1.0 - 1e-9), 0.005),
        (0.05, 0.01),
        (0.099, 0.01),
        (0.101, 0.02),
        (0.249, 0.02),
        (0.251, 0.05),
        (5.1, 1.0),
        (400.0, 1.0),
        (3e-5, 5e-6),
    ],
)
def test_a_safe_step_is_round_and_a_fifth_of_the_largest(largest, step):
    assert safe_step(largest) == pytest.approx(step, rel=1e-9)


@pytest.mark.parametrize(("ratio", "taken"), [(0.0, True), (0.9999, True), (1.0, False)])
def test_damping_ratios_end_before_one(ratio, taken):
    for given in (ratio, (0.1, ratio), {"xy": (ratio,)}):
        if taken:
            assert bc.Damping(ratio=given).ratio == given
        else:
            with pytest.raises(bc.InputError, match="is not an oscillation"):
                bc.Damping(ratio=given)


def test_the_last_ratio_of_a_short_list_goes_on():
    given = bc.Damping(ratio={"xy": (0.01, 0.02), "xz": ()})
    assert given.ratios("xy", 4).tolist() == [0.01, 0.02, 0.02, 0.02]
    assert given.ratios("xy", 1).tolist() == [0.01]
    assert given.ratios("torsion", 2).tolist() == [0.0, 0.0]
    assert bc.Damping(ratio=(0.3, 0.1)).ratios("xz", 3).tolist() == [0.3, 0.1, 0.1]
    assert bc.Damping(ratio=0.2).ratios("xy", 2).tolist() == [0.2, 0.2]


# -- what an exact appendage keeps -----------------------------------------------------------------
FULL = PortModel(
    np.array([[4.0, 1.0], [1.0, 3.0]]),
    np.array([1.0, 2.0, 3.0]),
    np.array([[1.0, 0.5], [0.5, -0.4], [0.2, 0.3]]),
)


def kept_of(count, hub=None, target="clamped"):
    body = Body(boom(root=bc.spec.Root(hub=hub)), {})
    return reduced_to_kept(body, Kept(target, {"xy": count}), "xy", count, FULL, ())


def test_what_a_file_holds_of_all_modes():
    assert kept_of(0).modes == 0
    assert kept_of(2).frequencies.tolist() == [1.0, 2.0]
    hub = bc.Hub(mass=5.0, inertia=(6.0, 6.0, 7.0))
    mass = FULL.rigid_mass + np.diag([5.0, 7.0])
    for target, whole in (("hub", mass), ("free", FULL.rigid_mass)):
        rows = FULL.participation
        shapes = np.eye(3) - rows @ np.linalg.solve(whole, rows.T)
        lowest = np.sort(1.0 / np.linalg.eigvals(shapes / np.outer([1, 2, 3], [1, 2, 3])).real)[:2]
        found = kept_of(2, hub=hub, target=target)
        on = np.diag([5.0, 7.0]) if target == "hub" else np.zeros((2, 2))
        assert found.with_hub(on).free_frequencies == pytest.approx(np.sqrt(lowest))


def test_static_responses_of_further_points_are_exact():
    """Columns 0, 1 and 4, 5 of the motion: points 0 and 2."""
    random = np.random.default_rng(3)
    w = np.arange(1.0, 9.0)
    rows, tip = random.normal(size=(8, 2)) / 4.0, random.normal(size=(8, 6))
    full = PortModel(4.0 * np.eye(2), w, rows, tip=tip, points=(9.0, 2.0, 5.0))
    given = Body(boom(), {}), Kept("clamped", {"xy": 2}), "xy", 2, full
    found = reduced_to_kept(*given, (9.0, 5.0))
    assert found.modes == 6
    assert found.frequencies[:2] == pytest.approx([1.0, 2.0])
    flexible, wanted = (of.tip.T @ np.diag(of.frequencies**-2.0) @ of.tip for of in (found, full))
    at = np.ix_([0, 1, 4, 5], [0, 1, 4, 5])
    assert flexible[at] == pytest.approx(wanted[at])
    assert reduced_to_kept(*given, (9.0,)).modes == 4


def test_what_is_kept_of_a_beam_is_what_its_chain_came_to_have():
    """Which may be fewer modes; shapes for further points behind them are none."""
    kept = Kept("hub", {"xy": 3, "xz": 1, "torsion": 2}, choice="choice")
    found = kept.of_chain({"xy": FULL.truncated(2), "xz": FULL})
    assert (found.target, found.counts, found.choice) == ("hub", {"xy": 2, "xz": 1}, "choice")
    assert kept.of_chain(dict.fromkeys(kept.counts, FULL)).counts == kept.counts
    imported = Kept("clamped", {"xy": 3}, whole="modes", numbers=(1, 2, 4))
    assert imported.of_chain({"xy": FULL.truncated(2)}) is imported


def test_all_modes_of_a_beam_are_six_more_than_twice_the_kept_or_those_that_were_fitted():
    """Of a port that is not kept six; where one is rigid none."""
    asked = []

    def port(name, count, stations):
        if name in ("torsion", "axial"):
            raise bc.InputError("rigid.")
        asked.append((name, count, stations))
        return FULL.truncated(2)

    beam = SimpleNamespace(port=port, rigid_mass=lambda: 9.0 * np.eye(6))
    spec = SimpleNamespace(
        beam=beam, further={}, with_ratios=lambda _, model: model, root=bc.spec.Root()
    )
    body = Body(spec, {"xy": FULL, "xz": FULL.truncated(1)})
    kept = Kept("clamped", {"xy": 2})
    found = exact_appendage(body, kept, np.eye(6))
    assert asked == [("xy", 10, []), ("xz", 6, [])]
    assert [model.modes for model in found.ports.values()] == [3, 2]
    # 1, 1, 2, 2 and 3 rad/s, of xy before xz: two of xy are kept
    assert found.kept.tolist() == [True, False, True, False, False]
    assert found.band == {"xy": 2.0}
    assert found.model.rigid_mass.tolist() == (9.0 * np.eye(6)).tolist()


@pytest.mark.parametrize("count", [1, 8])
def test_as_many_modes_of_the_exact_appendage_as_are_asked_for_are_those_of_the_beam(count):
    """Of what a fit has of it, only some more than twice the kept ones are."""
    body = body_of(boom(modes=bc.Modes(xy=count)))
    found = exact_appendage(body, Kept("clamped", {"xy": count}), np.eye(6), 40).ports
    for port, stiffness in (("xy", 400.0), ("xz", 1200.0)):
        wanted = cantilever(40, stiffness, 1.7, 3.0)
        assert found[port].frequencies[:40] == pytest.approx(wanted, rel=1e-9)


# -- timing ----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("springs", "step", "integrator", "timed"),
    [
        ("hinges", 0.05, "Euler", True),
        ("auto", 0.05, "Euler", False),
        ("hinges", None, "Euler", False),
        ("hinges", 0.05, "RK4", False),
    ],
)
def test_springs_on_hinges_are_timed_where_they_shall_stand_there(springs, step, integrator, timed):
    tree = etree.fromstring('<mujoco><joint stiffness="40"/><joint/></mujoco>')
    scene = bc.Scene(timestep=step, integrator=integrator)
    put_timing(
        tree, boom(fit=bc.spec.FitOptions(springs=springs), scene=scene), sprung=False, form=2
    )
    assert [joint.get("armature") is not None for joint in tree.iter("joint")] == [timed, False]


# -- modes that move several ports -----------------------------------------------------------------
BELONGS = ("xy", "xz", "xy", "torsion", "xz")
SIZES = np.array([0.4, 0.3, 1.0, 0.2, 0.5])


def told_apart(sizes, belongs):
    """A file whose modes at 1, 2, 3, ... rad/s move a port by their size, and all of them another
    one by a little."""
    rows = (
        np.array(sizes)[:, None] * np.eye(6)[[{"xy": 1, "xz": 2, "torsion": 3}[p] for p in belongs]]
    )
    rows[:, 0] = 1e-3
    return bc.ModalData(10.0 * np.eye(6), np.arange(1.0, len(sizes) + 1.0), rows, length=2.0)


class Told:
    """An error that falls by what each mode takes of it."""

    def __init__(self, parts, band=10.0):
        self.parts, self.band = parts, band

    def of_models(self, models, tolerance=None):
        del tolerance
        kept = set(models[0].frequencies.tolist())
        return sum(part for k, part in enumerate(self.parts, 1) if k not in kept)

    def of_exchange(self, number, model):
        assert number == 0
        return self.of_models([model])

    def floor(self, models):
        del models
        return lambda others: 0.0


def of_told(told, data, tolerance, fixed, tip=False):
    """What is kept of such a file."""
    scene = bc.Scene(bandwidth=told.band, tolerance=tolerance, tip=tip)
    spec = bc.Spec(
        name="file",
        imported=Imported(file="f.op2"),
        scene=scene,
        root=bc.spec.Root(hub=bc.Hub(mass=5.0, inertia=(5.0, 5.0, 5.0))),
        modes=bc.Modes(**fixed) if fixed else None,
    )
    body = body_of(spec, data)
    assert body.couples
    body.__dict__["promise"] = told
    return select(body)


@pytest.mark.parametrize(
    ("parts", "tolerance", "fixed", "tip", "numbers"),
    [
        # taken as they pay, mode 3 first, until 1.01 times the rest keeps the tolerance
        ((0.1, 0.1, 5.0, 0.1, 0.5), 0.31, {}, False, (3, 5)),
        ((0.1, 0.1, 5.0, 0.1, 0.5), 0.302, {}, False, (1, 3, 5)),
        # not mode 5, that weighs more than what is needed, mode 1
        ((1.0, 0.0, 5.0, 0.0, 0.0), 0.5, {}, False, (1, 3)),
        ((0.1, 0.1, 5.0, 0.1, 0.5), 9.0, {}, False, ()),
        # a port's first modes stay, its others go
        ((0.1, 0.1, 5.0, 0.1, 0.5), 9.0, {"xy": 1}, False, (1,)),
        ((0.1, 0.1, 5.0, 0.1, 0.5), 0.1, {"xy": 1}, False, (1, 2, 4, 5)),
        # the band up to 3 rad/s stays with a tip, but for what is barred
        ((0.1, 0.1, 5.0, 0.1, 0.5), 9.0, {}, True, (1, 2, 3)),
        ((0.1, 0.1, 5.0, 0.1, 0.5), 9.0, {"xz": 0}, True, (1, 3)),
    ],
)
def test_the_fewest_modes_in_the_order_in_which_they_pay(parts, tolerance, fixed, tip, numbers):
    told = Told(parts, 3.0 if tip else 10.0)
    kept = of_told(told, told_apart(SIZES, BELONGS), tolerance, fixed, tip)
    choice = kept.choice
    assert (kept.numbers, kept.target, choice.target) == (numbers, "clamped", "clamped")
    assert kept.data.frequencies.tolist() == list(numbers)
    error = sum(part for k, part in enumerate(parts, 1) if k not in numbers)
    assert choice.error == pytest.approx(error)
    assert choice.met == (1.01 * error <= tolerance)
    by_port = {p: sum(BELONGS[k - 1] == p for k in numbers) for p in ("xy", "xz", "torsion")}
    assert choice.modes == by_port
    costs = {item.what.split()[1]: item.cost for item in choice.left_out}
    left = [k for k in range(1, 6) if k not in numbers]
    assert costs == {str(k): pytest.approx(parts[k - 1]) for k in left}
    where = {item.what.split()[1]: item.why.split()[0] for item in choice.left_out}
    assert where == {str(k): "outside" if k > told.band else "inside" for k in left}
    heaviest = [3, 5, 1, 2, 4] if told.band > 5.0 else [int(k) for k in costs]
    assert [int(k) for k in costs] == [k for k in heaviest if k in left]
    assert len(choice.cannot) == bool(left) + (not tip)
    if left:
        assert choice.cannot[0] == f"motion above {left[0]} rad/s"


def test_how_modes_of_a_file_were_added_is_told():
    choice = of_told(Told((0.1, 0.1, 5.0, 0.1, 0.5)), told_apart(SIZES, BELONGS), 0.31, {}).choice
    assert choice.reasoning == (
        'target "clamped": 1 in xy, 1 in xz, in-band error 3.00e-01',
        'chosen: target "clamped", 2 flexible modes',
        "mode 3 of the file (3 rad/s): in-band error 5.80e+00 -> 8.00e-01",
        "mode 5 of the file (5 rad/s): in-band error 8.00e-01 -> 3.00e-01",
    )
    assert choice.left_out[0].what == "mode 1 of the file (xy, 1 rad/s)"


def test_modes_of_a_file_that_another_makes_needless_go_again():
    """Mode 3 pays most, but 1 and 5, which come later, do without it."""

    class Joined(Told):
        def of_models(self, models, tolerance=None):
            del tolerance
            kept = frozenset(int(w) for w in models[0].frequencies)
            if kept >= {1, 5}:
                return 0.1
            return {frozenset(): 5.0, frozenset({3}): 2.0, frozenset({3, 5}): 1.0}.get(kept, 4.0)

    kept = of_told(Joined(()), told_apart(SIZES, BELONGS), 0.2, {})
    assert kept.numbers == (1, 5)
    assert [line.split()[1] for line in kept.choice.reasoning[2:]] == ["3", "5", "1"]
    # of a typed port its first modes are no less kept than they are
    held = of_told(Joined(()), told_apart(SIZES, BELONGS), 0.2, {"xy": 2})
    assert held.numbers == (1, 3, 5)


def test_modes_that_matter_are_found_behind_many_heavier_ones():
    """Ten modes move a heavy part along the appendage and twist it, which no rotation about z
    feels; of the two that bend it both are needed, and nothing else."""
    w = np.append(np.linspace(1.0, 1.9, 10), [1.55, 2.5])
    rows = np.zeros((12, 6))
    rows[:10, [0, 3]] = 0.9, 0.05
    rows[10, [1, 5]] = 0.5, 0.6
    rows[11, [1, 5]] = 0.3, 0.2
    data = bc.ModalData(np.diag([20.0] * 3 + [3.0, 40.0, 40.0]), w, rows, length=2.0)
    spec = bc.Spec(
        name="file",
        imported=Imported(file="f.op2"),
        damping=bc.Damping(ratio=0.01),
        root=bc.spec.Root(hub=bc.Hub(mass=50.0, inertia=(20.0, 20.0, 20.0))),
        scene=bc.Scene(bandwidth=3.0, tolerance=1e-2, axes=("z",)),
    )
    body = body_of(spec, data)
    assert body.couples
    kept = select(body)
    assert data.frequencies[[k - 1 for k in kept.numbers]].tolist() == [1.55, 2.5]
    assert (kept.choice.met, kept.choice.error) == (True, pytest.approx(0.0, abs=1e-12))


def test_many_modes_that_each_take_little_are_kept_where_they_keep_the_tolerance_together():
    """A thirtieth of the error each; 21 of them leave 0.09."""
    data = told_apart(np.arange(30.0, 0.0, -1.0) / 100.0, ("xy",) * 30)
    kept = of_told(Told((0.01,) * 30), data, 0.1, {})
    assert len(kept.numbers) == 21
    assert (kept.choice.met, kept.choice.error) == (True, pytest.approx(0.09))


def test_modes_that_are_held_do_not_stand_before_those_that_may_go():
    """Six light ones are typed; of the others, which are heavier, two do without the third."""
    belongs = ("xz",) * 6 + ("xy",) * 3
    data = told_apart([0.1] * 6 + [0.5, 0.6, 0.9], belongs)

    class Joined(Told):
        def of_models(self, models, tolerance=None):
            del tolerance
            kept = frozenset(int(w) for w in models[0].frequencies) - {1, 2, 3, 4, 5, 6}
            if kept >= {7, 8}:
                return 0.1
            return {frozenset(): 5.0, frozenset({9}): 2.0, frozenset({8, 9}): 1.0}.get(kept, 4.0)

    kept = of_told(Joined(()), data, 0.2, {"xz": 6})
    assert [line.split()[1] for line in kept.choice.reasoning[2:]] == ["9", "8", "7"]
    assert kept.numbers == (1, 2, 3, 4, 5, 6, 7, 8)


def test_beyond_six_modes_left_out_the_lightest_are_told_together():
    data = told_apart(np.arange(9, 1, -1) / 10.0, ("xy",) * 8)
    choice = of_told(Told(0.01 * np.arange(1.0, 9.0)), data, 9.0, {}).choice
    assert len(choice.left_out) == 7
    assert [item.what.split()[1] for item in choice.left_out[:-1]] == list("123456")
    assert choice.left_out[-1].what == "2 lighter modes"
    assert choice.left_out[-1].cost == pytest.approx(0.07 + 0.08)


# -- one mode more ---------------------------------------------------------------------------------
def test_one_mode_more_port_by_port():
    """Of two in xy, all of one in torsion, and none in xz and along x, where there is one."""
    section = bc.Equivalent(bending_stiffness_xy=2.0, linear_mass=1.0)
    spec = bc.Spec(segment=(bc.Segment(length=2.0, section=section),), modes=bc.Modes(xy=2))
    known = ("xy", 5), ("torsion", 1), ("xz", 3), ("axial", 1)
    full = {port: SimpleNamespace(modes=n) for port, n in known}
    counts = Kept("clamped", {"xy": 2, "torsion": 1})
    made = SimpleNamespace(spec=spec, space=None, full=full, kept=counts)
    found = [one.modes.given() for one in one_mode_more(made)]
    kept = [{port: count for port, count in one.items() if count} for one in found]
    two = {"xy": 2, "torsion": 1}
    assert kept == [{"xy": 3, "torsion": 1}, {**two, "xz": 1}, {**two, "axial": 1}]


def test_a_description_is_the_first_paragraph():
    tables = schema()["$defs"]
    assert tables["Hub"]["description"] == str(bc.Hub.__doc__).split("\n\n")[0]
    assert all(table["description"] for table in tables.values())


def test_only_one_of_a_reader_s_steps_says_that_a_body_is_almost_rigid():
    assert departs(Caution("almost-rigid", "off"))
    assert not departs(Caution("ignored-damping", "off"))
    assert not departs("almost-rigid")


# -- what is asked of a beam -----------------------------------------------------------------------
def cantilever(count, stiffness, mass, length):
    def lean(z):
        return np.cos(z) + 1.0 / np.cosh(z)

    places = [brentq(lean, k * np.pi + 1e-9, (k + 1) * np.pi, xtol=1e-14) for k in range(count)]
    return np.array(places) ** 2 * np.sqrt(stiffness / mass) / length**2


def boom(xz=1200.0, **more):
    section = bc.Equivalent(bending_stiffness_xy=400.0, bending_stiffness_xz=xz, linear_mass=1.7)
    return bc.Spec(name="boom", segment=(bc.Segment(length=3.0, section=section),), **more)


def test_a_beam_has_all_modes_up_to_25_bands():
    w = cantilever(28, 400.0, 1.7, 3.0)
    spec = boom(xz=1e9, scene=bc.Scene(bandwidth=1.03 * w[-1] / 25.0))
    found = body_of(spec).ports
    assert list(found) == ["xy", "xz"]
    assert found["xy"].frequencies[:28] == pytest.approx(w, rel=1e-9)


@pytest.mark.parametrize(
    ("more", "asked"),
    [
        ({"modes": bc.Modes(xy=3, xz=5)}, [("xy", 10), ("xz", 14)]),
        ({"scene": bc.Scene(bandwidth=2.0)}, [("xy", 16), ("xz", 16)]),
        ({"scene": bc.Scene(bandwidth=3.1)}, [("xy", 16), ("xy", 19), ("xz", 16), ("xz", 19)]),
        ({"scene": bc.Scene(bandwidth=1e3)}, [("xy", 16), ("xy", 40), ("xz", 16), ("xz", 40)]),
    ],
)
def test_as_many_modes_of_the_whole_beam_are_asked_for_as_others_are_held_against(more, asked):
    """Twice those that are stated and four; of a scene 16, or up to 40 where 25 bands have more:
    the frequency of mode k is k squared."""
    spec = boom(xz=400.0, **more)
    found = []

    def port(name, count, stations):
        if name not in ("xy", "xz"):
            raise bc.InputError("rigid.")
        found.append((name, count))
        return SimpleNamespace(frequencies=np.arange(1.0, 50.0) ** 2 / 5.0)

    read = SimpleNamespace(
        beam=SimpleNamespace(segments=spec.beam.segments, port=port),
        with_ratios=lambda _, model: model,
        **{name: getattr(spec, name) for name in ("chooses", "further", "kept", "scene")},
    )
    ports_of_beam(read)
    assert found == asked


@pytest.mark.parametrize(("inside", "counts"), [(0, (1, 1)), (3, (3, 1)), (7, (5, 1))])
def test_of_everything_modes_up_to_three_bands_are_kept_one_to_five(inside, counts):
    w = cantilever(8, 400.0, 1.7, 3.0)
    band = 0.98 * w[inside] / 3.0
    scene = bc.Scene(bandwidth=band, tolerance=0.5, axes=("z",))
    hub = bc.Hub(mass=1e6, inertia=(1e6, 1e6, 1e6))
    spec = boom(xz=1e9, scene=scene, root=bc.spec.Root(hub=hub))
    kept = everything(spec).modes
    assert (kept.xy, kept.xz) == counts
    assert not kept.torsion


def test_everything_of_imported_modes_are_all(tmp_path):
    mass = np.diag([8.0, 8.0, 8.0, 0.5, 30.0, 30.0]).tolist()
    rows = np.eye(6)[:, [1, 2]].tolist()
    modes = {"mass": mass, "frequencies": [2.0, 3.0], "participation": rows}
    (tmp_path / "modes.json").write_text(json.dumps(modes))
    imported = bc.spec.Imported(file=str(tmp_path / "modes.json"))
    spec = bc.Spec(imported=imported, scene=bc.Scene(bandwidth=1.0))
    assert everything(spec).imported.modes == (1, 2)
    for given in ({}, {"scene": bc.Scene()}):
        with pytest.raises(bc.InputError, match="nothing is left out"):
            everything(boom(**given))


def test_a_specification_as_text_reads_back_and_leaves_defaults_out():
    lump = bc.Lump(x=1.0, mass=2.0, inertia=(0.1, 0.2, 0.3))
    spec = boom(
        lump=(lump, bc.Lump(x=2.0, mass=3.0)),
        damping=bc.Damping(ratio={"xy": (0.01, 0.02)}),
        root=bc.spec.Root(hub=bc.Hub(mass=7.0, inertia=(3.0, 4.0, 5.0))),
        modes=bc.Modes(xy=2),
        scene=bc.Scene(timestep=0.01, axes=("z", "ty")),
    )
    text = spec_toml(spec)
    assert msgspec.convert(tomllib.loads(text), bc.Spec) == spec
    assert tomllib.loads(text)["lump"][1] == {"x": 2.0, "mass": 3.0}
    assert tomllib.loads(text)["segment"][0]["section"]["shape"] == "equivalent"
    assert "tolerance" not in text


@pytest.mark.parametrize(("spherical", "chosen"), [(True, "Euler"), (False, "RK4")])
def test_auto_is_euler_where_the_whole_turns_as_a_ball(spherical, chosen):
    """5.1 kg of boom about the middle of it, where the hub stands: what turns alike about all axes
    does not tumble, so that no step errs."""
    across = 1.7 * 3.0 * 3.0**2 / 12.0
    less = across if spherical else 0.5 * across
    hub = bc.Hub(mass=7.0, inertia=(9.0, 9.0 - less, 9.0 - less), offset=(-1.5, 0.0, 0.0))
    scene = bc.Scene(integrator="auto", rates=(0.9, 0.5, 0.7), timestep=0.05, tolerance=1e-6)
    spec = boom(scene=scene, root=bc.spec.Root(hub=hub))
    found = with_integrator(spec, spec.beam.rigid_mass())
    assert found.scene.integrator == chosen
    with pytest.raises(bc.InputError, match=r"add root\.hub"):
        with_integrator(boom(scene=scene), spec.beam.rigid_mass())
    stated = boom(scene=bc.Scene(integrator="implicit"))
    assert with_integrator(stated, np.eye(6)) is stated


def test_the_modes_of_a_beam_that_are_kept_stand_among_all_in_their_order():
    one, two = cantilever(3, 400.0, 1.7, 3.0), cantilever(3, 1200.0, 1.7, 3.0)
    spec = boom(modes=bc.Modes(xy=2, xz=1))
    kept = Kept("clamped", {"xy": 2, "xz": 1})
    found = exact_appendage(body_of(spec), kept, np.eye(6), 3)
    assert len(found.kept) == found.ports["xy"].modes + found.ports["xz"].modes
    both = [(w, k < 2) for k, w in enumerate(one)] + [(w, k < 1) for k, w in enumerate(two)]
    lowest = sorted(both)[:5]
    assert found.model.frequencies[:5] == pytest.approx([w for w, _ in lowest], rel=1e-9)
    assert found.kept[:5].tolist() == [kept for _, kept in lowest]
    assert found.kept.sum() == 3
    assert found.band == {"xy": pytest.approx(one[1]), "xz": pytest.approx(two[0])}


@dataclass(frozen=True)
class Stepped:
    """Off by a hundred times its step, whatever integrates it."""

    spec: bc.Spec
    kept: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(counts={}))
    full: dict = field(default_factory=dict)
    space: None = None
    in_band_error: float | None = None

    @property
    def decisive(self):
        return 100.0 * self.spec.scene.timestep


@pytest.mark.parametrize(("form", "cured"), [("hinge", True), ("modal", False), (None, False)])
def test_dampers_in_hinges_are_cured_by_those_on_modes(form, cured):
    spec = boom(damping=form and bc.Damping(ratio=0.03, form=form))
    found = with_modal_damping(spec)
    if cured:
        assert found == boom(damping=bc.Damping(ratio=0.03, form="modal"))
    else:
        assert found is None


@pytest.mark.parametrize("typed", [False, True])
@pytest.mark.parametrize("band", [None, 3.0])
def test_numbers_of_modes_that_were_typed_may_be_left_out_for_a_band(typed, band, monkeypatch):
    """In continuous time the band's error counts, or without a band that of the shortest step."""
    monkeypatch.setattr("beamchain.fitting.cure.find_cure", lambda *given: given)
    scene = bc.Scene(timestep=0.01, integrator="implicitfast", bandwidth=band, tolerance=0.02)
    made = Stepped(boom(modes=bc.Modes(xy=1) if typed else None, scene=scene), in_band_error=0.07)
    now, error, wished, _, tolerance = cure_of(made, lambda _: pytest.fail("not to be fitted"))
    assert now == ("implicitfast", 0.01, None, "")
    assert len(wished) == bool(typed and band)
    assert tolerance == (0.02 if band else None)
    assert error(now._replace(timestep=0.0)) == pytest.approx(0.07 if band else 100.0 * 1e-6)
    assert error(now._replace(timestep=0.03)) == pytest.approx(3.0)


def test_without_a_band_a_shorter_step_is_the_cure_of_a_step():
    spec = boom(modes=bc.Modes(xy=1), scene=bc.Scene(timestep=0.01, integrator="implicitfast"))
    found = cure_of(Stepped(spec), lambda _: pytest.fail("nothing else is to be fitted"))
    # below 0.1
    assert 1e-4 < found.setting.timestep < 1e-3
    assert found.error == pytest.approx(100.0 * found.setting.timestep)
    assert not found.setting.change
