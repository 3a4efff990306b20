"""Spacecraft as others write them: docking pairs, mocap bodies, planar bases, actuators and
sensors of all kinds, equalities, includes, attached models, replicas, flexes.

The coupled modes of what `embed` writes are those of a composition by hand; what the proof leaves
out is said; the file comes back byte for byte; inspect, plant, stability and retime do not stumble.
"""

import tomllib

import mujoco
import numpy as np
import pytest

import beamchain as bc
from command import call
from craft_truth import hung
from finite_elements import cantilever, coupled
from mechanics import by_differences, quiet, system_matrix
from random_appendages import toml
from solver import Modes, body_mass
from spacecraft import CRAFTS
from spacecraft import frequencies as own_frequencies

SAME = 1e-9  # relative: closed forms against MuJoCo's matrices (1e-13 is seen)
READ = 2e-6  # relative: embed's table, through mjd_transitionFD; a damped net shifts it by 1e-6
SLOPES = 1e-6  # relative: poles from differences of forces
STEP = 1e-4  # rad or m of differences: an actuator is not linear

#: file, places, codes of what is left out
STRANGERS = {
    "docking pair, each with a wing": (
        "docking",
        ("chaser_wing", "target_wing"),
        {"equality", "contacts", "other-bases"},
    ),
    "a massless frame on a massless frame": (
        "docking",
        ("wing_root",),
        {"equality", "contacts", "other-bases"},
    ),
    "planar base, actuators of all kinds": (
        "planar_arm",
        ("mount",),
        {"equality", "gravity", "dry-friction", "held-ports", "unstable-step"},
    ),
    "at the end of a servo-driven arm": (
        "planar_arm",
        ("tip",),
        {"equality", "gravity", "dry-friction", "held-ports", "joints-behind"},
    ),
    "includes, defaults, an attached gimbal, replicas": (
        "inspector",
        ("mount", "wing_end"),
        {"joints-behind"},
    ),
    "a net, and a towed body": (
        "net",
        ("mount",),
        {"equality", "other-bases", "tendon-damping"},
    ),
}
ROD = CRAFTS / "strangers" / "rod.toml"


@pytest.fixture
def rod(tmp_path):
    (tmp_path / "rod.toml").write_text(ROD.read_text())
    return tmp_path / "rod.toml"


def frequencies(mass, damping, stiffness):
    """Above zero, ascending [rad/s], undamped."""
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real
    return np.sqrt(np.sort(squares[squares > 1e-9 * squares.max()]))


@pytest.mark.slow
@pytest.mark.parametrize("name", STRANGERS)
def test_embedded(name, rod, tmp_path):
    stem, places, codes = STRANGERS[name]
    craft = CRAFTS / "strangers" / f"{stem}.xml"
    made = bc.embed(craft, dict.fromkeys(places, rod), retime=False)
    found = cantilever(tomllib.loads(ROD.read_text()), {"xy": 2, "xz": 2, "torsion": 1})
    own = Modes(found.frequencies, 0.0, found.participation, found.rigid, found.tip)
    bare = quiet(mujoco.MjModel.from_xml_path(str(craft)))
    wanted = frequencies(*hung(bare, dict.fromkeys(places, own), step=STEP))
    written = quiet(mujoco.MjModel.from_xml_path(str(made.write(tmp_path / "flexible.xml")[-1])))
    got = frequencies(*by_differences(written, step=STEP))
    # the same modes, and what fills the chain above them
    assert all(np.abs(got / w - 1.0).min() < SAME for w in wanted)
    told = [mode.mujoco for mode in made.assembly.modes if mode.kept and mode.mujoco]
    assert all(np.abs(wanted / w - 1.0).min() < READ for w in told)
    assert {warning.code for warning in made.warnings} == codes
    assert all("\n" not in warning for warning in made.warnings)
    answer = call("embed", tmp_path / "flexible.xml", "--remove", "-o", tmp_path / "back.xml")
    assert answer.status == 0, answer.err
    if stem != "inspector":  # its relative paths are seen from another folder
        assert (tmp_path / "back.xml").read_bytes() == craft.read_bytes()


@pytest.mark.slow
def test_back_beside_its_parts(rod, tmp_path):
    for path in [*(CRAFTS / "strangers").glob("*.xml"), *(CRAFTS / "strangers/parts").iterdir()]:
        target = tmp_path / path.relative_to(CRAFTS / "strangers")
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(path.read_bytes())
    made = bc.embed(tmp_path / "inspector.xml", {"wing_end": rod}, retime=False)
    made.write(tmp_path / "flexible.xml")
    call("embed", tmp_path / "flexible.xml", "--remove", "-o", tmp_path / "back.xml")
    assert (tmp_path / "back.xml").read_bytes() == (tmp_path / "inspector.xml").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "docking pair, each with a wing",
        "planar base, actuators of all kinds",
    ],
)
def test_no_command_stumbles(name, rod, tmp_path):
    stem, places, _ = STRANGERS[name]
    made = bc.embed(CRAFTS / "strangers" / f"{stem}.xml", dict.fromkeys(places, rod), retime=False)
    file = made.write(tmp_path / "flexible.xml")[-1]
    base = {"docking": "chaser", "planar_arm": "base"}.get(stem, "bus")
    driven = [w for i in range(made.model.nu) for w in ("--from", made.model.actuator(i).name)]
    plant = ("plant", file, "--from", f"torque:{base}", "--to", "attitude")
    for number, words in enumerate(
        [
            ("inspect", file),
            (*plant, "-o", tmp_path / "one.npz"),
            ("plant", file, *driven[:4], *plant[4:], "-o", tmp_path / "two.npz"),
            ("inspect", file, "--steps", "-o", tmp_path / "stability"),
            ("retime", file, "--timestep", "0.001", "-o", tmp_path / "timed.xml"),
        ]
    ):
        answer = call(*words)
        assert answer.status in (0, 2, 3), (number, answer.err)
        assert answer.status != 2 or answer.err.startswith("beamchain: "), answer.err
        assert "Traceback" not in answer.err


def test_modes_of_a_plant_beside_joints_that_only_decay(rod):
    """A rod at the end of an arm of damped joints: every mode's frequency is the size of a pole."""
    made = bc.embed(CRAFTS / "strangers" / "planar_arm.xml", {"tip": rod}, retime=False)
    plant = bc.plant(made, inputs=["torque:base"], outputs=["attitude"])
    model = quiet(made.model)
    poles = np.linalg.eigvals(system_matrix(*by_differences(model, step=STEP)))
    ringing = np.abs(poles[poles.imag > 1e-3])
    assert plant.frequency.size >= 3
    assert all(np.abs(ringing / w - 1.0).min() < SLOPES for w in plant.frequency)


PUSHED = """<mujoco><compiler angle="radian"/><option gravity="0 0 0" integrator="implicitfast"/>
<worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="50" diaginertia="9 9 9"/><site name="mount" pos="0.5 0 0"/>
<body name="yoke" pos="0 0.5 0">
<joint name="drive" axis="0 0 1" range="{range}" limited="{limited}"/>
<inertial pos="0.4 0 0" mass="4" diaginertia="1 1 1"/></body></body></worldbody></mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limits", "codes"),
    [("0 2", set()), ("1 2", {"limits"})],
)
def test_a_limit_at_or_beside_the_rest_pose_makes_no_modes(limits, codes, rod, tmp_path):
    """Half a limit's spring stood in the slopes before, as a mode of its own."""
    free = bc.embed(PUSHED.format(range=limits, limited="false"), {"mount": rod}, retime=False)
    held = bc.embed(PUSHED.format(range=limits, limited="true"), {"mount": rod}, retime=False)
    assert {warning.code for warning in held.warnings} == codes
    records = []
    for made, name in ((free, "free.xml"), (held, "held.xml")):
        made.write(tmp_path / name)
        records.append(call("inspect", tmp_path / name, "--json").record)
    assert {each["code"] for each in records[1]["warnings"]} == codes
    both = [[mode["frequency"] for mode in record["modes"]] for record in records]
    np.testing.assert_allclose(both[1], both[0], rtol=1e-9)


@pytest.mark.slow
def test_a_plant_that_excites_no_mode_has_its_page(rod, tmp_path):
    """Thrust along the axis of a rod on the centre of mass."""
    craft = (
        '<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="5" '
        'diaginertia="1 1 1"/><site name="mid"/></body></worldbody><actuator><motor name="jet" '
        'site="mid" gear="1 0 0 0 0 0"/></actuator></mujoco>'
    )
    file = bc.embed(craft, {"mid": rod}, retime=False).write(tmp_path / "flexible.xml")[-1]
    answer = call("plant", file, "--from", "jet", "--to", "rate", "-o", tmp_path / "p.npz")
    assert answer.status == 0, answer.err
    assert (tmp_path / "p_report.html").exists() or "report" in answer.out


@pytest.mark.parametrize("command", ["inspect", "plant", "render"])
@pytest.mark.parametrize("encoding", ["ISO-8859-1", "UTF-16"])
def test_names_in_another_encoding_are_refused_with_their_cure(command, encoding, tmp_path):
    text = f'<?xml version="1.0" encoding="{encoding}"?>' + PUSHED.format(
        range="0 1", limited="auto"
    )
    (tmp_path / "craft.xml").write_bytes(text.replace("yoke", "trägt").encode(encoding))
    more = ("--from", "torque:bus", "--to", "attitude") if command == "plant" else ()
    out = () if command == "inspect" else ("-o", tmp_path / ("p.npz" if more else "out"))
    answer = call(command, tmp_path / "craft.xml", *more, *out)
    assert answer.status == 2
    assert "is not UTF-8" in answer.err
    assert "iconv" in answer.err


def test_an_equality_without_a_name_is_called_by_what_it_ties(tmp_path):
    (tmp_path / "tied.xml").write_text(
        "<mujoco><worldbody><site name='w'/><body name='a'><freejoint/><geom size='.1'/>"
        "<site name='s'/><body name='b'><joint name='left' stiffness='9'/><geom size='.1'/></body>"
        "<body name='c'><joint name='right' stiffness='9'/><geom size='.1'/></body></body>"
        "</worldbody><equality><joint joint1='left' joint2='right'/><weld body1='a'/>"
        "<connect site1='s' site2='w'/></equality></mujoco>"
    )
    (said,) = [
        item["message"]
        for item in call("inspect", tmp_path / "tied.xml", "--json").record["warnings"]
        if item["code"] == "equality"
    ]
    assert "joint of 'left' and 'right'" in said
    assert "weld of 'a' and 'world'" in said
    assert "connect of 's' and 'w'" in said


# -- what MuJoCo makes of others -------------------------------------------------------------------
BOOM = {
    "name": "boom",
    "segment": [
        {
            "length": 5.0,
            "section": {"shape": "equivalent", "bending_stiffness_xy": 900.0, "linear_mass": 1.1},
        }
    ],
    "modes": {"xy": 1},
    "root": {"target": "hub"},
}
PART = """<mujoco model="part"><worldbody><body name="bus"><geom type="box" size=".5 .5 .5"
mass="400"/><site name="mount" pos=".1234567890123456 0 0"/></body></worldbody></mujoco>"""
ATTACHED = """<mujoco><option gravity="0 0 0" timestep="0.01"/>
<asset><model name="part" file="part.xml"/></asset><worldbody><body name="craft"><freejoint/>
<geom type="box" size=".1 .1 .1" mass="10"/><attach model="part" body="bus" prefix="m1_"/>
</body></worldbody></mujoco>"""
RING = """<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody><body name="craft">
<freejoint/><geom type="cylinder" size=".5 .4" mass="300"/>
<replicate count="3" euler="0 0 120" sep="-"><site name="mount" pos=".5 0 0"/></replicate>
</body></worldbody></mujoco>"""
ARM = """<robot name="arm"><link name="base"><inertial><mass value="50"/>
<inertia ixx="4" iyy="5" izz="6" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="turn"><inertial><origin xyz="0.5 0 0"/><mass value="3"/>
<inertia ixx="0.01" iyy="0.25" izz="0.25" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="drive" type="revolute"><parent link="base"/><child link="turn"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="10" velocity="1"/></joint>
<link name="plate"/><joint name="weld" type="fixed"><parent link="turn"/><child link="plate"/>
</joint></robot>"""

#: file, its text, the place, and what carries the boom: mass, x of its centre from the place, Izz
MADE = {
    "attach": ("a.xml", ATTACHED, "m1_mount", (410.0, -0.1234567890123456, 0.2 / 3 + 200.0 / 3)),
    "replicate": ("r.xml", RING, "mount-1", (300.0, -0.5, 37.5)),
    "URDF": ("u.urdf", ARM, "plate", (1e9, 0.0, 1.0)),  # held, but for its turn
    "archive": ("z.mjz", None, "mount-2", (300.0, -0.5, 37.5)),
}


@pytest.mark.parametrize("kind", MADE)
@pytest.mark.slow
def test_places_that_mujoco_makes(kind, tmp_path):
    name, text, place, (mass, centre, inertia) = MADE[kind]
    (tmp_path / "part.xml").write_text(PART)
    (tmp_path / "boom.toml").write_text(toml(BOOM))
    if text is None:
        with (tmp_path / name).open("wb") as archive:
            mujoco.MjSpec.from_string(RING).to_zip(archive)
    else:
        (tmp_path / name).write_text(text)
    words = (
        "embed",
        tmp_path / name,
        "--mount",
        f"{place}={tmp_path / 'boom.toml'}",
        "--no-report",
    )
    answer = call(*words, "--no-retime", "--full", "-o", tmp_path / "out.xml")
    assert answer.status in (0, 3), answer.err
    assert "written out by MuJoCo" in " ".join((answer.out + answer.err).split())
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    hub = body_mass(mass, (centre, 0.0, 0.0), (inertia,) * 3)
    wanted = coupled(BOOM, hub, 1, ports=("xy",))
    assert own_frequencies(model) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.slow
def test_a_short_keyframe_is_padded_as_mujoco_does(rod):
    craft = """<mujoco><worldbody><body name="bus" pos="0 0 3"><freejoint/>
    <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/><site name="mount" pos=".5 0 0"/>
    </body><body name="other" pos="1 2 4"><joint name="slide" type="slide" ref="0.25"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
    <keyframe><key name="a" qpos="0 0 1" qvel="0.1"/><key name="b" qvel="0 0 0 0.2"/></keyframe>
    </mujoco>"""
    plain = mujoco.MjModel.from_xml_string(craft)
    flexible = bc.embed(craft, {"mount": rod}).model
    slide = flexible.joint("slide")
    for key in range(2):
        ours, theirs = flexible.key_qpos[key], plain.key_qpos[key]
        np.testing.assert_array_equal(ours[:7], theirs[:7])
        assert ours[slide.qposadr[0]] == theirs[7] == 0.25
        np.testing.assert_array_equal(flexible.key_qvel[key][:6], plain.key_qvel[key][:6])
        assert flexible.key_qvel[key][slide.dofadr[0]] == 0.0
