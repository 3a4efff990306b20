"""A printed rigid mass is judged by its digits: rounding makes no other body of it,
a missing direction does."""

import json

import numpy as np
import pytest

import beamchain as bc

MUJOCO = 1e-6  # what goes in comes back through A and B


def tumbling(seed: int, digits: int) -> dict:
    """Modes of point masses off the axis, which move in all six motions,
    every number printed with some digits."""
    source = np.random.default_rng(seed)
    count = int(source.integers(3, 7))
    place = np.column_stack(
        [source.uniform(0.2, 6.0, count), source.uniform(-1.0, 1.0, (count, 2))]
    )
    root = np.repeat(np.sqrt(10.0 ** source.uniform(-0.5, 1.0, count)), 3)[:, None]
    moves = [[[1, 0, 0, 0, z, -y], [0, 1, 0, -z, 0, x], [0, 0, 1, y, -x, 0]] for x, y, z in place]
    rows = root * np.concatenate(moves)
    modes = np.linalg.qr(source.standard_normal((3 * count, int(source.integers(2, 8)))))[0]

    def printed(values):
        return np.vectorize(lambda value: float(f"{value:.{digits - 1}e}"))(values).tolist()

    return {
        "frequencies": np.cumsum(source.uniform(1.0, 9.0, modes.shape[1])).tolist(),
        "participation": printed(rows.T @ modes),
        "mass": printed(rows.T @ rows),
        "digits": digits,
    }


@pytest.mark.parametrize(("seed", "digits"), [(1, 4), (5, 8)])
@pytest.mark.slow
def test_few_digits_are_a_body(seed, digits, tmp_path):
    document = tumbling(seed, digits)
    path = tmp_path / "modes.json"
    path.write_text(json.dumps(document))
    result = bc.fit(bc.read_modes(path))
    assert result.status.ok
    count = len(document["frequencies"])
    assert result.space.achieved.frequencies[:count] == pytest.approx(
        document["frequencies"], rel=MUJOCO
    )


@pytest.mark.parametrize("digits", [3, 5, 8])
def test_a_mass_that_depends_on_the_direction_is_no_body(digits, tmp_path):
    document = tumbling(0, digits)
    document["mass"][0][0] *= 1.1
    path = tmp_path / "modes.json"
    path.write_text(json.dumps(document))
    with pytest.raises(bc.BeamchainError, match="direction"):
        bc.fit(bc.read_modes(path))


@pytest.mark.slow
def test_a_structure_that_points_inwards_is_told_its_axes(tmp_path):
    """Turned by half a turn about z; no length is negative in the answer,
    and the axes it names lead out."""
    document = tumbling(3, 5)
    signs = np.array([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
    document["participation"] = (signs[:, None] * document["participation"]).tolist()
    document["mass"] = (np.outer(signs, signs) * document["mass"]).tolist()
    path = tmp_path / "modes.json"
    path.write_text(json.dumps(document))
    with pytest.raises(bc.InputError, match="axes = ") as refused:
        bc.fit(bc.read_modes(path))
    assert "length = -" not in str(refused.value)
    axes = json.loads(str(refused.value).partition("axes = ")[2].rstrip("."))
    assert bc.fit(bc.read_modes(path, axes=axes)).status.ok


@pytest.mark.parametrize("more", ["", "length = 1.5\n"])
def test_forgotten_axes_are_named_where_the_centre_is_slightly_outwards(more, tmp_path):
    """A uniform panel of 1.2 m along the file's y, whose centre lies at x = 0.01 m."""
    off = 0.01
    mass, length, wide = 3.0, 1.2, 0.2  # kg, m; radius of gyration along x
    centre = np.array([off, length / 2.0, 0.0])
    arm = np.array(
        [[0.0, -centre[2], centre[1]], [centre[2], 0.0, -centre[0]], [-centre[1], centre[0], 0.0]]
    )
    own = np.diag([length**2 / 12.0, wide**2, length**2 / 12.0 + wide**2])
    inertia = mass * own - mass * arm @ arm
    # x, y, z, rotations: a rigid body's matrix about the root
    matrix = np.block([[mass * np.eye(3), -mass * arm], [mass * arm, inertia]])
    row = [0.0, 0.0, 1.2, 1.2 * 0.87, -1.2 * off, 0.0]
    document = {"frequencies": [9.0], "participation": [[v] for v in row], "mass": matrix.tolist()}
    (tmp_path / "modes.json").write_text(json.dumps(document))
    spec = tmp_path / "spec.toml"
    text = 'name = "boom"\n[imported]\nfile = "modes.json"\n'
    spec.write_text(text + more)
    with pytest.raises(bc.InputError, match="axes = ") as refused:
        bc.fit(spec)
    assert "length =" not in str(refused.value)
    axes = str(refused.value).partition("axes = ")[2].rstrip(".")
    spec.write_text(f"{text}axes = {axes}\n{more}")
    assert bc.fit(spec).status.ok


@pytest.mark.slow
def test_a_body_that_lies_beside_x_is_taken_where_x_holds_it(tmp_path):
    """With the inertia along x of a uniform piece of 0.4 m, whose centre lies farther aside."""
    mass, length, aside = 3.0, 0.4, 0.5
    centre = np.array([length / 2.0, aside, 0.0])
    arm = np.array(
        [[0.0, -centre[2], centre[1]], [centre[2], 0.0, -centre[0]], [-centre[1], centre[0], 0.0]]
    )
    inertia = mass * length**2 / 12.0 * np.diag([1e-3, 1.0, 1.0]) - mass * arm @ arm
    matrix = np.block([[mass * np.eye(3), -mass * arm], [mass * arm, inertia]])
    row = [0.0, 0.0, 1.0, 0.5, -0.2, 0.0]
    document = {"frequencies": [9.0], "participation": [[v] for v in row], "mass": matrix.tolist()}
    (tmp_path / "modes.json").write_text(json.dumps(document))
    assert bc.fit(bc.read_modes(tmp_path / "modes.json")).status.ok
