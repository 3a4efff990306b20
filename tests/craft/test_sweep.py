"""Variants: draws, arrays that turn one compiled model into another, spread, left-out samples, the command."""

import json
import subprocess
import sys
import tomllib
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np
import pytest
from msgspec import structs
from scipy.linalg import eigh
from typer.testing import CliRunner

import beamchain as bc
from beamchain.cli import app
from beamchain.craft.variants import sweep as sweeps
from beamchain.fitting.spec import spec_from_dict
from beamchain.fitting.spec_text import spec_toml
from beamchain.fitting.uncertain import Uncertain, Uncertainty
from beamchain.fitting.varied import varied

ARRAY = Path(str(files("beamchain"))) / "examples" / "array_uncertain.toml"
SEED = Path(str(files("beamchain"))) / "examples" / "seed_boom.toml"
SAMPLES = 12
THROUGH_MUJOCO = (
    1e-7  # frequencies of a variant set into a compiled model: M from MuJoCo, six rigid modes to tell apart
)
SAME = 1e-12  # numbers that went through the same formulas
CHANCE = 5.0  # standard errors a statistic of 4,000 draws may lie off


@pytest.fixture(scope="module")
def variants():
    return sweeps.sweep(bc.read_spec(ARRAY), SAMPLES, seed=3)


def test_draws_are_what_they_say():
    table = Uncertain(
        stiffness=Uncertainty(relative=0.1, group="a"),
        density=Uncertainty(relative=0.1, group="a"),
        joint_stiffness=Uncertainty(relative=0.2, each=True),
        lump=Uncertainty(relative=0.5, distribution="uniform"),
    )
    counts = {"stiffness": 2, "density": 2, "joint_stiffness": 3, "lump": 1}
    rows = [table.scores(7, i, counts) for i in range(4000)]
    again = table.scores(7, 123, counts)
    assert again == rows[123]
    assert all(r["stiffness"][0] == r["stiffness"][1] == r["density"][0] for r in rows)
    each = np.array([r["joint_stiffness"] for r in rows])
    error = 1.0 / np.sqrt(4000.0)
    assert np.max(np.abs(each.mean(axis=0))) < CHANCE * error
    assert np.max(np.abs(np.corrcoef(each.T) - np.eye(3))) < CHANCE * error
    lump = np.array([table.lump.value(0.01, r["lump"][0]) for r in rows])
    assert 0.005 < lump.min() < 0.0052
    assert 0.0148 < lump.max() < 0.015
    assert lump.std() == pytest.approx(0.005 / np.sqrt(3.0), rel=0.05)


def test_normal_draws_are_cut():
    given = Uncertainty(relative=0.1)
    assert given.value(1.0, 9.0) == pytest.approx(1.3)
    assert given.value(1.0, -1.0) == pytest.approx(0.9)
    assert Uncertainty(absolute=2.0).value(10.0, 1.0) == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("table", "match"),
    [
        ({"stiffness": {}}, "either relative or absolute"),
        ({"stiffness": {"relative": 0.1, "absolute": 1.0}}, "either relative or absolute"),
        ({"density": {"absolute": 1.0}}, "relative only"),
        ({"damping": {"relative": 1.5}}, "less than 1"),
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
        spec_from_dict({**data, "uncertain": table})


def test_without_the_table_it_is_refused():
    with pytest.raises(bc.BeamchainError, match=r"no \[uncertain\]"):
        sweeps.sweep(bc.read_spec(SEED), 2)


def test_spec_reads_back():
    spec = bc.read_spec(ARRAY)
    assert spec_from_dict(tomllib.loads(spec_toml(spec))) == spec


def coupled(model: mujoco.MjModel) -> np.ndarray:
    """Undamped frequencies above the six rigid ones from MuJoCo's own mass matrix and the joints' springs."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.array([_column(model, data, i) for i in range(model.nv)])
    stiffness = np.zeros((model.nv, model.nv))
    for joint in range(model.njnt):
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE:
            at = model.jnt_dofadr[joint]
            stiffness[at, at] = np.atleast_1d(model.jnt_stiffness[joint])[0]
    for tendon in range(model.ntendon):
        row = np.zeros(model.nv)
        for k in range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon]):
            row[model.jnt_dofadr[model.wrap_objid[k]]] = model.wrap_prm[k]
        stiffness += np.atleast_1d(model.tendon_stiffness[tendon])[0] * np.outer(row, row)
    return np.sqrt(eigh(stiffness, mass, eigvals_only=True)[6:])


def _column(model: mujoco.MjModel, data: mujoco.MjData, i: int) -> np.ndarray:
    unit, out = np.zeros(model.nv), np.zeros(model.nv)
    unit[i] = 1.0
    mujoco.mj_mulM(model, data, out, unit)
    return out


def test_arrays_turn_the_nominal_model_into_each_variant(variants, tmp_path):
    variants.write(tmp_path)
    loaded = np.load(tmp_path / "variants.npz")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    data = mujoco.MjData(model)
    assert loaded["sample"].size == SAMPLES - len(variants.left_out) >= 10
    assert [model.body(i).name for i in range(model.nbody)] == loaded["body_names"].tolist()
    for i, sample in enumerate(loaded["sample"]):
        for name in loaded["fields"]:
            getattr(model, str(name))[:] = loaded[str(name)][i]
        mujoco.mj_setConst(model, data)
        expected = loaded["coupled_frequencies"][i]
        found = coupled(model)[: expected.size]
        np.testing.assert_allclose(found, expected, rtol=THROUGH_MUJOCO)
        spec = varied(variants.nominal.spec, 3, int(sample))
        assert model.body_subtreemass[1] == pytest.approx(spec.beam.rigid_mass()[0, 0] + 500.0, rel=1e-9)


def test_a_variant_is_the_fit_of_its_spec(variants):
    i = 4
    spec = varied(variants.nominal.spec, 3, int(variants.indices[i]))
    assert spec != variants.nominal.spec
    fresh = bc.fit(structs.replace(spec, uncertain=None))
    for port, values in variants.participation.items():
        np.testing.assert_allclose(np.abs(fresh.target[port].participation), np.abs(values[i]), rtol=1e-6, atol=1e-9)


def test_varied_scales_what_it_should():
    spec = bc.read_spec(ARRAY)
    one = varied(spec, 0, 1)
    yoke, panel = one.segment[0], one.segment[1]
    stiff = yoke.material.youngs_modulus / 7e10
    heavy = yoke.material.density / 2700.0
    assert panel.section.bending_stiffness_xz == pytest.approx(2e4 * stiff, rel=SAME)
    assert panel.section.linear_mass == pytest.approx(4.0 * heavy, rel=SAME)
    assert (stiff - 1.0) / 0.05 == pytest.approx((heavy - 1.0) / 0.02, rel=1e-9)
    assert one.joint[0].stiffness_xz / 900.0 != pytest.approx(one.joint[1].stiffness_xz / 700.0)
    assert one.damping == spec.damping  # drawn on the tendons


def test_what_cannot_be_is_left_out_and_said():
    spec = bc.read_spec(ARRAY)
    lump = bc.Lump(x=5.0, mass=1.0)
    wild = structs.replace(spec, lump=(lump,), uncertain=Uncertain(lump=Uncertainty(absolute=1.5)))
    found = sweeps.sweep(wild, 10, seed=1)
    assert found.left_out
    assert all("mass" in why for why in found.left_out.values())
    assert found.indices.size + len(found.left_out) == 10


def test_command_and_the_ten_lines(tmp_path):
    out = tmp_path / "variants"
    call = ["sweep", str(ARRAY), "--samples", "3", "--workers", "1", "-o", str(out), "--json"]
    result = CliRunner().invoke(app, call)
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    assert record["variants"] == 3
    assert len(record["coupled_frequencies"]) == 5
    script = (out / "apply_variants.py").read_text()
    assert len(script.split('"""\n\n')[1].splitlines()) <= 14
    subprocess.run([sys.executable, "-W", "error", "apply_variants.py"], cwd=out, check=True, timeout=60)
    assert not (out / sweeps.STORE).exists()


def test_same_seed_same_variants_on_any_workers(variants):
    with sweeps_pool() as pool:
        other = sweeps.sweep(bc.read_spec(ARRAY), SAMPLES, seed=3, executor=pool)
    for name, values in variants.fields.items():
        np.testing.assert_allclose(other.fields[name], values, rtol=1e-9, atol=1e-15)


def sweeps_pool():
    from beamchain.engine.jobs import workers

    return workers(2)
