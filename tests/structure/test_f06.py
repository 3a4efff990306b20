"""Nastran prints: every style read to its printed digits,
everything cut or mangled refused with a sentence that " "helps."""

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
    assert "the file's reference point is the origin of the basic axes" in steps


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
    with pytest.raises(InputError, match=r"subcases 1, 4; choose one with subcase = 1"):
        read_modes(path)
    assert read_modes(path, subcase=4).modes == 21
    with pytest.raises(InputError, match="subcase = 3 holds no modes"):
        read_modes(path, subcase=3)


def test_fractions_alone_are_refused_with_what_to_ask_for(tmp_path):
    content = Print()
    content.eigenvalues(PLATE)
    content.fractions(PLATE)
    with pytest.raises(
        InputError, match=r"lost the signs.*MEFFMASS\(PRINT,ALL\) = YES.*PARAM,GRDPNT,0"
    ):
        read_modes(written(tmp_path, content.text()))
    content.effective(PLATE)
    with pytest.raises(InputError, match="lost the signs"):
        read_modes(written(tmp_path, content.text(), "b.f06"))


def test_no_rigid_mass_is_refused(tmp_path):
    content = Print()
    content.eigenvalues(PLATE)
    content.factors(PLATE)
    with pytest.raises(InputError, match=r"no rigid mass matrix.*GRDPNT"):
        read_modes(written(tmp_path, content.text()))


def test_an_unclamped_run_is_refused(tmp_path):
    free = Modes(np.concatenate([[1e-4], PLATE.frequencies[1:]]), PLATE.participation, PLATE.mass)
    with pytest.raises(InputError, match="rigid body; clamp the port"):
        read_modes(written(tmp_path, whole(free)))


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


@pytest.mark.parametrize(
    ("find", "put", "words"),
    [
        (r"(\n +3    \S+ +\S+ +\S+ +)(-?\d\S+)", r"\1NaN", "no number"),
        (r"(\n +3    \S+ +\S+ +\S+ +)(-?\d\S+)", r"\1************", "no number"),
        (r"(\n +3    \S+ +\S+ +\S+ +)(-?\d\S+)", r"\1", "columns"),
    ],
)
def test_mangled_rows_are_refused(tmp_path, find, put, words):
    head, tail = whole(PLATE, "simcenter").split("MODAL PARTICIPATION FACTORS")
    mangled, count = re.subn(find, put, tail, count=1)
    assert count == 1
    with pytest.raises(InputError, match=words):
        read_modes(written(tmp_path, head + "MODAL PARTICIPATION FACTORS" + mangled))


def test_a_wrong_digit_contradicts_the_effective_mass(tmp_path):
    head, tail = whole(PLATE, "simcenter").split("MODAL PARTICIPATION FACTORS")
    row = tail.split("\n")[5]
    wrong = row.split()
    wrong[4] = f"{float(wrong[4]) * 1.01:.6E}"
    with pytest.raises(InputError, match=r"mode 1: participation squared .* effective mass"):
        read_modes(
            written(
                tmp_path,
                head + "MODAL PARTICIPATION FACTORS" + tail.replace(row, "    " + "  ".join(wrong)),
            )
        )


def test_what_is_no_print_is_refused(tmp_path):
    with pytest.raises(InputError, match="is empty"):
        read_modes(written(tmp_path, ""))
    with pytest.raises(InputError, match="no text"):
        read_modes(written(tmp_path, "\0\1\2" * 50))
    with pytest.raises(InputError, match="no table of real eigenvalues"):
        read_modes(written(tmp_path, "hello\n" * 100))
    with pytest.raises(InputError, match="does not exist"):
        read_modes(tmp_path / "none.f06")
    with pytest.raises(InputError, match="unknown ending"):
        read_modes(written(tmp_path, "x", "a.txt"))


def test_o8_as_a_print(tmp_path):
    data = read_modes(written(tmp_path, whole(cantilever(0.4), weight=True)))
    assert data.frequencies[:4] / (2 * np.pi) == pytest.approx(
        [63.70329, 63.70329, 319.9485, 319.9485], rel=DIGITS
    )
    # the pairs are turned back into the planes
    assert data.belongs == ("xy", "xz", "xy", "xz", "axial")
    assert float(data.leaks.max()) < 1e-5


def test_superelements_are_named(tmp_path):
    """Two superelements, each with its own mode 1;
    a second run of the same model is another matter."""
    first = Print()
    second = Print()
    first.eigenvalues(PLATE)
    second.eigenvalues(plate(length=0.3).in_units(1e-3, 1e3))
    with pytest.raises(
        InputError, match=r"mode 1 stands twice in the .* table .*; print one run only"
    ):
        read_modes(written(tmp_path, first.text() + second.text()))
    page = f"0{'SUPERELEMENT':>100} {{}}\n"
    content = page.format(10) + first.text() + page.format(20) + second.text()
    with pytest.raises(
        InputError,
        match=r"mode 1 stands twice .* because the print holds superelements, .*BEGIN SUPER",
    ):
        read_modes(written(tmp_path, content))
    assert read_modes(written(tmp_path, page.format(10) + whole(PLATE))).modes == 21
