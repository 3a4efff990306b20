"""Imported modes: the same physics from any axes, point and units; checks; files; matrices."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy import io
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from appendages import panels, tapered_boom
from beamchain import Beam, Equivalent, InputError, Lump, ModalData, Segment, fit, read_modes
from beamchain.spec import InterfaceGrid
from finite_elements import PORTS, into_space
from formulas import Moments
from modes_of_beam import delivered, modes_of_beam, modes_text
from prints import cantilever, plate
from textbook_modes import Cloud, frame, uniform_rod

SAME = 1e-9  # the bound: same physics in any axes, about any point, in any units
PRINT = 5e-7  # relative precision of seven printed digits


def same(a: ModalData, b: ModalData, tolerance: float = SAME) -> None:
    assert a.frequencies == pytest.approx(b.frequencies, rel=tolerance)
    assert np.max(np.abs((a.participation - b.participation) / b.scale)) < tolerance
    assert np.max(np.abs((a.rigid_mass - b.rigid_mass) / np.outer(b.scale, b.scale))) < tolerance


@settings(max_examples=12, deadline=None, derandomize=True, phases=[Phase.generate])
@given(
    seed=st.integers(0, 10_000),
    angles=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    point=st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    length=st.sampled_from([1.0, 1e-3, 0.0254, 0.3048]),
    mass=st.sampled_from([1.0, 1e3, 0.45359237, 175.126835]),
)
def test_any_axes_point_and_units(seed, angles, point, length, mass):
    cloud = Cloud(seed)
    axes = Rotation.from_euler("xyz", angles).as_matrix()  # rows: the file's axes in appendage axes
    stored = cloud.data(point, axes, length, mass)
    # the port (appendage origin) from the file's point, in the file's axes and units;
    # appendage axes in the file's
    back = stored.moved(axes @ -np.array(point) / length, axes.T).scaled(length, mass)
    same(back, cloud.data())


def test_printed_rounding_is_settled_and_told():
    truth = cantilever()
    data = ModalData(truth.mass, truth.frequencies, truth.participation, precision=PRINT)
    residual = data.port("xy").residual_mass
    assert residual[0, 0] == pytest.approx(5.30144, abs=2e-5)  # the clamped node's own
    assert residual[1, 1] == 0.0
    assert residual[0, 1] == 0.0
    assert any("printed precision" in step for step in data.steps)


@pytest.mark.parametrize("turn", [0.0, 0.3, 0.7853981633974483, 1.4])
def test_degenerate_pairs_turn_into_the_planes(turn):
    truth = cantilever(turn)
    data = ModalData(
        truth.mass, truth.frequencies, truth.participation, precision=PRINT
    ).untangled()
    assert data.belongs == ("xy", "xz", "xy", "xz", "axial")
    assert float(data.leaks.max()) < 20 * PRINT
    for port in ("xy", "xz"):
        plain = data.port(port, own=True)
        assert np.abs(plain.participation) == pytest.approx(
            np.array([[3.462030, 2.774607], [1.979560, 0.5036983]]), rel=3 * PRINT
        )


def test_leak_is_the_part_outside_the_port():
    rows = np.zeros((1, 6))
    rows[0, [2, 3]] = 0.6, 0.2
    data = ModalData(np.diag([1.0, 1.0, 1.0, 4.0, 4.0, 4.0]), np.array([2.0]), rows)
    assert data.belongs == ("xz",)
    assert data.leaks[0] == pytest.approx(0.1 / np.hypot(0.6, 0.1), rel=1e-12)


def test_port_models_are_blocks_of_space():
    data = Cloud(5).data()
    omega = np.array([0.3, 7.0, 60.0])
    for port in PORTS:
        motion = into_space(port)
        block = np.einsum("ai,abf,bj->ijf", motion, data.space().D(omega), motion)
        assert data.port(port).D(omega) == pytest.approx(
            block, rel=1e-9, abs=1e-12 * np.max(np.abs(block))
        )


def test_selected_modes():
    data = Cloud(6).data()
    assert data.selected([4, 2]).frequencies.tolist() == data.frequencies[[1, 3]].tolist()


# -- files -----------------------------------------------------------------------------------------
@pytest.mark.parametrize("make", [panels, tapered_boom])
def test_a_file_gives_the_same_numbers(tmp_path, make):
    kept = {"xy": 2, "xz": 2, "torsion": 1}
    wanted = delivered(make(), kept)
    path = tmp_path / "array.toml"
    path.write_text(modes_text(make(), kept))
    back = read_modes(path)
    same(back, ModalData(wanted.mass, wanted.frequencies, wanted.participation), 1e-15)
    assert back.length == wanted.length
    a = back.line()
    b = make().line
    for x in np.linspace(0.05, 0.99, 7) * b.length:
        assert a.moments([0.0, x]) == pytest.approx(b.moments([0.0, x]), rel=1e-12, abs=1e-15)


def test_modes_that_are_not_mass_normalised_state_their_generalized_mass(tmp_path):
    """Participation factors are `phi^T M R / m`; those of unit mass are their root of m times."""
    path = tmp_path / "a.json"
    rod = uniform_rod()
    path.write_text(json.dumps(rod))
    plain = read_modes(path)
    modal = np.geomspace(0.2, 9.0, plain.modes)
    factors = np.array(rod["participation"]) / np.sqrt(modal)
    more = {"participation": factors.tolist(), "generalized_mass": modal.tolist()}
    path.write_text(json.dumps(rod | more))
    same(read_modes(path), plain)


@pytest.mark.parametrize(("ratio", "says"), [(-0.01, "damping"), (1.0, "damping"), (0.99, None)])
def test_damping_ratios_of_a_file_lie_below_one(ratio, says, tmp_path):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(uniform_rod(damping=ratio)))
    if says is None:
        assert set(read_modes(path).damping.tolist()) == {ratio}
    else:
        with pytest.raises(InputError, match=says):
            read_modes(path)


def test_typed_numbers_count_their_digits(tmp_path):
    rows = np.array2string(
        plate(3).participation.T, separator=", ", formatter={"float": lambda v: f"{v:.6e}"}
    )
    mass = np.array2string(plate(3).mass, separator=", ", formatter={"float": lambda v: f"{v:.6e}"})
    hertz = (plate(3).frequencies / 2 / np.pi).tolist()
    path = tmp_path / "a.toml"
    path.write_text(
        f"frequencies_hz = {hertz}\nparticipation = {rows}\nmass = {mass}\ndamping = 0.005\n"
    )
    data = read_modes(path)
    assert data.precision == pytest.approx(PRINT)
    assert data.frequencies == pytest.approx(plate(3).frequencies, rel=1e-12)
    assert data.damping.tolist() == [0.005] * 3


# -- matrices --------------------------------------------------------------------------------------
def from_matrices(folder, mass, stiffness, boundary):
    """The modes of two matrices, by way of a file of NumPy's."""
    np.savez(folder / "matrices.npz", M=mass, K=stiffness, boundary=np.array(list(boundary)))
    return read_modes(folder / "matrices.npz")


def test_matrices_give_the_frame_s_modes(tmp_path):
    m, k = frame()
    data = from_matrices(tmp_path, m, k, range(6))
    assert data.rigid_mass[0, 0] == pytest.approx(3.0, rel=1e-12)
    assert data.rigid_mass[5, 5] == pytest.approx(1.5 * 8.0 / 3.0, rel=1e-12)
    squares, shapes = eigh(k[6:, 6:], m[6:, 6:])
    assert data.frequencies[:10] == pytest.approx(np.sqrt(squares[:10]), rel=1e-8)
    rigid = np.tile(np.eye(6), (7, 1))
    for node in range(7):
        x = node * 2.0 / 6
        rigid[6 * node + 1, 5], rigid[6 * node + 2, 4] = x, -x
    rows = (shapes.T @ (m @ rigid)[6:])[:10]
    assert np.abs(data.participation[:10]) == pytest.approx(np.abs(rows), rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_matrices_in_any_unit_have_the_same_modes(unit, tmp_path):
    m, k = frame()
    plain, scaled = (from_matrices(tmp_path, u * m, u * k, range(6)) for u in (1.0, unit))
    assert scaled.frequencies[:10] == pytest.approx(plain.frequencies[:10], rel=1e-8)
    assert scaled.rigid_mass == pytest.approx(unit * plain.rigid_mass, rel=1e-9, abs=1e-9 * unit)


def test_craig_bampton_form_and_files(tmp_path):
    m, k = frame()
    whole = from_matrices(tmp_path, m, k, range(6))
    count = 12  # reduced by hand: six port freedoms and twelve modes
    cb_m = np.eye(6 + count)
    cb_m[:6, :6] = whole.rigid_mass
    cb_m[:6, 6:] = whole.participation[:count].T
    cb_m[6:, :6] = whole.participation[:count]
    cb_k = np.diag(np.concatenate([np.zeros(6), whole.frequencies[:count] ** 2]))
    np.savez(tmp_path / "cb.npz", M=cb_m, K=cb_k, boundary=np.arange(6))
    io.savemat(tmp_path / "cb.mat", {"M": cb_m, "K": cb_k, "boundary": np.arange(1, 7)})
    for name in ("cb.npz", "cb.mat"):
        data = read_modes(tmp_path / name)
        assert data.frequencies == pytest.approx(whole.frequencies[:count], rel=1e-9)
        assert np.abs(data.participation) == pytest.approx(
            np.abs(whole.participation[:count]), rel=1e-6, abs=1e-8
        )


@pytest.mark.parametrize("elements", [6, 20, 40])
@pytest.mark.parametrize(
    "grids", [None, [InterfaceGrid(id=1, at=(0.0, 0.0, 0.0))]], ids=["boundary", "grid"]
)
def test_rounding_of_a_reduction_is_no_support(tmp_path, elements, grids):
    """A product of three matrices leaves some 1e-16 of the largest stiffness at the port, where
    nothing else stands."""
    m, k = frame(elements)
    squares, shapes = eigh(k[6:, 6:], m[6:, 6:])
    down = np.zeros((m.shape[0], 18))
    down[:6, :6] = np.eye(6)
    down[6:, :6] = -np.linalg.solve(k[6:, 6:], k[6:, :6])
    down[6:, 6:] = shapes[:, :12]
    mass, stiffness = down.T @ m @ down, down.T @ k @ down
    assert np.max(np.abs(stiffness[:6])) > 0.0

    def read(stiffness):
        np.savez(tmp_path / "cb.npz", M=mass, K=stiffness, boundary=np.arange(6))
        return read_modes(tmp_path / "cb.npz", **({} if grids is None else {"grids": grids}))

    data = read(stiffness)
    assert data.frequencies == pytest.approx(np.sqrt(squares[:12]), rel=1e-7)
    assert data.rigid_mass[0, 0] == pytest.approx(3.0, rel=1e-9)
    # a spring on which the whole goes at a hundredth of the first frequency is one
    for row, inertia in ((1, 3.0), (5, 1.5 * 8.0 / 3.0)):
        held = stiffness.copy()
        held[row, row] += 1e-4 * squares[0] * inertia
        with pytest.raises(InputError, match="strains"):
            read(held)


# -- the mass line ---------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("mass", "centre", "gyration"),
    [(3.0, 0.5, 0.2887), (3.0, 0.5, 0.36), (3.0, 0.3, 0.2), (3.0, 0.8, 0.1)],
)
def test_spread_mass_has_the_moments_it_was_made_from(mass, centre, gyration):
    rigid = np.diag([mass, mass, mass, 0.2, *[mass * (gyration**2 + centre**2)] * 2])
    rigid[1, 5] = rigid[5, 1] = mass * centre
    rigid[2, 4] = rigid[4, 2] = -mass * centre
    line = ModalData(
        rigid, np.array([1.0]), np.array([[0.0, 0.1, 0.0, 0.0, 0.0, 0.0]]), length=1.0
    ).line()
    total = Moments(*line.moments([0.0, 1.0])[0])
    assert (total.mass, total.first, total.polar) == pytest.approx(
        (mass, mass * centre, 0.2), rel=1e-9
    )
    assert total.second + total.rotary_xy == pytest.approx(rigid[5, 5], rel=1e-9)
    assert total.second + total.rotary_xz == pytest.approx(rigid[4, 4], rel=1e-9)
    assert line.behind(np.array([-1.0]))[0] == pytest.approx(rigid, rel=1e-9, abs=1e-12)
    edges = np.linspace(0.0, 1.0, 30)
    pieces = line.moments(edges)[:, 0]
    assert min(pieces) >= 0.0
    assert sum(pieces) == pytest.approx(mass, rel=1e-12)


def test_the_length_of_a_uniform_line():
    rigid = np.diag([3.0, 3.0, 3.0, 0.0, 1.0, 1.0])
    rigid[1, 5] = rigid[5, 1] = 1.5
    rigid[2, 4] = rigid[4, 2] = -1.5
    uniform = ModalData(rigid, np.array([1.0]), np.array([[0.0, 0.1, 0.0, 0.0, 0.0, 0.0]]))
    assert uniform.line().length == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("length", [{}, {"length": 8.0}])
def test_a_line_with_the_moments_of_the_rigid_mass_gives_the_length(tmp_path, length):
    line = [{"start": 0.0, "length": 8.0, "mass": [3.75], "polar": [0.0625]}]
    (tmp_path / "modes.json").write_text(json.dumps(uniform_rod(line=line, **length)))
    result = fit(read_modes(tmp_path / "modes.json"))
    assert result.status.ok
    assert result.chain.length == 8.0


def test_an_estimated_length_holds_the_mass():
    """Most of the mass near the root: a uniform piece with its centre and gyration is too short,
    for mass on [0, L] has x (L - x) >= 0 everywhere."""
    root, boom, tip = 60.0, 0.4 * 5.0, 3.0  # kg at 0.125 m, along 5 m, at the end
    mass = root + boom + tip
    first = root * 0.125 + boom * 2.5 + tip * 5.0
    second = root * 0.125**2 + boom * 25.0 / 3.0 + tip * 25.0
    beam = Beam(
        segments=(
            Segment(length=5.0, section=Equivalent(bending_stiffness_xy=2e3, linear_mass=0.4)),
        ),
        lumps=(Lump(x=0.125, mass=root), Lump(x=5.0, mass=tip)),
    )
    data = modes_of_beam(beam, {"xy": 2, "xz": 2})
    result = fit(replace(data, length=None, pieces=(), points=np.zeros((0, 5))))
    assert result.status.ok
    assert first / mass + np.sqrt(3.0 * (second / mass - (first / mass) ** 2)) < second / first
    assert result.chain.length == pytest.approx(second / first, rel=SAME)
    assert np.diag(result.chain.rigid_mass())[[1, 5]] == pytest.approx([mass, second], rel=SAME)
    assert result.space.error.frequency < SAME


def with_noise(matrix: np.ndarray, share: float) -> np.ndarray:
    """A symmetric matrix with noise of a share of its largest entry in all of them."""
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, matrix.shape)
    upper = np.triu(drawn) * share * np.max(matrix)
    return matrix + upper + np.triu(upper, 1).T


def flat_panel() -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness of a lamina of 21.6 kg, 6 m and 1.2 m, whose inertia lies on the edge of
    what a body can have: six modes of bending, one in its plane, and five of torsion of the
    uniform cantilever."""
    m, length, wide = 21.6, 6.0, 1.2
    along, across = m * length**2 / 3.0, m * wide**2 / 12.0
    rigid = np.diag([m, m, m, across, along, along + across])
    rigid[1, 5] = rigid[5, 1] = m * length / 2.0
    rigid[2, 4] = rigid[4, 2] = -m * length / 2.0
    roots = np.array([1.8751041, 4.6940911, 7.8547574, 10.9955407, 14.1371684, 17.2787595])
    moved = 2.0 * (np.sinh(roots) - np.sin(roots)) / (np.cosh(roots) + np.cos(roots)) / roots
    odd = 2.0 * np.arange(5) + 1.0
    rows = np.zeros((12, 6))
    rows[:6, 2], rows[:6, 4] = np.sqrt(m) * moved, -np.sqrt(m) * 2.0 / roots**2 * length
    rows[6, 1], rows[6, 5] = np.sqrt(m) * moved[0], np.sqrt(m) * 2.0 / roots[0] ** 2 * length
    rows[7:, 3] = np.sqrt(8.0 * across) / np.pi / odd
    squares = np.concatenate([12.34 * (roots / roots[0]) ** 2, [739.0], 123.0 * odd]) ** 2
    mass = np.block([[rigid, rows.T], [rows, np.eye(12)]])
    return mass, np.diag(np.concatenate([np.zeros(6), squares]))


def condensed_boom(length: float, modes: int, tip: float) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness of the frame with a body at its tip, over the root's motions and the
    first modes with the root held."""
    m, k = frame(8, length)
    m[-6:, -6:] += np.diag([tip, tip, tip, 0.05, 0.04, 0.06])
    squares, shapes = eigh(k[6:, 6:], m[6:, 6:])
    motion = np.tile(np.eye(6), (9, 1))
    motion[1::6, 5] = np.linspace(0.0, length, 9)
    motion[2::6, 4] = -motion[1::6, 5]
    down = np.column_stack([motion, np.vstack([np.zeros((6, modes)), shapes[:, :modes]])])
    return down.T @ m @ down, np.diag(np.concatenate([np.zeros(6), squares[:modes]]))


@pytest.mark.parametrize("noise", [0.0, 1e-5])
@pytest.mark.parametrize(
    "make",
    [
        flat_panel,
        lambda: condensed_boom(8.0, 9, 0.5),
        # 1e-5 of the inertia is 1.5e-3 of the mass, and a third of the roll inertia
        lambda: condensed_boom(16.0, 4, 20.0),
    ],
)
@pytest.mark.slow
def test_condensed_matrices_with_noise_keep_their_rigid_mass(tmp_path, make, noise):
    mass, stiffness = make()
    noisy = with_noise(mass, noise)
    np.savez(tmp_path / "m.npz", mass=noisy, stiffness=stiffness, boundary=np.arange(6))
    result = fit(read_modes(tmp_path / "m.npz"))
    assert result.status.ok
    # the edge of what a body can have takes up to a third of the noise more
    allowed = (1.5 * noise + 1e-12) * np.max(mass)
    assert np.max(np.abs(result.chain.rigid_mass() - mass[:6, :6])) < allowed
    # dw / w = dm / 2, of modal masses of 1
    own = np.sort(np.sqrt(np.diag(stiffness)[6:]))
    found = result.space.achieved.frequencies[: own.size]
    assert found == pytest.approx(own, rel=2.0 * noise * np.max(mass) + 1e-8)


@pytest.mark.parametrize(("first", "second"), [(-4e-7, -1e-6), (5e-7, 9e-7), (-5e-4, -1e-3)])
def test_a_line_that_is_nearly_uniform_has_the_moments_it_was_made_from(first, second):
    """A uniform rod of 21.6 kg and 6 m, whose first and second moments are changed a little."""
    moment = 64.8 * (1.0 + first)
    inertia = 259.2 * (1.0 + second) + 0.1
    rigid = np.diag([21.6, 21.6, 21.6, 0.2, inertia, inertia])
    rigid[1, 5] = rigid[5, 1] = moment
    rigid[2, 4] = rigid[4, 2] = -moment
    row = np.array([[0.0, 0.1, 0.0, 0.0, 0.0, 0.0]])
    line = ModalData(rigid, np.array([1.0]), row).line()
    assert line.behind(np.array([-1.0]))[0] == pytest.approx(rigid, rel=1e-11, abs=1e-13)
