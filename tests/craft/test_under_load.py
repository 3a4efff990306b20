"""The promise under gravity or thrust, against plain MuJoCo models of many rigid cells that rest
under the same load."""

import sys

import numpy as np
import pytest

import beamchain as bc
from arms import Arm, Link, mjcf, toml
from command import call
from loaded_arms import at_rest, dofs_of, extrapolated, in_band, loaded
from solver import Craft, Section

BAND = 20.0
AGREE = 0.05  # stated and found error of the craft, relative
# of the response: the truth is of two numbers of cells and extrapolated, 1e-6 of a frequency off,
# which is 1e-4 to 1e-3 of a resonance with 0.5 % of damping
ROUNDING = 1e-3
MODES = "[modes]\nxy = 3\nxz = 3\ntorsion = 2\n"
FEW = "[modes]\nxy = 1\n"  # where the load is refused
UPPER = Link("upper", 6.0, 0.05, 0.08)
FORE = Link("fore", 5.0, 0.04, 0.05, 2.0, (0.01, 0.01, 0.01), (0.0, 0.0, 1.0), 4e3, 5.0)
HAND = {"hand": 2.0, "hand_inertia": (0.1, 0.1, 0.1), "hand_at": (0.1, 0.2, 0.05)}
EARTH = {"gravity": (0.0, 0.0, -9.81)}
ONE = Arm((UPPER,), bus=50.0, **HAND, **EARTH)
TWO = Arm((UPPER, FORE), bus=50.0, **HAND, **EARTH, keys={"bent": {"fore": 0.8}})
SERVO = Link(
    **{
        **FORE.__dict__,
        "stiffness": 0.0,
        "damping": 0.0,
        "kp": 2e3,
        "kv": 40.0,
        "servo": "position",
    }
)
DRIVEN = Arm(**{**TWO.__dict__, "links": (UPPER, SERVO)})  # its keyframe's ctrl is its angle
ORBIT = Arm((UPPER, FORE), bus=400.0, **HAND, keys={"burn": {"fore": 0.8}})
STAND = '<joint name="stand" axis="0.3 0.5 1" stiffness="2e4" damping="3"/>'
FREE = '<freejoint name="bus"/>'
DOWN = "0.7071067811865476 0 0.7071067811865476 0"
THRUSTER = '<motor name="thrust" site="thruster" gear="0 0 1 0 0 0"/>'
ALONG = '<motor name="thrust" site="thruster" gear="-1 0 0 0 0 0"/>'


def embedded(folder, arm, loads=True, modes=MODES, **craft):
    """An arm's result of `embed` under its load, and its files."""
    (folder / "arm.xml").write_text(mjcf(arm, **craft))
    for link in arm.links:
        (folder / f"{link.name}.toml").write_text(toml(arm, link, BAND, 0.05, modes))
    at = {f"place_{link.name}": folder / f"{link.name}.toml" for link in arm.links}
    return bc.embed(folder / "arm.xml", at, retime=False, loaded=loads), at


def qpos_of(model, name):
    return model.qpos0 if name == "rest" else model.key(name).qpos


SLOW = pytest.mark.slow
CASES = {
    "hangs": (ONE, STAND, "rest", DOWN, 0.0, "", (12, 24)),
    "driven elbow": (DRIVEN, STAND, "bent", "1 0 0 0", 0.8, "", (12, 24)),
    "thrust across": (ORBIT, FREE, "burn", "1 0 0 0", 2000.0, THRUSTER, (12, 24)),
    "thrust along": (ORBIT, FREE, "burn", "1 0 0 0", 5000.0, ALONG, (12, 24)),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_promise_under_a_load_is_what_many_cells_find(tmp_path, case):
    arm, base, name, turned, push, actuators, counts = CASES[case]
    ctrl = f"{push}" if push else ""
    flexible, _ = embedded(
        tmp_path, arm, base=base, quaternion=turned, ctrl=ctrl, actuators=actuators
    )
    stated = flexible.promise.poses[name]
    angles = arm.keys.get(name)
    acts = f"<actuator>{actuators}</actuator>" if actuators else ""
    coarse, many = (
        loaded(arm, count, base, angles, push, quaternion=turned, actuators=acts)
        for count in counts
    )
    modes = [mode for mode in flexible.modes_at(name) if mode.exact is not None]
    near = [m.exact * (1.0 + 0.005 * np.linspace(-4.0, 4.0, 41)) for m in modes]
    near += [m.mujoco * (1.0 + 0.005 * np.linspace(-4.0, 4.0, 41)) for m in modes]
    omega = np.unique(np.concatenate([np.linspace(BAND / 800.0, BAND, 800), *near]))
    omega = omega[omega <= BAND]
    truth = extrapolated(coarse, many, 2.0, omega, 3.0 * BAND)
    bend = dofs_of(flexible.model, ["upper_", "fore_"])
    file = at_rest(flexible.model, qpos_of(flexible.model, name), bend, push)
    found = in_band(file.accelerance(omega), truth, many)
    exact = [mode.exact for mode in modes]
    coarser, finer = (model.frequencies(len(modes)) for model in (coarse, many))
    true = (4.0 * finer - coarser) / 3.0
    off = np.max(np.abs(exact / true - 1.0))
    sys.stdout.write(
        f"{case}: stated {stated:.4g}, found {found:.4g}; frequencies {exact} off by {off:.1e}\n"
    )
    assert abs(stated - found) < AGREE * found + ROUNDING
    assert off < 1e-5
    assert [mode.mujoco for mode in modes] == pytest.approx(file.frequencies(len(modes)), rel=1e-6)


@SLOW
def test_a_hanging_beam_is_stiffened_as_the_closed_form_says(tmp_path):
    """Rayleigh's quotient, exact to first order in g: w^2 + g int (L - x) v'^2 dx / int v^2 dx,
    1.5709 g / L for the first mode of a cantilever."""
    alone = Arm((UPPER,), bus=1e9, bus_inertia=(1e9,) * 3, hand=1e-6, hand_inertia=(1e-9,) * 3)
    beam = Arm(**{**alone.__dict__, "at": (0.0, 0.0, 0.0), **EARTH})
    flexible, _ = embedded(tmp_path, beam, base=STAND, quaternion=DOWN)
    still, _ = embedded(tmp_path, beam, False, base=STAND, quaternion=DOWN)
    slow, before = (
        next(m for m in each.modes_at("rest") if m.exact > 1.0) for each in (flexible, still)
    )
    added = slow.exact**2 - before.exact**2
    assert added == pytest.approx(1.5709 * 9.81 / 6.0, rel=2e-3)


@SLOW
def test_what_is_not_asked_for_is_left_out(tmp_path):
    flexible, _ = embedded(tmp_path, ONE, False, base=STAND)
    record = flexible.as_dict()
    assert "loads" not in record
    assert "gravity" in [warning["code"] for warning in record["warnings"]]
    assert flexible.craft_error < 0.01


@pytest.mark.slow
def test_a_thrust_on_what_an_appendage_carries_is_refused(tmp_path):
    pushed = Arm(**{**ORBIT.__dict__, "links": (UPPER,), "keys": {"burn": {}}})
    text = mjcf(pushed, ctrl="5", actuators='<motor site="tip" gear="1 0 0 0 0 0"/>')
    (tmp_path / "arm.xml").write_text(text.replace('<body name="hand"', '<body name="hand"', 1))
    marked = text.replace(
        '<inertial pos="0.1 0.2 0.05"', '<site name="tip"/><inertial pos="0.1 0.2 0.05"'
    )
    (tmp_path / "arm.xml").write_text(marked)
    (tmp_path / "upper.toml").write_text(toml(pushed, UPPER, BAND, 0.05, FEW))
    with pytest.raises(bc.InputError, match="carries"):
        bc.embed(
            tmp_path / "arm.xml",
            {"place_upper": tmp_path / "upper.toml"},
            retime=False,
            loaded=True,
        ).promise


@SLOW
def test_the_command_proves_under_the_load_and_says_so(tmp_path):
    (tmp_path / "arm.xml").write_text(mjcf(ONE, base=STAND, quaternion=DOWN))
    (tmp_path / "upper.toml").write_text(toml(ONE, UPPER, BAND, 0.05, MODES))
    words = ["embed", tmp_path / "arm.xml", "--mount", f"place_upper={tmp_path / 'upper.toml'}"]
    out = tmp_path / "flexible.xml"
    answer = call(*words, "--loaded", "--json", "-o", out)
    assert answer.status == 3
    assert answer.record["loads"] == {"rest": ["under 9.81 m/s^2 of gravity"]}
    assert answer.record["craft_error"] > 0.05 > answer.record["sampled_error"]
    proof = call("inspect", out, "--prove", "--loaded", "--json")
    assert proof.status == 3
    assert proof.record["proof"]["craft_error"] == pytest.approx(
        answer.record["craft_error"], rel=1e-6
    )
    assert call("inspect", out, "--loaded").status == 2


LENGTH, BENDING, LINE = 10.0, 1277.4, 1.0
PUSHED = """<mujoco><option gravity="0 0 0" integrator="RK4" timestep="0.005"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/>
<site name="mount" pos="0.5 0 0"/><site name="thruster"/></body></worldbody>
<actuator><motor site="thruster" gear="1 0 0 0 0 0"/></actuator>
<keyframe><key name="burn" ctrl="{}"/></keyframe></mujoco>"""


def boom(modes=2, tip=200.0, **more):
    section = bc.Equivalent(
        bending_stiffness_xy=1277.4, bending_stiffness_xz=1277.4, linear_mass=1.0
    )
    return bc.Spec(
        segment=(bc.Segment(length=10.0, section=section),),
        lump=(bc.Lump(x=10.0, mass=tip),) if tip else (),
        modes={"xy": modes, "xz": modes},
        **more,
    )


def pressed(thrust, modes=2, tip=200.0, loaded=False):
    craft = PUSHED.format(thrust)
    return bc.embed(craft, {"mount": boom(modes, tip)}, retime=False, loaded=loaded)


def squares(thrust, tip=200.0):
    """Squares of the frequencies of the same in finite elements; the thrust stays with the bus."""
    craft = Craft()
    craft.body(craft.base, 300.0, inertia=(100.0, 120.0, 150.0))
    mount = craft.base.at((0.5, 0.0, 0.0))
    section = Section(1e6, 1e3, BENDING, BENDING, LINE, 0.1)
    acceleration = thrust / (300.0 + LINE * LENGTH + tip)

    def pressed(x):
        return acceleration * (tip + LINE * (LENGTH - x))

    nodes = craft.beam(mount, LENGTH, 40, section, tension=lambda x: -pressed(x))
    craft.body(nodes[-1], tip)
    follows = np.zeros((6, 6))
    follows[1, 5], follows[2, 4] = -thrust, thrust
    follows[4, 4] = follows[5, 5] = -pressed(0.0) * 0.5  # of the bus from its centre to the root
    craft.add("stiffness", np.eye(6), follows)
    mass, _, stiffness = craft.matrices()
    found = np.linalg.eigvals(np.linalg.solve(mass, stiffness))
    elastic = np.delete(found, np.argsort(np.abs(found))[:6])
    return elastic[np.argsort(elastic.real)]


def said(result, code):
    return [str(warning) for warning in result.warnings if warning.code == code]


@pytest.mark.slow
def test_a_thrust_that_the_proof_is_without_is_said():
    before, after = (squares(thrust)[0].real for thrust in (0.0, 100.0))
    assert np.sqrt(after / before) < 0.9  # the thrust is felt
    (text,) = said(pressed(100.0), "load-left-out")
    assert "burn was judged without its load" in text
    assert "--loaded" in text
    assert not said(pressed(100.0, loaded=True), "load-left-out")
    assert not said(pressed(1e-3), "load-left-out")  # 1e-6 of a frequency


def test_of_imported_modes_it_is_said_that_the_load_cannot_be_judged():
    mass = np.diag([30.0, 30.0, 30.0, 20.0, 600.0, 600.0])
    mass[1, 5] = mass[5, 1] = 120.0
    mass[2, 4] = mass[4, 2] = -120.0
    row = np.array([[0.0, 4.0, 0.0, 0.0, 0.0, 23.0]])
    modes = bc.ModalData(rigid_mass=mass, frequencies=np.array([1.3]), participation=row)
    found = bc.embed(PUSHED.format(100.0), {"mount": modes}, retime=False)
    (text,) = said(found, "load-left-out")
    assert "imported modes" in text
    assert "--loaded" not in text


@pytest.mark.slow
def test_near_buckling_the_exact_frequencies_are_those_of_finite_elements():
    """At 92 % of the thrust under which the free spacecraft buckles, 283 N."""
    thrust = 260.0
    modes = pressed(thrust, loaded=True).modes_at("burn", beyond=True)
    true = np.sqrt(squares(thrust)[:4].real)
    assert [mode.exact for mode in modes] == pytest.approx(true, rel=3e-5)


# of the exact spacecraft and of the file, by finite elements and by MuJoCo's own forces: the first
# buckles at 283 N, with one mode a plane the file before
SLOW_RATE = 0.01  # 1/s: rounding of rigid motions
DAMPED = 0.1  # of a rate: what damping of 0.5 % takes, which the truth is without
GROWING = {"neither": (200.0, 2, 250.0), "both": (200.0, 2, 400.0), "the file": (200.0, 1, 281.0)}


@pytest.mark.parametrize("case", GROWING)
@pytest.mark.slow
def test_what_grows_under_its_load_is_called_unstable(case):
    tip, modes, thrust = GROWING[case]
    result = pressed(thrust, modes, tip, loaded=True)
    model = result.model
    bend = [i for i in range(model.nv) if i >= 6]
    file = at_rest(model, model.key("burn").qpos, bend, thrust)
    found = np.linalg.eigvals(np.linalg.solve(file.mass, file.stiffness))
    rates = [np.sqrt(-part.astype(complex)).real.max() for part in (squares(thrust, tip), found)]
    grows = {
        name: float(rate) if rate > SLOW_RATE else 0.0
        for name, rate in zip(("exact", "mujoco"), rates, strict=True)
    }
    assert [rate > 0.0 for rate in grows.values()] == {
        "neither": [False, False],
        "both": [True, True],
        "the file": [False, True],
    }[case]
    if case == "neither":
        assert result.growth == {}
        assert result.met is None
        assert "nstable" not in result.headline
        return
    stated = result.growth["burn"]
    assert [stated[name] > 0.0 for name in grows] == [rate > 0.0 for rate in grows.values()]
    if case == "both":
        assert stated == pytest.approx(grows, rel=DAMPED)
    assert result.met is False
    assert "Unstable at burn" in result.headline


UPRIGHT = """<mujoco><option gravity="-{} 0 0" timestep="0.001" integrator="RK4"/>
<worldbody><body name="hub"><joint axis="0 1 0" stiffness="1e5" damping="1e3"/>
<inertial pos="0 0 0" mass="50" diaginertia="9 9 9"/><site name="mount"/></body></worldbody>
</mujoco>"""
ROD = """name = "rod"
[[segment]]
length = 10.0
section.shape = "equivalent"
section.bending_stiffness_xy = 1e5
section.bending_stiffness_xz = 1277.4
section.linear_mass = 1.0
[modes]
xz = 3
"""


@pytest.mark.slow
@pytest.mark.parametrize(("share", "grows"), [(0.9, False), (1.1, True)])
def test_a_rod_that_its_weight_buckles_is_called_unstable(tmp_path, share, grows):
    """Greenhill: a standing rod buckles where g m L^3 / EI = 7.837. That gravity is on is no
    warning where it is in the proof."""
    (tmp_path / "stand.xml").write_text(UPRIGHT.format(share * 7.837 * 1277.4 / 10.0**3))
    (tmp_path / "rod.toml").write_text(ROD)
    words = ["embed", tmp_path / "stand.xml", "--mount", f"mount={tmp_path / 'rod.toml'}"]
    answer = call(*words, "--loaded", "--json", "-o", tmp_path / "flexible.xml")
    assert (answer.status, answer.record["met"]) == ((3, False) if grows else (0, None))
    assert bool(answer.record["growth"]) is grows
    assert "gravity" not in [each["code"] for each in answer.record["warnings"]]


@pytest.mark.slow
def test_what_its_weight_buckles_is_not_within_a_tolerance(tmp_path):
    spec = tmp_path / "rod.toml"
    spec.write_text(f"{ROD}[scene]\nbandwidth = 1.0\ntolerance = 0.02\n")
    craft = UPRIGHT.format(1.1 * 7.837 * 1277.4 / 10.0**3)
    made = bc.embed(craft, {"mount": spec}, loaded=True)
    assert made.growth
    assert "tolerance 0.02 is not met" in made.headline
