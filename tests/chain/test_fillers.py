"""Surplus hinges: no more than the modes need, and fillers that stand for what is left out and do
not set the step.

Truth: three-dimensional frames of finite elements (`frames`), a body of 22 modes of which few are
kept; the files are read by MuJoCo alone (`readback`, `mechanics`) and stepped.
"""

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from frames import Body, frame_modes, strip, tube, write_modes
from mechanics import mass_matrix, stiffness_matrix
from readback import mode_error, on_free_base, read
from specs import spec_of

MODES = 22
EXACT = 1e-9  # relative: kept modes as MuJoCo has them
AS_STATED = 1e-6  # relative: the step limit from MuJoCo's own M and K
# of the error of the kept modes alone: what the fillers may add to it where they cannot help
NO_WORSE = 1.02
STEPS = 3000  # after which a mode 5 % beyond the limit has grown beyond any doubt


def panel():
    """A panel on an arm, its frame a little out of the plane: all modes move all six motions."""
    corners = [(1.2, -0.9, 0.05), (1.2, 0.1, 0.0), (1.2, 0.9, 0.0), (2.6, 0.9, 0.02)]
    far = (2.6, -0.9, 0.04)
    legs = [
        tube((0.0, 0.0, 0.0), corners[1], 4),
        strip(corners[1], corners[2], 3, 0.08, 0.01),
        strip(corners[1], corners[0], 3, 0.08, 0.01),
        strip(corners[2], corners[3], 4, 0.06, 0.012),
        strip(corners[0], far, 4, 0.06, 0.012),
        strip(corners[3], far, 5, 0.06, 0.012),
    ]
    bodies = [
        Body(corners[3], 1.5, (0.03, 0.02, 0.03)),
        Body(far, 1.0, (0.03, 0.02, 0.03)),
    ]
    return frame_modes(legs, bodies, MODES)


def bent_strip():
    """A strip with a second one across its end: out of its plane it bends and twists at once."""
    legs = [
        strip((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), 10, 0.1, 0.005),
        strip((3.0, 0.0, 0.0), (3.0, 0.6, 0.0), 4, 0.08, 0.008),
    ]
    return frame_modes(legs, [Body((3.0, 0.6, 0.0), 1.0, (0.01, 0.01, 0.02))], MODES)


def straight_strip():
    """A strip along x with a body at its end: every mode moves one port."""
    body = Body((3.0, 0.0, 0.0), 2.0, (0.05, 0.04, 0.06))
    return frame_modes([strip((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), 12)], [body], MODES)


def hub_of(body, masses):
    """Mass and inertia of a hub of some body masses."""
    return masses * body.rigid[0, 0], [masses * float(np.max(np.diag(body.rigid)[3:]))] * 3


def fitted(folder, body, kept, masses=None):
    """The fit of some modes of a body, on a hub of some body masses where stated."""
    table = write_modes(folder / "modes.json", body, damping=0.0)
    lines = [
        'name = "panel"',
        "[imported]",
        f'file = "{table["file"]}"',
        f"modes = {[k + 1 for k in kept]}",
    ]
    if masses is not None:
        mass, inertia = hub_of(body, masses)
        lines += ["[root]", f"hub = {{ mass = {float(mass)!r}, inertia = {inertia!r} }}"]
    path = folder / "panel.toml"
    path.write_text("\n".join(lines) + "\n")
    return bc.fit(path)


def on_hub(body, fit, masses):
    """The written file on a free hub, as MuJoCo compiles it."""
    model = mujoco.MjModel.from_xml_string(on_free_base(fit.to_mjcf(), hub_of(body, masses)))
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    return model


def coupled(mass, stiffness):
    """Coupled frequencies [rad/s], ascending, those of the rigid body left out."""
    size = np.sqrt(np.diag(mass))
    both = [matrix / np.outer(size, size) for matrix in (stiffness, mass)]
    return np.sqrt(np.maximum(eigh(*both, eigvals_only=True), 0.0))[6:]


def exact_frequencies(body, masses, kept):
    """Coupled frequencies of some of the finite elements' modes on a hub."""
    mass, inertia = hub_of(body, masses)
    rows = body.participation[kept]
    hub = np.diag([mass] * 3 + inertia)
    whole = np.block([[body.rigid + hub, rows.T], [rows, np.eye(len(kept))]])
    stiffness = np.diag(np.concatenate([np.zeros(6), body.frequencies[kept] ** 2]))
    return coupled(whole, stiffness)


def largest_motion(model, step):
    """Largest velocity in the last tenth of many steps after a small push on every freedom,
    over the first."""
    model.opt.timestep = step
    data = mujoco.MjData(model)
    data.qvel[6:] = 1e-7 * np.random.default_rng(3).standard_normal(model.nv - 6)
    data.qvel[6:] /= np.sqrt(np.diag(mass_matrix(model)))[6:]
    history = []
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
        history.append(float(np.max(np.abs(data.qvel[6:]))))
        if history[-1] > 1e3 * history[0]:
            return np.inf
    return max(history[-STEPS // 10 :]) / max(history[: STEPS // 10])


@pytest.mark.slow
def test_fillers_leave_a_third_of_the_last_kept_modes_step(tmp_path):
    """Stated from A and B, read from M and K, and stepped."""
    body, masses = panel(), 10.0
    fit = fitted(tmp_path, body, range(4), masses)
    model = on_hub(body, fit, masses)
    fastest = coupled(mass_matrix(model), stiffness_matrix(model))[-1]
    stated = fit.limits.largest_step["Euler"]
    assert stated == pytest.approx(2.0 / fastest, rel=AS_STATED)
    assert stated >= 2.0 / body.frequencies[3] / 3.0
    assert largest_motion(model, 0.95 * stated) < 3.0
    assert largest_motion(model, 1.05 * stated) == np.inf


# kept modes of a body, motions that they move (L has that rank or one per mode), and hinges:
# n + rank P - rank L, with P the motions that hinges of these ports reach
COUNTS = {
    "one motion, torsion": (straight_strip, (3, 10), 1, 2),
    "two motions, a plane": (straight_strip, (0, 1), 2, 2),
    "three motions, one mode": (bent_strip, (0,), 3, 3),
    "three motions, three modes": (bent_strip, (0, 1, 2), 3, 3),
    "six motions, four modes": (panel, (0, 1, 2, 3), 6, 6),
    "six motions, eight modes": (panel, tuple(range(8)), 6, 8),
}


@pytest.mark.parametrize("case", COUNTS)
@pytest.mark.slow
def test_a_body_gets_no_more_hinges_than_its_modes_need(case, tmp_path):
    make, kept, motions, hinges = COUNTS[case]
    body = make()
    kept = list(kept)
    moved = np.abs(body.participation[kept]) / np.sqrt(np.diag(body.rigid))
    assert np.count_nonzero(np.max(moved, axis=0) > EXACT) == motions
    rank = np.linalg.matrix_rank(moved, tol=EXACT)
    assert hinges == len(kept) + motions - rank
    reading = read(fitted(tmp_path, body, kept).to_mjcf())
    assert reading.model.nv == hinges
    n = len(kept)
    found = reading.frequencies[:n], reading.participation[:n]
    exact = body.frequencies[kept], body.participation[kept]
    assert max(mode_error(found, exact, body.rigid)) < EXACT
    if reading.model.nv > n:
        # above the modes, and near them
        assert np.all(reading.frequencies[n:] > 1.9 * exact[0][-1])
        assert np.all(reading.frequencies[n:] < 3.0 * exact[0][-1])


@pytest.mark.parametrize(("masses", "kept"), [(0.1, 1), (1.0, 4), (10.0, 3)])
@pytest.mark.slow
def test_fillers_take_coupled_frequencies_towards_the_truth(kept, masses, tmp_path):
    """Against finite elements with all modes, on the hub that the specification states."""
    body = panel()
    fit = fitted(tmp_path, body, range(kept), masses)
    model = on_hub(body, fit, masses)
    exact = exact_frequencies(body, masses, list(range(MODES)))[:kept]
    alone = exact_frequencies(body, masses, list(range(kept)))
    found = coupled(mass_matrix(model), stiffness_matrix(model))[:kept]
    error, without = (float(np.max(np.abs(w / exact - 1.0))) for w in (found, alone))
    assert error < NO_WORSE * without
    if kept == 1:
        assert error < without / 10.0


@pytest.mark.slow
def test_fillers_of_a_body_with_a_further_port_do_not_set_its_step():
    """One mode a plane and the static responses of the port take a hinge more than they are."""
    tube = {"shape": "tube", "outer_diameter": 0.06, "wall": 0.002}
    aluminium = {"youngs_modulus": 7e10, "density": 2700.0, "poissons_ratio": 0.33}
    spec = spec_of(
        {
            "name": "boom",
            "segment": [{"length": 6.0, "section": tube, "material": aluminium}],
            "port": [{"name": "end", "x": 6.0}],
            "modes": {"xy": 1, "xz": 1},
        }
    )
    model = read(bc.fit(spec).to_mjcf()).model
    w = np.sqrt(np.ravel(model.tendon_stiffness))
    surplus = np.array(["filler" in model.tendon(i).name for i in range(model.ntendon)])
    assert surplus.any()
    assert np.max(w[surplus]) <= np.max(w[~surplus])
    assert 2.0 * np.min(w[w > 0.0]) < np.min(w[surplus])  # and stand above the modes
