"""Closed forms beside what an appendage would be with one mode more or one less: modes of a file,
which couple ports or do not, and ports of a beam beyond those that are kept."""

from types import SimpleNamespace

import numpy as np
import pytest

import beamchain as bc
from beamchain.structure.readers.imported import Imported
from formulas import Body, Candidate, Kept, body_of, free_ports, numbered, of_ports

FILE = np.array([3.0, 3.1, 3.2, 3.3, 4.0])  # rad/s
MASS = np.diag([9.0] * 3 + [1.0] * 3)
SCENE = bc.Scene(bandwidth=4.5)


def data(coupled):
    """Two planes; of `coupled` ones the fourth mode twists as well."""
    sizes = np.array([0.1, 0.9, 0.3, 0.5, 0.2])
    rows = sizes[:, None] * np.eye(6)[[1, 1, 2, 1, 2]]
    if coupled:
        rows[3, 3] = 0.02
    return bc.ModalData(MASS, FILE, rows, length=2.0)


def of_file(coupled, numbers, scene=None, hub=50.0, typed=None, **imported):
    """Some modes of a file on a hub."""
    root = bc.spec.Root(hub=hub and bc.Hub(mass=hub, inertia=(7.0, 7.0, 7.0)))
    read = Imported(file="f.op2", **imported)
    spec = bc.Spec(name="file", imported=read, root=root, scene=scene, modes=typed)
    body = body_of(spec, data(coupled))
    return Candidate(body, numbered(body, numbers))


# -- one more --------------------------------------------------------------------------------------
@pytest.mark.parametrize("band", [2.0, 4.5])
def test_modes_of_a_file_that_are_tried_are_those_that_move_the_hub_most(band):
    """Sizes by their participation, of which resonances in the band count most."""
    made = of_file(True, (1, 3))
    assert (made.modes, made.added, made.measured) == (2, "", None)
    found = made.offers(band)
    assert list(found) == ["2", "4", "5"]
    assert found["4"].kept.numbers == (1, 3, 4)
    assert (found["4"].modes, found["4"].measured) == (3, None)
    assert found["5"].newest == 4.0
    assert found["5"].added == "mode 5 of the file (4 rad/s)"
    assert found["5"].stated.imported.modes == (1, 3, 5)
    assert found["5"].stated.modes is None
    assert found["4"].model.frequencies.tolist() == [3.0, 3.2, 3.3]
    assert made.part("2") == made.part("5")  # an offer adds to all of them
    assert made.without(made.part("2")).frequencies.tolist() == [3.0, 3.2]
    assert of_file(True, (1, 3), modes=(1, 3)).offers(band) == {}


@pytest.mark.parametrize("scene", [None, SCENE])
def test_modes_of_a_file_that_keep_to_their_ports_are_offered_port_by_port(scene):
    made = of_file(False, (1, 3), scene)
    found = made.offers(4.5)
    assert {port: one.kept.numbers for port, one in found.items()} == {
        "xy": (1, 2, 3),
        "xz": (1, 3, 5),
    }
    assert {port: one.newest for port, one in found.items()} == {"xy": 3.1, "xz": 4.0}
    assert found["xy"].kept.counts == {"xy": 2, "xz": 1}
    assert found["xz"].model.frequencies.tolist() == [3.0, 3.2, 4.0]
    assert made.part("xz") == "xz"
    assert made.without("xz").frequencies.tolist() == [3.0, 3.1, 3.2, 3.3]
    assert made.without("xy").frequencies.tolist() == [3.0, 3.2, 4.0]
    assert list(found["xz"].offers(4.5)) == ["xy"]  # the file has no more in the other


def test_a_free_root_is_offered_no_mode_that_it_has_not():
    """With all inertia about x behind one spring nothing is left to swing against."""
    rows = np.eye(6)[[3, 1]]
    body = body_of(
        bc.Spec(name="rotor", imported=Imported(file="f.op2")),
        bc.ModalData(MASS, FILE[:2], rows, length=2.0),
    )
    assert list(Candidate(body, of_ports(body, {}, "free")).offers(9.0)) == ["xy"]
    assert list(Candidate(body, of_ports(body, {})).offers(9.0)) == ["xy", "torsion"]


@pytest.mark.parametrize("coupled", [True, False])
def test_typed_ports_are_never_offered(coupled):
    """Nor by a mode that belongs there and moves another port as well."""
    made = of_file(coupled, (1, 3), SCENE, typed=bc.Modes(xy=1))
    assert list(made.offers(4.5)) == (["5"] if coupled else ["xz"])
    both = of_file(coupled, (1, 3), SCENE, typed=bc.Modes(xy=1, xz=1))
    assert both.offers(4.5) == {}
    assert free_ports(both.body.spec) == ("torsion", "axial")
    # where no scene chooses, a count in one port states them all
    assert free_ports(of_file(coupled, (1,), typed=bc.Modes(xy=1)).body.spec) == ()


def test_no_more_than_the_heaviest_are_tried_at_a_time(monkeypatch):
    monkeypatch.setattr("beamchain.fitting.candidate.TRIED", 2)
    assert list(of_file(True, (1,)).offers(4.5)) == ["2", "4"]
    assert list(of_file(True, (1, 2)).offers(4.5)) == ["4", "3"]
    # a specification names so many at most
    monkeypatch.setattr("beamchain.fitting.candidate.MOST_NAMED", 3)
    assert list(of_file(True, (1, 2, 3)).offers(4.5)) == []


def test_weights_are_on_a_light_hub_where_none_is_stated():
    """A tenth of the appendage's own mass: shares of 9.9 kg and 1.1 kg m^2, in the band at peaks
    of 1 / (2 * 0.005)."""
    sizes = np.array([0.1, 0.9, 0.3, 0.5, 0.2])
    wanted = sizes**2 / 9.9 + [0.0, 0.0, 0.0, 0.02**2 / 1.1, 0.0]
    found = of_file(True, (1,), hub=None).weights(9.0)
    assert found / found[0] == pytest.approx(wanted / wanted[0], rel=1e-6)
    on_hub = of_file(True, (1,)).weights(9.0)
    share = sizes**2 / 59.0 + [0.0, 0.0, 0.0, 0.02**2 / 8.0, 0.0]
    assert on_hub / found == pytest.approx(share / wanted, rel=1e-6)


@pytest.mark.parametrize("coupled", [True, False])
def test_the_rigid_mass_of_imported_modes_is_that_of_the_file(coupled):
    """A chain of few ports may miss some."""
    made = of_file(coupled, (1,))
    offer = "4" if coupled else "xz"
    for model in (
        made.model,
        made.exact.model,
        made.without(made.part(offer)),
        made.offers(9.0)[offer].model,
    ):
        assert model.rigid_mass.tolist() == MASS.tolist()


def test_what_mujoco_has_stands_for_the_modes_that_are_kept_alone():
    made = of_file(False, (1, 3))
    measured = Candidate(made.body, made.kept, "measured")
    assert measured.model == "measured"
    assert measured.offers(4.5)["xy"].model.frequencies.tolist() == [3.0, 3.1, 3.2]
    assert measured.dropping("xy", of_ports(made.body, {})).model.frequencies.tolist() == [3.2]


def test_a_port_that_is_not_kept_has_modes_beyond_those_asked_for():
    """Twice as many and four, that points further out are read with; damped as the rest is."""
    asked = []

    def port(*given):
        asked.append(given)
        if given[0] == "axial":
            raise bc.InputError("rigid.")
        return "modes"

    spec = SimpleNamespace(
        beam=SimpleNamespace(port=port),
        further={"b": 2.0, "a": 1.0},
        with_ratios=lambda port, model: (port, model),
    )
    known = SimpleNamespace(modes=5)
    body = Body(spec, {"xy": known})
    assert body.with_modes("xy", 3) is body
    assert body.with_modes("xy", 5) is body
    assert body.with_modes("xy", 6) is None
    assert asked == []
    more = body.with_modes("xz", 3)
    assert (more.ports, more.spec) == ({"xy": known, "xz": ("xz", "modes")}, spec)
    assert body.with_modes("axial", 1) is None
    assert asked == [("xz", 10, [2.0, 1.0]), ("axial", 6, [2.0, 1.0])]
    # a file has no more than it has
    imported = Body(spec, {"xy": known}, "data")
    assert imported.with_modes("xz", 1) is None
    assert imported.with_modes("xy", 6) is None
    assert imported.with_modes("xy", 5) is imported
    assert len(asked) == 2


# -- one less --------------------------------------------------------------------------------------
def boom(**more):
    section = bc.Equivalent(bending_stiffness_xy=400.0, bending_stiffness_xz=300.0, linear_mass=1.6)
    return bc.Spec(name="boom", segment=(bc.Segment(length=5.0, section=section),), **more)


def test_the_last_mode_of_a_port_goes_down_to_the_least():
    body = body_of(boom(scene=bc.Scene(bandwidth=5.0), modes=bc.Modes(xz=1)))
    least = Kept("clamped", {"xy": 1, "xz": 1})
    now = Candidate(body, Kept("clamped", {"xy": 3, "xz": 1}), "measured")
    assert now.droppable(5.0, least) == ("xy", "torsion", "axial")  # whose number was not typed
    less = now.dropping("xy", least)
    assert (less.kept.counts, less.kept.target) == ({"xy": 2, "xz": 1}, "clamped")
    assert less.measured is None
    wanted = [1.8751040687**2 * np.sqrt(stiff / 1.6) / 25.0 for stiff in (300.0, 400.0)]
    assert less.model.frequencies[:2] == pytest.approx(wanted, rel=1e-6)
    assert less.model.labels == ("xz", "xy", "xy")
    last = less.dropping("xy", least)
    assert last.kept.counts == {"xy": 1, "xz": 1}
    assert last.dropping("xy", least) is None
    assert last.dropping("xz", least) is None
    assert last.dropping("torsion", least) is None
    # with nothing to be kept the port becomes rigid
    none = Kept("clamped", {})
    assert last.dropping("xy", none).kept.counts == {"xz": 1}
    assert last.dropping("xy", none).dropping("xy", none) is None
    on_hub = Candidate(body, Kept("free", {"xy": 2}))
    assert on_hub.dropping("xy", none).kept.target == "free"


def test_the_last_mode_of_a_file_s_port_goes():
    made = of_file(False, (1, 2, 3, 4), SCENE)
    none = of_ports(made.body, {})
    assert none.numbers == ()
    assert made.droppable(4.5, none) == ("xy", "xz", "torsion", "axial")
    less = made.dropping("xy", none)
    assert (less.kept.numbers, less.kept.counts) == ((1, 2, 3), {"xy": 2, "xz": 1})
    assert less.model.frequencies.tolist() == [3.0, 3.1, 3.2]
    assert less.dropping("xz", none).kept.numbers == (1, 2)
    assert less.dropping("xz", of_ports(made.body, {"xz": 1})) is None
    assert less.dropping("torsion", none) is None


def test_of_modes_that_couple_ports_any_goes_but_the_least():
    made = of_file(True, (1, 2, 4, 5), SCENE)
    # by 0.1, 0.2, 0.5 and 0.9: the lightest first
    assert made.droppable(4.5, numbered(made.body, ())) == ("1", "5", "4", "2")
    least = numbered(made.body, (2, 5))
    assert made.droppable(4.5, least) == ("1", "4")
    assert made.dropping("5", least) is None
    less = made.dropping("1", least)
    assert (less.kept.numbers, less.kept.counts) == ((2, 4, 5), {"xy": 2, "xz": 1})
    assert less.dropping("1", least) is None  # which is gone already
    assert less.dropping("4", least).kept.numbers == (2, 5)
    bare = numbered(made.body, ())
    rigid = of_file(True, (3,), SCENE).dropping("3", bare)
    assert (rigid.kept.numbers, rigid.kept.counts, rigid.model.modes) == ((), {}, 0)


def test_the_lightest_modes_are_tried_without_and_no_others(monkeypatch):
    monkeypatch.setattr("beamchain.fitting.candidate.LIGHTEST", 2)
    made = of_file(True, (1, 2, 3, 4, 5), SCENE)
    assert made.droppable(4.5, numbered(made.body, ())) == ("1", "5")


def test_no_pendulum_of_a_liquid_goes():
    tank = bc.spec.Slosh(
        shape="cylinder", radius=0.6, height=0.9, density=800.0, ratio=0.01, acceleration=2.5
    )
    body = body_of(bc.Spec(name="tank", slosh=tank))
    assert Candidate(body, numbered(body, (1, 2, 3, 4))).droppable(9.0, None) == ()
    assert free_ports(body.spec) == ()
