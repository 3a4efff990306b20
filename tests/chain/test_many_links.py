"""Recipes with many links: what MuJoCo reads back of them is as good as of few."""

import pytest

from beamchain import FitOptions, Round, fit
from beamchain.chain.rivals import equal_links
from beamchain.chain.seed import seed_beam
from beamchain.structure.beam import Beam, Segment
from beamchain.structure.section import Material

READ = 1e-9  # frequencies and participation read back against the chain's own, relative, however many links


def boom() -> Beam:
    steel = Material(youngs_modulus=2.06e11, density=7800.0)
    return Beam(segments=[Segment(length=4.0, section=Round(diameter=0.006), material=steel)])


@pytest.mark.parametrize("method", ["classical", "naive", "midpoint"])
@pytest.mark.parametrize("links", [31, 64, 200])
@pytest.mark.parametrize("make", [seed_beam, boom])
def test_many_links_are_read_back(method, links, make):
    found = fit(make(), modes={"xy": 2}, options=FitOptions(method=method, links=links)).achieved["xy"]
    wanted = equal_links(make(), links, method, "xy").port("xy")
    assert found.modes == wanted.modes
    for own, exact in ((found.frequencies, wanted.frequencies), (found.participation, wanted.participation)):
        assert own[:3] == pytest.approx(exact[:3], rel=READ)
    assert found.rigid_mass == pytest.approx(wanted.rigid_mass, rel=READ)
