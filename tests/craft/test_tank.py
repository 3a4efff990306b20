"""A tank on a spacecraft under thrust or gravity, against potential flow by polynomials
(tests/support/flow.py) on a rigid body, and against plain MuJoCo."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from command import call
from examples import EXAMPLES
from flow import Flow

DIFFERENCED = 1e-6  # frequencies from differences of MuJoCo's forces
SAME = 1e-6  # of a response off its peaks, by two ways to linearise
MASSES = 1e-5  # of the same, the stiffness of the exact one by differences of its masses' places
HELD = 5e-4  # of a frequency: damping, and what two pendulums leave out of the flow
STEP = 1e-4  # rad, of differences
RADIUS, HEIGHT, DENSITY, RATIO = 0.5, 0.8, 1010.0, 0.01
LIQUID = np.pi * RADIUS**2 * HEIGHT * DENSITY
BUS, ABOUT = 600.0, 300.0  # kg, kg m^2
PLACE = 0.4  # m, of the tank's bottom below the bus's centre
CRAFT = """<mujoco model="barge"><option gravity="{gravity}" timestep="0.02"/><worldbody>
<body name="bus">{joint}<inertial pos="0 0 0" mass="600" diaginertia="300 300 250"/>
<site name="left" pos="0 0.5 0" xyaxes="0 1 0 -1 0 0"/>
<site name="right" pos="0 -0.5 0" xyaxes="0 -1 0 1 0 0"/>
<site name="tank" pos="0 0 -0.4" xyaxes="{axes}"/><site name="nozzle" pos="0 0 -0.8"/>
</body></worldbody>
<actuator><motor name="thrust" site="nozzle" gear="0 0 1 0 0 0"/></actuator>
<keyframe><key name="burn" ctrl="{thrust!r}"/></keyframe></mujoco>"""
UP = "0 0 1 0 1 0"


def craft(thrust=0.0, gravity="0 0 0", joint="<freejoint/>", axes=UP):
    return CRAFT.format(thrust=float(thrust), gravity=gravity, joint=joint, axes=axes)


def tank(acceleration, modes=None, scene=""):
    many = "" if modes is None else f"modes = {modes}\n"
    return (
        f'name = "tank"\n[slosh]\nshape = "cylinder"\nradius = {RADIUS}\nheight = {HEIGHT}\n'
        f"density = {DENSITY}\nratio = {RATIO}\nacceleration = {acceleration}\n{many}{scene}"
    )


def embedded(folder, acceleration, *, arrays=False, loaded=True, modes=None, scene="", **more):
    (folder / "tank.toml").write_text(tank(acceleration, modes, scene))
    at = {"tank": folder / "tank.toml"}
    mass = BUS + LIQUID
    if arrays:
        array = EXAMPLES / "array.toml"
        at |= {"left": array, "right": array}
        mass += 2.0 * bc.read_spec(array).beam.rigid_mass()[0, 0]
    text = craft(mass * acceleration, **more)
    return bc.embed(text, at, loaded=loaded, retime=False)


def clamped(model, acceleration):
    """Frequencies and effective masses of the tank's hinges with all else held, in a field along
    the thrust's back: by MuJoCo's mass matrix and differences of its forces."""
    model.opt.gravity[:] = [0.0, 0.0, -acceleration]
    data = mujoco.MjData(model)
    names = [model.joint(int(j)).name for j in model.dof_jntid]
    inner = [i for i, name in enumerate(names) if name.startswith("tank_hinge")]

    def force(i, by):
        data.qpos[:] = model.qpos0
        mujoco.mj_integratePos(model, data.qpos, np.eye(model.nv)[i], by)
        mujoco.mj_forward(model, data)
        return np.array(data.qfrc_bias - data.qfrc_passive)[inner]

    k = np.column_stack([(force(i, STEP) - force(i, -STEP)) / (2.0 * STEP) for i in inner])
    data.qpos[:] = model.qpos0
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    m = mass[np.ix_(inner, inner)]
    values, shapes = np.linalg.eig(np.linalg.solve(m, k))
    order = np.argsort(values)
    shapes = shapes[:, order]
    rows = mass[np.ix_([0, 1], inner)] @ shapes
    effective = (rows**2).sum(axis=0) / np.einsum("ik,ij,jk->k", shapes, m, shapes)
    return np.sqrt(values[order]), effective


class TestThroughMujoco:
    @pytest.mark.parametrize("acceleration", [0.05, 1.0, 9.80665])
    def test_frequency_and_effective_mass_beside_arrays(self, tmp_path, acceleration):
        model = embedded(tmp_path, acceleration, arrays=True, loaded=False).model
        frequencies, effective = clamped(model, acceleration)
        kappa, masses, _ = Flow(RADIUS, HEIGHT).modes(2)
        expected = np.repeat(np.sqrt(kappa * acceleration), 2)
        assert np.max(np.abs(frequencies / expected - 1.0)) < DIFFERENCED
        assert np.max(np.abs(effective / np.repeat(DENSITY * masses, 2) - 1.0)) < DIFFERENCED

    @pytest.mark.parametrize("acceleration", [0.05, 1.0])
    def test_free_craft_under_its_thruster_swings_as_the_flow_says(self, tmp_path, acceleration):
        """The poles of the accelerations that MuJoCo computes with the thruster on."""
        model = embedded(tmp_path, acceleration, loaded=False).model
        data = mujoco.MjData(model)

        def motion(i, by, rate):
            mujoco.mj_resetDataKeyframe(model, data, 0)
            if rate:
                data.qvel[i] = by
            else:
                mujoco.mj_integratePos(model, data.qpos, np.eye(model.nv)[i], by)
            mujoco.mj_forward(model, data)
            # in axes that the craft takes along
            out = np.array(data.qacc)
            turn = data.xmat[model.body("bus").id].reshape(3, 3)
            out[:3] = turn.T @ out[:3]
            return out

        def slopes(rate):
            size = 1e-3 if rate else STEP
            return np.column_stack(
                [
                    (motion(i, size, rate) - motion(i, -size, rate)) / (2 * size)
                    for i in range(model.nv)
                ]
            )

        stiff, damp = -slopes(False), -slopes(True)
        n = model.nv
        poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-stiff, -damp]]))
        found = np.sort(poles[poles.imag > 1e-3 * np.sqrt(acceleration)].imag)
        truth = np.sort(OnBus(acceleration).poles)
        assert np.max(np.abs(found / np.repeat(truth, 2) - 1.0)) < DIFFERENCED


class OnBus:
    """The bus with `modes` modes of the flow in the plane of y and the turn about x, in axes that
    the accelerated craft takes along."""

    def __init__(self, acceleration, modes=2):
        flow = Flow(RADIUS, HEIGHT)
        kappa, masses, heights = flow.modes(modes)
        masses = DENSITY * masses
        self.w = np.sqrt(kappa * acceleration)
        own = np.diag([BUS, ABOUT])
        # at the bottom of the tank: lateral motion of the place, and the turn
        place = np.array([[1.0, -PLACE], [0.0, 1.0]])
        self.rigid = own + place.T @ (DENSITY * flow.rigid()) @ place
        self.rows = np.sqrt(masses)[:, None] * np.stack([np.ones(modes), heights], axis=1) @ place
        self.weight = -acceleration * np.sqrt(masses)[:, None] * np.array([[0.0, 1.0]])
        self.place = place
        # damping is that of the stated acceleration
        self.rate = 2.0 * RATIO * self.w

    def response(self, s):
        """`(2, 2)` acceleration per wrench on the bus."""
        resonance = s**2 + self.rate * s + self.w**2
        push = (self.rows * s**2 + self.weight) / resonance[:, None]
        return np.linalg.inv(self.rigid - push.T @ self.rows)

    @property
    def poles(self):
        n = self.w.size + 2
        mass, stiff, damp = np.eye(n), np.zeros((n, n)), np.zeros((n, n))
        mass[:2, :2] = self.rigid
        mass[2:, :2], mass[:2, 2:] = self.rows, self.rows.T
        stiff[2:, 2:], damp[2:, 2:] = np.diag(self.w**2), np.diag(self.rate)
        stiff[:2, 2:] = self.weight.T
        a = np.block(
            [[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, np.hstack([stiff, damp]))]]
        )
        poles = np.linalg.eigvals(a)
        return poles[poles.imag > 1e-3 * self.w[0]].imag


class TestPlant:
    @pytest.mark.parametrize("acceleration", [0.05, 9.80665])
    def test_attitude_by_torque_is_that_of_the_flow(self, tmp_path, acceleration):
        result = embedded(tmp_path, acceleration)
        plant = bc.plant(result, ["torque:bus"], ["attitude"], at="burn", loaded=True)
        truth, whole = (OnBus(acceleration, modes) for modes in (2, 12))
        omega = np.sqrt(acceleration) * np.array([0.3, 1.2, 2.5, 4.0, 6.0])
        for w in omega:
            s = 1j * w
            found = plant(s)[0, 0]
            expected = truth.response(s)[1, 1] / s**2
            assert abs(found / expected - 1.0) < SAME
            expected = whole.response(s)[1, 1] / s**2
            assert abs(plant.exact(s)[0, 0] / expected - 1.0) < MASSES

    def test_file_and_keyframe_give_the_same(self, tmp_path):
        result = embedded(tmp_path, 0.05)
        result.write(tmp_path / "flexible.xml")
        file = bc.plant(
            tmp_path / "flexible.xml", ["torque:bus"], ["attitude"], "burn", loaded=True
        )
        same = bc.plant(result, ["torque:bus"], ["attitude"], at="burn", loaded=True)
        assert np.allclose(file.frequency, same.frequency, rtol=1e-12)
        assert set(file.modes) == {f"tank_mode{k}_{p}" for k in (1, 2) for p in ("xy", "xz")}

    def test_held_craft_in_gravity(self, tmp_path):
        joint = '<joint name="pin" axis="1 0 0" stiffness="2e4" damping="9"/>'
        result = embedded(tmp_path, 9.80665, joint=joint, gravity="0 0 -9.80665")
        plant = bc.plant(result, ["torque:bus"], ["motion:tank"], loaded=True)
        flow = Flow(RADIUS, HEIGHT)
        place = np.array([[1.0, -PLACE], [0.0, 1.0]])
        weight = PLACE * LIQUID * 9.80665  # of the place, which rises as the pin turns

        def stiffness(w):
            """Of the pin in a field that does not turn, undamped; zero at the modes."""
            whole = place.T @ (DENSITY * flow.dynamic_mass(1j * w, 9.80665)) @ place
            return float(2e4 + weight - w**2 * (ABOUT + whole[1, 1].real))

        assert plant.modes == ("tank_mode1_xy", "pin", "tank_mode2_xy")
        for w in plant.frequency:
            assert stiffness(w * (1.0 - HELD)) * stiffness(w * (1.0 + HELD)) < 0.0


class TestPromise:
    def test_a_burn_is_met(self, tmp_path):
        scene = "[scene]\nbandwidth = 1.0\ntolerance = 1e-2\n"
        result = embedded(tmp_path, 0.05, scene=scene)
        assert result.met
        assert result.appendages[0].fit.spec.slosh.kept == 3
        omega = np.linspace(0.02, 1.0, 400)
        ours, whole = OnBus(0.05, 3), OnBus(0.05, 12)
        scale = np.sqrt(np.diag(whole.rigid))
        frozen = np.linalg.norm(np.linalg.inv(whole.rigid) * np.outer(scale, scale), 2)

        def size(matrix):
            return np.linalg.norm(matrix * np.outer(scale, scale), 2)

        worst = max(
            size(ours.response(1j * w) - whole.response(1j * w))
            / max(size(whole.response(1j * w)), frozen)
            for w in omega
        )
        assert result.promise.poses["burn"] == pytest.approx(worst, rel=0.1)

    def test_marks_are_proved_again(self, tmp_path):
        result = embedded(tmp_path, 0.05, arrays=True)
        result.write(tmp_path / "flexible.xml")
        proof = bc.prove(tmp_path / "flexible.xml", loaded=True)
        assert proof.craft_error == pytest.approx(result.craft_error, rel=1e-6)


class TestSaid:
    def codes(self, result):
        return [w.code for w in result.warnings if w.code.startswith("slosh")]

    def test_weightless(self, tmp_path):
        assert self.codes(embedded(tmp_path, 0.05, loaded=False)) == ["slosh-weightless"]
        under = embedded(tmp_path, 0.05)
        assert self.codes(under) == ["slosh-weightless"]  # at rest, where nothing acts
        assert "at rest" in str(under.warnings[-1])
        fit = under.appendages[0].fit
        assert [w.code for w in fit.warnings] == ["slosh-weightless"]
        limp = bc.plant(
            embedded(tmp_path, 0.05, arrays=True), ["torque:bus"], ["attitude"], at="burn"
        )
        assert [w.code for w in limp.warnings] == ["slosh-weightless"]

    def test_thrust_beside_the_axis(self, tmp_path):
        tilted = embedded(tmp_path, 0.05, axes="0 0.4 1 0 1 -0.4")
        assert self.codes(tilted) == ["slosh-weightless", "slosh-tilt"]

    def test_thrust_against_the_axis(self, tmp_path):
        with pytest.raises(bc.InputError, match="away from the tank's bottom"):
            embedded(tmp_path, 0.05, axes="0 0 -1 0 1 0")

    def test_carrying(self, tmp_path):
        (tmp_path / "tank.toml").write_text(tank(0.05))
        with pytest.raises(bc.InputError, match="carries nothing"):
            bc.embed(craft(), {"tank": tmp_path / "tank.toml"}, carry={"tank:tip": ["bus"]})

    def test_step_limits_and_recovery(self, tmp_path):
        (tmp_path / "tank.toml").write_text(tank(0.05))
        with pytest.raises(bc.InputError, match="no stiffness without an acceleration"):
            bc.stability(tmp_path / "tank.toml")
        result = embedded(tmp_path, 0.05)
        with pytest.raises(bc.InputError, match="has no sections"):
            result.recover(mujoco.MjData(result.model), "tank")

    def test_a_plant_without_a_load(self, tmp_path):
        result = embedded(tmp_path, 0.05, arrays=True)
        with pytest.raises(bc.InputError, match="nothing acts"):
            bc.plant(result, ["torque:bus"], ["attitude"], loaded=True)
        with pytest.raises(bc.InputError, match="leave discrete out"):
            bc.plant(result, ["torque:bus"], ["attitude"], "burn", discrete=0.02, loaded=True)


def test_commands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "craft.xml").write_text(craft((BUS + LIQUID) * 0.05))
    assert call("init", "tank").status == 0
    assert call("fit", "tank.toml", "-o", "out").status == 0
    at = ("--at", "tank=tank.toml")
    assert call("embed", "craft.xml", *at, "--loaded", "-o", "flexible.xml").status == 0
    at = ("--pose", "burn", "--loaded")
    told = call("plant", "flexible.xml", "--input", "torque:bus", *at, "-o", "plant.mat")
    assert told.status == 0
    assert "tank_mode1_xz" in told.out
    assert call("inspect", "flexible.xml", "--prove", "--loaded").status == 0
