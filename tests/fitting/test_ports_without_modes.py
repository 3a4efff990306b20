"""Ports with no modes, or with no free ones: every combination of them is fitted, reported and
embedded, and what plain MuJoCo then finds are the frequencies of a closed form."""

import json
import os

import mujoco
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import beamchain as bc
from beamchain.errors import RealisationError
from combinations_of_ports import beams, tables
from command import call
from finite_elements import coupled
from random_appendages import toml
from spacecraft import frequencies

SAME = 1e-6  # of a frequency of a file that MuJoCo stores in doubles
BUS = """<mujoco><option gravity="0 0 0" timestep="0.002" integrator="implicitfast"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="200" diaginertia="40 40 50"/>
<site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>"""
HUB = {"mass": 200.0, "inertia": [40.0, 40.0, 50.0]}
EXAMPLES = int(os.environ.get("BEAMCHAIN_FUZZ", "4"))  # of the long test, half beams


def written(folder, spec, document=None):
    """The path of a SPEC.toml, beside the file of modes that it names."""
    if document is not None:
        (folder / "odd_modes.json").write_text(json.dumps(document))
    (folder / "odd.toml").write_text(toml(spec))
    return folder / "odd.toml"


def fitted(folder, spec, document=None):
    """Frequencies of the scene as plain MuJoCo has them."""
    scene = bc.fit(written(folder, spec, document)).scene_mjcf()
    return frequencies(mujoco.MjModel.from_xml_string(scene))


# -- closed forms ----------------------------------------------------------------------------------
def test_a_body_on_a_twisting_rod_without_inertia(tmp_path):
    rod = {"shape": "equivalent", "bending_stiffness_xy": 3e2, "linear_mass": 1.3}
    spec = {
        "name": "odd",
        "segment": [{"length": 1.2, "section": rod | {"torsion_stiffness": 200.0}}],
        "lump": [{"x": 1.2, "mass": 2.0, "inertia": [0.02, 0.02, 0.02]}],
        "modes": {"torsion": 1},
        "root": {"hub": HUB},
    }
    # k = G J / L between two inertias
    wanted = np.sqrt(200.0 / 1.2 * (1.0 / 0.02 + 1.0 / 40.0))
    assert fitted(tmp_path, spec) == pytest.approx([wanted], rel=SAME)
    # with a free root nothing is left to oscillate
    with pytest.raises(RealisationError, match="a free root leaves 0 of 1 modes in torsion"):
        bc.fit(written(tmp_path, spec | {"root": {"target": "free"}}))


def test_a_boom_without_polar_inertia_and_a_body_with_it_for_a_scene(tmp_path):
    section = {
        "shape": "equivalent",
        "bending_stiffness_xy": 30.8,
        "bending_stiffness_xz": 3.08e5,
        "torsion_stiffness": 3.08e5,
        "axial_stiffness": 1e8,
        "linear_mass": 1.3,
    }
    spec = {
        "name": "odd",
        "segment": [{"length": 1.2, "section": section}],
        "lump": [{"x": 1.2, "mass": 2.29, "inertia": [0.00244, 0.00244, 0.00244]}],
        "scene": {"bandwidth": 170.0, "tolerance": 1e-2, "axes": ["z"]},
        "root": {"hub": HUB},
    }
    hub = np.diag([200.0] * 3 + HUB["inertia"])
    truth = coupled(spec, hub, modes=4, ports=("xy",))
    found = fitted(tmp_path, spec)
    assert found[:2] == pytest.approx(truth[:2], rel=1e-3)  # those in the band


def test_bodies_on_springs_take_all_mass_with_them(tmp_path):
    mass, reach = np.array([3.0, 4.5]), np.array([1.0, 3.0])
    rows = np.sqrt(mass) * np.array([np.ones(2), reach])  # across, about z
    rigid = np.diag([7.5, 7.5, 7.5, 0.0, *[mass @ reach**2] * 2])
    rigid[1, 5] = rigid[5, 1] = mass @ reach
    rigid[2, 4] = rigid[4, 2] = -mass @ reach
    participation = np.zeros((6, 2))
    participation[[1, 5]] = rows
    omega = np.array([2.5, 8.0])
    document = {
        "frequencies": omega.tolist(),
        "participation": participation.tolist(),
        "mass": rigid.tolist(),
    }
    spec = {"name": "odd", "imported": {"file": "odd_modes.json"}, "root": {"hub": HUB}}
    # the hub (across, about z) and both bodies against it
    whole = np.diag([200.0, 50.0, 1.0, 1.0])
    whole[:2, :2] += rows @ rows.T
    whole[:2, 2:], whole[2:, :2] = rows, rows.T
    squares = np.linalg.eigvals(np.linalg.solve(whole, np.diag([0.0, 0.0, *omega**2]))).real
    wanted = np.sqrt(np.sort(squares)[2:])
    assert fitted(tmp_path, spec, document) == pytest.approx(wanted, rel=SAME)


def clamped_by_transition(text):
    """Frequencies of a scene whose hub is held, from `A = [[1, h], [-h M^-1 K, 1]]` of MuJoCo's
    `mjd_transitionFD`."""
    spec = mujoco.MjSpec.from_string(text)
    for joint in [j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]:
        spec.delete(joint)
    model = spec.compile()
    model.opt.gravity[:] = 0.0
    nv = model.nv
    a = np.zeros((2 * nv, 2 * nv))
    mujoco.mjd_transitionFD(model, mujoco.MjData(model), 1e-6, 1, a, None, None, None)
    return np.sqrt(np.sort(np.linalg.eigvals(-a[nv:, :nv] / model.opt.timestep).real))


@pytest.mark.parametrize("stiffness", [1e-3, 1e6])
def test_a_figure_says_which_reading_it_comes_from(stiffness, tmp_path):
    """A root that is 1e9 times softer than the rod costs the differences of A and B digits."""
    rod = {"shape": "equivalent", "bending_stiffness_xy": 2e2, "linear_mass": 0.9}
    spec = {
        "name": "odd",
        "segment": [{"length": 15.0, "section": rod}],
        "joint": [{"after_segment": 0, "stiffness_xy": stiffness}],
        "modes": {"xy": 2},
    }
    fit = bc.fit(written(tmp_path, spec))
    port = fit.as_dict()["ports"]["xy"]
    said, stated = port["readback"], port["achieved"]["frequencies"]
    found = clamped_by_transition(fit.scene_mjcf())
    assert found == pytest.approx(stated, rel=1e-11 + 10.0 * said["distance"])
    exact = said["distance"] <= 1e-11
    assert exact == (stiffness > 1.0)
    assert said["reading"] == ("mjd_transitionFD" if exact else "mass and stiffness")


# -- every combination -----------------------------------------------------------------------------
def checked(case, folder):
    """`fit` with its report and `embed` either work, with numbers, or say why not."""
    document, spec = case if isinstance(case, tuple) else (None, case)
    path = written(folder, spec, document)
    (folder / "bus.xml").write_text(BUS)
    mount = f"mount={path}"
    for words in (
        ("fit", path, "-o", folder / "out"),
        ("embed", folder / "bus.xml", "--mount", mount, "-o", folder / "x.xml", "--no-report"),
    ):
        answer = call(*words, "--force", "--json")
        assert answer.status in (0, 2, 3)
        if answer.status == 2:
            assert answer.err.strip()
            continue
        assert "NaN" not in answer.out
        model = folder / ("x.xml" if words[0] == "embed" else "out/scene.xml")
        assert np.all(np.isfinite(frequencies(mujoco.MjModel.from_xml_path(str(model)))))


NO_CHECK = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]


@pytest.mark.slow
@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=NO_CHECK)
@given(case=st.one_of(beams(), tables()))
def test_every_combination(case, tmp_path):
    checked(case, tmp_path)
