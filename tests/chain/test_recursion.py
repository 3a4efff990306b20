"""The exact chain behaves at its root as its target does, in physical links that carry the beam's own mass.

The forward check does not use the package's own port of a chain: it writes the chain's mass and stiffness matrices out
and solves them with LAPACK.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from appendages import (
    REALISABLE,
    close,
    dense_port,
    panels,
    seed_boom,
    stepped_boom,
    tapered_boom,
    timoshenko_boom,
    tip_loaded_boom,
    unit_beam,
)
from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.chain.recursion import Nodes, planar_chain, realise, split
from beamchain.errors import RealisationError
from beamchain.ports.model import PortModel

PRINTED = 1.0  # units of the last printed digit of the method
FORWARD = 1e-9  # LAPACK's generalised eigenproblem on matrices whose entries span 1e4; the recursion itself keeps 4e-12
OWN = 1e-11  # through the package's own port, which keeps nearly every digit; 4e-12 at n = 7
FREE = 1e-9  # top free modes hang on the residual mass, a difference that leaves 1e-5 of the rigid mass
SUMS = 1e-12  # sums of masses and first moments
UNIQUE = 1e-6  # a chain drawn at random and recovered: a nonlinear inverse problem, up to 1e7 roundings
#: modes up to which the clamped and hub targets give a physical chain: 7 (uniform, tapered, stepped,
#: tip-loaded); a soft root joint costs two (found here, root stiffness up to 30 EI / L)
MOST = {"soft root": 5}
CASES = [
    (kind, target, n)
    for kind in REALISABLE
    for target in ("clamped", "free", "hub")
    for n in range(1, 8)
    if target == "free" or n <= MOST.get(kind, 7)
]


def targets(beam):
    """The three targets of a beam: n -> port."""
    full = beam.port("xy", 8)
    mass, length = beam.rigid_mass()[0, 0], beam.length
    hub = 2.0 * mass * np.array([[1.0, -0.1 * length], [-0.1 * length, 0.2 * length**2]])
    return {
        "clamped": full.truncated,
        "free": lambda n: full.reduced(n, np.zeros((2, 2))),
        "hub": lambda n: full.reduced(n, hub),
    }


# -- reference values --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("target", "n", "masses", "lengths", "stiffness"),
    [
        ("clamped", 1, "0.081651 0.30527 0.61308", "0.1789 0.54757", "2.2725"),
        ("clamped", 2, "0.047274 0.15135 0.38434 0.41704", "0.10061 0.27585 0.43902", "4.0463 3.487"),
        ("clamped", 3, "0.03265 0.1012 0.2518 0.2326 0.3816", "0.06894 0.1837 0.2357 0.3391", "5.917 5.738 3.244"),
        ("free", 2, "0.083333 0.25986 0.26079 0.39602", "0.21418 0.24301 0.36376", "5.4848 3.3395"),
    ],
)
def test_unit_beam_has_the_printed_chain(target, n, masses, lengths, stiffness):
    nodes = realise(targets(unit_beam())[target](n))
    for values, printed in ((nodes.masses, masses), (nodes.lengths, lengths), (nodes.stiffness, stiffness)):
        words = printed.split()
        assert values.size == len(words)
        for value, word in zip(values, words, strict=True):
            unit = 10.0 ** -len(word.partition(".")[2])
            assert value == close(float(word), abs=PRINTED * unit)


def test_rigid_target_is_a_dumbbell():
    # no modes: one rod with the beam's mass, centre and inertia: end mass at the root m/4, 3/4 at 2/3 of the length
    nodes = realise(unit_beam().port("xy", 4).truncated(0))
    assert nodes.masses == close([0.25, 0.75], rel=SUMS)
    assert nodes.lengths == close([2.0 / 3.0], rel=SUMS)
    assert nodes.stiffness.size == 0


# -- forward -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("kind", "target", "n"), CASES)
def test_the_chain_has_the_target_s_port(kind, target, n):
    beam = REALISABLE[kind]()
    wanted = targets(beam)[target](n)
    chain = planar_chain(realise(wanted), beam)
    assert len(chain.links) == n + 1

    rigid, frequencies, participation = dense_port(
        [(link.mass, link.com, link.inertia[2]) for link in chain.links],
        [(hinge.x, hinge.stiffness["xy"]) for hinge in chain.hinges],
    )
    assert rigid == close(wanted.rigid_mass, rel=OWN)
    assert frequencies == close(wanted.frequencies, rel=FORWARD)
    signs = np.sign(np.sum(participation * wanted.participation, axis=1))
    assert participation * signs[:, None] == close(wanted.participation, rel=FORWARD)

    own = chain.port("xy")
    assert own.frequencies == close(wanted.frequencies, rel=OWN)
    assert own.participation == close(wanted.participation, rel=OWN)
    assert own.free_frequencies == close(wanted.free_frequencies, rel=FREE)


@pytest.mark.parametrize(("kind", "target", "n"), CASES)
def test_the_chain_is_physical(kind, target, n):
    beam = REALISABLE[kind]()
    nodes = realise(targets(beam)[target](n))
    assert np.all(nodes.masses > 0.0)
    assert np.all(nodes.lengths > 0.0)
    assert np.all(nodes.stiffness > 0.0)
    chain = planar_chain(nodes, beam)
    for link in chain.links:
        assert link.mass > 0.0
        assert link.length > 0.0
        a, b, c = sorted(link.inertia)
        assert b > 0.0
        assert a + b >= c


@pytest.mark.parametrize("make", [panels, timoshenko_boom])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_other_beams_for_few_modes(make, n):
    for target in targets(make()).values():
        wanted = target(n)
        own = planar_chain(realise(wanted), make()).port("xy")
        assert own.frequencies == close(wanted.frequencies, rel=OWN)
        assert own.participation == close(wanted.participation, rel=OWN)


def test_plane_xz_is_realised_with_its_own_numbers():
    beam = panels()
    wanted = beam.port("xz", 4).truncated(3)
    chain = planar_chain(realise(wanted), beam, "xz")
    assert chain.ports == ("xz",)
    assert chain.port("xz").frequencies == close(wanted.frequencies, rel=OWN)
    assert chain.port("xy").modes == 0  # rigid in the other plane


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.data())
def test_any_chain_is_recovered_from_its_port(data):
    # 3 N numbers from 3 N data: the canonical chain is unique
    n = data.draw(st.integers(1, 4))
    numbers = st.floats(0.3, 3.0)
    masses = np.array(data.draw(st.lists(numbers, min_size=n + 2, max_size=n + 2)))
    lengths = np.array(data.draw(st.lists(numbers, min_size=n + 1, max_size=n + 1)))
    stiffness = np.array(data.draw(st.lists(numbers, min_size=n, max_size=n)))
    positions = np.concatenate([[0.0], np.cumsum(lengths)])
    # every node's mass to the link inside it, the root's to the first
    links = [(m, float(x), 0.0) for m, x in zip(masses[1:], positions[1:], strict=True)]
    x0 = links[0][1]
    total = masses[0] + masses[1]
    links[0] = (total, masses[1] * x0 / total, masses[0] * masses[1] / total * x0**2)
    hinges = list(zip(positions[1:-1].tolist(), stiffness.tolist(), strict=True))
    rigid, frequencies, participation = dense_port(links, hinges)
    nodes = realise(PortModel(rigid, frequencies, participation))
    assert nodes.masses == close(masses, rel=UNIQUE)
    assert nodes.lengths == close(lengths, rel=UNIQUE)
    assert nodes.stiffness == close(stiffness, rel=UNIQUE)


def test_scaling_the_beam_scales_the_chain():
    unit, seed = (realise(make().port("xy", 6).truncated(3)) for make in (unit_beam, seed_boom))
    length, mass = 15.0, 7800.0 * np.pi * 0.006**2 * 15.0
    bending = 2.06e11 * np.pi * 0.012**4 / 64.0
    assert seed.masses == close(unit.masses * mass, rel=OWN)
    assert seed.lengths == close(unit.lengths * length, rel=OWN)
    assert seed.stiffness == close(unit.stiffness * bending / length, rel=OWN)


# -- what cannot be realised -------------------------------------------------------------------------------------------
@pytest.mark.parametrize("make", [unit_beam, seed_boom])
def test_eight_clamped_modes_of_a_uniform_beam_are_not_physical(make):
    with pytest.raises(RealisationError, match=r"with 8 flexible modes is not physical: length of link \d would be -"):
        realise(make().port("xy", 8).truncated(8))


def test_the_message_names_the_cure():
    with pytest.raises(
        RealisationError, match='Keep fewer modes, or choose another target \\("clamped", "free", "hub"'
    ):
        realise(unit_beam().port("xy", 8).truncated(8))


def test_a_target_without_residual_mass_is_refused():
    # one point mass on a sprung massless rod: the chain would need a hinge at the root
    port = PortModel(np.array([[1.0, 1.0], [1.0, 1.0 + 1e-3]]), np.array([3.0]), np.array([[1.0, 1.0]]))
    with pytest.raises(RealisationError, match="displacement meets no mass"):
        realise(port)


# -- split -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("make", [seed_boom, tapered_boom, stepped_boom, tip_loaded_boom])
def test_links_carry_the_beam_s_own_mass(make, n):
    beam = make()
    chain = planar_chain(realise(beam.port("xy", 8).truncated(n)), beam)
    for i, link in enumerate(chain.links):
        last = i == n
        real = beam.moments(link.start, link.start + link.length, closed=last)
        assert link.mass == close(real.mass, rel=OWN)
        assert 0.0 < link.inertia[0] <= 2.0 * link.inertia[2]
    assert sum(link.inertia[0] for link in chain.links) == close(beam.rigid_mass()[3, 3], rel=OWN)


@pytest.mark.parametrize("n", range(1, 8))
@pytest.mark.parametrize("make", [seed_boom, tapered_boom, stepped_boom, tip_loaded_boom])
def test_mass_centre_and_inertia_are_the_beam_s(make, n):
    beam = make()
    for target in targets(beam).values():
        chain = planar_chain(realise(target(n)), beam)
        ours, real = chain.rigid_mass(), beam.rigid_mass()
        assert chain.mass == close(real[0, 0], rel=SUMS)
        assert sum(link.mass * link.com for link in chain.links) / chain.mass == close(
            real[1, 5] / real[0, 0], rel=SUMS * 10
        )
        for i, j in ((1, 1), (1, 5), (5, 5), (2, 2), (2, 4)):
            assert ours[i, j] == close(real[i, j], rel=OWN)
        assert chain.length == beam.length
        assert sum(link.length for link in chain.links) == close(beam.length, rel=SUMS)


def test_split_where_the_natural_one_would_be_negative():
    nodes = Nodes(np.array([0.1, 0.2, 0.3, 0.4]), np.array([1.0, 2.0, 1.0]), np.array([1.0, 1.0]))
    for wanted in ([0.05, 0.4, 0.55], [0.5, 0.1, 0.4]):  # less than the root node, more than two nodes hold
        mass, com, inertia = split(nodes, np.array(wanted), share=0.02)
        assert np.all(mass > 0.0)
        assert np.all(inertia > 0.0)
        assert np.all((com > 0.0) & (com < nodes.lengths))
        # the whole is unchanged: mass, first and second moment of the point masses
        x, start = nodes.positions, nodes.positions[:-1]
        assert mass.sum() == close(nodes.masses.sum(), rel=SUMS)
        assert mass @ (start + com) == close(nodes.masses @ x, rel=SUMS)
        assert mass @ (start + com) ** 2 + inertia.sum() == close(nodes.masses @ x**2, rel=SUMS)


# -- the chain itself --------------------------------------------------------------------------------------------------
def test_chain_refuses_the_wrong_number_of_hinges():
    link = Link(0.0, 1.0, 1.0, 0.5, (0.1, 0.1, 0.1))
    with pytest.raises(RealisationError, match="2 links need 1 hinges, not 0"):
        Chain(links=(link, link), hinges=(), length=2.0)


def test_hinges_refuse_negative_stiffness_and_unknown_ports():
    with pytest.raises(RealisationError, match=r"hinge at x = 1 m: stiffness xy = -2\.0 must not be negative"):
        Hinge(x=1.0, stiffness={"xy": -2.0})
    with pytest.raises(ValueError, match=r"hinge\.stiffness = 'yx' is unknown; choose one of xy, xz, torsion, axial"):
        Hinge(x=1.0, stiffness={"yx": 2.0})
    with pytest.raises(TypeError, match="does not support item assignment"):
        Hinge(x=1.0, stiffness={"xy": 2.0}).stiffness["xy"] = 3.0  # type: ignore[index]


@pytest.mark.parametrize(("port", "index", "axis"), [("torsion", 0, 3), ("axial", None, 0)])
def test_chain_port_of_one_motion(port, index, axis):
    # J1 - k1 - J2 - k2 - J3 against the 2x2 eigenproblem written out
    values = (0.3, 0.5, 0.7)
    links = tuple(
        Link(float(i), 1.0, v if port == "axial" else 1.0, i + 0.5, (v, 1.0, 1.0)) for i, v in enumerate(values)
    )
    chain = Chain(links, tuple(Hinge(float(i), {port: k}) for i, k in ((1, 4.0), (2, 2.5))), 3.0)
    model = chain.port(port)
    # absolute angles held at the root: K = [[k1 + k2, -k2], [-k2, k2]]
    squares = np.linalg.eigvals(np.linalg.solve(np.diag(values[1:]), np.array([[6.5, -2.5], [-2.5, 2.5]])))
    assert model.frequencies == close(np.sqrt(np.sort(squares.real)), rel=OWN)
    assert model.rigid_mass[0, 0] == close(sum(values), rel=SUMS)
    assert chain.rigid_mass()[axis, axis] == close(sum(values), rel=SUMS)


def test_tip_of_the_chain_is_the_last_link_s_end():
    # static: a moment-free tip deflection per root acceleration, from hinge moments written out
    beam = seed_boom()
    chain = planar_chain(realise(beam.port("xy", 8).truncated(3)), beam)
    port = chain.port("xy")
    ours = port.tip.T @ (port.participation / port.frequencies[:, None] ** 2)
    for column in range(2):
        deflection = slope = 0.0
        for j, hinge in enumerate(chain.hinges):
            outer = chain.links[j + 1 :]
            moment = sum(
                k.mass * (k.com - hinge.x) * (1.0 if column == 0 else k.com) + k.inertia[2] * column for k in outer
            )
            slope += moment / hinge.stiffness["xy"]
            deflection += moment / hinge.stiffness["xy"] * (chain.length - hinge.x)
        assert ours[:, column] == close(np.array([deflection, slope]), rel=1e-10)


def test_hinge_angles_of_the_modes_diagonalise_stiffness_and_mass():
    # row k holds psi_k of the mass-normalised mode: strain energy W_k^2 / 2, no coupling of two modes
    beam = seed_boom()
    chain = planar_chain(realise(beam.port("xy", 8).truncated(4)), beam)
    port = chain.port("xy")
    shapes = chain.shapes("xy", port)
    stiffness = np.array([h.stiffness["xy"] for h in chain.hinges])
    energy = (shapes * stiffness) @ shapes.T
    assert energy == close(np.diag(port.frequencies**2), abs=1e-10 * port.frequencies[-1] ** 2)
    _, rows = chain.rows(chain.freedoms(["xy"]))
    assert shapes @ (rows.T @ rows) @ shapes.T == close(np.eye(4), abs=1e-11)
    # signs belong to the participation: tip rotation of mode k is the sum of its angles
    assert np.sum(shapes, axis=1) == close(port.tip[:, 1], rel=1e-9)
