"""What cannot be asked of a spacecraft is refused by one sentence that names the argument, its
value and the cure; what embed refuses of its file, with nothing written, stands in
`test_embed_refused.py`. No tolerances: sentences only."""

import shutil
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
import pytest

import barge
import beamchain as bc
from arms import Arm, Link, mjcf, toml
from refused import check_refused
from spacecraft import spec
from specs import spec_of

NAN = float("nan")
BAND = 20.0
CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.05"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/><site name="mount" pos="0.5 0 0"/></body>
</worldbody></mujoco>"""
ARRAY = {"mount": "array.toml"}
TORQUE = ["torque:bus"]
SECTION = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
BOOM = (bc.Segment(length=8.0, section=SECTION),)
PLANAR = bc.Spec(segment=BOOM, modes=bc.Modes(xy=1), fit=bc.spec.FitOptions(springs="modes"))

# -- arguments of a wrong type, and arrays that are not finite -------------------------------------


def embedded_in_five():
    section = bc.Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0)
    bc.embed(5, {"mount": bc.Beam(segments=(bc.Segment(length=1.0, section=section),))})


def port():
    return bc.Beam(segments=BOOM).port("xy", 2)


ARGUMENTS = {
    "samples": (lambda: bc.sweep(CRAFT, samples="3"), ("samples = '3'", "whole number")),
    "seed": (lambda: bc.sweep(CRAFT, seed=0.5), ("seed = 0.5", "whole number")),
    "workers": (lambda: bc.sweep(CRAFT, workers="2"), ("workers = '2'", "whole number")),
    "no workers": (lambda: bc.sweep(CRAFT, workers=0), ("workers = 0", "whole number from 1")),
    "gains": (
        lambda: bc.sweep(CRAFT, gains="torque:bus=attitude"),
        ("gains = 'torque:bus=attitude'", "a list of names"),
    ),
    "mounts a list": (
        lambda: bc.sweep(CRAFT, mounts=[1]),
        ("mounts = [1] is a list", 'by place: {"mount": "array.toml"}'),
    ),
    "place": (
        lambda: bc.embed(CRAFT, {5: "array.toml"}),
        ("a place in mounts = 5 is an int", "a site or body"),
    ),
    "craft": (embedded_in_five, ("craft = 5 is an int", "path or the text")),
    "retime": (
        lambda: bc.embed(CRAFT, ARRAY, retime=np.zeros((2, 2))),
        ("retime = ", "ndarray", "True or False"),
    ),
    "rigid": (
        lambda: bc.embed(CRAFT, ARRAY, rigid="no"),
        ("rigid = 'no' is a str", "True or False"),
    ),
    "ragged pose": (
        lambda: bc.plant(CRAFT, TORQUE, pose=[[1, 2], [3]]),
        ("pose[0] has the shape (2,)", "shape (7,)"),
    ),
    "model": (lambda: bc.plant(5), ("model = 5 is an int", "MJCF file")),
    "data": (lambda: bc.linearise(CRAFT, data="now"), ("data = 'now' is a str", "mujoco.MjData")),
    "port model": (lambda: bc.compare(5, 6), ("a = 5 is an int", "PortModel")),
    "path to retime": (
        lambda: bc.retime("flexible.xml", 0.1),
        ("model = 'flexible.xml' is a str", "mujoco.MjModel"),
    ),
    "nothing to start": (
        lambda: bc.start_velocity(None, [0.0], [0.0]),
        ("model = None is a NoneType", "mujoco.MjModel"),
    ),
    "source": (lambda: bc.stability(5), ("source = 5 is an int", "give a Spec")),
    "spec to study": (lambda: bc.study(5), ("spec = 5 is an int", "give a Spec")),
    "spec to read": (lambda: bc.read_spec(5), ("spec = 5 is an int", "give a Spec")),
    "modes to read": (lambda: bc.read_modes(5), ("path = 5 is an int", "file of modes")),
    "input before": (lambda: bc.HeldInput(NAN), ("before is nan", "finite numbers")),
    "input now": (lambda: bc.HeldInput()([0.0, NAN]), ("now[1] is nan", "finite numbers")),
    "rigid mass": (
        lambda: bc.PortModel("3", [1.0], [[0.1]]),
        ("rigid_mass = '3' is a str", "numbers"),
    ),
    **{
        f"omega of {name} {values}": (
            lambda name=name, values=values: getattr(port(), name)(values),
            ("omega", said, "finite numbers (rad/s)"),
        )
        for name in ("D", "W")
        for values, said in (
            ([NAN], "omega[0] is nan"),
            ([1.0, float("inf")], "omega[1] is inf"),
            ("fast", "'fast' is a str"),
        )
    },
    "hub mass": (
        lambda: port().with_hub([[NAN, 0.0], [0.0, 1.0]]),
        ("hub_mass[0, 0] is nan", "(2, 2)"),
    ),
    **{
        f"timestep {wrong}": (
            lambda wrong=wrong: bc.retime(made().model, wrong),
            ("timestep = ", "is not a number"),
        )
        for wrong in (np.zeros((2, 2)), [[1, 2], [3]], ())
    },
}


@cache
def made():
    return bc.embed(CRAFT, {"mount": PLANAR})


def start(qpos=None, qvel=None):
    model = made().model
    bc.start_velocity(model, model.qpos0 if qpos is None else qpos, [0.0] if qvel is None else qvel)


def beyond_a_range():
    model = made().model
    model.jnt_limited[-1], model.jnt_range[-1] = True, (-0.1, 0.1)
    bc.retime(model, 0.1, pose=[*model.qpos0[:-1], 0.5])


def nans(name):
    return [NAN] * getattr(made().model, name)


CRAFTS = {
    "inputs": (lambda: bc.plant(made(), 5), ("inputs = 5", "a list of names")),
    "rates": (lambda: bc.plant(made(), rates=5), ("rates = 5 is an int", "speeds by joint")),
    "pose of nan": (
        lambda: bc.plant(made(), TORQUE, pose=nans("nq")),
        ("pose[0] is nan", "finite numbers"),
    ),
    "omega nan": (
        lambda: bc.plant(made(), TORQUE).truncation([1.0, NAN]),
        ("omega[1] is nan", "finite numbers (rad/s)"),
    ),
    "omega a word": (
        lambda: bc.plant(made(), TORQUE).truncation("fast"),
        ("omega = 'fast' is a str",),
    ),
    "path of a plant": (
        lambda: bc.plant(made(), TORQUE).write(5),
        ("path = 5 is an int", "path of a file"),
    ),
    "path of a craft": (lambda: made().write(None), ("path = None is a NoneType",)),
    "keyframe": (lambda: made().modes_at(5), ("key = 5 is an int", "name of a keyframe")),
    "timestep": (lambda: bc.retime(made().model, "0.1"), ("timestep = '0.1'", "not a number")),
    "qpos nan": (lambda: bc.retime(made().model, 0.1, pose=nans("nq")), ("pose[0] is nan",)),
    "beyond a range": (
        beyond_a_range,
        ("outside its range [-0.1, 0.1]",),
    ),
    "qvel nan": (lambda: start(qvel=nans("nv")), ("qvel[0] is nan",)),
    "one position": (lambda: start(qpos=[0.0]), ("qpos = [0.0] has the shape (1,)", "(8,)")),
}

# -- embed -----------------------------------------------------------------------------------------
HUB = """<mujoco><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="50" diaginertia="5 5 5"/>{}</body></worldbody></mujoco>"""
MOUNT = '<site name="mount"/>'
TURNING = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus">
<joint name="turn" axis="0 0 1"/><inertial pos="0 0 0" mass="60" diaginertia="9 8 7"/>
<site name="place" pos="0.5 0 0"/></body></worldbody></mujoco>"""
ALL_CARRIED = """<mujoco><worldbody><body name="bus"><freejoint/><site name="mount"/>
<body name="arm" pos="3 0 0"><inertial pos="0 0 0" mass="50" diaginertia="5 5 5"/></body>
</body></worldbody></mujoco>"""
UPPER = Link("upper", 6.0, 0.05, 0.08)
FORE = Link("fore", 5.0, 0.04, 0.05, 2.0, (0.01, 0.01, 0.01), (0.0, 0.0, 1.0))


def including(**files):
    """A craft that includes a.xml."""
    for name, inside in files.items():
        Path(f"{name}.xml").write_text(f"<mujocoinclude>{inside}</mujocoinclude>")
    Path("craft.xml").write_text(HUB.format('<include file="a.xml"/>'))
    bc.embed("craft.xml", {"mount": spec("rod")})


def damaged_mark():
    text = made().to_mjcf().replace('{"piece": "tendon"', '{"piece": tendon')
    bc.embed(text, {"mount": spec("rod")})


def compiled():
    mujoco.mj_saveModel(mujoco.MjModel.from_xml_string(CRAFT), "c.mjb")
    bc.embed("c.mjb", {"mount": spec("rod")})


def along(*axes):
    """A craft that can only turn about z is pushed along other axes."""
    section = bc.Equivalent(bending_stiffness_xy=2e3, bending_stiffness_xz=3e3, linear_mass=4.0)
    segment = (bc.Segment(length=8.0, section=section),)
    scene = bc.Scene(bandwidth=2.0, axes=list(axes))
    bc.embed(TURNING, {"place": bc.Spec(segment=segment, scene=scene)})


def all_mass_carried():
    tube = {"shape": "tube", "outer_diameter": 0.1, "wall": 0.003}
    metal = {"youngs_modulus": 7e10, "density": 2700.0}
    segment = [{"length": 3.0, "section": tube, "material": metal}]
    end = [{"name": "end", "x": 3.0, "carries": ["arm"]}]
    boom = spec_of({"segment": segment, "modes": {"xy": 1, "xz": 1}, "port": end})
    bc.embed(ALL_CARRIED, {"mount": boom}, retime=False)


def places(arm, modes="[modes]\nxy = 1\n"):
    for link in arm.links:
        Path(f"{link.name}.toml").write_text(toml(arm, link, BAND, 0.02, modes))
    return {f"place_{link.name}": f"{link.name}.toml" for link in arm.links}


def carrying(carry):
    arm = Arm((UPPER, FORE), 400.0, (80.0, 100.0, 120.0), hand=10.0, hand_inertia=(0.4,) * 3)
    bc.embed(mjcf(arm), places(arm), carry=carry)


def falling():
    still = Arm((UPPER,), bus=50.0, gravity=(0.0, 0.0, -9.81), keys={"as_it_is": {}})
    bc.embed(mjcf(still), places(still), retime=False, loaded=True)


def imported_under_load():
    mass = np.diag([30.0, 30.0, 30.0, 20.0, 600.0, 600.0])
    mass[1, 5] = mass[5, 1] = 120.0
    mass[2, 4] = mass[4, 2] = -120.0
    row = np.array([[0.0, 4.0, 0.0, 0.0, 0.0, 23.0]])
    modes = bc.ModalData(rigid_mass=mass, frequencies=np.array([1.3]), participation=row)
    standing = mjcf(
        Arm((UPPER,), bus=50.0, gravity=(0.0, 0.0, -9.81)),
        base='<joint name="stand" axis="0.3 0.5 1" stiffness="2e4" damping="3"/>',
    )
    bc.embed(standing, {"place_upper": modes}, retime=False, loaded=True)


def proof_of_a_file():
    Path("arm.xml").write_text(CRAFT)
    bc.prove("arm.xml")


def uncertain(**change):
    section = {"shape": "equivalent", "bending_stiffness_xy": 900.0, "linear_mass": 3.0}
    table = {"segment": [{"length": 6.0, "section": section}], "modes": {"xy": 2}}
    boom = spec_of(
        {**table, "damping": {"ratio": 0.005}, "uncertain": {"frequency": {"relative": 0.1}}}
    )
    boom.replace(**change)


EMBED = {
    "cycle of includes": (
        lambda: including(a='<include file="b.xml"/>', b='<include file="a.xml"/>'),
        ("a.xml -> b.xml -> a.xml",),
    ),
    "include missing": (including, ("a.xml", "does not exist")),
    "damaged mark": (damaged_mark, ("changed by hand",)),
    "compiled model": (compiled, ("c.mjb", "is a compiled model", "give the MJCF")),
    "axes x": (lambda: along("x"), ("scene.axes = x:", "body 'bus'", "only make the motions z")),
    "axes x, z": (lambda: along("x", "z"), ("scene.axes = x, z:", "only make the motions z")),
    "all mass carried": (all_mass_carried, ("mount: body 'bus'", "no mass", "<inertial>")),
    **{
        f"carry {carry}": (partial(carrying, carry), words)
        for carry, words in (
            ({"place_upper:end": "nobody"}, ("no body 'nobody'",)),
            ({"place_upper:end": "hand"}, ("does not hang directly on body 'bus'",)),
            ({"place_fore:end": "joint_fore"}, ("close a loop",)),
            ({"place_upper:end": "bus"}, ("has a free joint",)),
            ({"place_upper:elbow": "joint_fore"}, ("no port 'elbow'", "it has: end")),
            ({"place_upper:tip": "joint_fore"}, ("no port 'tip'",)),
            ({"nowhere:end": "joint_fore"}, ("no appendage", "'nowhere'")),
            ({"place_upper": "joint_fore"}, ("names no port",)),
            ({":end": "joint_fore"}, ("names no port",)),
            ({"place_upper:end": ["joint_fore", "joint_fore"]}, ("hangs on one port",)),
            ({"place_upper:end": 3}, ("carry",)),
            (["place_upper:end=joint_fore"], ("bodies by port",)),
        )
    },
    "load where nothing acts": (falling, ("no load acts",)),
    "load on imported modes": (imported_under_load, ("place_upper is imported modes",)),
    "proof of a plain file": (proof_of_a_file, ("arm.xml", "was not written by embed")),
    "proof of plain text": (lambda: bc.prove(CRAFT), ("was not written by embed",)),
    "uncertain on hinges": (
        lambda: uncertain(fit=bc.spec.FitOptions(springs="hinges")),
        ('springs = "auto"',),
    ),
    "uncertain in hinges": (
        lambda: uncertain(damping=bc.Damping(ratio=0.005, form="hinge")),
        ('form = "modal"',),
    ),
}

# -- recovery, deliveries, tanks -------------------------------------------------------------------
HUB_AND_TUBE = CRAFT.replace('timestep="0.05"', 'timestep="0.001" integrator="RK4"')
STILL = {"qpos": np.ones((2, 9))}
WING = Path(bc.__file__).parent / "examples" / "wing"


@cache
def tube():
    """A spacecraft with a boom on hinges, and a record of one instant."""
    segment = bc.Segment(
        length=8.0,
        section=bc.Tube(outer_diameter=0.1, wall=0.002),
        material=bc.Material(youngs_modulus=7e10, density=2700.0),
    )
    hinges = bc.spec.FitOptions(springs="hinges")
    boom = bc.Spec(segment=(segment,), modes=bc.Modes(xy=2, xz=0), fit=hinges)
    flexible = bc.embed(HUB_AND_TUBE, {"mount": boom})
    record = flexible.recorder()
    record(mujoco.MjData(flexible.model))
    return flexible, record


def recovered(place="mount", data=None, **given):
    flexible, record = tube()
    flexible.recover(record if data is None else data, place, **given)


def data_of_the_bare_craft():
    flexible, _ = tube()
    flexible.recorder()(mujoco.MjData(flexible.craft))


def plot_of_a_weight():
    flexible, _ = tube()
    flexible.recover(mujoco.MjData(flexible.model)).plot("weight")


def rows(names=("a",), **given):
    bc.spec.RecoveryRows(names=names, **given)


def wing(damping=0.005, **imported):
    """The specification of the shipped delivery."""
    for path in WING.iterdir():
        shutil.copy(path, path.name)
    axes = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    units = {"length": 1e-3, "mass": 1e3}
    table = {"file": str(Path("wing.op4").resolve()), "axes": axes, "units": units, **imported}
    return spec_of({"imported": table, "damping": {"ratio": damping}})


def twenty_columns():
    np.savez("rows.npz", names=["a"], modes=np.ones((1, 20)))
    return wing(recovery=str(Path("rows.npz").resolve()))


def matrices_for_rows():
    flexible = bc.embed(CRAFT, {"mount": wing()})
    flexible.recover(mujoco.MjData(flexible.model), rows="wing.op4")


def tank(acceleration=0.05, **more):
    Path("tank.toml").write_text(barge.tank(acceleration, **more))
    return Path("tank.toml")


def thrust(axes):
    with TemporaryDirectory() as folder:
        barge.embedded(Path(folder), 0.05, axes=axes)


def sections_of_a_tank():
    with TemporaryDirectory() as folder:
        result = barge.embedded(Path(folder), 0.05)
    result.recover(mujoco.MjData(result.model), "tank")


def across():
    bc.embed(barge.craft(barge.BURN), {"tank": tank(axis="z")}, loaded=True)


INSIDE = {
    "place": (lambda: recovered("boom"), ("place = 'boom'", "choose from mount")),
    "x beyond the tip": (lambda: recovered(x=9.0), ("x = 9.0 m", "mount", "from 0 to 8.0 m")),
    "x a word": (lambda: recovered(x="root"), ("x = 'root' is a str", "finite numbers (m)")),
    "no x": (lambda: recovered(x=[]), ("x holds 0 stations", "1 to 1000")),
    "rows of a beam": (lambda: recovered(rows="rows.npz"), ("rows", "at mount is a beam")),
    "static": (lambda: recovered(static=1), ("static = 1 is an int", "True or False")),
    "data": (lambda: recovered(data=3), ("data = 3 is an int", "mujoco.MjData")),
    "no qpos": (lambda: recovered(data={}), ("no qpos", "arrays by name")),
    "three positions": (
        lambda: recovered(data={"qpos": [[0.0] * 3] * 2}),
        ("qpos", "(2, 3)", "finite numbers"),
    ),
    "no instant": (lambda: recovered(data={"qpos": np.zeros((0, 9))}), ("data holds no instant",)),
    "unknown array": (
        lambda: recovered(data={"speed": 1}),
        ("'speed' is unknown", "choose from qpos, qvel"),
    ),
    "qacc nan": (
        lambda: recovered(data={**STILL, "qacc": np.full((2, 8), np.nan)}),
        ("qacc[0, 0] is nan",),
    ),
    "empty recorder": (
        lambda: recovered(data=tube()[0].recorder()),
        ("the recorder has recorded nothing",),
    ),
    "bare craft": (data_of_the_bare_craft, ("7 positions and 6 rates",)),
    "quantity": (plot_of_a_weight, ("quantity = 'weight'", "choose one of root")),
    "no rows": (lambda: rows([]), ("0 rows", "1 to 4000")),
    "two rows of a name": (lambda: rows(["a", "a"], modes=np.eye(2)), ("two rows", "'a'")),
    "rows of nothing": (rows, ("modes", "accelerations")),
    "modes inf": (lambda: rows(modes=[[1.0, np.inf]]), ("modes[0, 1] is inf",)),
    "modes and accelerations": (
        lambda: rows(modes=[[1.0]], accelerations=[[1.0, 2.0]]),
        ("modes has the shape (1, 1)", "(1, 2)"),
    ),
    "root of one": (lambda: rows(modes=[[1.0]], root=[[1.0]]), ("root has the shape (1, 1)",)),
    "two units": (lambda: rows(modes=[[1.0]], units=["N", "m"]), ("2 units", "1 rows")),
    "names a word": (lambda: rows("abc", modes=[[1.0]]), ("names = 'abc'", "a list of names")),
    "a point that does not move": (
        lambda: rows(modes=[[1.0]], points=[[1.0, 0.0, 0.0]]),
        ("row 'a'", "point", "motion with the root"),
    ),
    "rows of 20 in a fit": (lambda: bc.fit(twenty_columns()), ("20 columns", "holds 8 modes")),
    "rows of 20 in a craft": (
        lambda: bc.embed(CRAFT, {"mount": twenty_columns()}),
        ("20 columns", "holds 8 modes"),
    ),
    "matrices for rows": (matrices_for_rows, ("matrices, not rows", "MUG1 or MEF1")),
    "nine ratios": (lambda: bc.fit(wing([0.01] * 9)), ("ratio", "9 values", "8 modes")),
    "ratio of 1.5": (lambda: wing([0.01, 1.5]), ("ratio[1] = 1.5", "not an oscillation")),
    "ratios of a beam": (
        lambda: bc.Spec(segment=BOOM, damping=[0.01, 0.02]),
        ("a list", "per mode of an imported file"),
    ),
    "scene a table": (
        lambda: bc.Spec(imported=wing().imported, scene={"bandwidth": 5.0}),
        ("scene = {'bandwidth': 5.0} is a dict", "give a Scene"),
    ),
    **{
        f"thrust along {axes}": (
            partial(thrust, axes),
            ("press the liquid onto", "another slosh.axis"),
        )
        for axes in ("0 0 -1 0 1 0", "1 0 0 0 1 0", "0 1 0 0 0 1")
    },
    "thrust across but for rounding": (across, ("press the liquid onto",)),
    "carried by a tank": (
        lambda: bc.embed(barge.craft(), {"tank": tank()}, carry={"tank:tip": ["bus"]}),
        ("carries nothing",),
    ),
    "step limits of a tank": (
        lambda: bc.stability(tank()),
        ("no stiffness without an acceleration",),
    ),
    "sections of a tank": (sections_of_a_tank, ("has no sections",)),
}

GROUPS = {"craft": CRAFTS, "embed": EMBED, "inside": INSIDE}
REFUSED = {f"{kind}: {name}": row for kind, group in GROUPS.items() for name, row in group.items()}


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("case", ARGUMENTS)
@pytest.mark.slow
def test_the_argument_is_named(case):
    check_refused(ARGUMENTS[case][0], bc.InputError, ARGUMENTS[case][1])


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.slow
def test_what_cannot_be_asked_of_a_craft_is_refused(case):
    check_refused(REFUSED[case][0], bc.InputError, REFUSED[case][1])


def test_a_long_text_is_not_repeated():
    with pytest.raises(bc.InputError) as refused:
        bc.prove(CRAFT + " " * 500)
    assert len(str(refused.value)) < 200
