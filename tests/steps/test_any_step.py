"""Random craft, light hubs included, at 0.1 to 100 times the step that their appendages used to
allow: nothing grows.

BEAMCHAIN_CRAFTS sets how many craft (100 by hand),
`pytest -s` prints how many modes were slowed per craft and step.
"""

import copy
import os

import mujoco
import numpy as np
import pytest

import beamchain as bc
import finite_elements as fe
from beamchain.steps.retime import retime_by
from limits import largest_steps
from random_appendages import random_appendage, toml

CRAFTS = int(os.environ.get("BEAMCHAIN_CRAFTS", "3"))
FACTORS = (0.1, 1.0, 10.0, 100.0)
STEPS = 10_000
PUSH = 1e-9  # of a length: linear motion, also after 1e4 steps of a hundred seconds
GROWN = (
    # largest modal amplitude of the second half over that of the first: beating moves it about,
    # growth explodes it
    1.5
)


def random_craft(seed, tmp_path):
    """A free bus with one to three appendages of two to three modes a plane,
    0.3 to 30 times as heavy as they are."""
    rng = np.random.default_rng(1000 + seed)
    specs, mass = {}, 0.0
    for k in range(int(rng.integers(1, 4))):
        spec = random_appendage(int(rng.integers(10**6)))
        spec = {key: spec[key] for key in ("segment", "joint", "lump") if key in spec}
        spec |= {
            "name": f"part{k}",
            "modes": {"xy": 2 + k % 2, "xz": 2},
            "fit": {"springs": "modes"},
        }
        if rng.random() < 0.7:
            spec["damping"] = {"ratio": float(rng.uniform(0.001, 0.02))}
        mass += fe.rigid_mass(spec)[0, 0]
        path = tmp_path / f"part{k}.toml"
        path.write_text(toml(spec))
        specs[f"place{k}"] = path
    bus = mass * float(10.0 ** rng.uniform(-0.5, 1.5))
    inertia = " ".join(f"{v:.4f}" for v in bus * rng.uniform(0.3, 0.5, 3))
    sites = "".join(
        f'<site name="{name}" pos="{" ".join(f"{v:.4f}" for v in rng.uniform(-1.0, 1.0, 3))}" '
        f'euler="{" ".join(f"{v:.2f}" for v in rng.uniform(-180.0, 180.0, 3))}"/>'
        for name in specs
    )
    return (
        '<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody><body '
        f'name="bus"><freejoint/><inertial pos="0 0 0" mass="{bus:.4f}" '
        f'diaginertia="{inertia}"/>{sites}</body></worldbody></mujoco>'
    ), specs


def modal(model):
    """`(k, nv)` coefficients of the modal tendons over the velocities."""
    rows = np.zeros((model.ntendon, model.nv))
    for t in range(model.ntendon):
        for w in range(model.tendon_adr[t], model.tendon_adr[t] + model.tendon_num[t]):
            rows[t, model.jnt_dofadr[model.wrap_objid[w]]] = model.wrap_prm[w]
    return rows[[i for i in range(model.ntendon) if "_mode" in model.tendon(i).name]]


def amplitudes(model):
    """Largest modal amplitude in the first and second half of a free run."""
    data = mujoco.MjData(model)
    lengths = np.array(
        [model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE for j in range(model.njnt)]
    )
    places = model.jnt_qposadr[lengths]
    rows = modal(model)[:, model.jnt_dofadr[lengths]]
    data.qpos[places] = PUSH * np.linspace(1.0, -0.5, places.size)
    stock, found = 10, [0.0, 0.0]
    for k in range(STEPS // stock):
        mujoco.mj_step(model, data, stock)
        now = float(np.max(np.abs(rows @ data.qpos[places])))
        assert np.isfinite(now)
        found[k >= STEPS // stock // 2] = max(found[k >= STEPS // stock // 2], now)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(CRAFTS))
def test_nothing_grows(seed, tmp_path):
    craft, specs = random_craft(seed, tmp_path)
    embedded = bc.embed(craft, specs, retime=False)
    bare = embedded.model
    limits = largest_steps(embedded.to_mjcf())
    for integrator in ("Euler", "RK4"):
        for factor in FACTORS:
            model = copy.copy(bare)
            model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
            model.opt.timestep = h = factor * limits[integrator]
            for form in (2, 4):
                done = retime_by(form, model, h, integrator)
                first, second = amplitudes(model)
                assert first < 1e4 * PUSH, (integrator, factor, form)
                assert second < GROWN * first, (integrator, factor, form)
            slowed = sum(mode.slowed for mode in done.modes)
            print(  # noqa: T201
                f"craft {seed}, {integrator:5s} at {factor:5g} times its limit: {slowed} of "
                f"{len(done.modes)} modes slowed"
            )
