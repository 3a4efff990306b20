"""Two planes that share no hinges: both exact on one cut,
with as few hinges as the modes and the hinge lines need.

The judge is the written file in MuJoCo, read by the tests' own `readback`.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import readback as rb
from appendages import close, panels
from arrays import deployed_array, random_array, space_beam, tube
from beamchain import Beam, Equivalent, Hub, Joint, Lump, Modes, PortModel, Segment, Spec, fit
from beamchain.errors import RealisationError
from beamchain.spec import FitOptions, Root

EXACT = 1e-10  # frequencies and participation; 5e-12 measured
RIGID = 1e-12  # masses and positions are written with 17 digits
DECOUPLED = 1e-12  # 0 measured


def one_plane_taper():
    """EI falls to a quarter in plane xy and stays in plane xz."""
    a, b = (
        Equivalent(
            bending_stiffness_xy=ei,
            bending_stiffness_xz=30.0,
            linear_mass=2.0,
            torsion_stiffness=20.0,
            polar_inertia=1e-3,
        )
        for ei in (40.0, 10.0)
    )
    return Beam(segments=(Segment(length=5.0, section=a, section_end=b),))


def soft_root_in_one_plane():
    return Beam(
        segments=one_plane_taper().segments, joints=(Joint(after_segment=0, stiffness_xz=20.0),)
    )


def judge(beam, result, kept):
    """All kept modes of all ports, rigid mass and independence, in the file."""
    assert result.status.ok, result.status.message
    reading = rb.read(result.to_mjcf())
    for port, n in kept.items():
        wanted = beam.port(port, 2 * n + 4).truncated(n)
        frequencies, participation, _ = reading.port(port)
        assert frequencies[:n] == close(wanted.frequencies, rel=EXACT)
        assert participation[:n] == close(wanted.participation, rel=EXACT)
        # fillers lie above the modes kept
        assert np.all(frequencies[n:] > 1.5 * frequencies[n - 1])
        assert result.achieved[port].frequencies[:n] == close(wanted.frequencies, rel=EXACT)
        assert result.achieved[port].participation[:n] == close(wanted.participation, rel=EXACT)
    assert rb.mass_error(reading.rigid, beam.rigid_mass()) < RIGID
    assert rb.mass_error(result.measured.rigid_mass, beam.rigid_mass()) < RIGID
    assert reading.coupling() < DECOUPLED
    assert result.measured.coupling < DECOUPLED


# -- both planes exact -----------------------------------------------------------------------------
@cache
def chosen(make, kept):
    """The fit of a beam with these modes, `(port, count)` each."""
    return fit(make(), modes=dict(kept))


CASES = [
    (one_plane_taper, {"xy": 1, "xz": 2}),
    (one_plane_taper, {"xy": 2, "xz": 2}),
    (soft_root_in_one_plane, {"xy": 3, "xz": 3}),
    (panels, {"xy": 3, "xz": 3}),
    (deployed_array, {"xy": 1, "xz": 1}),
    (deployed_array, {"xy": 2, "xz": 3}),
    (deployed_array, {"xy": 3, "xz": 3, "torsion": 2}),
]


def needed(beam, port, n):
    """Hinges: one per mode, two for a single mode of a plane,
    and one more per hinge line that the appendage has."""
    return max(n, 2 if port in ("xy", "xz") else 1) + len(beam.hinge_lines(port))


@pytest.mark.parametrize(("make", "kept"), CASES)
@pytest.mark.slow
def test_both_planes_are_exact(make, kept):
    result = chosen(make, tuple(kept.items()))
    judge(make(), result, kept)
    assert "one tendon per mode" in result.status.message


@pytest.mark.parametrize(("make", "kept"), CASES)
def test_bodies_are_physical_and_hinges_few(make, kept):
    beam = make()
    chain = chosen(make, tuple(kept.items())).chain
    lines = len({x for port in kept for x in beam.hinge_lines(port)})
    assert len(chain.links) == len(chain.hinges) + 1
    assert len(chain.hinges) <= max(*kept.values(), 2) + lines  # one cut serves all planes
    for port, n in kept.items():
        assert (
            n
            <= sum(port in hinge.stiffness for hinge in chain.hinges)
            <= needed(beam, port, n) + lines
        )
    for link in chain.links:
        if link.start == link.length == link.mass == 0.0:
            # a hinge at the root stands on what carries the appendage
            assert chain.hinges[0].x == 0.0
            continue
        a, b, c = sorted(np.linalg.eigvalsh(link.inertia_matrix()))
        assert link.mass > 0.0
        assert a > 0.0
        assert a + b >= c * (1.0 - 1e-12)
    assert all(b.x > a.x for a, b in pairwise(chain.hinges))
    assert sum(link.length for link in chain.links) == close(chain.length, rel=1e-12)
    assert min(link.length for link in chain.links if link.mass > 0.0) > 0.02 * chain.length


@pytest.mark.parametrize(("make", "kept"), CASES)
def test_real_hinge_lines_stay_hinges(make, kept):
    beam = make()
    chain = chosen(make, tuple(kept.items())).chain
    for port in kept:
        own = [hinge.x for hinge in chain.hinges if port in hinge.stiffness]
        for line in beam.hinge_lines(port):
            assert np.min(np.abs(np.array(own) - line)) < 1e-9 * beam.length


@pytest.mark.parametrize("make", [deployed_array, tube])
def test_planes_with_different_hub_targets(make):
    # the hub's inertia differs from plane to plane, and so do the modes
    beam = make()
    mass = float(beam.rigid_mass()[0, 0])
    hub = Hub(mass=3.0 * mass, inertia=(40.0, 80.0, 50.0), offset=(1.0, 0.0, 0.0))
    result = fit(beam, modes={"xy": 2, "xz": 2}, root=Root(target="hub", hub=hub))
    assert result.status.ok
    assert result.kept_for == "hub"
    on_hub = hub.mass_matrix()
    for port, block in (("xy", (1, 5)), ("xz", (2, 4))):
        sign = np.array([1.0, 1.0 if port == "xy" else -1.0])
        own = on_hub[np.ix_(block, block)] * np.outer(sign, sign)
        wanted = beam.port(port, 8).with_hub(own).free_frequencies[:2]
        target = result.target[port].with_hub(own).free_frequencies[:2]
        assert target == close(wanted, rel=1e-10)  # of the modes that were kept
        found = result.achieved[port].truncated(2).with_hub(own).free_frequencies[:2]
        assert found == close(wanted, rel=1e-8)


# -- random arrays ---------------------------------------------------------------------------------
@pytest.mark.slow
@pytest.mark.parametrize("kept", [{"xy": 2, "xz": 2}, {"xy": 3, "xz": 3, "torsion": 2}])
def test_random_arrays(kept):
    for seed in range(8):
        judge(random_array(seed), fit(random_array(seed), modes=kept), kept)


# -- what is chosen --------------------------------------------------------------------------------
def test_planes_whose_springs_must_stand_on_hinges_say_what_that_needs():
    with pytest.raises(RealisationError, match="the planes"):
        fit(one_plane_taper(), modes={"xy": 2, "xz": 2}, options=FitOptions(springs="hinges"))


def test_hinges_where_the_user_wants_them():
    beam = one_plane_taper()
    result = fit(beam, modes={"xy": 2, "xz": 2}, options=FitOptions(cuts=(0.4, 2.0)))
    judge(beam, result, {"xy": 2, "xz": 2})
    places = np.array([hinge.x for hinge in result.chain.hinges])
    for x in (0.4, 2.0):
        assert np.min(np.abs(places - x)) < 1e-9


@pytest.mark.parametrize(
    "kept", [{"xy": 3, "xz": 1}, {"xy": 1, "xz": 1}, {"xy": 1, "xz": 3}, {"xy": 2, "xz": 2}]
)
def test_surplus_hinges_do_not_disturb_the_hub_of_a_hub_target(kept):
    """A plane with one mode takes two hinges; the coupled modes of its hub stay the beam's."""
    hub = Hub(mass=20.0, inertia=(3.0, 3.0, 3.0), offset=(0.2, 0.0, 0.0))
    result = fit(one_plane_taper(), modes=kept, root=Root(target="hub", hub=hub))
    for port, n in kept.items():
        turn = rb.into_space(port)
        carried = turn.T @ hub.mass_matrix() @ turn
        found = rb.read(result.to_mjcf()).port(port)
        achieved = PortModel(result.achieved[port].rigid_mass, found[0], found[1])
        wanted = one_plane_taper().port(port, 20).with_hub(carried).free_frequencies[:n]
        assert achieved.with_hub(carried).free_frequencies[:n] == close(wanted, rel=1e-6)


def test_cuts_that_hold_the_modes_only_with_more_say_so():
    """Quarter points weigh 48 times the residual mass of three modes of a uniform beam."""
    result = fit(tube(), modes={"xy": 3, "xz": 3}, options=FitOptions(cuts=(2.0, 4.0, 6.0)))
    judge(tube(), result, {"xy": 3, "xz": 3})
    assert "in xy the limp chain weighs 48 times the residual mass" in result.status.message
    assert "now hinges stand also at 0.614 m" in result.status.message


def test_a_lump_at_the_tip_belongs_to_the_last_body():
    beam = Beam(segments=space_beam().segments, lumps=(Lump(x=1.0, mass=0.5),))
    result = fit(beam, modes={"xy": 3, "xz": 2})
    judge(beam, result, {"xy": 3, "xz": 2})
    assert result.chain.mass == close(1.5, rel=1e-12)
    assert result.chain.links[-1].mass > 0.5


@pytest.mark.slow
def test_modes_on_springs_and_on_tendons_are_the_same_chain():
    beam = tube()
    kept = {"xy": 3, "xz": 3, "torsion": 2}
    plain = fit(beam, modes=kept)
    tied = fit(Spec(segment=beam.segments, modes=Modes(**kept), fit=FitOptions(springs="modes")))
    assert not plain.chain.tendons
    assert all(tendon.is_mode for tendon in tied.chain.tendons)
    assert len(tied.chain.tendons) == 8
    assert plain.chain.links == tied.chain.links
    assert [h.x for h in plain.chain.hinges] == [h.x for h in tied.chain.hinges]
    judge(beam, tied, kept)
    judge(beam, plain, kept)


@pytest.mark.slow
def test_the_whole_chain_is_found_from_its_own_model():
    """The package's port of a chain with tendons is what MuJoCo reads."""
    beam = deployed_array()
    kept = {"xy": 3, "xz": 3, "torsion": 2}
    built = chosen(deployed_array, tuple(kept.items()))
    for port, n in kept.items():
        wanted = beam.port(port, 8).truncated(n)
        ours = built.chain.port(port).truncated(n)
        assert ours.frequencies == close(wanted.frequencies, rel=EXACT)
        assert ours.participation == close(wanted.participation, rel=EXACT)
    assert built.chain.rigid_mass() == close(beam.rigid_mass(), abs=1e-13 * beam.rigid_mass()[5, 5])
