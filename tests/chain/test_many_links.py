"""Tests an internal, `engine.bench`: what it reads back of equal links by the dozen is as good
as of few."""

import pytest

import readback as rb
from appendages import close, seed_boom
from beamchain import Beam, Material, Round, Segment
from beamchain.chain.baselines import equal_links
from beamchain.chain.build import with_real_polar
from beamchain.engine.bench import measure, root_body
from beamchain.mjcf import write
from rival_files import rival_file

# frequencies and participation read back against the compiled file's own, relative,
# however many links
READ = 1e-9


def boom() -> Beam:
    steel = Material(youngs_modulus=2.06e11, density=7800.0)
    return Beam(segments=[Segment(length=4.0, section=Round(diameter=0.006), material=steel)])


@pytest.mark.parametrize(
    ("make", "links", "recipe"),
    [
        (seed_boom, 31, "midpoint"),
        (boom, 64, "classical"),
        pytest.param(seed_boom, 200, "classical", marks=pytest.mark.slow),
    ],
)
def test_many_links_are_read_back(recipe, links, make):
    chain = with_real_polar(equal_links(make(), links, recipe))
    # a hinge at the root needs a carrier with mass, which is taken off again
    measured = measure(
        write.appendage_document(chain, "appendage"),
        [("xy",)],
        timestep=0.01,
        ballast=root_body(chain),
    )
    found = measured.ports["xy"]
    file = rb.read(rival_file(chain))
    frequencies, participation, _ = file.port("xy")
    assert found.modes == frequencies.size
    assert found.frequencies[:3] == close(frequencies[:3], rel=READ)
    assert found.participation[:3] == close(participation[:3], rel=READ)
    turn = rb.into_space("xy")
    assert found.rigid_mass == close(turn.T @ file.rigid @ turn, rel=READ)
