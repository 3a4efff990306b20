"""Closed forms beside a craft at the step of a sampled plant: where it grows, what it is off by,
and what is made exact for it."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.control.at_step import at_step, retime_at, step_errors
from beamchain.engine.operating_point import operating_point

W = 4.0
CRAFT = """<mujoco><option gravity="0 0 0" integrator="{}"/><worldbody>
<body><joint name="drive" axis="0 0 1" stiffness="32"/><inertial pos="0 0 0" mass="1"
diaginertia="1 1 2"/></body></worldbody></mujoco>"""
BOOM = """<mujoco><option gravity="0 0 0" timestep="0.01" integrator="{}"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="8" diaginertia="5 6 7"/>
<body name="link" pos="1 0 0"><joint name="hinge" axis="0 0 1"/>
<inertial pos="0.5 0 0" mass="1.5" diaginertia="0.5 0.5 0.625"/></body></body></worldbody>
<tendon><fixed name="boom_mode1_xy" stiffness="20"><joint joint="hinge" coef="1"/></fixed></tendon>
</mujoco>"""


def made(text, integrator):
    return mujoco.MjModel.from_xml_string(text.format(integrator))


@pytest.mark.parametrize(
    ("integrator", "phase", "grows"),
    [
        ("Euler", 1.99, False),
        ("Euler", 2.01, True),
        ("RK4", 2.80, False),
        ("RK4", 2.85, True),  # 1 - x^6/72 + x^8/576 = 1.11 of its square
    ],
)
def test_a_step_that_grows_is_refused_and_a_stable_one_named(integrator, phase, grows):
    """4 rad/s: Euler grows beyond w h = 2, RK4 beyond 2 sqrt(2)."""
    model = made(CRAFT, integrator)
    if grows:
        with pytest.raises(bc.InputError, match="unstable") as said:
            at_step(model, phase / W, model.qpos0, None)
        number = float(str(said.value).split("give a step of ")[1].split(" s")[0])
        largest = 2.0 if integrator == "Euler" else np.sqrt(8.0)
        assert 0.8 * largest / W < number < largest / W
    else:
        out, _ = at_step(model, phase / W, model.qpos0, None)
        assert out.opt.timestep == phase / W
        assert model.opt.timestep != phase / W


@pytest.mark.parametrize(("integrator", "told"), [("Euler", True), ("RK4", False)])
def test_what_a_step_is_off_by(integrator, told):
    """|z - exp(s h)| / |exp(s h) - 1|, of Euler z = exp(2 j asin(w h / 2)), of RK4 its series."""
    model = made(CRAFT, integrator)
    h, x = 0.1, 0.1 * W
    z = np.exp(2j * np.arcsin(x / 2.0))
    if integrator == "RK4":
        z = sum((1j * x) ** k / np.prod(np.arange(1.0, k + 1.0)) for k in range(5))
    wanted = abs(z - np.exp(1j * x)) / abs(np.exp(1j * x) - 1.0)
    off, response = step_errors(model, operating_point(model), h, None)
    assert off.error == pytest.approx(wanted, rel=1e-5)
    assert off.frequency == pytest.approx(W)
    assert (off.step, response) == (h, None)
    _, said = at_step(model, h, model.qpos0, None)
    codes = [one.code for one in said]
    assert codes == ["not-exact-in-time"] + ["time-error"] * told


@pytest.mark.parametrize(("integrator", "exact"), [("Euler", True), ("RK4", False)])
def test_a_boom_is_made_exact_for_the_step_that_is_asked_for(integrator, exact):
    """1 + a = k h^2 / (4 sin^2(w h / 2)) of the boom held, which weighs 1."""
    model = made(BOOM, integrator)

    def armature(h):
        return 20.0 * h**2 / (4.0 * np.sin(np.sqrt(20.0) * h / 2.0) ** 2) - 1.0

    out, said = retime_at(model, 0.05, model.qpos0)
    assert (out.opt.timestep, model.opt.timestep) == (0.05, 0.01)
    assert model.tendon_armature[0] == 0.0
    assert [one.code for one in said] == ([] if exact else ["not-exact-in-time"])
    if not exact:
        assert out.tendon_armature[0] == 0.0
        return
    # of form 4: on the bus that gives way, to what moves against it alone
    apart = 8.0 * 1.5 / 9.5
    whole, relative = 7.625 + apart * 1.5**2, 0.625 + apart * 0.75
    inertia = 0.625 + apart * 0.25 - relative**2 / whole
    w = np.sqrt(20.0 / inertia)
    for h in (0.05, 0.02):
        done, _ = retime_at(model, h, model.qpos0)
        wanted = 20.0 * h**2 / (4.0 * np.sin(w * h / 2.0) ** 2) - inertia
        assert done.tendon_armature[0] == pytest.approx(wanted, rel=1e-6)
    held = bc.retime(made(BOOM, integrator), 0.05)
    assert held.model.tendon_armature[0] == pytest.approx(armature(0.05))
    # one that was made for this step stays as it is, for another it is made anew
    kept, _ = retime_at(held.model, 0.05, model.qpos0)
    assert kept.tendon_armature[0] == held.model.tendon_armature[0]
    other, _ = retime_at(held.model, 0.02, model.qpos0)
    wanted = 20.0 * 0.02**2 / (4.0 * np.sin(w * 0.01) ** 2) - inertia
    assert other.tendon_armature[0] == pytest.approx(wanted, rel=1e-6)
