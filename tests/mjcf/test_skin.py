"""The drawn surface of an appendage is that of the elastic beam: skins against finite elements.

The vertices are computed from the compiled model's skin arrays and the poses of its bodies, by the
formula of MuJoCo's documentation; the chain is displaced along a mode that is read from MuJoCo's
mass matrix and spring forces. The beam's mode comes from `finite_elements.py`, which imports
nothing from the package.
"""

import json
import os
import subprocess
import sys

import msgspec
import mujoco
import numpy as np
import pytest
import scipy.linalg

import beamchain as bc
import finite_elements
from beamchain.cli import shipped
from beamchain.engine import backend
from command import call
from mechanics import mass_matrix, stiffness_matrix
from solver import cross

FOLLOWED = 0.02  # of a mode's largest displacement
STATED = 2e-3  # between what a fit states of it and what is found here
SMALL = 1e-5  # scale of a mode's displacement, so that it is linear
SAME = 1e-5  # m, in MuJoCo's single precision
FREQUENCY = 1e-7  # relative, of a mode read back

BLANKET = {"youngs_modulus": 2e9, "density": 80.0, "poissons_ratio": 0.3}
PANEL = {
    "length": 2.0,
    "section": {"shape": "rectangle", "width_y": 0.022, "width_z": 1.5},
    "material": BLANKET,
    "nonstructural_mass": 2.0,
}
YOKE = {
    "length": 1.0,
    "section": {"shape": "tube", "outer_diameter": 0.06, "wall": 0.002},
    "material": {"youngs_modulus": 7e10, "density": 2700.0, "poissons_ratio": 0.33},
}
SOFT = {"stiffness_xz": 6000.0, "stiffness_torsion": 3000.0}
#: 6 m x 1.5 m of panels behind a yoke, on hinge lines.
WING = {
    "name": "wing",
    "segment": [YOKE, PANEL, PANEL, PANEL],
    "joint": [
        {"after_segment": 1, "stiffness_xy": 600.0, **SOFT},
        {"after_segment": 2, "stiffness_xy": 400.0, **SOFT},
        {"after_segment": 3, "stiffness_xy": 400.0, **SOFT},
    ],
    "modes": {"xy": 2, "xz": 2, "torsion": 1},
}
#: The same area as one sheet, whose planes and torsion share two hinges.
SHEET = {
    "name": "sheet",
    "segment": [{**PANEL, "length": 6.0}],
    "modes": {"xy": 2, "xz": 2, "torsion": 1},
}
MAST = {
    "name": "mast",
    "segment": [
        {
            "length": 12.0,
            "section": {
                "shape": "equivalent",
                "bending_stiffness_xy": 4e5,
                "torsion_stiffness": 3e4,
                "linear_mass": 1.6,
                "polar_inertia": 0.05,
                "draw": {"width": 0.4, "thickness": 0.4},
            },
        }
    ],
    "modes": {"xy": 2, "xz": 2, "torsion": 1},
}
BOOM = {"name": "boom", "segment": [{**YOKE, "length": 8.0}], "modes": {"xy": 2, "xz": 2}}
STEPPED = {  # a boom that bends at a joint and tapers
    "name": "stepped",
    "segment": [YOKE, {**YOKE, "section_end": {**YOKE["section"], "outer_diameter": 0.03}}],
    "joint": [{"after_segment": 1, "stiffness_xy": 4000.0, "stiffness_xz": 4000.0}],
    "modes": {"xy": 2},
}


def example(name):
    """A shipped specification as a dict, with the number of modes that its scene chooses."""
    path = shipped.pick(shipped.examples(), name, "example").path
    fit = bc.fit(path)
    spec = msgspec.to_builtins(fit.spec)
    segments = [{k: v for k, v in item.items() if v is not None} for item in spec["segment"]]
    joints = [{k: v for k, v in item.items() if v is not None} for item in spec["joint"]]
    counts = {port: model.modes for port, model in fit.target.items()}
    return {"segment": segments, "joint": joints, "lump": spec["lump"], "modes": counts}, fit


def fitted(given, **scene):
    spec = msgspec.convert(given, bc.Spec)
    return bc.fit(spec, **({"scene": bc.Scene(**scene)} if scene else {}))


# -- MuJoCo's side ---------------------------------------------------------------------------------
def vertices(model, data):
    """`(v, 3)` of all skins: each bone carries its vertices as they were bound to its body."""
    out = []
    for skin in range(model.nskin):
        start, count = model.skin_vertadr[skin], model.skin_vertnum[skin]
        drawn = np.zeros((count, 3))
        for bone in range(model.skin_boneadr[skin], sum_of(model, "skin_bone", skin)):
            place = slice(model.skin_bonevertadr[bone], sum_of(model, "skin_bonevert", bone))
            bind = np.zeros(9)
            mujoco.mju_quat2Mat(bind, model.skin_bonebindquat[bone].astype(float))
            body = model.skin_bonebodyid[bone]
            turn = data.xmat[body].reshape(3, 3) @ bind.reshape(3, 3).T
            for i, weight in zip(
                model.skin_bonevertid[place], model.skin_bonevertweight[place], strict=True
            ):
                arm = model.skin_vert[start + i].astype(float) - model.skin_bonebindpos[bone]
                drawn[i] += float(weight) * (data.xpos[body] + turn @ arm)
        out.append(drawn)
    return np.concatenate(out)


def sum_of(model, word, index):
    """Where a stretch of an array ends."""
    return getattr(model, f"{word}adr")[index] + getattr(model, f"{word}num")[index]


def at(model, positions):
    data = mujoco.MjData(model)
    data.qpos[:] = positions
    mujoco.mj_kinematics(model, data)
    return data


def modes_of(model, port):
    """Frequencies [rad/s] and mass-normalised shapes `(nv, n)` of a model in which the hinges of
    one port move on their springs, slowest first."""
    own = [j for j in range(model.njnt) if model.joint(j).name.endswith(f"_{port}")]
    mass, stiffness = (part(model)[np.ix_(own, own)] for part in (mass_matrix, stiffness_matrix))
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    return np.sqrt(np.maximum(squares, 0.0)), np.eye(model.nv)[:, own] @ shapes


def displacement(model, shape):
    """`(v, 3)` of the vertices per unit of a mode."""
    one, two = (vertices(model, at(model, sign * SMALL * shape)) for sign in (1.0, -1.0))
    return (one - two) / (2.0 * SMALL)


# -- the beam's side -------------------------------------------------------------------------------
def beam_displacement(given, port, k, points):
    """`(v, 3)` of points of the cross-sections in mode k of a port in finite elements."""
    out = np.zeros_like(points)
    _, y, z = points.T
    end = finite_elements.length(given)  # single precision may lead beyond it
    cache = {x: port.motion(min(x, end))[k] for x in np.unique(points[:, 0])}
    motion = np.array([cache[x] for x in points[:, 0]])
    turn = motion[:, -1]
    if port.port == "xy":
        out[:, 0], out[:, 1] = -y * turn, motion[:, 0]
    elif port.port == "xz":
        out[:, 0], out[:, 2] = -z * turn, motion[:, 0]
    else:
        out[:, 1], out[:, 2] = -z * turn, y * turn
    return out


def undrawn(given):
    """A specification without what only a picture needs."""
    sections = [{k: v for k, v in s["section"].items() if k != "draw"} for s in given["segment"]]
    segments = zip(given["segment"], sections, strict=True)
    return {**given, "segment": [{**s, "section": section} for s, section in segments]}


def compared(given, fit, frequency=FREQUENCY):
    """Per port and mode: both displacements `(v, 3)` relative to the beam's largest, and the
    hinges' motion."""
    model = mujoco.MjModel.from_xml_string(fit.to_mjcf())
    points = vertices(model, at(model, np.zeros(model.nq)))
    out = {}
    for name, count in given["modes"].items():
        port = finite_elements.port(undrawn(given), name, count + 2)
        frequencies, shapes = modes_of(model, name)
        for k in range(count):
            i = int(np.argmin(np.abs(frequencies - port.frequencies[k])))
            assert frequencies[i] == pytest.approx(port.frequencies[k], rel=frequency)
            wanted = beam_displacement(given, port, k, points)
            largest = np.max(np.linalg.norm(wanted, axis=1))
            drawn = displacement(model, shapes[:, i])
            sign = np.sign(np.sum(drawn * wanted))
            out[name, k] = sign * drawn / largest, wanted / largest, sign * shapes[:, i] / largest
    return model, points, out


def errors_of(found):
    """Largest error of a vertex per mode."""
    return {
        key: float(np.max(np.linalg.norm(drawn - wanted, axis=1)))
        for key, (drawn, wanted, _) in found.items()
    }


@pytest.mark.parametrize("given", [WING, MAST, STEPPED], ids=lambda given: given["name"])
@pytest.mark.slow
def test_the_surface_follows_every_kept_mode(given):
    fit = fitted(given)
    _, _, found = compared(given, fit)
    assert set(fit.look.residual) == set(given["modes"])
    errors = errors_of(found)
    print(f"{given['name']}: {max(errors.values()):.1e}")  # noqa: T201 - docs/accuracy.md quotes it
    for (port, k), error in errors.items():
        assert error < FOLLOWED
        assert fit.look.residual[port][k] == pytest.approx(error, abs=STATED)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["array_scene", "mast"])
def test_the_shipped_examples_do(name):
    """Those made for a hub keep modes that differ a little from the beam's first ones."""
    given, fit = example(name)
    _, _, found = compared(given, fit, 1e-3)
    assert max(errors_of(found).values()) < FOLLOWED


@pytest.mark.slow
def test_what_no_weights_can_follow_is_as_near_as_can_be():
    """Two bending planes and torsion of one sheet share two hinges.

    A vertex that bodies carry with any weights, from any point of theirs, moves by
    `sum_h w_h x G_h`: w_h is the rotation of hinge h, and the vectors G_h are free. The least
    sum of squares over the modes that free vectors leave is a bound for every skin.
    """
    fit = fitted(SHEET)
    model, points, found = compared(SHEET, fit)
    bodies = list(range(2, model.nbody))
    rows, wanted, left = [], [], []
    for drawn, beam, shape in found.values():
        row = []
        for body in bodies:
            joints = [j for j in range(model.njnt) if model.jnt_bodyid[j] == body]
            row.append(cross(sum(shape[j] * model.jnt_axis[j] for j in joints)))
        rows.append(np.hstack(row))
        wanted.append(beam)
        left.append(drawn - beam)
    matrix = np.vstack(rows)
    target = np.concatenate(wanted, axis=1).T
    best = target - matrix @ np.linalg.lstsq(matrix, target, rcond=None)[0]
    least = np.linalg.norm(best, axis=0)
    reached = np.linalg.norm(np.concatenate(left, axis=1), axis=1)
    assert np.max(least) / np.sqrt(len(found)) > FOLLOWED  # of some mode, with any weights
    assert np.max(reached) < 1.02 * np.max(least)
    assert np.all(reached < 1.02 * least + 5e-3)
    for (port, k), error in errors_of(found).items():
        assert fit.look.residual[port][k] == pytest.approx(error, abs=STATED)
        assert error < (FOLLOWED if port == "xy" else 0.1)
    assert len(points)


# -- the file --------------------------------------------------------------------------------------
def test_weights_sum_to_one_and_rest_is_as_bound():
    model = mujoco.MjModel.from_xml_string(fitted(WING).to_mjcf())
    for skin in range(model.nskin):
        total = np.zeros(model.skin_vertnum[skin])
        for bone in range(model.skin_boneadr[skin], sum_of(model, "skin_bone", skin)):
            place = slice(model.skin_bonevertadr[bone], sum_of(model, "skin_bonevert", bone))
            np.add.at(total, model.skin_bonevertid[place], model.skin_bonevertweight[place])
        np.testing.assert_allclose(total, 1.0, atol=1e-6)
    rest = vertices(model, at(model, np.zeros(model.nq)))
    np.testing.assert_allclose(rest, model.skin_vert, atol=3e-4)


def test_the_surfaces_are_as_wide_and_deep_as_the_sections():
    model = mujoco.MjModel.from_xml_string(fitted(WING).to_mjcf())
    tube, panel = (model.skin(f"wing_{look}").id for look in ("tube", "panel"))
    for skin, sizes, (low, high) in (
        (tube, (0.06, 0.06), (0.0, 1.0)),
        (panel, (0.022, 1.5), (1.0, 7.0)),
    ):
        start = model.skin_vertadr[skin]
        points = model.skin_vert[start : start + model.skin_vertnum[skin]]
        np.testing.assert_allclose(np.ptp(points[:, 1:], axis=0), sizes, rtol=1e-5)
        assert points[:, 0].min() == pytest.approx(low, abs=0.05)
        assert points[:, 0].max() == pytest.approx(high, abs=0.05)


@pytest.mark.parametrize("given", [WING, MAST, BOOM], ids=lambda given: given["name"])
def test_faces_look_outwards_and_the_file_is_short(given):
    """The volume that the triangles enclose is that of the solids: no face is turned round."""
    text = fitted(given).to_mjcf()
    model = mujoco.MjModel.from_xml_string(text)
    assert model.nskinvert < 600
    assert len(text) < 100_000
    assert text.index("<deformable>") > text.rindex("</body>")
    volume = 0.0
    for skin in range(model.nskin):
        points = model.skin_vert[model.skin_vertadr[skin] :].astype(float)
        start = model.skin_faceadr[skin]
        faces = model.skin_face[start : start + model.skin_facenum[skin]]
        a, b, c = (points[faces[:, i]] for i in range(3))
        volume += float(np.sum(a * np.cross(b, c))) / 6.0
    octagon = 2.0 * np.sqrt(2.0) * 0.03**2
    if given is BOOM:
        assert volume == pytest.approx(8.0 * octagon, rel=1e-4)
    elif given is WING:
        gap = 0.004 * 7.0  # at both ends of a panel, and of what ends at a joint
        panels = 3.0 * (2.0 - 2.0 * gap) * 0.022 * 1.5
        assert volume == pytest.approx((1.0 - gap) * octagon + panels, rel=1e-4)
    else:
        assert volume > 0.0


@pytest.mark.parametrize(
    ("visuals", "kinds"),
    [("skin", (True, False)), ("boxes", (False, True)), (False, (False, False))],
)
def test_the_scene_says_how_it_is_drawn(visuals, kinds):
    fit = fitted(WING, visuals=visuals)
    text = fit.to_mjcf()
    assert ("<skin" in text, "<geom" in text) == kinds
    assert fit.look.drawn == (visuals or "nothing")
    assert fit.as_dict()["look"]["drawn"] == fit.look.drawn
    assert bool(fit.look.residual) == (visuals == "skin")


@pytest.mark.parametrize("value", ["boxen", 3, None, ("skin",)])
def test_another_look_is_refused_in_a_sentence(value, tmp_path):
    with pytest.raises(bc.InputError, match="visuals = .* must be .*boxes"):
        bc.Scene(visuals=value)


def test_a_bad_word_in_the_file_is_refused_with_the_words_there_are(tmp_path):
    toml = tmp_path / "boom.toml"
    toml.write_text(
        "[[segment]]\nlength = 8.0\n"
        'section = { shape = "equivalent", bending_stiffness_xy = 2e3, linear_mass = 4.0 }\n'
        '[scene]\nvisuals = "skins"\n'
    )
    with pytest.raises(bc.InputError, match=r"scene\.visuals = 'skins' .*did you mean 'skin'"):
        bc.read_spec(toml)


def test_shapes_that_touch_are_seen_themselves():
    fit = fitted(WING, contacts=True)
    assert "<skin" not in fit.to_mjcf()
    assert fit.look.drawn == "contacts"


def test_a_rigid_appendage_is_drawn_too():
    scene = bc.Scene(bandwidth=1e-6, axes=("z",))
    fit = bc.fit(msgspec.convert({**WING, "modes": None}, bc.Spec), scene=scene)
    model = mujoco.MjModel.from_xml_string(fit.to_mjcf())
    assert (model.nv, model.nskin) == (0, 2)
    rest = vertices(model, at(model, np.zeros(0)))
    np.testing.assert_allclose(rest, model.skin_vert, atol=1e-5)


def test_a_beam_of_very_many_segments_is_drawn_in_boxes():
    pieces = [{**YOKE, "length": 0.1 + 0.001 * k} for k in range(60)]
    fit = fitted({**BOOM, "segment": pieces})
    assert fit.look.drawn == "boxes"
    assert "<geom" in fit.to_mjcf()


# -- on a spacecraft -------------------------------------------------------------------------------
CRAFT = """<mujoco model="craft">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="bus" pos="0.1 0.2 0.3" quat="0.8 0.6 0 0">
      <freejoint/>
      <inertial pos="0 0 0" mass="300" diaginertia="60 90 120"/>
      <site name="left" pos="0 0.5 0" quat="0.7071067811865476 0 0 0.7071067811865476"/>
      <site name="right" pos="0 -0.5 0" quat="0.7071067811865476 0 0 -0.7071067811865476"/>
    </body>
  </worldbody>
</mujoco>
"""


def on_site(model, site):
    """The vertices of the skins, seen from a site."""
    data = at(model, model.qpos0)
    turn = data.site(site).xmat.reshape(3, 3)
    return (vertices(model, data) - data.site(site).xpos) @ turn


def test_attach_carries_the_surfaces():
    fit = fitted(WING)
    craft = mujoco.MjSpec.from_string(CRAFT)
    fit.attach(craft, "left")
    model = craft.compile()
    assert {model.skin(i).name for i in range(model.nskin)} == {"wing_tube", "wing_panel"}
    np.testing.assert_allclose(on_site(model, "left"), model.skin_vert, atol=3e-4)


def test_attach_twice_with_prefixes():
    fit = fitted(WING)
    craft = mujoco.MjSpec.from_string(CRAFT)
    for side in ("left", "right"):
        child = mujoco.MjSpec.from_string(fit.to_mjcf())
        craft.attach(child, site=craft.site(side), prefix=f"{side}_")
    model = craft.compile()
    assert model.nskin == 4
    assert model.nmat == model.ntex == 2
    half = model.nskinvert // 2
    np.testing.assert_allclose(on_site(model, "left")[:half], model.skin_vert[:half], atol=3e-4)
    np.testing.assert_allclose(on_site(model, "right")[half:], model.skin_vert[half:], atol=3e-4)
    assert model.body(model.skin_bonebodyid[-1]).name.startswith("right_wing_link")


def test_a_rigid_tube_beside_a_bending_one_is_not_taken_for_changed():
    """A rigid appendage has as many bones as surfaces, one, and bones are numbered through."""
    tube = bc.Segment(
        length=5.0,
        section=bc.Tube(outer_diameter=0.1, wall=0.002),
        material=bc.Material(youngs_modulus=7e10, density=2700.0),
    )
    bending = bc.Spec(name="long", segment=(tube,), modes=bc.Modes(xy=2, xz=2))
    slow = bc.Scene(bandwidth=1e-6, axes=("z",))
    rigid = bc.Spec(name="stub", segment=(tube,), scene=slow)
    places = [site.name for site in mujoco.MjSpec.from_string(CRAFT).sites][:2]
    craft = bc.embed(CRAFT, dict(zip(places, (bending, rigid), strict=True)))
    assert craft.model.nskin == 2


@pytest.mark.slow
def test_embedded_twice_and_taken_out_again(tmp_path):
    wing = msgspec.convert(WING, bc.Spec)
    made = bc.embed(CRAFT, {"left": wing, "right": wing}, retime=False)
    made.write(tmp_path / "two.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "two.xml"))
    assert (model.nskin, model.nmat) == (4, 2)
    half = model.nskinvert // 2
    np.testing.assert_allclose(on_site(model, "left")[:half], model.skin_vert[:half], atol=3e-4)
    np.testing.assert_allclose(on_site(model, "right")[half:], model.skin_vert[half:], atol=3e-4)
    assert call("embed", tmp_path / "two.xml", "--remove", "-o", tmp_path / "back.xml").status == 0
    assert (tmp_path / "back.xml").read_text() == CRAFT


# -- through MuJoCo's renderer ---------------------------------------------------------------------
SEEN = """
import json, sys
import mujoco
import numpy as np

given = json.load(sys.stdin)
model = mujoco.MjModel.from_xml_string(given["xml"])
data = mujoco.MjData(model)
camera = mujoco.MjvCamera()
camera.lookat[:] = given["lookat"]
camera.distance, camera.azimuth, camera.elevation = given["distance"], 90.0, -90.0
option = mujoco.MjvOption()
option.sitegroup[:] = 0
renderer = mujoco.Renderer(model, 480, 640)
out = []
for positions in given["positions"]:
    data.qpos[:] = positions
    mujoco.mj_forward(model, data)
    renderer.update_scene(data, camera, option)
    picture = renderer.render().astype(int)
    lit = picture.max(axis=-1) > 20  # against a black background
    last = np.flatnonzero(lit.any(axis=0))[-1]
    rows = np.flatnonzero(lit[:, last - 6 : last + 1].any(axis=1))
    out.append([[int(rows.min()), int(rows.max())], renderer.scene.skinvert.ravel().tolist()])
json.dump(out, sys.stdout)
renderer.close()
"""
SWING = 0.2  # m, of the tip
DISTANCE = 3.0  # m, from above
PIXELS = 2.0  # of some 50


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["egl", "osmesa"])
def test_the_tip_is_seen_to_move_as_the_mode_says(renderer):
    """A camera looks down on the edge of the tip; MuJoCo's vertices are those of the formula."""
    if not backend._works(renderer):
        pytest.skip(f"MuJoCo cannot draw with {renderer} on this machine")
    fit = fitted(WING)
    model = mujoco.MjModel.from_xml_string(fit.to_mjcf())
    _, shapes = modes_of(model, "xy")
    port = finite_elements.port(WING, "xy", 4)
    length = finite_elements.length(WING)
    tips = port.motion(length)[:2, 0]
    near = DISTANCE - 0.75  # the upper corner of the tip, which lies farthest out in the picture
    k = 1  # the second mode
    size = SWING / tips[k]
    if displacement(model, shapes[:, k])[-1, 1] * tips[k] < 0.0:
        size = -size
    positions = [(sign * size * shapes[:, k]).tolist() for sign in (0.0, 1.0, -1.0)]
    given = {
        "xml": fit.to_mjcf(),
        "lookat": [length, 0.0, 0.0],
        "distance": DISTANCE,
        "positions": positions,
    }
    done = subprocess.run(
        [sys.executable, "-c", SEEN],
        input=json.dumps(given),
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "MUJOCO_GL": renderer},
    )
    assert done.returncode == 0, done.stderr
    ends = []
    for place, (rows, drawn) in zip(positions, json.loads(done.stdout), strict=True):
        ends.append(rows)
        ours = vertices(model, at(model, np.array(place)))
        np.testing.assert_allclose(np.reshape(drawn, (-1, 3)), ours, atol=SAME)
    focus = 240.0 / np.tan(np.radians(model.vis.global_.fovy) / 2.0)
    assert np.mean(ends[0]) == pytest.approx(239.5, abs=PIXELS)
    moved = np.array([ends[0][0] - ends[1][0], ends[2][1] - ends[0][1]])
    np.testing.assert_allclose(moved, focus * SWING / near, atol=PIXELS)
