"""Variants of a whole craft: arrays of one compiled model against models built one by one,
and what is refused.

The truth is XML written here and compiled by MuJoCo, or, for a participation above 1, which XML
refuses, the assembly M = [[R, L^T], [L, 1]] in NumPy.
"""

import json
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from lxml import etree
from msgspec import structs

import beamchain as bc
from beamchain.steps.retime import retime_by
from command import call
from mechanics import mass_matrix as mass_of
from mechanics import stiffness_matrix as stiffness_of
from varied_crafts import CRAFT, beam, frequencies, rows_of, sprung

ONE_BY_ONE = 1e-9  # the demand: a row of the arrays against the model compiled from its own XML
STEP = 1e-9  # entries of the step's matrix: central differences of MuJoCo leave about 1e-10
ROWS, SAMPLES = 5, 40

pytestmark = pytest.mark.slow


def imported(folder):
    """Modes that couple the ports, from a file that says what is uncertain of them."""
    mass = np.diag([30.0, 30.0, 30.0, 20.0, 162.0, 162.0])
    mass[1, 5] = mass[5, 1] = 60.0
    mass[2, 4] = mass[4, 2] = -60.0
    rows = [[0, 0], [3.0, 0.5], [0.4, 3.0], [0.6, -0.8], [-0.9, -7.0], [7.0, 1.2]]
    data = {
        "mass": mass.tolist(),
        "frequencies": [4.0, 5.5],
        "participation": rows,
        "damping": 0.004,
        "length": 4.0,
        "digits": 15,
        "uncertain": {
            "frequency": {"relative": 0.03, "each": True},
            "participation": {"relative": 0.02},
        },
    }
    (folder / "plate.json").write_text(json.dumps(data))
    (folder / "plate.toml").write_text('name = "plate"\n[imported]\nfile = "plate.json"\n')
    return folder / "plate.toml"


GIVEN = """
[appendage.left_]
frequency = { relative = 0.05, each = true }
damping = { relative = 0.2 }
participation = { relative = 0.03 }
[body.bus]
mass = { relative = 0.05 }
centre_x = { absolute = 0.02 }
centre_z = { absolute = 0.02 }
inertia_xx = { relative = 0.02 }
inertia_xy = { absolute = 1.0 }
inertia_yz = { absolute = 1.0 }
[body.drive]
mass = { relative = 0.1, distribution = "uniform" }
[joint.drive]
stiffness = { relative = 0.1 }
damping = { relative = 0.2 }
[[correlation]]
of = ["left_mode1_xy.frequency", "left_mode1_xz.frequency"]
matrix = [[1.0, 0.9], [0.9, 1.0]]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("variants")


@pytest.fixture(scope="module")
def swept(folder):
    (folder / "craft.xml").write_text(CRAFT)
    (folder / "given.toml").write_text(GIVEN)
    modal = {"frequency": {"relative": 0.04, "distribution": "uniform"}}
    at = {
        "left": beam("left", xy=2, xz=1, torsion=1),
        "right": beam("right", 5.0, modal, xy=2),
        "plate": imported(folder),
    }
    given = folder / "given.toml"
    found = bc.sweep(folder / "craft.xml", SAMPLES, mounts=at, uncertain=given, seed=5, retime=True)
    found.write(folder / "out")
    return found


@pytest.fixture(scope="module")
def arrays(swept, folder):
    return np.load(folder / "out" / "variants.npz")


def drawn(arrays, row):
    return dict(zip(arrays["quantities"].tolist(), arrays["values"][row].tolist(), strict=True))


def variant(folder, arrays, row):
    """The arrays applied to the file beside them."""
    model = mujoco.MjModel.from_xml_path(str(folder / "out" / "flexible.xml"))
    for name in arrays["fields"]:
        getattr(model, str(name))[:] = arrays[str(name)][row]
    return model


def written(folder, values):
    """The same craft as XML of its own: bodies, joints and tendons with the drawn numbers,
    not exact in time."""
    tree = etree.parse(str(folder / "out" / "flexible.xml"))
    body = {node.get("name"): node for node in tree.iter("body")}
    for node in tree.iter("fixed"):
        if float(node.get("stiffness")) == 0.0:
            continue  # mass that the links could not take, which no timing changes
        if float(node.get("solimplimit").split()[1]) == 3.0:  # implicitfast: it is exact in time
            node.set("damping", node.get("solimplimit").split()[3])
            del node.attrib["solimplimit"]
        for gone in ("armature", "margin"):
            node.attrib.pop(gone, None)
        stiffness = float(node.get("stiffness"))
        damping = float(node.get("damping", "0"))
        w = np.sqrt(stiffness)
        name = node.get("name")
        ratio = values.get(f"{name}.damping", damping / (2.0 * w))
        w, p = values.get(f"{name}.frequency", w), values.get(f"{name}.participation", 1.0)
        node.set("stiffness", repr(float(w**2)))
        node.set("damping", repr(float(2.0 * ratio * w)))
        if p < 1.0:
            node.set("armature", repr(float(1.0 - p**2)))
            node.set("margin", repr(float(1.0 - p**2)))
        for joint in node.iter("joint"):
            joint.set("coef", repr(float(joint.get("coef")) / p))
    inertial = body["bus"].find("inertial")
    centre = [float(v) for v in inertial.get("pos").split()]
    full = [float(v) for v in inertial.get("fullinertia").split()]
    inertial.set("mass", repr(float(values["bus.mass"])))
    inertial.set(
        "pos",
        " ".join(
            repr(float(values.get(f"bus.centre_{a}", v)))
            for a, v in zip("xyz", centre, strict=True)
        ),
    )
    kinds = ("xx", "yy", "zz", "xy", "xz", "yz")
    inertial.set(
        "fullinertia",
        " ".join(
            repr(float(values.get(f"bus.inertia_{k}", v))) for k, v in zip(kinds, full, strict=True)
        ),
    )
    body["drive"].find("inertial").set("mass", repr(float(values["drive.mass"])))
    joint = body["drive"].find("joint")
    joint.set("stiffness", repr(float(values["drive.stiffness"])))
    joint.set("damping", repr(float(values["drive.damping"])))
    return etree.tostring(tree).decode()


def step_of(model):
    data = mujoco.MjData(model)
    n = 2 * model.nv
    a = np.zeros((n, n))
    b = np.zeros((n, model.nu))
    mujoco.mjd_transitionFD(model, data, 1e-4, True, a, b, None, None)
    return np.hstack([a, b])


def far(found, wanted):
    """Largest difference over the geometric mean of the diagonal."""
    size = np.sqrt(np.abs(np.diag(wanted)))
    size[size == 0.0] = 1.0
    return np.max(np.abs(found - wanted) / np.outer(size, size))


def chosen(arrays, above):
    """Rows at random, of those whose participation is above 1, or the others."""
    names = arrays["quantities"].tolist()
    at = [i for i, name in enumerate(names) if name.endswith("participation")]
    there = np.flatnonzero(np.any(arrays["values"][:, at] > 1.0, axis=1) == above)
    assert there.size >= ROWS
    return np.random.default_rng(1).choice(there, ROWS, replace=False)


def test_rows_are_models_built_one_by_one(swept, arrays, folder):
    assert swept.indices.size == SAMPLES
    assert not swept.left_out
    for row in chosen(arrays, above=False):
        model = variant(folder, arrays, row)
        truth = mujoco.MjModel.from_xml_string(written(folder, drawn(arrays, row)))
        np.testing.assert_allclose(
            frequencies(truth), arrays["coupled_frequencies"][row], rtol=ONE_BY_ONE
        )
        retime_by(2, truth, truth.opt.timestep)  # that of draws
        assert far(mass_of(model), mass_of(truth)) < ONE_BY_ONE
        assert far(stiffness_of(model), stiffness_of(truth)) < ONE_BY_ONE
        np.testing.assert_allclose(step_of(model), step_of(truth), atol=STEP)


def test_a_participation_above_1_is_that_of_the_assembly(arrays, folder):
    for row in chosen(arrays, above=True):
        values = drawn(arrays, row)
        model = variant(folder, arrays, row)
        plain = {k: v for k, v in values.items() if not k.endswith("participation")}
        nominal = mujoco.MjModel.from_xml_string(written(folder, plain))
        turn = amplitudes(nominal)
        wanted = turn.T @ mass_of(nominal) @ turn
        names = sprung(model)
        modal = range(model.nv - len(names), model.nv)
        for i, name in zip(modal, names, strict=True):
            wanted[i, : modal[0]] *= values.get(f"{name}.participation", 1.0)
            wanted[: modal[0], i] *= values.get(f"{name}.participation", 1.0)
        springs = turn.T @ stiffness_of(nominal) @ turn
        bc.retime(model, 0.0)
        there = amplitudes(model)
        assert far(there.T @ mass_of(model) @ there, wanted) < ONE_BY_ONE
        assert far(there.T @ stiffness_of(model) @ there, springs) < ONE_BY_ONE


def amplitudes(model):
    """`(nv, nv)` joints' motion by that of the craft's own joints, then the tendons' lengths."""
    rows = rows_of(model)
    own = np.eye(model.nv)[~np.any(rows != 0.0, axis=0)]
    return np.linalg.inv(np.vstack([own, rows]))


def test_the_arrays_alone_give_the_same_simulation(swept, arrays, folder):
    """With and without `mj_setConst`, as `apply_variants.py` calls it."""
    for row in (0, 7):
        runs = []
        for derived in (True, False):
            model = variant(folder, arrays, row)
            data = mujoco.MjData(model)
            if derived:
                mujoco.mj_setConst(model, data)
                mujoco.mj_resetData(model, data)
            data.qvel[3:6] = [0.01, -0.02, 0.03]
            for k in range(50):
                data.ctrl[0] = np.sin(k)
                mujoco.mj_step(model, data)
            runs.append(np.append(data.qpos, data.qvel))
        np.testing.assert_allclose(runs[0], runs[1], rtol=0.0, atol=1e-12)
    done = subprocess.run(
        [sys.executable, "-W", "error", "apply_variants.py"],
        cwd=folder / "out",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_draws_are_what_was_asked_for(swept, arrays):
    names = arrays["quantities"].tolist()
    assert [q.name for q in swept.quantities] == names
    values = arrays["values"]
    # each for itself, from the modes file
    plate = [names.index(f"plate_mode{k}.frequency") for k in (1, 2)]
    assert abs(np.corrcoef(values[:, plate].T)[0, 1]) < 5.0 / np.sqrt(SAMPLES)
    one, two = (names.index(f"left_mode1_{port}.frequency") for port in ("xy", "xz"))
    assert np.corrcoef(values[:, one], values[:, two])[0, 1] == pytest.approx(0.9, abs=0.1)
    right = [names.index(f"right_mode{k}_xy.frequency") for k in (1, 2)]
    ratio = values[:, right] / [swept.quantities[i].nominal for i in right]
    np.testing.assert_allclose(ratio[:, 0], ratio[:, 1], rtol=1e-12)  # together
    assert np.ptp(ratio) < 0.08 * 1.0001
    record = swept.as_dict()
    # eight kept modes and the drive
    assert len(record["coupled_frequencies"]) == swept.coupled.shape[1] == 9
    assert record["gains"][0]["unit"] == "rad/s^2 per N m"


def test_gains_are_those_of_the_plant(swept, arrays, folder):
    model = variant(folder, arrays, 3)
    for tendon in range(model.ntendon):
        # damping mixes modes that are near
        model.tendon_damping[tendon] = model.tendon_solimp_lim[tendon, 3] = 0.0
    model.dof_damping[:] = 0.0
    plant = bc.plant(model, inputs=["torque:bus"], outputs=["attitude"])
    ours = arrays["gains"][0][3]
    # a filler may stand below a mode of another appendage
    kept = [k for k, name in enumerate(plant.modes) if "filler" not in name]
    sizes = np.array([np.linalg.norm(plant.gain[k]) for k in kept[: ours.size]])
    np.testing.assert_allclose(ours, sizes, rtol=1e-6)


def test_an_existing_file_and_the_same_seed(folder, swept):
    """The file beside the arrays, swept again by prefixes: the same draws,
    whatever else is uncertain."""
    given = folder / "right.toml"
    given.write_text(
        '[appendage.right_]\nfrequency = { relative = 0.04, distribution = "uniform" }\n'
    )
    again = bc.sweep(folder / "out" / "flexible.xml", 4, uncertain=given, seed=5)
    names = [q.name for q in swept.quantities]
    column = names.index("right_mode1_xy.frequency")
    np.testing.assert_allclose(again.values[:, 0], swept.values[:4, column], rtol=1e-12)


# -- refused ---------------------------------------------------------------------------------------
CRAFTS = [
    ("[body.bus]\nmass = { relative = 0.4 }", "bus.mass = 300 kg may fall to"),
    ('[body.bus]\nmass = { absolute = 400.0, distribution = "uniform" }', "stays above zero"),
    ("[body.buss]\nmass = { relative = 0.1 }", "did you mean 'bus'"),
    ("[body.bus]\nmas = { relative = 0.1 }", "did you mean 'mass'"),
    ("[body.bus]\ncentre_x = { relative = 0.1 }", "absolute only"),
    ("[body.bus]\ninertia_xy = { absolute = 60.0 }", "which no body has"),
    ("[body.left_link2]\nmass = { relative = 0.1 }", "is a link of an appendage"),
    ("[joint.drve]\nstiffness = { relative = 0.1 }", "did you mean 'drive'"),
    ("[joint.wheel]\nstiffness = { relative = 0.1 }", "wheel.stiffness is 0"),
    ("[joint.left_hinge1_xy]\nstiffness = { relative = 0.1 }", "is a hinge of an appendage"),
    ("[appendage.lft_]\nfrequency = { relative = 0.1 }", "did you mean 'left_'"),
    ("[appendage.left_]\nfrequency = { absolute = 2.0 }", "may fall to"),
    (
        "[appendage.left_]\nfrequency = { relative = 0.1, absolute = 2.0 }",
        "either relative or absolute",
    ),
    ('[appendage.left_]\nfrequency = { relative = 0.1, each = true, group = "a" }', "contradict"),
    ("[appendage.left_]\nparticipation = { absolute = 0.1 }", "relative only"),
    ("[appendage.left_]\ndamping = { relative = 0.5 }", "may fall to -"),
    (
        '[[appendage.left_.mode]]\nnumber = 7\nport = "xy"\nfrequency = { relative = 0.1 }',
        "mode = 'mode7_xy' is unknown",
    ),
    (
        '[[appendage.left_.mode]]\nnumber = 1\nport = "xy"\n[[appendage.left_.mode]]\nnumber = '
        '1\nport = "xy"',
        "two [[mode]]",
    ),
    (
        "[body.bus]\nmass = { relative = 0.1 }\ninertia_xx = { relative = 0.1 }\n[[correlation]]\n"
        'of = ["bus.mass", "bus.inertia_xx"]\nmatrix = [[1.0, 1.5], [1.5, 1.0]]',
        "positive semidefinite",
    ),
    (
        '[body.bus]\nmass = { relative = 0.1 }\n[[correlation]]\nof = ["bus.mass"]\nmatrix = '
        "[[2.0]]",
        "1 on its diagonal",
    ),
    (
        '[body.bus]\nmass = { relative = 0.1 }\n[[correlation]]\nof = ["bus.mas"]\nmatrix = '
        "[[1.0]]",
        "did you mean 'bus.mass'",
    ),
    (
        '[body.bus]\nmass = { relative = 0.1, distribution = "uniform" }\n[[correlation]]\nof = '
        '["bus.mass"]\n'
        "matrix = [[1.0]]",
        "is uniform",
    ),
    (
        "[appendage.left_]\nfrequency = { relative = 0.1 }\n[[correlation]]\nof = "
        '["left_mode1_xy.frequency"]\n'
        "matrix = [[1.0]]",
        "drawn together with",
    ),
    (
        '[body.bus]\nmass = { relative = 0.1 }\n[[correlation]]\nof = ["bus.mass"]\nmatrix = '
        "[[nan]]",
        "finite",
    ),
    ("[body", "is not TOML"),
    ("[" + ".".join("a" * 60) + "]", "nested too deeply"),
    ("", "nothing is uncertain"),
]


@pytest.mark.parametrize(("text", "match"), CRAFTS, ids=[match[:24] for _, match in CRAFTS])
def test_impossible_crafts_are_one_sentence(swept, folder, tmp_path, text, match):
    (tmp_path / "craft.toml").write_text(text)
    arguments = ["sweep", folder / "out" / "flexible.xml", "--uncertain", tmp_path / "craft.toml"]
    answer = call(*arguments, "-o", tmp_path / "out", "--samples", 2)
    said = answer.err.strip()
    assert answer.status == 2
    assert match in said
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_uncertain_modes_get_tendons_by_themselves():
    plain = structs.replace(beam("left", xy=2), damping=None)
    assert not any(t.stiffness > 0.0 for t in bc.fit(plain).chain.tendons)
    uncertain = beam("left", uncertain={"frequency": {"relative": 0.1}}, xy=2).uncertain
    made = bc.fit(structs.replace(plain, uncertain=uncertain))
    assert sum(t.stiffness > 0.0 for t in made.chain.tendons) == 2


def test_the_command(folder, swept, tmp_path):
    (tmp_path / "craft.toml").write_text("[joint.drive]\nstiffness = { relative = 0.1 }\n")
    at = f"plate={folder / 'plate.toml'}"
    arguments = ["sweep", folder / "craft.xml", "--mount", at]
    arguments += ["--uncertain", tmp_path / "craft.toml", "-o", tmp_path / "out", "--samples", 6]
    answer = call(*arguments, "--gain", "torque:bus=attitude", "--gain", "wheel=rate")
    assert answer.status == 0, answer.err
    record = json.loads((tmp_path / "out" / "sweep.json").read_text())
    assert {one["name"] for one in record["quantities"]} == {
        "plate_mode1.frequency",
        "plate_mode2.frequency",
        "plate_mode1.participation",
        "plate_mode2.participation",
        "drive.stiffness",
    }
    assert sorted(path.name for path in Path(tmp_path / "out").iterdir()) == [
        "apply_variants.py",
        "coupled_frequencies.svg",
        "flexible.xml",
        "modal_gains.svg",
        "sweep.json",
        "variants.npz",
    ]


def test_the_sweep_of_a_craft_has_no_nominal_fit(swept):
    with pytest.raises(bc.InputError, match="nominal"):
        swept.nominal
