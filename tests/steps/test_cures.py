"""The cure that an output names was tried: applied, it keeps what was missed.

The truth is finite elements on the hub, held over each step in closed form, against differences of
`mj_step` (`stepped`); the craft are a hub with tubes.
"""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import beamchain as bc
import finite_elements
import stepped
from command import call

TUBE = {"shape": "tube", "outer_diameter": 0.05, "wall": 0.002}
ALUMINIUM = {"youngs_modulus": 7e10, "density": 2700.0, "poissons_ratio": 0.33}
TEXT = """name = "first"
[[segment]]
length = 8.0
section = { shape = "tube", outer_diameter = 0.05, wall = 0.002 }
material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }
[damping]
ratio = 0.03
"""


def drawn(step, integrator, band=10.0):
    text = (
        f'<mujoco><option gravity="0 0 0" timestep="{step}" integrator="{integrator}"/><worldbody>'
        '<body name="bus"><freejoint/><inertial pos="0 0 0" mass="100" diaginertia="30 40 50"/>'
        '<site name="first" pos="0.4 0 0"/></body></worldbody></mujoco>'
    )
    spec = {"segment": [{"length": 8.0, "section": TUBE, "material": ALUMINIUM}]}
    return stepped.Drawn(text, {"first": spec}, 100.0, 0.03, band, step, integrator)


def cured(craft, words):
    """The craft with the integrator and the step that a sentence names."""
    integrator = re.search(r'write integrator="(\w+)"', words, re.IGNORECASE)
    step = re.search(r'write timestep="([\d.e-]+)"', words, re.IGNORECASE)
    integrator = integrator[1] if integrator else craft.integrator
    step = float(step[1]) if step else craft.step
    text = craft.text.replace(f'integrator="{craft.integrator}"', f'integrator="{integrator}"')
    text = text.replace(f'timestep="{craft.step}"', f'timestep="{step}"')
    return replace(craft, text=text, step=step, integrator=integrator)


@pytest.mark.slow
def test_another_integrator_at_the_same_step_is_named_where_it_helps():
    craft = drawn(0.01, "implicitfast")
    made = stepped.embedded(craft)
    assert made.met is False
    assert stepped.sampled_error(craft, made.model)[0] > 0.01
    assert made.cure.words.startswith('Write integrator="Euler" in the <option>')
    better = cured(craft, made.cure.words)
    assert (better.step, better.integrator) == (0.01, "Euler")
    again = stepped.embedded(better)
    assert stepped.sampled_error(better, again.model)[0] <= 0.01
    assert (again.met, again.cure) == (True, None)


@pytest.mark.slow
@pytest.mark.parametrize("words", [[], ["--no-retime"]])
def test_a_step_that_ruins_the_motion_is_no_success_and_the_cure_comes_first(tmp_path, words):
    craft = drawn(0.2, "Euler")
    (tmp_path / "boom.toml").write_text(TEXT)

    def embedded(one):
        (tmp_path / "craft.xml").write_text(one.text)
        out = tmp_path / "out.xml"
        given = [tmp_path / "craft.xml", "--mount", f"first={tmp_path}/boom.toml", "-o", out]
        more = [] if "leave out" in said else words
        answer = call("embed", *given, "--no-report", "--force", *more)
        band = float(re.search(r"up to ([\d.]+) rad/s", answer.out)[1])
        model = mujoco.MjModel.from_xml_path(str(out))
        finite = np.max(np.abs(np.linalg.eigvals(stepped.stepped(model)[0]))) < 1.0 + 1e-6
        found = stepped.sampled_error(replace(one, band=band), model)[0] if finite else np.inf
        return answer, found

    said = ""
    answer, found = embedded(craft)
    assert (answer.status, found > 0.1) == (3, True)
    said = " ".join(answer.out.split()).partition(": tried, ")[0]
    assert said.startswith("Write ")
    answer, found = embedded(cured(craft, said))
    assert (answer.status, found < 0.1) == (0, True)


def fit_error(file, step=None):
    """A fit, and the error of scene.xml, a hub of 100 kg held at the
    root of the tube, at its step."""
    made = bc.fit(file)
    model = mujoco.MjModel.from_xml_string(made.scene_mjcf())
    h = step or model.opt.timestep
    model.opt.timestep = h
    spec = {"segment": [{"length": 8.0, "section": TUBE, "material": ALUMINIUM}]}
    own = finite_elements.cantilever(spec, stepped.MODES)
    hub = np.diag([100.0, 100.0, 100.0, 30.0, 40.0, 50.0])
    frozen = hub + own.rigid
    n = own.frequencies.size
    mass = np.block([[frozen, own.participation.T], [own.participation, np.eye(n)]])
    zero = np.zeros(6)
    damping = np.diag([*zero, *(2.0 * 0.03 * own.frequencies)])
    stiffness = np.diag([*zero, *own.frequencies**2])
    exact = stepped.held(mass, damping, stiffness, h)
    band = min(made.bandwidth.values())
    return made, stepped.response_error(exact, stepped.stepped(model), frozen, h, band)[0]


HUB = "[root]\nhub = { mass = 100.0, inertia = [30.0, 40.0, 50.0], offset = [0.0, 0.0, 0.0] }\n"


@pytest.mark.slow
def test_a_fit_whose_step_ruins_the_motion_begins_with_the_cure(tmp_path):
    def fitted(step):
        file = tmp_path / "boom.toml"
        file.write_text(TEXT + HUB + f"[scene]\ntimestep = {step}\n")
        return fit_error(file)

    made, found = fitted(0.3)
    assert (made.status.ok, found > 0.1) == (False, True)
    words = made.status.message
    step = re.match(
        r"Write (?:scene.integrator = \"\w+\" and write )?scene.timestep = ([\d.]+)", words
    )
    made, found = fitted(float(step[1]))
    assert (made.status.ok, found < 0.1) == (True, True)


@pytest.mark.slow
def test_damping_of_hinges_is_told_its_cure_and_the_cure_leads_to_no_other(tmp_path):
    def fitted(form):
        file = tmp_path / "boom.toml"
        file.write_text(TEXT.replace("0.03", f'0.03\nform = "{form}"') + HUB)
        return fit_error(file, 1e-4)

    made, found = fitted("hinge")
    (said,) = [w for w in made.warnings if "Write" in w]
    assert said.startswith('Write damping.form = "modal": tried')
    assert found > 0.1
    made, found = fitted("modal")
    assert found < 0.1
    assert not any("damping.form" in w for w in made.warnings)
