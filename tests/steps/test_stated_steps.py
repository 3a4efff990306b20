"""Every step that is stated for an accuracy holds it: through the eigenvalues of `mj_step` itself,
damping included.

Step and motion are differenced here, state by state.
"""

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

import beamchain as bc
from limits import inspected
from random_appendages import random_appendage, toml

APPENDAGES = 6  # both forms of damping, one to three modes
ERRORS = {"1%": 1e-2, "0.1%": 1e-3}
ROUNDED = 1e-5  # relative, of the error itself: what differences of mj_step leave
EPSILON = 1e-6


def differenced(model, read):
    """`(k, 2 nv)` what `read(data)` `(k,)` changes with the state, by central differences."""
    data = mujoco.MjData(model)
    nv = model.nv

    def at(state):
        mujoco.mj_resetData(model, data)
        mujoco.mj_integratePos(model, data.qpos, state[:nv], 1.0)
        data.qvel[:] = state[nv:]
        return read(data)

    return np.array(
        [(at(EPSILON * e) - at(-EPSILON * e)) / (2.0 * EPSILON) for e in np.eye(2 * nv)]
    ).T


def step_matrix(model):
    """`(2 nv, 2 nv)` one `mj_step`."""

    def after(data):
        mujoco.mj_step(model, data)
        out = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, out, 1.0, model.qpos0, data.qpos)
        return np.concatenate([out, data.qvel])

    return differenced(model, after)


def true_pole(model):
    """Slowest oscillating pole of the motion itself [1/s], from differences of accelerations."""

    def acceleration(data):
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    matrix = np.vstack([np.eye(model.nv, 2 * model.nv, model.nv), differenced(model, acceleration)])
    s = np.linalg.eigvals(matrix).astype(complex)
    s = s[(np.abs(s) > 1e-4 * np.max(np.abs(s))) & (s.imag > 1e-3 * np.abs(s))]
    return s[np.argmin(np.abs(s))]


def seen_pole(model, integrator, timestep, near):
    """Pole `log(z) / h` of the step that is nearest to `near` [1/s]."""
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.timestep = timestep
    z = np.linalg.eigvals(step_matrix(model)).astype(complex)
    s = np.log(z[np.abs(z - 1.0) > 1e-4]) / timestep
    return s[np.argmin(np.abs(s - near))]


def damped_appendage(seed, tmp_path):
    rng = np.random.default_rng(seed)
    spec = random_appendage(500 + seed)
    spec = {key: spec[key] for key in ("segment", "joint", "lump") if key in spec}
    spec["damping"] = {
        "ratio": float(10.0 ** rng.uniform(-3.0, -1.0)),
        "form": ["modal", "hinge"][seed % 2],
    }
    spec["modes"] = {"xy": 1 + seed % 3, "xz": 2}
    mass = float(rng.uniform(20.0, 500.0))
    spec["root"] = {"hub": {"mass": mass, "inertia": [0.3 * mass] * 3, "offset": [0.5, 0.0, 0.0]}}
    path = tmp_path / "spec.toml"
    path.write_text(toml(spec))
    return bc.fit(bc.read_spec(path))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(APPENDAGES))
def test_stated_steps_hold_their_error(seed, tmp_path):
    scene = damped_appendage(seed, tmp_path).scene_mjcf()
    model = mujoco.MjModel.from_xml_string(scene)
    stated = inspected(scene)["accuracy"]
    true = true_pole(model)
    for integrator in ("Euler", "implicit", "implicitfast", "discrete", "RK4"):
        if not hasattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}"):
            continue
        for name, error in ERRORS.items():
            step = stated[integrator][name]
            seen = seen_pole(model, integrator, float(step), true)
            assert abs(abs(seen) / abs(true) - 1.0) < error * (1.0 + ROUNDED) + 1e-7, (
                integrator,
                error,
                step,
            )


def test_steps_are_not_stated_smaller_than_they_need_be(tmp_path):
    """Undamped Euler shows 2 asin(x / 2) for a phase of x per step."""
    spec = random_appendage(3)
    spec = {key: spec[key] for key in ("segment", "joint", "lump") if key in spec}
    path = tmp_path / "spec.toml"
    path.write_text(toml(spec | {"modes": {"xy": 2, "xz": 2}}))
    limits = inspected(bc.fit(bc.read_spec(path)).scene_mjcf())
    first = limits["modes"][0]["frequency"]
    wanted = brentq(lambda x: 2.0 * np.arcsin(x / 2.0) / x - 1.001, 1e-3, 1.0)
    assert limits["accuracy"]["Euler"]["0.1%"] * first == pytest.approx(wanted, rel=1e-5)


STIFF = """<mujoco><option gravity="0 0 0"><flag contact="disable"/></option><worldbody>
<body name="slow"><joint name="slow" type="slide" stiffness="4" damping="0.02"/>
<geom size=".1" mass="1"/></body>
<body name="fast"><joint name="fast" type="slide" stiffness="1e10"/><geom size=".1" mass="1"/>
</body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
def test_a_slow_mode_beside_a_stiff_spring_is_limited_by_stability_alone(integrator):
    """2 rad/s beside 1e5 rad/s: at every stable step the slow mode turns by 6e-5 at most,
    and is off by that squared."""
    limits = inspected(STIFF)
    largest = limits["stability"]["largest_step"][integrator]
    assert limits["accuracy"][integrator] == pytest.approx(dict.fromkeys(ERRORS, largest), rel=1e-9)
