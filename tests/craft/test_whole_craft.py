"""What a user is told of the whole spacecraft: rigid twin, prefixes,
modes at keyframes and in words, mass properties."""

import json
import re

import mujoco
import numpy as np
import pytest

import beamchain as bc
from command import run

SAME = 1e-12  # relative; two ways to add up the same bodies
# relative; chains with two modes per plane on one craft, against all modes of the beams
MODE = 2e-3

PANEL = bc.Spec(
    name="array",
    segment=(
        bc.Segment(
            length=6.0,
            section=bc.Equivalent(
                bending_stiffness_xy=3e3,
                bending_stiffness_xz=9e3,
                linear_mass=3.0,
                torsion_stiffness=4e3,
                polar_inertia=0.6,
            ),
        ),
    ),
    modes=bc.Modes(xy=2, xz=2, torsion=1),
    damping=bc.Damping(ratio=0.005),
)

CRAFT = """<mujoco model="bus"><option gravity="0 0 0"/><worldbody><body name="bus">
<freejoint name="free"/>
<inertial pos="0.1 0 0.05" mass="400" diaginertia="150 200 250"/>
<body name="yoke" pos="0 0.8 0"><joint name="drive" axis="0 1 0"/>
<inertial pos="0 0.1 0" mass="5" diaginertia="0.2 0.1 0.2"/>
<site name="+y" pos="0 0.2 0" xyaxes="0 1 0 -1 0 0"/></body>
<body name="other yoke" pos="0 -0.8 0"><inertial pos="0 -0.1 0" mass="5" diaginertia="0.2 0.1 0.2"/>
<site name="-y" pos="0 -0.2 0" xyaxes="0 -1 0 1 0 0"/></body>
</body></worldbody><keyframe><key name="turned" qpos="0 0 0 1 0 0 0 1.2"/></keyframe></mujoco>"""


@pytest.fixture(scope="module")
def flexible():
    return bc.embed(CRAFT, {"+y": PANEL, "-y": PANEL}, retime=False)


@pytest.fixture(scope="module")
def one():
    """With an array on one side."""
    return bc.embed(CRAFT, {"+y": PANEL}, retime=False)


@pytest.mark.slow
def test_equal_appendages_get_prefixes_of_their_places(flexible, one):
    assert [a.prefix for a in flexible.appendages] == ["array__y_", "array_-y_"]
    assert [a.prefix for a in one.appendages] == ["array_"]


@pytest.mark.parametrize(
    ("places", "prefixes"),
    [
        (("array_y", "mount"), ["array_y_", "array_mount_"]),
        (("mount", "array"), ["array_mount_", "array_"]),
        (("body:array-l", "array-r"), ["array-l_", "array-r_"]),
        (("array",), ["array_"]),
        (("m+", "m?"), ["array_m__", "array_m__2_"]),
    ],
)
def test_no_prefix_says_the_appendages_name_twice(places, prefixes):
    sites = "".join(
        f'<body name="{at}" pos="0 {i} 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        f'<site name="{at}"/></body>'
        for i, at in enumerate(place.removeprefix("body:") for place in places)
    )
    craft = f"""<mujoco><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="400" diaginertia="150 200 250"/>{sites}</body></worldbody></mujoco>"""
    panel = PANEL.replace(modes={"xy": 1, "xz": 0})
    at = {place if ":" in place else f"site:{place}": panel for place in places}
    file = bc.embed(craft, at, rigid=True)
    assert [a.prefix for a in file.appendages] == prefixes
    assert [file.model.body(f"{prefix}link1").id for prefix in prefixes]


@pytest.mark.slow
def test_a_second_equal_appendage_leaves_the_first_its_prefix_as_does_a_new_one_in_its_place():
    panel = PANEL.replace(modes={"xy": 1, "xz": 0})
    file = bc.embed(CRAFT, {"+y": panel}, rigid=True).to_mjcf()
    both = bc.embed(file, {"-y": panel}, rigid=True)
    prefixes = {"+y": "array_", "-y": "array_-y_"}
    assert {a.at: a.prefix for a in both.appendages} == prefixes
    again = bc.embed(both.to_mjcf(), {"+y": panel.replace(modes={"xy": 2, "xz": 0})}, rigid=True)
    assert {a.at: a.prefix for a in again.appendages} == prefixes


def rigid_inertia(model, qpos):
    """`(6, 6)` of everything about the world's origin, from MuJoCo's own bodies,
    everything frozen."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    out = np.zeros((6, 6))
    for i in range(1, model.nbody):
        m = model.body_mass[i]
        c = data.xipos[i]
        turn = data.ximat[i].reshape(3, 3)
        cross = np.array([[0, -c[2], c[1]], [c[2], 0, -c[0]], [-c[1], c[0], 0]])
        out[:3, :3] += m * np.eye(3)
        out[3:, :3] += m * cross
        out[:3, 3:] -= m * cross
        out[3:, 3:] += turn @ np.diag(model.body_inertia[i]) @ turn.T - m * cross @ cross
    return out


@pytest.mark.slow
def test_the_rigid_twin_has_the_same_bodies_and_keyframes(flexible, tmp_path):
    twin = bc.embed(CRAFT, {"+y": PANEL, "-y": PANEL}, rigid=True)
    model = mujoco.MjModel.from_xml_path(str(twin.write(tmp_path / "rigid.xml")[-1]))
    soft = flexible.model
    assert model.nv == 7
    assert model.ntendon == 0
    for kind in ("nbody", "nsite", "ngeom", "nkey"):
        assert getattr(model, kind) == getattr(soft, kind), kind
    assert [model.site(i).name for i in range(model.nsite)] == [
        soft.site(i).name for i in range(soft.nsite)
    ]
    for pose in (0, 1):
        ours = model.key_qpos[0] if pose else model.qpos0
        theirs = soft.key_qpos[0] if pose else soft.qpos0
        want = rigid_inertia(soft, theirs)
        np.testing.assert_allclose(
            rigid_inertia(model, ours), want, rtol=SAME, atol=SAME * np.abs(want).max()
        )
    assert "rigid twin" in twin.headline


@pytest.mark.slow
def test_the_rigid_twin_becomes_flexible_again(tmp_path):
    twin = bc.embed(CRAFT, {"+y": PANEL}, rigid=True).write(tmp_path / "rigid.xml")[-1]
    assert bc.embed(twin, {"+y": PANEL}, retime=False).model.nv > 7


@pytest.mark.slow
def test_modes_at_a_keyframe(flexible):
    rest = flexible.modes_at("rest")
    turned = flexible.modes_at("turned")
    for mode in (*rest, *turned):
        assert mode.error is not None
        assert abs(mode.error) < MODE
    # the pose matters
    assert max(abs(a.exact / b.exact - 1.0) for a, b in zip(rest, turned, strict=True)) > 0.01
    with pytest.raises(bc.InputError, match="'turnt'.* rest, turned"):
        flexible.modes_at("turnt")


@pytest.mark.slow
def test_modes_are_named_by_what_moves():
    fixed = CRAFT.replace('<joint name="drive" axis="0 1 0"/>', "").replace(' 1.2"/>', '"/>')
    plain = fixed.replace('pos="0.1 0 0.05"', 'pos="0 0 0"')
    words = {
        m.words for m in bc.embed(plain, {"+y": PANEL, "-y": PANEL}, retime=False).assembly.judged
    }
    assert "+y and -y opposed, bending xy; bus about z" in words
    assert "+y and -y in phase, bending xy; bus along x" in words
    # mirrored mounts: only what turns the same way in the world turns the bus
    assert "+y and -y in phase, torsion; bus about y" in words
    assert "+y and -y opposed, torsion; bus still" in words


@pytest.mark.slow
def test_mass_properties_of_the_whole(flexible):
    found = flexible.composite
    whole = rigid_inertia(flexible.model, flexible.model.qpos0)
    centre = np.array([whole[2, 4], whole[0, 5], whole[1, 3]]) * [-1, -1, -1] / whole[0, 0]
    assert found.mass == pytest.approx(whole[0, 0], rel=SAME)
    np.testing.assert_allclose(found.centre, centre, atol=1e-12)
    cross = np.array(
        [[0, -centre[2], centre[1]], [centre[2], 0, -centre[0]], [-centre[1], centre[0], 0]]
    )
    inertia = whole[3:, 3:] + whole[0, 0] * cross @ cross
    np.testing.assert_allclose(found.inertia, inertia, atol=1e-9 * inertia.max())
    assert found.body == "bus"


def slowed(result):
    return [said for said in result.warnings if said.code == "slowed-modes"]


@pytest.mark.slow
def test_modes_that_the_step_slows_are_told():
    timed = CRAFT.replace(
        '<option gravity="0 0 0"/>',
        '<option gravity="0 0 0" integrator="implicitfast" timestep="{}"/>',
    )
    quick, slow = (bc.embed(timed.format(step), {"+y": PANEL}, retime=True) for step in (0.01, 0.4))
    assert not slowed(quick)
    assert "too fast for implicitfast at 0.4 s" in slowed(slow)[0]
    assert not slowed(bc.plant(quick, ["torque:bus"], discrete=0.01))
    assert [
        said
        for said in bc.plant(slow, ["torque:bus"], discrete=0.4).warnings
        if said.code == "slowed-modes"
    ]


@pytest.mark.slow
def test_the_command_tells_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "craft.xml").write_text(CRAFT)
    run(["init", "boom"], capsys, monkeypatch)
    at = ["embed", "craft.xml", "--mount", "+y=boom.toml", "--no-report"]
    code, told, _ = run([*at, "-o", "flexible.xml", "--json"], capsys, monkeypatch)
    record = json.loads(told)
    assert code == 0
    assert record["composite"]["body"] == "bus"
    assert record["modes"][0]["moving"]
    code, told, _ = run([*at, "-o", "rigid.xml", "--rigid"], capsys, monkeypatch)
    assert code == 0
    assert re.search(r"rigid twin", told)
    code, told, _ = run(["inspect", "rigid.xml"], capsys, monkeypatch)
    assert "bus with all that it carries" in told
