"""Tests internals, `report.shapes`: mode shapes of the beam,
against closed forms and the elements' own tip; of the chain, against both."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.interpolate import CubicSpline

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
GAUSS = leggauss(40)
ORTHOGONAL = 1e-5  # of splines over eighty points
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
@pytest.mark.slow
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


@pytest.mark.parametrize("make", [make for make in BEAMS if make is not timoshenko_boom])
def test_shapes_are_orthogonal_in_the_mass(make):
    """Independent of participation at the root:
    what could go wrong on the way shows here."""
    beam = make()
    x, shapes = beam_shapes(beam, "xy", 3)
    gram = np.zeros((3, 3))
    for start, end in pairwise([*beam.starts, beam.length]):
        here = (x >= start) & (x <= end)
        at = start + (end - start) * (GAUSS[0] + 1.0) / 2.0
        values = CubicSpline(x[here], shapes[:, here], axis=1)(at)
        mass = np.array([beam.density(float(a), "xy")[0] for a in at])
        gram += values * (mass * GAUSS[1] * (end - start) / 2.0) @ values.T
    for lump in beam.lumps:
        values = CubicSpline(x, shapes, axis=1)
        gram += lump.mass * np.outer(values(lump.x), values(lump.x))
        gram += lump.inertia[2] * np.outer(values(lump.x, 1), values(lump.x, 1))
    np.testing.assert_allclose(gram, np.eye(3), atol=ORTHOGONAL)


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


@pytest.mark.slow
def test_the_drawing_shows_every_kept_mode_and_moves_by_style_alone():
    fit = bc.fit(panels(), modes={"xy": 3, "xz": 1})
    for port, count in (("xy", 3), ("xz", 1)):
        text = shapes_svg(fit, port)
        assert text.count('class="ring"') == count
        assert "aria-label" in text
        assert "nan" not in text
