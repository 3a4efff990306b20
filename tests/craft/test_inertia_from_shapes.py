"""A spacecraft whose masses come from its shapes (`inertiafromgeom="true"`):
links keep the inertia they were given."""

import tomllib

import mujoco
import numpy as np
import pytest

import beamchain as bc
from spacecraft import frequencies, spec

# relative, and absolute in m, kg and kg m^2: the box's numbers through MuJoCo and through this file
SAME = 1e-9
SAME_FREQUENCY = 1e-9  # the same
CRAFT = """<mujoco><compiler inertiafromgeom="{}"/><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="77" diaginertia="7 8 9"/><geom type="box" size="0.6 0.5 0.4" mass="50"/>
<site name="mount" pos="0.6 0 0"/></body></worldbody></mujoco>"""


def written(look, tmp_path):
    """The specification of a rod that is drawn, or not, or touches."""
    text = spec("rod").read_text()
    scene = {"drawn": {}, "bare": {"visuals": False}, "touching": {"contacts": True}}[look]
    table = tomllib.loads(text).get("scene", {})
    assert not table
    path = tmp_path / "rod.toml"
    lines = [f"{key} = {str(value).lower()}" for key, value in scene.items()]
    path.write_text(text + "\n[scene]\n" + "\n".join(lines) + "\n" if lines else text)
    return path


BOX = np.array([1.2, 1.0, 0.8])  # m, of 50 kg
WORDS = " ".join(repr(float(value)) for value in 50.0 / 12.0 * (np.sum(BOX**2) - BOX**2))
STATED = f"""<mujoco><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="50" diaginertia="{WORDS}"/>
<site name="mount" pos="0.6 0 0"/></body></worldbody></mujoco>"""


def compiled(craft: str, appendage, folder) -> mujoco.MjModel:
    """What MuJoCo makes of the files written for a spacecraft."""
    folder.mkdir()
    (folder / "craft.xml").write_text(craft)
    out = folder / "out" / "flexible.xml"
    bc.embed(folder / "craft.xml", {"mount": appendage}).write(out)
    return mujoco.MjModel.from_xml_path(str(out))


@pytest.mark.parametrize("look", ["drawn", "bare", "touching"])
@pytest.mark.slow
def test_links_keep_their_mass_and_the_craft_its_frequencies(look, tmp_path):
    """Beside a hub whose numbers are stated with <inertial>,
    which no setting of the compiler moves."""
    appendage = written(look, tmp_path)
    stated = compiled(STATED, appendage, tmp_path / "stated")
    shapes = compiled(CRAFT.format("true"), appendage, tmp_path / "shapes")
    kept = compiled(CRAFT.format("auto"), appendage, tmp_path / "kept")
    assert float(kept.body("hub").mass[0]) == 77.0
    assert float(shapes.body("hub").mass[0]) == 50.0  # of the box, not of <inertial>
    links = [i for i in range(shapes.nbody) if shapes.body(i).name.startswith("rod_link")]
    assert len(links) > 2
    for i in links:
        name = shapes.body(i).name
        for field in ("mass", "inertia", "ipos", "iquat"):
            here, there = (getattr(model.body(name), field) for model in (shapes, stated))
            np.testing.assert_allclose(
                here, there, rtol=SAME, atol=SAME, err_msg=f"{field} of {name}"
            )
    np.testing.assert_allclose(frequencies(shapes), frequencies(stated), rtol=SAME_FREQUENCY)
