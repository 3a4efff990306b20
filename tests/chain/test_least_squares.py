"""Constrained least squares: links the user fixed, payloads the scene attaches, a second plane.

Whatever the fit says of itself is judged outside it: payloads are hung on the written file's tip site by MuJoCo, the
beam with a payload comes from `Beam` with a lump, chains from matrices written out.
"""

import mujoco
import numpy as np
import pytest

from appendages import close, dense_port, panels, seed_boom, stepped_boom, tapered_boom, unit_beam
from arrays import deployed_array, tube
from beamchain.chain.least_squares import (
    FREE,
    RodModes,
    Rods,
    TipBody,
    fit_planar,
    fit_stiffness,
    jacobian,
    loaded_modes,
    nodes_to_rods,
    payload_cases,
)
from beamchain.chain.recursion import planar_chain, realise
from beamchain.chain.rivals import build_least_squares
from beamchain.engine.linearise import linearise
from beamchain.errors import InputError
from beamchain.fitting.fit import fit
from beamchain.fitting.options import FitOptions, Modes
from beamchain.fitting.options import Payload as PayloadSpec
from beamchain.fitting.spec import Spec
from beamchain.structure.beam import Beam, Lump

TWO_PORT = {(3, 1): 1e-3, (4, 2): 5e-3, (6, 3): 5e-4}  # the issue's own; 7e-6, 6e-5 and 3e-5 measured
TIMES_BETTER = 5.0  # the issue's own, on frequencies; 60 measured
HELD = 1e-11  # mass, centre and inertia are kept by construction; the sums lose a few digits
CLOSED = 1e-10  # chains of rods against LAPACK's generalised eigenproblem
STEP = 1e-6  # centred differences against complex steps
FITTED = 1e-6  # a chain recovered by a fit whose minimum is zero


def target(beam, port, n):
    return beam.port(port, 8).truncated(n)


def rod_modes(rods, tip, load):
    return RodModes(*(values[0] for values in loaded_modes(rods, tip, (load,))))


def rods_of(chain, port="xy"):
    index = 2 if port == "xy" else 1
    return Rods(
        np.array([0.0, *(h.x for h in chain.hinges)]),
        np.array([k.mass for k in chain.links]),
        np.array([k.com for k in chain.links]),
        np.array([k.inertia[index] for k in chain.links]),
        np.array([h.stiffness[port] for h in chain.hinges]),
    )


# -- rods --------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("load", [(0.0, 0.0), (3.0, 0.0), (0.5, 0.7)])
def test_rods_with_a_payload_against_written_out_matrices(load):
    chain = planar_chain(realise(target(unit_beam(), "xy", 3)), unit_beam())
    ours = rod_modes(rods_of(chain), 1.0, TipBody(*load))
    links = [(k.mass, k.com, k.inertia[2]) for k in chain.links]
    m, c, j = links[-1]
    mass, inertia = load
    centre = (m * c + mass) / (m + mass)  # the last link and the payload are one body
    links[-1] = (m + mass, centre, j + inertia + m * (c - centre) ** 2 + mass * (1.0 - centre) ** 2)
    _, frequencies, participation = dense_port(links, [(h.x, h.stiffness["xy"]) for h in chain.hinges])
    assert ours.frequencies == close(frequencies, rel=CLOSED)
    assert np.abs(ours.participation) == close(np.abs(participation), rel=CLOSED * 10)


def test_many_payloads_at_once_are_the_same_as_one_by_one():
    rods = rods_of(planar_chain(realise(target(unit_beam(), "xy", 3)), unit_beam()))
    loads = [TipBody(0.0, 0.0), TipBody(1.0, 0.0), TipBody(5.0, 0.3)]
    together = loaded_modes(rods, 1.0, loads)
    for k, load in enumerate(loads):
        alone = rod_modes(rods, 1.0, load)
        assert together.frequencies[k] == close(alone.frequencies, rel=1e-12)
        assert together.participation[k] == close(alone.participation, rel=1e-10)
        assert together.tip[k] == close(alone.tip, rel=1e-10)


def test_complex_steps_are_derivatives():
    nodes = realise(target(unit_beam(), "xy", 3))

    def modes(theta):
        rods = nodes_to_rods(np.exp(theta[:5]), np.exp(theta[5:9]), np.exp(theta[9:]))
        found = rod_modes(rods, 1.0, TipBody(0.7, 0.1))
        return np.concatenate([found.frequencies, found.participation.ravel(), found.tip])

    at = np.concatenate([np.log(nodes.masses), np.log(nodes.lengths), np.log(nodes.stiffness)])
    exact = jacobian(modes, at)
    for k in range(at.size):
        ends = [modes(at + sign * STEP * np.eye(at.size)[k]) for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / (2.0 * STEP)
        assert exact[:, k] == close(slope, abs=1e-7 * np.max(np.abs(exact)))


# -- two-port ----------------------------------------------------------------------------------------------------------
def with_payload(text, site, mass):
    """First frequencies with a point mass on the tip site, attached by MuJoCo; the root stands on the world."""
    spec = mujoco.MjSpec.from_string(text)
    spec.option.gravity = [0.0, 0.0, 0.0]
    if mass > 0.0:
        load = mujoco.MjSpec()
        body = load.worldbody.add_body(name="load", mass=mass, inertia=[1e-9 * mass] * 3, explicitinertial=True)
        assert body.name == "load"
        spec.attach(load, site=spec.site(site), prefix="payload_")
    return linearise(spec.compile()).frequencies()


@pytest.mark.parametrize(("links", "modes"), TWO_PORT)
@pytest.mark.parametrize("make", [seed_boom, unit_beam])
def test_payloads_on_the_exported_file(make, links, modes):
    beam = make()
    mass = float(beam.rigid_mass()[0, 0])
    spec = Spec(
        name="arm",
        segment=beam.segments,
        payload=PayloadSpec(mass=5.0 * mass),
        modes=Modes(xy=modes),
        fit=FitOptions(method="least_squares", links=links),
    )
    result = fit(spec)
    assert result.status.ok, result.status.history
    assert len(result.chain.links) == links
    text = result.to_mjcf()
    for factor in (0.0, 0.1, 1.0, 5.0):
        loaded = Beam(segments=beam.segments, lumps=(Lump(x=beam.length, mass=factor * mass),) if factor else ())
        wanted = loaded.port("xy", 6).frequencies[:modes]
        found = with_payload(text, "arm_tip", factor * mass)[:modes]
        assert found == close(wanted, rel=TWO_PORT[links, modes]), factor


def test_payload_with_rotary_inertia():
    beam = unit_beam()
    load = PayloadSpec(mass=2.0, inertia=(0.1, 0.1, 0.1))
    for links, bound in ((4, 5e-3), (6, 5e-4)):
        options = FitOptions(method="least_squares", links=links)
        result = fit(Spec(segment=beam.segments, payload=load, modes=Modes(xy=2), fit=options))
        assert result.status.ok
        loaded = Beam(segments=beam.segments, lumps=(Lump(x=1.0, mass=2.0, inertia=(0.1, 0.1, 0.1)),))
        ours = rod_modes(rods_of(result.chain), 1.0, TipBody(2.0, 0.1)).frequencies[:2]
        assert ours == close(loaded.port("xy", 6).frequencies[:2], rel=bound)


def test_payload_is_fitted_for_and_not_written():
    beam = unit_beam()
    result = fit(Spec(segment=beam.segments, payload=PayloadSpec(mass=5.0), modes=Modes(xy=2)))
    assert result.measured.rigid_mass[0, 0] == close(1.0, rel=1e-12)


def test_cases_run_from_nothing_to_the_whole_payload():
    cases = payload_cases(unit_beam(), "xy", 2, TipBody(5.0, 0.1))
    assert [case.payload.mass for case in cases] == close([0.0, 0.1, 1.0, 5.0], rel=1e-15)
    assert [case.payload.inertia for case in cases] == close([0.0, 0.002, 0.02, 0.1], rel=1e-15)
    assert len(payload_cases(unit_beam(), "xy", 2, None)) == 1


# -- links the user fixed ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("make", [unit_beam, seed_boom, tapered_boom, stepped_boom])
def test_four_equal_links_against_the_classical_recipe(make):
    beam = make()
    options = FitOptions(method="least_squares", links=4, free=("stiffness",))
    ours = fit(beam, modes={"xy": 2}, options=options)
    theirs = fit(beam, modes={"xy": 2}, options=FitOptions(method="classical", links=4))
    wanted = beam.port("xy", 6).frequencies[:2]
    errors = [np.abs(f.achieved["xy"].frequencies[:2] / wanted - 1.0).max() for f in (ours, theirs)]
    assert errors[1] > TIMES_BETTER * errors[0]
    assert [link.length for link in ours.chain.links] == close([beam.length / 4] * 4, rel=1e-12)
    for link in ours.chain.links:  # untouched pieces of the beam
        own = beam.moments(link.start, link.start + link.length, closed=True)
        assert link.mass == close(own.mass, rel=HELD)
        assert link.com == close(own.first / own.mass, rel=HELD)


def test_links_of_the_user_s_lengths_stand():
    lengths = (1.0, 2.0, 2.0, 3.0)
    options = FitOptions(method="least_squares", links=lengths, free=("stiffness",))
    result = fit(tube(), modes={"xy": 2}, options=options)
    assert [link.length for link in result.chain.links] == close(lengths, rel=1e-12)


@pytest.mark.parametrize("free", [("stiffness",), ("stiffness", "lengths"), FREE])
@pytest.mark.parametrize("make", [stepped_boom, deployed_array])
def test_rigid_mass_is_held_exactly(make, free):
    beam = make()
    options = FitOptions(method="least_squares", links=4, free=free)
    result = fit(beam, modes={"xy": 2}, options=options)
    ours, real = result.measured.rigid_mass, beam.rigid_mass()
    for i, j in ((0, 0), (1, 5), (5, 5), (3, 3)):
        assert ours[i, j] == close(real[i, j], rel=HELD if (i, j) != (3, 3) else 1e-9)


def test_more_freedom_fits_better():
    beam = tapered_boom()
    costs = []
    for free in (("stiffness",), ("stiffness", "lengths"), FREE):
        cases = payload_cases(beam, "xy", 3, None)
        costs.append(fit_planar(beam, "xy", cases, np.full(4, beam.length / 4), free).cost)
    assert costs[0] > 10.0 * costs[1] > 1e-9
    assert costs[2] < 1e-9  # an exact chain exists


@pytest.mark.parametrize("n", [1, 2])
def test_everything_free_finds_the_exact_chain(n):
    # 3 N numbers for 3 N data: the minimum is unique and its cost zero (with more modes the valley is flat)
    beam = seed_boom()
    found = fit_planar(beam, "xy", payload_cases(beam, "xy", n, None), np.full(n + 1, beam.length / (n + 1)), FREE)
    exact = realise(target(beam, "xy", n))
    assert found.nodes is not None
    assert found.nodes.masses == close(exact.masses, rel=FITTED)
    assert found.nodes.lengths == close(exact.lengths, rel=FITTED)
    assert found.stiffness == close(exact.stiffness, rel=FITTED)


def test_the_result_says_what_happened():
    beam = seed_boom()
    found = fit_planar(beam, "xy", payload_cases(beam, "xy", 2, TipBody(60.0, 0.0)), np.full(4, 3.75))
    assert found.ok
    assert "least squares, stiffness, lengths, masses free: worst relative residual" in found.message
    assert found.history
    assert all(line.startswith("start ") for line in found.history)
    assert "evaluations" in found.history[-1]


def test_several_starts_and_the_best_is_kept():
    # three links, 5 beam masses: the first start runs into a negative mass, the next one holds
    beam = seed_boom()
    mass = float(beam.rigid_mass()[0, 0])
    found = fit_planar(beam, "xy", payload_cases(beam, "xy", 1, TipBody(5.0 * mass, 0.0)), np.full(3, 5.0))
    assert len(found.history) > 1
    assert found.cost < 1e-8


def test_it_is_deterministic():
    def once():
        beam = tapered_boom()
        return fit_planar(beam, "xy", payload_cases(beam, "xy", 2, TipBody(3.0, 0.0)), np.full(4, 2.5))

    one, two = once(), once()
    assert np.array_equal(one.stiffness, two.stiffness)
    assert np.array_equal(one.positions, two.positions)
    assert one.history == two.history


# -- other ports on links that stand -----------------------------------------------------------------------------------
def test_second_plane_and_torsion_get_springs():
    beam = panels()
    options = FitOptions(method="least_squares", links=4)
    kept = {"xy": 2, "xz": 2, "torsion": 1}
    result = fit(beam, modes=kept, options=options)
    for port, n in kept.items():
        wanted = beam.port(port, 8).frequencies[:n]
        assert result.achieved[port].frequencies[:n] == close(wanted, rel=0.02), port
        assert f"{port}: " in result.status.message


def test_springs_of_a_second_plane_are_recovered():
    # the second plane's true springs are known: the ratio of the stiffnesses
    beam = tube()
    chain = planar_chain(realise(target(beam, "xy", 3)), beam)
    found, miss = fit_stiffness(chain, "xz", target(beam, "xz", 3), np.array([3e3, 3e3, 3e3]))
    assert miss < 1e-6
    for hinge in found.hinges:
        assert hinge.stiffness["xz"] == close(hinge.stiffness["xy"], rel=1e-5)


# -- refusals ----------------------------------------------------------------------------------------------------------
def test_too_few_links_are_refused():
    with pytest.raises(InputError, match=r"fit\.links gives 2 hinges, fewer than the 3 modes kept"):
        fit(tube(), modes={"xy": 3}, options=FitOptions(method="least_squares", links=3))


def test_links_must_add_up_to_the_appendage():
    options = FitOptions(method="least_squares", links=(1.0, 2.0, 3.0))
    with pytest.raises(
        InputError, match=r"fit\.links = \[1\.0, 2\.0, 3\.0\] add up to 6\.0 m, but the appendage is 8\.0 m"
    ):
        fit(tube(), modes={"xy": 2}, options=options)


@pytest.mark.parametrize("kept", [{"xy": 1, "axial": 1}, {"torsion": 1}])
def test_least_squares_needs_a_bending_plane_and_takes_no_axial(kept):
    beam = tube()
    with pytest.raises(
        InputError, match='method = "least_squares" needs modes in a bending plane and takes none in axial'
    ):
        build_least_squares(beam, kept, np.full(3, 8 / 3), FREE, None, lambda port, n: target(beam, port, n))
