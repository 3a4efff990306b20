"""Tests internals, `report.shapes`: mode shapes of the beam,
against closed forms and the elements' own tip; of the chain, against both."""

import numpy as np
import pytest

import beamchain as bc
from appendages import (
    panels,
    seed_boom,
    soft_root_boom,
    stepped_boom,
    tapered_boom,
    timoshenko_boom,
    tip_loaded_boom,
)
from beamchain.report.shapes import beam_shapes, chain_shapes, shapes_svg

CLOSED = 1e-6  # of the largest
TIP = 1e-5
CHAIN = 1e-9  # the chain's shapes are linear between its hinges: only rounding is left

BEAMS = [
    seed_boom,
    tapered_boom,
    stepped_boom,
    panels,
    tip_loaded_boom,
    soft_root_boom,
    timoshenko_boom,
]


def test_uniform_cantilever_against_the_closed_form():
    beam = seed_boom()
    x, shapes = beam_shapes(beam, "xy", 4)
    betas = np.array([1.875104068711961, 4.694091132974174, 7.854757438237613, 10.995540734875467])
    mass = beam.rigid_mass()[0, 0]
    for beta, shape in zip(betas, shapes, strict=True):
        b = beta * x / beam.length
        ratio = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
        exact = (np.cosh(b) - np.cos(b) - ratio * (np.sinh(b) - np.sin(b))) / np.sqrt(mass)
        exact *= np.sign(exact[-1] * shape[-1])
        np.testing.assert_allclose(shape, exact, atol=CLOSED * np.abs(exact).max())


@pytest.mark.parametrize("make", BEAMS)
@pytest.mark.parametrize("port", ["xy", "xz"])
def test_tip_is_the_elements_own(make, port):
    beam = make()
    model = beam.port(port, 8).truncated(3)
    _, shapes = beam_shapes(beam, port, 3)
    np.testing.assert_allclose(np.abs(shapes[:, -1]), np.abs(model.tip[:, 0]), rtol=TIP)


@pytest.mark.parametrize("port", ["torsion", "axial"])
def test_strings(port):
    beam = tapered_boom()
    model = beam.port(port, 8).truncated(3)
    x, shapes = beam_shapes(beam, port, 3)
    np.testing.assert_allclose(np.abs(shapes[:, -1]), np.abs(model.tip[:, 0]), rtol=TIP)
    for k, shape in enumerate(shapes):
        assert np.sum(np.diff(np.sign(shape[2:])) != 0) == k  # nodes
    assert x[-1] == pytest.approx(beam.length)


@pytest.mark.parametrize("make", BEAMS)
def test_shapes_are_orthogonal_in_the_mass(make):
    """Independent of participation at the root:
    what could go wrong on the way shows here."""
    beam = make()
    x, shapes = beam_shapes(beam, "xy", 3, 240)
    if any(segment.theory == "timoshenko" for segment in beam.segments):
        pytest.skip("rotary inertia takes part in the orthogonality")
    if any(max(lump.inertia) > 0.0 for lump in beam.lumps):
        pytest.skip("rotary inertia of the lumps takes part in the orthogonality")
    middle = (x[1:] + x[:-1]) / 2.0
    mass = np.array([beam.density(float(a), "xy")[0] for a in middle]) * np.diff(x)
    at = (shapes[:, 1:] + shapes[:, :-1]) / 2.0
    gram = at * mass @ at.T
    for lump in beam.lumps:
        value = np.array([np.interp(lump.x, x, shape) for shape in shapes])
        gram += lump.mass * np.outer(value, value)
    np.testing.assert_allclose(gram, np.eye(3), atol=2e-3)  # the middle rule on 240 steps


@pytest.mark.parametrize(("port", "kept"), [("xy", 3), ("torsion", 2), ("axial", 1)])
def test_chain_shapes_end_at_its_tip(port, kept):
    fit = bc.fit(tapered_boom(), modes={"xy": 3, port: kept} if port != "xy" else {"xy": 3})
    model = fit.chain.port(port)
    x, shapes = chain_shapes(fit.chain, port, model)
    assert x.size == shapes.shape[1]
    np.testing.assert_allclose(shapes[:, -1], model.tip[:, 0], rtol=CHAIN)
    np.testing.assert_array_equal(shapes[:, 0], 0.0)
    for hinge in fit.chain.hinges:
        if port in hinge.stiffness:
            assert hinge.x in x


def test_the_drawing_shows_every_kept_mode_and_moves_by_style_alone():
    fit = bc.fit(panels(), modes={"xy": 3, "xz": 1})
    for port, count in (("xy", 3), ("xz", 1)):
        text = shapes_svg(fit, port)
        assert text.count('class="ring"') == count
        assert "aria-label" in text
        assert "nan" not in text
