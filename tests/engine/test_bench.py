"""Tests an internal, `engine.bench.measure`: what couples the ports of an appendage is named.

No specification gives a chain along x whose ports couple, so that a body is moved aside by hand.
"""

from arrays import tube
from beamchain import fit
from beamchain.engine.bench import measure

DECOUPLED = 1e-9  # 0 measured
BLOCKS = (("xy",), ("xz",), ("torsion",), ("axial",))


def test_what_couples_the_ports_is_named():
    # a body whose mass sits off the axis: bending in xy turns the root about x
    tree = fit(tube(), modes={"xy": 1, "xz": 1}).appendage()
    inertial = tree.findall(".//inertial")[-1]
    x, _, _ = inertial.get("pos").split()
    inertial.set("pos", f"{x} 0 0.05")
    measured = measure(tree, BLOCKS, timestep=0.01)
    assert measured.couplings["xy, torsion"] > 1e-6
    assert measured.couplings["xz, axial"] > 1e-6
    assert measured.couplings["xy, xz"] < DECOUPLED
    assert measured.coupling == max(measured.couplings.values())
