"""The load of a study: small enough to be linear by default; warned of where it is not.

Tests an internal as well, `studies.study.prepare`: what a load changes, without measuring.
"""

from importlib.resources import files
from pathlib import Path

import pytest

import beamchain as bc
from beamchain.fitting.spec_text import spec_toml
from beamchain.studies import study as studies

SEED = Path(str(files("beamchain"))) / "examples" / "seed_boom.toml"
QUICK = {"models": ["exact, hub"], "duration": 8.0, "budget": 0.001}
LINEAR = 1e-5  # of the largest elastic part, under the default load
# what large motion changes grows with the square of the load, but for the next even power
SQUARE = 0.05


def changed(spec, amplitude=None):
    """What large motion changes, relative: `reference.nonlinear` of a study's record."""
    return studies.prepare(spec_toml(spec), studies.Options(amplitude=amplitude))[1].nonlinear


@pytest.mark.slow
def test_a_larger_load_is_warned_of(tmp_path):
    told = []
    found = bc.study(SEED, amplitude=30.0, **QUICK, progress=lambda *done: told.append(done))
    (text,) = [w for w in found.warnings if "not to be relied on" in w]
    assert text.code == "large-motion"
    reference = found.as_dict()["reference"]
    assert reference["kind"] == "linear"
    assert f"{reference['nonlinear']:.2g}" in text
    assert "not to be relied on" in found.write(tmp_path)[-2].read_text()
    assert (found.models, found.scenario.duration) == (QUICK["models"], QUICK["duration"])
    assert min(point.error for point in found.points) < 0.1
    assert told


def test_the_default_load_is_linear():
    assert changed(bc.read_spec(SEED)) < LINEAR


def test_what_a_larger_load_changes_grows_with_the_square():
    one, three = (changed(bc.read_spec(SEED), size) for size in (10.0, 30.0))
    assert three / one == pytest.approx(9.0, rel=SQUARE)


def test_the_default_load_stays_linear_on_a_heavy_hub():
    """A hub of ten thousand beams hardly moves:
    the doublet is chosen by what the appendage does."""
    spec = bc.read_spec(SEED)
    hub = bc.Hub(mass=5e6, inertia=(5e6, 5e6, 5e6), offset=spec.root.hub.offset)
    heavy = bc.Spec(
        segment=spec.segment, modes=spec.modes, root=bc.spec.Root(target="hub", hub=hub)
    )
    assert changed(heavy) < LINEAR


def test_two_loads_and_negative_ones_are_refused(tmp_path):
    profile = tmp_path / "p.csv"
    profile.write_text("time,mz\n0,1\n1,0\n")
    with pytest.raises(bc.InputError, match="leave one out"):
        bc.study(SEED, profile=profile.read_text(), amplitude=2.0)
    with pytest.raises(bc.InputError, match="amplitude"):
        bc.study(SEED, amplitude=-2.0)


def test_the_field_is_our_chains_and_equal_links():
    with pytest.raises(bc.InputError) as refused:
        bc.study(SEED, models=["flexcomp rod"])
    choice = str(refused.value).split("choose from ")[1]
    assert "exact, hub" in choice
    assert "equal links, classical" in choice
    assert "rod" not in choice
    assert "cable" not in choice
