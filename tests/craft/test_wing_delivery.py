"""A delivery as a structural engineer has it, from its files to the loads at each foot, against the
mesh that it was made from (`support/superelements.py`, which shares nothing with the package)."""

import json
import re
import shutil
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
import superelements as se
from beamchain.errors import EngineError
from beamchain.report.tables import fit as tables
from command import call
from solver import moved

WING = se.wing_on_two_feet(se.SHIPPED)
SQUARES = eigh(WING.mesh_stiffness[12:, 12:], WING.mesh_mass[12:, 12:], eigvals_only=True)
FREQUENCIES = np.sqrt(SQUARES)
AXES = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # of the appendage
ROOT = np.mean(list(se.FEET.values()), axis=0)  # mm
CORNER = AXES @ (np.array([500.0, -4900.0, 350.0]) - ROOT) * 1e-3  # m, from the root
MUJOCO = 1e-8  # mjd_transitionFD
EXACT = 1e-6  # of values that MuJoCo integrates or differences
CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody>
<body name="bus"><freejoint/>
<inertial pos="0.1 0 0" mass="200" diaginertia="60 75 50"/>
<site name="mount" pos="0.8 0.2 0.1" xyaxes="0 1 0 -1 0 0"/></body></worldbody></mujoco>"""
BASE = {"file": "wing.op4", "axes": AXES.tolist(), "units": {"length": 1e-3, "mass": 1e3}}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the shipped delivery."""
    monkeypatch.chdir(tmp_path)
    for path in (Path(bc.__file__).parent / "examples" / "wing").iterdir():
        shutil.copy(path, path.name)
    return tmp_path


def wing(damping=0.005, **imported):
    """The specification of the delivery, with some keys of [imported]."""
    lines = [f"{key} = {toml(value)}" for key, value in (BASE | imported).items()]
    text = "\n".join(['name = "wing"', "[imported]", *lines])
    text += f"\n[damping]\nratio = {toml(damping)}\n"
    Path("spec.toml").write_text(text)
    return bc.read_spec("spec.toml")


@cache
def as_shipped():
    """The delivery in the spacecraft, made in the folder of the first test that reads it."""
    return bc.embed(CRAFT, {"mount": wing()}, retime=False)


@cache
def kept_fit():
    return bc.fit(wing(modes=list(KEPT)))


def toml(value):
    """A value as TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(one)}" for key, one in value.items()) + " }"
    return json.dumps(value)


def rigid_mass():
    """`(6, 6)` of the mesh about the root, in basic axes, mm and t."""
    motion = np.vstack([moved(np.eye(6), np.array(p) - ROOT) for p in WING.nodes])
    return motion.T @ WING.mesh_mass @ motion


# -- which modes are kept, by their numbers in the file --------------------------------------------
KEPT = (1, 2, 4, 7)


@pytest.mark.slow
def test_kept_modes_have_their_numbers_in_the_file(folder):
    fit = kept_fit()
    assert "Kept: modes 1, 2, 4, 7 of the 8 of the file." in fit.status.message
    assert fit.as_dict()["space"]["kept"] == KEPT
    shown = tables.mode_table(fit)
    heads = dict(zip(shown.head, zip(*shown.rows, strict=True), strict=True))
    assert heads["mode of the file"] == ("1", "2", "4", "7")  # each once, not once per port
    found = [float(w) for w in heads["through MuJoCo, rad/s"]]
    assert found == pytest.approx(FREQUENCIES[[k - 1 for k in KEPT]], rel=1e-5)
    tendons = tables.tendon_table(fit)
    column = {c.name: c.values for c in tendons.columns}
    numbered = [
        (number, w)
        for number, w in zip(column["mode of the file"], column["frequency"], strict=True)
        if number is not None
    ]
    assert sorted(number for number, _ in numbered) == list(KEPT)
    for number, w in numbered:
        assert w == pytest.approx(FREQUENCIES[number - 1], rel=MUJOCO)


def test_effective_masses_of_kept_modes_and_of_all(folder):
    fit = kept_fit()
    table = tables.effective_mass_table(fit.space)
    *_, kept, every = table.rows
    assert (kept[0], every[0]) == ("kept", "all")
    shapes = eigh(WING.mesh_stiffness[12:, 12:], WING.mesh_mass[12:, 12:])[1][:, : se.SHIPPED]
    along = np.tile(np.r_[0.0, 0.0, 1.0, 0.0, 0.0, 0.0], len(WING.nodes))  # z of all nodes
    share = 100.0 * (shapes.T @ (WING.mesh_mass @ along)[12:]) ** 2 / rigid_mass()[2, 2]
    assert float(kept[4]) == pytest.approx(share[[k - 1 for k in KEPT]].sum(), abs=0.006)
    assert float(every[4]) == pytest.approx(share.sum(), abs=0.006)
    mass = rigid_mass()[0, 0] * 1e3
    assert any(f"Total mass {mass:.6g} kg, mass centre at (" in note for note in table.notes)


@pytest.mark.slow
def test_embed_says_which_modes_are_kept_and_where_the_mass_stands(folder):
    Path("craft.xml").write_text(CRAFT)
    wing(modes=list(KEPT))
    words = ["--mount", "mount=spec.toml", "-o", "f.xml", "--full"]
    status, out, _ = call("embed", "craft.xml", *words)
    assert status == 3  # mode 3 is left out, and lies below those kept
    assert re.search("kept: .*modes 1, 2, 4, 7 of the 8 of the file", " ".join(out.split()))
    flexible = bc.embed("craft.xml", {"mount": "spec.toml"}, retime=False)
    record = flexible.as_dict()["appendages"][0]
    assert record["modes_of_the_file"] == KEPT
    mass = rigid_mass()
    centre = AXES @ np.array([mass[1, 5], mass[2, 3], mass[0, 4]]) / mass[0, 0] * 1e-3
    mount = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # columns: x, y, z
    wanted = np.array([0.8, 0.2, 0.1]) + mount @ centre
    assert flexible.mass_centres["mount"] == pytest.approx(wanted, abs=1e-9)
    assert record["mass_centre"] == pytest.approx(wanted, abs=1e-9)
    page = " ".join(Path("f_report.html").read_text().split())
    assert "by all modes in its file" in page
    assert "modes 1, 2, 4, 7 of the 8 of the file" in page


# -- loads of each foot, accelerations of a point --------------------------------------------------
@cache
def rigid():
    """`(12, 6)` motion of both feet, mm and rad in their own axes, per m and rad of the root."""
    rows = []
    for grid, turn in ((1, np.eye(3)), (2, se.FEET_TURN)):
        away = np.array(se.FEET[grid]) - ROOT
        own = moved(np.eye(6), away)
        rows.append(np.kron(np.eye(2), turn) @ own)
    return np.vstack(rows) @ np.kron(np.eye(2), AXES.T) @ np.diag([1e3] * 3 + [1.0] * 3)


def foot_rows():
    """Forces of both feet on the spacecraft, N and N mm, and accelerations of the corner, mm/s^2,
    the last ones with the place of the corner."""
    mass, corner = WING.mass, WING.corner
    names = [f"foot{foot} {c}" for foot in (1, 2) for c in ("x", "y", "z", "rx", "ry", "rz")]
    return bc.spec.RecoveryRows(
        names=[*names, "corner x", "corner y", "corner z"],
        accelerations=np.vstack([-mass[:12, 12:], corner[:, 12:]]),
        root=np.vstack([-mass[:12, :12] @ rigid(), corner[:, :12] @ rigid()]),
        points=np.vstack([np.zeros((12, 3)), np.tile(CORNER, (3, 1))]),
    )


@pytest.mark.slow
def test_forces_of_the_feet_add_up_to_the_load_of_the_root(folder):
    flexible = as_shipped()
    data = mujoco.MjData(flexible.model)
    record = flexible.recorder()
    for _ in range(300):
        data.xfrc_applied[1] = [3e-3, -2e-3, 1e-3, 3e-4, 2e-4, -4e-4]
        record(data)
        mujoco.mj_step(flexible.model, data)
    found = flexible.recover(record, rows=foot_rows())
    feet = found.rows[:, :12]
    force = (feet[:, :3] + feet[:, 6:9] @ se.FEET_TURN) @ AXES.T  # basic, then appendage axes
    moment = np.zeros_like(force)
    for grid, own, turn in ((1, feet[:, :6], np.eye(3)), (2, feet[:, 6:], se.FEET_TURN)):
        arm = np.array(se.FEET[grid]) - ROOT
        moment += own[:, 3:] @ turn + np.cross(arm, own[:, :3] @ turn)
    moment = 1e-3 * moment @ AXES.T
    # what remains is of second order in the motion: a spin of 2e-6 rad/s
    assert np.max(np.abs(force - found.root_force)) < EXACT * np.max(np.abs(found.root_force))
    assert np.max(np.abs(moment - found.root_moment)) < EXACT * np.max(np.abs(found.root_moment))
    kept = bc.embed(CRAFT, {"mount": wing(modes=list(KEPT))}, retime=False)
    part = kept.recover(mujoco.MjData(kept.model))
    numbers = dict(zip(part.modes, part.in_file, strict=True))
    assert numbers == {f"mode{i}": number for i, number in enumerate(KEPT, 1)}
    assert any("7 (mode4)" in note for note in part.table.notes)
    assert part.as_dict()["modes_of_the_file"] == list(part.in_file)


@pytest.mark.slow
def test_element_forces_hold_what_the_modes_of_the_file_hold(folder):
    """No mode of the file moves along x: a push along x loads the feet, and the bar hardly."""
    bar = bc.spec.RecoveryRows(names=["fx", "fy", "fz"], modes=WING.bar[:3, 12:])
    craft = CRAFT.replace("<freejoint/>", '<joint type="slide" axis="0 1 0"/>')
    flexible = bc.embed(craft, {"mount": wing()}, retime=False)
    data = mujoco.MjData(flexible.model)
    data.xfrc_applied[1, 1] = 1.0  # the appendage's x is the craft's y
    feet = flexible.recover(data, rows=foot_rows()).rows[0]
    root = flexible.recover(data).root_force[0]
    along = -(feet[1] + feet[6])  # basic y of both feet; component 1 of the second points along y
    assert along == pytest.approx(root[0], rel=1e-6)
    history = flexible.recorder()
    for _ in range(500):
        history(data)
        mujoco.mj_step(flexible.model, data)
    held = np.max(np.abs(flexible.recover(history, rows=bar).rows[:, 1]))
    assert held < 0.05 * abs(root[0]) / 2.0  # half of it is the foot's, and truly the bar's


@pytest.mark.slow
def test_a_point_has_the_centripetal_acceleration_of_a_spin(folder):
    """Of a point that moves with the root, against MuJoCo's accelerometer there."""
    at = np.array([0.8, 0.2, 0.1]) + np.array([-CORNER[1], CORNER[0], CORNER[2]])
    site = f'<site name="corner" pos="{" ".join(map(str, at))}" xyaxes="0 1 0 -1 0 0"/></body>'
    sensor = '<sensor><accelerometer name="felt" site="corner"/></sensor></mujoco>'
    craft = CRAFT.replace("</body>", site).replace("</mujoco>", sensor)
    flexible = bc.embed(craft, {"mount": wing()}, retime=False)
    data = mujoco.MjData(flexible.model)
    data.qvel[3:6] = [0.3, -0.2, 0.5]
    data.xfrc_applied[1] = [3.0, -2.0, 1.0, 0.3, 0.2, -0.4]
    rows = foot_rows()
    still = np.zeros((3, se.SHIPPED))
    last = {"names": rows.names[-3:], "accelerations": still, "root": rows.root[-3:]}
    found = flexible.recover(data, rows=bc.spec.RecoveryRows(**last, points=rows.points[-3:])).rows[
        0
    ]
    bare = flexible.recover(data, rows=bc.spec.RecoveryRows(**last)).rows[0]
    mujoco.mj_forward(flexible.model, data)
    felt = AXES.T @ data.sensor("felt").data * 1e3  # mm/s^2 in basic axes
    assert found == pytest.approx(felt, rel=EXACT, abs=EXACT * np.max(np.abs(felt)))
    assert np.max(np.abs(bare - felt)) > 0.1 * np.max(np.abs(felt))


def test_points_in_files_and_points_that_do_not_move(folder):
    rows = foot_rows()
    arrays = {key: getattr(rows, key) for key in ("names", "accelerations", "root", "points")}
    np.savez("rows.npz", **arrays)
    row = rows.root[-1].tolist()
    Path("rows.toml").write_text(
        '[[row]]\nname = "corner z"\naccelerations = [0, 0, 0, 0, 0, 0, 0, 0]\n'
        f"root = {row}\npoint = {CORNER.tolist()}\n"
    )
    flexible = as_shipped()
    data = mujoco.MjData(flexible.model)
    data.qvel[3:6] = [0.3, -0.2, 0.5]
    by_array = flexible.recover(data, rows="rows.npz").rows
    assert by_array == pytest.approx(flexible.recover(data, rows=rows).rows)
    spin = np.array([0.3, -0.2, 0.5]) @ np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    centripetal = 1e3 * np.cross(spin, np.cross(spin, CORNER))[2]
    with_point = flexible.recover(data, rows="rows.toml").rows[0, 0]
    Path("rows.toml").write_text(Path("rows.toml").read_text().rpartition("point")[0])
    without = flexible.recover(data, rows="rows.toml").rows[0, 0]
    assert with_point - without == pytest.approx(centripetal, rel=1e-9)


def test_extremes_name_what_is_rigid_and_what_is_nothing(folder):
    flexible = as_shipped()
    data = mujoco.MjData(flexible.model)
    data.qvel[3:6] = [0.0, 0.0, 0.5]
    still = bc.spec.RecoveryRows(names=["still"], modes=np.zeros((1, se.SHIPPED)))
    found = {row.quantity: row for row in flexible.recover(data, rows=still).extremes}
    assert found["root force x"].largest_from == "rigid motion and modes left out"
    assert found["still"].largest_from == "nothing"


# -- damping and units -----------------------------------------------------------------------------
def codes(warnings):
    return {warning.code for warning in warnings}


@pytest.mark.slow
def test_damping_by_mode_of_the_file(folder):
    listed = [0.01, 0.002, 0.003, 0.004]
    fit = bc.fit(wing(listed))
    wanted = np.array([*listed, *[0.004] * 4])
    assert fit.space.data.damping == pytest.approx(wanted)
    for mode in tables.every_mode(fit):  # read back from MuJoCo
        assert mode.damping == pytest.approx(wanted[mode.in_file - 1], rel=1e-6)
    assert "undamped-modes" not in codes(fit.warnings)
    flexible = bc.embed(CRAFT, {"mount": wing(listed)}, retime=False)
    flexible.write("flexible.xml")  # whose mark holds the list
    again = bc.prove("flexible.xml").appendages[0].fit.space.data.damping
    assert again == pytest.approx(wanted)
    assert bc.read_spec("wing.toml").replace(damping=[0.01, 0.02]).damping.ratio == (0.01, 0.02)


@pytest.mark.slow
def test_a_table_that_leaves_modes_undamped_is_asked_about(folder):
    spec = wing({"xz": [0.005, 0.01]})
    fit = bc.fit(spec)
    (warning,) = [w for w in fit.warnings if w.code == "undamped-modes"]
    bare = [k + 1 for k, port in enumerate(fit.space.data.belongs) if port != "xz"]
    assert f"leaves modes {', '.join(map(str, bare))} of the file" in warning
    assert np.all(fit.space.data.damping[[k - 1 for k in bare]] == 0.0)
    assert "undamped-modes" in codes(bc.embed(CRAFT, {"mount": spec}, retime=False).warnings)


@pytest.mark.slow
def test_forgotten_units_are_asked_about(folder):
    (asked,) = [w for w in bc.fit(wing(units={})).warnings if w.code == "file-units"]
    assert "need units = { length = 1e-3, mass = 1e3 }" in asked
    assert "file-units" in codes(bc.fit(wing(units={"length": 1e-3})).warnings)  # 0.7 g/m
    assert "file-units" not in codes(bc.fit(wing()).warnings)
    with pytest.raises(EngineError, match="mass = 1e-13"):
        bc.fit(wing(units={"length": 1e-3, "mass": 1e-13}))


def test_a_table_in_place_of_an_object(folder):
    spec = bc.read_spec("wing.toml")
    by_table = bc.Spec(imported=spec.imported, modes={"xz": 2, "xy": 1}, damping=0.005)
    assert by_table.modes.counts() == {"xy": 1, "xz": 2}
    assert by_table.damping.ratio == 0.005


# -- the step, the terminal ------------------------------------------------------------------------
@pytest.mark.slow
def test_a_step_that_misses_poles_says_why(folder):
    craft = CRAFT.replace('timestep="0.001"', 'timestep="0.02" integrator="implicitfast"')
    flexible = bc.embed(craft, {"mount": wing()}, retime=True)
    (note,) = [w for w in flexible.warnings if w.code == "time-error"]
    assert "exceeds omega h/12, as Euler can" in note
    assert "in the rest pose" in note
    flexible.write("flexible.xml")
    status, out, _ = call("inspect", "flexible.xml")
    assert status == 0
    assert "timing for implicitfast at 0.02 s" in " ".join(out.split())
    assert "exact in time" not in out


@pytest.mark.slow  # two pages
def test_fit_names_a_mode_that_is_left_out_in_the_band(folder):
    wing(modes=[1, 2, 3, 4, 6])
    status, out, _ = call("fit", "spec.toml", "-o", "out")
    said = " ".join(out.split())
    named = f"mode 5 of the file ({FREQUENCIES[4]:.4g} rad/s) lies in the band and is not kept"
    assert status == 0
    assert said.count("lies in the band") == 1
    assert named in said
    wing()
    assert "lies in the band" not in call("fit", "spec.toml", "-o", "out", "--force").out


@pytest.mark.slow
def test_embed_counts_modes_that_are_left_out_in_the_band(folder):
    Path("craft.xml").write_text(CRAFT.replace('timestep="0.001"', 'timestep="0.02"'))
    wing(modes=[1, 2, 3, 4, 6])
    words = ("embed", "craft.xml", "--mount", "mount=spec.toml", "-o", "f.xml", "--no-report")
    status, out, _ = call(*words, "--retime", "--full")
    said = " ".join(out.split())
    assert status == 0
    assert "; one mode in the band is left out" in said
    assert "in continuous time, and by" in said
    assert "when stepped by Euler at 0.02 s" in said
    assert "timing for Euler at 0.02 s; " in said
    wing()
    out = call(*words, "--force", "--no-retime", "--full").out
    assert "in the band is left out" not in out
    assert "timing for" not in out


@pytest.mark.slow
def test_a_wing_that_runs_through_the_bus_is_noted(folder):
    outwards = CRAFT.replace('pos="0.8 0.2 0.1"', 'pos="0.1 0.9 0"')
    inwards = outwards.replace('xyaxes="0 1 0 -1 0 0"', 'xyaxes="0 -1 0 1 0 0"')
    for craft, said in ((outwards, False), (inwards, True)):
        made = bc.embed(craft, {"mount": wing()}, rigid=True)
        assert ("points-inward" in codes(made.warnings)) is said


@pytest.mark.slow
def test_init_writes_a_delivery_that_fits(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("init", "wing")[0] == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "wing.asm",
        "wing.op4",
        "wing.pch",
        "wing.toml",
    ]
    Path("wing.toml").unlink()
    status, _, err = call("init", "wing")
    assert status == 2
    assert "wing.asm" in err
    assert not Path("wing.toml").exists()
    assert call("init", "wing", "--force")[0] == 0
    fit = bc.fit("wing.toml")
    assert fit.status.ok
    assert "grids 1, 2 of wing.asm held as one rigid body" in fit.status.history[0]


@pytest.mark.slow
def test_the_command_says_where_the_delivery_of_init_is_held(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("init", "wing")[0] == 0
    status, out, _ = call("fit", "wing.toml", "-o", "out", "--full")
    assert status == 0
    said = " ".join(out.split())
    assert "rigid body by" not in said  # 1e-12 of rounding is not worth a sentence
    assert "grids 1, 2 of wing.asm held as one rigid body" in said
    assert "(800, -900, 350): place" in said


@pytest.mark.slow
def test_a_heavy_bus_on_a_slide_joint_gives_the_1_g_case(folder):
    """Mass and first moment of the mesh times 9.81 m/s^2, held until the wing has settled."""
    slide = CRAFT.replace("<freejoint/>", '<joint type="slide" axis="0 0 1"/>')
    slide = slide.replace('mass="200"', 'mass="1e7"').replace('"0.001"', '"0.002"')
    flexible = bc.embed(slide, {"mount": wing(0.3)})
    model, data = flexible.model, mujoco.MjData(flexible.model)
    total = float(np.sum(model.body_mass))
    for _ in range(6000):
        ramp = np.sin(np.pi * min(data.time / 8.0, 1.0) / 2.0) ** 2
        data.qfrc_applied[0] = 9.81 * total * ramp
        mujoco.mj_step(model, data)
    found = flexible.recover(data, "mount", rows=foot_rows())
    mass = rigid_mass()
    weight = 9.81e3 * mass[2, 2]  # t to kg
    print(found.root_force[0], weight, found.root_moment[0], 9.81 * mass[2, 3:])  # noqa: T201
    assert found.root_force[0] == pytest.approx([0.0, 0.0, -weight], abs=2e-5 * weight)
    # about the appendage's y; the wing hangs bent, which shortens its arm
    arm = 9.81 * abs(mass[2, 3])
    assert abs(found.root_moment[0, 1]) == pytest.approx(arm, rel=2e-3)
    feet = found.rows[0, :12]
    force = (feet[:3] + feet[6:9] @ se.FEET_TURN) @ AXES.T
    assert force == pytest.approx(found.root_force[0], abs=2e-5 * weight)


def test_feet_lack_the_centrifugal_force_of_a_spin(folder):
    """By m w x (w x c) of the mesh about the root, in the first instant of a spin of 0.1 rad/s."""
    flexible = as_shipped()
    data = mujoco.MjData(flexible.model)
    data.qvel[5] = 0.1  # rad/s about z, which is the appendage's z as well
    found = flexible.recover(data, rows=foot_rows())
    feet = found.rows[0, :12]
    force = (feet[:3] + feet[6:9] @ se.FEET_TURN) @ AXES.T
    mass = rigid_mass()
    # first moment of the block m [c x], t mm in basic axes
    moment = AXES @ [-mass[4, 2], mass[3, 2], -mass[3, 1]]
    lacking = 0.1**2 * moment * [1.0, 1.0, 0.0]  # t mm/s^2 = N
    assert lacking[0] > 0.03
    assert found.root_force[0] - force == pytest.approx(lacking, abs=1e-6 * lacking[0])
