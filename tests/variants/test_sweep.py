"""Variants: draws, arrays that turn one compiled model into another, spread, left-out samples,
the command."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
from msgspec import structs
from scipy.linalg import eigh

import beamchain as bc
from command import call
from examples import example
from mechanics import mass_matrix, stiffness_matrix
from specs import spec_of

ARRAY = example("array_uncertain")
SEED = example("seed_boom")
SAMPLES = 12
THROUGH_MUJOCO = (
    # frequencies of a variant set into a compiled model: M from MuJoCo,
    # six rigid modes to tell apart
    1e-7
)
SAME = 1e-12  # numbers that went through the same formulas


@cache
def swept():
    """Made once for this module and for those that import the fixture."""
    return bc.sweep(bc.read_spec(ARRAY), SAMPLES, seed=3)


@pytest.fixture(scope="module")
def variants():
    return swept()


@pytest.mark.parametrize(
    ("table", "match"),
    [
        ({"stiffness": {}}, "either relative or absolute"),
        ({"stiffness": {"relative": 0.1, "absolute": 1.0}}, "either relative or absolute"),
        ({"density": {"absolute": 1.0}}, "relative only"),
        ({"damping": {"relative": 1.5}}, "a fraction below 1"),
        ({"lump": {"relative": 0.1, "each": True, "group": "a"}}, "contradict"),
        ({"damping": {"relative": 0.1, "distribution": "beta"}}, "distribution"),
        ({"stifness": {"relative": 0.1}}, "did you mean 'stiffness'"),
    ],
)
def test_bad_tables(table, match):
    data = {
        "segment": [
            {
                "length": 1.0,
                "section": {"shape": "round", "diameter": 0.01},
                "material": {"youngs_modulus": 7e10, "density": 2700.0},
            }
        ]
    }
    with pytest.raises(bc.BeamchainError, match=match):
        spec_of({**data, "uncertain": table})


def test_without_the_table_it_is_refused():
    with pytest.raises(bc.BeamchainError, match=r"no \[uncertain\]"):
        bc.sweep(bc.read_spec(SEED), 2)


def coupled(model: mujoco.MjModel) -> np.ndarray:
    """Undamped frequencies above the six rigid ones from MuJoCo's own mass matrix and
    the joints' springs."""
    return np.sqrt(eigh(stiffness_matrix(model), mass_matrix(model), eigvals_only=True)[6:])


@pytest.mark.slow
def test_arrays_turn_the_nominal_model_into_each_variant(variants, tmp_path):
    variants.write(tmp_path)
    loaded = np.load(tmp_path / "variants.npz")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    data = mujoco.MjData(model)
    assert loaded["sample"].size == SAMPLES - len(variants.left_out) >= 10
    assert [model.body(i).name for i in range(model.nbody)] == loaded["body_names"].tolist()
    for i in range(loaded["sample"].size):
        for name in loaded["fields"]:
            getattr(model, str(name))[:] = loaded[str(name)][i]
        mujoco.mj_setConst(model, data)
        expected = loaded["coupled_frequencies"][i]
        found = coupled(model)[: expected.size]
        np.testing.assert_allclose(found, expected, rtol=THROUGH_MUJOCO)


@pytest.mark.slow
def test_the_record_counts_samples_and_spreads_every_number(variants):
    record = replace(variants, left_out={40: "why", 41: "why"}).as_dict()
    count = variants.indices.size
    assert (record["samples"], record["variants"]) == (count + 2, count)
    assert [one["sample"] for one in record["left_out"]] == [40, 41]
    model = variants.case.model
    assert record["fields"]["body_mass"] == [model.nbody]
    for one, column in zip(record["coupled_frequencies"], variants.coupled.T, strict=True):
        assert one["mean"] == pytest.approx(np.mean(column))
    for port, values in variants.participation.items():
        modes = record["participation"][port]
        assert [[motion["mean"] for motion in mode] for mode in modes] == [
            pytest.approx(mode) for mode in values.mean(axis=0)
        ]
    assert 0.0 < variants.seconds < 1000.0


def uncertain(table):
    """The table [uncertain] of a specification, as the package reads it."""
    segment = {
        "length": 1.0,
        "section": {"shape": "equivalent", "bending_stiffness_xy": 1.0, "linear_mass": 1.0},
    }
    return spec_of({"segment": [segment], "uncertain": table}).uncertain


@pytest.mark.slow
def test_what_cannot_be_is_left_out_and_said():
    spec = bc.read_spec(ARRAY)
    lump = bc.Lump(x=5.0, mass=1.0)
    wild_masses = uncertain({"lump": {"absolute": 1.5}})
    wild = structs.replace(spec, lump=(lump,), uncertain=wild_masses)
    found = bc.sweep(wild, 10, seed=1)
    assert found.left_out
    assert all("mass" in why for why in found.left_out.values())
    assert found.indices.size + len(found.left_out) == 10


@pytest.mark.slow
def test_command_and_the_ten_lines(tmp_path):
    out = tmp_path / "variants"
    answer = call("sweep", ARRAY, "--samples", 3, "-o", out)
    assert answer.status == 0, answer.err
    record = json.loads((out / "sweep.json").read_text())
    assert record["variants"] == 3
    assert len(record["coupled_frequencies"]) == 5
    script = (out / "apply_variants.py").read_text()
    assert len(script.split('"""\n\n')[1].splitlines()) <= 14
    subprocess.run(
        [sys.executable, "-W", "error", "apply_variants.py"], cwd=out, check=True, timeout=60
    )


@pytest.mark.slow
def test_same_seed_same_variants_on_any_workers(variants):
    other = bc.sweep(bc.read_spec(ARRAY), 6, seed=3, workers=2)
    rows = np.isin(variants.indices, other.indices)
    assert rows.sum() == other.indices.size
    for name, values in variants.fields.items():
        np.testing.assert_allclose(other.fields[name], values[rows], rtol=1e-9, atol=1e-15)


FILLED = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 80 70"/>
<site name="left" pos="0 0.5 0" euler="0 0 90"/><site name="right" pos="0 -0.5 0" euler="0 0 -90"/>
</body></worldbody></mujoco>"""


def on_tendons(name, length, uncertain=None, **modes):
    section = {
        "shape": "equivalent",
        "bending_stiffness_xy": 900.0,
        "bending_stiffness_xz": 1500.0,
        "torsion_stiffness": 500.0,
        "polar_inertia": 0.3,
        "linear_mass": 3.0,
    }
    table = {
        "name": name,
        "segment": [{"length": length, "section": section}],
        "modes": modes,
        "fit": {"springs": "modes"},
    }
    return spec_of(table if uncertain is None else {**table, "uncertain": uncertain})


@pytest.mark.slow
def test_a_kept_mode_above_a_filler_is_counted_and_the_filler_is_not(tmp_path):
    """Fillers of a long appendage lie below the modes of a short one."""
    spread = {"frequency": {"relative": 0.01}}
    at = {"left": on_tendons("left", 6.0, spread, xy=1, torsion=2)}
    at["right"] = on_tendons("right", 1.5, xy=3, xz=1)
    (tmp_path / "craft.xml").write_text(FILLED)
    found = bc.sweep(tmp_path / "craft.xml", 3, mounts=at, seed=1)
    found.write(tmp_path / "out")
    arrays = np.load(tmp_path / "out" / "variants.npz")
    for row in range(3):
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "flexible.xml"))
        for name in arrays["fields"]:
            getattr(model, str(name))[:] = arrays[str(name)][row]
        bc.retime(model, 0.0)
        squares, shapes = eigh(stiffness_matrix(model), mass_matrix(model))
        held = np.zeros(model.nv)  # energy of the fillers' tendons
        for i in range(model.ntendon):
            if "filler" in model.tendon(i).name:
                line = np.zeros(model.nv)
                for wrap in range(model.tendon_adr[i], model.tendon_adr[i] + model.tendon_num[i]):
                    line[model.jnt_dofadr[model.wrap_objid[wrap]]] = model.wrap_prm[wrap]
                stiffness = np.atleast_2d(model.tendon_stiffness.T)[0][i]
                held += stiffness * (line @ shapes) ** 2
        flexible = squares > 1e-6
        kept = flexible & (held < 0.5 * squares)
        fillers = flexible & ~kept
        assert fillers.any()
        assert squares[fillers].min() < squares[kept].max()  # what a count from below mistakes
        np.testing.assert_allclose(
            arrays["coupled_frequencies"][row], np.sqrt(squares[kept]), rtol=THROUGH_MUJOCO
        )


SOFT = {
    "name": "soft",
    "segment": [
        {
            "length": 8.0,
            "section": {
                "shape": "equivalent",
                "bending_stiffness_xy": 1.18,
                "linear_mass": 3.0,
            },
        }
    ],
    "modes": {"xy": 1},
    "root": {"hub": {"mass": 1e6, "inertia": [1e6, 1e6, 1e6]}},
    "fit": {"springs": "modes"},
    "uncertain": {"frequency": {"relative": 6e-4, "distribution": "uniform"}},
}


@pytest.mark.slow
def test_histograms_label_near_frequencies_apart(tmp_path):
    """Frequencies from 0.0345 rad/s on that differ in the fifth digit: the labels of an axis differ
    from each other, and are frequencies, not steps from one."""
    found = bc.sweep(spec_of(SOFT), 20, seed=1)
    low, high = found.coupled[:, 0].min(), found.coupled[:, 0].max()
    assert 0.03 < low < high < 0.04
    assert high - low < 5e-5
    found.write(tmp_path)
    text = (tmp_path / "coupled_frequencies.svg").read_text(encoding="utf-8")
    axis = text.split("matplotlib.axis_1", 1)[1].split("matplotlib.axis_2", 1)[0]
    labels = re.findall(r">(0\.03\d*)<", axis)
    assert len(labels) >= 3
    assert len(set(labels)) == len(labels)
    values = np.array([float(label) for label in labels])
    assert np.all((values > low - 1e-5) & (values < high + 1e-5))
    assert not re.search(r">[^<]*(?:\+|1e)[^<]*<", axis)
