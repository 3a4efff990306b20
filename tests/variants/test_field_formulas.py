"""Closed forms beside fields of worlds (internals of `variants.fields`): two masses on springs that
Euler steps, of which each world's poles are known."""

import copy
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.engine.model_fields import DrawnFields, with_fields
from beamchain.steps.modal import TimingMark
from beamchain.variants import fields
from beamchain.variants.fields import Modes, Table, runs_exact, source_of
from formulas import DrawTiming

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


def timed(model, step):
    out = copy.copy(model)
    out.opt.timestep = step
    bc.retime(out, step)
    return out


def test_draws_of_modes_are_exact_in_time_with_their_own_numbers(model):
    made = Modes(timed(model, STEP), RANGES)
    factors = 1.0 + np.array([0.1, 0.4])[:, None] * KEYS
    wanted = W * factors[:, 0], DAMPING * factors[:, 0] * factors[:, 1]
    plain = Modes(model, RANGES).fields(KEYS)
    np.testing.assert_allclose(plain["tendon_stiffness"][:, MODES], wanted[0] ** 2)
    np.testing.assert_allclose(plain["tendon_damping"][:, MODES], wanted[1])
    assert not plain["tendon_armature"].any()
    for step in (STEP, 0.02):
        check_exact(made.at(timed(model, step)).fields(KEYS), wanted[0] ** 2, wanted[1], step)
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
    slower = made.at(timed(model, 0.02)).fields(np.array([[0], [1]]))
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


def test_variants_that_are_exact_already_are_taken_as_they_are(model):
    rows = {"tendon_stiffness": np.array([[9.0, 0.0, 400.0], [12.0, 0.0, 300.0]])}
    both = np.array([[0], [1]])
    timed = Table(model, rows, STEP, None, {}).fields(both)
    own = timed | {"tendon_armature": timed["tendon_armature"] + 0.01}
    found = Table(model, own, STEP, None, {}).fields(both)
    np.testing.assert_array_equal(found["tendon_armature"], own["tendon_armature"])
    # marked in the model alone
    marked = with_fields(model, {name: values[0] for name, values in timed.items()})
    given = {"tendon_armature": own["tendon_armature"]}
    found = Table(marked, given, STEP, None, {}).fields(both)
    np.testing.assert_array_equal(found["tendon_armature"], own["tendon_armature"])
    # for another step they are made anew
    again = Table(model, timed, 0.02, None, {}).fields(both)
    check_exact(again, rows["tendon_stiffness"][:, MODES], np.array([DAMPING] * 2), 0.02)


def test_a_table_of_one_variant(model):
    made = source_of(model, model, {"body_mass": np.array([[0.0, 3.0, 4.0]])}, None)
    found = made.fields(made.keys(2, np.random.default_rng(0)))
    np.testing.assert_allclose(found["dof_M0"], [[3.0, 4.0]] * 2)
    fields = ("body_mass", "body_subtreemass", "body_invweight0", "dof_invweight0", "dof_M0")
    sizes = {name: found[name][0].nbytes for name in found}
    assert set(fields) <= set(sizes)
    assert made.nbytes == sum(sizes.values())


def test_tendons_of_a_tree_s_draws_are_marked_with_how_much_stiffer_they_are(model):
    """Of three, the last and the first are modes."""
    fields = DrawnFields(model, 2)
    plain = {
        "tendon_stiffness": np.array([[80.0, 7.0, 50.0], [90.0, 7.0, 40.0]]),
        "tendon_damping": np.array([[0.3, 0.7, 0.5], [0.2, 0.7, 0.4]]),
        "tendon_armature": np.array([[0.1, 0.2, 0.3]] * 2),
        "tendon_solimp_lim": np.full((2, 3, mujoco.mjNIMP), 0.9),
    }
    fields.update({name: values.copy() for name, values in plain.items()})
    modes = [2, 0]
    wanted = SimpleNamespace(
        armature=np.array([[0.01, 0.02], [0.03, 0.04]]),
        stiffness=np.array([[51.0, 78.0], [39.0, 94.0]]),
        damping=np.array([[0.6, 0.31], [0.41, 0.19]]),
    )

    def drawn(stiffness, damping, participation):
        assert stiffness.tolist() == [[50.0, 80.0], [40.0, 90.0]]
        assert damping.tolist() == [[0.5, 0.3], [0.4, 0.2]]
        assert participation.tolist() == [[1.0, 1.0]] * 2
        return wanted

    modal = SimpleNamespace(index=np.array(modes))
    mark = TimingMark(STEP, "implicitfast", 5)
    DrawTiming(mark, modal, None, SimpleNamespace(drawn=drawn)).write(fields)
    np.testing.assert_allclose(fields["tendon_armature"], [[0.12, 0.2, 0.31], [0.14, 0.2, 0.33]])
    np.testing.assert_allclose(fields["tendon_stiffness"], [[78.0, 7.0, 51.0], [94.0, 7.0, 39.0]])
    np.testing.assert_allclose(fields["tendon_damping"], [[0.31, 0.7, 0.6], [0.19, 0.7, 0.41]])
    marks = fields["tendon_solimp_lim"]
    assert marks[:, 1].tolist() == [[0.9] * mujoco.mjNIMP] * 2
    number = float(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    for world, k in np.ndindex(2, 2):
        at = world, modes[k]
        stiffer = 5.0 + wanted.stiffness[world, k] / plain["tendon_stiffness"][at] - 1.0
        old = plain["tendon_damping"][at], plain["tendon_stiffness"][at]
        np.testing.assert_allclose(marks[at], [STEP, number, stiffer, *old], rtol=1e-12)


TREE = """<mujoco><option gravity="0 0 0"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="1e8" diaginertia="1e8 1e8 1e8"/>
<body name="arm_link2"><joint name="h" axis="0 0 1"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.3 0.3 0.25"/>
<body name="load" pos="0.4 0 0"><inertial pos="0 0 0" mass="0.5" diaginertia="0.02 0.02 0.03"/>
</body></body></body></worldbody>
<tendon><fixed name="arm_mode1_xy" stiffness="9" damping="0.1"><joint joint="h" coef="0.5"/></fixed>
</tendon></mujoco>"""


def test_variants_that_carry_bodies_are_timed_one_by_one_as_a_tree(monkeypatch):
    """0.25 of the arm over 0.5^2 of a tendon is a mass of 1, and with its load of more."""
    asked = []

    def retime_by(form, model, *given, **named):
        asked.append((given, named, float(np.ravel(model.tendon_stiffness.T)[0])))
        return retimed(form, model, *given, **named)

    retimed = fields.retime_by
    monkeypatch.setattr(fields, "retime_by", retime_by)
    model = mujoco.MjModel.from_xml_string(TREE)
    stiffness = np.array([[9.0], [12.0]])
    found = Table(model, {"tendon_stiffness": stiffness}, STEP, 7.0, {})
    assert asked == [((STEP,), {"band": 7.0}, value) for value in (9.0, 12.0)]
    marks = found.fields(np.array([[1], [0]]))["tendon_solimp_lim"][:, 0]
    assert np.round(marks[:, 2]).tolist() == [5.0, 5.0]
    assert marks[:, 4].tolist() == [12.0, 9.0]


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
    assert source_of(model, model, None, STEP) is None
    assert isinstance(source_of(model, model, {"damping": 0.1}, STEP), Modes)
    assert isinstance(source_of(model, model, {"body_mass": np.ones((2, 3))}, None), Table)
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
            source_of(model, model, given, None)
    assert (
        source_of(model, model, {"frequency": 0.0}, None).drawn(KEYS)["frequency"].tolist()
        == [[1.0, 1.0]] * 2
    )
    # what no range is given of stays
    drawn = source_of(model, model, {"damping": 0.4}, None).drawn(KEYS)
    assert drawn["frequency"].tolist() == [[1.0, 1.0]] * 2
    np.testing.assert_allclose(drawn["damping"], 1.0 + 0.4 * KEYS[:, 1])
