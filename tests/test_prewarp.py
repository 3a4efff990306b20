"""Pre-warping: the discrete frequencies, read from MuJoCo's own A at the chosen step, are the beam's on its hub."""

import numpy as np
import pytest

import beamchain as bc
from appendages import close, seed_boom, stepped_boom, tapered_boom
from beamchain.chain.prewarp import coupled_poles
from beamchain.engine.linearise import compile_model, linearise
from beamchain.spec import port_hub_mass
from beamchain.structure.exact import UniformBeam

DISCRETE = 1e-8  # relative: what is promised; some 1e-12 is seen
STATIC = 1e-9  # relative: the static flexibility of the modes on the hub
EXACT = 1e-9  # relative: elements against the transcendental solution

HUB = bc.Hub(mass=50.0, inertia=(40.0, 40.0, 50.0), offset=(0.5, 0.0, 0.0))


def fitted(beam, integrator, timestep, modes, ratio=0.0, root=None):
    return bc.fit(
        beam,
        modes=modes,
        root=root or bc.Root(hub=HUB, target="hub"),
        damping=bc.Damping(ratio=ratio) if ratio else None,
        options=bc.FitOptions(timestep=timestep),
        scene=bc.Scene(integrator=integrator, timestep=timestep),
    )


def simulated(fit):
    """Poles `log(z)/h` of MuJoCo's own step of the scene, oscillating ones, slowest first."""
    a = linearise(compile_model(fit.scene_mjcf())).a
    z = np.linalg.eigvals(a).astype(complex)
    s = np.log(z[z.imag > 1e-5]) / fit.spec.fit.timestep
    return s[np.argsort(np.abs(s))]


def coupled(beam, modes, ratio=0.0):
    """Poles of the whole beam on the hub, from its own model with many modes."""
    out = []
    for port, count in modes.items():
        model = beam.port(port, 2 * count + 6)
        out += list(
            coupled_poles(model.replaced(damping=np.full(model.modes, ratio)), port_hub_mass(HUB.mass_matrix(), port))[
                :count
            ]
        )
    return np.array(sorted(out, key=abs))


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
@pytest.mark.parametrize("beam", [seed_boom, tapered_boom, stepped_boom])
def test_discrete_frequencies_are_the_beams(integrator, beam):
    modes = {"xy": 3, "xz": 2}
    wanted = np.abs(coupled(beam(), modes))
    timestep = 1.2 / float(wanted[-1])  # twelve times coarser than what is usual
    seen = simulated(fitted(beam(), integrator, timestep, modes))
    assert np.abs(seen) == close(wanted, rel=DISCRETE)
    assert np.max(np.abs(seen.real) / np.abs(seen)) < 1e-9  # and no damping of its own


def test_against_the_transcendental_solution():
    boom = seed_boom()
    plane = port_hub_mass(HUB.mass_matrix(), "xy")
    section = boom.segments[0].at(np.array([0.0]))
    truth = UniformBeam(15.0, float(section.bending_xy[0]), float(section.mass[0])).coupled_frequencies(plane, 3)
    seen = simulated(fitted(boom, "implicitfast", 0.1, {"xy": 3}))
    assert np.abs(seen) == close(truth, rel=DISCRETE)


def test_without_it_the_step_is_far_off():
    boom, modes = seed_boom(), {"xy": 3}
    wanted = np.abs(coupled(boom, modes))
    plain = bc.fit(boom, modes=modes, root=bc.Root(hub=HUB, target="hub"), scene=bc.Scene(timestep=0.1))
    a = linearise(compile_model(plain.scene_mjcf())).a
    z = np.linalg.eigvals(a).astype(complex)
    w = np.sort(np.abs(np.log(z[z.imag > 1e-5])) / 0.1)
    assert abs(w[-1] / wanted[-1] - 1.0) > 1e5 * DISCRETE


def test_runge_kutta_shows_the_frequency_too():
    modes = {"xy": 3}
    wanted = np.abs(coupled(seed_boom(), modes))
    seen = simulated(fitted(seed_boom(), "RK4", 0.12, modes))
    assert seen.imag == close(wanted, rel=DISCRETE)


@pytest.mark.parametrize("modes", [{"xy": 3}, {"xy": 2, "xz": 2}])
def test_discrete_meets_the_damped_poles(modes):
    wanted = coupled(seed_boom(), modes, 0.05)
    timestep = 0.03 / float(np.abs(wanted[-1]))
    fit = fitted(seed_boom(), "discrete", timestep, modes, 0.05)
    seen = simulated(fit)
    assert np.abs(seen) == close(np.abs(wanted), rel=DISCRETE)
    assert -seen.real / np.abs(seen) == close(-wanted.real / np.abs(wanted), rel=1e-6)


def test_discrete_refuses_with_figures_where_it_damps_more_than_the_structure():
    with pytest.raises(bc.BeamchainError, match=r"by a ratio of 0\.\d+ of its own, more than the structure's 0\.00"):
        fitted(seed_boom(), "discrete", 0.05, {"xy": 2}, 0.003)


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_static_response_is_kept(integrator):
    fit = fitted(seed_boom(), integrator, 0.15, {"xy": 2})
    plane = port_hub_mass(HUB.mass_matrix(), "xy")

    def flexibility(model):
        p, w = model.free_port_values[:2], model.free_frequencies[:2]
        return (p / w[:, None] ** 2).T @ p

    whole = seed_boom().port("xy", 8).with_hub(plane)
    assert flexibility(fit.achieved["xy"].with_hub(plane)) == close(flexibility(whole), rel=STATIC)


def test_in_band_error_is_that_of_what_the_step_shows():
    warped = fitted(seed_boom(), "implicitfast", 0.15, {"xy": 3})
    assert warped.error["xy"].accelerance_in_band < 2e-3
    assert any("pre-warped for implicitfast at 0.15 s" in w for w in warped.warnings)
    assert warped.as_dict()["prewarp"]["xy"]["timestep"] == 0.15


def test_without_a_hub_the_held_modes_are_meant():
    fit = fitted(seed_boom(), "implicitfast", 0.2, {"xy": 2}, root=bc.Root())
    held = seed_boom().port("xy", 8).frequencies[:2]
    assert fit.achieved["xy"].frequencies == close(2.0 / 0.2 * np.sin(held * 0.1), rel=1e-8)
    assert fit.achieved["xy"].rigid_mass == close(seed_boom().port("xy").rigid_mass, rel=1e-9)


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_a_step_beyond_the_mode_is_refused(integrator):
    with pytest.raises(bc.BeamchainError, match="must stay below"):
        fitted(seed_boom(), integrator, 3.0, {"xy": 3})


def test_only_the_exact_chain_is_warped():
    with pytest.raises(bc.BeamchainError, match="pre-warps the exact chain only"):
        bc.fit(seed_boom(), options=bc.FitOptions(timestep=0.01, method="classical", links=4))
