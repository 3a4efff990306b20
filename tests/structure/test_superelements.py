"""Superelements as they are delivered, against the whole mesh that they were made from
(`support/superelements.py`, which writes them and shares nothing with the readers)."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
import superelements as se
from refused import check_refused
from spec_tables import spec_of

EXACT = 1e-9  # of the mesh: modes by eigh, of which the lowest lose some digits to K
SINGLE = 2e-7  # relative to the largest entry: numbers of single precision
DIGITS = 5e-8  # eight printed digits of the modes; rounding of K adds to this
MUJOCO = 1e-8  # mjd_transitionFD with eps = 1e-6
AXES = np.eye(3)
FOUND = se.superelement()
MATRICES = {"KXX": FOUND.stiffness, "MXX": FOUND.mass}
OTHER = {"PX1": np.array([[0.0, 2.0], [1.0, 0.0]]), **MATRICES, "VA": np.ones((40, 1))}
UNITS = {"length": 1e-3, "mass": 1e3}
LENGTH = np.array([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])  # mm per m, in the columns of rotations

BINARY = [
    (form, order, wide, single)
    for form in ("dense", "sparse", "bigmat")
    for order in "<>"
    for wide, single in ((False, False), (True, False), (False, True))
]
TEXT = [
    (form, digits, letter)
    for form in ("dense", "sparse", "bigmat")
    for digits, letter in ((16, "E"), (16, "D"), (8, "E"))
]


def refused(path, *words):
    check_refused(lambda: bc.read_modes(path), bc.InputError, words)


@pytest.fixture
def delivery(tmp_path):
    """A folder with the assembly file."""
    (tmp_path / "boom.asm").write_text(se.asm_text())
    return tmp_path


def check_against_mesh(data, tolerance=EXACT):
    """Frequencies, participation but for signs, and rigid mass, in the file's units."""
    assert data.frequencies == pytest.approx(FOUND.frequencies, rel=tolerance)
    scale = np.sqrt(np.diag(FOUND.rigid))
    sign = np.sign(np.sum(data.participation * FOUND.participation / scale**2, axis=1))
    gap = (data.participation * sign[:, None] - FOUND.participation) / scale
    assert np.max(np.abs(gap)) < 30.0 * tolerance
    miss = (data.rigid_mass - FOUND.rigid) / np.outer(scale, scale)
    assert np.max(np.abs(miss)) < 10.0 * tolerance


@pytest.mark.parametrize(("form", "order", "wide", "single"), BINARY)
def test_binary_files_of_every_form_hold_the_mesh_s_modes(form, order, wide, single, delivery):
    path = delivery / "boom.op4"
    path.write_bytes(se.op4_binary(OTHER, form, order, wide, single))
    check_against_mesh(bc.read_modes(path), SINGLE if single else EXACT)


@pytest.mark.parametrize(("form", "digits", "letter"), TEXT)
def test_text_files_of_every_form_hold_the_mesh_s_modes(form, digits, letter, delivery):
    path = delivery / "boom.op4"
    path.write_bytes(se.op4_text(OTHER, form, digits, letter))
    data = bc.read_modes(path)
    check_against_mesh(data, EXACT if digits == 16 else DIGITS)
    if digits == 8:  # decimals: half a unit of the last
        assert data.precision == pytest.approx(0.5e-8)


def test_a_punch_file_holds_all_of_it(tmp_path):
    path = tmp_path / "boom.pch"
    path.write_text(se.punch_text(FOUND))
    check_against_mesh(bc.read_modes(path), DIGITS)


def test_the_grids_may_stand_in_the_specification(tmp_path):
    (tmp_path / "boom.op4").write_bytes(se.op4_binary(MATRICES, "bigmat"))
    grids = [
        {"id": g, "at": list(se.PLACES[g]), "axes": se.output_axes(g).tolist()} for g in se.GRIDS
    ]
    imported = {"file": str(tmp_path / "boom.op4"), "grids": grids, "length": 2.0, "units": UNITS}
    data = spec_of({"imported": imported}).imported.read()
    assert data.frequencies == pytest.approx(FOUND.frequencies, rel=EXACT)
    assert "of the specification held as one rigid body" in data.steps[0]
    # the same by rows, in another order of the grids
    moved = [grids[2] | {"row": 13}, grids[0] | {"row": 1}, grids[1] | {"row": 7}]
    again = spec_of({"imported": {**imported, "grids": moved}}).imported.read()
    np.testing.assert_allclose(again.rigid_mass, data.rigid_mass, rtol=1e-9, atol=1e-9)


def test_a_punch_file_is_held_in_the_components_that_are_stated(tmp_path):
    """With the displacements of three grids held, their rotations vibrate with the rest."""
    (tmp_path / "boom.pch").write_text(se.punch_text(FOUND))
    grids = [
        {"id": g, "at": list(se.PLACES[g]), "axes": se.output_axes(g).tolist(), "components": "123"}
        for g in se.GRIDS
    ]
    imported = {"file": str(tmp_path / "boom.pch"), "grids": grids, "length": 2.0, "units": UNITS}
    data = spec_of({"imported": imported}).imported.read()
    free = np.r_[3:6, 9:12, 15:18, 18:40]
    matrices = (m[np.ix_(free, free)] for m in (FOUND.stiffness, FOUND.mass))
    wanted = np.sqrt(eigh(*matrices, eigvals_only=True))
    assert data.frequencies == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("first", [0, 22])
def test_arrays_with_several_grids_in_their_boundary(first, delivery):
    """Grids first or last: `boundary` says so."""
    order = np.r_[0:40] if first == 0 else np.r_[18:40, 0:18]
    np.savez(
        delivery / "boom.npz",
        M=FOUND.mass[np.ix_(order, order)],
        K=FOUND.stiffness[np.ix_(order, order)],
        boundary=np.arange(first, first + 18),
    )
    check_against_mesh(bc.read_modes(delivery / "boom.npz", asm=delivery / "boom.asm"))


def test_the_order_that_a_punch_file_beside_states_is_taken(delivery):
    turned = np.r_[12:18, 0:12, 18:40]
    both = {name: matrix[np.ix_(turned, turned)] for name, matrix in MATRICES.items()}
    path = delivery / "boom.op4"
    path.write_bytes(se.op4_binary(both, "sparse"))
    refused(path, "strains")
    (delivery / "boom.pch").write_text(se.extrn_text((27, 3, 11)))
    check_against_mesh(bc.read_modes(path))


@pytest.mark.slow
def test_a_flexible_body_is_the_mesh_through_mujoco(delivery):
    """Fitted, written, and read back by MuJoCo's linearisation, in SI, appendage axes."""
    path = delivery / "boom.op4"
    path.write_bytes(se.op4_binary(MATRICES, "bigmat"))
    result = bc.fit(spec_of({"name": "boom", "imported": {"file": str(path), "units": UNITS}}))
    assert result.status.ok
    space = result.space.achieved
    assert space.frequencies[:22] == pytest.approx(FOUND.frequencies, rel=MUJOCO)
    effective = np.sum(result.space.data.participation**2, axis=0) / np.diag(
        result.space.data.rigid_mass
    )
    of_mesh = np.sum(FOUND.participation**2, axis=0) / np.diag(FOUND.rigid)
    assert effective == pytest.approx(of_mesh, rel=1e-8)
    assert result.space.error.participation < 1e-4
    assert result.space.error.accelerance_in_band < 1e-6


@pytest.mark.slow
def test_four_modes_of_twenty_two_keep_the_step_of_the_last(delivery):
    """A third of 2 / omega at least: fillers do not set the step (Euler's limit of one mode)."""
    path = delivery / "boom.op4"
    path.write_bytes(se.op4_binary(MATRICES, "dense"))
    imported = {"file": str(path), "units": UNITS, "modes": [1, 2, 3, 4]}
    result = bc.fit(spec_of({"name": "boom", "imported": imported}))
    assert result.space.data.modes == 22
    share = result.limits.largest_step["Euler"] * FOUND.frequencies[3] / 2.0

    assert share > 1.0 / 3.0


# -- rounding and strain ---------------------------------------------------------------------------
WING_MASS, WING_STIFFNESS = se.wing_on_two_feet().mass, se.wing_on_two_feet().stiffness
SOFTEST = np.sort(np.diag(WING_STIFFNESS)[:3])[0]  # N/mm, of a foot across the wing


@pytest.fixture
def wing(tmp_path):
    """Writes the delivery of the wing on two feet; returns its path."""

    def write(change=0.0, **text):
        (tmp_path / "wing.asm").write_text(se.feet_text(**text))
        both = {"KAA": WING_STIFFNESS + change, "MAA": WING_MASS}
        (tmp_path / "wing.op4").write_bytes(se.op4_binary(both))
        return tmp_path / "wing.op4"

    return write


def noise(size):
    """Symmetric noise in the stiffness of the feet [N/mm, N, N mm]."""
    out = np.zeros_like(WING_STIFFNESS)
    drawn = np.random.default_rng(0).normal(size=(12, 12))
    out[:12, :12] = size * (drawn + drawn.T) / 2.0
    return out


@pytest.mark.parametrize("size", [0.0, 1e-10, 1e-8, 1e-6])
def test_rounding_in_cells_that_are_zero_by_symmetry_is_no_strain(size, wing):
    """Condensing a mesh of stiff bars leaves such noise where a foot is soft."""
    assert 1e-4 * np.max(np.abs(WING_STIFFNESS)) > SOFTEST
    clean = bc.read_modes(wing())
    data = bc.read_modes(wing(noise(size)))
    assert data.frequencies == pytest.approx(clean.frequencies, rel=1e-9)


@pytest.mark.parametrize("row", range(3))
def test_a_soft_spring_to_ground_is_found_in_every_direction(row, wing):
    """A thousandth of the softest stiffness of a foot."""
    spring = np.zeros_like(WING_STIFFNESS)
    spring[row, row] = 1e-3 * SOFTEST
    refused(wing(spring), "strains", "held elsewhere too")


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("shift", [1.0, 10.0])
def test_a_foot_that_is_off_is_found_in_every_direction(axis, shift, wing):
    place = list(se.FEET[1])
    place[axis] += shift
    refused(wing(places={**se.FEET, 1: tuple(place)}), "strains", "places and axes")


def test_the_shipped_delivery_is_that_of_the_mesh():
    folder = Path(bc.__file__).parent / "examples" / "wing"
    for ending, text in se.shipped_wing().items():
        shipped = (folder / f"wing.{ending}").read_text()
        if ending != "op4":
            assert shipped == text
    found = se.wing_on_two_feet(se.SHIPPED)
    names = {"KAA": found.stiffness, "MAA": found.mass, "MUG1": found.corner, "MEF1": found.bar}
    for name, values in bc.spec.read_op4(folder / "wing.op4", list(names)).items():
        assert np.max(np.abs(values - names[name])) < EXACT * np.max(np.abs(names[name]))


def test_matrices_are_read_by_name(wing):
    path = wing()
    np.testing.assert_array_equal(bc.spec.read_op4(path, ["maa"])["MAA"], WING_MASS)


def test_a_foot_in_wrong_axes_is_found(wing):
    refused(wing(systems=(0, 0)), "forces of 1.0e+00 of", "places and axes")


# -- grids that the root does not hold -------------------------------------------------------------
WITH_PORT = se.superelement(modes=200, port=True)


@pytest.fixture
def with_port(tmp_path):
    """A delivery with a fourth interface grid, the end of the mast, and every mode of the mesh."""
    count = WITH_PORT.mass.shape[0] - 24
    (tmp_path / "boom.asm").write_text(se.asm_text(count, port=True))
    path = tmp_path / "boom.op4"
    both = {"KXX": WITH_PORT.stiffness, "MXX": WITH_PORT.mass}
    path.write_bytes(se.op4_binary(both, "bigmat"))
    return path


def test_a_port_is_free(with_port):
    """Cantilever modes are those with three grids held; the port moves in them as in the mesh."""
    data = bc.read_modes(with_port, ports={"mast": se.PORT})
    n = 30
    assert data.frequencies[:n] == pytest.approx(WITH_PORT.frequencies[:n], rel=1e-7)
    (mast,) = data.further
    assert mast.name == "mast"
    assert mast.place == pytest.approx([1600.0, 250.0 / 3.0, 0.0], rel=1e-12)
    scale = np.max(np.abs(WITH_PORT.motion[:n]), axis=0)
    weight = np.sqrt(np.diag(WITH_PORT.rigid))
    sign = np.sign(np.sum(data.participation[:n] * WITH_PORT.participation[:n] / weight**2, axis=1))
    gap = mast.motion[:n] * sign[:, None] - WITH_PORT.motion[:n]
    assert np.max(np.abs(gap / scale)) < 1e-5
    # held as well, it is not the cantilever that the modes are asked of
    assert bc.read_modes(with_port).frequencies[0] > 1.5 * data.frequencies[0]


def test_a_port_keeps_its_motion_in_other_axes_and_units(with_port):
    imported = {
        "file": str(with_port),
        "units": UNITS,
        "reference": [0.0, 250.0 / 3.0, 0.0],
        "axes": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        "ports": {"mast": se.PORT},
    }
    data = spec_of({"imported": imported}).imported.read()
    (mast,) = data.selected([1, 2, 3]).further
    assert mast.place == pytest.approx([1.6, 0.0, 0.0], abs=1e-12)
    moved = np.abs(mast.motion[:, [0, 2, 1]]) * np.sqrt(UNITS["mass"])
    np.testing.assert_allclose(moved, np.abs(WITH_PORT.motion[:3, :3]), rtol=1e-5, atol=1e-4)
    assert "grid 45 is free, as port 'mast'" in data.steps


# -- rounding of a delivery ------------------------------------------------------------------------
SHIPPED = se.wing_on_two_feet(se.SHIPPED)
UPRIGHT = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]


def shipped(folder, change=0.0, others=None, units=UNITS, **document):
    """The fit of the shipped wing, of stiffness that is `change`d [N/mm, N, N mm]."""
    (folder / "wing.asm").write_text(se.feet_text(document.pop("places", se.FEET), modes=8))
    both = {"KAA": SHIPPED.stiffness + change, "MAA": document.pop("mass", SHIPPED.mass)}
    (folder / "wing.op4").write_bytes(se.op4_binary(both | (others or {})))
    imported = {"file": str(folder / "wing.op4"), "axes": UPRIGHT, "units": units}
    return bc.fit(spec_of({"name": "wing", "imported": imported, **document}))


def codes_of(result):
    return {warning.code: str(warning) for warning in result.warnings}


def true_mass():
    """Of the whole mesh, held rigidly about the mean of its feet, in SI and the wing's axes."""
    mean = np.mean(list(se.FEET.values()), axis=0)
    motion = []
    for x, y, z in np.array(SHIPPED.nodes) - mean:
        turned = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        motion.append(np.block([[np.eye(3), turned], [np.zeros((3, 3)), np.eye(3)]]))
    metre = np.diag([1e3] * 3 + [1.0] * 3)
    rigid = np.vstack(motion) @ np.kron(np.eye(2), np.array(UPRIGHT).T) @ metre
    return 1e-3 * rigid.T @ SHIPPED.mesh_mass @ rigid  # 1 t mm^2 = 1e-3 kg m^2


def mass_error(data):
    """Of the rigid mass against the mesh's, relative."""
    scale = np.sqrt(np.diag(true_mass()))
    return np.max(np.abs((data.rigid_mass - true_mass()) / np.outer(scale, scale)))


@pytest.mark.slow
def test_rounding_between_interface_and_modes_is_no_coupling(tmp_path):
    """Noise in KAA[b, q] beside entries of 5e4 leaves modes and mass where they are."""
    drawn = 1e-6 * np.random.default_rng(0).standard_normal((12, 8))
    change = np.zeros_like(SHIPPED.stiffness)
    change[:12, 12:], change[12:, :12] = drawn, drawn.T
    result = shipped(tmp_path, change)
    assert result.status.ok
    assert "almost-rigid" not in codes_of(result)
    assert mass_error(result.space.data) < EXACT
    frequencies = bc.read_modes(tmp_path / "wing.op4").frequencies[:8]
    assert result.space.achieved.frequencies[:8] == pytest.approx(frequencies, rel=MUJOCO)


@pytest.mark.parametrize(("shift", "spoken"), [((1e-7, 0, 0), False), ((0, 0.1, 0), True)])
@pytest.mark.slow
def test_a_grid_that_is_off_by_what_the_strain_check_takes_is_fitted(shift, spoken, tmp_path):
    """The same delivery is not refused later; what it departs by is said, and bounds its error."""
    places = {**se.FEET, 1: tuple(np.add(se.FEET[1], shift))}
    result = shipped(tmp_path, places=places)
    assert result.status.ok
    said = codes_of(result).get("almost-rigid", "")
    assert bool(said) == spoken
    assert mass_error(result.space.data) < 3e-4  # the root moves with the grid as well
    if spoken:
        assert re.search(r"^wing.op4: .* by \d\.\de-0[567].* 8 characters.*a-set", said)


@pytest.mark.parametrize("digits", [5, 8])
@pytest.mark.slow
def test_matrices_of_few_digits_are_fitted(digits, tmp_path):
    """As DMIG writes them; every number of mass and stiffness rounded by itself."""

    def printed(values):
        return np.vectorize(lambda value: float(f"{value:.{digits - 1}e}"))(values)

    change = printed(SHIPPED.stiffness) - SHIPPED.stiffness
    if digits < 8:  # too few for the stiffness, whose forces cancel
        change = np.zeros_like(change)
    result = shipped(tmp_path, change, mass=printed(SHIPPED.mass))
    assert result.status.ok
    assert mass_error(result.space.data) < 10.0 ** (2 - digits)


@pytest.mark.parametrize("change", ["direction", "freedom"])
def test_a_mass_that_is_no_body_s_is_refused_still(change, tmp_path):
    """Half a per cent more in one direction; or a mass without what moves in one component."""
    mass = SHIPPED.mass.copy()
    if change == "direction":
        mass[0, 0] *= 1.005
        mass[0, 0] += 0.005 * 3.066e-3
    else:
        mass[2, :] = mass[:, 2] = 0.0
    with pytest.raises(bc.BeamchainError, match="a-set") as caught:
        shipped(tmp_path, mass=mass)
    assert "weight generator" not in str(caught.value)


@pytest.mark.slow
def test_damping_that_is_ignored_is_named(tmp_path):
    others = dict.fromkeys(("K4AA", "BAA"), 0.02 * SHIPPED.stiffness)
    said = codes_of(shipped(tmp_path, others=others))["ignored-damping"]
    for words in ("wing.op4", "K4AA and BAA", "are ignored", "[damping]", "undamped"):
        assert words in said
