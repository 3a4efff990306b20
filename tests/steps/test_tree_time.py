"""The step of an arm of two flexible links against exact motion: differences of `mj_step` against
the dense exponential of the file without timing, and of finite elements of the whole arm."""

import copy
import sys

import mujoco
import numpy as np
import pytest

import beamchain as bc
import stepped
from arms import Arm, Link, mjcf, side, toml
from command import call
from craft_truth import compiled
from mechanics import INTEGRATORS

BAND = 20.0
MODES = "[modes]\nxy = 2\nxz = 2\ntorsion = 1\n"
KEYS = {"bent": {"fore": np.pi / 4.0}, "square": {"fore": np.pi / 2.0}}
ANGLES = np.radians([0.0, 30.0, 45.0, 75.0, 90.0])  # poses, and places between them
# of the response, at peaks of 0.5 to 1 %, and of |z - 1|; plain Euler's poles are off by 1.7e-3 at
# 0.01 s where it is stable at all, with armature by the rule h^2 k/12 to h^2 k/4 by 7e-4
BOUNDS = {0.01: (2.5e-3, 1e-4), 0.02: (3e-2, 3e-4)}
STATED = 0.1  # relative: stated and found error of the response


def arm(hand):
    upper = Link("upper", 6.0, 0.05, 0.08)
    fore = Link("fore", 5.0, 0.04, 0.05, 4.0, (0.02, 0.02, 0.02), (0.0, 0.0, 1.0))
    return Arm((upper, fore), hand=hand, hand_inertia=(0.025 * hand,) * 3, keys=KEYS)


ONE = Arm((Link("upper", 6.0, 0.05, 0.08),), hand=20.0, hand_inertia=(0.5, 0.5, 0.5))


def embedded(folder, made, timestep, integrator="Euler", **options):
    craft = mjcf(made, timestep=timestep, integrator=integrator)
    (folder / "arm.xml").write_text(craft)
    at = {}
    for link in made.links:
        path = folder / f"{link.name}.toml"
        path.write_text(toml(made, link, BAND, 0.05, MODES))
        at[f"place_{link.name}"] = path
    return bc.embed(folder / "arm.xml", at, **options)


def turned(model, angle):
    qpos = model.qpos0.copy()
    qpos[model.joint("hinge_fore").qposadr[0]] = angle
    return qpos


@pytest.mark.slow
@pytest.mark.parametrize(
    ("timestep", "hand"),
    [(0.01, 0.01), (0.02, 100.0)],
)
def test_the_step_of_an_arm_is_near_exact_motion_at_every_angle(tmp_path, timestep, hand):
    made = arm(hand)
    flexible = embedded(tmp_path, made, timestep)
    plain = copy.copy(flexible.model)
    bc.retime(plain, 0.0)
    limit, poles = BOUNDS[timestep]
    for angle in ANGLES:
        qpos = turned(plain, angle)
        still = compiled(plain, qpos)
        ours = stepped.stepped(flexible.model, qpos)
        exact = stepped.held(still.mass, still.damping, still.stiffness, timestep)
        frozen = still.mass[:6, :6]
        error, place = stepped.response_error(exact, ours, frozen, timestep, BAND)
        pole, slow = stepped.time_error(flexible.model, plain, BAND, qpos)
        sys.stdout.write(
            f"{timestep:g} s, {hand:g} kg, {np.degrees(angle):.0f} deg: response {error:.2e} at "
            f"{place:.4g} rad/s, pole {pole:.2e} at {slow:.4g} rad/s\n"
        )
        assert error < limit
        assert pole < poles


@pytest.mark.slow
def test_the_stated_error_of_the_step_is_that_of_finite_elements(tmp_path):
    timestep = 0.01
    made = arm(20.0)
    flexible = embedded(tmp_path, made, timestep)
    angles = {"rest": 0.0, "bent": np.pi / 4.0, "square": np.pi / 2.0}
    angles["30% of the way from rest to bent"] = 0.3 * np.pi / 4.0
    angles["30% of the way from bent to square"] = 1.3 * np.pi / 4.0
    assert set(flexible.sampled_poses) == set(angles)
    for name, angle in angles.items():
        truth = side(made, BAND, {"fore": angle})
        exact = stepped.held(truth.mass, truth.damping, truth.stiffness, timestep)
        ours = stepped.stepped(flexible.model, turned(flexible.model, angle))
        frozen = truth.mass[:6, :6]
        found, _ = stepped.response_error(exact, ours, frozen, timestep, BAND)
        stated = flexible.sampled_poses[name].error
        sys.stdout.write(f"{timestep:g} s, {name}: stated {stated:.3e}, found {found:.3e}\n")
        assert stated == pytest.approx(found, rel=STATED, abs=1e-5)
    assert flexible.met is (1.01 * flexible.sampled_error <= 0.05)


@pytest.mark.slow
def test_timing_comes_out_bit_by_bit(tmp_path):
    flexible = embedded(tmp_path, ONE, 0.01, "implicitfast", retime=True)
    written = mujoco.MjModel.from_xml_string(flexible.to_mjcf())
    again = copy.copy(written)
    bc.retime(written, 0.0)
    plain = embedded(tmp_path, ONE, 0.01, "implicitfast", retime=False).model
    for name in ("stiffness", "damping", "armature", "solimp_lim"):
        field = f"tendon_{name}"
        assert np.array_equal(getattr(written, field), getattr(plain, field)), field
        assert np.array_equal(getattr(again, field), getattr(flexible.model, field)), field


SPRUNG = """<mujoco><option gravity="0 0 0" timestep="{step}" integrator="{integrator}"/>
<worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="60" diaginertia="20 22 24"/>
<body name="yoke" pos="0.5 0 0">
<joint name="drive" axis="0 0 1" {drive} armature="0.01"/>
<inertial pos="0.2 0 0" mass="2" diaginertia="0.05 0.05 0.05"/><site name="mount"/></body>
</body></worldbody>{more}</mujoco>"""
SERVO = '<actuator><position name="servo" joint="drive" kp="900" kv="3"/></actuator>'
DRIVES = {"sprung": ('stiffness="900" damping="3"', ""), "servo": ('damping="1"', SERVO)}
BEYOND = 1.2  # over x^4/480 + zeta x^2/6, what a damped spring with armature errs by
TEN = 10.0  # times smaller than without


SPEC = bc.Spec(
    name="boom",
    fit=bc.spec.FitOptions(springs="modes"),
    segment=(
        bc.Segment(
            length=4.0,
            section=bc.Equivalent(bending_stiffness_xy=1e6, linear_mass=3.0),
        ),
    ),
)
BOOM = """name = "boom"
[[segment]]
length = 4.0
section = { shape = "equivalent", bending_stiffness_xy = 1e6, linear_mass = 3.0 }
"""


def driven(drive, integrator, step, **options):
    attributes, more = DRIVES[drive]
    text = SPRUNG.format(step=step, integrator=integrator, drive=attributes, more=more)
    return bc.embed(text, {"mount": SPEC}, **options)


def with_joints(made, folder, step):
    """The model of its file after `retime --retime-joints`."""
    file = folder / "timed.xml"
    made.write(folder / "left.xml", force=True)
    words = ("--timestep", step, "--retime-joints", "-o", file, "--force")
    answer = call("retime", folder / "left.xml", *words)
    assert answer.status == 0, answer.err
    return mujoco.MjModel.from_xml_path(str(file))


@pytest.mark.parametrize(
    ("drive", "integrator"),
    [
        ("sprung", "Euler"),
        ("servo", "implicitfast"),
    ],
)
@pytest.mark.slow
def test_sprung_drives_get_armature_only_where_it_is_asked_for(tmp_path, drive, integrator):
    step = 0.04 if drive == "sprung" else 0.005
    left = driven(drive, integrator, step, retime=True)
    assert left.model.joint("drive").armature[0] == 0.01
    written = with_joints(left, tmp_path, step)
    assert written.joint("drive").armature[0] != 0.01
    poles = stepped.continuous(left.untimed)
    slowest = min(poles[poles.imag > 1.0], key=abs)
    size = abs(slowest)
    errors = [
        stepped.time_error(timed, left.untimed, 1.1 * size)[0] for timed in (left.model, written)
    ]
    x = size * step
    assert errors[1] < BEYOND * (x**4 / 480.0 - slowest.real / size * x**2 / 6.0)
    assert errors[0] > TEN * errors[1]
    bc.retime(written, 0.0)
    assert np.array_equal(written.dof_armature, left.untimed.dof_armature)
    assert np.array_equal(written.dof_solimp, left.untimed.dof_solimp)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.slow
def test_sprung_drives_that_are_too_fast_for_rk4_are_slowed_where_it_is_asked_for(drive, tmp_path):
    left = driven(drive, "RK4", 1.0, retime=True)
    timed = with_joints(left, tmp_path, 1.0)
    growth = [np.abs(np.linalg.eigvals(stepped.stepped(m)[0])).max() for m in (left.model, timed)]
    assert growth[0] > 1.1
    assert growth[1] < 1.0 + 1e-5  # rigid motions are a double eigenvalue 1
    slow = with_joints(driven(drive, "RK4", 0.01, retime=True), tmp_path, 0.01)
    assert slow.joint("drive").armature[0] == 0.01


@pytest.mark.slow
def test_the_command_times_joints_and_takes_it_out_again(tmp_path):
    text = SPRUNG.format(step=0.01, integrator="Euler", drive=DRIVES["sprung"][0], more="")
    craft = tmp_path / "craft.xml"
    craft.write_text(text)
    (tmp_path / "boom.toml").write_text(BOOM)
    plain, out = tmp_path / "plain.xml", tmp_path / "out.xml"
    at = f"mount={tmp_path / 'boom.toml'}"
    # its modes reach beyond what 0.01 s can represent
    assert call("embed", craft, "--mount", at, "--retime", "-o", plain).status == 3
    words = ("retime", plain, "--timestep", "0.01", "--retime-joints", "-o", out)
    assert call(*words).status == 0
    timed = mujoco.MjModel.from_xml_path(str(out)).joint("drive").armature[0]
    again = tmp_path / "again.xml"
    words = ("retime", out, "--timestep", "0.004", "--retime-joints", "-o", again)
    assert call(*words).status == 0
    assert mujoco.MjModel.from_xml_path(str(again)).joint("drive").armature[0] != timed
    back = tmp_path / "back.xml"
    assert call("embed", again, "--remove", "-o", back).status == 0
    assert back.read_text().replace('timestep="0.004"', 'timestep="0.01"') == text
    assert call("retime", again, "--timestep", "0", "-o", again, "--force").status == 0
    assert mujoco.MjModel.from_xml_path(str(again)).joint("drive").armature[0] == 0.01
    assert call("embed", again, "--remove", "-o", again, "--force").status == 0
    assert again.read_text().replace('timestep="0.004"', 'timestep="0.01"') == text


@pytest.mark.slow
def test_the_largest_step_that_keeps_the_tolerance_is_named(tmp_path):
    """At the step named it is kept, at a third longer it is not."""
    flexible = embedded(tmp_path, ONE, 0.04)
    named = flexible.cure.setting.timestep
    assert flexible.met is False
    kept = embedded(tmp_path, ONE, named)
    assert kept.met
    assert not embedded(tmp_path, ONE, 1.3 * named).met
    assert flexible.as_dict()["cure"]["timestep"] == named
    assert kept.as_dict()["cure"] is None


@pytest.mark.parametrize("latched_first", [True, False])
@pytest.mark.slow
def test_timing_and_latching_of_a_joint_do_not_meet(latched_first):
    """Whichever comes first, the joint ends as it began."""
    model = driven("sprung", "Euler", 0.004, retime=False).model
    before = model.dof_armature.copy()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    if not latched_first:
        bc.retime(model, 0.004, joints=True)
    assert bc.latch(model, data, "drive", stiffness=2000.0, armature=0.025) is not None
    if latched_first:
        bc.retime(model, 0.004, joints=True)
    assert model.joint("drive").armature[0] == 0.025
    for undo in (lambda: bc.retime(model, 0.0), lambda: bc.unlatch(model, data, "drive")):
        undo()
    assert np.array_equal(model.dof_armature, before)


@pytest.mark.slow
def test_discrete_leaves_an_arm_alone(tmp_path):
    if "discrete" not in INTEGRATORS:
        pytest.skip("this MuJoCo has no `discrete` integrator")
    model = embedded(tmp_path, ONE, 0.01, retime=False).model
    plain = copy.copy(model)
    bc.retime(model, 0.01, "discrete", joints=True)
    for name in ("tendon_stiffness", "tendon_damping", "tendon_armature", "dof_armature"):
        np.testing.assert_allclose(getattr(model, name), getattr(plain, name), rtol=1e-12)


@pytest.mark.slow
def test_the_error_in_continuous_time_does_not_depend_on_the_timing(tmp_path):
    """Of modes with less damping than errors are compared at, which their mass alone tells."""
    light = Arm((ONE.links[0],), hand=20.0, hand_inertia=(0.5, 0.5, 0.5), ratio=1e-4)
    plain, timed = (embedded(tmp_path, light, 0.05, retime=retime) for retime in (False, True))
    assert timed.sampled_error != plain.sampled_error
    assert timed.promise.poses == plain.promise.poses
