"""The frames that coupled chains are held against: straight ones are the beam, turned ones turn,
files come back."""

import numpy as np
import pytest

import beamchain as bc
import finite_elements as fe
import frames
import readback as rb


def straight(elements):
    return frames.tube((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), elements)


def the_same_beam():
    material = {"youngs_modulus": 7e10, "density": 2700.0, "poissons_ratio": 0.33}
    section = {"shape": "tube", "outer_diameter": 0.05, "wall": 0.002}
    return {
        "segment": [{"length": 3.0, "section": section, "material": material}],
        "lump": [{"x": 3.0, "mass": 2.0, "inertia": [0.1, 0.2, 0.3]}],
    }


def test_a_straight_frame_is_the_beam():
    found = frames.frame_modes(
        [straight(24)], [frames.Body((3.0, 0.0, 0.0), 2.0, (0.1, 0.2, 0.3))], 12
    )
    truth = fe.cantilever(the_same_beam(), {"xy": 3, "xz": 3, "torsion": 1, "axial": 1})
    np.testing.assert_allclose(found.rigid, truth.rigid, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found.frequencies[:5], truth.frequencies[:5], rtol=2e-6)
    _, rows = rb.mode_error(
        (found.frequencies[:5], found.participation[:5]),
        (truth.frequencies[:5], truth.participation[:5]),
        truth.rigid,
    )
    assert rows < 1e-5
    # those of stiff motions too
    for w, row in zip(truth.frequencies[5:], truth.participation[5:], strict=True):
        close = found.frequencies / w - 1.0
        assert np.min(np.abs(close)) < 1e-3, row


def test_refining_converges_as_cubic_elements_do():
    exact = fe.cantilever(the_same_beam(), {"xy": 3}).frequencies
    body = [frames.Body((3.0, 0.0, 0.0), 2.0, (0.1, 0.2, 0.3))]

    def error(elements):
        found = frames.frame_modes([straight(elements)], body, 12).frequencies
        return min(abs(w / exact[2] - 1.0) for w in found)

    assert error(4) / error(8) == pytest.approx(16.0, rel=0.3)


@pytest.mark.parametrize("seed", range(4))
def test_a_turned_frame_has_turned_numbers(seed):
    turn = frames.turned_axes(seed)
    legs = [
        frames.tube((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), 4),
        frames.tube((2.0, 0.0, 0.0), (2.0, 1.5, 0.3), 4, 0.03),
    ]
    turned = [
        frames.tube(turn @ a, turn @ b, 4, d)
        for a, b, d in ((leg.start, leg.end, d) for leg, d in zip(legs, (0.05, 0.03), strict=True))
    ]
    one = frames.frame_modes(legs, modes=8)
    other = frames.frame_modes(turned, modes=8)
    both = np.block([[turn, np.zeros((3, 3))], [np.zeros((3, 3)), turn]])
    np.testing.assert_allclose(
        both @ one.rigid @ both.T, other.rigid, atol=1e-12 * np.max(one.rigid)
    )
    assert (
        max(
            rb.mode_error(
                (other.frequencies, other.participation),
                (one.frequencies, one.participation @ both.T),
                other.rigid,
            )
        )
        < 1e-9
    )


def test_residual_mass_is_positive_and_small_with_all_modes():
    for seed in range(16):
        found = frames.l_frame(seed, 12)
        rest = found.rigid - found.participation.T @ found.participation
        assert np.linalg.eigvalsh(rest)[0] > -1e-10 * np.max(found.rigid)
        left = np.linalg.eigvalsh(found.rigid - found.everything)
        assert np.max(np.abs(left)) < 0.3 * np.max(found.rigid)
        # out of one axis: motions couple in one and the same mode
        share = np.abs(found.participation / np.sqrt(np.diag(found.rigid)))
        assert np.any(np.sort(share, axis=1)[:, -3] > 1e-2)


@pytest.mark.parametrize("suffix", [".toml", ".json"])
@pytest.mark.parametrize("seed", [0, 1, 6])
def test_files_come_back_in_si_about_the_port(tmp_path, suffix, seed):
    found = frames.l_frame(seed, 6)
    axes = frames.turned_axes(seed) if seed else np.eye(3)
    table = frames.write_modes(
        tmp_path / f"modes{suffix}", found, 1e-3, 1e3, axes, (120.0, -40.0, 33.0), hertz=seed == 1
    )
    data = bc.read_modes(
        tmp_path / table["file"],
        reference=table["reference"],
        axes=np.array(table["axes"]),
        units=table["units"],
    )
    np.testing.assert_allclose(data.frequencies, found.frequencies, rtol=1e-13)
    size = np.sqrt(np.diag(found.rigid))
    np.testing.assert_allclose(data.participation / size, found.participation / size, atol=1e-12)
    assert rb.mass_error(data.rigid_mass, found.rigid) < 1e-12
    np.testing.assert_allclose(data.tip, found.tip, atol=1e-11 * np.max(np.abs(found.tip)))
    assert data.length == pytest.approx(found.length, rel=1e-14)
