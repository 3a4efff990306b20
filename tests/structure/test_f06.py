"""Nastran prints: every style read to its printed digits, everything cut refused."""

import re

import numpy as np
import pytest

from beamchain import InputError, read_modes
from prints import Modes, Print, cantilever, plate, whole

# half a unit in the seventh printed digit, and a little for the square root of the eigenvalue
DIGITS = 6e-7
PLATE = plate().in_units(1e-3, 1e3)
UNITS = {"length": 1e-3, "mass": 1e3}


def written(tmp_path, content: str, name: str = "array.f06"):
    path = tmp_path / name
    path.write_bytes(content.encode())
    return path


def test_the_plate_is_a_plate():
    # a very slender one bends as a beam: 3.5160153 sqrt(EI / m) / L^2
    thin = plate(3, length=2.0, width=0.02, thickness=1e-3)
    assert thin.frequencies[0] == pytest.approx(
        3.5160153 * np.sqrt(7.1e10 / 12.0 / 2750.0) * 1e-3 / 4.0, rel=1e-2
    )


@pytest.mark.parametrize("style", ["msc", "simcenter"])
@pytest.mark.parametrize("rows", [50, 20, 7, 1])
def test_every_style_and_page_length(tmp_path, style, rows):
    data = read_modes(written(tmp_path, whole(PLATE, style, rows)), units=UNITS)
    truth = plate()
    scale = np.sqrt(np.diag(truth.mass))
    assert data.frequencies == pytest.approx(truth.frequencies, rel=DIGITS)
    assert np.max(np.abs(data.participation - truth.participation) / scale) < DIGITS
    assert np.max(np.abs(data.rigid_mass - truth.mass) / np.outer(scale, scale)) < 2e-6
    assert data.modes == 21
    assert not any("generalized mass" in step for step in data.steps)


def test_rescaled_modes_are_normalised(tmp_path):
    # as with MAX normalisation: generalized masses that are not one
    generalized = np.geomspace(1e-6, 3.0, 21)
    data = read_modes(
        written(
            tmp_path, whole(Modes(PLATE.frequencies, PLATE.participation, PLATE.mass, generalized))
        ),
        units=UNITS,
    )
    assert np.abs(data.participation) == pytest.approx(
        np.abs(plate().participation), rel=3e-6, abs=1e-12
    )
    assert any("generalized mass" in step for step in data.steps)


def test_the_reference_point_is_stated(tmp_path):
    steps = read_modes(written(tmp_path, whole(PLATE)), units=UNITS).steps
    assert any("reference point" in step and "basic axes" in step for step in steps)


def test_exponents_without_a_letter_and_with_d(tmp_path):
    content = whole(PLATE).replace("0.000000E+00", "1.234567-101").replace("E-05", "D-05")
    data = read_modes(written(tmp_path, content), units=UNITS)
    assert data.frequencies == pytest.approx(plate().frequencies, rel=DIGITS)


def test_the_weight_generator_s_mass_counts_the_clamped_nodes(tmp_path):
    heavy = Modes(
        PLATE.frequencies, PLATE.participation, PLATE.mass + np.diag([1e-5, 1e-5, 1e-5, 0, 0, 0])
    )
    content = Print()
    content.weight(heavy)
    content = content.text() + whole(PLATE)
    data = read_modes(written(tmp_path, content), units=UNITS)
    assert data.rigid_mass[0, 0] == pytest.approx(heavy.mass[0, 0] * 1e3, rel=1e-6)
    assert any("clamped nodes included" in step for step in data.steps)


def test_a_contradicting_weight_generator_is_not_taken(tmp_path):
    # WTMASS: the generator prints weight
    light = Modes(PLATE.frequencies, PLATE.participation, PLATE.mass * 0.00259)
    content = Print()
    content.weight(light)
    data = read_modes(written(tmp_path, content.text() + whole(PLATE)), units=UNITS)
    assert data.rigid_mass[0, 0] == pytest.approx(plate().mass[0, 0], rel=1e-6)
    assert any("WTMASS" in step for step in data.steps)


def test_several_subcases(tmp_path):
    path = written(tmp_path, whole(PLATE, subcases=(1, 4)))
    assert read_modes(path, subcase=4).modes == 21


def test_every_cut_is_refused_or_complete(tmp_path):
    """A print cut anywhere either still holds everything or is refused;
    it never gives other numbers."""
    content = whole(PLATE)
    lines = content.splitlines(keepends=True)
    truth = read_modes(written(tmp_path, content), units=UNITS)
    sentences: list[str] = []
    for at in range(1, len(lines), 3):
        path = written(tmp_path, "".join(lines[:at]), "cut.f06")
        try:
            data = read_modes(path, units=UNITS)
        except InputError as error:
            sentences.append(str(error))
        else:
            assert np.array_equal(data.participation, truth.participation)
    assert len(sentences) > 20
    assert all(
        re.search(r"cut|MEFFMASS|damaged|empty|run it again", sentence) for sentence in sentences
    )


def test_o8_as_a_print(tmp_path):
    data = read_modes(written(tmp_path, whole(cantilever(0.4), weight=True)))
    assert data.frequencies[:4] / (2 * np.pi) == pytest.approx(
        [63.70329, 63.70329, 319.9485, 319.9485], rel=DIGITS
    )
    # the pairs are turned back into the planes
    assert data.belongs == ("xy", "xz", "xy", "xz", "axial")
    assert float(data.leaks.max()) < 1e-5


def test_a_run_of_one_superelement_is_read(tmp_path):
    page = f"0{'SUPERELEMENT':>100} 10\n"
    assert read_modes(written(tmp_path, page + whole(PLATE))).modes == 21
