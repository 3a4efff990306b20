"""The liquid of a tank against potential flow by polynomials (tests/support/flow.py), read back
from the written file by plain MuJoCo."""

import json

import mujoco
import numpy as np
import pytest

import beamchain as bc
from command import call
from flow import Flow

CLOSED = 1e-9  # of closed forms, which MuJoCo's numbers hold but for differences
DIFFERENCED = 1e-6  # frequencies from differences of MuJoCo's forces
CORNER = 1e-8  # the locked flow has corners, at which polynomials converge to 3e-9
STEP = 1e-4  # rad, of differences
TANKS = {"half": (1.0, 1.0), "deep": (0.5, 1.6), "shallow": (1.0, 0.25)}
DENSITY = 1010.0


def tank(radius, height, ratio=1e-9, acceleration=9.80665, density=DENSITY, **more):
    """A specification as a user would type it, through the same door."""
    keys = {"radius": radius, "height": height, "density": density, "ratio": ratio}
    keys |= {"acceleration": acceleration, **more}
    lines = "\n".join(f"{key} = {value!r}" for key, value in keys.items())
    return f'name = "tank"\n[slosh]\nshape = "cylinder"\n{lines}\n'


def fitted(folder, *args, **kwargs):
    file = folder / "tank.toml"
    file.write_text(tank(*args, **kwargs))
    return bc.fit(file)


class Bench:
    """A written file on a massless root that slides along y and turns about z, in a field along
    -x: M and K by MuJoCo's own mass matrix and by differences of its forces."""

    def __init__(self, fit, acceleration):
        spec = mujoco.MjSpec()
        spec.option.gravity = [-acceleration, 0.0, 0.0]
        root = spec.worldbody.add_body(name="root")
        root.add_joint(name="y", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 1, 0])
        root.add_joint(name="turn", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
        root.mass, root.inertia, root.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
        root.add_site(name="mount")
        fit.attach(spec, "mount")
        self.model = model = spec.compile()
        self.data = mujoco.MjData(model)
        names = [model.joint(j).name for j in range(model.njnt)]
        self.inner = [i for i, name in enumerate(names) if name.endswith("_xy")]
        mujoco.mj_forward(model, self.data)
        self.mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, self.data, self.mass)
        self.mass[0, 0] -= 1.0
        self.mass[1, 1] -= 1.0
        self.stiffness = np.column_stack([self._slope(i) for i in range(model.nv)])

    def _force(self, i, by):
        self.data.qpos[:] = 0.0
        self.data.qpos[i] = by
        mujoco.mj_forward(self.model, self.data)
        return np.array(self.data.qfrc_bias)

    def _slope(self, i):
        return (self._force(i, STEP) - self._force(i, -STEP)) / (2.0 * STEP)

    def frequencies(self):
        pick = np.ix_(self.inner, self.inner)
        return np.sqrt(
            np.sort(np.linalg.eigvals(np.linalg.solve(self.mass[pick], self.stiffness[pick])))
        )

    def dynamic_mass(self, s):
        """`(2, 2)` wrench on the root per its acceleration."""
        whole = self.mass + self.stiffness / s**2
        own, inner = [0, 1], self.inner
        cross = whole[np.ix_(own, inner)]
        return whole[np.ix_(own, own)] - cross @ np.linalg.solve(
            whole[np.ix_(inner, inner)], whole[np.ix_(inner, own)]
        )


def own_body(model, name):
    body = model.body(name)
    return float(body.mass[0]), float(body.ipos[0]), np.array(body.inertia)


class TestNumbers:
    def test_printed_numbers_of_a_tank_as_high_as_wide(self, tmp_path):
        fit = fitted(tmp_path, 0.5, 1.0)
        bench = Bench(fit, 9.80665)
        w = bench.frequencies()[0]
        assert w**2 * 0.5 / 9.80665 == pytest.approx(1.83885, abs=5e-6)
        k = bench.inner[0]
        effective = bench.mass[0, k] ** 2 / bench.mass[k, k]
        total = np.pi * 0.25 * DENSITY
        assert effective / total == pytest.approx(0.22697, abs=5e-6)
        assert bench.mass[k, k] / bench.mass[0, k] / 0.5 == pytest.approx(-0.54382, abs=5e-6)

    def test_period_of_forty_metres_filled_by_half(self, tmp_path):
        w = Bench(fitted(tmp_path, 20.0, 20.0), 9.80665).frequencies()[0]
        assert 2.0 * np.pi / w == pytest.approx(6.781, abs=5e-4)

    @pytest.mark.parametrize("acceleration", [0.05, 1.0, 9.80665])
    def test_frequency_goes_with_the_root_of_the_acceleration(self, tmp_path, acceleration):
        bench = Bench(fitted(tmp_path, 0.5, 0.8), acceleration)
        kappa, _, _ = Flow(0.5, 0.8).modes(2)
        expected = np.sqrt(kappa * acceleration)
        assert np.max(np.abs(bench.frequencies() / expected - 1.0)) < DIFFERENCED


class TestFlow:
    @pytest.mark.parametrize("name", TANKS)
    def test_pendulums_are_the_modes_of_the_flow(self, tmp_path, name):
        radius, height = TANKS[name]
        model = mujoco.MjModel.from_xml_string(fitted(tmp_path, radius, height).to_mjcf())
        kappa, masses, heights = Flow(radius, height).modes(2)
        for number, (k, mass, stands) in enumerate(zip(kappa, masses, heights, strict=True), 2):
            own, arm, inertia = own_body(model, f"tank_link{number}")
            first, second = own * arm, own * arm**2 + inertia[1]
            pivot = float(model.body(f"tank_link{number}").pos[0])
            assert first**2 / second == pytest.approx(DENSITY * mass, rel=CLOSED)
            assert -first / second == pytest.approx(k, rel=CLOSED)
            assert pivot - 1.0 / k == pytest.approx(stands, rel=CLOSED, abs=CLOSED)

    @pytest.mark.parametrize("name", TANKS)
    def test_fixed_mass_is_what_the_pendulums_leave_of_the_locked_flow(self, tmp_path, name):
        radius, height = TANKS[name]
        model = mujoco.MjModel.from_xml_string(fitted(tmp_path, radius, height).to_mjcf())
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        rigid = DENSITY * Flow(radius, height, 26, 26).rigid()
        bodies = range(1, model.nbody)
        mass = np.array([model.body_mass[i] for i in bodies])
        centre = np.array([data.xipos[i][0] for i in bodies])
        about = np.array([model.body_inertia[i][1:].max() for i in bodies])
        assert mass.sum() == pytest.approx(rigid[0, 0], rel=CLOSED)
        assert mass @ centre == pytest.approx(rigid[0, 1], rel=CLOSED)
        assert about.sum() + mass @ centre**2 == pytest.approx(rigid[1, 1], rel=CORNER)
        # an inviscid liquid is not dragged along
        roll = sum(model.body_inertia[i].min() for i in bodies)
        assert roll < 1e-6 * rigid[1, 1]

    @pytest.mark.slow
    def test_force_and_moment_of_sway_and_pitch(self, tmp_path):
        """What two pendulums leave out falls as the square of frequency; what six leave is less."""
        radius, height = TANKS["shallow"]
        flow = Flow(radius, height)
        kappa, _, _ = flow.modes(3)
        size = np.sqrt(np.diag(DENSITY * flow.rigid()))
        worst = {}
        for modes in (2, 6):
            bench = Bench(fitted(tmp_path, radius, height, modes=modes), 1.0)
            for part in (0.5, 0.9, 1.3):  # of the first frequency
                s = 1j * part * np.sqrt(kappa[0])
                truth = DENSITY * flow.dynamic_mass(s, 1.0)
                off = (bench.dynamic_mass(s) - truth) / np.outer(size, size)
                worst[modes] = max(worst.get(modes, 0.0), float(np.max(np.abs(off))))
        assert worst[2] < LEFT_OUT
        assert worst[6] < 0.05 * worst[2]


LEFT_OUT = 6e-2  # of the rigid mass: what the third and further modes do, measured 4.9e-2


class TestFile:
    @pytest.mark.parametrize("acceleration", [0.05, 0.2])
    def test_damping_ratio_holds_at_the_stated_acceleration(self, tmp_path, acceleration):
        """And elsewhere it goes with the inverse root of the acceleration."""
        bench = Bench(fitted(tmp_path, 0.5, 0.8, ratio=0.02, acceleration=0.05), acceleration)
        damping = np.diag(bench.model.dof_damping)[np.ix_(bench.inner, bench.inner)]
        mass = np.diag(bench.mass)[bench.inner]
        ratio = np.diag(damping) / mass / (2.0 * bench.frequencies())
        assert ratio == pytest.approx(0.02 * np.sqrt(0.05 / acceleration), rel=DIFFERENCED)

    @pytest.mark.slow
    def test_shapes_are_left_out_where_asked(self, tmp_path):
        drawn = mujoco.MjModel.from_xml_string(fitted(tmp_path, 0.5, 0.8).to_mjcf())
        assert sorted(drawn.geom_type.tolist()) == [2, 2, 5]  # two balls in a cylinder
        assert 0.0 < drawn.geom_rgba[:, 3].min() < 1.0
        file = tmp_path / "plain.toml"
        file.write_text(tank(0.5, 0.8) + "[scene]\nvisuals = false\n")
        plain = mujoco.MjModel.from_xml_string(bc.fit(file).to_mjcf())
        assert plain.ngeom == 0
        assert np.array_equal(plain.body_mass, drawn.body_mass)

    def test_keyframe_of_the_scene_accelerates_as_stated(self, tmp_path):
        model = mujoco.MjModel.from_xml_string(
            fitted(tmp_path, 0.5, 0.8, acceleration=0.05).scene_mjcf()
        )
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("burn").id)
        mujoco.mj_forward(model, data)
        assert data.qacc[:3] == pytest.approx([0.05, 0.0, 0.0], abs=1e-12)

    @pytest.mark.parametrize(("axis", "along"), [("y", [0, 1, 0]), ("-x", [-1, 0, 0])])
    @pytest.mark.slow
    def test_another_axis_of_the_place(self, tmp_path, axis, along):
        """The file, its balls and its thrust point along it; what is read back is not changed."""
        fits = [fitted(tmp_path, 0.5, 0.8, acceleration=0.05, axis=one) for one in ("x", axis)]
        rows, expected = (
            [(row.port, row.achieved_rad_s) for row in fit.modes] for fit in reversed(fits)
        )
        assert [port for port, _ in rows] == [port for port, _ in expected]
        for (_, found), (_, wanted) in zip(rows, expected, strict=True):
            assert found == pytest.approx(wanted, rel=1e-12)
        model = mujoco.MjModel.from_xml_string(fits[1].to_mjcf())
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        balls = data.geom_xpos[model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE]
        assert balls @ along == pytest.approx(np.linalg.norm(balls, axis=1), rel=1e-12)
        scene = mujoco.MjModel.from_xml_string(fits[1].scene_mjcf())
        data = mujoco.MjData(scene)
        mujoco.mj_resetDataKeyframe(scene, data, scene.key("burn").id)
        mujoco.mj_forward(scene, data)
        assert data.qacc[:3] == pytest.approx(0.05 * np.array(along), abs=1e-12)

    def test_schema_names_the_axes(self):
        key = json.loads(call("init", "schema").out)["$defs"]["Slosh"]["properties"]["axis"]
        assert set(key["enum"]) == {"x", "y", "z", "-x", "-y", "-z"}
        assert key["default"] == "x"


class TestPage:
    @pytest.mark.slow
    def test_the_page_says_that_no_mode_is_drawn(self, tmp_path):
        file = tmp_path / "tank.toml"
        file.write_text(tank(0.5, 0.8))
        told = call("fit", file, "-o", tmp_path / "out")
        assert told.status == 0
        assert "No mode is drawn: nothing accelerates" in (tmp_path / "out/report.html").read_text()


class TestUnits:
    def test_a_tank_in_millimetres(self, tmp_path):
        fit = fitted(tmp_path, 600.0, 450.0)
        (said,) = [w for w in fit.warnings if w.code == "heavy-liquid"]
        assert "write radius = 0.6 and height = 0.45" in said
        usual = fitted(tmp_path, 0.6, 0.45).warnings
        assert "heavy-liquid" not in {w.code for w in usual}
