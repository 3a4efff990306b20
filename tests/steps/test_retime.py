"""Craft made exact in time: poles through MuJoCo, samples against the exact motion, stability,
and the way back."""

import re

import mujoco
import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

import beamchain as bc
import finite_elements as fe
import solver
from beamchain.steps.retime import retime_by
from command import call
from mechanics import (
    INTEGRATORS,
    first,
    made_for,
    mass_matrix,
    modal_tendons,
    step_matrix,
    tendon_rows,
)
from modal_crafts import body_text, chain_of, craft, modes_of

BOOM = [("seed", 3, 0.0)]
PAIR = [("light", 2, 0.0), ("heavy", 2, np.pi)]
THREE = [("light", 2, 0.0), ("heavy", 2, 2.0), ("seed", 3, 4.0)]
#: what a retiming may change; after all of them MuJoCo needs no `mj_setConst`
ARRAYS = {
    "tendon_armature",
    "tendon_damping",
    "tendon_solimp_lim",
}


def arrays(model):
    return {
        name: np.array(getattr(model, name))
        for name in dir(model)
        if not name.startswith("_") and isinstance(getattr(model, name), np.ndarray)
    }


def same(before, after):
    return [name for name, values in before.items() if values.tobytes() != after[name].tobytes()]


def pole_errors(made, model):
    """Relative error of the craft's poles below the phase limit, wanted ones from numpy,
    achieved ones from MuJoCo."""
    h = model.opt.timestep
    wanted = made.poles()
    z = np.linalg.eigvals(step_matrix(model))
    s = np.log(z[(np.abs(z - 1) > 1e-5) & (z.imag > 0)]) / h
    wanted = wanted[np.abs(wanted) * h < 2.6]
    s = s[linear_sum_assignment(np.abs(s[None, :] - wanted[:, None]) / np.abs(wanted)[:, None])[1]]
    return np.abs(s - wanted) / np.abs(wanted)


def largest_growth(model):
    z = np.linalg.eigvals(step_matrix(model))
    return np.max(np.abs(z[np.abs(z - 1) > 1e-4]), initial=0.0)


def test_the_hand_made_craft_is_what_mujoco_makes_of_it():
    made = craft(THREE, 100.0, 40.0, ratio=0.01)
    model = made.model(0.01)
    assert np.allclose(mass_matrix(model), made.mass, rtol=1e-12, atol=1e-12)
    assert len(modal_tendons(model)) == model.ntendon == 7
    rows = tendon_rows(model)
    spans = [tuple(row != 0.0) for row in rows]
    assert [spans.count(span) for span in dict.fromkeys(spans)] == [2, 2, 3]
    assert np.allclose(
        rows.T @ np.diag(first(model.tendon_stiffness)) @ rows,
        made.stiffness,
        rtol=1e-12,
        atol=1e-12,
    )


@pytest.mark.parametrize("ratio", [0.0, 0.001, 0.005, 0.02, 0.1])
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_form_4_places_every_pole_of_one_appendage(ratio, integrator):
    made = craft(BOOM, 500.0, 500.0, ratio=ratio)
    fastest = made.frequencies()[-1]
    for x in (0.3, 1.0, 2.1, 2.5):
        model = made.model(x / fastest, integrator)
        done = retime_by(4, model, model.opt.timestep)
        errors = pole_errors(made, model)
        clamped = np.array([mode.clamped for mode in done.modes])
        assert not np.any([mode.slowed for mode in done.modes])
        if integrator == "Euler":
            assert not np.any(clamped)
        # the latter where implicitfast cannot have a mode exactly
        assert np.max(errors) < (1e-9 if not np.any(clamped) else 5 * ratio**2)


#: worst relative pole error of all three modes of the 13 kg boom, fastest coupled mode at x = 1
FORM_2 = {1e4: 2e-6, 500.0: 4e-5, 50.0: 4e-4, 5.0: 1.5e-3}


@pytest.mark.parametrize("hub", FORM_2)
def test_form_2_is_fourth_order_and_the_better_the_heavier_the_hub(hub):
    made = craft(BOOM, hub, hub)
    errors = []
    for x in (1.0, 0.5):
        h = x / made.frequencies()[-1]
        model = made.model(h)
        plain = np.max(pole_errors(made, model))
        bc.retime(model, h)
        errors.append(np.max(pole_errors(made, model)))
        assert errors[-1] < plain / 15
    assert errors[0] < FORM_2[hub]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.15)
    model = made.model(h)
    retime_by(4, model, h)
    assert np.max(pole_errors(made, model)) < 1e-10


#: worst relative pole error of two appendages (4 and 36 kg, two modes each) per x of the fastest:
#: form 2
TWO = {
    1000.0: {0.5: 1.1e-5, 1.0: 1.8e-4, 2.0: 3.7e-3},
    100.0: {0.5: 8.5e-5, 1.0: 1.4e-3, 2.0: 3e-2},
    10.0: {0.5: 1.2e-4, 1.0: 2e-3, 2.0: 4.3e-2},
}


@pytest.mark.parametrize("hub", TWO)
def test_form_2_of_several_appendages(hub):
    made = craft(PAIR, hub, hub)
    for x, bound in TWO[hub].items():
        h = x / made.frequencies()[-1]
        model = made.model(h)
        bc.retime(model, h)
        assert np.max(pole_errors(made, model)) < bound
        rows = tendon_rows(model)
        stiffness = rows.T @ np.diag(model.tendon_stiffness) @ rows
        assert np.allclose(stiffness, made.stiffness, rtol=1e-11, atol=1e-9)


def test_damping_of_several_appendages():
    """Form 2 keeps it, form 4 is exact."""
    made = craft(THREE, 1000.0, 1000.0, ratio=0.005)
    h = 1.0 / made.frequencies()[-1]
    for form, bound in ((2, 6e-5), (4, 1e-8)):
        model = made.model(h)
        retime_by(form, model, h)
        errors = pole_errors(made, model)
        assert len(errors) == 7
        assert np.max(errors) < bound


@pytest.mark.parametrize(("hub", "ratio"), [(1000.0, 0.005), (10.0, 0.0), (10.0, 0.1)])
@pytest.mark.parametrize("parts", [PAIR, THREE], ids=["two", "three"])
def test_form_4_places_every_pole_of_any_craft(parts, hub, ratio):
    made = craft(parts, hub, hub, ratio=ratio)
    for x in (0.1, 1.0):
        h = x / made.frequencies()[-1]
        model = made.model(h)
        retime_by(4, model, h)
        assert np.max(pole_errors(made, model)) < 1e-9
        assert largest_growth(model) < 1 + 1e-9
        assert np.array_equal(model.tendon_stiffness, made.model(h).tendon_stiffness)
        assert np.array_equal(model.wrap_prm, made.model(h).wrap_prm)


def test_form_4_of_twins_is_no_worse_than_form_2():
    made = craft([("light", 2, 0.0), ("light", 2, np.pi)], 100.0, 100.0)
    h = 1.0 / made.frequencies()[-1]
    errors = {}
    for form in (2, 4):
        model = made.model(h)
        retime_by(form, model, h)
        errors[form] = np.max(pole_errors(made, model))
    assert errors[4] < 0.6 * errors[2]
    assert errors[4] < 2e-4


#: largest error of a sample and of a mean rate over the largest of them, one appendage in form 4:
#: its poles are exact, the shares of the modes off in fourth order of the step
SAMPLES = {0.15: (3e-9, 3e-8), 0.3: (3e-8, 6e-7), 1.0: (3e-6, 7e-5), 2.3: (2e-5, 7e-4)}


@pytest.mark.parametrize("x", SAMPLES)
def test_samples_with_the_averaged_input(x):
    made = craft(BOOM, 500.0, 500.0)
    h = x / made.frequencies()[-1]
    model = made.model(h)
    retime_by(4, model, h)
    data = mujoco.MjData(model)
    a, b = made.stepper(h)
    rng = np.random.default_rng(1)
    state = np.zeros(12)
    held = bc.HeldInput()
    off = np.zeros(2)
    size = np.zeros(2)
    for _ in range(300):
        wrench = np.zeros(6)
        wrench[2] = 1e-6 * rng.normal()  # small: the linear motion is compared
        data.qfrc_applied[:] = held(wrench)
        mujoco.mj_step(model, data)
        before = state[:6].copy()
        state = a @ state + b @ wrench
        rate = (state[:6] - before) / h
        off[0] = max(off[0], np.max(np.abs(data.qpos - state[:6])[2:]))
        off[1] = max(off[1], np.max(np.abs(data.qvel - rate)[2:]))
        size[0] = max(size[0], np.max(np.abs(state[2:6])))
        size[1] = max(size[1], np.max(np.abs(rate[2:])))
    assert np.all(off < np.array(SAMPLES[x]) * size)


@pytest.mark.parametrize(("ratio", "bound"), [(0.005, 3e-3), (0.1, 5e-2)])
def test_damped_response(ratio, bound):
    made = craft(BOOM, 500.0, 500.0, ratio=ratio)
    h = 2.1 / made.frequencies()[-1]
    model = made.model(h)
    retime_by(4, model, h)
    data = mujoco.MjData(model)
    a, b = made.stepper(h)
    state = np.zeros(12)
    held = bc.HeldInput()
    worst = 0.0
    size = 0.0
    for k in range(200):
        wrench = np.zeros(6)
        wrench[2] = 1e-6 * (k < 3)
        data.qfrc_applied[:] = held(wrench)
        mujoco.mj_step(model, data)
        state = a @ state + b @ wrench
        worst = max(worst, np.max(np.abs(data.qpos - state[:6])[3:]))
        size = max(size, np.max(np.abs(state[3:6])))
    assert worst < bound * size


@pytest.mark.parametrize(("n", "h", "bound"), [(2, 1.0, 1.5e-3), (3, 0.5, 1.5e-4), (4, 0.25, 3e-5)])
def test_the_2008_boom_as_simulated(n, h, bound):
    """Torque 1 mN m for 4 s and back for 4 s, hub 500 kg, 500 kg m2, root at 1 m: attitude error
    over the largest elastic part of the attitude within 60 s, nothing taken off. Form 4
    leaves the truncation of modes alone."""
    section = {"shape": "round", "diameter": 0.012}
    steel = {"youngs_modulus": 2.06e11, "density": 7800.0}
    beam = {"segment": [{"length": 15.0, "section": section, "material": steel}]}
    exact, found = solver.Craft(), fe.cantilever(beam, {"xy": 30})
    exact.body(exact.base, 500.0, inertia=(500.0,) * 3)
    own = solver.Modes(found.frequencies, 0.0, found.participation, found.rigid, found.tip)
    exact.modes(exact.base.at((1.0, 0.0, 0.0)), own)
    full, _, springs = exact.matrices()
    w, v = solver.normal_modes(full, springs, 1e-2)
    gain = v[5]  # the torque acts on the rotation, which is looked at

    def attitude(t):
        def since(start):
            s = np.maximum(t - start, 0.0)[:, None]
            rigid = s**2 / 2
            with np.errstate(divide="ignore", invalid="ignore"):
                elastic = np.where(w > 0, (1 - np.cos(w * s)) / np.where(w > 0, w, 1) ** 2, rigid)
            return np.where(w > 0, elastic, rigid) * gain**2

        parts = 1e-3 * (since(0.0) - 2 * since(4.0) + since(8.0))
        stiff = np.linalg.inv(full[:6, :6])[5, 5] * 1e-3
        frozen = stiff * sum(
            c * np.maximum(t - s, 0.0) ** 2 / 2 for c, s in ((1, 0.0), (-2, 4.0), (1, 8.0))
        )
        return parts.sum(axis=1), frozen

    made = craft([("seed", n, 0.0)], 500.0, 500.0)
    errors = {}
    for form in (2, 4):
        model = made.model(h)
        retime_by(form, model, h)
        data = mujoco.MjData(model)
        held = bc.HeldInput()
        out = []
        for k in range(round(60 / h)):
            t = k * h
            data.qfrc_applied[2] = held(1e-3 if t < 4 else -1e-3 if t < 8 else 0.0)
            mujoco.mj_step(model, data)
            out.append(data.qpos[2])
        t = h * np.arange(1, len(out) + 1)
        exact, frozen = attitude(t)
        errors[form] = np.max(np.abs(np.array(out) - exact)) / np.max(np.abs(exact - frozen))
    assert errors[2] < 1.8 * bound
    assert errors[4] < bound


@pytest.mark.parametrize(
    ("parts", "hub", "integrator"),
    [(BOOM, 10.0, "RK4"), (PAIR, 0.1, "Euler"), (THREE, 1.0, "RK4"), (BOOM, 1.0, "Euler")],
)
def test_nothing_grows_at_any_step(parts, hub, integrator):
    for ratio in (0.0, 0.1):
        made = craft(parts, hub, 0.3 * hub, ratio=ratio)
        limit = (2.0 if integrator == "Euler" else 2.83) / made.frequencies()[-1]
        for factor in (0.1, 1.0, 10.0, 100.0):
            h = factor * limit
            for form in (2, 4):
                model = made.model(h, integrator)
                done = retime_by(form, model, h)
                assert done.lambda_max <= (3.8 if integrator == "Euler" else 7.6)
                assert largest_growth(model) < 1 + 1e-9


def test_lowering_is_said():
    made = craft(BOOM, 0.1, 0.03)
    h = 20.0 / made.frequencies()[-1]
    done = bc.retime(made.model(h), h)
    assert done.lowered
    assert done.phase < 2.6
    made = craft(BOOM, 500.0, 500.0)
    assert not bc.retime(made.model(h), h).lowered


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
def test_slowed_modes_keep_their_static_response(integrator):
    made = craft(BOOM, 500.0, 500.0)
    h = 5.0
    model = made.model(h, integrator)
    done = bc.retime(model, h)
    assert [mode.slowed for mode in done.modes] == [False, True, True]
    assert np.array_equal(model.tendon_stiffness, made.model(h).tendon_stiffness)
    for mode in done.modes[1:]:
        assert abs(mode.pole) * h < 2.61


def test_retime_step_undo_is_bit_for_bit():
    made = craft(THREE, 100.0, 100.0, ratio=0.005)
    model = made.model(0.1)
    before = arrays(model)
    for h, integrator, form in (
        (0.1, None, 2),
        (3.0, "RK4", 2),
        (0.5, "implicitfast", 4),
        (0.25, "Euler", 4),
    ):
        retime_by(form, model, h, integrator)
        mujoco.mj_step(model, mujoco.MjData(model))
        assert made_for(model) == [(h, integrator or "Euler", form)]
        changed = same(before, arrays(model))
        assert set(changed) <= ARRAYS
    done = bc.retime(model, 0.0)
    assert (done.timestep, done.lambda_max, done.modes) == (0.0, 0.0, ())
    assert same(before, arrays(model)) == []
    assert made_for(model) == [None]


def test_undo_is_bit_for_bit():
    made = craft(THREE, 20.0, 20.0, ratio=0.005)
    model = made.model(0.1)
    before = arrays(model)
    done = retime_by(4, model, 0.1)
    assert set(same(before, arrays(model))) <= ARRAYS
    done.undo(model)
    assert same(before, arrays(model)) == []


def test_retiming_does_not_add_up():
    made = craft(PAIR, 100.0, 100.0, ratio=0.005)
    once = made.model(0.1)
    twice = made.model(0.1)
    bc.retime(once, 0.1)
    for h in (0.3, 0.05, 0.1):
        bc.retime(twice, h)
    assert same(arrays(once), arrays(twice)) == []


def test_stiffness_changed_at_run_time_is_followed():
    made = craft(BOOM, 500.0, 500.0)
    model = made.model(0.2)
    bc.retime(model, 0.2)
    model.tendon_stiffness[:] *= 1.1
    bc.retime(model, 0.2)
    want = made.model(0.2)
    want.tendon_stiffness[:] *= 1.1
    bc.retime(want, 0.2)
    assert same(arrays(want), arrays(model)) == []


# -- files, by the command -------------------------------------------------------------------------
def retimed(made, folder, timestep, *more):
    """The file of a craft made exact in time, and the record of the command that did it."""
    (folder / "craft.xml").write_text(made.xml)
    words = ("retime", folder / "craft.xml", "--timestep", timestep, *more)
    answer = call(*words, "-o", folder / "timed.xml", "--json", "--force")
    assert answer.status == 0, answer.err
    return folder / "timed.xml", answer.record


def other_step(file, **options):
    """What `inspect` says of a file that is run at another step or by another integrator
    than it was made for."""
    text = file.read_text()
    for name, value in options.items():
        text, count = re.subn(rf'(<option[^>]* {name}=)"[^"]*"', rf'\1"{value}"', text)
        assert count == 1
    place = file.with_name("other.xml")
    place.write_text(text)
    record = call("inspect", place, "--json").record
    assert {one["code"] for one in record["warnings"]} <= {"other-step"}
    return [one["message"] for one in record["warnings"]], mujoco.MjModel.from_xml_path(str(place))


BUS = """<mujoco model="bus">
  <option timestep="0.05"/>
  <worldbody>
    <body name="bus">
      <freejoint/>
      <inertial pos="0 0 0" mass="300" diaginertia="60 90 120"/>
      <site name="mount" pos="0.5 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""
ROD = """name = "rod"
[[segment]]
length = 4.0
section = { shape = "round", diameter = 0.02 }
material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }
[modes]
xy = 1
xz = 1
[damping]
ratio = 0.005
"""


def said_step(file):
    """The steps that the first three lines of a file name; no other line names one."""
    text = file.read_bytes().decode()
    assert mujoco.MjModel.from_xml_path(str(file))
    said = re.findall(r"timed for (\w+ at \S+ s)", text)
    assert said == re.findall(r"timed for (\w+ at \S+ s)", "".join(text.splitlines()[:3]))
    return said


def retimed_again(file, *words):
    answer = call("retime", file, "--timestep", *words, "-o", file, "--force")
    assert answer.status == 0, answer.err
    return said_step(file)


@pytest.mark.parametrize("change", [("\n", "\r\n"), ("\n", "")])
@pytest.mark.slow
def test_the_first_lines_of_a_timed_file_name_its_step(change, tmp_path):
    spec, bus, file = (tmp_path / name for name in ("rod.toml", "bus.xml", "file.xml"))
    spec.write_text(ROD)
    bus.write_bytes(BUS.replace(*change).encode())
    words = ("embed", bus, "--mount", f"mount={spec}", "-o", file, "--no-report", "--force")
    assert call(*words, "--no-retime").status == 0
    assert said_step(file) == []
    assert call(*words, "--retime").status == 0
    assert said_step(file) == ["Euler at 0.05 s"]
    assert retimed_again(file, 0.02) == ["Euler at 0.02 s"]
    assert retimed_again(file, 0.03, "--integrator", "implicitfast") == ["implicitfast at 0.03 s"]
    assert call("embed", file, "--remove", "-o", tmp_path / "back.xml").status == 0
    assert b"timed for" not in (tmp_path / "back.xml").read_bytes()
    assert retimed_again(file, 0.0) == []
    assert call(*words, "--retime").status == 0
    assert call("embed", file, "--remove", "-o", tmp_path / "bus2.xml").status == 0
    assert (tmp_path / "bus2.xml").read_bytes() == bus.read_bytes()


@pytest.mark.parametrize(("springs", "form"), [("modes", "modal"), ("hinges", "hinge")])
@pytest.mark.slow
def test_the_first_lines_of_a_fit_name_its_step(springs, form, tmp_path):
    scene = '[scene]\ntimestep = 0.05\nintegrator = "Euler"\n'
    text = f'{ROD}form = "{form}"\n[fit]\nsprings = "{springs}"\n{scene}'
    (tmp_path / "rod.toml").write_text(text)
    fit = bc.fit(tmp_path / "rod.toml")
    for name, text in (("scene", fit.scene_mjcf()), ("appendage", fit.to_mjcf())):
        file = tmp_path / f"{name}.xml"
        file.write_text(text)
        assert said_step(file) == ["Euler at 0.05 s"]
    (tmp_path / "bench.xml").write_text(fit.bench_mjcf())
    assert said_step(tmp_path / "bench.xml") == []
    if springs == "modes":
        scene = tmp_path / "scene.xml"
        assert retimed_again(scene, 0.02) == ["Euler at 0.02 s"]
        before = scene.read_bytes()
        (tmp_path / "rod2.toml").write_text(ROD.replace('"rod"', '"rod2"'))
        at = f"hub={tmp_path / 'rod2.toml'}"
        out, back = tmp_path / "two.xml", tmp_path / "one.xml"
        words = ("embed", scene, "--mount", at, "-o", out, "--no-report", "--retime")
        assert call(*words).status == 0
        assert call("embed", out, "--remove", "-o", back).status == 0
        assert (tmp_path / "one.xml").read_bytes() == before
        assert retimed_again(scene, 0.0) == []


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_the_error_stated_at_another_step_is_the_error_measured(factor, tmp_path):
    made = craft([("seed", 2, 0.0)], 1e5, 1e5)
    h = 0.4 / made.frequencies()[-1]
    file, _ = retimed(made, tmp_path, h, "--integrator", "Euler")
    assert other_step(file, timestep=h)[0] == []
    (sentence,), model = other_step(file, timestep=factor * h)
    stated = float(sentence.split("up to ")[1].split(";")[0])
    wanted = made.poles()
    z = np.linalg.eigvals(step_matrix(model))
    s = np.log(z[(np.abs(z - 1) > 1e-5) & (z.imag > 0)]) / model.opt.timestep
    measured = np.max(np.abs(np.sort(np.abs(s)) / np.sort(np.abs(wanted)) - 1.0))
    assert stated == pytest.approx(measured, rel=0.1)
    predicted = 0.4**2 * (factor**2 - 1) / 24
    assert measured == pytest.approx(abs(predicted), rel=0.1)


@pytest.mark.slow
def test_another_integrator_and_an_unstable_step_are_said(tmp_path):
    made = craft(BOOM, 500.0, 500.0, ratio=0.005)
    file, _ = retimed(made, tmp_path, 3.0, "--integrator", "Euler")
    assert "unstable" in other_step(file, timestep=3.2)[0][0]
    file, _ = retimed(made, tmp_path, 0.1, "--integrator", "Euler")
    assert "runs RK4" in other_step(file, integrator="RK4")[0][0]
    assert "runs implicitfast" in other_step(file, integrator="implicitfast")[0][0]


def test_poles_wanted_and_achieved(tmp_path):
    made = craft(BOOM, 500.0, 500.0, ratio=0.005)
    h = 1.0
    _, record = retimed(made, tmp_path, h, "--integrator", "Euler")
    rows = record["modes"]
    wanted = made.poles()
    assert [row["slowed"] for row in rows] == [False, False, True]

    def pole(frequency, ratio):
        return frequency * complex(-ratio, np.sqrt(1.0 - ratio**2))

    errors = []
    for row, s in zip(rows, wanted, strict=True):
        assert row["frequency"] == pytest.approx(abs(s), rel=1e-8)
        assert row["ratio"] == pytest.approx(-s.real / abs(s), rel=1e-6)
        got = pole(row["achieved_frequency"], row["achieved_ratio"])
        errors.append(abs(got - s) / abs(s))
    assert max(errors[:2]) < 1e-8
    assert rows[2]["achieved_frequency"] * h == pytest.approx(2.6, rel=1e-6)
    _, record = retimed(made, tmp_path, 0.1, "--integrator", "RK4")
    for row, s in zip(record["modes"], wanted, strict=True):
        assert abs(pole(row["achieved_frequency"], row["achieved_ratio"]) - s) < 1e-3 * abs(s)


@pytest.mark.parametrize("form", [2, 4])
def test_a_start_in_motion(form):
    made = craft(BOOM, 500.0, 500.0)
    h = 0.79 / made.frequencies()[-1]
    model = made.model(h)
    retime_by(form, model, h)
    rng = np.random.default_rng(5)
    qpos = np.zeros(6)
    qvel = 1e-6 * rng.normal(size=6)
    qpos[3:] = 1e-6 * rng.normal(size=3)
    a, _ = made.stepper(h)
    errors = {}
    for name, start in (("true", qvel), ("mean", bc.start_velocity(model, qpos, qvel))):
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = qpos, start
        state = np.concatenate([qpos, qvel])
        worst = size = 0.0
        for _ in range(200):
            mujoco.mj_step(model, data)
            state = a @ state
            worst = max(worst, np.max(np.abs(data.qpos - state[:6])[3:]))
            size = max(size, np.max(np.abs(state[3:6])))
        errors[name] = worst / size
    assert errors["true"] > 0.05
    assert errors["mean"] < (1e-5 if form == 4 else 5e-3)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    assert np.array_equal(bc.start_velocity(model, qpos, qvel), qvel)


def marked_child(h: float) -> str:
    """An appendage file as it would be written for a step."""
    w, rows = modes_of("seed", 2)
    chain = chain_of("seed", 2)
    tendons = ""
    for i, row in enumerate(rows):
        joints = "".join(
            f'<joint joint="boom_hinge{j + 1}_xy" coef="{float(c)!r}"/>' for j, c in enumerate(row)
        )
        x = w[i] * h
        k = float(w[i] ** 2)
        tendons += (
            f'<fixed name="boom_mode{i + 1}_xy" limited="false" stiffness="{k!r}" damping="0.0" '
            f'frictionloss="0" armature="{float(x**2 / (4 * np.sin(x / 2) ** 2) - 1)!r}" '
            f'springlength="0" solimplimit="{h!r} {INTEGRATORS["Euler"]} 2 0.0 '
            f'{k!r}">{joints}</fixed>'
        )
    return (
        '<mujoco model="boom"><compiler '
        f'angle="radian"/><worldbody>{body_text(chain, "boom", (1.0, 0.0), 0.0)}</worldbody>'
        f"<tendon>{tendons}</tendon></mujoco>"
    )


HOSTILE = (
    '<default><tendon limited="true" range="-1 1" margin="1" solreflimit=".5 .5" '
    'solimplimit=".7 .7 .7 .5 2"/></default>'
)


@pytest.mark.parametrize("how", ["attach", "spec", "paste"])
def test_the_mark_travels(how, tmp_path):
    h = 0.3
    child = marked_child(h)
    (tmp_path / "boom.xml").write_text(child)
    bodies = child.split("<worldbody>")[1].split("</worldbody>")[0]
    tendons = "<tendon>" + child.split("<tendon>")[1].split("</tendon>")[0] + "</tendon>"
    asset = (
        f'<asset><model name="boom" file="{tmp_path}/boom.xml"/></asset>' if how == "attach" else ""
    )
    inner = {
        "attach": '<attach model="boom" body="boom_link1" prefix="left_"/>',
        "spec": "",
        "paste": bodies,
    }[how]
    text = f"""<mujoco model="craft"><compiler angle="radian"/>
    <option timestep="{h}" gravity="0 0 0"/>{HOSTILE}{asset}
<worldbody><body name="hub"><freejoint/><inertial pos="0 0 0" mass="50" diaginertia="5 5 5"/>
<site name="port"/>{inner}</body></worldbody>
{tendons if how == "paste" else ""}</mujoco>"""
    if how == "spec":
        spec = mujoco.MjSpec.from_string(text)
        spec.attach(mujoco.MjSpec.from_string(child), site="port", prefix="left_")
        model = spec.compile()
    else:
        model = mujoco.MjModel.from_xml_string(text)
    assert made_for(model) == [(h, "Euler", 2)]
    before = np.array(model.tendon_armature)
    bc.retime(model, 0.0)
    assert np.array_equal(model.tendon_armature, np.zeros(2))
    bc.retime(model, h)
    assert np.allclose(model.tendon_armature, before, rtol=1e-12)


def test_a_foreign_model_is_left_as_it_is():
    text = """<mujoco><worldbody><body><joint name="h" axis="0 0 1" stiffness="3"/>
    <inertial mass="1" pos=".5 0 0"
    diaginertia=".1 .1 .1"/></body></worldbody>{}</mujoco>"""
    named = text.format(
        '<tendon><fixed name="drive_mode1" limited="false" stiffness="5"><joint joint="h" '
        'coef="2"/></fixed></tendon>'
    )
    model = mujoco.MjModel.from_xml_string(named)
    before = arrays(model)
    with pytest.raises(bc.InputError, match="is not 1"):
        bc.retime(model, 0.1)
    assert same(before, arrays(model)) == []


DRIVEN = """<mujoco><option gravity="0 0 0" timestep="0.02" integrator="implicitfast"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="400" diaginertia="150 170 130"/>
<body name="rotor" pos="0 0.6 0" euler="0 0 90">
<joint name="drive" axis="1 0 0" stiffness="3000" damping="3"/>
<inertial pos="0 0 0" mass="3" diaginertia=".4 .4 .4"/><site name="mount"/></body></body>
</worldbody></mujoco>"""


def largest_motion(file, seconds=40.0):
    """Of the joints, in MuJoCo's own steps, after a kick of the hub."""
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    data.qvel[:6] = [1e-3, -2e-3, 1e-3, 2e-3, 3e-3, -1e-3]
    worst = 0.0
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        worst = max(worst, float(np.max(np.abs(data.qpos[7:]))))
    return worst if data.time > seconds / 2.0 else np.inf  # MuJoCo starts again where it blew up


@pytest.mark.slow
def test_springs_of_the_spacecraft_still_limit_the_step(tmp_path):
    """A panel drive's own spring is not slowed: a step beyond it is refused,
    and a step as advised runs."""
    section = bc.Equivalent(bending_stiffness_xy=670.0, linear_mass=0.25)
    part = bc.Segment(length=4.0, section=section)
    spec = bc.Spec(
        name="boom", segment=(part,), scene=bc.Scene(bandwidth=4.0), modes=bc.Modes(xy=4)
    )
    done = bc.embed(DRIVEN, {"mount": spec})
    assert done.model.opt.timestep > 2.0 / max(done.appendages[0].fit.target["xy"].frequencies)
    assert any("unstable in the rest pose without" in text for text in done.warnings)
    done.write(tmp_path / "flexible.xml")
    assert largest_motion(tmp_path / "flexible.xml") < 0.1

    def retimed(step):
        file, out = tmp_path / "flexible.xml", tmp_path / "out.xml"
        words = ["retime", file, "--timestep", step, "-o", out]
        answer = call(*words, "--force")
        return answer.status, " ".join(answer.err.split())

    code, error = retimed(0.2)
    assert code == 2
    assert "the spacecraft's own springs" in error
    assert not (tmp_path / "out.xml").exists()
    advised = float(error.partition("below ")[2].split()[0])
    assert advised > 0.01
    assert retimed(0.99 * advised)[0] == 0
    assert largest_motion(tmp_path / "out.xml") < 0.1
