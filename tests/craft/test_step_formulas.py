"""Closed forms beside what one step of MuJoCo makes of a craft, when timing is worth it, how modes
and poses are named, and what disturbs an appendage."""

from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from lxml import etree
from scipy.linalg import eigh

import beamchain as bc
from beamchain.errors import EngineError
from beamchain.steps.budget import HOST
from formulas import (
    AppendageOnLoad,
    CraftError,
    Embedded,
    Way,
    cantilever_names,
    change_of_stiffness,
    cure_of_step,
    decide_timing,
    disturbances,
    embedded_headline,
    hanging_notes,
    is_worth_timing,
    joint_request,
    layout_of,
    lightest_of_bodies,
    linear_craft,
    mode_names,
    motion_warnings,
    mount,
    owner_of_place,
    pose_label,
    poses_of,
    response_change,
    rest_point,
    step_slopes,
    study_fit,
    time_notes,
)
from specs import spec_of

# -- one step --------------------------------------------------------------------------------------
H, OUTER, INNER = 0.02, 3.0, 2.0
SLIDES = f"""<mujoco><option timestep="{H}" integrator="Euler" gravity="0 0 0"/><worldbody>
<body><joint name="a" type="slide" stiffness="50" damping="1.5"/>
<inertial pos="0 0 0" mass="{OUTER}" diaginertia="1 1 1"/>
<body><joint name="b" type="slide" stiffness="80" damping="0.7" armature="0.4"/>
<inertial pos="0 0 0" mass="{INNER}" diaginertia="1 1 1"/></body></body></worldbody>
<actuator><motor name="push" joint="a" gear="3"/>
<general name="slow" joint="b" dyntype="filter" dynprm="0.2" gainprm="5"/></actuator></mujoco>"""


@pytest.mark.parametrize(("step", "rates"), [(H, 50.0), (1e-6, 5000.0), (4.0, 1.0)])
def test_one_step_of_euler(step, rates):
    """(M + h D) a = -K q - D v + F a; then v + h a, q + h v; the filter by its own rate."""
    text = SLIDES.replace(f'timestep="{H}"', f'timestep="{step}"')
    craft = linear_craft(mujoco.MjModel.from_xml_string(text), None, None, None, None)
    mass = np.array([[OUTER + INNER, INNER], [INNER, INNER + 0.4]])
    damping, stiffness = np.diag([1.5, 0.7]), np.diag([50.0, 80.0])
    inverse = np.linalg.inv(mass + step * damping)
    pushed = np.array([[3.0, 0.0], [0.0, 5.0]])  # by ctrl of the one, by the state of the other
    rate = step * inverse @ np.hstack([-stiffness, -damping, pushed[:, 1:]])
    rate[:, 2:4] += np.eye(2)
    place = step * rate
    place[:, :2] += np.eye(2)
    filtered = np.array([[0.0, 0.0, 0.0, 0.0, 1.0 - step / 0.2]])
    found, driven = step_slopes(craft.point, craft.linear, craft.inputs)
    np.testing.assert_allclose(found, np.vstack([place, rate, filtered]), rtol=1e-6, atol=1e-7)
    rate = step * inverse @ pushed[:, :1]
    wanted = np.zeros((5, 2))
    wanted[:, 0] = np.concatenate([step * rate[:, 0], rate[:, 0], [0.0]])
    wanted[4, 1] = step / 0.2
    np.testing.assert_allclose(driven, wanted, rtol=1e-6, atol=1e-9)
    if step == H:  # its blocks are of (A - 1) / h and B / h
        read = '<sensor><jointpos name="place" joint="a"/></sensor></mujoco>'
        model = mujoco.MjModel.from_xml_string(text.replace("</mujoco>", read))
        form = linear_craft(model, None, None, None, ["place"]).form(sampled=True)
        s = 0.3 + 2.1j
        moved = np.linalg.solve(s * H * np.eye(5) - (found - np.eye(5)), driven)[:1]
        blocks = form.c @ np.linalg.solve(s * np.eye(len(form.a)) - form.a, form.b)
        np.testing.assert_allclose(blocks, moved, rtol=1e-5)


# -- which timing ----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("by", "error", "wanted", "needed"),
    [
        ("Euler", 0.21, None, True),
        ("Euler", 0.19, None, False),
        ("Euler", 0.19, True, True),
        ("Euler", 0.21, False, False),
        ("implicitfast", np.inf, None, True),
        ("RK4", 0.21, None, False),
        ("RK4", 0.21, True, False),
        ("RK4", np.inf, None, True),
    ],
)
def test_timing_is_needed_where_the_step_errs_by_more_than_is_allowed(
    monkeypatch, by, error, wanted, needed
):
    """0.2 is; RK4 is timed where it would be unstable alone."""
    monkeypatch.setattr("beamchain.craft.timing.step_error", lambda *_: (error, 0.2))
    text = SLIDES.replace('integrator="Euler"', f'integrator="{by}"')
    model = mujoco.MjModel.from_xml_string(text)

    def appendage(hung, hinges):
        chain = SimpleNamespace(hung=hung, hinges=range(hinges))
        return SimpleNamespace(fit=SimpleNamespace(chain=chain, spec=SimpleNamespace(scene=None)))

    liquid, stiff, boom = appendage(True, 4), appendage(False, 0), appendage(False, 4)
    found = decide_timing(model, [liquid, boom, stiff], wanted)
    assert found.needed is needed
    assert not decide_timing(model, [liquid, stiff], wanted).needed


def test_appendages_ask_together_for_the_largest_band_and_the_least_tolerance():
    """In the motions of any of them; of no scene with a band, all six."""
    scenes = [
        bc.Scene(bandwidth=3.0, tolerance=0.02, axes=("z",)),
        bc.Scene(bandwidth=5.0, tolerance=0.04, axes=("tx", "z")),
        bc.Scene(tolerance=0.001, axes=("ty",)),
        None,
    ]
    found = joint_request([SimpleNamespace(scene=scene) for scene in scenes])
    assert (found.band, found.tolerance, found.motions) == (5.0, 0.02, (0, 5))
    found = joint_request([SimpleNamespace(scene=scene) for scene in scenes[2:]])
    assert (found.band, found.tolerance, found.motions) == (None, None, (0, 1, 2, 3, 4, 5))


# -- timing ----------------------------------------------------------------------------------------
def test_a_response_changes_with_a_pole():
    """At a peak in the band by 1 / ratio; below one beyond, 2 s / (1 - s), s = (w / p)^2, as far
    as its width goes."""
    assert response_change(3.0, 0.02, 3.0) == pytest.approx(50.0)
    assert response_change(6.0, 0.02, 3.0) == pytest.approx(2.0 * 0.25 / 0.75)
    share = (3.0 / 3.01) ** 2
    assert response_change(3.01, 0.02, 3.0) == pytest.approx(2.0 * share / 0.04)
    assert response_change(3.01, 1e-3, 3.0) == pytest.approx(2.0 * share / (1.0 - share))


@pytest.mark.parametrize(
    ("plain", "timed", "tolerance", "worth"),
    [
        (0.3, 0.199, None, True),  # a third less
        (0.3, 0.201, None, False),
        (0.3, 0.201, 0.25, True),  # within the tolerance
        (0.2, 0.19, 0.25, False),  # as it was before
        (0.3, 0.27, 0.25, False),
        (0.3, np.inf, None, False),
        (np.inf, np.inf, None, True),  # the craft's own springs are left to blame
        (np.inf, 0.5, None, True),
    ],
)
def test_timing_is_worth_a_third_of_the_error_or_the_tolerance(plain, timed, tolerance, worth):
    assert is_worth_timing(plain, timed, tolerance) is worth


@pytest.mark.parametrize("stiffer", [0.7, 1.2])
def test_timing_changes_stiffness_by_its_worst_mode(stiffer, monkeypatch):
    modal = SimpleNamespace(index=np.array([2, 0]), stiffness=np.array([40.0, 5.0]))
    monkeypatch.setattr("beamchain.craft.timing.modal_tendons", lambda _: modal)
    model = SimpleNamespace(tendon_stiffness=np.array([5.0 * 1.1, 900.0, 40.0 * stiffer]))
    assert change_of_stiffness(model) == pytest.approx(abs(stiffer - 1.0))


@pytest.mark.parametrize(
    ("by", "exact", "growing", "codes"),
    [
        ("RK4", True, [], []),
        ("RK4", False, [], []),
        ("Euler", True, [], ["exact-in-time"]),
        ("Euler", True, ["rest"], []),
        ("implicit", False, [], ["time-error"]),
        ("implicit", False, ["rest"], []),
    ],
)
def test_what_timing_did_is_told_but_under_rk4_and_of_a_step_that_stays_unstable(
    by, exact, growing, codes, monkeypatch
):
    monkeypatch.setattr("beamchain.craft.timing.growing_poses", lambda *_: growing)
    monkeypatch.setattr("beamchain.craft.timing.time_reason", lambda _: "")
    monkeypatch.setattr("beamchain.craft.timing._stiffness_change", lambda _: 0.2)
    model = mujoco.MjModel.from_xml_string(
        STILL.format(step=0.01, by=by, g="0 0 0", rho=0, mu=0, con=0, aff=0, damper=0)
    )
    error = SimpleNamespace(exact=exact, error=0.01, words="words", frequency=3.0)
    found = time_notes(model, model, error, error)
    assert [caution.code for caution in found] == codes


# -- limits of a fit -------------------------------------------------------------------------------
FITTED_LIMITS = {
    "rod on its hub": {"Euler": 0.03, "implicit": 0.5, HOST: 0.9},
    "rod alone": {"Euler": 0.07, "implicit": 0.2, HOST: 0.9},
}


@pytest.mark.parametrize("step", [0.0299, 0.03, 0.3])
@pytest.mark.parametrize("overdamped", [False, True])
def test_limits_of_a_fit_are_those_on_its_hub_and_alone(step, overdamped, monkeypatch):
    """Its step and its own are held against those on its hub."""

    def budget(model, name):
        if overdamped and name == "rod alone":
            raise EngineError("nothing oscillates")
        return SimpleNamespace(name=name, timestep=0.02, largest_step=FITTED_LIMITS[name])

    monkeypatch.setattr("beamchain.craft.stability.compile_model", lambda text: text)
    monkeypatch.setattr("beamchain.craft.stability.budget", budget)
    spec = SimpleNamespace(
        name="rod", integrator="Euler", scene=SimpleNamespace(integrator="Euler")
    )
    fit = SimpleNamespace(
        spec=spec,
        step=step,
        scene_mjcf=lambda: "scene",
        bench_mjcf=lambda: "bench",
        large_motion=({"xy": "limit"}, ["why"]),
        chain=SimpleNamespace(tendons=()),
    )
    found = study_fit(fit)
    kept = list(FITTED_LIMITS)[: 1 if overdamped else 2]
    assert [each.name for each in found.budgets] == kept
    rows = [(name, *row) for name in kept for row in FITTED_LIMITS[name].items()]
    assert [(row.name, row.integrator, row.largest) for row in found.rows] == [
        row for row in rows if row[1] != HOST
    ]
    codes = ["overdamped"] * overdamped + ["unstable-step"] * (step >= 0.03)
    assert found.warnings[0] == "why"
    assert [caution.code for caution in found.warnings[1:]] == codes
    assert found.large == {"xy": "limit"}
    assert found.own_step.startswith("rod on its hub: stable as it is")
    assert not found.is_retimable
    spec.scene = None
    assert len(study_fit(fit).warnings) == 1 + overdamped
    fit.chain.tendons = ("mode1_xy",)
    assert study_fit(fit).is_retimable


# -- names -----------------------------------------------------------------------------------------
CHAIN = """<mujoco><worldbody><body><joint name="drive" type="slide" stiffness="90"/>
<joint name="free" type="slide" axis="1 0 0"/>
<inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>
<body><joint name="arm_hinge1_xy" stiffness="1"/><inertial pos="0 0 0" mass="1"
diaginertia="1 1 1"/>
<body><joint name="arm_hinge1_xz" stiffness="1"/><inertial pos="0 0 0" mass="1"
diaginertia="1 1 1"/>
<body><joint name="arm_hinge2_xy" stiffness="1"/><inertial pos="0 0 0" mass="1"
diaginertia="1 1 1"/></body></body></body></body></worldbody>
<tendon><fixed name="arm_filler1_xy" stiffness="400"><joint joint="arm_hinge2_xy" coef="1.5"/>
</fixed></tendon></mujoco>"""


@pytest.mark.parametrize(("held", "kind"), [(1801.0, "mode2"), (1799.0, "filler1")])
def test_modes_of_an_arm_with_its_root_held(held, kind):
    """Three hinges that nothing couples; the last has most of its energy in a filler of 900 where
    less than 1800 hold it."""
    model = mujoco.MjModel.from_xml_string(CHAIN)
    mass = np.diag([5.0, 5.0, 2.0, 1.0, 4.0])
    stiffness = np.diag([90.0, 0.0, 8.0, 9.0, held])
    names, rows = cantilever_names(model, mass, stiffness)
    assert names == ["arm_mode1_xy", "arm_mode1_xz", f"arm_{kind}_xy", "drive"]
    soft = np.diag([0.05, *np.diag(stiffness)[1:]])
    assert cantilever_names(model, mass, soft)[0] == names
    wanted = np.zeros((4, 5))
    wanted[[0, 1, 2, 3], [2, 3, 4, 0]] = np.sqrt([8.0, 9.0, held, 90.0])
    np.testing.assert_allclose(np.abs(rows), wanted, atol=1e-9)


def test_rows_of_coupled_hinges_take_the_strain_energy():
    model = mujoco.MjModel.from_xml_string(CHAIN)
    half = np.random.default_rng(3).standard_normal((3, 3))
    mass, stiffness = 5.0 * np.eye(5), np.zeros((5, 5))
    mass[2:, 2:] += half @ half.T
    stiffness[2:, 2:] = np.diag([7.0, 30.0, 90.0]) + half.T @ half
    names, rows = cantilever_names(model, mass, stiffness)
    assert len(names) == 3
    squares, shapes = eigh(stiffness[2:, 2:], mass[2:, 2:])
    # a mode of unit mass has the energy w^2, all of it its own
    taken = (rows[:, 2:] @ shapes) ** 2
    np.testing.assert_allclose(taken, np.diag(squares), atol=1e-9)
    moved = np.random.default_rng(4).standard_normal(3)
    assert np.sum((rows[:, 2:] @ moved) ** 2) == pytest.approx(moved @ stiffness[2:, 2:] @ moved)


def test_a_mode_has_the_name_of_what_holds_most_of_its_energy():
    """Each name once: the assignment that takes most; a third mode is a number."""
    shapes = np.array([[3.0, 5.0, 0.1], [1.0, 4.0, 0.05]])
    # energies 9:1, 25:16 and 4:1
    assert mode_names(shapes, ["a", "b"], np.eye(2)) == ["a", "b", "mode3"]
    shapes[:, 0] = [1.0, 1.0]
    assert mode_names(shapes[:, :2], ["a", "b"], np.eye(2)) == ["b", "a"]


# -- poses -----------------------------------------------------------------------------------------
POSES = """<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="9"
diaginertia="1 1 1"/><body><joint name="drive" axis="0 0 1"/><inertial pos="1 0 0" mass="2"
diaginertia="1 1 1"/><body><joint name="rail" type="slide"/><inertial pos="0 0 0" mass="1"
diaginertia="1 1 1"/></body></body>
<body><joint name="wheel" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 2"/></body>
</body></worldbody><keyframe><key name="bent" qpos="0 0 0 1 0 0 0 0.5 0 3"/>
<key qpos="0 0 0 1 0 0 0 0 0.2 0"/></keyframe></mujoco>"""


def test_a_way_is_as_long_as_its_largest_motion():
    """Wheels do not count, on whose angle nothing depends; all move together."""
    model = mujoco.MjModel.from_xml_string(POSES)
    start, end = np.array(model.qpos0), np.array(model.qpos0)
    start[7], end[[7, 8, 9]] = 0.1, [0.6, -0.7, 2.0]
    end[3:7] = [np.cos(0.2), 0.0, np.sin(0.2), 0.0]
    way = Way.between(model, start, end)
    assert way.length == pytest.approx(0.7)
    assert way.motion == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.4, 0.0, 0.5, -0.7, 2.0])
    half = way.at(0.25)
    assert half[3:7] == pytest.approx([np.cos(0.05), 0.0, np.sin(0.05), 0.0])
    assert half[7:] == pytest.approx([0.225, -0.175, 0.5])
    end[:] = start
    assert Way.between(model, start, end).length == 0.0


def test_poses_have_the_joints_that_they_name_or_that_move():
    model = mujoco.MjModel.from_xml_string(POSES)
    found = poses_of(model, [{"drive": 0.25}, "bent", 1, None])
    assert found.joints == ("drive", "rail")
    assert found.units == ("rad", "m")
    np.testing.assert_allclose(found.values, [[0.25, 0.0], [0.5, 0.0], [0.0, 0.2], [0.0, 0.0]])
    assert found.labels[1:] == ("bent", "keyframe 1", "rest")
    assert found.labels[0].startswith("drive ")
    assert found.angles is None
    grid = poses_of(model, {"drive": [0.0, 0.5, 1.0], "rail": 0.1})
    assert grid.joint == "drive"
    assert grid.angles == pytest.approx([0.0, 0.5, 1.0])
    assert grid.values[:, 1] == pytest.approx([0.1] * 3)
    listed = np.array([{"drive": 0.25}, "bent"], dtype=object)
    np.testing.assert_allclose(poses_of(model, listed).values, [[0.25], [0.5]])
    assert poses_of(model, {"drive": 0.5}) is None
    assert poses_of(model, list(map(float, model.qpos0))) is None
    qpos = np.array(model.qpos0)
    qpos[7] = 0.5
    assert pose_label(model, qpos) == pose_label(model, {"drive": 0.5})
    assert pose_label(model, None) == ""
    for wrong in ([], {"drive": [0.0], "rail": [0.1]}, {"drive": [[0.0]]}, {"drive": []}):
        with pytest.raises(bc.InputError, match="pose"):
            poses_of(model, wrong)


def test_bare_positions_of_many_joints_have_the_number_of_their_pose():
    """Up to four are named; a joint that has not moved is not."""
    bodies = "".join(
        f'<body><joint name="{name}" type="slide"/><geom size="1" contype="0"/></body>'
        for name in "abcde"
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    four, five = [0.1, 0.2, 1e-10, 0.3, 0.4], [0.1, 0.2, 0.5, 0.3, 0.4]
    found = poses_of(model, [five, four, five])
    assert found.labels[::2] == ("pose 1", "pose 3")
    assert [words.split()[0] for words in found.labels[1].split(", ")] == ["a", "b", "d", "e"]
    assert pose_label(model, five) == "pose 1"
    assert found.joints == ("c",)
    np.testing.assert_allclose(found.values, [[0.5], [1e-10], [0.5]])


# -- what disturbs ---------------------------------------------------------------------------------
STILL = """<mujoco><option timestep="{step}" integrator="{by}" gravity="{g}" density="{rho}"
viscosity="{mu}"/><worldbody><body><joint name="x" type="slide" stiffness="4"/>
<geom size="1" contype="{con}" conaffinity="{aff}" mass="1"/></body></worldbody>
<tendon><fixed name="t" damping="{damper}"><joint joint="x" coef="1"/></fixed></tendon></mujoco>"""


def codes_of(step=0.01, by="RK4", g="0 0 0", rho=0, mu=0, con=0, aff=0, damper=0, **more):
    text = STILL.format(step=step, by=by, g=g, rho=rho, mu=mu, con=con, aff=aff, damper=damper)
    given = {"fastest": 2.0, "zeta": 0.01, "geoms": [0], "bodies": [1], **more}
    found = disturbances(mujoco.MjModel.from_xml_string(text), **given)
    return [each.code for each in found]


@pytest.mark.parametrize(
    ("given", "codes"),
    [
        ({}, []),
        ({"g": "0 0.01 0"}, ["gravity"]),
        ({"rho": 0.1}, ["medium"]),
        ({"mu": 0.1}, ["medium"]),
        ({"con": 1}, ["collisions"]),
        ({"aff": 1}, ["collisions"]),
        ({"con": 1, "geoms": []}, []),
        ({"by": "Euler", "damper": 0.1}, ["tendon-damping"]),
        ({"by": "Euler", "damper": 0.1, "zeta": 0.0}, []),
        ({"by": "implicit", "damper": 0.1}, []),
        # RK4 is stable up to sqrt(8) / 2 s here, Euler without damping up to 2 / 2 s
        ({"step": 1.40}, []),
        ({"step": 1.43}, ["unstable-step"]),
        ({"step": 0.99, "by": "Euler"}, []),
        ({"step": 1.01, "by": "Euler"}, ["unstable-step"]),
        # the integrator discrete adds h w / 2 to a ratio, worth a word from half of it
        ({"by": "discrete", "step": 0.0049}, []),
        ({"by": "discrete", "step": 0.0051}, ["discrete-damping"]),
        ({"by": "discrete", "step": 0.00049, "zeta": 1e-4}, []),
        ({"by": "discrete", "step": 0.00051, "zeta": 1e-4}, ["discrete-damping"]),
        ({"by": "discrete", "step": 1.0, "fastest": 0.0}, []),
    ],
)
def test_what_disturbs_an_appendage_is_said(given, codes):
    if given.get("by") == "discrete" and not hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
        pytest.skip("this MuJoCo has no integrator of that name")
    assert codes_of(**given) == codes


HOLDER = """<mujoco><worldbody><body name="bus"><freejoint/><geom size="1"/>
<body name="drive" pos="0 0.2 0"><joint axis="0 0 1"/>
<inertial pos="{mass_at}" mass="2" diaginertia="1 1 1"/><site name="root" pos="0.1 0 0"/>
<body name="hand" pos="{hand}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
</body></body></worldbody></mujoco>"""


def notes(hand="10.1 0 0", mass_at="0 0 0", carries=(), ports=True):
    """What is said of a boom of 10 m with a port at its end, `hand` in the axes of the drive."""
    model = mujoco.MjModel.from_xml_string(HOLDER.format(hand=hand, mass_at=mass_at))
    section = {"shape": "equivalent", "bending_stiffness_xy": 900.0, "linear_mass": 1.0}
    table = {"name": "boom", "segment": [{"length": 10.0, "section": section}]}
    spec = spec_of({**table, "port": [{"name": "end", "x": 10.0}]} if ports else table)
    item = AppendageOnLoad(2, spec, {"end": tuple(carries)})
    return list(hanging_notes(model, mount(model, "root", "site", "root"), item))


@pytest.mark.parametrize(
    ("given", "codes"),
    [
        ({}, ["not-carried"]),
        ({"ports": False}, ["not-carried"]),
        ({"hand": "10.109 0 0"}, ["not-carried"]),  # within a thousandth of 10 m
        ({"hand": "10.1 0.009 0"}, ["not-carried"]),
        ({"hand": "10.111 0 0"}, []),
        ({"carries": ["hand"]}, []),
        ({"carries": ["hand"], "hand": "10.1 0 0.19"}, []),  # a bracket of a fiftieth
        ({"carries": ["hand"], "hand": "10.1 0 0.21"}, ["carried-apart"]),
        ({"carries": ["hand"], "hand": "-0.1 0 0"}, ["points-inward"]),
        ({"carries": ["hand"], "hand": "3.1 2 2.2"}, ["carried-apart"]),
        ({"carries": ["hand"], "hand": "3.1 2 2.3"}, ["points-inward"]),
        # a mass well out along the appendage, a quarter of its length and as far aside
        ({"hand": "5 5 5", "mass_at": "2.59 0 0"}, []),
        ({"hand": "5 5 5", "mass_at": "2.61 0 0"}, ["counted-twice"]),
        ({"hand": "5 5 5", "mass_at": "10.09 0 0"}, ["counted-twice"]),
        ({"hand": "5 5 5", "mass_at": "10.11 0 0"}, []),
        ({"hand": "5 5 5", "mass_at": "5 1.5 1.99"}, ["counted-twice"]),
        ({"hand": "5 5 5", "mass_at": "5 1.5 2.01"}, []),
    ],
)
def test_bodies_where_an_appendage_ends(given, codes):
    assert [each.code for each in notes(**given)] == codes


def test_where_a_body_apart_from_its_port_stands():
    (said,) = map(str, notes(hand="9.6 0.3 0", carries=["hand"]))
    assert "stands 0.583 m from port 'end'" in said
    assert "x of the body (9.5 m)" in said
    (said,) = map(str, notes(hand="10.1 0.3 0", carries=["hand"]))
    assert "x of the body" not in said
    (said,) = map(str, notes(hand="-1.9 0.3 0.4", carries=["hand"]))
    assert "stands behind it, at (-2, 0.3, 0.4) m in its axes" in said
    (said,) = map(str, notes(hand="1.1 3 4", carries=["hand"]))
    assert "stands beside it, at (1, 3, 4) m in its axes" in said


def test_a_strong_motor_is_moved_by_what_little_it_needs():
    """A pendulum, of which a motor of 1e6 N m may not be turned on: the series of RK4 at rest."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.1" integrator="RK4" gravity="0 0 -10"/><worldbody><body>
        <joint name="a" axis="0 1 0"/><inertial pos="0 0 -1" mass="2" diaginertia=".3 .5 .3"/>
        </body></worldbody><actuator><motor name="m" joint="a" gear="1e6"/></actuator></mujoco>"""
    )
    inertia = 2.5
    linear = SimpleNamespace(
        mass=np.array([[inertia]]),
        inputs=SimpleNamespace(force=np.array([[1e6]])),
        activations=SimpleNamespace(feed=np.zeros((0, 1))),
    )

    class Motor:
        def apply(self, data, by):
            data.ctrl[0] = by

    found, driven = step_slopes(rest_point(model, np.zeros(1)), linear, [Motor()])
    a = 0.1 * np.array([[0.0, 1.0], [-20.0 / inertia, 0.0]])
    b = 0.1 * np.array([[0.0], [1e6 / inertia]])
    powers = [np.linalg.matrix_power(a, k) for k in range(5)]
    step = powers[0] + powers[1] + powers[2] / 2.0 + powers[3] / 6.0 + powers[4] / 24.0
    pushed = (powers[0] + powers[1] / 2.0 + powers[2] / 6.0 + powers[3] / 24.0) @ b
    np.testing.assert_allclose(found, step, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(driven, pushed, rtol=1e-6)


def test_the_fastest_mode_of_no_appendage_is_damped_by_no_step():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.1" integrator="discrete" gravity="0 0 0"/><worldbody>
        <body><freejoint/><geom size=".3"/></body></worldbody></mujoco>"""
    )
    assert motion_warnings(model, [], model) == []
    text = STILL.format(step=0.01, by="Euler", g="0 0 0", rho=0, mu=0, con=0, aff=0, damper=0.1)
    model = mujoco.MjModel.from_xml_string(text)
    assert motion_warnings(model, [], model) == []


@pytest.mark.parametrize(
    ("damps", "kind", "shorter"),
    [(True, "servo", False), (True, "appendage", True), (False, "servo", True)],
)
def test_only_what_damps_the_spacecraft_itself_has_another_cure_than_a_step(damps, kind, shorter):
    found = cure_of_step(SimpleNamespace(damps=damps, kind=kind), "Euler", "STEP")
    assert (found == "write STEP") is shorter


def test_a_site_stands_on_its_body():
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody><body name="bus"><geom size="1"/><body name="end"><geom size="1"/>
        <site name="tip"/></body><site name="end"/></body></worldbody></mujoco>"""
    )
    assert owner_of_place(spec, "site", "tip").name == "end"
    assert owner_of_place(spec, "body", "end").name == "end"
    assert owner_of_place(spec, "site", "end").name == "bus"


def test_the_lightest_body_that_moves_is_behind_the_first_hinge():
    """The root's own does not count: it is held to the spacecraft."""
    root = etree.fromstring(
        """<body><inertial mass="0.1" diaginertia="1e-4 1e-4 1e-4"/><body>
        <inertial mass="0.7" diaginertia="0.03 0.2 0.2"/><body>
        <inertial mass="3" diaginertia="0.5 0.4 0.6"/></body></body></body>"""
    )
    made = SimpleNamespace(fit=SimpleNamespace(appendage=lambda timed: root))
    assert lightest_of_bodies([made]) == (0.7, 0.03)


def test_mass_centres_are_told_from_the_base_wherever_it_stands():
    """3 m along the appendage, which points along y of a base that is turned by 90 degrees."""
    craft = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="bus" pos="1 2 3" euler="0 0 90"><freejoint/>
        <geom size="1"/></body></worldbody></mujoco>"""
    )
    # x of the base is y of the world, and y of the base -x
    axes = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
    mass = np.diag([2.0, 2.0, 2.0, 0.1, 20.0, 20.0])
    mass[1, 5] = mass[5, 1] = 6.0  # the force along y has the moment m x about z
    mass[2, 4] = mass[4, 2] = -6.0
    held = SimpleNamespace(body=1, origin=np.array([1.0, 2.5, 3.0]), axes=axes)
    fit = SimpleNamespace(measured=SimpleNamespace(rigid_mass=mass))
    made = SimpleNamespace(craft=craft, appendages=[SimpleNamespace(at="m", mount=held, fit=fit)])
    found = Embedded.mass_centres.func(made)["m"]
    assert found == pytest.approx([0.5, 3.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(("part", "kept"), [(0.5, False), (2.0, True)])
def test_a_mass_centre_is_on_an_axis_but_for_rounding_of_its_distance(part, kept):
    craft = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>'
    )
    side = part * 1e-12 * 40.0
    held = SimpleNamespace(body=1, origin=np.array([40.0, side, 0.0]), axes=np.eye(3))
    fit = SimpleNamespace(measured=SimpleNamespace(rigid_mass=np.eye(6)))
    made = SimpleNamespace(craft=craft, appendages=[SimpleNamespace(at="m", mount=held, fit=fit)])
    assert Embedded.mass_centres.func(made)["m"].tolist() == [40.0, side if kept else 0.0, 0.0]


def test_only_a_file_of_the_spacecraft_has_hinges_to_slew():
    with pytest.raises(bc.InputError, match="joints = 'elbow': arm.toml has no hinges"):
        bc.stability("arm.toml", joints=["elbow"])


def test_loads_left_out_are_told_of_the_base_that_they_change_most(monkeypatch):
    """Two ships that keyframes push: both, one, and none; changes put in by hand."""
    ship = """<body name="{0}"><freejoint/><geom size="1" mass="2"/><site name="{0}"/></body>"""
    motor = """<motor name="{0}" site="{0}" gear="1 0 0 0 0 0"/>"""
    still = "0 0 0 1 0 0 0 0 0 0 1 0 0 0"
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0"/><worldbody>{ship.format("one")}{ship.format("two")}
        </worldbody><actuator>{motor.format("one")}{motor.format("two")}</actuator><keyframe>
        <key name="both" qpos="{still}" ctrl="3 1"/><key name="second" qpos="{still}" ctrl="0 2"/>
        <key name="coasts" qpos="{still}"/></keyframe></mujoco>"""
    )
    mounts = [SimpleNamespace(body=model.body(name).id) for name in ("one", "two")]
    whole = SimpleNamespace(rigid_mass=np.eye(6))
    items = [SimpleNamespace(mount=mount, whole=whole) for mount in mounts]
    monkeypatch.setattr("beamchain.craft.embedded.carried", lambda *_: items)
    changes = {("both", 1): 0.02, ("both", 2): 0.05, ("second", 1): 0.0, ("second", 2): 0.0}

    def pose(name, body):
        return SimpleNamespace(body=body, changed_by=lambda *_: changes[name, body])

    exact = {name: [pose(name, 1), pose(name, 2)] for name in ("rest", "both", "second", "coasts")}
    made = SimpleNamespace(
        loaded=False, craft=model, untimed=model, appendages=(), _exact_poses=exact
    )
    left_out = Embedded.loads_left_out.fget
    assert {name: change for name, (_, change) in left_out(made).items()} == {
        "both": 0.05, "second": 0.0,
    }  # fmt: skip
    changes["both", 1] = 0.07
    assert left_out(made)["both"][1] == 0.07
    made.loaded = True
    assert left_out(made) == {}


def test_of_two_poses_the_worse_is_named():
    promise = CraftError(0.03, 0.8, {"folded": 0.01, "unfolded": 0.03}, (5,), "bus", {})
    made = SimpleNamespace(
        promise=promise, tolerance=None, appendages=[SimpleNamespace(rigid=False)], loaded=False,
        by_step=False, ruined=False,
    )  # fmt: skip
    assert "unfolded" in embedded_headline(made)
    made.promise = replace(promise, poses={"folded": 0.03, "unfolded": 0.01})
    assert "unfolded" not in embedded_headline(made)
    assert "folded" in embedded_headline(made)


def test_positions_and_rates_of_the_craft_among_those_with_appendages(monkeypatch):
    """Hinges of appendages stand between a free joint, a ball, a slide and a hinge."""
    joints = ["<freejoint/>", *(f'<joint type="{kind}"/>' for kind in ("ball", "slide", "hinge"))]

    def chain(*joints):
        text = "".join(f'<body>{joint}<geom size="1"/>' for joint in joints)
        return mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody>{text}{'</body>' * len(joints)}</worldbody></mujoco>"
        )

    whole = chain(joints[0], "<joint/>", joints[1], "<joint/>", *joints[2:])
    module = "beamchain.craft.documents"
    monkeypatch.setattr(f"{module}.compile_document", lambda *_: whole)
    monkeypatch.setattr(f"{module}.craft_elements", lambda *_: {"jnt": [0, 2, 4, 5]})
    found = layout_of(None, [], chain(*joints))
    assert found["qpos"] == [*range(7), None, *range(7, 11), None, 11, 12]
    assert found["qvel"] == [*range(6), None, *range(6, 9), None, 9, 10]
    assert found["rest"] == list(whole.qpos0)
    with pytest.raises(EngineError, match="has 3 joints, with appendages 4"):
        layout_of(None, [], chain(*joints[:3]))
