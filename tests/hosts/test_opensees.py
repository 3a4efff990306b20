"""The tests' own solver beside OpenSees: a space frame with rigid bodies at nodes.
Elements are the same in theory (Euler and Bernoulli, consistent mass); the code is not."""

import numpy as np
import pytest

from frames import Body, frame_modes, tube

pytestmark = pytest.mark.host
ops = pytest.importorskip(
    "openseespy.opensees", reason="OpenSees is not installed: make hosts HOSTS=opensees"
)
SAME = 1e-6  # relative
YOUNG, DENSITY, POISSON = 7e10, 2700.0, 0.33
CORNERS = [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.5, 1.0, 0.4), (3.5, 1.2, 1.5)]
TUBES = [(0.05, 0.002), (0.04, 0.0015), (0.03, 0.001)]  # diameter and wall
ELEMENTS = 8
BODIES = [Body(CORNERS[1], 1.2, (0.02, 0.03, 0.04)), Body(CORNERS[3], 0.7, (0.01, 0.01, 0.02))]
COUNT = 12


def opensees(bodies):
    """Frequencies of the frame, held at its first corner [rad/s]."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    tag, last = 1, 1
    ops.node(1, *CORNERS[0])
    ops.fix(1, *[1] * 6)
    places = {CORNERS[0]: 1}
    for number, (start, end, (diameter, wall)) in enumerate(
        zip(CORNERS, CORNERS[1:], TUBES, strict=False), 1
    ):
        inner = diameter - 2.0 * wall
        area = np.pi / 4.0 * (diameter**2 - inner**2)
        inertia = np.pi / 64.0 * (diameter**4 - inner**4)
        ops.geomTransf("Linear", number, 0.1, 0.2, 1.0)  # round: any plane will do
        for k in range(1, ELEMENTS + 1):
            place = np.array(start) + (np.array(end) - start) * k / ELEMENTS
            tag += 1
            ops.node(tag, *place.tolist())
            section = area, YOUNG, YOUNG / 2.0 / (1.0 + POISSON), 2.0 * inertia, inertia, inertia
            mass = "-mass", DENSITY * area, "-cMass"
            ops.element("elasticBeamColumn", tag, last, tag, *section, number, *mass)
            last = tag
        places[end] = tag
    for body in bodies:
        ops.mass(places[body.at], *[body.mass] * 3, *body.inertia)
    return np.sqrt(ops.eigen("-fullGenLapack", COUNT))


@pytest.mark.parametrize("bodies", [[], BODIES], ids=["alone", "with bodies"])
def test_frequencies_of_a_space_frame(bodies):
    legs = [
        tube(start, end, ELEMENTS, *size, YOUNG, DENSITY, POISSON)
        for start, end, size in zip(CORNERS, CORNERS[1:], TUBES, strict=False)
    ]
    found = frame_modes(legs, bodies, COUNT).frequencies
    np.testing.assert_allclose(found, opensees(bodies), rtol=SAME)
