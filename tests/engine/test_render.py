"""Tests internals, `engine.draw`, `engine.slew`, `engine.backend`, `craft.moving_modes`,
`report.film`: the turn that pictures show, and the pictures.
"""

import os
import re
import struct
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import beamchain as bc
from appendages import seed_boom, tapered_boom
from beamchain.cli import app, shipped
from beamchain.craft.moving_modes import moving_modes
from beamchain.engine import backend, draw
from beamchain.engine.slew import MOST_BENT, simulate
from beamchain.report import film
from command import call
from examples import shipped_arm
from turns import bent

HUB = bc.Hub(mass=500.0, inertia=(400.0, 400.0, 500.0), offset=(1.0, 0.0, 0.0))
ADDS_UP = 0.3  # of the most that two halves of a turn can leave behind
BEYOND = 1.3  # of the bending in proportion to a small turn: large angles, and frames between
TURNED = 0.02  # of the angle asked for: sampled means of the hub's ringing about it
# of the frame's width or height: a margin of 5 per cent each side,
# and thin ends that leave no pixel
FILLED = 0.85
DARK_BLUE = 8  # of 255: by how much blue leads in the sky
READ_BACK = 1e-6  # relative, between mjd_transitionFD and the slopes by differences
SHOWN = 5e-4  # relative, of four digits
# of the hub's motion: the mass centre moves only where angles of a few mrad are not small
SECOND_ORDER = 0.01

YOKE = bc.Segment(
    length=1.0,
    section=bc.Tube(outer_diameter=0.05, wall=0.002),
    material=bc.Material(youngs_modulus=7e10, density=2700.0),
)
PANEL = bc.Segment(
    length=2.5,
    section=bc.Rectangle(width_y=0.02, width_z=1.2),
    material=bc.Material(youngs_modulus=2e9, density=80.0),
    nonstructural_mass=2.0,
)


ARRAY = bc.Beam(segments=(YOKE, PANEL, PANEL), lumps=(bc.Lump(x=6.0, mass=1.0),))
ARRAY_SPEC = shipped.pick(shipped.examples(), "array_scene", "example").path


# -- the turn --------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("modes", "axis"),
    [
        ({"xz": 2}, 1),
        ({"torsion": 1}, 0),
    ],
)
def test_slew_turns_by_the_angle_and_stops(modes, axis):
    fit = bc.fit(tapered_boom(), name="boom", modes=modes, root=bc.spec.Root(hub=HUB))
    model = mujoco.MjModel.from_xml_string(fit.scene_mjcf())
    slew = simulate(model, angle=0.5, frames=240)
    assert slew.body == "hub"
    assert slew.axis == axis
    turned = 2.0 * np.arctan2(slew.positions[:, 4 + slew.axis], slew.positions[:, 3])
    # whole periods: the ringing averages out
    last = slew.times > slew.times[-1] - 3.0 * 2.0 * np.pi / slew.omega
    assert np.mean(turned[last]) == pytest.approx(0.5, rel=TURNED)
    assert bent(model, slew).max() < BEYOND * MOST_BENT
    periods = slew.duration * slew.omega / (2.0 * np.pi)
    # what the halves of the turn leave behind adds up
    assert np.sin(np.pi * periods / 2.0) ** 2 > ADDS_UP
    assert slew.loudest > 0


def test_exaggeration_is_of_the_springs_alone():
    fit = bc.fit(seed_boom(), modes={"xy": 2}, root=bc.spec.Root(hub=HUB))
    slew = simulate(mujoco.MjModel.from_xml_string(fit.scene_mjcf()), angle=0.5, frames=40)
    k = slew.loudest
    springs = list(slew.elastic)
    assert slew.shown(5.0)[k, springs] == pytest.approx(5.0 * slew.positions[k, springs])
    np.testing.assert_array_equal(slew.shown(5.0)[k, :7], slew.positions[k, :7])
    np.testing.assert_array_equal(slew.shown(0.0)[k, springs], 0.0)


# -- files -----------------------------------------------------------------------------------------
def frames(count=6):
    out = np.zeros((count, 41, 60, 3), dtype=np.uint8)
    for k in range(count):
        out[k, 10 : 20 + k, 10:20] = (220, 160, 40)
    return list(out)


def test_png_and_gif_hold_the_frames(tmp_path):
    (tmp_path / "a.png").write_bytes(film.png(frames()[2]))
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), frames()[2])
    (tmp_path / "a.gif").write_bytes(film.gif(frames(), 20.0))
    with Image.open(tmp_path / "a.gif") as moving:
        assert moving.n_frames == 6
        assert moving.size == (60, 41)
        assert moving.info["duration"] == 50
        assert moving.info["loop"] == 0


def samples(mp4):
    """The number of frames that an MP4 says it holds, in its table of sample sizes."""
    at = mp4.index(b"stsz")
    return struct.unpack(">I", mp4[at + 12 : at + 16])[0]


@pytest.mark.skipif(
    film.ffmpeg() is None,
    reason="there is neither ffmpeg nor imageio-ffmpeg, and only they make MP4",
)
def test_mp4_by_ffmpeg():
    made = film.mp4(frames(), 20.0)
    assert made is not None
    assert made[4:8] == b"ftyp"
    assert b"avc1" in made
    assert samples(made) == 6


@pytest.fixture
def without_ffmpeg(monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(film, "find_spec", lambda name: None)


def test_no_mp4_without_ffmpeg(without_ffmpeg):
    assert film.mp4(frames(), 20.0) is None


@pytest.mark.parametrize(
    ("program", "said"),
    [("exit 1", "made no film: it does not say why"), ("echo no libx264 >&2; exit 1", "libx264")],
)
def test_an_ffmpeg_that_fails_says_so(program, said, tmp_path, monkeypatch):
    (tmp_path / "ffmpeg").write_text(f"#!/bin/sh\n{program}\n")
    (tmp_path / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    with pytest.raises(bc.BeamchainError, match=said):
        film.mp4(frames(), 20.0)


@pytest.mark.slow
def test_render_without_ffmpeg_makes_no_mp4(boom, tmp_path, monkeypatch, without_ffmpeg):
    monkeypatch.setattr(backend, "choose_renderer", lambda: "none")
    blank = np.zeros((64, 64, 3), dtype=np.uint8)
    monkeypatch.setattr(
        draw, "draw_frames", lambda model, body, shown, ghosts, **_: iter([blank] * len(shown))
    )
    arguments = ["render", str(boom / "scene.xml"), "-o", str(tmp_path / "o")]
    arguments += ["--width", "64"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0
    assert not done.stderr
    assert {path.name for path in (tmp_path / "o").iterdir()} == {"scene.png", "scene.gif"}


def command(arguments, folder, **environment):
    # without a screen, whatever this machine has
    keep = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(
        [sys.executable, "-m", "beamchain", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**keep, **environment},
    )


@pytest.fixture(scope="module")
def boom(tmp_path_factory):
    folder = tmp_path_factory.mktemp("boom")
    fit = bc.fit(seed_boom(), name="boom", modes={"xy": 2}, root=bc.spec.Root(hub=HUB))
    (folder / "scene.xml").write_text(fit.scene_mjcf())
    return folder


RENDERERS = pytest.mark.parametrize("renderer", ["egl", "osmesa"])


def check(renderer):
    if not backend._works(renderer):
        pytest.skip(f"MuJoCo cannot draw with {renderer} on this machine")


def pixels(path):
    with Image.open(path) as still:
        return np.asarray(still.convert("RGB")).astype(int)


def looks(picture):
    """The sky is dark blue, and the spacecraft reaches across the frame, lit."""
    caption = picture.shape[0] * 9 // 10  # the line of text is below
    red, green, blue = np.moveaxis(picture[:caption], -1, 0)
    sky = (blue > red + DARK_BLUE) & (blue > green + DARK_BLUE) & (blue < 110) & (red < 40)
    assert 0.2 < sky.mean() < 0.95
    rows, columns = np.nonzero(~sky & (red > 60) & (red > blue + 20))  # the hub is gold
    craft = np.nonzero((blue > 110) | (red > 60))
    across = max(np.ptp(craft[0]) / caption, np.ptp(craft[1]) / picture.shape[1])
    assert across > FILLED
    assert rows.size > 100
    assert np.ptp(columns) > 5
    assert red[rows, columns].max() > 150  # lit


@pytest.mark.slow
@RENDERERS
def test_render(renderer, boom, tmp_path):
    check(renderer)
    arguments = ["render", str(boom / "scene.xml"), "-o", "pictures"]
    arguments += ["--width", "200", "--exaggerate", "3"]
    done = command(arguments, tmp_path, MUJOCO_GL=renderer)
    assert done.returncode == 0, done.stderr
    assert "degrees about z in" in " ".join(done.stdout.split())
    assert {"scene.png", "scene.gif"} <= {path.name for path in (tmp_path / "pictures").iterdir()}
    picture = pixels(tmp_path / "pictures" / "scene.png")
    assert picture.shape == (125, 200, 3)
    looks(picture)
    with Image.open(tmp_path / "pictures" / "scene.gif") as moving:
        assert moving.n_frames > 20


@pytest.mark.slow
def test_modes_of_a_craft_without_sky_and_light_are_drawn_like_others(tmp_path):
    renderer = next((name for name in ("egl", "osmesa") if backend._works(name)), "egl")
    check(renderer)
    craft = shipped.pick(shipped.everything(), "craft", "kind").path
    bc.embed(craft, {"mount": ARRAY_SPEC}).write(tmp_path / "flexible.xml")
    text = (tmp_path / "flexible.xml").read_text()
    assert "skybox" not in text
    assert "<light" not in text
    arguments = ["render", "flexible.xml", "-o", "o", "--modes", "1", "--width", "180"]
    done = command(arguments, tmp_path, MUJOCO_GL=renderer)
    assert done.returncode == 0, done.stderr
    (told,) = re.findall(r"mode 1, .*?: ([\d.]+) rad/s", " ".join(done.stdout.split()))
    untimed = bc.embed(craft, {"mount": ARRAY_SPEC}, retime=False)
    modes = bc.linearise(untimed.model).frequencies()
    (drawn,) = moving_modes(draw.stage(tmp_path / "flexible.xml"), 1, 4)
    assert drawn.omega == pytest.approx(modes[0], rel=READ_BACK)
    assert float(told) == pytest.approx(modes[0], rel=SHOWN)
    looks(pixels(tmp_path / "o" / "flexible_mode1.png"))
    with Image.open(tmp_path / "o" / "flexible_mode1.gif") as moving:
        assert moving.n_frames == 24  # every second one
    if film.ffmpeg():
        assert samples((tmp_path / "o" / "flexible_mode1.mp4").read_bytes()) == 48
    done = command([*arguments[:5], "99", "--force"], tmp_path, MUJOCO_GL=renderer)
    assert done.returncode == 2
    assert "--modes = 99" in done.stderr


def test_moving_modes_leave_the_mass_centre_where_it_is():
    """A free spacecraft that rings has no momentum: what the array does, the hub answers."""
    fit = bc.fit(ARRAY, modes={"xy": 2}, root=bc.spec.Root(hub=HUB))
    model = mujoco.MjModel.from_xml_string(fit.scene_mjcf())
    data = mujoco.MjData(model)
    for mode in moving_modes(model, 2, 48, 0.01):
        centres, hubs = [], []
        for positions in mode.positions:
            data.qpos[:] = positions
            mujoco.mj_forward(model, data)
            centres.append(data.subtree_com[0].copy())
            hubs.append(data.body("hub").xpos.copy())
        assert np.ptp(hubs, axis=0).max() > 0.0
        assert np.ptp(centres, axis=0).max() < SECOND_ORDER * np.ptp(hubs, axis=0).max()
        np.testing.assert_allclose(mode.positions[0], mode.rest, atol=1e-12)


def test_moving_modes_have_the_frequencies_of_the_file_without_timing():
    """Not of its armature, which slows the second one by a third at 0.25 s."""
    fit = bc.fit(
        ARRAY, modes={"xy": 2}, root=bc.spec.Root(hub=HUB), damping=bc.Damping(ratio=0.005)
    )
    model = mujoco.MjModel.from_xml_string(fit.scene_mjcf())
    wanted = [mode.omega for mode in moving_modes(model, 2, 4)]
    bc.retime(model, 0.25)
    assert [mode.omega for mode in moving_modes(model, 2, 4)] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.slow
def test_render_without_a_renderer_says_what_to_install(boom, tmp_path):
    done = command(["render", str(boom / "scene.xml"), "-o", "o"], tmp_path, MUJOCO_GL="glfw")
    if done.returncode == 0:
        pytest.skip("glfw draws here without a screen")
    assert done.returncode == 2
    assert done.stderr.startswith("beamchain: MUJOCO_GL = 'glfw' does not draw here")
    assert "libosmesa6" in done.stderr
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("option", "value"),
    [("--exaggerate", "-1"), ("--angle", "1000"), ("--width", "1"), ("--modes", "101")],
)
def test_render_checks_its_numbers(option, value):
    done = call("render", "scene.xml", "-o", "o", option, value)
    assert done.status == 2
    assert f"{option} = {value}" in done.err


@pytest.mark.slow
def test_the_elbow_of_an_arm_turns_by_the_angle_asked_for_and_rings():
    arm = draw.stage(shipped_arm().to_mjcf())
    degrees = -60.0
    slew = simulate(arm, angle=np.radians(degrees), frames=60, joint="elbow")
    elbow = np.degrees(slew.positions[:, arm.joint("elbow").qposadr[0]])
    # the first mode that the elbow moves, beside what `test_trees.py` finds in finite elements
    assert slew.omega == pytest.approx(15.37, rel=1e-3)
    after = elbow[slew.times >= slew.duration]
    # a torque of the rigid arm on a flexible one: the mean over the ringing
    assert after.mean() == pytest.approx(degrees, abs=2.0)
    rings = bent(arm, slew)[slew.times >= slew.duration]
    assert 0.02 < rings.max() < BEYOND * MOST_BENT
    # the bus turns the other way, as nothing pushes from outside
    assert np.sign(slew.positions[-1, 6]) == -np.sign(degrees)

    chosen = simulate(arm, angle=None, frames=10, joint="elbow")
    assert (chosen.joint, chosen.angle) == ("elbow", pytest.approx(np.radians(20.0)))
    turned = np.degrees(chosen.positions[:, arm.joint("elbow").qposadr[0]])
    assert turned[chosen.times >= chosen.duration].mean() == pytest.approx(20.0, abs=2.0)

    with pytest.raises(bc.InputError, match="nobody.*elbow"):
        simulate(arm, angle=1.0, frames=10, joint="nobody")
    with pytest.raises(bc.InputError, match="upper_hinge1_xy.*without springs"):
        simulate(arm, angle=1.0, frames=10, joint="upper_hinge1_xy")
