"""What cannot be fitted is refused by one sentence that names the key, its value and the cure; what
the command line says of a file stands in `test_bad_input.py`. No tolerances: sentences only, but
for tanks between their limits.

Tests an internal as well, `meant`, which every answer to an unknown name asks."""

from functools import cache, partial
from pathlib import Path

import control
import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.checks import meant
from beamchain.errors import RealisationError
from command import call
from modes_of_beam import modes_of_beam
from prints import plate, whole
from refused import check_refused
from spec_tables import spec_of, table_of

STEEL = bc.Material(youngs_modulus=2.06e11, density=7800.0)
BAY = bc.Segment(length=5.0, section=bc.Round(diameter=0.02), material=STEEL)
ROD = bc.Beam(segments=[BAY])
CRAFT = """<mujoco><worldbody><body name="hub"><freejoint/><geom size=".5" mass="50"/>
<site name="mount"/><site name="tip"/></body></worldbody></mujoco>"""
SPEC = """
name = "boom"
[[segment]]
length = 2.0
section = { shape = "tube", outer_diameter = 0.05, wall = 0.002 }
material = { youngs_modulus = 7e10, density = 2700.0 }
[fit]
method = "exact"
"""

# -- arguments in Python ---------------------------------------------------------------------------


def attached(craft, site="mount"):
    bc.fit(ROD).attach(craft, site)


def of_steel(**values):
    bc.Segment(**{"length": 1.0, "section": bc.Round(diameter=0.1), "material": STEEL} | values)


def with_port(x):
    return bc.Spec(segment=(BAY,), port=(bc.spec.Port(name="end", x=x),))


PYTHON = {
    "a port beyond the tip": (lambda: with_port(5.00001), ("port.end.x = 5.00001 m lies beyond",)),
    "a cut at the tip": (
        lambda: bc.Spec(segment=(BAY,), fit=bc.spec.FitOptions(cuts=(5.0,))),
        ("fit.cuts[0] = 5.0 m lies beyond",),
    ),
    "modes a word": (lambda: bc.fit(ROD, modes="two"), ('modes={"xy": 2',)),
    "damping a word": (lambda: bc.fit(ROD, damping="low"), ("ratio = 'low'", "not a number")),
    "root a word": (lambda: bc.fit(ROD, root="hub"), ("Root(target=",)),
    "scene a number": (lambda: bc.fit(ROD, scene=5.0), ("Scene(bandwidth=",)),
    "options a word": (lambda: bc.fit(ROD, options="modes"), ("FitOptions(springs=",)),
    "one segment": (lambda: bc.Beam(segments=BAY), ("segments=[Segment(...)]",)),
    "a beam for segments": (lambda: bc.Beam(segments=[ROD]), ("segments=[Segment(...)]",)),
    "section a word": (lambda: of_steel(section="round"), ("Round(diameter=",)),
    "material a word": (lambda: of_steel(material="steel"), ("Material(youngs_modulus=",)),
    "inertia a number": (
        lambda: bc.Hub(mass=100.0, inertia=100.0),
        ("three numbers [Ixx, Iyy, Izz]",),
    ),
    "ratio of a port": (
        lambda: bc.Damping(ratio={"xy": 0.01}),
        ("ratio.xy = 0.01", "must be a list"),
    ),
    "attached to a path": (lambda: attached("craft.xml"), ("needs an mujoco.MjSpec", "not a str")),
    "attached to a model": (
        lambda: attached(mujoco.MjModel.from_xml_string(CRAFT)),
        ("not a MjModel",),
    ),
    "attached nowhere": (
        lambda: attached(mujoco.MjSpec.from_string(CRAFT), "port_side"),
        ("site 'port_side'", "its sites are: mount, tip"),
    ),
    "embedded nowhere": (lambda: bc.embed(CRAFT, "array.toml"), ('{"mount": "array.toml"}',)),
    "a field of another name": (
        lambda: bc.Tube(thickness=0.1),
        ("Tube has no field 'thickness'", "outer_diameter, wall"),
    ),
    "a field with a slip": (
        lambda: bc.Scene(bandwith=3.0),
        ("Scene has no field 'bandwith'", "did you mean 'bandwidth'"),
    ),
    "a field that is missing": (
        lambda: bc.Tube(outer_diameter=0.1),
        ("Tube: wall is missing", "outer_diameter, wall"),
    ),
    "a field without its name": (
        lambda: bc.Segment(8.0),
        ("Segment: 8.0", "without a name", "length"),
    ),
    "a field of no specification": (
        lambda: bc.Spec(segment=ROD.segments).replace(mode=2),
        ("no field 'mode'", "it has name"),
    ),
    "hub a number": (lambda: bc.fit(ROD, hub=3), ("hub = 3 is an int", "give a Hub")),
    "port": (
        lambda: bc.fit(ROD, modes={"yx": 2}),
        ("unknown port 'yx'", "choose from xy, xz, torsion, axial"),
    ),
    "no axes": (lambda: bc.Scene(bandwidth=1.0, axes=()), ("axes",)),
    "target auto": (lambda: bc.fit(ROD, root=bc.spec.Root(target="auto")), ("auto",)),
    "amplitudes of hinges": (
        lambda: spec_of(
            {**table_of(ROD), "sensors": {"modes": True}, "fit": {"springs": "hinges"}}
        ),
        ("sensors.modes",),
    ),
    **{
        f"repeat {repeat}": (
            partial(of_steel, repeat=repeat),
            (f"repeat = {repeat}", "whole number from 1 to 500"),
        )
        for repeat in (0, -1, 501, 2.5, True)
    },
}

# -- keys of a file --------------------------------------------------------------------------------


def of_file(old, new):
    assert old in SPEC
    Path("boom.toml").write_text(SPEC.replace(old, new))
    bc.read_spec("boom.toml")


def sampled_loop():
    text = 'input = "u"\noutput = "y"\nnumerator = [1.0]\ndenominator = [1.0]\ndt = 0.1\n'
    Path("loops.toml").write_text(f"[[loop]]\n{text}")
    bc.margins(control.ss(control.tf([1.0], [1.0, 1.0])), "loops.toml")


KEYS = {
    "of another shape": (
        lambda: of_file("wall = 0.002", "wall = 0.002, diameter = 0.05"),
        (
            "segment[0].section: unknown key 'diameter'",
            "'outer_diameter'",
            'shape = "tube"',
            "shape, outer_diameter, wall",
        ),
    ),
    "of another shape, at the other end": (
        lambda: of_file(
            "material", 'section_end = { shape = "round", diameter = 0.1, wall = 0.01 }\nmaterial'
        ),
        (
            "section_end: unknown key 'wall'",
            "another table",
            'keys of shape = "round" are shape, diameter.',
        ),
    ),
    "of another table": (
        lambda: of_file('method = "exact"', "bandwidth = 3.0"),
        ("fit: unknown key 'bandwidth'", "another table", "keys of [fit] are springs"),
    ),
    "with a slip": (
        lambda: of_file("density = 2700.0", "density = 2700.0, poisson_ratio = 0.3"),
        (
            "unknown key 'poisson_ratio'",
            "did you mean 'poissons_ratio'",
            "keys of [segment.material] are youngs_modulus",
        ),
    ),
    "in the file itself": (
        lambda: of_file('name = "boom"', 'name = "boom"\nbandwidth = 3.0'),
        ("unknown key 'bandwidth'", "keys of the file are name, segment"),
    ),
    "of a table that nobody knows": (
        lambda: of_file("[fit]", "[fitt]"),
        ("unknown key 'fitt'", "did you mean 'fit'"),
    ),
    "of a text with a unit": (
        lambda: of_file('[fit]\nmethod = "exact"\n', '[scene]\nbandwidth = "1 Hz"\n'),
        ("bandwidth", "a number in rad/s is needed"),
    ),
    "of a sampled loop": (sampled_loop, ("unknown key 'dt'", "continuous")),
}

# -- imported modes --------------------------------------------------------------------------------
PRINT = {"file": "a.f06"}
SI = {"length": 1e-3, "mass": 1e3}


def of_print(imported, **more):
    """A specification of the printed plate."""
    Path("plate.f06").write_text(whole(plate().in_units(1e-3, 1e3)))
    file = {"file": str(Path("plate.f06").resolve()), "units": SI}
    bc.fit(spec_of({"name": "plate", "imported": {**file, **imported}, **more}))


@cache
def boom():
    section = bc.Equivalent(
        bending_stiffness_xy=200.0,
        bending_stiffness_xz=300.0,
        torsion_stiffness=90.0,
        linear_mass=2.0,
        polar_inertia=0.1,
    )
    beam = bc.Beam(segments=(bc.Segment(length=3.0, section=section),))
    return beam, modes_of_beam(beam, {"xz": 1})


def backwards():
    data = boom()[1].moved((0.0, 0.0, 0.0), np.diag([-1.0, -1.0, 1.0]))
    bc.fit(data)


IMPORTED = {
    "springs on hinges": (
        lambda: of_print({}, fit={"springs": "hinges"}),
        ('fit.springs = "hinges"', "independent"),
    ),
    "mode 30": (lambda: of_print({"modes": [30]}), ("modes: 30 is not in the file",)),
    "modes twice": (
        lambda: of_print({"modes": [1, 3, 4]}, modes={"xz": 1}),
        ("imported.modes are both given",),
    ),
    "beside segments": (
        lambda: spec_of({**table_of(boom()[0]), "imported": PRINT}),
        ("[imported] and segment are both given",),
    ),
    "ending": (lambda: spec_of({"imported": {"file": "a.xls"}}), ("a.xls", "unknown ending")),
    "beam": (lambda: spec_of({"imported": PRINT}).beam, ("needs a beam",)),
    "no file": (lambda: bc.fit(spec_of({"imported": PRINT})), ("a.f06", "does not exist")),
    "two modes of one": (
        lambda: bc.fit(boom()[1], modes={"xz": 2}),
        ("only 1 of the imported modes", "xz"),
    ),
    "backwards": (backwards, ("the mass centre lies at", "give axes")),
}

# -- tanks -----------------------------------------------------------------------------------------
TANK = """name = "tank"
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
    "negative radius": ("radius = 0.5", "radius = -0.5", ("radius = -0.5", "above zero")),
    "no height": ("height = 0.8", "height = 0", ("height = 0.0", "above zero")),
    "not finite": ("density = 1010.0", "density = nan", ("density",)),
    "sphere": ('shape = "cylinder"', 'shape = "sphere"', ("shape ", "cylinder")),
    "ratio of one": ("ratio = 0.01", "ratio = 1.0", ("ratio = 1.0", "not an oscillation")),
    "no damping": ("ratio = 0.01", "ratio = 0.0", ("ratio = 0.0", "above zero")),
    "no acceleration": (
        "acceleration = 0.05",
        "acceleration = 0",
        ("acceleration = 0", "positive"),
    ),
    "left out": ("acceleration = 0.05", "", ("acceleration",)),
    "flat": ("height = 0.8", "height = 0.001", ("0.002 times the radius",)),
    "long": ("height = 0.8", "height = 80.0", ("160 times the radius",)),
    "unknown key": ("ratio = 0.01", "ratio = 0.01\nfill = 0.5", ("unknown key 'fill'",)),
    "axis": (
        "ratio = 0.01",
        'ratio = 0.01\naxis = "up"',
        ("slosh.axis = 'up'", "choose one of x, y, z, -x, -y, -z"),
    ),
    "no pendulum": ("ratio = 0.01", "ratio = 0.01\nmodes = 0", ("modes = 0",)),
    "many": ("ratio = 0.01", "ratio = 0.01\nmodes = 7", ("modes = 7",)),
}
ADDED = {
    "segments": (SEGMENT, ("[slosh] and segment are both given",)),
    "imported": ('[imported]\nfile = "modes.f06"\n', ("[slosh] and imported",)),
    "payload": ("[payload]\nmass = 1.0\n", ("[slosh] and payload", "carries nothing")),
    "port": ('[[port]]\nname = "end"\nx = 0.5\n', ("[slosh] and port",)),
    "modes": ("[modes]\nxy = 3\n", ("[slosh] and modes", "slosh.modes")),
    "damping": ("[damping]\nratio = 0.01\n", ("[slosh] and damping", "slosh.ratio")),
    "uncertain": ("[uncertain]\nfrequency = { relative = 0.1 }\n", ("a liquid is not varied",)),
    "target": ('[root]\ntarget = "free"\n', ('root.target = "free" and',)),
    "springs": ('[fit]\nsprings = "modes"\n', ("[fit] and [slosh]",)),
    "sensors": ("[sensors]\nmodes = true\n", ("root_load alone",)),
    "tip": ("[scene]\ntip = true\n", ("scene.tip",)),
}


def tank(text):
    Path("tank.toml").write_text(text)
    bc.fit("tank.toml")


TANKS = {
    **{
        name: (partial(tank, TANK.replace(old, new)), words)
        for name, (old, new, words) in CHANGED.items()
    },
    **{
        f"beside {name}": (partial(tank, TANK + text), words)
        for name, (text, words) in ADDED.items()
    },
}

# -- a slip of units, of which no chain is made ----------------------------------------------------


def thick_rod(theory):
    rod = bc.Round(diameter=80.0)
    metal = bc.Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.3)
    segment = bc.Segment(length=5.0, section=rod, material=metal, theory=theory)
    bc.fit(bc.Beam(segments=[segment]))


def thick_tube(theory):
    tube = bc.Tube(outer_diameter=20.0, wall=1.0)
    metal = bc.Material(youngs_modulus=2e11, density=7800.0)
    segment = bc.Segment(length=15.0, section=tube, material=metal, theory=theory)
    bc.fit(bc.Beam(segments=[segment]))


MILLIMETRES = {
    "rod": (thick_rod, ("segment[0]: diameter = 80 m", "5 m long", "mm", "diameter = 0.08.")),
    "tube": (thick_tube, ("mm", "write outer_diameter = 0.02, wall = 0.001.")),
}

GROUPS = {"Python": PYTHON, "key": KEYS, "imported": IMPORTED, "tank": TANKS}
REFUSED = {f"{kind}: {name}": row for kind, group in GROUPS.items() for name, row in group.items()}


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_fitted_is_refused(case):
    check_refused(REFUSED[case][0], bc.InputError, REFUSED[case][1])


@pytest.mark.parametrize("theory", ["euler", "timoshenko"])
@pytest.mark.parametrize("case", MILLIMETRES)
def test_millimetres_are_asked_about(case, theory):
    """Eighty metres of rod on five of boom: no theory helps, and none is advised before the unit
    is."""
    call, words = MILLIMETRES[case]
    check_refused(lambda: call(theory), RealisationError, words)


@pytest.mark.parametrize("name", CHANGED)
def test_a_wrong_tank_leaves_nothing(name):
    old, new, _ = CHANGED[name]
    Path("tank.toml").write_text(TANK.replace(old, new))
    told = call("fit", "tank.toml", "-o", "out")
    assert told.status == 2
    assert "Traceback" not in told.err
    assert not Path("out").exists()


def test_what_needs_a_beam_takes_no_tank():
    Path("tank.toml").write_text(TANK)
    told = call("study", "tank.toml", "-o", "study")
    assert told.status == 2
    assert "needs a beam" in " ".join(told.err.split())


@pytest.mark.parametrize("proportion", np.geomspace(0.01, 100.0, 9).tolist())
def test_every_proportion_of_a_tank_has_a_body(proportion):
    """Between the limits of height over radius the fixed mass is one that MuJoCo takes."""
    Path("tank.toml").write_text(TANK.replace("height = 0.8", f"height = {0.5 * proportion!r}"))
    fit = bc.fit("tank.toml")
    assert fit.status.ok
    assert max(abs(row.frequency_error) for row in fit.modes) < 1e-9


def test_of_names_alike_the_one_that_holds_the_word_is_meant():
    assert meant("wing_n_", ["wing_wing_s_", "wing_wing_n_"]) == "did you mean 'wing_wing_n_'? "
    assert meant("wing_n_", ["wing_wing_n_", "wing_wing_s_"]) == "did you mean 'wing_wing_n_'? "
    assert meant("elephant", ["wing"]) == ""
