"""Flexible bodies on flexible bodies against three-dimensional finite elements of the whole arm,
and the stability of their timing at every pose, payload and step."""

import copy
import re
import sys

import mujoco
import numpy as np
import pytest
from lxml import etree
from scipy.linalg import eigh

import beamchain as bc
from arms import Arm, Link, frequencies, mjcf, side, toml
from command import call
from craft_truth import Pair, compiled

BAND = 20.0
AGREE = 0.05  # stated and found error of the craft, relative
# h^2 w^2 of a timed tree, 4 at z = -1: 2 % less, and what modal damping of 0.5 % changes of that
CLEAR = 3.93
MODES = "[modes]\nxy = 2\nxz = 2\ntorsion = 1\n"
PLANE = "[modes]\nxy = 1\nxz = 0\n"  # where any modes do
ANGLES = {"rest": 0.0, "bent": np.pi / 4.0, "square": np.pi / 2.0}
UPPER = Link("upper", 6.0, 0.05, 0.08)
FORE = Link("fore", 5.0, 0.04, 0.05, 2.0, (0.01, 0.01, 0.01), (0.0, 0.0, 1.0))


def arm(hand=10.0, bus=400.0, **hinge):
    fore = Link(**{**FORE.__dict__, **hinge})
    keys = {name: {"fore": angle} for name, angle in ANGLES.items() if angle}
    inertia = tuple(np.array([80.0, 100.0, 120.0]) * bus / 400.0)
    return Arm((UPPER, fore), bus, inertia, hand=hand, hand_inertia=(0.04 * hand,) * 3, keys=keys)


def written(folder, made, tolerance=0.02, modes=MODES, band=BAND, **craft):
    """The files of an arm: its craft, and the specification at each place."""
    (folder / "arm.xml").write_text(mjcf(made, **craft))
    for link in made.links:
        (folder / f"{link.name}.toml").write_text(toml(made, link, band, tolerance, modes))
    return folder / "arm.xml", {
        f"place_{link.name}": folder / f"{link.name}.toml" for link in made.links
    }


def qpos_of(model, name):
    return model.qpos0 if name == "rest" else model.key(name).qpos


FREE, WELDED = {}, {"axis": None}
SPRUNG = {"stiffness": 4000.0, "damping": 5.0}
SERVO = {"kp": 2000.0, "kv": 40.0, "servo": "position"}
GENERAL = {**SPRUNG, "kp": 500.0, "kv": 120.0, "servo": "general"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hand", "hinge", "poses"),
    [
        (0.0, FREE, ("bent",)),
        (1000.0, FREE, ("bent", "square")),
        (10.0, SPRUNG, ("bent",)),
        (10.0, SERVO, ("bent",)),
        (1000.0, GENERAL, ("square",)),
        (1000.0, WELDED, ()),
    ],
)
def test_promise_and_modes_of_an_arm_are_what_finite_elements_find(tmp_path, hand, hinge, poses):
    made = arm(max(hand, 1e-3), **hinge)
    if made.links[1].axis is None:
        poses = ()
    keys = {name: made.keys[name] for name in poses}
    made = Arm(**{**made.__dict__, "keys": keys})
    flexible = bc.embed(*written(tmp_path, made), retime=False)
    for name, stated in flexible.promise.poses.items():
        truth = side(made, BAND, {"fore": ANGLES[name]})
        qpos = qpos_of(flexible.model, name)
        found, place = Pair(truth, compiled(flexible.model, qpos), list(range(6)), BAND).search()
        line = f"{hand:g} kg, {name}: stated {stated:.3e}, found {found:.3e} at {place:.4g}"
        sys.stdout.write(f"{line}\n")
        assert stated == pytest.approx(found, rel=AGREE, abs=1e-5)
        true = frequencies(truth, 6)
        ours = [mode for mode in flexible.modes_at(name) if mode.exact is not None]
        count = int(np.sum(true <= BAND))
        assert [m.exact for m in ours[:count]] == pytest.approx(true[:count], rel=1e-5)
        assert [m.mujoco for m in ours[:count]] == pytest.approx(true[:count], rel=1e-3)


@pytest.mark.slow
def test_modes_of_what_carries_are_added_one_at_a_time(tmp_path):
    """Static shapes of loads on the port do not count as modes of the appendage."""
    flexible = bc.embed(*written(tmp_path, arm(), tolerance=4e-3, modes=""), retime=False)
    assert flexible.met
    highest = {}
    for step in flexible.steps:
        place, number, port = re.match(r"(\S+): mode (\d+) in (\w+):", step).groups()
        before = highest.get((place, port), int(number) - 1)
        assert int(number) == before + 1
        highest[place, port] = int(number)
    assert highest
    for appendage in flexible.appendages:
        for (place, port), number in highest.items():
            if place == appendage.at:
                assert getattr(appendage.fit.spec.modes, port) == number
                kept = appendage.fit.target[port].frequencies
                assert kept[:number] == pytest.approx(cantilever(place, port, number), rel=1e-6)


def cantilever(place, port, count):
    """Frequencies of a link of the arm with its root held, in closed form."""
    link = UPPER if place.endswith("upper") else FORE
    section = link.section
    if port in ("torsion", "axial"):
        over = section.polar if port == "torsion" else section.mass
        speed = np.sqrt(getattr(section, port) / over)
        return [(k + 0.5) * np.pi / link.length * speed for k in range(count)]
    bending = section.bending_z if port == "xy" else section.bending_y
    roots = [1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349, 14.1371683910][:count]
    return [(root / link.length) ** 2 * np.sqrt(bending / section.mass) for root in roots]


@pytest.mark.slow
def test_a_carried_body_is_moved_as_it_is_written_and_comes_back(tmp_path):
    craft, at = written(tmp_path, arm(), modes=PLANE)
    before = craft.read_bytes()
    out = tmp_path / "flexible.xml"
    bc.embed(craft, at, retime=False).write(out)
    root = etree.fromstring(out.read_bytes())
    moved = next(node for node in root.iter("body") if node.get("name") == "joint_fore")
    assert moved.getparent().tag == "frame"
    assert str(moved.getparent().getparent().get("name")).startswith("upper_link")
    answer = call("embed", out, "--remove", "-o", out, "--force")
    assert answer.status == 0
    assert out.read_bytes() == before


@pytest.mark.slow
def test_the_file_embedded_again_is_the_same(tmp_path):
    craft, at = written(tmp_path, arm(), modes=PLANE)
    out = tmp_path / "flexible.xml"
    bc.embed(craft, at, retime=False).write(out)
    again = bc.embed(out, {"place_fore": at["place_fore"]}, retime=False)
    assert again.to_mjcf(tmp_path) == out.read_text()


@pytest.mark.slow
def test_keyframes_keep_their_angles(untimed):
    model = untimed.model
    data = mujoco.MjData(model)
    for name, angle in ANGLES.items():
        data.qpos[:] = qpos_of(model, name)
        mujoco.mj_forward(model, data)
        assert data.joint("hinge_fore").qpos[0] == angle
        reach = [6.5 + 5.0 * np.cos(angle), 5.0 * np.sin(angle), 0.0]
        assert data.body("hand").xpos == pytest.approx(reach, abs=1e-12)


@pytest.mark.slow
def test_the_rigid_twin_is_the_same_tree(tmp_path):
    twin = bc.embed(*written(tmp_path, arm(), modes=PLANE), rigid=True)
    assert twin.model.nv == 7
    data = mujoco.MjData(twin.model)
    mujoco.mj_forward(twin.model, data)
    assert data.body("hand").xpos == pytest.approx([11.5, 0.0, 0.0], abs=1e-12)


@pytest.mark.slow
def test_an_appendage_right_on_a_port_is_the_welded_arm(tmp_path):
    made = arm(0.001, axis=None, mass=0.001)
    craft, at = written(tmp_path, Arm(**{**made.__dict__, "keys": {}}))
    hung = craft.read_text().replace('carries = ["joint_fore"]', "")
    welded = bc.embed(craft, at, retime=False)
    bare = etree.fromstring(hung.encode())
    body = next(node for node in bare.iter("body") if node.get("name") == "joint_fore")
    body.getparent().remove(body)
    craft.write_bytes(etree.tostring(bare))
    for name in ("upper", "fore"):
        spec = tmp_path / f"{name}.toml"
        lines = [line for line in spec.read_text().splitlines() if "carries" not in line]
        spec.write_text("\n".join(lines))
    direct = bc.embed(
        craft, {"place_upper": at["place_upper"], "place_upper:end": at["place_fore"]}, retime=False
    )
    ours = [mode.mujoco for mode in direct.modes_at("rest")]
    assert ours == pytest.approx([mode.mujoco for mode in welded.modes_at("rest")], rel=1e-4)
    out = tmp_path / "direct.xml"
    direct.write(out)
    assert call("embed", out, "--remove", "-o", out, "--force").status == 0
    assert out.read_bytes() == craft.read_bytes()


@pytest.fixture(scope="module")
def untimed(tmp_path_factory):
    return bc.embed(*written(tmp_path_factory.mktemp("arm"), arm()), retime=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "integrator"), [(0.002, "implicitfast"), (0.05, "Euler"), (0.2, "implicitfast")]
)
def test_timing_is_stable_at_every_step_pose_and_payload(untimed, step, integrator):
    model = copy.copy(untimed.model)
    model.opt.timestep = step
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    bc.retime(model, step, integrator)
    hand = model.body("hand").id
    for mass in (0.001, 10.0, 1000.0):
        model.body_mass[hand] = mass
        model.body_inertia[hand] = 0.04 * mass
        mujoco.mj_setConst(model, mujoco.MjData(model))
        for angle in np.linspace(0.0, np.pi / 2.0, 5):
            data = mujoco.MjData(model)
            data.joint("hinge_fore").qpos[0] = angle
            data.qvel[6:] = 1e-4 * np.random.default_rng(0).standard_normal(model.nv - 6)
            mujoco.mj_forward(model, data)
            still = compiled(model, data.qpos)
            assert step**2 * eigh(still.stiffness, still.mass, eigvals_only=True)[-1] < CLEAR
            largest = 0.0
            for k in range(2000):
                mujoco.mj_step(model, data)
                if k == 200:
                    largest = np.abs(data.ten_velocity).max()
            assert np.abs(data.ten_velocity).max() < 3.0 * largest


@pytest.mark.slow
def test_the_command_line_carries_too_and_refuses_without_writing(tmp_path):
    craft, at = written(tmp_path, arm())
    for spec in at.values():
        lines = spec.read_text().splitlines()
        spec.write_text("\n".join(line for line in lines if "carries" not in line))
    words = [word for place, spec in at.items() for word in ("--mount", f"{place}={spec}")]
    words += ["--no-retime", "--no-report"]
    out = tmp_path / "flexible.xml"
    carry = ["--carry", "place_upper:end=joint_fore", "--carry", "place_fore:end=hand"]
    assert call("embed", craft, *words, *carry, "-o", out).status == 0
    assert '"piece": "moved", "body": "hand"' in out.read_text()
    out = tmp_path / "none.xml"
    for wrong in ("place_upper:end", "=hand", "place_upper:end=nobody"):
        answer = call("embed", craft, *words, "--carry", wrong, "-o", out)
        assert answer.status == 2
        assert "Traceback" not in answer.err
        assert not out.exists()
