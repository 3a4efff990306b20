"""The limits of acceleration and slew that `bc.stability` states,
found again by MuJoCo's inverse dynamics.

The appendage hangs on a hub that turns about its centre and slides across; its bent shape is where
no hinge needs a torque. The 60 equal links of the same beam are written here.
"""

import mujoco
import numpy as np
import pytest
from scipy.optimize import root

import beamchain as bc

LENGTH, STIFFNESS, LINEAR_MASS, LINKS = 8.0, 2e3, 4.0, 60  # m, N m^2, kg/m
STATED = 0.01  # what the limits promise
WITHIN = 2e-4
SMALL = 1e-4  # of the limit: small motion
BALANCED = 1e-8  # relative: torque left in a hinge


def hub(offset, inside=""):
    return f"""<mujoco><compiler balanceinertia="true"/><option gravity="0 0 0">
    <flag contact="disable"/></option>
    <worldbody><body name="hub"><joint type="slide" axis="0 1 0"/><joint axis="0 0 1"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><site name="mount" pos="{offset} 0 0"/>
    <body pos="{offset} 0 0">{inside}</body></body></worldbody></mujoco>"""


def fine(offset):
    """A hinge in the middle of each of 60 equal pieces, with the stiffness EI/h."""
    h = LENGTH / LINKS
    edges = [0.0, *(h * (np.arange(LINKS) + 0.5)).tolist(), LENGTH]
    out, before = "", 0.0
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        size, mass = b - a, LINEAR_MASS * (b - a)
        joint = f'<joint axis="0 0 1" stiffness="{STIFFNESS / h}"/>' if a else ""
        inertia = mass * size**2 / 12.0
        out += (
            f'<body pos="{a - before} 0 0">{joint}<inertial pos="{size / 2.0} 0 0" mass="{mass}" '
        )
        out += f'diaginertia="{1e-3 * inertia} {inertia} {inertia}"/>'
        before = a
    return mujoco.MjModel.from_xml_string(hub(offset, out + "</body>" * (LINKS + 1)))


def bent(model, offset, acceleration, slew, start):
    """Displacement of the mass centre and moment at the root, both held by the hub;
    and the hinges' angles."""
    data = mujoco.MjData(model)

    def torques(angles):
        data.qpos[2:], data.qacc[:2] = angles, (acceleration, slew)
        mujoco.mj_inverse(model, data)
        return data.qfrc_inverse[2:].copy()

    size = np.abs(torques(np.zeros(model.nv - 2))).max()
    found = root(lambda angles: torques(angles) / size, start, tol=1e-12)
    assert np.abs(found.fun).max() < BALANCED
    # less what the hub takes
    force = data.qfrc_inverse[0] - acceleration
    moment = data.qfrc_inverse[1] - slew
    mass = model.body_mass.copy()
    mass[model.body("hub").id] = 0.0
    return np.array([mass @ data.xipos[:, 1] / mass.sum(), moment - offset * force]), found.x


def left(models, offset, acceleration, slew):
    """Largest difference of the two models, each divided by its own small motion."""
    shares = []
    for model in models:
        small, start = bent(
            model, offset, SMALL * acceleration, SMALL * slew, np.zeros(model.nv - 2)
        )
        for part in np.linspace(0.1, 1.0, 10):
            large, start = bent(model, offset, part * acceleration, part * slew, start)
        shares.append(SMALL * large / small)
    return np.abs(shares[0] / shares[1] - 1.0).max()


@pytest.mark.slow
def test_the_error_at_the_stated_limits_is_one_percent():
    """A root away from the hub's centre is accelerated by the slew as well."""
    offset = 0.5
    section = bc.Equivalent(bending_stiffness_xy=STIFFNESS, linear_mass=LINEAR_MASS)
    body = bc.Hub(mass=300.0, inertia=(100.0, 120.0, 150.0), offset=(offset, 0.0, 0.0))
    spec = bc.Spec(
        segment=(bc.Segment(length=LENGTH, section=section),),
        modes=bc.Modes(xy=2),
        root=bc.spec.Root(target="hub", hub=body),
    )
    limit = bc.stability(spec).large["xy"]
    carrier = mujoco.MjSpec.from_string(hub(offset))
    bc.fit(spec).attach(carrier, "mount")
    models = carrier.compile(), fine(offset)
    assert abs(left(models, offset, 0.0, limit.slew) - STATED) < WITHIN
    assert abs(left(models, offset, limit.acceleration, 0.0) - STATED) < WITHIN
