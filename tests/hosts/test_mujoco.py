"""One exported appendage in every form MuJoCo takes: the same frequencies and the same free motion.

`make hosts` runs this file with the oldest and the newest MuJoCo that are supported.
"""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import beamchain as bc
from spacecraft import APPENDAGES, frequencies, response

FREQUENCY = 1e-12  # the same numbers through the same code
# the same model, products in another order: last digits, over 10 000 steps
MOTION = 1e-10

SITE = np.array([0.4, 0.1, -0.2])
TURN = np.array([0.9238795325112867, 0.0, 0.0, 0.3826834323650898])
HUB = """<mujoco model="craft">{compiler}
  <option gravity="0 0 0" timestep="0.002" integrator="RK4"><flag contact="disable"/></option>
  {default}{asset}
  <worldbody>
    <body name="hub" pos="0 0 1">
      <freejoint name="free"/>
      <inertial pos="0.01 0 0.02" mass="150" diaginertia="30 25 40"/>
      <geom name="box" type="box" size="0.4 0.4 0.4" mass="0"/>
      <site name="mount" pos="{pos}" quat="{quat}"/>
      {body}
    </body>
  </worldbody>
  {tendon}
</mujoco>"""


def numbers(values) -> str:
    """As an attribute, every digit."""
    return " ".join(repr(float(value)) for value in values)


def hub(**parts: str) -> str:
    empty = dict.fromkeys(("compiler", "default", "asset", "body", "tendon"), "")
    return HUB.format(**{**empty, "pos": numbers(SITE), "quat": numbers(TURN), **parts})


def forms(folder: Path) -> dict[str, mujoco.MjModel]:
    """The model in every form, by name."""
    spec = bc.read_spec(APPENDAGES / "array_left.toml")
    craft = folder / "craft.xml"
    craft.write_text(hub())
    done = bc.embed(craft, {"mount": spec})
    fit = done.appendages[0].fit
    appendage = fit.to_mjcf()
    (folder / "array.xml").write_text(appendage)
    (embedded,) = done.write(folder / "embedded.xml")
    out = {"by embed": mujoco.MjModel.from_xml_path(str(embedded))}
    by_hand = hub(
        asset='<asset><model name="array" file="array.xml"/></asset>',
        body=f'<frame pos="{numbers(SITE)}" quat="{numbers(TURN)}">'
        '<attach model="array" body="array_link1" prefix="x_"/></frame>',
    )
    (folder / "hand.xml").write_text(by_hand)
    out["<attach> by hand"] = mujoco.MjModel.from_xml_path(str(folder / "hand.xml"))
    for where in ("site", "frame", "body"):
        parent = mujoco.MjSpec.from_string(hub())
        child = mujoco.MjSpec.from_string(appendage)
        if where == "site":
            parent.attach(child, site=parent.site("mount"), prefix="x_")
        elif where == "frame":
            frame = parent.body("hub").add_frame(pos=SITE, quat=TURN)
            parent.attach(child, frame=frame, prefix="x_")
        else:
            frame = parent.body("hub").add_frame(pos=SITE, quat=TURN)
            frame.attach_body(child.body("array_link1"), "x_", "")
        out[f"MjSpec to a {where}"] = parent.compile()
    bodies = appendage[appendage.index("<body") : appendage.index("</worldbody>")]
    pasted = bodies.replace('pos="0 0 0"', f'pos="{numbers(SITE)}" quat="{numbers(TURN)}"', 1)
    tendon = appendage[
        appendage.index("<tendon>") : appendage.index("</tendon>") + len("</tendon>")
    ]
    out["pasted text"] = mujoco.MjModel.from_xml_string(hub(body=pasted, tendon=tendon))
    return out


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    return forms(tmp_path_factory.mktemp("forms"))


def test_all_forms(models):
    assert len(models) == 6  # by embed, by hand, through MjSpec
    assert len({model.ntendon for model in models.values()}) == 1


def test_frequencies(models):
    reference = frequencies(models["by embed"])
    (nv,) = {model.nv for model in models.values()}
    assert reference.size == nv - 6 >= 4  # every hinge of the appendage, on a free hub
    for name, model in models.items():
        np.testing.assert_allclose(frequencies(model), reference, rtol=FREQUENCY, err_msg=name)


@pytest.mark.slow
def test_free_motion(models):
    reference = response(models["by embed"])
    peak = np.abs(reference - reference[0]).max(axis=0)
    assert np.all(peak > 0.0)
    for name, model in models.items():
        assert np.max(np.abs(response(model) - reference) / peak) < MOTION, name


def test_compiled_through_a_string(models, tmp_path):
    """What a host that takes text sees: no file is looked for."""
    text = (bc.embed(hub(), {"mount": APPENDAGES / "array_left.toml"})).to_mjcf()
    np.testing.assert_allclose(
        frequencies(mujoco.MjModel.from_xml_string(text)),
        frequencies(models["by embed"]),
        rtol=FREQUENCY,
    )
