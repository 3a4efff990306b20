"""A chain on a hub that turns fast: its flap and lag frequencies through MuJoCo,
and a printed table for beams."""

import mujoco
import numpy as np

from beamchain import linearise

#: S. Wright, C. Smith, R. Thresher, J. Wang, J. Appl. Mech. 49 (1982) 197: hub radius 0,
#: L = EI = m = 1
FLAP = {
    0: (3.5160, 22.0345, 61.6972),
    1: (3.6816, 22.1810, 61.8418),
    2: (4.1373, 22.6149, 62.2732),
    5: (6.4495, 25.4461, 65.2050),
    10: (11.2023, 33.6404, 74.6493),
}


def spinning(result, eta):
    """Flap and lag frequencies of the chain on a hub that turns at `eta`."""
    spec = mujoco.MjSpec()
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.timestep = 1e-3
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    hub = spec.worldbody.add_body(name="hub", mass=1.0, inertia=[1e9] * 3, explicitinertial=True)
    hub.add_joint(name="spin", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
    hub.add_site(name="mount")
    result.attach(spec, "mount")
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[0] = eta
    linear = linearise(model, data)
    out = []
    for port in ("xz", "xy"):
        own = [i for i, joint in enumerate(linear.joints) if joint.endswith(f"_{port}")]
        other = [i for i in range(1, model.nv) if i not in own]
        assert np.max(np.abs(linear.stiffness[np.ix_(own, other)])) < 1e-9 * np.max(
            np.abs(linear.stiffness)
        )
        out.append(np.sqrt(np.sort(np.linalg.eigvals(linear.stiffness[np.ix_(own, own)]).real)))
    return out
