"""Tests internals, `engine.draw` and `engine.geometry`: where the camera stands, its light, and
what lies on what in a frame."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from beamchain.engine import draw
from beamchain.engine.geometry import drawn_points
from beamchain.engine.library import rest
from beamchain.errors import EngineError

PLAIN = "<mujoco><worldbody>{}<geom size='1'/></worldbody></mujoco>"
LAMP = "<light pos='0 0 9'/>"


@pytest.mark.parametrize("degrees", [0.0, 35.0, 90.0])
@pytest.mark.parametrize("sides", [(1.0,), (1.0, -1.0)], ids=["one side", "both sides"])
@pytest.mark.parametrize("lean", [(0.01, 0.0, 0.0), (0.0, -0.01, 0.0)])
def test_arrays_are_seen_from_the_side_on_one_side_and_on_both(degrees, sides, lean):
    """What stands on both sides has its mean near the body, in any direction from it; how tall it
    is makes no difference."""
    way = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
    points = np.array([side * x * way for side in sides for x in np.linspace(0.5, 6.0, 20)]) + lean
    up = np.array([0.0, 0.0, 9.0])
    points = np.vstack([points - up, points + up])
    model = mujoco.MjModel.from_xml_string(PLAIN.format(""))
    place = np.array([30.0, -40.0, 5.0])
    again = 360.0 / len(sides)  # either end of what stands on both sides is its direction
    for size in (1.0, 0.02):
        camera, _ = draw._camera(model, size * points + place, place, 1.6)
        off = (camera.azimuth - degrees - draw.AZIMUTH) % again
        assert min(off, again - off) == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("lamp", ["", LAMP], ids=["no light", "a light"])
def test_what_faces_the_camera_is_lit_whatever_lights_the_file_has(lamp):
    model = draw.stage(PLAIN.format(lamp))
    assert min(*model.vis.headlight.ambient, *model.vis.headlight.diffuse) >= 0.3


def test_a_file_gets_a_sky_and_a_light_and_a_compiled_one_stays(tmp_path):
    (tmp_path / "a.xml").write_text(PLAIN.format(""))
    made = draw.stage(tmp_path / "a.xml")
    assert (made.nlight, made.ntex) == (1, 1)
    assert made.tex_type.tolist() == [int(mujoco.mjtTexture.mjTEXTURE_SKYBOX)]
    for name in ("a.mjb", "a.MJB"):
        plain = mujoco.MjModel.from_xml_string(PLAIN.format(""))
        mujoco.mj_saveModel(plain, str(tmp_path / name))
        kept = draw.stage(tmp_path / name)
        assert (kept.ngeom, kept.ntex) == (1, 0)
    (tmp_path / "spoilt.mjb").write_bytes(b"spoilt")
    with pytest.raises(EngineError):
        draw.stage(tmp_path / "spoilt.mjb")


@pytest.mark.parametrize("aspect", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("fovy", [30.0, 70.0])
def test_what_is_drawn_just_fits_between_the_sides_of_the_frame(aspect, fovy):
    """Through a pinhole: five per cent are left at two opposite sides, as much or more above and
    below them, and there the same on both sides."""
    model = mujoco.MjModel.from_xml_string(PLAIN.format(""))
    model.vis.global_.fovy = fovy
    points = np.random.default_rng(4).normal(size=(60, 3)) * [4.0, 1.0, 2.0] + [7.0, -3.0, 1.0]
    camera, extent = draw._camera(model, points, np.zeros(3), aspect)
    azimuth, elevation = np.radians([camera.azimuth, camera.elevation])
    forward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) * np.cos(elevation)
    forward[2] = np.sin(elevation)
    right = np.cross(forward, [0.0, 0.0, 1.0]) / np.cos(elevation)
    away = points - (camera.lookat - camera.distance * forward)
    half = np.tan(np.radians(fovy) / 2.0)
    assert extent == pytest.approx(2.0 * camera.distance * half)
    depth = away @ forward
    assert depth.mean() == pytest.approx(camera.distance)
    left_over = []
    for axis, side in ((right, aspect * half), (np.cross(right, forward), half)):
        across, allowed = away @ axis, side / 1.05 * depth
        margins = np.min(allowed - across), np.min(allowed + across)
        assert margins[0] == pytest.approx(margins[1], abs=1e-9)
        left_over.append(margins[0])
    assert min(left_over) == pytest.approx(0.0, abs=1e-9)


def test_thin_solids_are_made_thick_enough_to_be_seen():
    """All three sides of a box, radius and half length of rods, and the skins of tubes alone."""
    skin = """<skin name="{0}" {1} vertex="0 0 0 1 0 0 0 1 0" face="0 1 2"><bone body="b"
    bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2" vertweight="1 1 1"/></skin>"""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><asset><material name="blue"/></asset><deformable>{skin.format("tube", "")}
        {skin.format("panel", 'material="blue"')}</deformable><worldbody><body name="b">
        <geom type="box" size=".5 .001 .002"/><geom type="cylinder" size=".001 .7"/>
        <geom type="capsule" size=".6 .001"/><geom type="sphere" size=".001"/>
        <geom type="ellipsoid" size=".001 .002 .8"/></body></worldbody></mujoco>"""
    )
    draw.thicken(model, 0.02)
    wanted = [[0.5, 0.02, 0.02], [0.02, 0.7, 0.0], [0.6, 0.02, 0.0], [0.02, 0.0, 0.0]]
    assert model.geom_size[:4] == pytest.approx(np.array(wanted))
    assert model.geom_size[4] == pytest.approx([0.001, 0.002, 0.8])
    assert model.skin_inflate == pytest.approx([0.01, 0.0])


def test_a_file_without_a_sky_gets_one_whatever_other_textures_it_has():
    sky = '<texture type="skybox" builtin="flat" rgb1="1 0 0" width="8" height="8"/>'
    wood = '<texture name="w" type="2d" builtin="flat" rgb1="1 0 0" width="8" height="8"/>'
    box = mujoco.mjtTexture.mjTEXTURE_SKYBOX
    for given, count in ((wood, 2), (sky, 1), (wood + sky, 2), ("", 1)):
        text = PLAIN.replace("<world", f"<asset>{given}</asset><world", 1).format("")
        kinds = draw.stage(text).tex_type.tolist()
        assert (kinds.count(int(box)), len(kinds)) == (1, count)


def test_drawn_points_are_corners_of_all_that_is_seen():
    """A tetrahedron lies within its own; a box in a pose has them where they are turned to."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><asset><mesh name="m" vertex="0 0 0 1 0 0 0 2 0 0 0 3"/></asset><worldbody>
        <geom type="plane" size="9 9 9"/><geom type="sphere" size="7" rgba="1 1 1 0"/>
        <body pos="1 2 3"><joint axis="0 0 1"/><geom type="box" size=".1 .2 .3" pos="1 0 0"/>
        </body><body pos="9 9 9"><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""
    )
    data = rest(model, np.array([np.pi / 2.0]))
    box, mesh = np.split(drawn_points(model, data), 2)
    assert box.min(axis=0) == pytest.approx([0.8, 2.9, 2.7])
    assert box.max(axis=0) == pytest.approx([1.2, 3.1, 3.3])
    assert len(np.unique(box.round(9), axis=0)) == 8
    frame = data.geom_xmat[3].reshape(3, 3)
    vertices = (data.geom_xpos[3] + model.mesh_vert @ frame.T) @ frame
    assert (mesh @ frame).min(axis=0) == pytest.approx(vertices.min(axis=0), abs=1e-6)
    assert (mesh @ frame).max(axis=0) == pytest.approx(vertices.max(axis=0), abs=1e-6)


class Painter:
    """A renderer whose sky is 10 and which paints 200 at the pixel where the slide stands."""

    made: list["Painter"]

    def __init__(self, model, height, width):
        self.model, self.size, self.scene = model, (height, width), SimpleNamespace(flags=[1] * 9)
        self.drawn = []
        Painter.made.append(self)

    def update_scene(self, data, camera, option):
        hidden = not option.geomgroup.any() and not option.skingroup.any()
        self.drawn.append(None if hidden else int(data.qpos[0]))

    def render(self):
        out = np.full((*self.size, 3), 10, dtype=np.uint8)
        if self.drawn[-1] is not None:
            out[0, self.drawn[-1]] = 200
        return out

    def close(self):
        self.drawn.append("closed")


def test_what_is_compared_lies_faintly_behind_what_is_shown(monkeypatch):
    """Three tenths of it, seven of the sky; it is drawn again only where it moved."""
    monkeypatch.setattr(Painter, "made", [], raising=False)
    monkeypatch.setattr(mujoco, "Renderer", Painter)
    slide = "<body name='b'><joint type='slide'/><geom size='1'/></body>"
    model = mujoco.MjModel.from_xml_string(PLAIN.format(slide))
    model.vis.global_.offwidth, model.vis.global_.offheight = 5, 700
    shown, ghosts = np.array([[0.0], [1.0], [2.0]]), np.array([[1.0], [1.0], [3.0]])
    frames = list(draw.draw_frames(model, "b", shown, ghosts, width=6, height=2))
    faint = int(0.7 * 10 + 0.3 * 200)
    assert [frame[0, :4, 0].tolist() for frame in frames] == [
        [200, faint, 10, 10],
        [10, 200, 10, 10],
        [10, 10, 200, faint],
    ]
    (painter,) = Painter.made
    assert painter.drawn == [None, 0, 1, 1, 2, 3, "closed"]
    assert painter.scene.flags[int(mujoco.mjtRndFlag.mjRND_SHADOW)] == 0
    assert (model.vis.global_.offwidth, model.vis.global_.offheight) == (6, 700)
    # every position of a short film is held by the frame, some 24 of a long one
    held = []
    monkeypatch.setattr(
        draw, "drawn_points", lambda _, data: held.append(data.qpos[0]) or np.eye(3)
    )
    still = np.zeros((60, 1))
    next(draw.draw_frames(model, "b", still, still, width=6, height=2))
    next(draw.draw_frames(model, "b", shown, ghosts, width=6, height=2))
    assert len(held) == 60 + 6
