"""A tank on a spacecraft under thrust or gravity, against potential flow by polynomials
(tests/support/flow.py) on a rigid body, and against plain MuJoCo."""

import copy

import mujoco
import numpy as np
import pytest

import beamchain as bc
from barge import (
    ABOUT,
    BOTH,
    BURN,
    BUS,
    DENSITY,
    HEIGHT,
    LIQUID,
    PLACE,
    RADIUS,
    RATIO,
    craft,
    embedded,
    tank,
)
from command import call
from flow import Flow
from spacecraft import spec

DIFFERENCED = 1e-6  # frequencies from differences of MuJoCo's forces
SAME = 1e-6  # of a response off its peaks, by two ways to linearise
MASSES = 1e-5  # of the same, the stiffness of the exact one by differences of its masses' places
HELD = 5e-4  # of a frequency: damping, and what two pendulums leave out of the flow
STEP = 1e-4  # rad, of differences


def clamped(model, acceleration):
    """Frequencies and effective masses of the tank's hinges with all else held, in a field along
    the thrust's back: by MuJoCo's mass matrix and differences of its forces."""
    model = copy.copy(model)
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
    @pytest.mark.slow
    @pytest.mark.parametrize("acceleration", [0.05, 9.80665])
    def test_frequency_and_effective_mass_beside_arrays(self, tmp_path, acceleration):
        model = embedded(tmp_path, acceleration, arrays=BOTH, loaded=False).model
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
    @pytest.mark.slow
    def test_attitude_by_torque_is_that_of_the_flow(self, tmp_path, acceleration):
        result = embedded(tmp_path, acceleration)
        plant = bc.plant(result, ["torque:bus"], ["attitude"], pose="burn", loaded=True)
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
        same = bc.plant(result, ["torque:bus"], ["attitude"], pose="burn", loaded=True)
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
    @pytest.mark.slow
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

    @pytest.mark.slow
    def test_marks_are_proved_again(self, tmp_path):
        (tmp_path / "tank.toml").write_text(tank(0.05))
        at = {"tank": tmp_path / "tank.toml", "left": spec("rod")}
        result = bc.embed(craft(BURN), at, loaded=True, retime=False)
        result.write(tmp_path / "flexible.xml")
        proof = bc.prove(tmp_path / "flexible.xml", loaded=True)
        assert proof.craft_error == pytest.approx(result.craft_error, rel=1e-6)


class TestSaid:
    def codes(self, result):
        return [w.code for w in result.warnings if w.code.startswith("slosh")]

    @pytest.mark.slow
    def test_weightless(self, tmp_path):
        assert self.codes(embedded(tmp_path, 0.05, loaded=False)) == ["slosh-weightless"]
        under = embedded(tmp_path, 0.05)
        assert self.codes(under) == ["slosh-weightless"]  # at rest, where nothing acts
        assert "at rest" in str(under.warnings[-1])
        fit = under.appendages[0].fit
        assert [w.code for w in fit.warnings] == ["slosh-weightless"]
        limp = bc.plant(
            embedded(tmp_path, 0.05, arrays=BOTH), ["torque:bus"], ["attitude"], pose="burn"
        )
        assert [w.code for w in limp.warnings] == ["slosh-weightless"]

    def test_thrust_beside_the_axis(self, tmp_path):
        tilted = embedded(tmp_path, 0.05, axes="0 0.4 1 0 1 -0.4")
        assert self.codes(tilted) == ["slosh-weightless", "slosh-tilt"]

    @pytest.mark.slow
    def test_a_plant_without_a_load(self, tmp_path):
        result = embedded(tmp_path, 0.05, arrays=BOTH)
        with pytest.raises(bc.InputError, match="nothing acts"):
            bc.plant(result, ["torque:bus"], ["attitude"], loaded=True)
        with pytest.raises(bc.InputError, match="leave discrete out"):
            bc.plant(result, ["torque:bus"], ["attitude"], "burn", discrete=0.02, loaded=True)

    @pytest.mark.parametrize("held", [False, True])
    @pytest.mark.parametrize("retime", [None, True])
    def test_a_tank_alone_has_no_timing(self, tmp_path, retime, held):
        """Though its damper is felt at the step, and in gravity its frequencies are too."""
        (tmp_path / "tank.toml").write_text(tank(0.05).replace("0.01", "0.2"))
        pin = '<joint axis="1 0 0" stiffness="2e4"/>'
        fixed = {"joint": pin, "gravity": "0 0 -9.80665"} if held else {}
        text = craft(**fixed).replace("timestep", 'integrator="implicitfast" timestep')
        result = bc.embed(text, {"tank": tmp_path / "tank.toml"}, retime=retime)
        assert result.appendages[0].timed is None
        assert not {"exact-in-time", "time-error"} & {w.code for w in result.warnings}

    @pytest.mark.slow
    def test_embed_speaks_of_no_scene(self, tmp_path):
        for loaded in (False, True):
            result = embedded(tmp_path, 0.05, loaded=loaded)
            assert not any("scene.xml" in w for w in result.warnings)
        assert any("scene.xml" in w for w in bc.fit(tmp_path / "tank.toml").warnings)

    @pytest.mark.parametrize("turned", [False, True])
    @pytest.mark.slow
    def test_thrust_beside_the_centre_of_mass(self, tmp_path, turned):
        """The bus turns away by the moment that is told, as plain MuJoCo has it."""
        text = craft(BURN).replace('"nozzle" pos="0 0 -0.8"', '"nozzle" pos="0.014 0 -0.8"')
        if turned:  # the moment is told in no axes
            text = text.replace('<body name="bus">', '<body name="bus" quat="0.6 0 0.8 0">')
        (tmp_path / "tank.toml").write_text(tank(0.05))
        result = bc.embed(text, {"tank": tmp_path / "tank.toml"}, loaded=True, retime=False)
        (said,) = [w for w in result.warnings if w.code == "thrust-offset"]
        moment = 0.014 * BURN
        assert "burn passes 14 mm beside" in said
        assert f"{moment:.3g} N m" in said
        model, data = result.model, mujoco.MjData(result.model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        data.subtree_angmom[:] = 0.0
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        gained = np.linalg.norm(data.subtree_angmom[model.body("bus").id]) / model.opt.timestep
        assert gained == pytest.approx(moment, rel=1e-3)
        plant = bc.plant(result, ["torque:bus"], ["attitude"], pose="burn", loaded=True)
        assert said in plant.warnings

    def test_thrust_through_the_centre_of_mass(self, tmp_path):
        result = embedded(tmp_path, 0.05)
        plant = bc.plant(result, ["torque:bus"], ["attitude"], pose="burn", loaded=True)
        said = [*result.warnings, *plant.warnings]
        assert "thrust-offset" not in {w.code for w in said}

    def test_a_liquid_that_outweighs_the_spacecraft(self, tmp_path):
        text = tank(0.05).replace("0.5", "5.0").replace("0.8", "8.0")  # 1,058 times the bus
        (tmp_path / "tank.toml").write_text(text)
        result = bc.embed(craft(), {"tank": tmp_path / "tank.toml"}, retime=False)
        (said,) = [w for w in result.warnings if w.code == "heavy-liquid"]
        assert "1.06e+03 times the 600 kg that carry it" in said
        usual = embedded(tmp_path, 0.05).warnings
        assert "heavy-liquid" not in {w.code for w in usual}

    @pytest.mark.slow
    def test_key_lists_every_kept_mode(self, tmp_path):
        result = embedded(tmp_path, 0.05)
        modes = result.modes_at("burn", beyond=True)
        assert len(modes) == len(result.as_dict()["modes"]) == 4
        assert all(mode.kept and abs(mode.error) < HELD for mode in modes)


#: The place by the axis of it that is the tank's, for one and the same tank: its x, y and z are the
#: bus's z, x and y. The quaternions of these attitudes hold no rounding.
PLACES = {
    "x": "0 0 1 1 0 0",
    "y": "0 1 0 0 0 1",
    "z": "1 0 0 0 1 0",
    "-x": "0 0 -1 -1 0 0",
    "-y": "0 1 0 0 0 -1",
    "-z": "-1 0 0 0 1 0",
}
ROUNDING = 1e-12  # relative
SWUNG = 0.1  # rad


def spec_along(folder, axis, scene=""):
    file = folder / f"{axis}.toml"
    file.write_text(tank(0.05, axis=axis, scene=scene))
    return file


def craft_on(axes):
    return craft(BURN, axes=axes).replace("300 300 250", "300 320 250")


@pytest.fixture(scope="module")
def along(tmp_path_factory):
    """The tank without the key, on a place whose x is its axis."""
    at = {"tank": spec_along(tmp_path_factory.mktemp("along"), None)}
    return bc.embed(craft_on(PLACES["x"]), at, loaded=True, retime=False)


@pytest.fixture(scope="module")
def plant_along(along):
    return bc.plant(along, ["torque:bus"], ["attitude"], pose="burn", loaded=True)


class TestAxis:
    """A tank whose axis is another one of its place's is the tank on a place that is turned."""

    def numbers(self, model):
        """Of the pendulums swung aside: the mass matrix, the accelerations under thrust, and the
        frequencies with all else held, in a field along the thrust's back."""
        names = [model.joint(int(j)).name for j in model.dof_jntid]
        inner = [i for i, name in enumerate(names) if name.startswith("tank_hinge")]
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[[model.jnt_qposadr[model.dof_jntid[i]] for i in inner]] = [0.1, -0.2, 0.3, 0.15]
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        moved, at = np.array(data.qacc), np.array(data.xipos)
        field = np.array(model.opt.gravity)
        model.opt.gravity[:] = [0.0, 0.0, -0.05]
        squares = []
        for i in inner:
            data.qpos[:] = model.qpos0
            data.qpos[model.jnt_qposadr[model.dof_jntid[i]]] = SWUNG
            data.qvel[:] = 0.0
            mujoco.mj_forward(model, data)
            own = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, own)
            squares.append(data.qfrc_bias[i] / np.sin(SWUNG) / own[i, i])
        model.opt.gravity[:] = field
        return mass, moved, at, np.sqrt(squares)

    def assert_same(self, model, plain):
        """As the tank on a place whose x is its axis."""
        found, wanted = self.numbers(model), self.numbers(plain)
        for one, other in zip(found, wanted, strict=True):
            assert np.max(np.abs(one - other)) < ROUNDING * np.max(np.abs(other))
        return found

    def test_frequencies_are_those_of_the_flow(self, along):
        found = self.numbers(along.model)
        kappa, _, _ = Flow(RADIUS, HEIGHT).modes(2)
        assert found[-1] == pytest.approx(np.repeat(np.sqrt(0.05 * kappa), 2), rel=1e-9)

    @pytest.mark.slow
    @pytest.mark.parametrize("axis", ["-x", "y", "z"])  # each is attached by MuJoCo below
    def test_embedded_in_a_file(self, tmp_path, along, plant_along, axis):
        at = {"tank": spec_along(tmp_path, axis)}
        result = bc.embed(craft_on(PLACES[axis]), at, loaded=True, retime=False)
        assert result.craft_error == pytest.approx(along.craft_error, rel=ROUNDING)
        result.write(tmp_path / "flexible.xml")
        self.assert_same(mujoco.MjModel.from_xml_path(str(tmp_path / "flexible.xml")), along.model)
        proof = bc.prove(tmp_path / "flexible.xml", loaded=True)
        assert proof.craft_error == pytest.approx(along.craft_error, rel=ROUNDING)
        plant = bc.plant(result, ["torque:bus"], ["attitude"], pose="burn", loaded=True)
        for response in ("__call__", "exact"):
            one, other = (getattr(p, response)(0.3j)[0, 0] for p in (plant, plant_along))
            assert one == pytest.approx(other, rel=SAME)

    @pytest.mark.parametrize("axis", PLACES)
    def test_attached_by_mujoco(self, tmp_path, along, axis):
        """The file of the tank alone on a site, and in a frame of the file of the spacecraft."""
        fit = bc.fit(spec_along(tmp_path, axis))
        spec = mujoco.MjSpec.from_string(craft_on(PLACES[axis]))
        fit.attach(spec, "tank")
        self.assert_same(spec.compile(), along.model)
        (tmp_path / "appendage.xml").write_text(fit.to_mjcf().replace('"tank_', '"'))
        model = f'<asset><model name="tank" file="{tmp_path}/appendage.xml"/></asset>'
        frame = (
            f'<frame pos="0 0 -0.4" xyaxes="{PLACES[axis]}">'
            '<attach model="tank" body="link1" prefix="tank_"/></frame></body></worldbody>'
        )
        text = craft_on(PLACES[axis]).replace("</body></worldbody>", frame)
        text = text.replace("<worldbody>", f"{model}<worldbody>")
        self.assert_same(mujoco.MjModel.from_xml_string(text), along.model)

    def test_embedded_in_an_mjspec(self, tmp_path, along):
        spec = mujoco.MjSpec.from_string(craft_on(PLACES["z"]))
        bc.embed(spec, {"tank": spec_along(tmp_path, "z")}, retime=False)
        self.assert_same(spec.compile(), along.model)

    @pytest.mark.slow
    def test_on_a_body(self, tmp_path, along):
        """The axes of a body are those of the place."""
        turned = f'<body name="bottom" pos="0 0 -0.4" xyaxes="{PLACES["-y"]}"/></body></worldbody>'
        text = craft_on(PLACES["x"]).replace("</body></worldbody>", turned)
        at = {"body:bottom": spec_along(tmp_path, "-y")}
        result = bc.embed(text, at, loaded=True, retime=False)
        assert result.craft_error == pytest.approx(along.craft_error, rel=ROUNDING)
        mass, wanted = (self.numbers(one)[0] for one in (result.model, along.model))
        assert np.max(np.abs(mass - wanted)) < ROUNDING * np.max(wanted)

    @pytest.mark.slow
    def test_on_a_place_that_leans(self, tmp_path):
        """The turn is about the axes of the place, wherever they point."""
        x = np.array([0.8, 0.6, 0.05])
        y = np.array([-0.6, 0.8, 0.02])
        y -= x * (x @ y) / (x @ x)
        z = np.cross(x, y)
        results = [
            bc.embed(
                craft_on(" ".join(map(str, axes))),
                {"tank": spec_along(tmp_path, axis)},
                loaded=True,
                retime=False,
            )
            for axis, axes in (("z", [*x, *y]), ("x", [*z, *x]))
        ]
        self.assert_same(*(result.model for result in results))
        errors = [result.craft_error for result in results]
        assert errors[0] == pytest.approx(
            errors[1], rel=1e-6
        )  # by differences of its masses' places

    def test_scene_has_the_hub_in_axes_of_the_place(self, tmp_path):
        hub = (
            "[root]\nhub = { mass = 100.0, inertia = [10.0, 20.0, 25.0], products = "
            "[1.0, 2.0, 3.0], offset = [0.3, 0.2, 0.1] }\n"
        )
        models = []
        for axis in ("x", "z"):
            scene = bc.fit(spec_along(tmp_path, axis, hub)).scene_mjcf()
            models.append(mujoco.MjModel.from_xml_string(scene))
        found = []
        for model in models:
            data = mujoco.MjData(model)
            mujoco.mj_resetDataKeyframe(model, data, model.key("burn").id)
            mujoco.mj_forward(model, data)
            mass = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, mass)
            found.append((mass, np.array(data.qacc)))
        turn = np.eye(models[0].nv)
        turn[:3, :3] = turn[3:6, 3:6] = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]  # x of the tank is z
        (mass, moved), (own_mass, own_moved) = found
        assert np.max(np.abs(own_mass - turn @ mass @ turn.T)) < ROUNDING * np.max(mass)
        assert own_moved == pytest.approx(turn @ moved, abs=ROUNDING * np.max(np.abs(moved)))

    def test_root_load_under_thrust_is_along_the_axis(self, tmp_path):
        """`sensors.root_load` reads in the tank's axes."""
        at = {"tank": spec_along(tmp_path, "z", "[sensors]\nroot_load = true\n")}
        model = bc.embed(craft_on(PLACES["z"]), at, retime=False).model
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        force = data.sensor("tank_root_force").data
        assert force == pytest.approx([0.05 * LIQUID, 0.0, 0.0], rel=1e-9, abs=1e-9)

    @pytest.mark.slow
    def test_commands(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "craft.xml").write_text(craft_on(PLACES["z"]))
        before = (tmp_path / "craft.xml").read_bytes()
        spec_along(tmp_path, "z")
        at = ("--mount", "tank=z.toml", "--loaded", "--no-report")
        assert call("embed", "craft.xml", *at, "-o", "flexible.xml").status == 0
        assert call("inspect", "flexible.xml", "--prove", "--loaded").status == 0
        told = call("embed", "flexible.xml", "--remove", "-o", "back.xml")
        assert told.status == 0, told.err
        assert (tmp_path / "back.xml").read_bytes() == before


@pytest.mark.slow
def test_a_thrust_across_a_tank_leaves_its_liquid_without_rest(tmp_path):
    """And is told of, where the proof is made without it."""
    made = bc.embed(craft_on("0 1 0 0 0 1"), {"tank": spec_along(tmp_path, None)})
    (said,) = (one for one in made.warnings if one.code == "load-left-out")
    assert "the file finds no rest" in said


def test_commands(tmp_path, monkeypatch):
    """With their pages; those of `TestAxis` write none."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "craft.xml").write_text(craft((BUS + LIQUID) * 0.05, axes=PLACES["z"]))
    assert call("init", "tank").status == 0
    assert call("fit", "tank.toml", "-o", "out").status == 0
    at = ("--mount", "tank=tank.toml")
    assert call("embed", "craft.xml", *at, "--loaded", "-o", "flexible.xml").status == 0
    at = ("--pose", "burn", "--loaded")
    told = call("plant", "flexible.xml", "--from", "torque:bus", *at, "--full", "-o", "plant.mat")
    assert told.status == 0
    assert "tank_mode1_xz" in told.out
    assert call("inspect", "flexible.xml", "--prove", "--loaded").status == 0
