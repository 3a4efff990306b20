"""Sensors of an appendage: amplitude of its modes, place of a point, load at its root,
in the written file."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from appendages import close, tip_loaded_boom
from arrays import tube
from spec_tables import spec_of, table_of

ACCELERATION = 1e-4  # m/s^2 across the appendage: linear motion
MODES = 3
POINTS = {"middle": 4.0}


def sensing(beam, name="boom", **tables):
    """The specification of a beam with sensors; `tables` beside its own."""
    return spec_of({"name": name, **table_of(beam), **tables})


def held(beam, **sensors):
    """Three modes in both planes on a hub that nothing moves."""
    return sensing(
        beam,
        port=[{"name": name, "x": x} for name, x in POINTS.items()],
        modes={"xy": MODES, "xz": MODES},
        sensors=sensors,
        root={"hub": {"mass": 1e9, "inertia": [1e9, 1e9, 1e9]}},
    )


def settled(result, gravity):
    """Data of the held chain in a uniform field, at rest:
    from the equilibrium of its linear motion."""
    model = mujoco.MjModel.from_xml_string(result.to_mjcf())
    model.opt.gravity[:] = gravity
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    stiffness = np.zeros((model.nv, model.nv))
    for i in range(model.nv):
        data.qpos[:] = 0.0
        data.qpos[i] = 1e-6
        mujoco.mj_forward(model, data)
        stiffness[:, i] = -data.qfrc_passive / 1e-6
    data.qpos[:] = 0.0
    for _ in range(5):
        mujoco.mj_forward(model, data)
        data.qpos[:] += np.linalg.solve(stiffness, data.qfrc_passive - data.qfrc_bias)
    mujoco.mj_forward(model, data)
    assert np.max(np.abs(data.qacc)) < 1e-6 * ACCELERATION
    return model, data


@pytest.fixture(scope="module")
def leaning():
    result = bc.fit(held(tube(), modes=True, points=list(POINTS), root_load=True))
    return result, *settled(result, (0.0, -ACCELERATION, 0.0))


@pytest.mark.slow
def test_amplitudes_are_the_modal_coordinates(leaning):
    """Phi'' + w^2 Phi = -L a at rest: amplitude -L a / w^2, with L and w of the beam itself."""
    _, _, data = leaning
    beam = tube().port("xy", 12)
    for i in range(MODES):
        wanted = beam.participation[i, 0] * ACCELERATION / beam.frequencies[i] ** 2
        assert abs(data.sensor(f"boom_mode{i + 1}_xy_amplitude").data[0]) == close(
            abs(wanted), rel=1e-5
        )
        assert data.sensor(f"boom_mode{i + 1}_xz_amplitude").data[0] == close(
            0.0, abs=1e-6 * abs(wanted)
        )


def test_rates_are_those_of_the_amplitudes(leaning):
    _, model, _ = leaning
    data = mujoco.MjData(model)
    data.qvel[:] = np.linspace(0.1, 0.2, model.nv)
    mujoco.mj_forward(model, data)
    names = [f"boom_mode{k + 1}_xy" for k in range(MODES)]
    before = [float(data.sensor(f"{name}_amplitude").data[0]) for name in names]
    rates = [float(data.sensor(f"{name}_rate").data[0]) for name in names]
    mujoco.mj_integratePos(model, data.qpos, data.qvel, 1e-3)
    mujoco.mj_forward(model, data)
    for name, rate, start in zip(names, rates, before, strict=True):
        assert (data.sensor(f"{name}_amplitude").data[0] - start) / 1e-3 == close(rate, rel=1e-9)


def test_deflection_is_the_beam_s(leaning):
    """Static deflection under a uniform field, from statics alone:
    what the attachment modes are for."""
    _, _, data = leaning
    beam = tube()
    load = 2700.0 * np.pi / 4.0 * (0.05**2 - 0.046**2) * ACCELERATION
    stiffness = 7e10 * np.pi / 64.0 * (0.05**4 - 0.046**4)
    for point, x in POINTS.items():
        wanted = (
            load * x**2 * (6.0 * beam.length**2 - 4.0 * beam.length * x + x**2) / (24.0 * stiffness)
        )
        place = data.sensor(f"boom_{point}_place").data
        assert place[1] == close(-wanted, rel=1e-3)
        assert place[0] == close(x, rel=1e-9)
        turn = data.sensor(f"boom_{point}_turn").data
        slope = load * x * (3.0 * beam.length**2 - 3.0 * beam.length * x + x**2) / (6.0 * stiffness)
        assert 2.0 * turn[3] == close(-slope, rel=5e-3)


def test_root_load_is_the_weight(leaning):
    """What carries the appendage holds up its weight and the moment of it."""
    _, _, data = leaning
    mass = tube().rigid_mass()
    force = data.sensor("boom_root_force").data
    moment = data.sensor("boom_root_moment").data
    assert abs(force[1]) == close(mass[0, 0] * ACCELERATION, rel=1e-9)
    assert abs(moment[2]) == close(mass[0, 0] * ACCELERATION * tube().length / 2.0, rel=1e-6)
    assert np.sign(force[1]) == np.sign(moment[2])
    assert np.max(np.abs(force[[0, 2]])) < 1e-6 * abs(force[1])


def test_nothing_is_written_without_being_asked():
    assert "<sensor" not in bc.fit(tube(), modes={"xy": 1, "xz": 0}).to_mjcf()


@pytest.mark.slow
def test_sensors_travel_into_a_spacecraft(tmp_path):
    spec = sensing(
        tube(),
        "array",
        modes={"xy": 2, "xz": 0},
        sensors={"modes": True, "root_load": True},
    )
    craft = tmp_path / "craft.xml"
    craft.write_text(
        '<mujoco model="bus"><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>'
        '<inertial pos="0 0 0" mass="800" diaginertia="500 500 600"/><site name="mount" pos="1 0 '
        '0"/></body>'
        "</worldbody></mujoco>"
    )
    embedded = bc.embed(craft, {"mount": spec})
    model = mujoco.MjModel.from_xml_string(embedded.to_mjcf())
    names = [model.sensor(i).name for i in range(model.nsensor)]
    assert len(names) == 2 * 2 + 2
    assert all("array" in name for name in names)


def test_asking_for_amplitudes_gives_each_mode_a_tendon():
    spec = sensing(tube(), modes={"xy": 2}, sensors={"modes": True})
    model = mujoco.MjModel.from_xml_string(bc.fit(spec).to_mjcf())
    assert [model.sensor(i).name for i in range(model.nsensor)] == [
        "boom_mode1_xy_amplitude",
        "boom_mode1_xy_rate",
        "boom_mode2_xy_amplitude",
        "boom_mode2_xy_rate",
    ]


def test_amplitudes_are_read_where_fewer_modes_are_kept():
    """A tip this heavy costs a chosen cut its digits with 8 modes;
    the 7 that the recursion holds keep their tendons."""
    beam = tip_loaded_boom(1e7)
    spec = sensing(beam, modes={"xy": 8}, sensors={"modes": True})
    result = bc.fit(spec)
    assert "xy keeps 7 of the 8 modes asked for" in result.status.message
    assert [tendon.label for tendon in result.chain.tendons] == [f"mode{k}_xy" for k in range(1, 8)]
    model = mujoco.MjModel.from_xml_string(result.to_mjcf())
    names = {model.sensor(i).name for i in range(model.nsensor)}
    assert {f"boom_mode{k}_xy_amplitude" for k in range(1, 8)} < names
