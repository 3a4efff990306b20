"""Momentum and motion inside a beam: at the root the participation, at the tip nothing, in between
a share that the strain of the mode gives as well.

EXACT: rounding of sums. STRAIN: differences over a hundredth of a wave, to second order.
"""

import numpy as np
import pytest

import beamchain as bc
from beamchain.structure.section_loads import inside_beam, snapped

EXACT = 1e-12
COLUMNS = {"xy": [1, 5], "torsion": [3], "axial": [0]}
STRAIN = 1e-3
MATERIAL = bc.Material(youngs_modulus=7e10, density=2700.0)


def many():
    """So many different segments that the rows are not written down."""
    rng = np.random.default_rng(0)
    return bc.Beam(
        segments=[
            bc.Segment(
                length=0.1,
                section=bc.Tube(outer_diameter=0.1 * (1.0 + 0.1 * rng.random()), wall=0.002),
                material=MATERIAL,
            )
            for _ in range(60)
        ]
    )


def mixed():
    """A stocky taper, a rod, joints and lumps."""
    box = bc.Segment(
        length=2.0,
        section=bc.Box(width_y=0.1, width_z=0.2, wall=0.003),
        section_end=bc.Box(width_y=0.02, width_z=0.04, wall=0.003),
        material=MATERIAL,
        theory="timoshenko",
    )
    rod = bc.Segment(length=1.0, section=bc.Round(diameter=0.05), material=MATERIAL)
    joints = [
        bc.Joint(after_segment=0, stiffness_xy=1e3),
        bc.Joint(after_segment=1, stiffness_xy=1e4),
    ]
    lumps = [
        bc.Lump(x=1.5, mass=2.0, inertia=(0.1, 0.1, 0.1)),
        bc.Lump(x=3.0, mass=1.0),
    ]
    return bc.Beam(segments=[box, rod], joints=joints, lumps=lumps)


@pytest.mark.parametrize("port", ["xy", "torsion", "axial"])
@pytest.mark.parametrize("beam", [many(), mixed()], ids=["many", "mixed"])
def test_at_the_root_all_and_at_the_tip_nothing(beam, port):
    x = snapped(beam, np.array([0.0, beam.length]))
    found = inside_beam(beam, port, 8, lambda model, _: model.truncated(3), x)
    wanted = beam.port(port, 8).truncated(3)
    to_space = np.eye(6)[:, COLUMNS[port]]
    size = np.max(np.abs(wanted.participation))
    assert np.max(np.abs(found.frequencies / wanted.frequencies - 1.0)) < EXACT
    taken = to_space @ wanted.participation.T
    assert np.max(np.abs(found.momentum[0] - taken)) < EXACT * size
    assert np.max(np.abs(found.momentum[1])) < EXACT * size
    assert np.max(np.abs(found.motion[0])) == 0.0
    tip = wanted.tip.reshape(3, -1, wanted.motions)[:, 0]
    assert np.max(np.abs(found.motion[1] - to_space @ tip.T)) < 1e-8 * np.max(np.abs(tip))


UNIFORM = bc.Beam(
    segments=[
        bc.Segment(length=5.0, section=bc.Equivalent(bending_stiffness_xy=300.0, linear_mass=2.0))
    ]
)
#: EI half way along the taper, and of the rod
TAPER = 7e10 * (0.12 * 0.06**3 - 0.114 * 0.054**3) / 12.0
ROD = 7e10 * np.pi * 0.05**4 / 64.0


@pytest.mark.parametrize(
    ("beam", "x", "stiffness"),
    [(UNIFORM, 1.5, 300.0), (mixed(), 1.0, TAPER), (mixed(), 2.5, ROD)],
    ids=["uniform", "taper", "rod"],
)
def test_momentum_is_what_strain_gives(beam, x, stiffness):
    """`M = EI phi'` of a mode, its rotation differenced; behind joints and between lumps too."""
    h = 4e-3 * beam.length
    stations = np.array([x - h, x, x + h])
    found = inside_beam(beam, "xy", 8, lambda model, _: model.truncated(2), stations)
    turn = found.motion[:, 5]
    curvature = (turn[2] - turn[0]) / (2.0 * h)
    moment = found.momentum[1, 5] * found.frequencies**2
    assert stiffness * curvature == pytest.approx(moment, rel=STRAIN)


def test_stations_beside_a_step_stand_on_it():
    beam = mixed()
    assert snapped(beam, np.array([1.5 + 1e-9, 2.0 - 1e-8, 1.0])).tolist() == [1.5, 2.0, 1.0]


ROD = bc.Equivalent(bending_stiffness_xy=300.0, axial_stiffness=70.0, linear_mass=2.0)


@pytest.mark.parametrize("port", ["xy", "axial"])
def test_constant_loads_bend_and_stretch_a_uniform_beam_as_in_the_textbook(port):
    """Of 5 m, under accelerations of its root, which pull back, and under a force at 3 m."""
    length, at, m = 5.0, 3.0, 2.0
    beam = bc.Beam(segments=[bc.Segment(length=length, section=ROD)])
    s = np.array([1.0, 3.0, 5.0])
    found = inside_beam(beam, port, 4, lambda model, _: model.truncated(2), s, [at])
    carried = found.static[:, :, 15:]
    low = np.minimum(s, at)
    if port == "axial":
        # N = m (L - s), and m (L^2 - s^2) / 2 of a pull that grows with x, -(w_y^2 + w_z^2) x
        even, growing = length * s - s**2 / 2.0, length**2 * s / 2.0 - s**3 / 6.0
        assert found.static[:, 0, 0] == pytest.approx(-m / 70.0 * even, rel=1e-9)
        products = found.static[:, 0, 6:15].reshape(3, 3, 3)
        for i, j in np.ndindex(3, 3):
            wanted = m / 70.0 * growing if i == j > 0 else 0.0 * growing
            assert products[:, i, j] == pytest.approx(wanted, rel=1e-9)
        assert carried[:, 0, 0] == pytest.approx(low / 70.0, rel=1e-9)
        return
    # of m per length, and of m x
    even = s**2 * (6.0 * length**2 - 4.0 * length * s + s**2) / 24.0
    growing = s**2 * (20.0 * length**3 - 10.0 * length**2 * s + s**3) / 120.0
    assert found.static[:, 1, 1] == pytest.approx(-m / 300.0 * even, rel=1e-9)
    assert found.static[:, 1, 5] == pytest.approx(-m / 300.0 * growing, rel=1e-9)
    # a spin about x and y moves a point at x by w_x w_y x
    products = found.static[:, 1, 6:15].reshape(3, 3, 3)
    spun = products[:, 0, 1] + products[:, 1, 0]
    assert spun == pytest.approx(-m / 300.0 * growing, rel=1e-9)
    moved = np.where(s <= at, s**2 * (3.0 * at - s), at**2 * (3.0 * s - at)) / 6.0
    turned = np.where(s <= at, s * (at - s / 2.0), at**2 / 2.0)
    assert carried[:, 1, 1] == pytest.approx(moved / 300.0, rel=1e-9)
    assert carried[:, 5, 1] == pytest.approx(turned / 300.0, rel=1e-9)
    assert carried[:, 5, 5] == pytest.approx(low / 300.0, rel=1e-9)


def test_a_beam_that_is_rigid_in_a_port_does_nothing_there():
    stations = np.array([0.0, 1.0, 5.0])
    found = inside_beam(UNIFORM, "torsion", 4, lambda model, _: model, stations, [5.0])
    assert found.frequencies.size == found.motion.size == found.momentum.size == 0
    assert found.drives.shape == (0, 21)
    np.testing.assert_array_equal(found.static, np.zeros((3, 6, 21)))
