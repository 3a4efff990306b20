"""What the thing looks like: in boxes, shapes in the written files; they weigh nothing and change
no motion, nor do the surfaces that `tests/mjcf/test_skin.py` looks at."""

import mujoco
import numpy as np
import pytest
from lxml import etree

import beamchain as bc
from appendages import panels, seed_boom, tapered_boom
from mechanics import mass_matrix

HUB = bc.Hub(mass=500.0, inertia=(400.0, 400.0, 500.0), offset=(1.0, 0.0, 0.0))
BOXES = bc.Scene(visuals="boxes")
COVERED = 0.02  # of the length: gaps at panel edges
#: Colours of solar panels, tubes, trusses and carried bodies.
PANELS = "0.15 0.27 0.62 1"
TUBES = "0.66 0.67 0.7 1"
TRUSSES = "0.8 0.8 0.82 1"
CARRIED = "0.72 0.72 0.75 1"

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
TRUSS = bc.Segment(length=10.0, section=bc.Equivalent(bending_stiffness_xy=1e5, linear_mass=1.0))


def equivalent(**draw):
    """Two pieces, soft in plane xz, with an instrument at the tip."""
    section = bc.Equivalent(
        bending_stiffness_xy=2e5,
        bending_stiffness_xz=2e4,
        linear_mass=4.0,
        draw=bc.spec.Draw(**draw) if draw else None,
    )
    return bc.Beam(
        segments=(YOKE, bc.Segment(length=4.0, section=section)),
        lumps=(bc.Lump(x=5.0, mass=9.0, inertia=(0.3, 0.4, 0.5)),),
    )


ARRAY = bc.Beam(segments=(YOKE, PANEL, PANEL), lumps=(bc.Lump(x=6.0, mass=1.0),))


def geoms(beam, **options):
    fit = bc.fit(beam, modes={"xy": 2}, root=bc.spec.Root(hub=HUB), scene=BOXES, **options)
    return list(etree.fromstring(fit.to_mjcf()).iter("geom"))


# -- the written files -----------------------------------------------------------------------------
@pytest.mark.parametrize(
    "make", [seed_boom, tapered_boom, panels, lambda: ARRAY, lambda: bc.Beam(segments=(TRUSS,))]
)
def test_shapes_weigh_nothing_and_touch_nothing(make):
    found = geoms(make())
    assert found
    names = [geom.get("name") for geom in found]
    assert len(names) == len(set(names))
    for geom in found:
        assert (geom.get("mass"), geom.get("contype"), geom.get("conaffinity")) == ("0", "0", "0")
        allowed = {"name", "type", "size", "pos", "quat", "rgba", "mass", "contype", "conaffinity"}
        assert set(geom.attrib) <= allowed
        assert len(geom.get("rgba").split()) == 4


def test_each_section_has_its_look():
    kinds = {(geom.get("type"), geom.get("rgba")) for geom in geoms(ARRAY)}
    assert kinds == {("cylinder", TUBES), ("box", PANELS), ("box", CARRIED)}
    assert {geom.get("rgba") for geom in geoms(bc.Beam(segments=(TRUSS,)))} == {TRUSSES}


@pytest.mark.parametrize("beam", [seed_boom(), ARRAY])
def test_shapes_cover_the_appendage_and_are_as_deep(beam):
    model = mujoco.MjModel.from_xml_string(bc.fit(beam, modes={"xy": 2}, scene=BOXES).to_mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    spans = []
    for i in range(model.ngeom):
        along = model.geom_size[i, 0 if model.geom_type[i] == int(mujoco.mjtGeom.mjGEOM_BOX) else 1]
        x = float(data.geom_xpos[i, 0])
        if model.geom_rgba[i, :3] != pytest.approx([float(v) for v in CARRIED.split()[:3]]):
            spans.append((x - along, x + along))
            depth = beam.depth(x, "xy") / 2.0
            across = model.geom_size[
                i, 1 if model.geom_type[i] == int(mujoco.mjtGeom.mjGEOM_BOX) else 0
            ]
            assert across == pytest.approx(depth, rel=1e-9)
    covered = sum(b - a for a, b in spans)
    assert covered == pytest.approx(beam.length, rel=COVERED)
    assert min(a for a, _ in spans) >= -1e-9
    assert max(b for _, b in spans) <= beam.length * (1.0 + 1e-9)


def test_a_carried_body_is_drawn_once_and_where_it_is():
    model = mujoco.MjModel.from_xml_string(bc.fit(ARRAY, modes={"xy": 3}, scene=BOXES).to_mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    colour = [float(v) for v in CARRIED.split()[:3]]
    at = [
        data.geom_xpos[i, 0]
        for i in range(model.ngeom)
        if model.geom_rgba[i, :3] == pytest.approx(colour)
    ]
    assert at == pytest.approx([6.0])


@pytest.mark.parametrize("visuals", [True, "skin", "boxes"])
def test_looks_change_no_motion(visuals):
    """The same masses, mass matrix and steps, to the last bit."""
    drawn = bc.fit(ARRAY, modes={"xy": 2}, scene=bc.Scene(visuals=visuals))
    bare = bc.fit(ARRAY, modes={"xy": 2}, scene=bc.Scene(visuals=False))
    assert "<geom" not in bare.to_mjcf()
    assert "<skin" not in bare.to_mjcf()
    assert ("<skin" in drawn.to_mjcf()) == (visuals != "boxes")
    one, two = (mujoco.MjModel.from_xml_string(fit.scene_mjcf()) for fit in (drawn, bare))
    assert one.nv == two.nv
    np.testing.assert_array_equal(one.body_mass, two.body_mass)
    np.testing.assert_array_equal(one.body_inertia, two.body_inertia)
    np.testing.assert_array_equal(mass_matrix(one), mass_matrix(two))
    ends = []
    for model in (one, two):
        data = mujoco.MjData(model)
        data.qvel[:] = np.linspace(0.1, 0.2, model.nv)
        mujoco.mj_step(model, data, 200)
        ends.append(np.concatenate([data.qpos, data.qvel]))
    np.testing.assert_array_equal(*ends)


def test_an_equivalent_section_is_as_wide_and_thick_as_it_is_drawn():
    """Soft in xz, so that the panel is thin along z."""
    model = mujoco.MjModel.from_xml_string(
        bc.fit(equivalent(width=1.2, thickness=0.03), modes={"xz": 2}, scene=BOXES).to_mjcf()
    )
    blue = [
        i for i in range(model.ngeom) if " ".join(f"{v:g}" for v in model.geom_rgba[i]) == PANELS
    ]
    np.testing.assert_allclose(
        model.geom_size[blue, 1:], np.tile([0.6, 0.015], (len(blue), 1)), rtol=1e-12
    )
    assert 2.0 * model.geom_size[blue, 0].sum() == pytest.approx(4.0, rel=COVERED)
    mast = geoms(equivalent(width=0.5, thickness=0.4))
    assert TRUSSES in {geom.get("rgba") for geom in mast}
    assert PANELS not in {geom.get("rgba") for geom in mast}


def test_a_carried_body_with_inertias_is_the_even_box_of_them():
    (box,) = [geom for geom in geoms(equivalent()) if geom.get("rgba") == CARRIED]
    a, b, c = (float(v) for v in box.get("size").split())
    assert 9.0 / 3.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b]) == pytest.approx(
        [0.3, 0.4, 0.5]
    )


def test_what_is_drawn_changes_no_dynamics():
    one, two = (
        bc.fit(equivalent(**given), modes={"xy": 1, "xz": 1}, root=bc.spec.Root(hub=HUB))
        for given in ({"width": 1.2, "thickness": 0.03}, {})
    )
    first, second = (mujoco.MjModel.from_xml_string(fit.scene_mjcf()) for fit in (one, two))
    assert np.all(first.geom_contype == 0)
    np.testing.assert_allclose(mass_matrix(first), mass_matrix(second), rtol=0.0, atol=1e-12)
    for fit in (one, two):
        assert [m.achieved_rad_s for m in fit.modes] == [m.achieved_rad_s for m in one.modes]
    for tag in ("body", "inertial", "joint", "fixed"):
        written = [
            [dict(e.attrib) for e in etree.fromstring(fit.to_mjcf()).iter(tag)]
            for fit in (one, two)
        ]
        assert written[0] == written[1]
