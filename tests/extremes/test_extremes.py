"""Extreme appendages: every one passes an independent check, or is refused with its reason;
nothing in between.

The check (`extremes/`) is itself held against closed forms, against `mpmath`, and against fits that
were spoilt on purpose: a check that cannot fail proves nothing.
"""

import json
from collections import Counter
from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

import beamchain as bc
from appendages import TransferMatrix, close, roots_within
from beamchain import BeamchainError, Hub
from beamchain.chain.baselines import equal_links
from beamchain.errors import EngineError
from beamchain.spec import Root
from extremes.cases import RANGES, Case, cases
from extremes.compiled import frequencies
from extremes.picture import OTHER, extremes_map, reason
from extremes.suite import judge, run, verdict
from extremes.truth import Rod
from rival_files import rival_file, rival_scene

SERIES = 1e-9  # relative: pieces of half a wave at most, Magnus' sixth order
CLAMPED = (1.8751040687119611, 4.694091132974175, 7.854757438237613)  # roots of cos cosh = -1
FREE = (4.730040744862704, 7.853204624095838, 10.995607838001671)  # roots of cos cosh = 1


def uniform(**changes) -> Rod:
    return replace(Rod(2.0, 0.02, 0.02, 7e10, 2700.0), **changes)


def per_second(rod: Rod, root: float) -> float:
    """Frequency of a uniform rod from `beta L` [rad/s]."""
    ei = rod.modulus * np.pi / 64.0 * rod.inner**4
    return root**2 * np.sqrt(ei / (rod.density * np.pi / 4.0 * rod.inner**2)) / rod.length**2


# -- the check itself ------------------------------------------------------------------------------
@pytest.mark.parametrize(("hub", "roots"), [(None, CLAMPED), (np.zeros((2, 2)), FREE)])
def test_truth_knows_the_closed_forms(hub, roots):
    rod = uniform()
    squares = np.array([per_second(rod, r) for r in roots]) ** 2
    inside, _, below = rod.check_poles(squares, SERIES, hub)
    assert inside.all()
    assert below.tolist() == [1, 2, 3]


def test_truth_refuses_a_frequency_that_is_off():
    rod = uniform()
    off = np.array([per_second(rod, r) for r in CLAMPED]) * (1.0 + 3.0 * SERIES)
    assert not rod.check_poles(off**2, SERIES)[0].any()


def test_truth_counts_a_missing_mode():
    rod = uniform()
    squares = np.array([per_second(rod, CLAMPED[i]) for i in (0, 2)]) ** 2
    assert rod.check_poles(squares, SERIES)[2].tolist() == [1, 3]


@pytest.mark.parametrize(
    ("tip", "joint"),
    [(1e4, 1e6), *(pytest.param(*v, marks=pytest.mark.slow) for v in ((0.0, 1e-6), (3.0, 0.2)))],
)
def test_truth_against_mpmath(tip, joint):
    rod = uniform(tip_mass=tip, joint=(0.0, joint))
    ei = rod.modulus * np.pi / 64.0 * rod.inner**4
    m = rod.density * np.pi / 4.0 * rod.inner**2
    exact = TransferMatrix([("joint", joint), ("piece", rod.length, ei, m), ("body", tip)])
    grid = np.geomspace(1e-9 * per_second(rod, 1.0), per_second(rod, 9.0), 8000)
    counts = rod.dynamics(grid**2)[1]
    assert np.all(np.diff(counts) >= 0)
    found = [float(grid[np.argmax(counts >= k)]) for k in (1, 2)]
    assert all(roots_within(exact.held, found, 1.5 * (grid[1] / grid[0] - 1.0)))
    middle = float(np.sqrt(found[0] * found[1]))
    scale = np.sqrt(np.diag(rod.rigid()))
    miss = (rod.dynamics(np.array([middle**2]))[0][0] - exact.dynamic_mass(middle)) / np.outer(
        scale, scale
    )
    assert np.max(np.abs(miss)) < SERIES


def test_truth_weighs_a_cone():
    x = np.linspace(0.0, 2.0, 200001)
    rod = uniform(outer=0.005, tip_mass=0.1)
    line = rod.density * np.pi / 4.0 * (rod.inner + (rod.outer - rod.inner) * x / rod.length) ** 2
    want = [np.trapezoid(line * x**k, x) + 0.1 * 2.0**k for k in (0, 1, 2)]
    assert rod.rigid()[[0, 0, 1], [0, 1, 1]] == close(want, rel=1e-9)


def test_compiled_reads_what_mujoco_holds():
    result = bc.fit(Case("x", modes=4, tip=0.5).spec())
    model = mujoco.MjModel.from_xml_string(result.to_mjcf())
    assert frequencies(model, "xy") == close(result.chain.port("xy").frequencies, rel=1e-11)
    scene = mujoco.MjModel.from_xml_string(result.scene_mjcf())
    hub = Case("x", tip=0.5).hub_body.mass_matrix()[np.ix_([1, 5], [1, 5])]
    assert frequencies(scene, "xy", "hub") == close(
        result.chain.port("xy").with_hub(hub).free_frequencies, rel=1e-10
    )
    alone = frequencies(scene, "xy", "extreme_link1")
    assert alone == close(result.chain.port("xy").free_frequencies, rel=1e-10)


class Spoilt:
    """A fit whose files were changed after it was made."""

    def __init__(self, result, change):
        self.result, self.change = result, change

    def __getattr__(self, name):
        return getattr(self.result, name)

    def to_mjcf(self):
        return self.changed(self.result.to_mjcf())

    def scene_mjcf(self):
        return self.changed(self.result.scene_mjcf())

    def changed(self, text):
        tree = ElementTree.fromstring(text)
        self.change(tree)
        return ElementTree.tostring(tree, encoding="unicode")


def scaled(element, key, factor):
    element.set(key, repr(float(element.get(key)) * factor))


def another_spring(tree):
    sprung = [
        e
        for e in tree.iter()
        if e.tag in ("joint", "fixed") and float(e.get("stiffness", "0")) > 0.0
    ]
    scaled(sprung[0], "stiffness", 1.0 + 1e-5)


def another_mass(tree):
    own = [body for body in tree.iter("body") if body.get("name").startswith("extreme_")]
    scaled(own[-1].find("inertial"), "mass", 1.0 + 1e-5)


SPOILT = {
    "a spring": lambda f, c: (c, Spoilt(f, another_spring)),
    "a mass": lambda f, c: (c, Spoilt(f, another_mass)),
    "another length": lambda f, c: (replace(c, length=c.length * 1.00001), f),
    "another tip mass": lambda f, c: (replace(c, tip=c.tip * 1.0001), f),
    "damping": lambda f, c: (replace(c, damping=0.02), f),
    "a mode that is missing": lambda f, c: (replace(c, modes=c.modes + 1), f),
}


@pytest.mark.parametrize(
    ("what", "target"), [(what, ("clamped", "hub", "free")[i % 3]) for i, what in enumerate(SPOILT)]
)
def test_a_spoilt_fit_is_noticed(what, target):
    case = Case("x", modes=3, tip=1.0, damping=0.01, target=target)
    result = bc.fit(case.spec())
    assert judge(case, result) == ""
    assert judge(*SPOILT[what](result, case)) != ""


# -- what was found and mended ---------------------------------------------------------------------
def test_a_thin_rod_carries_a_little_more_polar_inertia_and_says_so():
    case = Case("x", length=0.1, slenderness=1000.0)
    result = bc.fit(case.spec())
    [said] = [w for w in result.warnings if "polar inertia" in w]
    assert "1.01e-15" in said
    assert min(link.inertia[0] for link in result.chain.links) == 1.01e-15
    assert judge(case, result) == ""


def test_torsion_is_never_thickened():
    with pytest.raises(
        EngineError, match=r"link 2 would have mass .* smallest inertia .* nothing below 1e-15"
    ):
        bc.fit(Case("x", length=0.1, slenderness=1000.0, space=True).spec())


def test_the_cure_of_a_small_appendage_works():
    small = Case("x", length=1e-3, slenderness=50.0, hub=1e3)
    with pytest.raises(EngineError, match="millimetres and grams"):
        bc.fit(small.spec())
    # as the sentence says: lengths times 1e3, the modulus keeps its number, density over 1e6
    cured = replace(small, length=1.0, density=small.density / 1e6)
    result = bc.fit(cured.spec())
    assert judge(cured, result) == ""
    assert result.achieved["xy"].frequencies == close(
        small.spec().beam.port("xy").frequencies[:2], rel=1e-9
    )


def test_a_hub_below_mjminval_is_refused_with_its_numbers():
    hub = Hub(mass=1e-3, inertia=(1e-16, 1e-16, 1e-16))
    with pytest.raises(EngineError, match=r"the hub has mass 0.001 kg and smallest inertia 1e-16"):
        bc.fit(Case("x").spec(), root=Root(hub=hub))


def test_a_mass_centre_a_micrometre_from_its_hinge_is_seen():
    # MuJoCo takes offsets below 1e-6 m for none where nothing is turned:
    # the first moment was off by 1e-6
    [case] = [c for c in cases() if c.name == "spread 252"]
    result = bc.fit(case.spec())
    assert 0.0 < result.chain.links[0].com < 1e-6
    model = mujoco.MjModel.from_xml_string(result.to_mjcf())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.xipos[1, 0] == result.chain.links[0].com
    assert judge(case, result) == ""


def test_free_modes_that_hang_on_a_light_root_are_left_out():
    [case] = [c for c in cases() if c.name == "spread 511"]
    result = bc.fit(case.spec())
    assert not result.status.ok
    assert "the root is too light beside the rest" in result.status.message
    assert judge(case, result) == ""


@pytest.mark.slow
def test_deeper_than_a_file_nests():
    spec = Case("x", slenderness=1000.0).spec()
    scene = rival_scene(equal_links(spec.beam, 494, "classical"), spec.root.hub)
    # 494 hinges, and the hub between the world and the first link
    assert mujoco.MjModel.from_xml_string(scene).nbody == 497
    with pytest.raises(
        EngineError, match=r"496 links and the body that carries them .* give fewer fit\.cuts"
    ):
        rival_file(equal_links(spec.beam, 495, "classical"))


def test_nothing_is_written_beside_a_fit_in_the_working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # MuJoCo warns in a bent pose that is only looked at
    [case] = [c for c in cases() if c.name == "spread 96"]
    bc.fit(case.spec())
    assert list(tmp_path.iterdir()) == []


# -- the suite -------------------------------------------------------------------------------------
def test_the_suite_covers_its_ranges():
    everything = cases()
    assert len(everything) >= 1500
    for field, (low, high) in RANGES.items():
        values = np.array([float(getattr(c, field)) for c in everything])
        if field in ("damping", "modes"):
            assert (values.min(), values.max()) == (low, high) if field == "modes" else (0.0, high)
        else:
            values = values[values > 0.0]
            assert np.log10(values.min()) == close(low, abs=1e-9)
            assert np.log10(values.max()) == close(high, abs=1e-9)
    assert {c.target for c in everything} == {"clamped", "hub", "free"}
    assert sum(c.space for c in everything) > 150


@pytest.mark.slow
def test_a_sample_of_the_suite_has_no_silent_failure():
    sample = cases()[::80]
    found = run(sample)
    assert [row for row in found.rows if row.verdict == "failed"] == []
    assert found.count("passed") > 0.6 * len(sample)


def test_an_error_of_our_own_making_is_a_failure(monkeypatch):
    def broken(_spec):
        raise IndexError("index 3 is out of bounds")

    monkeypatch.setattr("extremes.suite.fit", broken)
    row = verdict(Case("x"))
    assert (row.verdict, row.reason) == ("failed", "IndexError: index 3 is out of bounds")


def test_a_file_mujoco_does_not_take_is_a_failure(monkeypatch):
    def refused(*_):
        raise EngineError("MuJoCo refuses the model")

    monkeypatch.setattr("extremes.suite.judge", refused)
    assert verdict(Case("x")).verdict == "failed"


@pytest.mark.slow
def test_the_map_is_a_picture_of_all_rows():
    found = run(
        [
            Case("x"),
            Case("x", modes=10, taper=0.01),
            Case("x", length=1e-2, slenderness=1e4, hub=1e6),
        ]
    )
    assert [row.verdict for row in found.rows] == ["passed", "passed", "refused"]
    # ten modes of a slender cone, which no springs on hinges hold
    assert found.rows[1].reason == ""
    assert found.rows[1].modes == 10
    assert reason(found.rows[2]) == "link below mjMINVAL"
    assert extremes_map(found.rows).startswith(b"\x89PNG")
    assert json.loads(json.dumps(found.as_dict()))["passed"] == 2


@pytest.mark.slow
def test_the_whole_suite_has_no_silent_failure():
    found = run(cases(), processes=2)
    counts = found.as_dict()
    assert [row for row in found.rows if row.verdict == "failed"] == []
    assert counts["cases"] >= 1500
    assert counts["passed"] > 0.7 * counts["cases"]
    refused = [row for row in found.rows if row.verdict == "refused"]
    assert Counter(reason(row) for row in refused)[OTHER] == 0  # each sentence is one we know


@pytest.mark.slow
def test_refusals_of_small_appendages_are_true():
    """What mjMINVAL refuses is refused for its size alone:
    the same shape 10,000 times as long passes."""
    small = [c for c in cases() if c.length < 1e-2][::12]
    for case in small:
        row = verdict(case)
        if row.verdict == "refused":
            grown = verdict(replace(case, length=case.length * 1e4))
            assert grown.verdict == "passed", grown.reason


def test_every_refusal_is_typed():
    with pytest.raises(BeamchainError):
        bc.fit(Case("x", length=1e-3, slenderness=1e4).spec())
