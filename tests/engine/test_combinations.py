"""Inputs and outputs of `bc.plant` that combine actuators and sensors: torque shared out over
wheels, thrusters and torquers, sensors in a body's axes, weighted sums; in every kind of plant."""

import json
import pickle

import mujoco
import numpy as np
import pytest

import beamchain as bc
from command import run
from wheels_and_jets import ASKEW, CRAFT, INPUTS, OUTPUTS, TILT, WHEELS, array, off, response

ROUNDING = 1e-9  # of responses, channel by channel beside the largest of the output
FIELD = 1e-8  # the same of a magnetometer, whose field is large beside what turns add to it
RUN = 1e-4  # of a run of MuJoCo, for what is not linear in it


@pytest.fixture(scope="module")
def boom():
    return array()


@pytest.fixture(scope="module")
def made(boom):
    return bc.embed(CRAFT, {"mount": boom})


def columns(made, names, outputs=("attitude", "rate"), **more):
    return response(bc.plant(made, names, list(outputs), **more))


# -- allocation ------------------------------------------------------------------------------------
# axes of the wheels in the bus, as the file has them; the torque on the bus is against them
AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], TILT @ np.ones(3) / 3**0.5])
ON_BUS = -(AXES * np.array([[1.0], [1.0], [-2.0], [0.5]])).T


def test_torque_is_shared_out_by_the_pseudo_inverse(made):
    """With gears, gains, a turned wheel and one on a bracket; whatever the attitude."""
    at = "turned"
    plant = bc.plant(made, {"torque": bc.allocate(WHEELS, axes="bus")}, pose=at)
    allocated = plant.allocations["torque"]
    np.testing.assert_allclose(allocated.torque, ON_BUS, atol=1e-12)
    shares = ON_BUS.T @ np.linalg.inv(ON_BUS @ ON_BUS.T)
    np.testing.assert_allclose(allocated.commands, shares, atol=1e-12)
    motors = columns(made, WHEELS, pose=at)
    true = np.einsum("pnk,na->pak", motors, shares)
    assert off(response(plant), true) < ROUNDING
    (direction,) = allocated.without_torque
    np.testing.assert_allclose(ON_BUS @ [direction[name] for name in WHEELS], 0.0, atol=1e-9)
    assert max(direction.values()) == 1.0
    assert plant.input_names == ("torque_x", "torque_y", "torque_z")
    assert plant.input_units == ("N m",) * 3


def test_thrusters_turn_about_the_mass_centre(made):
    """Pairs about the mass centre share a torque as couples, so that it is one on the bus."""
    thrusters = ["t_px", "t_nx", "t_py", "t_ny", "t_pz", "t_nz"]
    plant = bc.plant(made, {"couple": bc.allocate(thrusters)})
    z, x, y = np.eye(3)[[2, 0, 1]]
    np.testing.assert_allclose(
        plant.allocations["couple"].torque.T, [z, -z, x, -x, y, -y], atol=1e-12
    )
    assert plant.input_names == ("couple_x", "couple_y", "couple_z")
    assert off(response(plant), columns(made, ["torque:bus"])) < ROUNDING
    assert len(plant.allocations["couple"].without_torque) == 3
    said = [str(w) for w in plant.warnings if w.code == "allocation-null"]
    assert any("t_px : t_nx = 1 : 1" in text for text in said)


def test_a_torquer_turns_about_its_own_axis(made):
    plant = bc.plant(made, {"torque": bc.allocate(["w1", "rod", "w3"])})
    np.testing.assert_allclose(plant.allocations["torque"].torque[:, 1], 3.0 * ASKEW[:, 2])
    # a lone axis, and a matrix of one's own
    assert plant.allocations["torque"].without_torque == ()
    assert [w for w in plant.warnings if w.code.startswith("allocation")] == []


def test_axes_that_are_reached_may_be_asked_for_alone(made):
    plant = bc.plant(made, {"torque": bc.allocate(["w1", "w2"], about="xz")})
    assert plant.input_names == ("torque_x", "torque_z")
    np.testing.assert_allclose(plant.allocations["torque"].commands, [[-1.0, 0.0], [0.0, -1.0]])
    assert bc.plant(made, {"t": bc.allocate(["w3"], about="y")}).input_names == ("t_y",)
    assert off(response(plant), -columns(made, ["w1", "w2"])) < ROUNDING


def test_a_matrix_may_be_given(made):
    matrix = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.5, 0.0]])
    names = ["w1", "w2", "w3"]
    right = bc.plant(made, {"torque": bc.allocate(names, matrix=matrix)})
    assert [w for w in right.warnings if w.code.startswith("allocation")] == []
    wrong = bc.plant(made, {"torque": bc.allocate(names, matrix=-matrix)})
    said = [str(w) for w in wrong.warnings if w.code == "allocation-matrix"]
    assert len(said) == 3
    assert "torque of (-1, 0, 0) N m on 'bus'" in said[0]
    assert off(response(wrong), -response(right)) < ROUNDING
    true = np.einsum("pnk,na->pak", columns(made, names), matrix)
    assert off(response(right), true) < ROUNDING


# -- alignment, weights, names ---------------------------------------------------------------------
def test_sensors_are_turned_into_the_axes_of_a_body(made):
    """As the same sensors whose sites lie along the axes of the body."""
    at = "turned"
    pairs = {"gyro": "gyro_askew", "acc": "acc_askew", "vel": "vel_askew", "mag": "mag_askew"}
    inputs = ["torque:bus", "force:bus"]
    straight = bc.plant(made, inputs, [*pairs, "attitude"], at)
    outputs = {name: bc.align(sensor, "bus") for name, sensor in pairs.items()}
    turned_back = bc.plant(made, inputs, {**outputs, "attitude": bc.align("star")}, at)
    assert turned_back.output_names == straight.output_names
    assert turned_back.output_units == straight.output_units
    # there is no magnetic field: the magnetometer tells of none
    seen = [i for i, name in enumerate(straight.output_names) if not name.startswith("mag")]
    assert off(response(turned_back)[seen], response(straight)[seen]) < ROUNDING
    more = {
        "a": bc.align("inertia_axes"),
        "b": bc.align("seen"),
        "c": bc.align("world_rate", "bus"),
        "d": bc.align("world_vel", "bus"),
    }
    others = response(bc.plant(made, inputs, more, at))
    true = response(bc.plant(made, inputs, ["attitude", "gyro", "vel"], at))
    assert off(others, true[[0, 1, 2, 0, 1, 2, 3, 4, 5, 6, 7, 8]]) < ROUNDING


@pytest.mark.slow
def test_a_field_is_turned_too(boom):
    made = bc.embed(
        CRAFT.replace('gravity="0 0 0"', 'gravity="0 0 0" magnetic="0 -0.5 2e-5"'), {"mount": boom}
    )
    outputs = {"mag": bc.align("mag_askew"), "straight": "mag"}
    plant = bc.plant(made, ["torque:bus"], outputs)
    assert plant.output_units == ("T",) * 6
    found = response(plant)
    assert off(found[:3], found[3:]) < FIELD


def test_signals_are_renamed_and_added_up(made):
    plant = bc.plant(
        made,
        {"spin": {"w1": 1.0, "w2": -2.0}, "push": "t_px", "hub": "torque:bus", "w3": "w3"},
        {
            "mean": {"gyro": 0.5, "gyro_askew": 0.5},
            "angle": "drive_angle",
            "sum": {"drive_angle": 1.0, "second_angle": 2.0},
            "at": "motion:straight",
            "mixed": {"gyro": 1.0, "acc": 1.0},
        },
    )
    assert plant.input_names == ("spin", "push", "hub_x", "hub_y", "hub_z", "w3")
    assert plant.input_units == ("N m", "N", "N m", "N m", "N m", "N m")
    assert plant.output_names[:5] == ("mean_x", "mean_y", "mean_z", "angle", "sum")
    assert plant.output_names[5] == "at_displacement_x"
    assert plant.output_units[3:5] == ("rad", "rad")
    assert plant.output_units[-3:] == ("",) * 3
    plain = response(
        bc.plant(
            made,
            ["w1", "w2", "t_px", "torque:bus", "w3"],
            ["gyro", "gyro_askew", "drive_angle", "second_angle", "motion:straight", "acc"],
        )
    )
    driven = np.stack([plain[:, 0] - 2.0 * plain[:, 1], *plain[:, 2:].swapaxes(0, 1)], 1)
    true = np.vstack(
        [
            (driven[:3] + driven[3:6]) / 2.0,
            driven[6:7],
            driven[6:7] + 2.0 * driven[7:8],
            driven[8:14],
            driven[:3] + driven[14:17],
        ]
    )
    assert off(response(plant), true) < ROUNDING


def test_names_are_told_apart(made):
    inputs = {"torque:bus": "torque:bus", "torque": bc.allocate(WHEELS), "gyro": "w1"}
    plant = bc.plant(made, inputs, ["gyro"])
    assert plant.input_names[:4] == ("torque_x_bus", "torque_y_bus", "torque_z_bus", "torque_x")
    linear = bc.Linear.of(made.model, {"torque": bc.allocate(WHEELS)}, {"a": bc.align("star")})
    assert [signal.name for signal in linear.inputs.signals] == ["torque_x", "torque_y", "torque_z"]


# -- every kind of plant ---------------------------------------------------------------------------
PLAIN = (["torque:bus", "force:bus"], ["attitude", "gyro"])
DOUBLED = np.repeat([1.0, 2.0], 3)[:, None]


def test_the_exact_plant_has_the_same_signals(made):
    found = response(bc.plant(made, INPUTS, OUTPUTS).exact)
    true = response(bc.plant(made, *PLAIN).exact) * DOUBLED
    assert off(found, true) < 1e-6


@pytest.mark.slow
def test_a_sampled_plant_is_what_mujoco_runs(boom):
    """Commands of the wheels as the allocation says, held over a step."""
    made = bc.embed(CRAFT, {"mount": boom}, retime=True)
    h = 0.01
    inputs = {"torque": bc.allocate(WHEELS)}
    plant = bc.plant(made, inputs, {"attitude": bc.align("star")}, discrete=h)
    shares = ON_BUS.T @ np.linalg.inv(ON_BUS @ ON_BUS.T)
    data = mujoco.MjData(made.model)
    held = bc.HeldInput()
    numbers = [made.model.actuator(name).id for name in WHEELS]
    given = 0.05 * np.random.default_rng(3).standard_normal((3, 200))
    seen = []
    for torque in given.T:
        turn = data.body("bus").xmat.reshape(3, 3) if data.time else np.eye(3)
        seen.append([(turn - turn.T)[i, j] / 2.0 for i, j in ((2, 1), (0, 2), (1, 0))])
        data.ctrl[numbers] = held(shares @ torque)
        mujoco.mj_step(made.model, data)
        mujoco.mj_forward(made.model, data)
    states = np.zeros(plant.nstates)
    told = []
    for torque in given.T:
        told.append(plant.C @ states + plant.D @ torque)
        states = plant.A @ states + plant.B @ torque
    difference = np.abs(np.array(told) - np.array(seen)).max()
    assert difference < RUN * np.abs(seen).max()


def test_combined_plants_travel(made):
    plant = bc.plant(made, INPUTS, OUTPUTS)
    other = pickle.loads(pickle.dumps(plant))
    assert np.array_equal(response(other), response(plant))
    assert other.allocations["torque"].without_torque == plant.allocations["torque"].without_torque
    assert np.array_equal(response(other.exact), response(plant.exact))


# -- files -----------------------------------------------------------------------------------------
LOOP = """
[[loop]]
input = "torque_z"
output = "attitude_z"
numerator = [120.0, 20.0]
denominator = [0.05, 1.0]
"""
ALLOCATION = '[allocation.torque]\nactuators = ["w1", "w2", "w3"]\naxes = "bus"\n'
ALIGNMENT = '[alignment.attitude]\nsensor = "star"\n'


@pytest.fixture(scope="module")
def place(made, tmp_path_factory):
    out = tmp_path_factory.mktemp("combined")
    made.write(out / "flexible.xml")
    return out


def asked(place, capsys, monkeypatch, *words, loops=ALLOCATION + ALIGNMENT + LOOP):
    (place / "loops.toml").write_text(loops)
    monkeypatch.chdir(place)
    common = ["plant", "flexible.xml", "--controller", "loops.toml", "-o", "p.npz"]
    return run([*common, "--force", "--json", *words], capsys, monkeypatch)


def names(out, kind):
    return [row["name"] for row in json.loads(out)[kind]]


@pytest.mark.slow
def test_tables_of_a_controller_make_its_signals(place, capsys, monkeypatch):
    # one table alone leaves the others as they are
    code, out, _ = asked(place, capsys, monkeypatch, loops=ALLOCATION + LOOP)
    assert code == 0
    assert names(out, "inputs") == ["torque_x", "torque_y", "torque_z"]
    assert names(out, "outputs") == [f"{n}_{a}" for n in ("attitude", "rate") for a in "xyz"]
    words = ["--from", "torque:bus", "--from", "w4", "--to", "gyro"]
    code, out, _ = asked(place, capsys, monkeypatch, *words)
    assert code == 0
    assert names(out, "inputs") == [
        *(f"torque_{axis}_bus" for axis in "xyz"),
        "w4",
        *(f"torque_{axis}" for axis in "xyz"),
    ]
    assert names(out, "outputs")[:4] == ["gyro_x", "gyro_y", "gyro_z", "attitude_x"]


@pytest.mark.parametrize(
    ("loops", "words", "sentence"),
    [
        (
            ALLOCATION.replace("torque]", "w4]") + LOOP,
            ["--from", "w4"],
            "[allocation.w4] of the controller",
        ),
        (
            ALIGNMENT.replace('"star"', '"drive_angle"') + LOOP,
            [],
            "'drive_angle' has no three axes",
        ),
        (ALLOCATION.replace("axes", "axis") + LOOP, [], "unknown key 'axis'"),
        (ALLOCATION + "matrix = [[1.0]]\n" + LOOP, [], "matrix of an allocation"),
        (
            ALLOCATION.replace('"w1", ', "") + LOOP,
            [],
            "2 of 3 directions, and not about x alone",
        ),
        (ALLOCATION.replace('["w1", "w2", "w3"]', "[]") + LOOP, [], "is empty"),
        ("[alignment.a]\nbody = 'bus'\n" + LOOP, [], "sensor is missing"),
    ],
)
def test_mistakes_in_tables_are_named(place, capsys, monkeypatch, loops, words, sentence):
    code, _, error = asked(place, capsys, monkeypatch, *words, loops=loops)
    assert code == 2
    assert sentence in error
