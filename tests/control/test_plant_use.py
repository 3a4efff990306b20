"""What `bc.plant` hands out and how it answers mistakes: names, units, minimality, angles,
files, errors."""

import json

import control
import mujoco
import numpy as np
import pytest
from scipy.io import loadmat

import beamchain as bc
from mechanics import compiled
from plant_truth import CRAFTS, Truth, embedded, error, kept, text

SAME = 1e-12  # numbers that went through a file, or through another way of asking for them
AGREE = 1e-7  # transfer functions after states were taken out
NAME = "four wheels, two drives with arrays, a boom"
SPRUNG = "a sprung drive and worn bearings"
S = np.geomspace(0.05, 80.0, 40) * (0.01 + 1j)


def bare(**changes):
    """The bare craft with a sprung drive, its text changed."""
    out = text(CRAFTS[SPRUNG])
    for old, new in changes.values():
        assert old in out
        out = out.replace(old, new)
    return compiled(out)


# -- what it is ------------------------------------------------------------------------------------
def test_it_is_a_state_space_with_names_and_units():
    plant = bc.plant(
        embedded(NAME),
        ["left_drive_motor", "torque:hub", "wrench:unit"],
        ["attitude", "star", "left_drive_angle"],
    )
    assert isinstance(plant, control.StateSpace)
    assert plant.input_labels == [
        "left_drive_motor",
        "torque_x_hub",
        "torque_y_hub",
        "torque_z_hub",
        "force_x",
        "force_y",
        "force_z",
        "torque_x_unit",
        "torque_y_unit",
        "torque_z_unit",
    ]
    assert plant.output_labels == [f"{n}_{a}" for n in ("attitude", "star") for a in "xyz"] + [
        "left_drive_angle"
    ]
    assert plant.output_units == ("rad",) * 7
    assert plant.input_units[1:5] == ("N m", "N m", "N m", "N")
    assert len(plant.state_units) == plant.nstates == plant.A.shape[0]
    assert {
        "boom_mode1_xy",
        "left_array_mode2_xz",
        "rigid_attitude_x_rate",
        "rigid_left_drive",
    } <= set(plant.state_labels)
    assert not [state for state in plant.state_labels if "wheel" in state or "position" in state]
    assert repr(plant).startswith("<Plant, 10 inputs, 7 outputs, ")
    with pytest.raises(ValueError, match="read-only"):
        plant.A[0, 0] = 1.0


@pytest.mark.slow
def test_units_of_actuators():
    """Motors are forces or torques, servos set points; what MuJoCo does not say is left empty."""
    section = bc.Equivalent(bending_stiffness_xy=1e3, linear_mass=2.0)
    spec = bc.Spec(segment=(bc.Segment(length=4.0, section=section),), modes=bc.Modes(xy=1))
    craft = """<mujoco><worldbody><body name="bus"><freejoint/>
    <inertial pos="0 0 0" mass="90" diaginertia="20 20 20"/>
    <site name="mount"/><body><joint name="turn" axis="0 0 1" damping="1"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
    <body><joint name="slide" type="slide" damping="1"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
    </body></worldbody><tendon><fixed name="rope"><joint joint="slide" coef="1"/></fixed></tendon>
    <actuator>
    <motor name="wheel" joint="turn"/><motor name="pusher" joint="slide" gear="2"/>
    <position name="angle" joint="turn" kp="3"/>
    <velocity name="speed" joint="turn" kv="3"/><position name="place" joint="slide" kp="3" kv="1"/>
    <intvelocity name="held" joint="turn" kp="3" actrange="-1 1"/>
    <motor name="jet" site="mount" gear="1 0 0 0 0 0"/>
    <motor name="torquer" site="mount" gear="0 0 0 0 1 0"/>
    <motor name="both" site="mount" gear="1 0 0 0 1 0"/>
    <motor name="winch" tendon="rope"/><general name="scaled" joint="turn" gainprm="0.2"/>
    </actuator></mujoco>"""
    plant = bc.plant(bc.embed(craft, {"mount": spec}), outputs=["attitude", "rate"])
    units = dict(zip(plant.input_labels, plant.input_units, strict=True))
    assert units == {
        "wheel": "N m",
        "pusher": "N",
        "angle": "rad",
        "speed": "rad/s",
        "place": "m",
        "held": "",
        "jet": "N",
        "torquer": "N m",
        "both": "",
        "winch": "",
        "scaled": "",
    }


@pytest.mark.slow
def test_what_makes_up_a_chain_is_no_mode():
    section = bc.Equivalent(bending_stiffness_xy=1e3, bending_stiffness_xz=4e3, linear_mass=2.0)
    spec = bc.Spec(
        name="boom",
        segment=(bc.Segment(length=4.0, section=section),),
        modes=bc.Modes(xy=2, xz=1),
        fit=bc.spec.FitOptions(springs="modes"),
        damping=bc.Damping(ratio=0.003),
    )
    craft = """<mujoco><worldbody><body name="bus"><freejoint/>
    <inertial pos="0 0 0" mass="90" diaginertia="20 20 20"/>
    <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>"""
    embedded = bc.embed(craft, {"mount": spec})
    names = [
        mujoco.mj_id2name(embedded.model, mujoco.mjtObj.mjOBJ_TENDON, i)
        for i in range(embedded.model.ntendon)
    ]
    plant = bc.plant(embedded, ["torque:bus"])
    fillers = [name for name in plant.modes if "filler" in name]
    assert len(fillers) == sum("filler" in name for name in names) > 0
    assert [name for name in plant.modes if name not in fillers] == [
        "boom_mode1_xy",
        "boom_mode1_xz",
        "boom_mode2_xy",
    ]
    assert any(fillers[0] in said and "predicts nothing" in said for said in plant.warnings)


def test_defaults_are_all_actuators_and_attitude_with_rate():
    plant = bc.plant(embedded(NAME))
    assert plant.input_labels == [
        *(f"wheel{i}_motor" for i in range(1, 5)),
        "left_drive_motor",
        "right_drive_motor",
    ]
    assert plant.output_labels == [f"{n}_{a}" for n in ("attitude", "rate") for a in "xyz"]
    assert bc.plant(embedded("one undamped boom")).input_labels == [
        "torque_x",
        "torque_y",
        "torque_z",
    ]


@pytest.mark.slow
def test_control_works_on_it():
    plant = bc.plant(embedded(NAME), ["torque:hub"])
    one = plant["attitude_z", "torque_z"]
    assert control.frequency_response(plant, [1.0, 2.0, 3.0]).magnitude.shape == (6, 3, 3)
    assert control.bode(one, [1.0, 2.0, 3.0]).lines.shape == (2, 1)
    loop = control.feedback(one, control.tf([40.0, 20.0], [0.1, 1.0]))
    assert loop.nstates == plant.nstates + 1


def test_it_is_modal_and_minimal():
    plant = bc.plant(embedded(NAME), ["torque:hub"])
    a = np.array(plant.A)
    for state in plant.state_labels[::2]:  # pairs on the diagonal
        i = plant.state_labels.index(state)
        assert plant.state_labels[i + 1] == f"{state}_rate"
        a[i : i + 2, i : i + 2] = 0.0
    assert np.all(a == 0.0)
    w = np.concatenate([np.ones(6), np.repeat(plant.frequency, 2)])
    w[0::2] = 1.0
    scaled = (
        np.diag(1.0 / w) @ plant.A @ np.diag(w),
        np.diag(1.0 / w) @ plant.B,
        plant.C @ np.diag(w),
    )
    for s in np.linalg.eigvals(plant.A):  # Popov, Belevitch, Hautus
        eye = s * np.eye(plant.nstates)
        assert np.linalg.svd(np.hstack([scaled[0] - eye, scaled[1]]), compute_uv=False)[-1] > 1e-7
        assert np.linalg.svd(np.vstack([scaled[0] - eye, scaled[2]]), compute_uv=False)[-1] > 1e-7


def test_one_wheel_drives_one_direction():
    craft = CRAFTS[NAME]
    plant = bc.plant(embedded(NAME), ["wheel1_motor"], ["attitude"])
    assert [state for state in plant.state_labels if state.startswith("rigid")].__len__() == 2
    assert (
        error(
            plant(S, squeeze=False),
            Truth(craft_at_rest(craft), kept).transfer(S, ["wheel1_motor"], ["attitude"]),
        )
        < AGREE
    )


def craft_at_rest(craft):
    return {**craft, "wheels": {n: {**w, "rate": 0.0} for n, w in craft["wheels"].items()}}


def test_a_wheel_turns_the_hub_the_other_way():
    plant = bc.plant(bare(), ["spin_motor"], ["rate"])
    assert plant.gain.shape == (1, 3, 1)
    assert plant(0.5)[0].real < 0.0  # the wheel's axis is x, but for a tenth


def test_keyframes_bring_angles_and_speeds():
    made = embedded(NAME)
    rates = {n: w["rate"] for n, w in CRAFTS[NAME]["wheels"].items()}
    by_key = bc.plant(made, pose="run")
    by_hand = bc.plant(made, pose={}, rates=rates)
    assert error(by_key(S, squeeze=False), by_hand(S, squeeze=False)) < SAME
    assert bc.plant(made, pose=0).state_labels == by_key.state_labels
    still = bc.plant(made, pose=np.array(made.model.key_qpos[0]))  # positions bring no speeds
    assert ["nutation" in " ".join(p.state_labels) for p in (still, by_key)] == [False, True]


def test_specs_models_and_files_are_taken(tmp_path):
    made = embedded("one undamped boom")
    path = made.write(tmp_path / "craft.xml")[-1]
    plants = [
        bc.plant(given) for given in (path, made.model, mujoco.MjSpec.from_file(str(path)), made)
    ]
    for plant in plants[:3]:
        assert np.allclose(plant.A, plants[3].A, rtol=1e-9, atol=1e-12)
        with pytest.raises(bc.InputError, match="bc.embed"):
            _ = plant.exact
    assert plants[3].truncation([0.1, 1.0]).shape == (6, 3, 2)


def test_the_exact_plant_has_signals_of_the_bare_spacecraft_alone():
    with pytest.raises(bc.InputError, match="exact.*bare spacecraft's signals"):
        _ = bc.plant(embedded("one undamped boom"), ["torque:boom_link1"]).exact


def test_a_lag_of_an_actuator_is_a_state():
    lagged = bare(
        a=(
            '<motor name="drive_motor" joint="drive"/>',
            '<general name="drive_motor" joint="drive" dyntype="filter" dynprm="0.5"/>',
        )
    )
    plain = bc.plant(bare(), ["drive_motor"])
    slow = bc.plant(lagged, ["drive_motor"])
    assert "drive_motor" in slow.state_labels
    assert error(slow(S, squeeze=False), plain(S, squeeze=False) / (0.5 * S + 1.0)) < AGREE


# -- over angles -----------------------------------------------------------------------------------
@pytest.mark.slow
def test_a_plant_per_angle_keeps_its_states_and_modes():
    angles = np.radians([0.0, 30.0, 60.0, 90.0])
    made = embedded(NAME)
    grid = bc.plant(made, ["torque:hub"], pose={"left_drive": angles, "right_drive": 0.5})
    assert len(grid) == 4
    assert {plant.state_labels.__repr__() for plant in grid.plants} == {
        grid[0].state_labels.__repr__()
    }
    assert [m.shape for m in grid.matrices()] == [
        (4, *getattr(grid[0], name).shape) for name in "ABCD"
    ]
    assert grid.frequency.shape == grid.damping_ratio.shape == (4, len(grid.modes))
    assert grid.gain.shape == (4, len(grid.modes), 6, 3)
    for angle, plant in zip(angles, grid.plants, strict=True):
        alone = bc.plant(made, ["torque:hub"], pose={"left_drive": angle, "right_drive": 0.5})
        assert error(plant(S, squeeze=False), alone(S, squeeze=False)) < AGREE
    fine = bc.plant(
        made,
        ["torque:hub"],
        pose={"left_drive": np.radians(np.arange(0.0, 91.0, 10.0)), "right_drive": 0.5},
    )
    assert np.allclose(
        fine.frequency[[0, 3, 6, 9]][:, [fine.modes.index(m) for m in grid.modes]],
        grid.frequency,
        rtol=1e-9,
    )
    # no mode jumps from one to another
    assert np.max(np.abs(np.diff(np.log(fine.frequency), axis=0))) < 0.12
    assert fine.plot().get_xlabel() == "left_drive, degrees"


# -- files -----------------------------------------------------------------------------------------
def test_files_hold_the_plant_and_are_not_overwritten(tmp_path):
    plant = bc.plant(embedded("one undamped boom"))
    grid = bc.plant(bare(), ["torque:hub"], pose={"drive": [0.0, 0.1]})
    matlab = loadmat(plant.write(tmp_path / "p.mat"))
    plain = np.load(plant.write(tmp_path / "p.npz"))
    words = json.loads(plant.write(tmp_path / "p.json").read_text())
    for name in "ABCD":
        assert np.array_equal(matlab[name], getattr(plant, name))
        assert np.array_equal(plain[name], getattr(plant, name))
        assert np.allclose(words[name], getattr(plant, name), rtol=SAME, atol=0.0)
    assert (
        [str(cell[0]) for cell in matlab["StateName"][:, 0]]
        == plant.state_labels
        == words["StateName"]
        == list(plain["StateName"])
    )
    assert loadmat(grid.write(tmp_path / "g.mat"))["A"].shape == (*grid[0].A.shape, 2)
    with pytest.raises(bc.BeamchainError, match="exists"):
        plant.write(tmp_path / "p.mat")
    plant.write(tmp_path / "p.mat", force=True)
    with pytest.raises(bc.InputError, match=r"\.csv'.* \.npz, \.json, \.mat"):
        plant.write(tmp_path / "p.csv")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["g.mat", "p.json", "p.mat", "p.npz"]


def test_gravity_is_left_out_and_said():
    model = bare(a=('gravity="0 0 0"', 'gravity="0 0 -9.81"'))
    plant = bc.plant(model)
    assert [w.code for w in plant.warnings] == ["gravity"]
    assert np.allclose(plant.A, bc.plant(bare()).A)


@pytest.mark.parametrize("kind", ["magnetometer", "framepos"])
@pytest.mark.slow
def test_an_output_that_sees_few_directions_alone_is_what_it_is_beside_others(tmp_path, kind):
    """Directions that no output sees are left out of the states; what is seen stays."""
    at = 'site="imu"' if kind == "magnetometer" else 'objtype="site" objname="imu"'
    sensor = f'<{kind} name="seen" {at}/>'
    (tmp_path / "craft.xml").write_text(
        '<mujoco><option gravity="0 0 0" magnetic="0.3 -0.5 0.8"/><worldbody><body name="bus">'
        '<freejoint/><inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/>'
        '<site name="mount" pos="0.6 0 0"/><site name="imu" pos="0.2 -0.3 0.4" euler="20 30 40"/>'
        f"</body></worldbody><sensor>{sensor}</sensor></mujoco>"
    )
    boom = beam_of_two_planes()
    flexible = bc.embed(tmp_path / "craft.xml", {"mount": boom})
    inputs = ["torque:bus", "force:bus"]
    s = 1j * np.array([0.05, 0.4, 1.7])
    alone = bc.plant(flexible, inputs, ["seen"])(s, squeeze=False)
    beside = bc.plant(flexible, inputs, ["seen", "attitude", "rate", "motion:imu"])(
        s, squeeze=False
    )
    size = np.abs(beside[:3]).max(axis=(0, 1))
    assert np.max(np.abs(alone - beside[:3]) / size) < 1e-9


def beam_of_two_planes():
    section = bc.Equivalent(
        bending_stiffness_xy=2e3,
        bending_stiffness_xz=3e3,
        torsion_stiffness=500.0,
        linear_mass=4.0,
        polar_inertia=0.2,
    )
    return bc.Spec(
        name="boom",
        segment=(bc.Segment(length=6.0, section=section),),
        modes=bc.Modes(xy=2, xz=1, torsion=1),
    )
