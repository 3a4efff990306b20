"""The modes of an appendage found by MuJoCo's own system identification, from a log of plain MuJoCo
whose file has other frequencies and damping than the craft that is given to it."""

import mujoco
import numpy as np
import pytest
from lxml import etree

import beamchain as bc
from beamchain import identification

sysid = pytest.importorskip("mujoco.sysid")
if not hasattr(sysid, "ParameterDict"):  # what it needs is not installed
    pytest.skip("pip install 'beamchain[sysid]'", allow_module_level=True)

OFF = {"xy": (1.06, 1.4), "xz": (0.95, 0.7)}  # factors on frequency and damping of the truth
FREQUENCY, DAMPING = 1e-3, 1e-2  # relative, of what is found
NOISE = 1e-6  # rad/s
STEP, SAMPLES = 0.01, 4000
CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.01" integrator="RK4"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 80 70"/>
<site name="mount" pos="0.6 0 0"/><site name="imu"/></body></worldbody>
<actuator><motor name="y" site="imu" gear="0 0 0 0 1 0"/>
<motor name="z" site="imu" gear="0 0 0 0 0 1"/></actuator>
<sensor><gyro name="gyro" site="imu"/></sensor></mujoco>"""
SECTION = bc.Equivalent(bending_stiffness_xy=600.0, bending_stiffness_xz=900.0, linear_mass=1.5)


def spec(form="modal"):
    return bc.Spec(
        segment=(bc.Segment(length=8.0, section=SECTION),),
        damping=bc.Damping(ratio=0.01, form=form),
        modes=bc.Modes(xy=1, xz=1),
    )


@pytest.fixture(scope="module")
def craft():
    return bc.embed(CRAFT, {"mount": spec()})


def truth(craft):
    """The craft's file with other springs and dampers, and what they are."""
    root = etree.fromstring(craft.to_mjcf().encode())
    wanted = {}
    for tendon in root.iter("fixed"):
        name = tendon.get("name")
        faster, damped = OFF[name.rpartition("_")[2]]
        w = float(tendon.get("stiffness")) ** 0.5
        ratio = float(tendon.get("damping")) / (2.0 * w)
        w, ratio = faster * w, damped * ratio
        tendon.set("stiffness", repr(w**2))
        tendon.set("damping", repr(2.0 * ratio * w))
        wanted |= {f"{name}.frequency": w, f"{name}.damping": ratio}
    return mujoco.MjModel.from_xml_string(etree.tostring(root).decode()), wanted


def flight(model):
    """Times, torques and rates of a run."""
    rng = np.random.default_rng(3)
    torque = np.repeat(rng.choice([-1.0, 1.0], (SAMPLES // 250 + 1, 2)), 250, axis=0)[:SAMPLES]
    data, rates = mujoco.MjData(model), []
    for now in torque:
        data.ctrl[:] = now
        mujoco.mj_step(model, data)  # which reads its sensors before it moves
        rates.append(data.sensor("gyro").data.copy())
    return STEP * np.arange(SAMPLES), torque, rates + NOISE * rng.standard_normal((SAMPLES, 3))


def test_mujoco_finds_the_modes_of_another_craft(craft):
    model, wanted = truth(craft)
    time, torque, rates = flight(model)
    parameters = identification.to_sysid(craft)
    assert set(parameters.keys()) == set(wanted)
    for name, value in wanted.items():
        low, high = parameters[name].get_bounds()
        assert low < value < high
    mjcf = mujoco.MjSpec.from_string(craft.to_mjcf())
    log = sysid.ModelSequences(
        "craft",
        mjcf,
        "flight",
        sysid.create_initial_state(model, model.qpos0),
        sysid.TimeSeries.from_control_names(time, torque, model),
        sysid.TimeSeries.from_names(time + STEP, rates, model, ["gyro"]),
    )
    found, _ = sysid.optimize(
        parameters, sysid.build_residual_fn(models_sequences=[log]), verbose=False
    )
    for name, value in wanted.items():
        limit = FREQUENCY if name.endswith("frequency") else DAMPING
        assert found[name].value[0] == pytest.approx(value, rel=limit), name


def test_a_modifier_leaves_the_other_number_of_its_mode(craft):
    mjcf = mujoco.MjSpec.from_string(craft.to_mjcf())
    parameters = identification.to_sysid(craft, frequency=0.1, damping=0.5)
    name, w = "appendage_mode1_xy", parameters["appendage_mode1_xy.frequency"].nominal[0]
    assert parameters[f"{name}.frequency"].get_bounds() == (
        pytest.approx(0.9 * w),
        pytest.approx(1.1 * w),
    )
    parameters[f"{name}.frequency"].update_from_vector([1.05 * w])
    parameters[f"{name}.damping"].update_from_vector([0.013])
    for _ in range(2):  # each time that a model is compiled
        model = sysid.apply_param_modifiers(parameters, mjcf)
        made = model.tendon(name).id
        assert model.tendon_stiffness[made] == pytest.approx((1.05 * w) ** 2, rel=1e-12)
        assert model.tendon_damping[made] == pytest.approx(2.0 * 0.013 * 1.05 * w, rel=1e-12)


@pytest.mark.parametrize(
    ("given", "words"), [("hinges", "no modal tendons"), ("retime", "embed without retime")]
)
def test_springs_that_are_no_parameters_are_refused(given, words):
    bare = CRAFT.replace("RK4", "implicitfast")
    form = "hinge" if given == "hinges" else "modal"
    craft = bc.embed(bare, {"mount": spec(form)}, retime=given == "retime")
    with pytest.raises(bc.InputError, match=words):
        identification.to_sysid(craft)
