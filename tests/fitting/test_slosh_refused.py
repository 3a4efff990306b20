"""Wrong [slosh] tables: one sentence each, naming the field, the value and the cure."""

import numpy as np
import pytest

import beamchain as bc
from command import call

GOOD = """name = "tank"
[slosh]
shape = "cylinder"
radius = 0.5
height = 0.8
density = 1010.0
ratio = 0.01
acceleration = 0.05
"""
SEGMENT = """[[segment]]
length = 2.0
section = { shape = "tube", outer_diameter = 0.05, wall = 0.002 }
material = { youngs_modulus = 7e10, density = 2700.0 }
"""
CHANGED = {
    "negative radius": ("radius = 0.5", "radius = -0.5", "radius = -0.5 must be above zero"),
    "no height": ("height = 0.8", "height = 0", "height = 0.0 must be above zero"),
    "not finite": ("density = 1010.0", "density = nan", "density"),
    "sphere": ('shape = "cylinder"', 'shape = "sphere"', "shape .*cylinder"),
    "ratio of one": ("ratio = 0.01", "ratio = 1.0", "ratio = 1.0 is not an oscillation"),
    "no damping": ("ratio = 0.01", "ratio = 0.0", "ratio = 0.0 must be above zero"),
    "no acceleration": ("acceleration = 0.05", "acceleration = 0", "acceleration = 0.*positive"),
    "left out": ("acceleration = 0.05", "", "acceleration"),
    "flat": ("height = 0.8", "height = 0.001", "0.002 times the radius"),
    "long": ("height = 0.8", "height = 80.0", "160 times the radius"),
    "unknown key": ("ratio = 0.01", "ratio = 0.01\nfill = 0.5", "unknown key 'fill'"),
    "axis": (
        "ratio = 0.01",
        'ratio = 0.01\naxis = "up"',
        "slosh.axis = 'up' is not allowed; choose one of x, y, z, -x, -y, -z",
    ),
    "no pendulum": ("ratio = 0.01", "ratio = 0.01\nmodes = 0", "modes = 0"),
    "many": ("ratio = 0.01", "ratio = 0.01\nmodes = 7", "modes = 7"),
}
ADDED = {
    "segments": (SEGMENT, r"\[slosh\] and segment are both given"),
    "imported": ('[imported]\nfile = "modes.f06"\n', r"\[slosh\] and imported"),
    "payload": ("[payload]\nmass = 1.0\n", r"\[slosh\] and payload.*carries nothing"),
    "port": ('[[port]]\nname = "end"\nx = 0.5\n', r"\[slosh\] and port"),
    "modes": ("[modes]\nxy = 3\n", r"\[slosh\] and modes.*slosh.modes"),
    "damping": ("[damping]\nratio = 0.01\n", r"\[slosh\] and damping.*slosh.ratio"),
    "uncertain": ("[uncertain]\nfrequency = { relative = 0.1 }\n", "a liquid is not varied"),
    "target": ('[root]\ntarget = "free"\n', 'root.target = "free" and'),
    "timing": ("[fit]\ntimestep = 0.01\n", r"\[fit\] and \[slosh\]"),
    "sensors": ("[sensors]\nmodes = true\n", "root_load alone"),
    "tip": ("[scene]\ntip = true\n", "scene.tip"),
}


@pytest.mark.parametrize("name", CHANGED)
def test_a_wrong_value(tmp_path, name):
    old, new, sentence = CHANGED[name]
    file = tmp_path / "tank.toml"
    file.write_text(GOOD.replace(old, new))
    with pytest.raises(bc.InputError, match=sentence):
        bc.fit(file)
    told = call("fit", file, "-o", tmp_path / "out")
    assert told.status == 2
    assert "Traceback" not in told.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ADDED)
def test_what_does_not_go_with_it(tmp_path, name):
    text, sentence = ADDED[name]
    file = tmp_path / "tank.toml"
    file.write_text(GOOD + text)
    with pytest.raises(bc.InputError, match=sentence):
        bc.fit(file)


def test_what_needs_a_beam(tmp_path):
    file = tmp_path / "tank.toml"
    file.write_text(GOOD)
    told = call("study", file, "-o", tmp_path / "study")
    assert told.status == 2
    assert "liquid in a tank, but this needs a beam" in " ".join(told.err.split())


def test_every_proportion_has_a_body(tmp_path):
    """Between the limits of height over radius the fixed mass is one that MuJoCo takes."""
    for proportion in np.geomspace(0.01, 100.0, 9).tolist():
        file = tmp_path / "tank.toml"
        file.write_text(GOOD.replace("height = 0.8", f"height = {0.5 * proportion!r}"))
        fit = bc.fit(file)
        assert fit.status.ok
        assert max(abs(row.frequency_error) for row in fit.modes) < 1e-9
