"""The stated error of the response at the step, of appendages that carry heavy bodies: as the step
goes to zero it becomes the error without a step, and at a step it is what `mj_step` and finite
elements of the whole craft give."""

import re
import sys

import numpy as np
import pytest

import beamchain as bc
import stepped
from arms import Arm, Link, mjcf, side, toml
from command import call
from examples import EXAMPLES

BAND = 20.0
SMALL = 1e-5 * 2.0 * np.pi / BAND  # s, a hundred thousandth of the band's period
# relative: a step of Euler that nothing corrects is off by w h/2 = 3e-5 of what a mode has in
# springs, and its peak by that over twice its damping ratio
SAME = 0.02
FLOOR = 2e-5  # what is left of both where nothing is carried: 1.5e-5
STATED = 0.03  # relative: stated and found error; found ones come from a coarser grid


def boom(payload):
    return Arm((Link("boom", 4.0, 0.05, 0.05),), hand=payload, hand_inertia=(0.02 * payload,) * 3)


def arm(payload):
    upper = Link("upper", 6.0, 0.05, 0.08)
    fore = Link("fore", 5.0, 0.04, 0.05, 4.0, (0.02, 0.02, 0.02), (0.0, 0.0, 1.0))
    return Arm((upper, fore), hand=payload, hand_inertia=(0.02 * payload,) * 3)


def embedded(folder, made, timestep):
    (folder / "craft.xml").write_text(mjcf(made, timestep=timestep, integrator="Euler"))
    at = {}
    for link in made.links:
        path = folder / f"{link.name}.toml"
        path.write_text(toml(made, link, BAND, 0.05))
        at[f"place_{link.name}"] = path
    return bc.embed(folder / "craft.xml", at)


@pytest.mark.slow
@pytest.mark.parametrize("payload", [0.0, 1000.0])
def test_the_error_at_the_step_becomes_that_without_a_step(tmp_path, payload):
    made = boom(payload)
    craft = mjcf(made, timestep=0.01, integrator="Euler")
    text = toml(made, made.links[0], BAND, 0.05)
    if not payload:
        craft = re.sub(r'<body name="hand".*?</body>', "", craft, flags=re.DOTALL)
        text = text.replace('carries = ["hand"]', "")
        assert "hand" not in craft + text
    (tmp_path / "boom.toml").write_text(text)
    file, again = tmp_path / "flexible.xml", tmp_path / "again.xml"
    flexible = bc.embed(craft, {"place_boom": tmp_path / "boom.toml"})
    flexible.write(file)
    record = call("retime", file, "--timestep", SMALL, "-o", again, "--json").record
    sys.stdout.write(
        f"{payload:g} kg: without a step {flexible.craft_error:.4e}, at {SMALL:.3g} s "
        f"{record['sampled_error']:.4e}\n"
    )
    assert record["sampled_error"] == pytest.approx(flexible.craft_error, rel=SAME, abs=FLOOR)


@pytest.mark.slow
def test_so_it_does_for_the_shipped_arm(tmp_path):
    payload = 1000.0
    text = (EXAMPLES / "arm.xml").read_text()
    size = f"{0.025 * payload:g}"
    loaded = text.replace(
        'mass="20" diaginertia="0.5 0.5 0.5"',
        f'mass="{payload:g}" diaginertia="{size} {size} {size}"',
    ).replace('timestep="0.0005"', f'timestep="{SMALL!r}"')
    assert f'mass="{payload:g}"' in loaded
    assert repr(SMALL) in loaded
    at = {"shoulder": EXAMPLES / "upper.toml", "forearm": EXAMPLES / "fore.toml"}
    flexible = bc.embed(loaded, at)
    assert set(flexible.promise.poses) <= set(flexible.sampled_poses)
    for name, error in flexible.promise.poses.items():
        stated = flexible.sampled_poses[name].error
        sys.stdout.write(f"{payload:g} kg, {name}: {error:.4e}, at the step {stated:.4e}\n")
        assert stated == pytest.approx(error, rel=SAME, abs=FLOOR)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "payload", "timestep"),
    [
        (boom, 1000.0, 0.01),
        (boom, 500.0, 0.002),
        (arm, 1000.0, 0.01),
    ],
)
def test_under_a_heavy_body_it_is_that_of_mj_step_and_finite_elements(
    tmp_path, make, payload, timestep
):
    made = make(payload)
    flexible = embedded(tmp_path, made, timestep)
    truth = side(made, BAND)
    exact = stepped.held(truth.mass, truth.damping, truth.stiffness, timestep)
    ours = stepped.stepped(flexible.model)
    found, place = stepped.response_error(exact, ours, truth.mass[:6, :6], timestep, BAND)
    stated = flexible.sampled_poses["rest"]
    sys.stdout.write(
        f"{made.links[-1].name}, {payload:g} kg, {timestep:g} s: stated {stated.error:.4e} at "
        f"{stated.frequency:.5g} rad/s, found {found:.4e} at {place:.5g} rad/s\n"
    )
    assert stated.error == pytest.approx(found, rel=STATED)
