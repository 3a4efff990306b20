"""Other people's numbers: the 2008 paper, textbooks, MathWorks, Exudyn, a space manipulator.
None of them is ours.

Each test names its source. Frequencies of uniform beams are held twice: tightly against the closed
form, loosely against the figure as somebody printed it.
"""

from functools import cache
from math import pi

import numpy as np
import pytest

import readback as rb
from appendages import close, seed_boom, unit_beam
from beamchain import (
    Beam,
    Equivalent,
    Joint,
    Lump,
    Material,
    PortModel,
    Rectangle,
    Segment,
)
from rival_files import paper_file
from written_chain import read_chain

CLOSED = 1e-10  # roots of transcendental equations given here with ten digits or computed
TEXTBOOK = 1e-7  # beta L and omega as tables print them, eight or nine digits
# the paper rounded its k and c before it used them; its own recomputed figures move by this much
SEED = 3e-4
EXUDYN = 1e-5  # 32 ANCF elements: their third frequency is 1e-5 above the beam's

#: beta L of the cantilever and of the free-free beam (Blevins, table 8-1)
HELD = np.array([1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349])
FREE = np.array([4.7300407449, 7.8532046241, 10.9956078380, 14.1371654913])


def printed(value, figure, slack=0.0):
    """`value` is the printed `figure` within one unit of its last digit,
    or `slack` relative where that is larger."""
    unit = 10.0 ** -len(figure.partition(".")[2])
    return abs(value - float(figure)) <= max(unit, slack * abs(float(figure)))


def bar(length, width_y, width_z, young, density, nu=None):
    material = Material(youngs_modulus=young, density=density, poissons_ratio=nu)
    section = Rectangle(width_y=width_y, width_z=width_z)
    return Beam(segments=(Segment(length=length, section=section, material=material),))


# -- O1: P. P. Belonozhko (2008) -------------------------------------------------------------------
def seed_unit():
    """sqrt(EI / m L^4) of the paper's rod."""
    return np.sqrt(2.06e11 * 0.012**2 / (16 * 7800.0)) / 15.0**2


def test_o1_free_frequencies_of_the_papers_rod():
    free = seed_boom().port("xy", 4).free_frequencies[:4]
    assert free == close(FREE**2 * seed_unit(), rel=1e-9)
    assert free == close([1.5330447, 4.2258967, 8.2844471, 13.694612], rel=TEXTBOOK)
    assert printed(free[0], "1.533")
    assert printed(free[1], "4.2257", SEED)


def test_o1_mass_of_the_papers_rod():
    assert printed(seed_boom().rigid_mass()[0, 0], "13.232")


BEAM = {
    "gains": {"T0y y0": "0.9069", "M0 y0": "-0.2823", "M0 phi1": "0.1160"},
    "n1": {"T0y y0": "1.0648", "M0 y0": "0.7105", "M0 phi1": "0.4690"},
    "n2": {"T0y y0": "3.5124", "M0 y0": "2.9837", "M0 phi1": "2.5745"},
}
CHAIN = {
    "gains": {"T0y y0": "0.7321", "M0 y0": "-0.1743", "M0 phi1": "0.0541"},
    "n1": {"T0y y0": "1.0977", "M0 y0": "0.7815", "M0 phi1": "0.5613"},
    "n2": {"T0y y0": "3.7917", "M0 y0": "3.4521", "M0 phi1": "3.1515"},
}
ENTRY = {"T0y y0": (0, 0), "M0 y0": (0, 1), "M0 phi1": (1, 1)}


def two_mode_beam():
    """The paper's beam: its first two free modes and nothing else."""
    return seed_boom().port("xy", 6).reduced(2, np.zeros((2, 2)))


@cache
def papers_file():
    """Three uniform rods, as the recipe of the paper exports them."""
    return paper_file(seed_boom())


def papers_chain():
    """The same, read by plain MuJoCo; the paper's own k and c are rounded."""
    reading = rb.read(papers_file())
    turn = rb.into_space("xy")
    frequencies, participation, _ = reading.port("xy")
    return PortModel(turn.T @ reading.rigid @ turn, frequencies, participation)


@pytest.mark.parametrize(
    ("make", "table"), [(two_mode_beam, BEAM), (papers_chain, CHAIN)], ids=["beam", "chain"]
)
@pytest.mark.parametrize("entry", ENTRY)
def test_o1_transfer_functions(make, table, entry):
    # equation (15): gain k, zeros n1, n2 of the accelerance
    port, (i, j) = make(), ENTRY[entry]
    assert printed(port.gains[i, j], table["gains"][entry], SEED)
    zeros = port.zeros(i, j)
    assert zeros.imag == close(np.zeros(2), abs=1e-9)
    assert printed(zeros[0].real, table["n1"][entry], SEED)
    assert printed(zeros[1].real, table["n2"][entry], SEED)


@pytest.mark.parametrize("make", [two_mode_beam, papers_chain])
def test_o1_poles(make):
    poles = make().free_frequencies
    assert poles.size == 2
    assert printed(poles[0], "1.533", SEED)
    assert printed(poles[1], "4.2257", SEED)


def test_o1_gains_of_the_beam_in_closed_form():
    # W(infinity) of two free modes: M^-1 + sum p p^T, p = (2, -2 sigma beta) of the unit beam
    b = FREE[:2]
    sigma = (np.cosh(b) - np.cos(b)) / (np.sinh(b) - np.sin(b))
    p = np.column_stack([np.full(2, 2.0), -2.0 * sigma * b])
    unit = np.array([[4.0, -6.0], [-6.0, 12.0]]) + p.T @ p
    m = 7800.0 * pi * 0.006**2 * 15.0
    length = 15.0
    scale = np.array([[m, m * length], [m * length, m * length**2]])
    assert two_mode_beam().gains == close(unit / scale, rel=1e-8)


def test_o1_parameters_that_match_two_frequencies():
    w = FREE[:2] ** 2 * seed_unit()
    chain = read_chain(papers_file())
    inner, outer = (hinge.x for hinge in chain.hinges)
    k = (outer - inner) / 15.0
    c = chain.hinges[0].stiffness["xy"]
    assert printed(k, "0.26985", SEED)
    assert printed(c, "51.325", SEED)
    # recomputed without rounding on the way
    assert printed(k, "0.26988")
    assert printed(c, "51.338")
    port = papers_chain()
    assert port.free_frequencies == close(w, rel=1e-9)
    assert printed(port.zeros(0, 0)[1].real, "3.7921")


def test_o1_the_equivalence_is_partial():
    # the paper's own conclusion: equal poles, unequal gains
    beam = two_mode_beam()
    chain = papers_chain()
    assert beam.free_frequencies == close(chain.free_frequencies, rel=SEED)
    assert chain.gains[0, 0] / beam.gains[0, 0] == close(0.7321 / 0.9069, rel=2 * SEED)
    # three printed digits
    assert chain.gains[1, 1] / beam.gains[1, 1] == close(0.0541 / 0.1160, rel=2e-3)


# -- O2: the uniform cantilever --------------------------------------------------------------------
def test_o2_cantilever_frequencies():
    port = unit_beam().port("xy", 4)
    assert port.frequencies[:4] == close(HELD**2, rel=CLOSED)
    assert port.frequencies[:3] == close([3.5160153, 22.0344916, 61.6972144], rel=TEXTBOOK)


def test_o2_effective_masses():
    port = unit_beam().port("xy", 4)
    fractions = np.array([np.diag(m) / np.diag(port.rigid_mass) for m in port.effective_mass[:3]])
    assert fractions[:, 0] == close([0.613076, 0.188300, 0.064732], abs=1e-6)
    assert fractions[:, 1] == close([0.970688, 0.024716, 0.003152], abs=1e-6)


# -- O3: MathWorks, sm_flex_lumped_param_beam ------------------------------------------------------
def test_o3_mathworks_cantilever():
    beam = bar(0.3, 0.005, 0.015, 70e9, 2800.0)
    port = beam.port("xy", 6)
    unit = np.sqrt(70e9 * 0.005**2 / (12 * 2800.0)) / 0.3**2 / (2 * pi)
    assert port.frequencies[:4] / (2 * pi) == close(HELD**2 * unit, rel=CLOSED)
    assert port.frequencies[:4] / (2 * pi) == close(
        [44.8722, 281.2095, 787.3948, 1542.9796], rel=1e-6
    )


def test_o3_mathworks_tip_sag_at_100_g():
    # the root accelerates: tip deflection = sum of tip x participation / w^2,
    # closed form q L^4 / (8 EI)
    port = bar(0.3, 0.005, 0.015, 70e9, 2800.0).port("xy", 6)
    sag = (
        100 * 9.81 * float(np.sum(port.tip[:, 0] * port.participation[:, 0] / port.frequencies**2))
    )
    closed = 2800.0 * 0.015 * 0.005 * 981.0 * 0.3**4 / (8 * 70e9 * 0.015 * 0.005**3 / 12)
    assert sag == close(closed, rel=1e-9)
    assert printed(sag, "0.019071")


# -- O4: Exudyn, computeODE2EigenvaluesTest.py -----------------------------------------------------
def test_o4_exudyn_free_free():
    free = bar(2.0, 0.01, 0.01, 2.07e11, 7800.0).port("xy", 4).free_frequencies[:3]
    unit = np.sqrt(2.07e11 * 0.01**2 / (12 * 7800.0)) / 4.0
    assert free == close(FREE[:3] ** 2 * unit, rel=CLOSED)
    assert free == close([83.179637, 229.287872, 449.495907], rel=1e-8)
    assert free == close([83.179665, 229.288446, 449.500218], rel=EXUDYN)  # 32 ANCF elements


# -- O5: Exudyn, ANCFBeamEigTest.py (Nachbagauer et al. 2013): axial, fixed-free -------------------
def test_o5_exudyn_axial():
    axial = bar(2.0, 0.4, 0.4, 1e9, 7850.0, nu=0.3).port("axial", 2).frequencies[0]
    assert axial == close(pi / 4.0 * np.sqrt(1e9 / 7850.0), rel=CLOSED)
    assert axial == close(280.32063, rel=1e-7)
    assert axial == close(280.322475, rel=1e-4)  # Exudyn, 256 elements


def test_o5_exudyn_torsion():
    # pi c / L: the beam free in torsion; the square's torsion over polar factor is
    # printed as 0.8436
    beam = bar(2.0, 0.4, 0.4, 1e9, 7850.0, nu=0.3)
    free = beam.port("torsion", 2).free_frequencies[0]
    c = np.sqrt(1e9 / 2.6 / 7850.0)
    assert free == close(pi / 2.0 * c * np.sqrt(0.8436), rel=1e-4)
    assert free == close(319.34981, rel=1e-4)
    assert free == close(319.346597, rel=1e-4)  # Exudyn, 256 elements


# -- O6: a space manipulator link with a heavy payload (DETC2007-35511, in MBDyn's tests) ----------
def manipulator(joints=()):
    section = Equivalent(bending_stiffness_xy=5.974**2 * 2.82, linear_mass=2.82)
    segment = Segment(length=3.372, section=section)
    payload = Lump(x=3.372, mass=5.18 * 2.82 * 3.372)
    return Beam(segments=(segment,), lumps=(payload,), joints=joints)


def pinned(port: PortModel):
    """Frequencies with the root's displacement held and its rotation free:
    the zeros of y per force."""
    return port.zeros(0, 0).real


def test_o6_manipulator_pinned_at_the_root():
    found = pinned(manipulator().port("xy", 6))[:4]
    assert found == close([5.28343, 20.84173, 46.76976, 83.06847], rel=1e-6)
    published = np.array([5.28, 20.9, 46.7, 83.4])  # of a finite-element model, three digits
    assert found == close(published, rel=5e-3)


def test_o6_manipulator_clamped_at_the_root():
    held = manipulator().port("xy", 6).frequencies[:4]
    # printed to six decimals
    assert held == close([0.391031, 8.194197, 26.351741, 54.872162], rel=2e-6)


def test_o6_a_soft_root_joint_tends_to_the_pin():
    soft = manipulator((Joint(after_segment=0, stiffness_xy=1e-6),)).port("xy", 6).frequencies
    assert soft[1:4] == close(pinned(manipulator().port("xy", 6))[:3], rel=1e-6)
