"""The strain elements give the beam's own frequencies and port,
held against closed forms and transfer matrices.

References: characteristic equations of uniform beams (Blevins, Formulas for Natural Frequency and
Mode Shape), Bessel functions for the truncated wedge and cone (Kirchhoff 1879), transfer matrices
in 30 digits for everything piecewise.
"""

from math import pi

import mpmath
import numpy as np
import pytest
from msgspec import structs

import finite_elements as fe
from appendages import (
    STEEL,
    TransferMatrix,
    close,
    panels,
    roots_within,
    seed_boom,
    sign_changes,
    soft_root_boom,
    stepped_boom,
    timoshenko_boom,
    tip_loaded_boom,
    unit_beam,
)
from beamchain import (
    Beam,
    Equivalent,
    Joint,
    Lump,
    PortModel,
    Rectangle,
    Round,
    Segment,
)
from beamchain.structure import discretise
from spec_tables import table_of
from uniform_beam import are_coupled, free_roots, held_roots

# what `Beam.port` promises for the modes asked for, with room for the rounding of ten modes
FREQUENCY = 1e-11
# a mode shape converges half as fast as its frequency and carries the SVD's rounding
PARTICIPATION = 1e-10
# the dynamic mass is a sum over modes, some beyond those asked for; taken away from resonance
RESPONSE = 1e-9
LOPSIDED = (
    # free modes of a beam far lighter at its root than at its tip:
    # the rigid motion that is taken off is large; 4e-11 to 1.01e-10 by OpenBLAS's kernel
    1e-9
)
# residual mass: a difference that leaves 1e-3 of the rigid mass or less, in double precision
MASS = 1e-12
SLOPE = 0.15  # log-log slope between two refinements, before the asymptote is quite reached

MODES = 10


# -- uniform: transcendental solution --------------------------------------------------------------
@pytest.mark.parametrize("make", [unit_beam, seed_boom])
def test_uniform_beam_held_and_free(make):
    beam = make()
    unit = 1.0 if make is unit_beam else np.sqrt(2.06e11 * 0.012**2 / 16.0 / 7800.0) / 15.0**2
    port = beam.port("xy", MODES)
    assert port.frequencies[:MODES] == close(held_roots(MODES) ** 2 * unit, rel=FREQUENCY)
    assert port.free_frequencies[:MODES] == close(free_roots(MODES) ** 2 * unit, rel=FREQUENCY)


@pytest.mark.parametrize("segments", [1, 20])
def test_many_modes_and_many_segments(segments):
    one = Segment(length=1.0 / segments, section=unit_beam().segments[0].section)
    port = Beam(segments=(one,) * segments).port("xy", 20)
    assert port.frequencies[:20] == close(held_roots(20) ** 2, rel=FREQUENCY)
    assert port.free_frequencies[:20] == close(free_roots(20) ** 2, rel=FREQUENCY)


@pytest.mark.parametrize(
    "hub", [(0.1, 0.0, 0.01), (1.0, 0.0, 0.1), (10.0, 3.0, 2.0), (1000.0, -40.0, 100.0)]
)
def test_uniform_beam_on_a_hub(hub):
    mass = np.array([[hub[0], hub[1]], [hub[1], hub[2]]])
    coupled = unit_beam().port("xy", MODES).with_hub(mass).free_frequencies[:MODES]
    assert are_coupled(coupled, mass, FREQUENCY)


def test_uniform_beam_s_participation_and_tip():
    # cos bl cosh bl = -1; normalised: translation 2 s / b, rotation 2 / b^2 (b = beta L), tip +-2
    port = unit_beam().port("xy", MODES)
    for k in range(MODES):
        with mpmath.workdps(30):
            b = mpmath.findroot(lambda z: mpmath.cos(z) + 1 / mpmath.cosh(z), (k + 0.5) * mpmath.pi)
            sigma = (mpmath.cosh(b) + mpmath.cos(b)) / (mpmath.sinh(b) + mpmath.sin(b))
            expected = [float(2 * sigma / b), float(2 / b**2)]
        assert port.frequencies[k] == close(float(b**2), rel=FREQUENCY)
        assert np.abs(port.participation[k]) == close(np.array(expected), rel=PARTICIPATION)
        assert port.participation[k, 0] > 0.0  # the sign rule of PortModel
        assert abs(port.tip[k, 0]) == close(2.0, rel=PARTICIPATION)


@pytest.mark.parametrize(("port", "speed"), [("torsion", np.sqrt(1.0 / 1e-3)), ("axial", 1.0)])
def test_uniform_torsion_and_axial_motion(port, speed):
    model = unit_beam().port(port, MODES)
    k = np.arange(1, MODES + 1)
    assert model.frequencies[:MODES] == close((k - 0.5) * pi * speed, rel=FREQUENCY)
    assert model.free_frequencies[:MODES] == close(k * pi * speed, rel=FREQUENCY)
    inertia = model.rigid_mass[0, 0]
    assert model.participation[:MODES, 0] == close(
        np.sqrt(2.0 * inertia) / ((k - 0.5) * pi), rel=PARTICIPATION
    )
    omega = np.array([0.3, 2.2, 7.7]) * speed
    expected = inertia * np.tan(omega / speed) / (omega / speed)
    assert model.D(omega)[0, 0].real == close(expected, rel=RESPONSE)


# -- uniform with something at an end: characteristic equations ------------------------------------
@pytest.mark.parametrize("ratio", [0.01, 1.0, 5.18, 1000.0])
def test_tip_mass(ratio):
    port = tip_loaded_boom(ratio).port("xy", 6)

    def characteristic(w):
        with mpmath.workdps(30):
            z = mpmath.sqrt(mpmath.mpf(w))
            c = mpmath.cos(z)
            s = mpmath.sin(z)
            ch = mpmath.cosh(z)
            sh = mpmath.sinh(z)
            return 1 + c * ch + ratio * z * (c * sh - s * ch)

    assert all(roots_within(characteristic, port.frequencies[:6], FREQUENCY))
    assert sign_changes(characteristic, 1e-3, port.frequencies[5] * 1.001, 200) == 6


@pytest.mark.parametrize("stiffness", [1e-6, 0.1, 3.0, 1e8])
def test_root_spring(stiffness):
    port = soft_root_boom(stiffness).port("xy", 6)

    def characteristic(w):
        with mpmath.workdps(30):
            z = mpmath.sqrt(mpmath.mpf(w))
            c = mpmath.cos(z)
            s = mpmath.sin(z)
            ch = mpmath.cosh(z)
            sh = mpmath.sinh(z)
            return stiffness * (1 + c * ch) - z * (s * ch - c * sh)

    assert all(roots_within(characteristic, port.frequencies[:6], FREQUENCY))
    assert sign_changes(characteristic, 1e-4, port.frequencies[5] * 1.001, 200) == 6


def test_a_very_stiff_joint_is_no_joint():
    joint = soft_root_boom(1e15).port("xy", 4)
    assert joint.frequencies[:4] == close(unit_beam().port("xy", 4).frequencies[:4], rel=FREQUENCY)


def test_a_root_lump_adds_rigid_mass_only():
    lump = Lump(x=0.0, mass=2.0, inertia=(0.1, 0.2, 0.25))
    loaded = Beam(segments=unit_beam().segments, lumps=(lump,)).port("xy", 4)
    bare = unit_beam().port("xy", 4)
    assert loaded.frequencies == close(bare.frequencies, rel=FREQUENCY)
    assert loaded.rigid_mass - bare.rigid_mass == close(np.diag([2.0, 0.25]), rel=MASS)
    assert loaded.free_frequencies[:4] == close(
        bare.with_hub(np.diag([2.0, 0.25])).free_frequencies[:4], rel=FREQUENCY
    )


# -- piecewise: transfer matrices ------------------------------------------------------------------
def rod(length, diameter):
    area = pi * diameter**2 / 4
    second = pi * diameter**4 / 64
    return ("piece", length, STEEL.youngs_modulus * second, STEEL.density * area)


def bar(length, b, h, k):
    g = STEEL.youngs_modulus / 2.6
    area = b * h
    second = h * b**3 / 12
    return (
        "piece",
        length,
        STEEL.youngs_modulus * second,
        STEEL.density * area,
        k * g * area,
        STEEL.density * second,
    )


PANEL = (4000.0, 6.0)
PIECEWISE = {
    "stepped": (stepped_boom, [rod(3.0, 0.03), rod(4.0, 0.024), rod(3.5, 0.02)]),
    "step of 1 to 10": (
        lambda: Beam(
            segments=(
                Segment(length=1.0, section=Round(diameter=0.01), material=STEEL),
                Segment(length=1.0, section=Round(diameter=0.1), material=STEEL),
            )
        ),
        [rod(1.0, 0.01), rod(1.0, 0.1)],
    ),
    "timoshenko": (timoshenko_boom, [bar(2.0, 0.3, 0.2, 0.85)]),
    "panels": (
        panels,
        [
            ("joint", 2500.0),
            ("piece", 2.0, *PANEL),
            ("joint", 1800.0),
            ("piece", 1.1, *PANEL),
            ("body", 1.7, 0.04),
            ("piece", 0.9, *PANEL),
            ("joint", 1800.0),
            ("piece", 2.0, *PANEL),
        ],
    ),
    "euler, joint, timoshenko, lump": (
        lambda: Beam(
            segments=(
                Segment(length=1.5, section=Rectangle(width_y=0.1, width_z=0.2), material=STEEL),
                Segment(
                    length=1.0,
                    section=Rectangle(width_y=0.15, width_z=0.1),
                    material=STEEL,
                    theory="timoshenko",
                    shear_factor=5.0 / 6.0,
                ),
            ),
            joints=(Joint(after_segment=1, stiffness_xy=2e6),),
            lumps=(Lump(x=2.5, mass=60.0, inertia=(2.0, 1.0, 2.5)), Lump(x=1.5, mass=20.0)),
        ),
        [
            bar(1.5, 0.1, 0.2, 1.0)[:4],
            ("body", 20.0),
            ("joint", 2e6),
            bar(1.0, 0.15, 0.1, 5 / 6),
            ("body", 60.0, 2.5),
        ],
    ),
}


@pytest.mark.parametrize("name", PIECEWISE)
@pytest.mark.slow
def test_piecewise_frequencies(name):
    make, steps = PIECEWISE[name]
    port = make().port("xy", 6)
    exact = TransferMatrix(steps)
    count = 6
    assert all(roots_within(exact.held, port.frequencies[:count], FREQUENCY))
    tolerance = LOPSIDED if name == "step of 1 to 10" else FREQUENCY
    assert all(roots_within(exact.free, port.free_frequencies[:count], tolerance))


@pytest.mark.parametrize("name", PIECEWISE)
def test_piecewise_dynamic_mass(name):
    make, steps = PIECEWISE[name]
    port = make().port("xy", 6)
    exact = TransferMatrix(steps)
    w = port.frequencies
    for omega in (0.5 * w[0], 0.5 * (w[0] + w[1]), 0.6 * w[2] + 0.4 * w[3], 0.5 * (w[4] + w[5])):
        expected = exact.dynamic_mass(omega)
        error = np.abs(port.D(omega)[:, :, 0].real - expected)
        scale = np.sqrt(np.outer(np.abs(np.diag(expected)), np.abs(np.diag(expected))))
        assert np.max(error / scale) < RESPONSE


@pytest.mark.slow
def test_no_mode_is_missed():
    make, steps = PIECEWISE["stepped"]
    port = make().port("xy", 6)
    exact = TransferMatrix(steps, digits=20)
    for function, w in ((exact.held, port.frequencies), (exact.free, port.free_frequencies)):
        assert sign_changes(function, 0.05 * w[0], 0.5 * (w[3] + w[4]), 24) == 4


# -- tapered: Bessel functions ---------------------------------------------------------------------
def truncated(power, end):
    """Characteristic function of kappa for `(u^(p+2) w'')'' = kappa^4 u^p w`, held at u = 1,
    free at u = `end`.

    With z = 2 kappa sqrt(u): w = u^(-p/2) (J_p, Y_p, I_p, K_p)(z),
    and every derivative is again one Bessel function.
    """
    p = power

    def function(kappa):
        with mpmath.workdps(30):
            k = mpmath.mpf(kappa)

            def row(u, order, shift, signs):
                z = 2 * k * mpmath.sqrt(u)
                bessel = (mpmath.besselj, mpmath.bessely, mpmath.besseli, mpmath.besselk)
                return [
                    s * b(order, z) * mpmath.mpf(u) ** shift
                    for s, b in zip(signs, bessel, strict=True)
                ]

            system = mpmath.matrix(
                [
                    row(1, p, 0, (1, 1, 1, 1)),  # w
                    row(1, p + 1, 0, (-1, -1, 1, -1)),  # w' / kappa
                    row(mpmath.mpf(end), p + 2, 0, (1, 1, 1, 1)),  # moment
                    row(mpmath.mpf(end), p + 1, 0, (1, 1, 1, -1)),  # shear
                ]
            )
            for j in range(4):  # mpmath calls a badly scaled matrix singular
                system[:, j] = system[:, j] / max(abs(v) for v in system[:, j])
            return mpmath.det(system)

    return function


@pytest.mark.parametrize(
    ("power", "end"),
    [(1, 0.01), (2, 0.1)],
)
@pytest.mark.slow
def test_truncated_wedge_and_cone(power, end):
    length, d = 3.0, 0.2
    if power == 1:
        root = Rectangle(width_y=d, width_z=0.5)
        tip = Rectangle(width_y=end * d, width_z=0.5)
        radius_of_gyration = d / np.sqrt(12.0)
    else:
        root = Round(diameter=d)
        tip = Round(diameter=end * d)
        radius_of_gyration = d / 4.0
    port = Beam(
        segments=(Segment(length=length, section=root, section_end=tip, material=STEEL),)
    ).port("xy", 5)
    unit = (
        np.sqrt(STEEL.youngs_modulus / STEEL.density)
        * radius_of_gyration
        * ((1.0 - end) / length) ** 2
    )
    kappa = np.sqrt(port.frequencies[:5] / unit)
    function = truncated(power, end)
    assert all(roots_within(function, kappa, FREQUENCY / 2))  # omega is kappa squared
    assert sign_changes(function, 0.2 * kappa[0], 0.5 * (kappa[2] + kappa[3]), 12) == 3


def test_nearly_sharp_wedge_and_cone_approach_kirchhoff():
    # Kirchhoff (1879): sharp wedge 5.315, sharp cone 8.719 sqrt(EI / m L^4) at the root,
    # printed to four digits
    for section, sharp, gyration, expected in (
        (
            Rectangle(width_y=0.1, width_z=0.1),
            Rectangle(width_y=1e-4, width_z=0.1),
            0.1 / np.sqrt(12.0),
            5.315,
        ),
        (Round(diameter=0.1), Round(diameter=1e-4), 0.025, 8.719),
    ):
        beam = Beam(
            segments=(Segment(length=5.0, section=section, section_end=sharp, material=STEEL),)
        )
        # of the sharp one
        unit = np.sqrt(STEEL.youngs_modulus / STEEL.density) * gyration * ((1.0 - 1e-3) / 5.0) ** 2
        assert beam.port("xy", 2).frequencies[0] / unit == close(expected, abs=1e-3)


def test_a_taper_towards_the_root_is_the_same_beam_turned_round():
    # a free beam does not know which end is called the root
    forward = Segment(
        length=2.0, section=Round(diameter=0.1), section_end=Round(diameter=0.01), material=STEEL
    )
    back = Segment(
        length=2.0, section=Round(diameter=0.01), section_end=Round(diameter=0.1), material=STEEL
    )
    a = Beam(segments=(forward,)).port("xy", 5)
    b = Beam(segments=(back,)).port("xy", 5)
    assert a.free_frequencies[:5] == close(b.free_frequencies[:5], rel=LOPSIDED)


def test_a_segment_cut_in_two_is_the_same_beam():
    whole = Segment(
        length=2.0, section=Round(diameter=0.1), section_end=Round(diameter=0.04), material=STEEL
    )
    middle = Round(diameter=0.07)
    halves = (
        Segment(length=1.0, section=Round(diameter=0.1), section_end=middle, material=STEEL),
        Segment(length=1.0, section=middle, section_end=Round(diameter=0.04), material=STEEL),
    )
    a = Beam(segments=(whole,)).port("xy", 6)
    b = Beam(segments=halves).port("xy", 6)
    assert a.frequencies[:6] == close(b.frequencies[:6], rel=FREQUENCY)
    assert a.participation[:6] == close(b.participation[:6], rel=PARTICIPATION)


# -- the residual mass -----------------------------------------------------------------------------
@pytest.mark.parametrize("make", [unit_beam, seed_boom, stepped_boom, panels, timoshenko_boom])
def test_static_correction_is_the_beam_s_own(make):
    # the root's static inertia force bends the beam as its own weight would:
    # sum L L^T / w^2 is independent of modes
    few = make().port("xy", 2)
    many = make().port("xy", 20)

    def compliance(port: PortModel) -> np.ndarray:
        return (port.participation.T / port.frequencies**2) @ port.participation

    assert compliance(few) == close(compliance(many), rel=PARTICIPATION)


# -- convergence -----------------------------------------------------------------------------------
def test_stiffness_contrast_costs_no_digits():
    # a boom on a joint 1e9 times softer than itself: pendulum-like first mode,
    # w^2 = 3 c / (m L^2) in the limit
    port = soft_root_boom(1e-9).port("xy", 3)
    # next term of the expansion is of order c L / EI
    assert port.frequencies[0] == close(np.sqrt(3e-9), rel=1e-9)
    pinned = [15.418205728, 49.964862032]  # tan z = tanh z
    assert port.frequencies[1:3] == close(pinned, rel=1e-9)


def test_xz_uses_its_own_stiffness():
    section = Equivalent(bending_stiffness_xy=1.0, bending_stiffness_xz=4.0, linear_mass=1.0)
    beam = Beam(segments=(Segment(length=1.0, section=section),))
    assert beam.port("xz", 3).frequencies[:3] == close(
        2.0 * beam.port("xy", 3).frequencies[:3], rel=FREQUENCY
    )


# -- many pieces: the same rows, never written down ------------------------------------------------
def crowded(kind: str, count: int) -> Beam:
    """`count` unequal pieces: by lumps, by segments (tapered or with shear),
    or by joints with lumps."""
    draw = np.random.default_rng(5)
    size = lambda: 0.05 * (1.0 + 0.2 * float(draw.random()))  # noqa: E731
    lumps = [
        Lump(x=20.0 * (i + 1) / count, mass=0.1 + float(draw.random()), inertia=(0.01, 0.01, 0.01))
        for i in range(count)
    ]
    if kind == "lumps":
        return Beam(
            segments=(Segment(length=20.0, section=Round(diameter=0.05), material=STEEL),),
            lumps=tuple(lumps),
        )
    segments = [
        Segment(
            length=20.0 / count * (1.0 + float(draw.random())),
            section=Round(diameter=size()),
            section_end=Round(diameter=size()) if kind == "tapered" else None,
            material=STEEL,
            theory="timoshenko" if kind == "shear" and i % 3 else "euler",
        )
        for i in range(count)
    ]
    joints = [
        Joint(
            after_segment=i, stiffness_xy=float(10.0 ** draw.uniform(2, 6)), stiffness_torsion=300.0
        )
        for i in range(0, count, 2)
    ]
    return Beam(
        segments=tuple(segments),
        joints=tuple(joints) if kind == "joints" else (),
        lumps=tuple(lumps) if kind == "joints" else (),
    )


CROWDED = [
    ("segments", "torsion"),
    ("lumps", "xy"),
    ("lumps", "axial"),
    ("joints", "xy"),
    ("tapered", "torsion"),
    ("shear", "xz"),
]


@pytest.mark.parametrize(("kind", "port"), CROWDED)
def test_many_pieces_are_the_finite_elements(kind, port, monkeypatch):
    """As for hundreds of pieces, the beam's rows are never written down."""
    monkeypatch.setattr(discretise, "WRITTEN", 0)
    beam = crowded(kind, 8)
    wanted = 4
    few = beam.port(port, wanted)
    truth = fe.port(table_of(beam), port, wanted)
    hub = 0.3 * truth.rigid
    assert few.rigid_mass == close(truth.rigid, rel=PARTICIPATION, abs=1e-12 * np.max(truth.rigid))
    assert few.frequencies[:wanted] == close(truth.frequencies, rel=FREQUENCY)
    assert few.free_frequencies[:wanted] == close(truth.coupled(None, wanted), rel=FREQUENCY)
    assert few.with_hub(hub).free_frequencies[:wanted] == close(
        truth.coupled(hub, wanted), rel=FREQUENCY
    )
    size = np.max(np.abs(truth.participation), axis=0)
    assert few.participation[:wanted] / size == close(
        truth.participation / size, rel=PARTICIPATION, abs=PARTICIPATION
    )
    reach = np.max(np.abs(truth.tip), axis=0)
    assert few.tip[:wanted] / reach == close(
        truth.tip / reach, rel=PARTICIPATION, abs=PARTICIPATION
    )
    scale = np.sqrt(np.diag(truth.rigid))
    elastic = truth.rows.elastic
    carried = truth.rows.rigid
    for omega in np.sqrt(truth.frequencies[:-1] * truth.frequencies[1:]):
        # strain coordinates y of a root that moves by one: (1 - w^2 E^T E) y = w^2 E^T R
        strain = np.linalg.solve(
            np.eye(elastic.shape[1]) - omega**2 * elastic.T @ elastic, elastic.T @ carried
        )
        exact = truth.rigid + omega**2 * carried.T @ elastic @ strain
        assert np.max(np.abs(few.D(omega)[:, :, 0] - exact) / np.outer(scale, scale)) < RESPONSE


@pytest.mark.parametrize("port", ["xy", "torsion"])
@pytest.mark.slow
def test_five_hundred_bays_are_one(port):
    """Equal bays, kept apart by hair's breadths of stiffness, against the one rod they are."""
    section = unit_beam().segments[0].section
    other = structs.replace(
        section,
        bending_stiffness_xy=1.0 + 1e-13,
        torsion_stiffness=section.torsion_stiffness * (1.0 + 1e-13),
    )
    bays = tuple(Segment(length=1.0 / 500, section=(section, other)[i % 2]) for i in range(500))
    whole = unit_beam()
    cut = Beam(segments=bays)
    assert cut.port(port, MODES).frequencies[:MODES] == close(
        whole.port(port, MODES).frequencies[:MODES], rel=FREQUENCY
    )


@pytest.mark.slow
def test_five_hundred_of_everything():
    beam = crowded("joints", 500)
    model = beam.port("xy", 4)
    assert model.modes < 500
    assert float(model.rigid_mass[0, 0]) == close(float(beam.rigid_mass()[0, 0]), rel=1e-12)
