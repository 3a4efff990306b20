"""Closed forms beside imported modes: their damping, their band, what a print lacks, what a port
sees of them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from beamchain import PortModel
from beamchain.chain.build import Built
from beamchain.errors import RealisationError
from beamchain.structure.readers.imported import Imported
from formulas import (
    body_of,
    chain_of_ports,
    check_body,
    compared_in_space,
    couple_ports,
    damping_of_file,
    damps_modes,
    exact_appendage,
    fillers_above,
    first_of_ports,
    kept_model,
    line_with_room,
    modes_left_out,
    numbered,
    same_planes,
    select,
    spread_mass,
    visible_modes,
    where_springs_stand,
)

MASS, LENGTH = 8.0, 5.0
RIGID = np.diag([MASS, MASS, MASS, 0.5, 70.0, 70.0])
RIGID[1, 5] = RIGID[5, 1] = MASS * 2.5
RIGID[2, 4] = RIGID[4, 2] = -MASS * 2.5
W = np.array([2.0, 3.0, 7.0, 11.0])
ROWS = np.zeros((4, 6))
ROWS[0, [1, 5]] = 2.0, 6.5
ROWS[1, [2, 4]] = 1.9, -6.4
ROWS[2, [1, 5]] = 1.1, 0.9
ROWS[3, 3] = 0.4


def data(**more):
    given = {"rigid_mass": RIGID, "frequencies": W, "participation": ROWS, "length": LENGTH}
    return bc.ModalData(**{**given, **more})


def case(of=None, numbers=(1, 2), target="clamped", hub=None, scene=None, **more):
    """A file's modes, and those of them that are kept for a target."""
    imported = Imported(file="f.op2", modes=numbers)
    root = bc.spec.Root(hub=hub)
    spec = bc.Spec(name="file", imported=imported, root=root, scene=scene, **more)
    body = body_of(spec, data() if of is None else of)
    return body, replace(select(body), target=target)


HUB = bc.Hub(mass=30.0, inertia=(20.0, 25.0, 28.0), offset=(0.4, 0.2, -0.3))


def on_hub(hub, rows, w):
    """Coupled frequencies on a hub `(6, 6)`, rigid motions left out."""
    whole = np.block([[hub + RIGID, rows.T], [rows, np.eye(len(w))]])
    squares = eigh(np.diag([0.0] * 6 + list(w**2)), whole, eigvals_only=True)
    return np.sqrt(squares[6:])


def test_a_body_ends_at_its_tip():
    assert case()[0].length == LENGTH
    section = bc.Equivalent(bending_stiffness_xy=400.0, linear_mass=1.6)
    parts = tuple(bc.Segment(length=x, section=section) for x in (1.25, 2.0))
    assert body_of(bc.Spec(segment=parts, modes=bc.Modes(xy=1))).length == 3.25


def test_fillers_stand_above_the_band_and_the_last_kept_mode_on_the_hub():
    band = bc.Scene(bandwidth=2.5)
    assert fillers_above(*case()) == 0.0
    assert fillers_above(*case(scene=band)) == 2.5
    last = on_hub(HUB.mass_matrix(), ROWS[:2], W[:2])[-1]
    assert fillers_above(*case(hub=HUB, scene=band)) == pytest.approx(last, rel=1e-9)
    free = on_hub(np.zeros((6, 6)), ROWS[:2], W[:2])[-1]
    assert free > 1.1 * last
    assert fillers_above(*case(target="free")) == pytest.approx(free, rel=1e-9)
    assert fillers_above(*case(target="free", hub=HUB)) == pytest.approx(free, rel=1e-9)
    assert fillers_above(*case(hub=HUB, scene=bc.Scene(bandwidth=50.0))) == 50.0


def test_modes_that_are_not_kept_as_they_move_some_ports():
    left = modes_left_out(*case(numbers=(1, 4)), ("xz", "xy"))
    assert left.frequencies == pytest.approx([3.0, 7.0])
    assert left.rows == pytest.approx(np.array([[1.9, 6.4, 0, 0], [0, 0, 1.1, 0.9]]))
    assert left.ports == ("xz", "xy")


def test_a_table_of_damping_goes_by_port_and_a_list_by_mode():
    table = bc.Damping(ratio={"xy": (0.01, 0.02), "torsion": (0.05,)})
    assert damping_of_file(table, data()) == pytest.approx([0.01, 0.0, 0.02, 0.05])
    listed = bc.Damping(ratio=(0.01, 0.02, 0.03, 0.04))
    assert damping_of_file(listed, data()) == pytest.approx([0.01, 0.02, 0.03, 0.04])
    assert damping_of_file(bc.Damping(ratio=0.07), data()) == pytest.approx([0.07] * 4)
    with pytest.raises(bc.InputError, match="holds 5 values, but modes has 4 modes"):
        damping_of_file(bc.Damping(ratio=(0.01,) * 5), data())


def test_the_first_modes_of_each_port():
    assert first_of_ports(data(), {"xy": 1, "torsion": 1}) == (1, 4)
    assert first_of_ports(data(), {"xz": 1, "xy": 2}) == (1, 2, 3)
    with pytest.raises(bc.InputError, match=r"modes.xz = 2, but only 1 of"):
        first_of_ports(data(), {"xz": 2})


def test_a_case_is_damped_and_keeps_what_is_stated():
    imported = Imported(file="f.op2", modes=(4, 1))
    spec = bc.Spec(name="f", imported=imported, damping=bc.Damping(ratio=0.03))
    body = body_of(spec, data())
    kept = select(body)
    assert kept.numbers == (1, 4)
    assert kept.counts == {"xy": 1, "torsion": 1}
    assert body.data.damping == pytest.approx([0.03] * 4)
    assert kept.data.frequencies == pytest.approx([2.0, 11.0])
    assert body.promise is None
    spec = bc.Spec(name="f", imported=Imported(file="f.op2"), modes=bc.Modes(xy=1, torsion=1))
    assert select(body_of(spec, data())).numbers == (1, 4)
    spec = bc.Spec(name="f", imported=Imported(file="f.op2"))
    assert select(body_of(spec, data())).numbers == (1, 2, 3, 4)
    spec = bc.Spec(name="f", imported=imported, modes=bc.Modes(xy=1))
    with pytest.raises(bc.InputError, match="both given"):
        select(body_of(spec, data()))


def test_the_promise_of_a_file_without_polar_inertia():
    """Its motions are x, y, z and the rotations about y and z; the tail of its modes is static."""
    rigid = np.array(RIGID)
    rigid[3, 3] = 0.0
    rows = np.array(ROWS)
    rows[3] = 0.0
    rows[3, [1, 5]] = 0.3, 0.1
    scene = bc.Scene(bandwidth=0.4, axes=("z", "ty", "x"))
    imported = Imported(file="f.op2", modes=(1, 2))
    spec = bc.Spec(name="f", imported=imported, scene=scene, root=bc.spec.Root(hub=HUB))
    promise = body_of(spec, data(rigid_mass=rigid, participation=rows)).promise
    live = [0, 1, 2, 4, 5]
    assert promise.motions == (0, 1, 2, 4, 5)
    assert promise.wanted == [1, 4]  # of these: "ty" and "z"
    assert promise.asked == {1, 3, 5}
    assert promise.band == 0.4
    assert promise.hubs[0] == pytest.approx(HUB.mass_matrix()[np.ix_(live, live)])
    # ratios of 0.5 % where none is stated
    assert promise.exact.damping[:3] == pytest.approx([0.005] * 3)
    assert promise.exact.frequencies[:3] == pytest.approx(W[:3], rel=1e-3)


# -- compared in space -----------------------------------------------------------------------------
@pytest.mark.parametrize("target", ["clamped", "free", "hub"])
def test_a_case_is_compared_with_the_modes_of_its_target(target):
    body, kept = case(numbers=(1, 2, 3), target=target, hub=HUB)
    full = data().space().replaced(damping=np.full(4, 0.01))
    measured = SimpleNamespace(motion=data().selected((1, 2, 3)).space(), damped_motion=full)
    found = compared_in_space(body, kept, measured)
    wanted = W[:3]
    if target != "clamped":
        hub = HUB.mass_matrix() if target == "hub" else np.zeros((6, 6))
        wanted = on_hub(hub, ROWS, W)[:3]
        assert found.target.with_hub(hub).free_frequencies == pytest.approx(wanted, rel=1e-9)
    else:
        assert found.target.frequencies == pytest.approx(wanted)
        assert found.error.frequency == pytest.approx(0.0, abs=1e-12)
    assert found.live == (0, 1, 2, 3, 4, 5)
    assert found.numbers == (1, 2, 3)
    assert found.full.modes == 4


def test_the_error_of_a_case_is_that_of_damped_modes_on_its_hub():
    """A mode of x alone, on a hub whose centre is on the axis: one motion by itself."""
    rows = np.array([[1.8, 0.0, 0.0, 0.0, 0.0, 0.0]])
    of = data(frequencies=W[:1], participation=rows, damping=np.array([0.02]))
    hub = bc.Hub(mass=30.0, inertia=(20.0, 25.0, 28.0), offset=(0.4, 0.0, 0.0))
    body, kept = case(of, numbers=(1,), hub=hub, scene=bc.Scene(bandwidth=3.0))
    stiffer = of.space().replaced(frequencies=W[:1] * 1.05)
    measured = SimpleNamespace(motion=stiffer, damped_motion=stiffer)
    found = compared_in_space(body, kept, measured)
    s = 1j * np.linspace(1e-3, 3.0, 20_001)

    def accelerance(w):
        return 1.0 / (30.0 + MASS - 1.8**2 * s**2 / (s**2 + 0.04 * w * s + w**2))

    true = accelerance(2.0)
    # the largest of all motions, on this hub of the others too, which have no modes
    size = np.maximum(np.abs(true) * (30.0 + MASS), floor(hub))
    wanted = np.max(np.abs(accelerance(2.1) - true) * (30.0 + MASS) / size)
    assert found.error.accelerance_in_band == pytest.approx(wanted, rel=1e-4)
    assert found.error.frequency == pytest.approx(0.05)


def floor(hub):
    whole = hub.mass_matrix() + RIGID
    scale = np.sqrt(np.diag(whole))
    return np.linalg.norm(np.linalg.inv(whole) * np.outer(scale, scale), 2)


@pytest.mark.parametrize("target", ["hub", "free"])
def test_modes_for_a_target_are_the_lowest_of_their_port(target):
    def kept(*numbers):
        imported = Imported(file="f.op2", modes=numbers)
        root = bc.spec.Root(hub=HUB, target=target)
        return select(body_of(bc.Spec(name="f", imported=imported, root=root), data())).numbers

    assert kept(1, 4) == (1, 4)
    assert kept(1, 2, 3) == (1, 2, 3)
    with pytest.raises(bc.InputError, match=r"here \[1, 4\]"):
        kept(3, 4)


def test_a_scene_whose_axes_nothing_moves_has_no_steps_to_choose():
    rigid, rows = np.array(RIGID), np.array(ROWS)
    rigid[3, 3], rows[3] = 0.0, [0.0, 0.3, 0.0, 0.0, 0.0, 0.1]
    scene = bc.Scene(axes=("x",), bandwidth=2.0)
    made = bc.fit(data(rigid_mass=rigid, participation=rows), modes={"xy": 1}, scene=scene)
    assert made.steps == ()
    assert not any(one.code.startswith("step") for one in made.warnings)


# -- prints ----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("most", "grown"), [(0.99, 1.0), (1.0, 1.0), (1.05, 1.06), (1.0999, 1.11988), (1.11, 1.0)]
)
def test_a_line_grows_by_what_the_modes_ask_for_and_a_fifth_of_it(most, grown):
    """Participation along a column of the mass matrix: its square is a share of the diagonal."""
    line = spread_mass(RIGID, LENGTH)
    line = replace(line, bodies=np.array([[4.0, 0.3, 0.01, 0.02, 0.03]]))
    own = line.behind(np.array([-LENGTH]))[0]
    rows = np.sqrt(most / own[5, 5]) * own[5:6]
    kept = SimpleNamespace(modes=1, live=[0, 1, 2, 3, 4, 5], participation=rows)
    found = line_with_room(line, kept)
    assert found.rigid == pytest.approx(grown * RIGID, rel=1e-9)
    assert found.bodies[0] == pytest.approx([4.0, *(grown * line.bodies[0, 1:])], rel=1e-9)
    edges = [0.0, 0.7 * LENGTH, LENGTH]
    assert found.moments(edges) == pytest.approx(grown * line.moments(edges), rel=1e-9)
    assert (found is line) == (grown == 1.0)
    assert line_with_room(line, SimpleNamespace(modes=0)) is line


def test_a_line_grows_where_a_small_inertia_asks_for_it():
    """0.05 kg m^2 about x, of which a mode takes 1.05 times as much."""
    rigid = np.array(RIGID)
    rigid[3, 3] = 0.05
    line = spread_mass(rigid, LENGTH)
    own = line.behind(np.array([-LENGTH]))[0]
    rows = np.sqrt(1.05 / own[3, 3]) * own[3:4]
    kept = SimpleNamespace(modes=1, live=[0, 1, 2, 3, 4, 5], participation=rows)
    assert line_with_room(line, kept).rigid == pytest.approx(1.06 * rigid, rel=1e-9)


def departing(by):
    rigid = np.array(RIGID)
    rigid[2, 2] = MASS * (1.0 + by)
    return SimpleNamespace(rigid_mass=rigid, source="f.op2")


@pytest.mark.parametrize(
    ("precision", "most"),
    [
        # 3 precisions, and 4 times the smaller of 20 precisions and 1e-5
        (1e-8, 3e-8 + 8e-7),
        (1e-6, 3e-6 + 4e-5),
        (1e-14, 1e-9),
    ],
)
@pytest.mark.parametrize("file", ["f.op2", "f.op4"])
def test_a_mass_that_depends_on_direction_by_more_than_the_print_is_refused(precision, most, file):
    # beside the mean mass m (1 + d / 3) the third is m (1 + d): 2 d / 3 more
    for part, kept in ((0.99, True), (1.01, False)):
        given = departing(1.5 * part * most)
        given.precision, given.source = precision, file
        if kept:
            check_body(given)
        else:
            cure = "a-set holds" if file == "f.op4" else "PARAM,GRDPNT"
            with pytest.raises(RealisationError, match=cure):
                check_body(given)


@pytest.mark.parametrize(("part", "seen"), [(2e-6, True), (0.5e-6, False)])
def test_a_port_sees_modes_that_move_it_by_more_than_a_millionth(part, seen):
    rows = np.array(ROWS)
    rows[0, 2] = part * np.hypot(rows[0, 1] / np.sqrt(MASS), rows[0, 5] / np.sqrt(70.0))
    rows[0, 2] *= np.sqrt(MASS)
    found = visible_modes(data(participation=rows), "xz")
    assert found.frequencies == pytest.approx([2.0, 3.0] if seen else [3.0])
    assert visible_modes(data(participation=rows), "xy").frequencies == pytest.approx([2.0, 7.0])


def plane(mass=1.0, frequency=1.0, row=1.0, count=2):
    rigid = np.array([[8.0, 20.0], [20.0, 70.0]])
    rigid[1, 1] *= mass
    rows = np.array([[2.0, 6.5], [1.1, 0.9]])[:count]
    rows[0, 1] *= row
    return PortModel(rigid, np.array([2.0 * frequency, 7.0])[:count], rows)


@pytest.mark.parametrize(
    ("given", "off"),
    [
        ({"frequency": 1.0 / (1.0 + 1e-3)}, 1e-3),
        ({"frequency": 1.0 / (1.0 - 1e-3)}, 1e-3),
        ({"row": 1.0 + 1e-3}, 6.5e-3 / np.sqrt(70.0)),  # over the root of the first plane's mass
        ({"row": 1.0 - 1e-3}, 6.5e-3 / np.sqrt(70.0)),
        ({"mass": 1.0 + 1e-3}, 1e-3),
        ({"mass": 1.0 - 1e-3}, 1e-3),
    ],
)
def test_planes_that_agree_within_the_print_become_one(given, off):
    for part, one in ((1.001, True), (0.999, False)):
        targets = {"xy": plane(), "xz": plane(**given)}
        same_planes(targets, part * off)
        same = targets["xz"].frequencies, targets["xz"].participation, targets["xz"].rigid_mass
        wanted = plane() if one else plane(**given)
        assert same[0] == pytest.approx(wanted.frequencies, rel=1e-14)
        assert same[1] == pytest.approx(wanted.participation, rel=1e-14)
        assert same[2] == pytest.approx(wanted.rigid_mass, rel=1e-14)


def test_planes_with_unequal_numbers_of_modes_stay():
    targets = {"xy": plane(), "xz": plane(count=1)}
    same_planes(targets, 1.0)
    assert targets["xz"].modes == 1
    alone = {"xz": plane(), "torsion": plane()}
    same_planes(alone, 1.0)
    assert list(alone) == ["xz", "torsion"]


@pytest.mark.parametrize(
    ("form", "springs", "step", "integrator", "sensed", "stand", "damped"),
    [
        (None, "auto", None, "Euler", False, "auto", True),  # the file's own ratios
        ("modal", "auto", None, "Euler", False, "auto", True),
        ("hinge", "auto", None, "Euler", False, "auto", False),
        ("hinge", "auto", 0.01, "implicitfast", False, "modes", False),
        ("hinge", "modes", 0.01, "implicitfast", False, "modes", False),
        ("hinge", "hinges", 0.01, "implicitfast", False, "hinges", False),
        ("hinge", "auto", None, "Euler", True, "modes", False),
        ("hinge", "auto", 0.01, "RK4", False, "auto", False),
        ("hinge", "auto", 1.0, "RK4", False, "modes", False),  # too fast for it
    ],
)
def test_a_mode_takes_a_tendon_to_be_damped_timed_or_sensed(
    form, springs, step, integrator, sensed, stand, damped
):
    spec = bc.Spec(
        name="file",
        imported=Imported(file="f.op2"),
        damping=form and bc.Damping(ratio=0.01, form=form),
        fit=bc.spec.FitOptions(springs=springs),
        sensors=bc.spec.Sensors(modes=sensed),
        scene=step and bc.Scene(timestep=step, integrator=integrator),
    )
    body = body_of(spec, data(damping=np.full(4, 0.01)))
    assert where_springs_stand(body, select(body)) == stand
    assert damps_modes(body, select(body)) is damped
    bare = body_of(spec.replace(damping=bc.Damping(ratio=0.0)), data())
    assert not damps_modes(bare, select(bare))


def test_hinge_dampers_are_there_once_where_a_step_takes_tendons():
    damping = bc.Damping(ratio=0.01, form="hinge")
    scene = bc.Scene(timestep=0.01, integrator="implicitfast")
    made = bc.fit(data().selected((1, 3)), damping=damping, scene=scene)
    assert [row.damping_ratio for row in made.modes] == pytest.approx([0.01, 0.01], rel=1e-9)
    assert made.tendon_sprung
    assert not made.tendon_damped


def test_the_exact_appendage_of_imported_modes_has_six_motions():
    light, rows = 0.01 * RIGID, 0.1 * ROWS[[0, 2]]
    light[3, 3] = 0.0
    of = data(rigid_mass=light, frequencies=W[[0, 2]], participation=rows, damping=[0.01, 0.02])
    body, _ = case(of)
    assert body.live == (0, 1, 2, 4, 5)
    found = exact_appendage(body, numbered(body, (2,)), 3.0 * np.eye(6))
    rigid = np.array(light)
    rigid[3, 3] = 3.0  # what the file has not
    assert np.array_equal(found.model.rigid_mass, rigid)
    assert np.array_equal(found.model.participation, rows)
    assert found.model.damping.tolist() == [0.01, 0.02]
    assert found.kept.tolist() == [False, True]
    assert found.band == {"space": 7.0}
    # before there is a chain, a trace of the largest inertia
    rigid[3, 3] = 1e-9 * 0.7
    assert exact_appendage(body, numbered(body, (2,))).model.rigid_mass == pytest.approx(rigid)


def test_what_turns_without_inertia_gets_some_before_there_is_a_chain():
    """In numbers its mass; a chain knows better."""
    mass, rows = np.diag([MASS] * 3 + [0.0] * 3), 2.0 * np.eye(6)[:1]
    of = data(rigid_mass=mass, frequencies=W[:1], participation=rows)
    body, kept = case(of, numbers=(1,))
    for found in (exact_appendage(body, kept).model, kept_model(body, kept)):
        assert found.rigid_mass == pytest.approx(np.diag([MASS] * 6))
        assert np.array_equal(found.participation, rows)
    chain = np.diag([1.0, 1.0, 1.0, 0.1, 0.2, 0.3])
    found = exact_appendage(body, kept, chain).model.rigid_mass
    assert found == pytest.approx(np.diag([MASS] * 3 + [0.1, 0.2, 0.3]))


BALL = bc.Hub(mass=30.0, inertia=(20.0, 25.0, 28.0))  # couples no ports


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("target", ["clamped", "free", "hub"])
def test_a_model_of_the_kept_modes_is_exact_for_their_target(target, coupled):
    """Clamped they are those of the file; else the lowest on the hub are those of all modes, of
    independent ports in each."""
    rows = np.array(ROWS)
    rows[1, 3] = 0.2 * coupled
    of = data(participation=rows, damping=np.array([0.01, 0.02, 0.03, 0.04]))
    found = kept_model(*case(of, target=target, hub=BALL))
    assert found.rigid_mass == pytest.approx(RIGID)
    if target == "clamped":
        assert found.frequencies.tolist() == [2.0, 3.0]
        assert np.array_equal(found.participation, rows[:2])
        assert found.damping.tolist() == [0.01, 0.02]
        return
    hub = BALL.mass_matrix() if target == "hub" else np.zeros((6, 6))
    if coupled:
        wanted = on_hub(hub, rows, W)[:2]
    else:
        wanted = np.sort([on_hub(hub, rows[own], W[own])[0] for own in ([0, 2], [1])])
    assert found.with_hub(hub).free_frequencies == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("target", ["clamped", "free"])
def test_what_separate_ports_ask_of_their_chain(target, monkeypatch):
    """Per port its own modes, clamped or on its hub, here on none."""
    monkeypatch.setattr("beamchain.fitting.realise.build_exact", lambda *asked: asked)
    of = data(damping=np.array([0.01, 0.02, 0.03, 0.04]))
    fit = bc.spec.FitOptions(springs="modes", cuts=(0.7,))
    given = case(of, (1, 2, 4), target, scene=bc.Scene(bandwidth=50.0), fit=fit)
    line, counts, target_of, wishes = chain_of_ports(*given, "line")
    assert (line, counts) == ("line", {"xy": 1, "xz": 1, "torsion": 1})
    assert (wishes.springs, wishes.per_mode, wishes.lines) == ("modes", True, (0.7,))
    assert (wishes.band, wishes.neutral) == (50.0, target == "free")
    rest = {port: group.frequencies.tolist() for port, group in wishes.left_out.items()}
    assert rest["xy"] == [7.0]
    assert wishes.left_out["xy"].rows == pytest.approx(np.array([[1.1, 0.9]]))
    found = target_of("xy", 1)
    assert found.damping.tolist() == [0.01]
    if target == "clamped":
        assert found.frequencies.tolist() == [2.0]
    else:  # the lower free mode of both in the plane
        rows, own = ROWS[np.ix_([0, 2], [1, 5])], RIGID[np.ix_([1, 5], [1, 5])]
        free = np.eye(2) - rows @ np.linalg.solve(own, rows.T)
        lowest = np.sqrt(eigh(np.diag([4.0, 49.0]), free, eigvals_only=True)[0])
        assert found.free_frequencies == pytest.approx([lowest], rel=1e-9)


@pytest.mark.parametrize("target", ["clamped", "free"])
def test_what_coupled_ports_ask_of_their_chain(target, monkeypatch):
    """Of two groups: the modes of each by number, damping, weight and rigid mass, and the modes
    that are left out."""
    coupled = np.array(ROWS)
    coupled[1, 3] = 0.2
    of = data(participation=coupled, damping=np.array([0.01, 0.02, 0.03, 0.04]))
    asked = []

    def cut_chain(line, groups, lines, most_added):
        asked.extend([line, groups, lines, most_added])
        return Built("chain", {}, "so", cut="cut")

    monkeypatch.setattr("beamchain.fitting.realise.cut_chain", cut_chain)
    kept = case(of, (1, 2, 4), target, scene=bc.Scene(bandwidth=50.0))
    built = couple_ports(*kept, "line", 3)
    line, groups, lines, most_added = asked
    assert (line, lines, most_added) == ("line", (), 3)
    assert (built.chain, built.cut, list(built.targets)) == (
        "chain", "cut", ["xy", "xz", "torsion"],
    )  # fmt: skip
    plane, both = sorted(groups, key=lambda group: len(group.ports))
    assert (plane.ports, both.ports) == (("xy",), ("xz", "torsion"))
    assert [(group.band, group.neutral) for group in groups] == [(50.0, target == "free")] * 2
    # part of each port in the squares of participation, over the rigid mass
    along = 1.9**2 / MASS + 6.4**2 / 70.0
    twist = 0.2**2 / 0.5
    if target == "clamped":
        assert (plane.numbers, both.numbers) == ((1,), (2, 3))
        assert (plane.damping.tolist(), both.damping.tolist()) == ([0.01], [0.02, 0.04])
        share = along / (along + twist)
        assert both.weights == pytest.approx({"xz": share, "torsion": 1.0 + 1.0 - share})
        assert both.frequencies.tolist() == [3.0, 11.0]
        assert both.rows == pytest.approx(np.array([[1.9, 6.4, 0.2], [0.0, 0.0, 0.4]]))
    rigid = np.array([[MASS, MASS * 2.5, 0.0], [MASS * 2.5, 70.0, 0.0], [0.0, 0.0, 0.5]])
    assert both.rigid == pytest.approx(rigid)
    assert plane.left_out.frequencies.tolist() == [7.0]
    assert plane.left_out.rows == pytest.approx(np.array([[1.1, 0.9]]))
    assert both.left_out.rows == pytest.approx(np.zeros((1, 3)))
