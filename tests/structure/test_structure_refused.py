"""Structures that cannot be, and files that do not tell of one, are refused by one sentence that
names the key, its value and the cure. No tolerances: sentences only."""

import json
import re
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from scipy import io

import superelements as se
from appendages import STEEL, tapered_boom, unit_beam
from beamchain import (
    Beam,
    BeamchainError,
    Box,
    Custom,
    Equivalent,
    InputError,
    Joint,
    Lump,
    Material,
    ModalData,
    Rectangle,
    Round,
    Segment,
    Tube,
    embed,
    fit,
    read_modes,
)
from beamchain.spec import Draw, InterfaceGrid, read_op4
from beamchain.structure.exact import UniformBeam
from modes_of_beam import modes_of_beam, modes_text
from prints import Modes, Print, cantilever, plate, whole
from refused import check_refused
from spec_tables import spec_of
from textbook_modes import Cloud, frame, uniform_rod

NAN = float("nan")

# -- sections, materials, segments, joints, lumps --------------------------------------------------
TRUSS = Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0)
TWISTS = Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0, torsion_stiffness=5.0)
STRETCHES = Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0, axial_stiffness=5.0)
ROUND = Round(diameter=0.1)
BAR = Segment(length=1.0, section=ROUND, material=STEEL)


def steel(**values):
    Material(**{"youngs_modulus": 2.6e11, "density": 7800.0} | values)


def drawn(**values):
    Segment(**{"length": 1.0, "section": ROUND, "material": STEEL} | values)


def truss(**values):
    Segment(**{"length": 1.0, "section": TRUSS} | values)


def profile(**values):
    moments = {"second_moment_z": 1.0, "second_moment_y": 1.0, "torsion_constant": 1.0}
    Custom(**{"area": 1.0, **moments} | values)


def with_joints(*joints):
    Beam(segments=(BAR,), joints=joints)


def with_lumps(*lumps):
    Beam(segments=unit_beam().segments, lumps=lumps)


def port_of(section, port):
    Beam(segments=(Segment(length=1.0, section=section),)).port(port)


def limp_port():
    section = Equivalent(
        bending_stiffness_xy=1e4, linear_mass=8.0, torsion_stiffness=3e-300, polar_inertia=5e-3
    )
    Beam(segments=(Segment(length=0.86, section=section),)).port("torsion", 2)


SECTIONS = {
    "diameter 0": (lambda: Round(diameter=0.0), ("diameter = 0.0", "above zero (m)")),
    "diameter -1": (lambda: Round(diameter=-1.0), ("diameter = -1.0", "above zero")),
    "diameter nan": (lambda: Round(diameter=NAN), ("diameter = nan", "finite number in m")),
    "diameter inf": (lambda: Round(diameter=float("inf")), ("diameter = inf", "finite number")),
    "diameter true": (lambda: Round(diameter=True), ("diameter = True", "not a number")),
    "diameter as text": (lambda: Round(diameter="2 cm"), ("diameter = '2 cm'", "not a number")),
    "tube without a hole": (
        lambda: Tube(outer_diameter=0.1, wall=0.06),
        ("wall = 0.06 m", "half", "outer_diameter = 0.1 m", "thinner"),
    ),
    "box without a hole": (
        lambda: Box(width_y=0.1, width_z=0.2, wall=0.05),
        ("wall = 0.05 m", "less than half", "0.1 m", "thinner"),
    ),
    "width 0": (lambda: Rectangle(width_y=0.1, width_z=0.0), ("width_z = 0.0", "above zero")),
    "area 0": (lambda: profile(area=0.0), ("area = 0.0", "above zero (m^2)")),
    "polar moment": (
        lambda: profile(polar_moment=3.0),
        ("polar_moment = 3.0 m^4", "second_moment_y + second_moment_z = 2"),
    ),
    "bending stiffness 0": (
        lambda: Equivalent(bending_stiffness_xy=0.0, linear_mass=1.0),
        ("bending_stiffness_xy = 0.0", "above zero (N m^2)"),
    ),
    "torsion stiffness -1": (
        lambda: Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0, torsion_stiffness=-1.0),
        ("torsion_stiffness = -1.0", "not be negative"),
    ),
    "drawn thicker than wide": (
        lambda: Draw(width=1.0, thickness=2.0),
        ("thickness = 2.0 m", "width = 1.0 m"),
    ),
    "drawn of no thickness": (
        lambda: Draw(width=1.0, thickness=0.0),
        ("thickness = 0.0", "above zero (m)"),
    ),
    "youngs modulus 0": (
        lambda: steel(youngs_modulus=0.0),
        ("youngs_modulus = 0.0", "above zero (N/m^2)"),
    ),
    "density -1": (lambda: steel(density=-1.0), ("density = -1.0", "above zero (kg/m^3)")),
    "density nan": (lambda: steel(density=NAN), ("density = nan", "finite number")),
    "youngs modulus 1e31": (
        lambda: steel(youngs_modulus=1e31),
        ("youngs_modulus = 1e+31", "at most 1e+30"),
    ),
    "poissons ratio 0.51": (
        lambda: steel(poissons_ratio=0.51),
        ("poissons_ratio = 0.51", "above -1", "at most 0.5"),
    ),
    "poissons ratio -1": (
        lambda: steel(poissons_ratio=-1.0),
        ("poissons_ratio = -1.0", "above -1"),
    ),
    "shear modulus 0": (lambda: steel(shear_modulus=0.0), ("shear_modulus = 0.0", "above zero")),
    "two shear moduli": (
        lambda: steel(poissons_ratio=0.3, shear_modulus=9e10),
        ("shear_modulus = 90000000000.0", "poissons_ratio = 0.3", "1e+11", "one of them"),
    ),
}

BEAMS = {
    "length 0": (lambda: truss(length=0.0), ("length = 0.0", "above zero (m)")),
    "no material": (
        lambda: Segment(length=1.0, section=ROUND),
        ("material is missing", "add material"),
    ),
    "material of a truss": (
        lambda: truss(material=STEEL),
        ("material", '"equivalent" section', "leave material out"),
    ),
    "shear of a truss": (
        lambda: truss(theory="timoshenko"),
        ('theory = "timoshenko"', "drawn section"),
    ),
    "taper from rigid torsion": (
        lambda: truss(section_end=TWISTS),
        ("torsion_stiffness", "0 in section", "5 in section_end", "0 is rigid"),
    ),
    "taper to a rigid rod": (
        lambda: truss(section=STRETCHES, section_end=TRUSS),
        ("axial_stiffness", "5 in section", "0 in section_end", "0 is rigid"),
    ),
    "theory": (
        lambda: drawn(theory="reissner"),
        ("theory = 'reissner'", "choose one of euler, timoshenko"),
    ),
    "shear factor without shear": (
        lambda: drawn(shear_factor=0.9),
        ("shear_factor", 'theory = "euler"', 'set theory = "timoshenko"'),
    ),
    "taper of two shapes": (
        lambda: drawn(section_end=Tube(outer_diameter=1.0, wall=0.1)),
        ('section_end has shape "tube"', '"round"', "same shape"),
    ),
    "nonstructural mass": (
        lambda: truss(nonstructural_mass=-0.5),
        ("nonstructural_mass = -0.5", "not be negative"),
    ),
    "no segment": (lambda: Beam(segments=()), ("no segment", "[[segment]]")),
    "1001 segments": (
        lambda: Beam(segments=(BAR,) * 1001),
        ("1001 segments", "at most 1000", "join"),
    ),
    "1001 lumps": (
        lambda: with_lumps(*[Lump(x=0.5, mass=1.0) for _ in range(1001)]),
        ("1001 lumps", "at most 1000", "nonstructural_mass"),
    ),
    "joint behind the tip": (
        lambda: with_joints(Joint(after_segment=1, stiffness_xy=1.0)),
        ("after_segment = 1", "between 0 (the root) and 0"),
    ),
    "two joints in a place": (
        lambda: with_joints(
            Joint(after_segment=0, stiffness_xy=1.0), Joint(after_segment=0, stiffness_xz=1.0)
        ),
        ("two joints", "after_segment = [0, 0]", "merge"),
    ),
    "joint without stiffness": (
        lambda: Joint(after_segment=0),
        ("joint", "give stiffness_xy, stiffness_xz or stiffness_torsion"),
    ),
    "joint before the root": (
        lambda: Joint(after_segment=-1, stiffness_xy=1.0),
        ("after_segment = -1", "whole number from 0"),
    ),
    "joint of stiffness 0": (
        lambda: Joint(after_segment=0, stiffness_xy=0.0),
        ("stiffness_xy = 0.0", "above zero", "rigid joint"),
    ),
    "lump behind the tip": (
        lambda: Beam(segments=(BAR,), lumps=(Lump(x=1.1, mass=1.0),)),
        ("lump.x = 1.1 m", "tip at 1.0 m"),
    ),
    "lump before the root": (lambda: Lump(x=-0.1, mass=1.0), ("x = -0.1", "not be negative")),
    "lump without mass": (lambda: Lump(x=0.0, mass=0.0), ("mass = 0.0", "above zero (kg)")),
    "inertia of no body": (
        lambda: Lump(x=0.0, mass=1.0, inertia=(1.0, 1.0, 2.1)),
        ("inertia = [1.0, 1.0, 2.1]", "no rigid body", "units"),
    ),
    "negative inertia": (
        lambda: Lump(x=0.0, mass=1.0, inertia=(1.0, 1.0, -1.0)),
        ("inertia[2] = -1.0", "not be negative"),
    ),
    "inertia of two numbers": (
        lambda: Lump(x=0.0, mass=1.0, inertia=(1.0, 2.0)),
        ("inertia = (1.0, 2.0)", "three numbers"),
    ),
    "unknown port": (
        lambda: unit_beam().port("zx"),
        ("port = 'zx'", "choose one of xy, xz, torsion, axial"),
    ),
    "61 modes": (lambda: unit_beam().port("xy", 61), ("modes = 61", "whole number from 0 to 60")),
    "half a mode": (lambda: unit_beam().port("xy", 2.0), ("modes = 2.0", "whole number")),
    "rigid in torsion": (
        lambda: port_of(TRUSS, "torsion"),
        ('port "torsion"', "no stiffness", "modes.torsion = 0"),
    ),
    "rigid along": (
        lambda: port_of(TRUSS, "axial"),
        ('port "axial"', "no stiffness", "modes.axial = 0"),
    ),
    "no inertia in torsion": (
        lambda: port_of(
            Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0, torsion_stiffness=1.0), "torsion"
        ),
        ('port "torsion"', "no polar inertia", "give polar_inertia"),
    ),
    "stiffness that underflows": (
        limp_port,
        ('port "torsion"', "stiffness 3e-300", "below 1e-200"),
    ),
    "uniform beam of length 0": (
        lambda: UniformBeam(0.0, 1.0, 1.0),
        ("length = 0.0", "above zero"),
    ),
    "uniform beam of negative stiffness": (
        lambda: UniformBeam(1.0, -1.0, 1.0),
        ("bending_stiffness = -1.0", "above zero"),
    ),
    "uniform beam of mass nan": (
        lambda: UniformBeam(1.0, 1.0, NAN),
        ("linear_mass = nan", "finite number"),
    ),
}

# -- modes: numbers, tables, matrices --------------------------------------------------------------
NUMBERS = ("rigid_mass", "frequencies", "participation")
MODES_KEYS = ("the keys of a modes file are frequencies, ",)
RESIDUAL = ("residual mass", "eigenvalue", "reference points", "units", "clamped nodes")
RIGHT_HANDED = ("axes = ", "perpendicular", "right-handed")


def changed(**factors):
    """Modes of a cloud of point masses, some of their numbers changed by functions."""
    data = Cloud(3).data()
    replace(data, **{key: change(getattr(data, key)) for key, change in factors.items()})


def with_number(key, place, value):
    data = Cloud(2).data()
    values = np.array(getattr(data, key))
    values.flat[place] = value
    replace(data, **{key: values})


def about_another_point():
    far = Cloud(3).data(point=(30.0, 0.0, 0.0))
    changed(participation=lambda _: far.participation)


def print_said_to_be_exact():
    truth = cantilever()
    rows = truth.participation * (1 + 1e-6)
    ModalData(truth.mass, truth.frequencies, rows, precision=1e-13)


def stated_too_short():
    fit(replace(modes_of_beam(tapered_boom(), {"xy": 1}), length=2.0, pieces=()))


def document(text):
    Path("a.json").write_text(text)
    read_modes("a.json")


def rod_of(**more):
    Path("modes.json").write_text(json.dumps(uniform_rod(length=8.0, **more)))
    fit(read_modes("modes.json"))


def line(**more):
    rod_of(line=[{"start": 0.0, "length": 8.0, **more}])


def points(*places):
    rod_of(points=[{"x": x, "mass": 15.0, "polar": 0.25} for x in places])


def table(change):
    """A modes file whose text is changed."""
    Path("a.toml").write_text(change(modes_text(tapered_boom(), {"xy": 3})))
    read_modes("a.toml")


def first_frequency(value):
    table(lambda text: re.sub(r"frequencies = \[[^,]*,", f"frequencies = [{value},", text))


def arrays(name="matrices.npz", **values):
    save = io.savemat if name.endswith("mat") else lambda path, held: np.savez(path, **held)
    save(name, values)
    read_modes(name)


def of_frame(elements, change, boundary):
    mass, stiffness = frame(elements)
    arrays(M=mass, K=change(stiffness), boundary=np.array(boundary))


def unchanged(values):
    return values


def mass_of_objects():
    held = {"K": frame(3)[1], "boundary": np.arange(6)}
    arrays("z.npz", M=np.array([{"a": 1}], dtype=object), **held)


def file_of(content, name):
    Path(name).write_bytes(content)
    read_modes(name)


MODES = {
    "mirrored axes": (
        lambda: Cloud(1).data().moved((0, 0, 0), np.diag([1.0, 1.0, -1.0])),
        RIGHT_HANDED,
    ),
    "stretched axes": (
        lambda: Cloud(1).data().moved((0, 0, 0), np.diag([1.0, 1.0, 1.1])),
        RIGHT_HANDED,
    ),
    "axes all alike": (lambda: Cloud(1).data().moved((0, 0, 0), np.ones((3, 3))), RIGHT_HANDED),
    "about another point": (about_another_point, RESIDUAL),
    "tonnes beside kilograms": (lambda: changed(rigid_mass=lambda mass: mass / 1e3), RESIDUAL),
    "mass not symmetric": (
        lambda: changed(rigid_mass=lambda mass: mass + np.outer(np.eye(6)[1], np.eye(6)[0])),
        ("not symmetric", "x, y", "one point"),
    ),
    **{
        f"nan in {key}": (
            partial(with_number, key, 1, np.nan),
            (key.removeprefix("rigid_"), "not a finite number", "export"),
        )
        for key in NUMBERS
    },
    **{
        f"8.8e306 in {key}": (
            partial(with_number, key, 0, 8.8e306),
            (f"{key.removeprefix('rigid_')} holds 8.8e+306", "up to 1e+50"),
        )
        for key in NUMBERS
    },
    "print said to be exact": (print_said_to_be_exact, ("residual mass",)),
    "mode 5 of 4": (lambda: Cloud(6).data().selected([5]), ("5 ", "holds modes 1 to 4")),
    "a mode twice": (lambda: Cloud(6).data().selected([1, 1]), ("[1, 1]", "only once")),
    "no mode": (lambda: Cloud(6).data().selected([]), ("[]", "at least one")),
    "length too short": (
        stated_too_short,
        ("length = 2 m", "does not hold the mass", "3.65385", "reference"),
    ),
    "line without polar": (
        lambda: line(mass=[3.75, 3.75]),
        ("line", "has 0 in (rotation x", "has 0.5", "leave line and points out"),
    ),
    "line of another polar": (
        lambda: line(mass=[3.75], polar=[0.625]),
        ("line", "has 5 in (rotation x", "has 0.5"),
    ),
    "points of less inertia": (
        lambda: points(3.0, 5.0),
        ("points", "has 510 in (rotation y", "has 640"),
    ),
    "points of another centre": (
        lambda: points(3.0, 5.5),
        ("points", "has 127.5 in (y, rotation z)", "has 120"),
    ),
    "table cut in half": (
        lambda: table(lambda text: text[: len(text) // 2]),
        ("a.toml'", "cut or mangled", "export it again"),
    ),
    "key with a slip": (
        lambda: table(lambda text: text.replace("participation", "particpation")),
        ("`particpation`", *MODES_KEYS),
    ),
    "mass of seven rows": (
        lambda: table(lambda text: text.replace("mass = [", "mass = [[1.0], ", 1)),
        ("mass has 7 rows", "6 rows"),
    ),
    "damping of 5": (
        lambda: table(lambda text: re.sub(r"damping = \[[^\]]*\]", "damping = 5.0", text)),
        ("damping = [5.0", "between 0 and 1"),
    ),
    "frequency nan": (lambda: first_frequency("nan"), ("frequencies", "not a finite number")),
    "frequency -1": (lambda: first_frequency(-1.0), ("frequency -1", "held at its port", "SPC")),
    "rows for columns": (
        lambda: document(
            json.dumps({"frequencies": [1.0, 2.0], "participation": [[0] * 6] * 2, "mass": []})
        ),
        ("participation has 2 rows of 6", "stands turned", "swap"),
    ),
    **{
        f"json {text}": (partial(document, text), ("a.json'", f"`{kind}`", *MODES_KEYS))
        for text, kind in (
            ("5", "int"),
            ("null", "null"),
            ("[1.0]", "array"),
            ('"matrices"', "str"),
        )
    },
    "boundary of five": (
        lambda: of_frame(3, unchanged, range(5)),
        ("boundary = [0, 1, 2, 3, 4]", "six different freedoms of the 24"),
    ),
    "springs to ground": (
        lambda: of_frame(3, lambda k: k + np.diag([0.0] * 20 + [50.0] * 4), range(6)),
        ("strains the structure", "boundary", "order x, y, z"),
    ),
    "triangle": (lambda: of_frame(3, np.triu, range(6)), ("not symmetric", "full matrix")),
    # rounding lets some of these be factored
    **{
        f"loose frame of {elements}": (
            partial(of_frame, elements, unchanged, [0, 1, 2, 3, 6, 7]),
            ("can still move", "check boundary"),
        )
        for elements in (2, 3, 5, 8)
    },
    "no zip file": (
        lambda: file_of(b"PK\3\4 cut", "x.npz"),
        ("x.npz'", "cannot be read", "save mass, stiffness and boundary"),
    ),
    "mass alone": (
        lambda: arrays("y.npz", M=frame(3)[0]),
        ("y.npz'", "holds no stiffness", "it holds M"),
    ),
    "mass of objects": (mass_of_objects, ("z.npz'", "cannot be read")),
}

# -- prints of Nastran -----------------------------------------------------------------------------
PLATE = plate().in_units(1e-3, 1e3)
FACTORS = "MODAL PARTICIPATION FACTORS"
EFFECTIVE_MASS = ("MEFFMASS(PRINT,ALL) = YES", "PARAM,GRDPNT,0")
THIRD_VALUE = r"(\n +3    \S+ +\S+ +\S+ +)(-?\d\S+)"


def printed(text, name="array.f06", **more):
    Path(name).write_bytes(text.encode())
    read_modes(name, **more)


def tables(*names, modes=PLATE):
    """The text of a print that holds these tables."""
    content = Print()
    for name in names:
        getattr(content, name)(modes)
    return content.text()


def mangled(change):
    """A print whose participation table is changed."""
    head, tail = whole(PLATE, "simcenter").split(FACTORS)
    printed(head + FACTORS + change(tail))


def third_value(put):
    mangled(lambda text: re.sub(THIRD_VALUE, put, text, count=1))


def one_per_cent_more(text):
    row = text.split("\n")[5]
    wrong = row.split()
    wrong[4] = f"{float(wrong[4]) * 1.01:.6E}"
    return text.replace(row, "    " + "  ".join(wrong))


def unclamped():
    frequencies = np.concatenate([[1e-4], PLATE.frequencies[1:]])
    printed(whole(Modes(frequencies, PLATE.participation, PLATE.mass)))


def two_runs(*heads):
    short = plate(length=0.3).in_units(1e-3, 1e3)
    first, second = tables("eigenvalues"), tables("eigenvalues", modes=short)
    printed(heads[0] + first + heads[1] + second)


def superelement_page(number):
    return f"0{'SUPERELEMENT':>100} {number}\n"


PRINTS = {
    "two subcases": (
        lambda: printed(whole(PLATE, subcases=(1, 4))),
        ("subcases 1, 4", "subcase = 1"),
    ),
    "a subcase without modes": (
        lambda: printed(whole(PLATE, subcases=(1, 4)), subcase=3),
        ("subcase = 3", "no modes", "1, 4"),
    ),
    "fractions alone": (
        lambda: printed(tables("eigenvalues", "fractions")),
        ("lost the signs", *EFFECTIVE_MASS),
    ),
    "effective masses alone": (
        lambda: printed(tables("eigenvalues", "fractions", "effective"), "b.f06"),
        ("lost the signs", *EFFECTIVE_MASS),
    ),
    "no rigid mass": (
        lambda: printed(tables("eigenvalues", "factors")),
        ("no rigid mass matrix", *EFFECTIVE_MASS),
    ),
    "not clamped": (unclamped, ("mode 1", "1e-08", "rigid body", "clamp the port (SPC)")),
    "a value that is nan": (lambda: third_value(r"\1NaN"), ("line 146", "'NaN' is no number")),
    "a value of stars": (
        lambda: third_value(r"\1************"),
        ("line 146", "'************' is no number"),
    ),
    "a value that is missing": (lambda: third_value(r"\1"), ("line 146", "7 columns instead of 8")),
    "a wrong digit": (
        lambda: mangled(one_per_cent_more),
        ("mode 1", "participation squared", "effective mass"),
    ),
    "two runs": (lambda: two_runs("", ""), ("mode 1 stands twice", "print one run only")),
    "two superelements": (
        lambda: two_runs(superelement_page(10), superelement_page(20)),
        ("mode 1 stands twice", "superelements", "BEGIN SUPER"),
    ),
    "empty print": (lambda: printed(""), ("is empty",)),
    "binary print": (lambda: printed("\0\1\2" * 50), ("no text",)),
    "no table": (
        lambda: printed("hello\n" * 100),
        ("no table of real eigenvalues", *EFFECTIVE_MASS),
    ),
    "no file": (lambda: read_modes("none.f06"), ("none.f06'", "does not exist")),
    "ending": (lambda: printed("x", "a.txt"), ("a.txt'", "unknown ending", ".f06, .op2")),
}

# -- superelements ---------------------------------------------------------------------------------
BOOM = se.superelement()
MATRICES = {"KXX": BOOM.stiffness, "MXX": BOOM.mass}
WING = {"KAA": se.wing_on_two_feet().stiffness, "MAA": se.wing_on_two_feet().mass}
GRIDS, FEET = se.asm_text(), se.feet_text()
UNITS = {"length": 1e-3, "mass": 1e3}
NO_FREE_FREE = ("Free-free modes without interface grids", "Craig-Bampton")
COUNTED = {"M": BOOM.mass, "K": BOOM.stiffness}
RENAMED = {"Mcb": BOOM.mass, "Kcb": BOOM.stiffness, "bset": np.arange(1, 19)}


def written(matrices=MATRICES, grids=GRIDS, name="boom"):
    """The path of an .op4 file, beside an .asm one where `grids` is a text."""
    if grids is not None:
        Path(f"{name}.asm").write_text(grids)
    content = matrices if isinstance(matrices, bytes) else se.op4_binary(matrices)
    Path(f"{name}.op4").write_bytes(content)
    return Path(f"{name}.op4").resolve()


def boom(matrices=MATRICES, grids=GRIDS, **more):
    read_modes(written(matrices, grids), **more)


def corner(card):
    """With another card of grid 27."""
    boom(grids=GRIDS.replace(",-300.0,12", card))


def wing(matrices, grids=FEET):
    read_modes(written(matrices, grids, "wing"))


def one_way_round(order):
    return {name: matrix[np.ix_(order, order)] for name, matrix in WING.items()}


def free_modes(grids):
    wing({"KAA": np.diag(np.r_[np.zeros(6), 10.0 * np.arange(1, 9)]), "MAA": np.eye(14)}, grids)


def grids_of_a_table():
    Path("modes.toml").write_text("frequencies = [1.0]")
    read_modes("modes.toml", grids=[InterfaceGrid(id=1, at=(0.0, 0.0, 0.0))])


def held_elsewhere():
    ground = np.diag([0.0] * 17 + [1e9] + [0.0] * 22)
    boom({**MATRICES, "KXX": BOOM.stiffness + ground})


def complex_numbers():
    boom(re.sub(r"       2KXX", "       4KXX", se.op4_text(MATRICES).decode()).encode())


def of_900000_rows():
    header = f"{5000:8d}{-900000:8d}{6:8d}{2:8d}{'KXX':<8}1P,3E23.16\n"
    boom(f"{header}{5001:8d}{1:8d}{1:8d}\n 1.0\n".encode())


def modes_before_the_interface():
    last = np.r_[18:40, 0:18]
    both = {name: matrix[np.ix_(last, last)] for name, matrix in COUNTED.items()}
    arrays("boom.npz", **both, boundary=np.arange(22, 40))


def new_matlab():
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    file_of(head + bytes(600), "new.mat")


def by_name(names):
    read_op4(written(WING, FEET, "wing"), names)


def turned(*axes):
    fit(spec_of({"imported": {"file": str(written()), "units": UNITS, "axes": list(axes)}}))


@cache
def mesh_with_port():
    return se.superelement(modes=200, port=True)


def boom_with_port():
    """A delivery with a fourth interface grid, the end of the mast, and every mode of the mesh."""
    found = mesh_with_port()
    grids = se.asm_text(found.mass.shape[0] - 24, port=True)
    return written({"KXX": found.stiffness, "MXX": found.mass}, grids)


def ports(**named):
    read_modes(boom_with_port(), ports=named)


def spec_with_port(**named):
    imported = {"file": str(boom_with_port()), "units": UNITS, "ports": named}
    return spec_of({"name": "boom", "imported": imported})


def carried_by_a_port():
    craft = """<mujoco><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="50" diaginertia="9 9 9"/><site name="mount"/>
<body name="dish" pos="1.6 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
</body></worldbody></mujoco>"""
    embed(craft, {"mount": spec_with_port(mast=se.PORT)}, carry={"mount:mast": ["dish"]})


DELIVERIES = {
    "grid off by a millimetre": (
        lambda: corner(",-301.0,12"),
        ("strains the structure (forces of", "most at grid", "component"),
    ),
    "grid in wrong axes": (
        lambda: corner(",-300.0,0"),
        ("most at grid 27, component", "check the places and axes of the grids"),
    ),
    "no such axes": (lambda: corner(",-300.0,13"), ("boom.asm'", "coordinate system 13")),
    "no grids": (lambda: boom(grids=None), ("boom.asm' does not exist", "asm", "give grids")),
    "held elsewhere": (held_elsewhere, ("held elsewhere too",)),
    "mass for stiffness": (
        lambda: wing({"KAA": WING["MAA"], "MAA": WING["KAA"]}),
        ("mass and stiffness are exchanged",),
    ),
    "own names": (
        lambda: wing({"KRED": WING["KAA"], "MRED": WING["MAA"]}),
        ("holds no mass", "it holds KRED, MRED", "EXTSEOUT, or rename the matrices"),
    ),
    "modes first": (
        lambda: wing(one_way_round(np.r_[12:26, :12])),
        ("can still move", "check grids and the order of the freedoms"),
    ),
    "free modes": (
        lambda: free_modes(FEET),
        ("matrices of 14 freedoms", "wing.asm make 26", *NO_FREE_FREE),
    ),
    "free modes without grids": (
        lambda: free_modes("SPOINT,5001,THRU,5014\n"),
        ("holds no GRID", *NO_FREE_FREE),
    ),
    "mass alone": (lambda: boom({"MXX": BOOM.mass}), ("holds no stiffness", "it holds MXX")),
    "mass of nine rows": (
        lambda: boom({**MATRICES, "MXX": BOOM.mass[:9, :9]}),
        ("mass (9, 9)", "stiffness (40, 40)", "one size"),
    ),
    "all twice": (
        lambda: boom(se.op4_binary(MATRICES) * 2),
        ("holds KXX more than once", "a file of its own"),
    ),
    "modes too few": (
        lambda: boom(grids=se.asm_text(modes=20)),
        ("matrices of 40 freedoms", "boom.asm make 38"),
    ),
    "asm of comments": (lambda: boom(grids="$ nothing\n"), ("boom.asm'", "holds no GRID")),
    "no such asm": (lambda: boom(asm="no.asm"), ("no.asm' does not exist", "check asm")),
    "grids of a table": (grids_of_a_table, ("grids", "'modes.toml'", "leave it out")),
    "complex numbers": (complex_numbers, ("KXX holds complex numbers", "[damping]")),
    "900000 rows": (of_900000_rows, ("KXX", "(900000, 5000)", "at most 4000 freedoms")),
    "900000 scalar points": (
        lambda: boom(grids="SPOINT,1,THRU,900000\n"),
        ("boom.asm'", "from 1 to 900000"),
    ),
    "npz without grids": (
        modes_before_the_interface,
        ("boundary = [22, ", "counted from 0", "six different freedoms", "give their places"),
    ),
    "mat without grids": (
        lambda: arrays("boom.mat", **COUNTED, boundary=np.arange(1, 19)),
        ("boundary = [1, 2, ", " 18]", "counted from 1"),
    ),
    **{
        f"{name} of own names": (
            partial(arrays, name, **RENAMED),
            ("holds no mass", "it holds Mcb, Kcb, bset", "rename"),
        )
        for name in ("own.mat", "own.npz")
    },
    "mat of v7.3": (new_matlab, ("new.mat'", "MATLAB v7.3", "save it with -v7")),
    "matrix by a wrong name": (lambda: by_name(["MUG1"]), ("holds no MUG1", "check its name")),
    "name for names": (lambda: by_name("MAA"), ("names = 'MAA'", 'names=["..."]')),
    "no such op4": (
        lambda: read_op4(Path("no.op4"), ["MAA"]),
        ("no.op4' does not exist", "give the path"),
    ),
    "turned about z": (
        lambda: turned([-1, 0, 0], [0, -1, 0], [0, 0, 1]),
        ("give axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",),
    ),
    "turned about y and z": (
        lambda: turned([-1, 0, 0], [0, 0, 1], [0, 1, 0]),
        ("give axes = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]",),
    ),
    "port at no grid": (
        lambda: ports(mast=46),
        ("ports.mast = 46", "no interface grid of 'boom.op4'", "3, 11, 27, 45"),
    ),
    "two ports at a grid": (
        lambda: ports(a=45, b=45),
        ("ports names a grid twice", "its own name"),
    ),
    "ports everywhere": (
        lambda: ports(a=45, b=3, c=11, d=27),
        ("none of its freedoms", "leave one out of ports"),
    ),
    "port that is text": (lambda: ports(a="x"), ("ports.a = 'x'", "whole number")),
    "carried by a port": (carried_by_a_port, ("port 'mast'", "free in its modes", "a beam")),
    "capital of a port": (
        lambda: spec_with_port(Mast=45),
        ("ports: 'Mast'", "small letter", "ports = { mast = 45 }"),
    ),
}

GROUPS = {"section": SECTIONS, "beam": BEAMS, "modes": MODES, "print": PRINTS}
REFUSED = {f"{kind}: {name}": row for kind, group in GROUPS.items() for name, row in group.items()}


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_structure_can_be_is_refused(case):
    check_refused(REFUSED[case][0], InputError, REFUSED[case][1])


@pytest.mark.parametrize("case", DELIVERIES)
def test_a_delivery_that_does_not_fit_together_is_refused(case):
    check_refused(DELIVERIES[case][0], InputError, DELIVERIES[case][1])


@pytest.mark.parametrize(
    ("thing", "field"), [(Round(diameter=1.0), "diameter"), (unit_beam(), "segments")]
)
def test_what_is_made_is_frozen(thing, field):
    with pytest.raises(AttributeError, match="immutable"):
        setattr(thing, field, ())


@pytest.mark.parametrize("kind", [BeamchainError, ValueError])
def test_errors_are_the_packages_and_pythons(kind):
    check_refused(lambda: steel(youngs_modulus=0.0), kind, ("youngs_modulus",))
