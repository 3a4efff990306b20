"""Closed forms beside fields of worlds (internals of `variants.fields`): two masses on springs that
Euler steps, of which each world's poles are known."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.variants.fields import Modes, Table, runs_exact, source_of, with_fields

STEP = 0.05
CRAFT = """<mujoco><option gravity="0 0 0"/><worldbody>
<body name="one"><joint name="a" type="slide"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
<body name="two"><joint name="b" type="slide"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
<tendon><fixed name="x_mode1_xy" stiffness="9" damping="0.3"><joint joint="a" coef="1"/></fixed>
<fixed name="rope"><joint joint="a" coef="1"/></fixed>
<fixed name="x_mode2_xy" stiffness="400" damping="0.8"><joint joint="b" coef="1"/></fixed></tendon>
<actuator><motor joint="a"/></actuator></mujoco>"""
MODES = [0, 2]
W, DAMPING = np.array([3.0, 20.0]), np.array([0.3, 0.8])
KEYS = np.array([[[1.0, -0.5], [-1.0, 0.4]], [[0.2, 0.3], [0.0, 1.0]]])
RANGES = {"frequency": 0.1, "damping": 0.4}


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_string(CRAFT)


def check_exact(fields, stiffness, damping, step=STEP):
    """v' = v - h (k x + c v)/m, x' = x + h v', m = 1 + armature: the pole is exp(s h) of
    s^2 + c s + k, and what is not timed is kept beside it."""
    for world, tendon in np.ndindex(2, 2):
        at = world, MODES[tendon]
        k, c = stiffness[world, tendon], damping[world, tendon]
        inside = fields["tendon_stiffness"][at], fields["tendon_damping"][at]
        slope = step * np.array(inside) / (1.0 + fields["tendon_armature"][at])
        rate = np.array([-slope[0], 1.0 - slope[1]])
        poles = np.linalg.eigvals([[1.0 + step * rate[0], step * rate[1]], rate])
        s = -c / 2.0 + 1j * np.sqrt(k - c**2 / 4.0)
        assert np.abs(poles - np.exp(s * step)).min() < 1e-12
        euler = int(mujoco.mjtIntegrator.mjINT_EULER)
        wanted = [step, euler, 2.0, c, k]  # made for, the form, and what it was
        np.testing.assert_allclose(fields["tendon_solimp_lim"][at], wanted, rtol=1e-12)


def test_draws_of_modes_are_exact_in_time_with_their_own_numbers(model):
    made = Modes(model, RANGES, STEP, None)
    factors = 1.0 + np.array([0.1, 0.4])[:, None] * KEYS
    wanted = W * factors[:, 0], DAMPING * factors[:, 0] * factors[:, 1]
    plain = Modes(model, RANGES, None, None).fields(KEYS)
    np.testing.assert_allclose(plain["tendon_stiffness"][:, MODES], wanted[0] ** 2)
    np.testing.assert_allclose(plain["tendon_damping"][:, MODES], wanted[1])
    assert not plain["tendon_armature"].any()
    for step in (STEP, 0.02):
        check_exact(made.at(step).fields(KEYS), wanted[0] ** 2, wanted[1], step)
    for name, of in zip(("frequency", "damping"), (0, 1), strict=True):
        np.testing.assert_allclose(made.drawn(KEYS)[name], factors[:, of])
    keys = made.keys(500, np.random.default_rng(0))
    assert keys.shape == (500, 2, 2)
    assert (keys.min(), keys.max()) == pytest.approx((-1.0, 1.0), abs=0.01)
    assert made.nbytes == 3 * (3 + mujoco.mjNIMP) * 8


def test_variants_of_tendons_are_exact_in_time(model):
    rows = {
        "tendon_stiffness": np.array([[9.0, 0.0, 400.0], [12.0, 0.0, 300.0]]),
        "tendon_damping": np.array([[0.3, 0.0, 0.8], [0.1, 0.0, 2.0]]),
    }
    made = Table(model, rows, STEP, None, {"drawn": np.array([5.0, 6.0])})
    worlds = made.fields(np.array([[0], [1]]))
    check_exact(worlds, *(values[:, MODES] for values in rows.values()))
    again = Table(model, worlds, STEP, None, {}).fields(np.array([[0], [1]]))
    for name, values in worlds.items():  # they are exact already
        np.testing.assert_array_equal(again[name], values)
    slower = made.at(0.02).fields(np.array([[0], [1]]))
    check_exact(slower, *(values[:, MODES] for values in rows.values()), 0.02)
    assert made.size == 2
    assert made.nbytes == 3 * (3 + mujoco.mjNIMP) * 8
    assert made.keys(5, np.random.default_rng(0), first=True).tolist() == [[0], [1], [0], [1], [0]]
    drawn = made.keys(400, np.random.default_rng(0))
    assert drawn.shape == (400, 1)
    assert 150 < drawn.sum() < 250
    told = made.drawn(np.array([[1], [0], [1]]))
    assert {name: list(values) for name, values in told.items()} == {
        "row": [1, 0, 1],
        "drawn": [6.0, 5.0, 6.0],
    }
    assert not runs_exact(model)
    assert runs_exact(with_fields(model, {name: values[0] for name, values in worlds.items()}))


def test_what_follows_from_the_masses_of_variants(model):
    """An acceleration per force is one over a mass, of a motor too."""
    masses = np.array([[0.0, 1.0, 2.0], [0.0, 3.0, 4.0]])
    found = Table(model, {"body_mass": masses}, None, None, {}).fields(np.array([[1], [0]]))
    np.testing.assert_allclose(found["body_subtreemass"], [[7.0, 3.0, 4.0], [3.0, 1.0, 2.0]])
    np.testing.assert_allclose(found["dof_invweight0"], 1.0 / masses[::-1, 1:])
    np.testing.assert_allclose(found["dof_M0"], masses[::-1, 1:])
    np.testing.assert_allclose(found["tendon_invweight0"], 1.0 / masses[::-1, [1, 1, 2]])
    np.testing.assert_allclose(found["actuator_acc0"], 1.0 / masses[::-1, 1:2])
    assert "tendon_length0" not in found  # as it was in the model
    assert model.body_mass.tolist() == [0.0, 1.0, 1.0]


def test_what_variants_mean(model):
    assert source_of(model, None, STEP) is None
    assert isinstance(source_of(model, {"damping": 0.1}, STEP), Modes)
    assert isinstance(source_of(model, {"body_mass": np.ones((2, 3))}, None), Table)
    for given, words in (
        ({}, "not understood"),
        ({"frequency": 0.1, "body_mass": np.ones((2, 3))}, "variants mix 'frequency'"),
        ({"frequency": 1.0}, "below 1"),
        ({"frequency": -0.1}, "below 1"),
        ({"body_mass": np.ones((2, 4))}, r"shape \(2, 4\)"),
        ({"body_mass": np.ones((0, 3))}, r"shape \(0, 3\)"),
        ({"body_mass": np.full((2, 3), np.nan)}, "finite"),
        ({"body_parentid": np.ones((2, 3), dtype=int)}, "how the model is connected"),
    ):
        with pytest.raises(bc.InputError, match=words):
            source_of(model, given, None)
    assert (
        source_of(model, {"frequency": 0.0}, None).drawn(KEYS)["frequency"].tolist()
        == [[1.0, 1.0]] * 2
    )
