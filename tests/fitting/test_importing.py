"""Imported modes through the whole walk, as chains: a printed cantilever, a plate,
round trips of beams, files and words."""

import mujoco
import numpy as np
import pytest

from appendages import (
    panels,
    soft_root_boom,
    tapered_boom,
    timoshenko_boom,
    tip_loaded_boom,
)
from beamchain import (
    Beam,
    Damping,
    Equivalent,
    Hub,
    ModalData,
    PortModel,
    Segment,
    compare,
    embed,
    fit,
    read_spec,
)
from beamchain.spec import FitOptions, Root
from modes_of_beam import modes_of_beam, modes_text
from prints import cantilever, plate, whole
from spec_tables import spec_of
from written_chain import read_chain

PRINT = 5e-7  # half a unit in the seventh printed digit
ROUND_TRIP = 1e-9  # the bound
MUJOCO = 1e-8  # mjd_transitionFD with eps = 1e-6


def printed_cantilever(turn: float = 0.0, **more) -> ModalData:
    truth = cantilever(turn)
    return ModalData(
        truth.mass, truth.frequencies, truth.participation, precision=PRINT, length=1.0, **more
    )


# -- a printed cantilever --------------------------------------------------------------------------
@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_a_printed_cantilever_comes_back_through_mujoco(turn):
    result = fit(printed_cantilever(turn))
    assert result.status.ok
    truth = cantilever()
    space = result.space.achieved
    assert space.frequencies == pytest.approx(np.sort(truth.frequencies), rel=PRINT)
    rows = {port: np.abs(result.achieved[port].participation) for port in ("xy", "xz")}
    for port in rows:
        for expected in ([3.462030, 2.774607], [1.979560, 0.5036983]):
            assert min(np.max(np.abs(row / expected - 1.0)) for row in rows[port]) < 3 * PRINT
    assert np.max(np.abs(result.achieved["axial"].participation)) == pytest.approx(
        3.930588, rel=PRINT
    )
    mass = result.measured.rigid_mass
    assert mass[0, 0] == pytest.approx(21.20575, rel=PRINT)
    residual = mass[1, 1] - np.sum(result.achieved["xy"].participation[:, 0] ** 2)
    assert residual == pytest.approx(5.30144, abs=2e-5)  # lumped at the clamped node


def test_a_printed_cantilever_is_a_chain_with_its_hinge_at_the_root():
    result = fit(printed_cantilever())
    assert result.chain.hinges[0].x == 0.0
    assert result.chain.links[0].length == 0.0
    assert result.chain.mass == pytest.approx(21.20575, rel=1e-9)
    assert "independent" in result.status.message
    assert result.space.error.accelerance_in_band < 1e-7
    assert all(
        np.isfinite(step) and step > 0
        for name, step in result.limits.largest_step.items()
        if name != "discrete"
    )


def test_a_root_hinge_by_hand():
    """A pendulum bar on a root spring: W^2 = c / J with the root held;
    the root's own mass is a point."""
    point, mass, at, inertia, c = 2.0, 3.0, 0.7, 0.5, 40.0
    about = inertia + mass * at**2
    reach = about / (mass * at)  # centre of percussion
    for x in (0.0, 0.3):  # and the same hinge 0.3 m out
        total = point + mass
        first = point * x + mass * (at + x)
        second = point * x**2 + mass * (at + x) ** 2 + inertia
        rigid = np.diag([total, total, total, 1e-3, second, second])
        rigid[1, 5] = rigid[5, 1] = first
        rigid[2, 4] = rigid[4, 2] = -first
        row = np.zeros((1, 6))
        row[0, [1, 5]] = np.array([mass * at, about + x * mass * at]) / np.sqrt(about)
        data = ModalData(rigid, np.array([np.sqrt(c / about)]), row)
        chain = read_chain(fit(data, modes={"xy": 1}).to_mjcf())
        masses, lengths, stiffness = chain.nodes()
        # what the mode leaves: the point, and the part of the bar's mass that stays
        # behind, at the hinge
        assert [hinge.x for hinge in chain.hinges] == pytest.approx([x], rel=1e-9, abs=1e-12)
        assert masses[0] == pytest.approx(0.0, abs=1e-12)
        assert lengths == pytest.approx([x, reach], rel=1e-9, abs=1e-12)
        assert stiffness == pytest.approx([c], rel=1e-9 if x else 1e-12)
        assert masses[2] == pytest.approx(about / reach**2, rel=1e-10)


# -- the plate -------------------------------------------------------------------------------------
@pytest.fixture
def print_of_the_plate(tmp_path):
    path = tmp_path / "plate.f06"
    path.write_text(whole(plate().in_units(1e-3, 1e3), rows=9), newline="")
    return {"file": str(path), "units": {"length": 1e-3, "mass": 1e3}}


@pytest.mark.slow
def test_all_21_modes_of_the_plate_through_mujoco(print_of_the_plate):
    result = fit(
        spec_of({"name": "plate", "imported": print_of_the_plate, "damping": {"ratio": 0.005}})
    )
    assert result.status.ok
    assert [t.label for t in result.chain.tendons if t.is_mode] == [
        f"mode{k}" for k in range(1, 22)
    ]
    truth = plate()
    space = result.space.achieved
    assert space.modes >= 21
    assert np.all(space.frequencies[21:] > 1.5 * space.frequencies[20])
    assert space.frequencies[:21] == pytest.approx(truth.frequencies, rel=PRINT)
    scale = np.sqrt(np.diag(truth.mass))
    rows = space.participation[:21]
    sign = np.sign(np.sum(rows * truth.participation / scale**2, axis=1))
    gap = np.abs(rows * sign[:, None] - truth.participation) / scale
    assert gap.max() < PRINT
    assert result.space.error.frequency < 1e-9  # and of the numbers that were read
    assert result.space.error.participation < 1e-7
    assert np.max(np.abs(space.rigid_mass - truth.mass) / np.outer(scale, scale)) < 2e-6
    assert space.damping[:21] == pytest.approx(np.full(21, 0.005), rel=1e-5)
    # 6 x 6, at any frequency, against the definition with the numbers before printing
    reference = PortModel(truth.mass, truth.frequencies, truth.participation, np.full(21, 0.005))
    omega = np.geomspace(1.0, 2e4, 60)
    difference = (space.D(omega) - reference.D(omega)) / np.outer(scale, scale)[:, :, None]
    assert np.max(np.abs(difference)) < 1e-3 * np.max(
        np.abs(reference.D(omega) / np.outer(scale, scale)[:, :, None])
    )
    assert result.space.error.accelerance_in_band < 1e-5


def test_modes_counted_per_port_are_exact_too(print_of_the_plate):
    result = fit(spec_of({"name": "plate", "imported": print_of_the_plate, "modes": {"xz": 1}}))
    assert result.status.ok
    assert result.space.target.modes == 1
    assert result.space.error.frequency < 1e-9
    assert result.space.error.participation < 1e-7
    assert "couple xz and torsion" in result.space.why


def test_the_modes_may_be_chosen(print_of_the_plate):
    few = {**print_of_the_plate, "modes": [1, 3, 4]}
    result = fit(spec_of({"name": "plate", "imported": few}))
    assert [t.label for t in result.chain.tendons if t.is_mode] == ["mode1", "mode2", "mode3"]
    assert result.space.error.frequency < 1e-9
    assert result.space.error.participation < 1e-7
    assert result.space.target.modes == 3
    assert result.space.full.modes == 21


# -- round trips -----------------------------------------------------------------------------------
def torsion_boom() -> Beam:
    section = Equivalent(
        bending_stiffness_xy=200.0,
        bending_stiffness_xz=300.0,
        torsion_stiffness=90.0,
        axial_stiffness=1e6,
        linear_mass=1.5,
        polar_inertia=0.02,
    )
    return Beam(segments=(Segment(length=3.0, section=section),))


BEAMS = {
    "tip-loaded": (tip_loaded_boom, {"xy": 3}),
    "soft root": (soft_root_boom, {"xy": 2}),
    "panels": (panels, {"xy": 3, "xz": 2, "torsion": 2}),
    "timoshenko": (timoshenko_boom, {"xy": 2, "xz": 2}),
    "all ports": (torsion_boom, {"xy": 2, "xz": 2, "torsion": 2, "axial": 1}),
}


@pytest.mark.parametrize(
    "name",
    [
        n if n in ("tip-loaded", "soft root") else pytest.param(n, marks=pytest.mark.slow)
        for n in BEAMS
    ],
)
def test_a_beam_comes_back_as_the_same_chain(tmp_path, name):
    make, modes = BEAMS[name]
    path = tmp_path / "modes.toml"
    path.write_text(modes_text(make(), modes))
    imported = fit(spec_of({"imported": {"file": str(path)}}))
    direct = fit(make(), modes=modes)
    assert imported.status.ok == direct.status.ok
    for port in direct.achieved:
        found = compare(imported.achieved[port], direct.achieved[port].truncated(modes[port]))
        assert max(found.frequency, found.participation) < MUJOCO
    if name == "panels":
        assert direct.chain.tendons
        # cut at hinge lines, of which modes know nothing: the same appendage on other bodies
        return
    assert len(imported.chain.links) == len(direct.chain.links)
    length = direct.chain.length
    for ours, theirs in zip(imported.chain.links, direct.chain.links, strict=True):
        assert ours.start == pytest.approx(theirs.start, rel=ROUND_TRIP, abs=ROUND_TRIP * length)
        assert ours.mass == pytest.approx(theirs.mass, rel=ROUND_TRIP)
        assert ours.com == pytest.approx(theirs.com, rel=ROUND_TRIP)
        assert ours.inertia == pytest.approx(
            theirs.inertia, rel=1e-8, abs=ROUND_TRIP * max(theirs.inertia)
        )
    for ours, theirs in zip(imported.chain.hinges, direct.chain.hinges, strict=True):
        assert dict(ours.stiffness) == pytest.approx(dict(theirs.stiffness), rel=ROUND_TRIP)


# -- the choice, and the walk beyond ---------------------------------------------------------------
@pytest.mark.parametrize("leak", [2e-4, 0.05])
def test_what_leaks_into_another_port_is_held(leak):
    base = modes_of_beam(torsion_boom(), {"xz": 1, "torsion": 1})
    rows = 0.95 * base.participation  # something must be left for the leak
    k = base.belongs.index("xz")
    rows[k, 3] = leak * np.linalg.norm(rows[k] / base.scale) * base.scale[3]
    data = ModalData(base.rigid_mass, base.frequencies, rows, length=3.0)
    result = fit(data)
    assert result.status.ok
    assert result.space.error.frequency < 1e-9
    assert result.space.error.participation < 1e-8
    # against all six motions; it was of the order of the leak where the leak was left out
    assert result.space.error.accelerance_in_band < 20 * min(leak, 2e-4)


def test_with_a_hub_damping_and_free_target():
    hub = Hub(mass=300.0, inertia=(80.0, 90.0, 100.0), offset=(0.5, 0.0, 0.1))
    data = modes_of_beam(torsion_boom(), {"xy": 4, "xz": 4, "torsion": 3})
    result = fit(
        data,
        modes={"xy": 2, "xz": 2},
        root=Root(target="hub", hub=hub),
        damping=Damping(ratio=0.01),
    )
    assert result.status.ok
    assert result.hub_mass is not None
    assert result.target["xy"].modes == 2
    clamped = fit(data, modes={"xy": 2}, damping=Damping(ratio={"xy": (0.004, 0.002)}))
    assert clamped.achieved["xy"].damping[:2] == pytest.approx([0.004, 0.002], rel=1e-5)


def test_the_files_run_in_mujoco(tmp_path):
    (tmp_path / "modes.toml").write_text(
        modes_text(torsion_boom(), {"xy": 1, "xz": 1, "torsion": 1})
    )
    spec = tmp_path / "array.toml"
    spec.write_text('name = "array"\n[imported]\nfile = "modes.toml"\n[damping]\nratio = 0.005\n')
    result = fit(spec)
    assert result.as_dict()["space"]["error"]["frequency"] < MUJOCO
    model = mujoco.MjModel.from_xml_string(result.scene_mjcf())
    state = mujoco.MjData(model)
    state.qvel[3] = 0.01
    mujoco.mj_step(model, state, nstep=200)
    assert all(int(w.number) == 0 for w in state.warning)
    assert np.all(np.isfinite(state.qpos))


@pytest.mark.parametrize("make", [tapered_boom, tip_loaded_boom])
def test_a_beam_with_a_tendon_per_mode(make):
    result = fit(make(), modes={"xz": 2}, options=FitOptions(springs="modes"))
    direct = fit(make(), modes={"xz": 2})
    assert [t.label for t in result.chain.tendons] == ["mode1_xz", "mode2_xz"]
    found = compare(result.achieved["xz"], direct.achieved["xz"])
    assert max(found.frequency, found.participation) < MUJOCO
    assert result.readback_error["xz"].accelerance_in_band == pytest.approx(
        direct.readback_error["xz"].accelerance_in_band, rel=1e-3
    )


@pytest.mark.slow
def test_embedded_in_a_spacecraft(tmp_path):
    (tmp_path / "array.f06").write_text(whole(cantilever(0.3), weight=True))
    spec = tmp_path / "array.toml"
    spec.write_text('name = "array"\n[imported]\nfile = "array.f06"\n')
    craft = tmp_path / "craft.xml"
    craft.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/><inertial '
        'pos="0.1 0 0" mass="3" diaginertia="0.1 0.2 0.15"/><site name="mount" pos="0.2 0.1 0" '
        'euler="10 20 30"/></body></worldbody></mujoco>'
    )
    record = embed(craft, {"mount": read_spec(spec)}).as_dict()
    pairs = [(m["exact"], m["mujoco"]) for m in record["modes"] if m["exact"] is not None]
    assert len(pairs) == 5
    assert max(abs(ours / exact - 1.0) for exact, ours in pairs) < MUJOCO


@pytest.mark.slow
def test_no_link_is_without_mass_where_the_mass_lies_at_two_places():
    """Three quarters of the mass near the root, the rest at the end: all that moments know of it
    would be two points, and a link between them would have nothing."""
    mass, first, second = 1755.0, 772.0, 690.0
    rigid = np.diag([mass, mass, mass, 36.0, second + 18.0, second + 18.0])
    rigid[1, 5] = rigid[5, 1] = first
    rigid[2, 4] = rigid[4, 2] = -first
    root = np.linalg.cholesky(rigid)
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.normal(size=(8, 6)))[0]
    rows = np.diag([0.9] * 8) @ turn @ root.T
    data = ModalData(rigid, np.geomspace(40.0, 900.0, 8), rows)
    result = fit(data)
    assert result.status.ok
    assert min(link.mass for link in result.chain.links[1:]) > 1e-3 * mass
    assert result.space.error.frequency < MUJOCO
