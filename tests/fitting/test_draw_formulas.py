"""Tests internals, `fitting.varied` and `fitting.uncertain.correlate`, too.

Closed forms beside uncertain numbers: what a draw makes of a quantity, what a correlation may
be, and the waves that fit into a beam."""

from zlib import crc32

import numpy as np
import pytest
from msgspec import structs
from scipy.linalg import sqrtm
from scipy.special import ndtr

import beamchain as bc
from beamchain.fitting.quantity import draws
from beamchain.fitting.uncertain import correlate
from beamchain.fitting.varied import structural_quantities, vary_spec
from formulas import half_waves


def normal(**width):
    return bc.spec.Uncertainty(distribution="normal", **width)


@pytest.mark.parametrize("score", [-7.0, -2.5, -0.4, 0.0, 1.1, 2.9, 7.0])
def test_a_draw_is_a_share_or_a_part_added_cut_at_three_deviations(score):
    held = min(max(score, -3.0), 3.0)
    assert normal(relative=0.1).value(50.0, score) == pytest.approx(50.0 * (1.0 + 0.1 * held))
    assert normal(absolute=0.7).value(-2.0, score) == pytest.approx(-2.0 + 0.7 * held)
    uniform = bc.spec.Uncertainty(relative=0.1, distribution="uniform")
    share = 2.0 * float(ndtr(score)) - 1.0
    assert uniform.value(50.0, score) == pytest.approx(50.0 * (1.0 + 0.1 * share))


def test_how_far_a_quantity_may_come():
    assert normal(relative=0.1).reach(-50.0) == pytest.approx(15.0)
    assert normal(absolute=0.7).reach(-50.0) == pytest.approx(2.1)
    assert bc.spec.Uncertainty(absolute=0.7, distribution="uniform").reach(9.0) == 0.7


@pytest.mark.parametrize(
    ("of", "matrix", "words"),
    [
        ((), (), "0 names"),
        (("a.frequency", "b.frequency"), ((1.0, 0.5),), "2 x 2"),
        (("a.frequency", "b.frequency"), ((1.0, 0.5), (0.5,)), "2 x 2"),
        (("a.frequency", "a.frequency"), ((1.0, 0.5), (0.5, 1.0)), "each name once"),
        (("a.frequency", "b.frequency"), ((1.0, 0.5), (0.4, 1.0)), "symmetric"),
        (("a.frequency", "b.frequency"), ((1.1, 0.5), (0.5, 1.1)), "diagonal"),
        (("a.frequency", "b.frequency"), ((1.0, 1.2), (1.2, 1.0)), "-0.2"),
    ],
)
def test_what_no_correlation_is(of, matrix, words):
    with pytest.raises(bc.InputError, match=words):
        bc.spec.Correlation(of=of, matrix=matrix)


def test_half_waves_of_a_beam_are_its_length_over_half_a_wavelength():
    """`k = omega sqrt(m/S)` of twist and stretching, `k^4 = omega^2 m/EI` of bending; k L/pi of
    them."""
    section = bc.Equivalent(
        bending_stiffness_xy=400.0,
        bending_stiffness_xz=90.0,
        torsion_stiffness=0.055,
        axial_stiffness=7e3,
        linear_mass=1.7,
        polar_inertia=0.3,
    )
    parts = tuple(bc.Segment(length=part, section=section) for part in (2.0, 3.5))
    beam = bc.Beam(segments=parts)
    omega, length = 23.0, 5.5
    for port, stiffness in (("xy", 400.0), ("xz", 90.0)):
        wave = (omega**2 * 1.7 / stiffness) ** 0.25
        assert half_waves(beam, port, omega) == pytest.approx(wave * length / np.pi)
    twist = omega * np.sqrt(0.3 / 0.055)
    assert half_waves(beam, "torsion", omega) == pytest.approx(twist * length / np.pi)
    stretch = omega * np.sqrt(1.7 / 7e3)
    assert half_waves(beam, "axial", omega) == pytest.approx(stretch * length / np.pi)


def test_half_waves_of_a_taper_are_those_of_its_middle():
    """A square rod: k^4 = omega^2 12 rho / (E a^2), 3 cm wide in the middle."""
    material = bc.Material(youngs_modulus=7e10, density=2700.0)
    first, last = (bc.Rectangle(width_y=side, width_z=side) for side in (0.05, 0.01))
    segment = bc.Segment(length=4.0, section=first, section_end=last, material=material)
    wave = (31.0**2 * 12.0 * 2700.0 / (7e10 * 0.03**2)) ** 0.25
    found = half_waves(bc.Beam(segments=(segment,)), "xz", 31.0)
    assert found == pytest.approx(wave * 4.0 / np.pi)


def test_a_matrix_that_is_a_correlation_is_taken_as_it_is():
    names, matrix = ("a.frequency", "b.frequency"), ((1.0, -0.5), (-0.5, 1.0))
    taken = bc.spec.Correlation(of=names, matrix=matrix)
    assert np.array_equal(taken.matrix, matrix)


def test_scores_are_correlated_by_the_symmetric_root():
    """Two of four columns, in the order of their names; what is wholly correlated is the same."""
    scores = np.random.default_rng(2).normal(size=(5, 4))
    places = {"a": 0, "b": 1, "c": 2, "d": 3}

    def correlated(of, matrix):
        return correlate(scores, places, (bc.spec.Correlation(of=of, matrix=matrix),))

    matrix = ((1.0, 0.6, 0.0), (0.6, 1.0, -0.3), (0.0, -0.3, 1.0))
    found = correlated(("d", "a", "c"), matrix)
    assert found[:, [3, 0, 2]] == pytest.approx(scores[:, [3, 0, 2]] @ sqrtm(np.array(matrix)))
    assert np.array_equal(found[:, 1], scores[:, 1])
    same = correlated(("a", "b"), ((1.0, 1.0), (1.0, 1.0)))
    assert same[:, 0] == pytest.approx(same[:, 1])
    assert same[:, 0] == pytest.approx((scores[:, 0] + scores[:, 1]) / np.sqrt(2.0))


# -- structures ------------------------------------------------------------------------------------
WIDTHS = {"stiffness": 0.1, "density": 0.05, "joint_stiffness": 0.2, "lump": 0.03, "payload": 0.07}


def structure(**given):
    """Two pieces with a joint that bends and twists, two lumps and a payload."""
    truss = bc.Equivalent(
        bending_stiffness_xy=400.0, torsion_stiffness=55.0, linear_mass=1.7, polar_inertia=0.3
    )
    metal = bc.Material(youngs_modulus=7e10, shear_modulus=2.6e10, density=2700.0)
    rod = bc.Round(diameter=0.02)
    inertia = (0.1, 0.2, 0.3)
    return bc.Spec(
        segment=(
            bc.Segment(length=2.0, section=truss, nonstructural_mass=0.4),
            bc.Segment(length=3.0, section=rod, material=metal),
        ),
        joint=(bc.Joint(after_segment=1, stiffness_xy=500.0, stiffness_torsion=60.0),),
        lump=(bc.Lump(x=1.0, mass=2.0, inertia=inertia), bc.Lump(x=3.0, mass=4.0, inertia=inertia)),
        payload=bc.spec.Payload(mass=5.0, inertia=inertia),
        modes=bc.Modes(xy=1),
        uncertain=bc.spec.Uncertain(**given),
    )


def drawn_factor(name, key, seed=5, index=8):
    """A number is drawn by its key alone, the same on any machine."""
    score = np.random.default_rng([seed, index, crc32(key.encode())]).standard_normal()
    return 1.0 + WIDTHS[name] * min(max(score, -3.0), 3.0)


@pytest.mark.parametrize("each", [True, False])
def test_the_numbers_of_a_structure_are_drawn_in_their_order(each):
    spec = structure(**{name: normal(relative=w, each=each) for name, w in WIDTHS.items()})
    wanted = [
        *(
            ("segment1.stiffness", "", 1.0, "stiffness", 0),
            ("segment2.stiffness", "", 1.0, "stiffness", 1),
        ),
        *(("segment1.density", "", 1.0, "density", 0), ("segment2.density", "", 1.0, "density", 1)),
        ("joint1.stiffness_xy", "N m/rad", 500.0, "joint_stiffness", 0),
        ("joint1.stiffness_torsion", "N m/rad", 60.0, "joint_stiffness", 0),
        *(("lump1.mass", "kg", 2.0, "lump", 0), ("lump2.mass", "kg", 4.0, "lump", 1)),
        ("payload.mass", "kg", 5.0, "payload", 0),
    ]
    found = structural_quantities(spec, "arm_", "left_")
    assert [(q.name, q.unit, q.nominal, q.index) for q in found] == [
        (f"arm_{name}", unit, nominal, -1) for name, unit, nominal, *_ in wanted
    ]
    values = [
        nominal * drawn_factor(name, f"left_{name}{number}" if each else f"left_{name}")
        for _, _, nominal, name, number in wanted
    ]
    assert draws(found, [8], 5, ())[0] == pytest.approx(values, rel=1e-14)
    for sure in (structure(), structs.replace(structure(), uncertain=None)):
        assert structural_quantities(sure) == ()
        assert vary_spec(sure, ()) == sure


def test_a_drawn_structure_is_stiffer_and_heavier_by_what_was_drawn():
    """The inertia of a body goes with its mass; what a section does not state stays unstated."""
    spec = structure(**{name: normal(relative=w, each=True) for name, w in WIDTHS.items()})
    found = vary_spec(spec, draws(structural_quantities(spec), [8], 5, ())[0])
    stiff, dense = (
        [drawn_factor(name, f"{name}{i}") for i in (0, 1)] for name in ("stiffness", "density")
    )
    truss, metal = found.segment[0].section, found.segment[1].material
    assert truss.bending_stiffness_xy == pytest.approx(400.0 * stiff[0])
    assert truss.torsion_stiffness == pytest.approx(55.0 * stiff[0])
    assert truss.bending_stiffness_xz == 0.0
    assert (truss.linear_mass, truss.polar_inertia, found.segment[0].nonstructural_mass) == (
        pytest.approx((1.7 * dense[0], 0.3 * dense[0], 0.4 * dense[0]))
    )
    assert (metal.youngs_modulus, metal.shear_modulus) == (
        pytest.approx((7e10 * stiff[1], 2.6e10 * stiff[1]))
    )
    assert metal.density == pytest.approx(2700.0 * dense[1])
    hinge = drawn_factor("joint_stiffness", "joint_stiffness0")
    assert found.joint[0].stiffness_xy == pytest.approx(500.0 * hinge)
    assert found.joint[0].stiffness_torsion == pytest.approx(60.0 * hinge)
    assert found.joint[0].stiffness_xz is None
    bodies = [("lump", 0, found.lump[0], 2.0), ("lump", 1, found.lump[1], 4.0)]
    for name, number, body, mass in [*bodies, ("payload", 0, found.payload, 5.0)]:
        factor = drawn_factor(name, f"{name}{number}")
        assert body.mass == pytest.approx(mass * factor)
        assert body.inertia == pytest.approx(factor * np.array([0.1, 0.2, 0.3]))


def test_a_mode_is_uncertain_in_one_table():
    modes = [
        bc.spec.UncertainMode(number=n, port="xy", damping=bc.spec.Uncertainty(relative=0.1))
        for n in (1, 2, 2)
    ]
    assert len(bc.spec.UncertainModes(mode=tuple(modes[:2])).mode) == 2
    with pytest.raises(bc.InputError, match="mode2_xy"):
        bc.spec.UncertainModes(mode=tuple(modes))
