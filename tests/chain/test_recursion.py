"""A planar chain with its springs on the hinges behaves at its root as its target does, in rigid
bodies that carry the beam's own mass.

Everything is read from the exported file as plain MuJoCo compiles it. Its mass and
stiffness matrices are written out again and solved with LAPACK; the truth comes from the
tests' own finite elements.
"""

from functools import cache

import numpy as np
import pytest

import beamchain as bc
import finite_elements as fe
import readback as rb
from appendages import (
    REALISABLE,
    close,
    dense_port,
    drawn_rods,
    modes_of_rods,
    panels,
    seed_boom,
    stepped_boom,
    timoshenko_boom,
    unit_beam,
)
from planar_truth import hub_of, kept_for
from spec_tables import table_of
from written_chain import read_chain

PRINTED = 1.0  # units of the last printed digit of the method
# LAPACK's generalised eigenproblem on matrices whose entries span 1e4;
# the recursion itself keeps 4e-12
FORWARD = 1e-9
# the chain's port against its target's, no eigenproblem of LAPACK's between them; 4e-12 at n = 7
OWN = 1e-11
# top free modes hang on the residual mass, a difference that leaves 1e-5 of the rigid mass
FREE = 1e-9
SUMS = 1e-12  # sums of masses and first moments
# a chain drawn at random and recovered: a nonlinear inverse problem, up to 1e7 roundings
UNIQUE = 1e-6

#: every shape, every target, every number of modes
CASES = [
    ("uniform", "clamped", 7),
    ("tapered", "free", 4),
    ("tapered", "hub", 6),
    ("stepped", "clamped", 3),
    ("stepped", "hub", 7),
    ("tip-loaded 0.1", "clamped", 7),
    ("tip-loaded 1", "hub", 2),
    ("tip-loaded 1", "free", 7),
    ("tip-loaded 10", "free", 1),
    ("soft root", "clamped", 5),  # more is not physical, with a root of up to 30 EI / L
]


@cache
def fitted(make, target: str, n: int, port: str = "xy") -> bc.Fit:
    beam = make()
    other = "xz" if port == "xy" else "xy"
    root = bc.spec.Root(target=target, hub=hub_of(beam) if target == "hub" else None)
    return bc.fit(beam, modes={port: n, other: 0}, root=root)


@cache
def written(make, target: str, n: int, port: str = "xy"):
    return read_chain(fitted(make, target, n, port).to_mjcf())


# -- reference values ------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("target", "n", "masses", "lengths", "stiffness"),
    [
        ("clamped", 1, "0.081651 0.30527 0.61308", "0.1789 0.54757", "2.2725"),
        (
            "clamped",
            2,
            "0.047274 0.15135 0.38434 0.41704",
            "0.10061 0.27585 0.43902",
            "4.0463 3.487",
        ),
        (
            "clamped",
            3,
            "0.03265 0.1012 0.2518 0.2326 0.3816",
            "0.06894 0.1837 0.2357 0.3391",
            "5.917 5.738 3.244",
        ),
        ("free", 2, "0.083333 0.25986 0.26079 0.39602", "0.21418 0.24301 0.36376", "5.4848 3.3395"),
    ],
)
def test_unit_beam_has_the_printed_chain(target, n, masses, lengths, stiffness):
    nodes = written(unit_beam, target, n).nodes()
    for values, printed in zip(nodes, (masses, lengths, stiffness), strict=True):
        words = printed.split()
        assert values.size == len(words)
        for value, word in zip(values, words, strict=True):
            unit = 10.0 ** -len(word.partition(".")[2])
            assert value == close(float(word), abs=PRINTED * unit)


# -- forward ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(("kind", "target", "n"), CASES)
@pytest.mark.slow
def test_the_chain_has_the_target_s_port(kind, target, n):
    make = REALISABLE[kind]
    result = fitted(make, target, n)
    chain = written(make, target, n)
    wanted = kept_for(make(), target, n)
    assert "springs on the hinges" in result.status.message
    assert len(chain.bodies) == n + 1

    rigid, frequencies, participation = dense_port(*chain.planar())
    assert rigid == close(wanted.rigid, rel=OWN)
    assert frequencies == close(wanted.frequencies, rel=FORWARD)
    signs = np.sign(np.sum(participation * wanted.participation, axis=1))
    assert participation * signs[:, None] == close(wanted.participation, rel=FORWARD)

    own = result.chain.port("xy")
    aim = result.target["xy"]
    assert own.frequencies == close(aim.frequencies, rel=OWN)
    assert own.participation == close(aim.participation, rel=OWN)
    assert own.free_frequencies == close(aim.free_frequencies, rel=FREE)


@pytest.mark.parametrize(("kind", "target", "n"), CASES)
def test_the_chain_is_physical(kind, target, n):
    chain = written(REALISABLE[kind], target, n)
    masses, lengths, stiffness = chain.nodes()
    assert np.all(masses > 0.0)
    assert np.all(lengths > 0.0)
    assert np.all(stiffness > 0.0)
    starts = [body.start for body in chain.bodies]
    assert np.all(np.diff([*starts, chain.length]) > 0.0)
    assert all(body.moments_fit_together() for body in chain.bodies)
    # and together they have the beam's mass, centre and inertia
    make = REALISABLE[kind]
    reading = rb.read(fitted(make, target, n).to_mjcf())
    real = fe.rigid_mass(table_of(make()))
    assert reading.rigid[0, 0] == close(real[0, 0], rel=SUMS)
    assert reading.rigid[1, 5] / reading.rigid[0, 0] == close(
        real[1, 5] / real[0, 0], rel=SUMS * 10
    )
    for i, j in ((1, 1), (1, 5), (5, 5), (2, 2), (2, 4), (3, 3)):
        assert reading.rigid[i, j] == close(real[i, j], rel=OWN)
    assert written(make, target, n).length == close(make().length, rel=SUMS)


@pytest.mark.parametrize(
    ("make", "n"),
    [(panels, 3), (timoshenko_boom, 3)],
)
@pytest.mark.parametrize("target", ["clamped", "free", "hub"])
def test_other_beams_for_few_modes(make, target, n):
    wanted = kept_for(make(), target, n)
    frequencies, participation, _ = rb.read(fitted(make, target, n).to_mjcf()).port("xy")
    assert frequencies[:n] == close(wanted.frequencies, rel=OWN)
    assert participation[:n] == close(wanted.participation, rel=OWN)


def test_plane_xz_is_realised_with_its_own_numbers():
    wanted = kept_for(panels(), "clamped", 3, "xz")
    result = fitted(panels, "clamped", 3, "xz")
    assert result.chain.ports == ("xz",)
    frequencies, participation, _ = rb.read(result.to_mjcf()).port("xz")
    assert frequencies[:3] == close(wanted.frequencies, rel=OWN)
    assert participation[:3] == close(wanted.participation, rel=FORWARD)
    assert rb.read(result.to_mjcf()).port("xy")[0].size == 0  # rigid in the other plane


# -- the canonical chain is the only one -----------------------------------------------------------
@pytest.mark.parametrize("seed", range(8))
def test_any_chain_is_recovered_from_its_port(seed):
    # 3 N numbers from 3 N data: the canonical chain is unique
    n = seed % 4 + 1
    masses, lengths, stiffness = drawn_rods(seed, n)
    options = bc.spec.FitOptions(springs="hinges")
    result = bc.fit(modes_of_rods(masses, lengths, stiffness), modes={"xy": n}, options=options)
    found = read_chain(result.to_mjcf()).nodes()
    for ours, wanted in zip(found, (masses, lengths, stiffness), strict=True):
        assert ours == close(wanted, rel=UNIQUE)


def test_scaling_the_beam_scales_the_chain():
    unit, seed = (written(make, "clamped", 3).nodes() for make in (unit_beam, seed_boom))
    length = 15.0
    mass = 7800.0 * np.pi * 0.006**2 * 15.0
    bending = 2.06e11 * np.pi * 0.012**4 / 64.0
    for ours, base, scale in zip(seed, unit, (mass, length, bending / length), strict=True):
        assert ours == close(base * scale, rel=OWN)


# -- what cannot be realised -----------------------------------------------------------------------
@pytest.mark.parametrize("make", [unit_beam, seed_boom])
def test_eight_clamped_modes_of_a_uniform_beam_are_not_physical(make):
    result = bc.fit(make(), modes={"xy": 8, "xz": 0}, options=bc.spec.FitOptions(springs="hinges"))
    assert not result.status.ok
    assert "xy keeps 7 of the 8 modes asked for" in result.status.message
    [line] = [line for line in result.status.history if "8" in line]
    assert "with 8 flexible modes is not physical: length of link" in line
    assert "would be -" in line
    assert 'Keep fewer modes, or choose another target ("clamped", "free", "hub"' in line


# -- the bodies ------------------------------------------------------------------------------------
def mass_between(table: dict, start: float, end: float) -> float:
    """Mass of a stretch of the beam without lumps, by Gauss' rule on each segment."""
    total, x = 0.0, 0.0
    points, weights = np.polynomial.legendre.leggauss(12)
    for segment in table["segment"]:
        a = max(start, x)
        b = min(end, x + segment["length"])
        if b > a:
            at = (a + (b - a) * (1.0 + points) / 2.0 - x) / segment["length"]
            total += (b - a) / 2.0 * float(weights @ fe.section_properties(segment, at)["mass"])
        x += segment["length"]
    return total


@pytest.mark.parametrize("n", [1, 3, 5])
@pytest.mark.parametrize("kind", ["uniform", "tapered", "stepped", "tip-loaded 1"])
def test_links_carry_the_beam_s_own_mass(kind, n):
    make = REALISABLE[kind]
    chain = written(make, "clamped", n)
    table = table_of(make())
    polar = sum(body.inertia[0, 0] for body in chain.bodies)
    ends = [body.start for body in chain.bodies[1:]] + [make().length]
    for i, (body, end) in enumerate(zip(chain.bodies, ends, strict=True)):
        lump = sum(lump["mass"] for lump in table.get("lump", ())) if i == n else 0.0  # at the tip
        assert body.mass == close(mass_between(table, body.start, end) + lump, rel=OWN)
        assert 0.0 < body.inertia[0, 0] <= 2.0 * body.inertia[2, 2]
    assert polar == close(fe.rigid_mass(table)[3, 3], rel=OWN)


def test_tip_of_the_chain_is_the_last_link_s_end():
    # static: a moment-free tip deflection per root acceleration, from hinge moments written out
    chain = written(seed_boom, "clamped", 3)
    reading = rb.read(fitted(seed_boom, "clamped", 3).to_mjcf())
    tip = reading.site("appendage_tip")[:, [1, 5]]
    ours = tip.T @ (reading.participation[:, [1, 5]] / reading.frequencies[:, None] ** 2)
    for column in range(2):
        deflection = slope = 0.0
        for j, hinge in enumerate(chain.hinges):
            outer = chain.bodies[j + 1 :]
            moment = sum(
                body.mass * (body.com - hinge.x) * (1.0 if column == 0 else body.com)
                + body.inertia[2, 2] * column
                for body in outer
            )
            slope += moment / hinge.stiffness["xy"]
            deflection += moment / hinge.stiffness["xy"] * (chain.length - hinge.x)
        assert ours[:, column] == close(np.array([deflection, slope]), rel=1e-10)


# -- what moves in one motion only -----------------------------------------------------------------
def test_torsion_on_springs_is_a_row_of_discs():
    # J1 - k1 - J2 - ... from the compiled bodies,
    # against the eigenproblem written out in absolute angles
    result = bc.fit(seed_boom(), modes={"xy": 3, "xz": 0, "torsion": 3})
    assert "springs on the hinges" in result.status.message
    chain = read_chain(result.to_mjcf())
    inertias = [body.inertia[0, 0] for body in chain.bodies]
    springs = [hinge.stiffness["torsion"] for hinge in chain.hinges]
    steps = np.eye(3) - np.eye(3, k=-1)  # twist of each spring per absolute angle, the root held
    stiffness = steps.T @ np.diag(springs) @ steps
    squares = np.linalg.eigvals(np.linalg.solve(np.diag(inertias[1:]), stiffness))
    assert result.chain.port("torsion").frequencies == close(
        np.sqrt(np.sort(squares.real)), rel=OWN
    )
    assert rb.read(result.to_mjcf()).rigid[3, 3] == close(sum(inertias), rel=SUMS)


@pytest.mark.parametrize(("port", "axis"), [("torsion", 3), ("axial", 0)])
def test_chain_of_one_motion(port, axis):
    beam = fe.port(table_of(stepped_boom()), port, 3)
    reading = rb.read(bc.fit(stepped_boom(), modes={"xy": 0, "xz": 0, port: 3}).to_mjcf())
    frequencies, participation, _ = reading.port(port)
    assert frequencies[:3] == close(beam.frequencies, rel=OWN)
    assert participation[:3] == close(beam.participation, rel=FORWARD)
    assert reading.rigid[axis, axis] == close(beam.rigid[0, 0], rel=SUMS)
