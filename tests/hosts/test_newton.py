"""Newton with files that embed wrote, given as MJCF and as USD.

The files come from write_usd.py, in an environment of its own (run.py makes both). What Newton runs
is read back from its MuJoCo model and from its motion; plain MuJoCo with the file that embed wrote
is the truth. Isaac Lab steps Newton's solvers; it is not run here.
"""

import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.optimize import least_squares

from spacecraft import frequencies

pytestmark = [pytest.mark.host, pytest.mark.filterwarnings("ignore")]  # Warp warns of its future
wp = pytest.importorskip("warp", reason="Newton is not installed: pip install 'beamchain[newton]'")
newton = pytest.importorskip(
    "newton", reason="Newton is not installed: pip install 'beamchain[newton]'"
)
FILES = Path("build/hosts/newton_files")
if not FILES.is_dir():
    pytest.skip("its files are not there: tests/hosts/run.py newton", allow_module_level=True)

KEPT = 1e-7  # Newton holds a model in float32: 6e-8 of every number
FREQUENCY = 1e-6  # which the differences of a few of them make larger
TINY = 2e-8  # what bodies of a billionth of a link's inertia do to a frequency
# Newton holds the state in float32 between steps, and MuJoCo Warp steps in float32
MOTION = 1e-4  # of the largest motion of a kind: displacement, attitude, angles of hinges
# fillers with armatures of 6e4 beside 1e-5 cost MuJoCo Warp digits, without Newton as well (2.9e-4)
WIDE = 6e-4
RUNG = 1e-6  # the frequency of the array's first mode, from 60 s of float32 hinge angles
SECONDS = 20.0

CASES = ["array", "untimed", "mast", "drive", "boom", "planar"]
FORMS = ["MJCF", "USD"]
cases = pytest.mark.parametrize("case", CASES)
forms = pytest.mark.parametrize("form", FORMS)


def compiled(case: str) -> mujoco.MjModel:
    """The file as embed wrote it."""
    return mujoco.MjModel.from_xml_path(str(FILES / f"{case}.xml"))


def builder_of(path: Path, gravity=(0.0, 0.0, 0.0), **options):
    """Newton's builder with the file's spacecraft in it."""
    builder = newton.ModelBuilder(gravity=gravity)
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    # principal moments below these are raised by 1e-6 kg m^2, those of light and thin links too
    builder.inertia_relative_tolerance, builder.inertia_absolute_tolerance = 0.0, 1e-20
    read = builder.add_usd if path.suffix == ".usdc" else builder.add_mjcf
    read(str(path), **options)
    return builder


def imported(path: Path, cpu: bool = True, **options):
    """Newton's model and its MuJoCo solver."""
    builder = builder_of(path, **options)
    with wp.ScopedDevice("cpu"):
        model = builder.finalize()
        return model, newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=cpu)


def file_of(case: str, form: str) -> Path:
    return FILES / (f"{case}.usdc" if form == "USD" else f"{case}_newton.xml")


def kicked(model: mujoco.MjModel) -> np.ndarray:
    """Initial velocity that moves the hub and shakes every mode [m/s, rad/s]."""
    free = model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    hub = [0.01, -0.02, 0.015, 0.02, 0.03, -0.01] if free else [0.01, -0.02, 0.05]
    return np.concatenate([hub, np.full(model.nv - len(hub), 0.02)])


def in_mujoco(model: mujoco.MjModel, velocity: np.ndarray, seconds: float) -> np.ndarray:
    data = mujoco.MjData(model)
    data.qvel[:] = velocity
    path = [data.qpos.copy()]
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        path.append(data.qpos.copy())
    return np.array(path)


def in_newton(path: Path, step: float, velocity: np.ndarray, seconds: float, cpu: bool):
    """The joints' coordinates in MuJoCo's order.

    A free joint's rate is that of its centre of mass, here the body's origin, in world axes, which
    the kicked bodies' are; its quaternion ends in the scalar.
    """
    model, solver = imported(path, cpu)
    with wp.ScopedDevice("cpu"):
        now, then, control = model.state(), model.state(), model.control()
        now.joint_qd.assign(velocity)
        out = [now.joint_q.numpy().copy()]
        for _ in range(round(seconds / step)):
            solver.step(now, then, control, None, step)
            now, then = then, now
            out.append(now.joint_q.numpy().copy())
    motion = np.array(out, dtype=np.float64)
    if motion.shape[1] > velocity.size:  # a free hub
        motion[:, 3:7] = motion[:, [6, 3, 4, 5]]
    return motion


def difference(motion: np.ndarray, reference: np.ndarray, model: mujoco.MjModel) -> float:
    """Largest difference, relative to the largest motion of that kind."""
    hub = 7 if model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE else 3
    attitude = slice(3, 7) if hub == 7 else slice(2, 3)
    kinds = [slice(0, attitude.start), attitude, slice(hub, None)]
    apart, moved = np.abs(motion - reference), np.abs(reference - reference[0])
    return max(float(apart[:, kind].max() / moved[:, kind].max()) for kind in kinds)


# -- the model -------------------------------------------------------------------------------------
@cases
@forms
def test_frequencies(case, form):
    _, solver = imported(file_of(case, form))
    expected = frequencies(compiled(case))
    found = frequencies(solver.mj_model)
    worst = float(np.abs(found / expected - 1.0).max())
    print(f"{case} as {form}: {found.size} coupled modes within {worst:.1e}")  # noqa: T201
    assert worst < FREQUENCY


@cases
@forms
def test_springs_dampers_and_armatures_are_kept(case, form):
    _, solver = imported(file_of(case, form))
    ours, theirs = compiled(case), solver.mj_model
    assert theirs.ntendon == ours.ntendon
    for name in (
        "tendon_stiffness",
        "tendon_damping",
        "tendon_armature",
        "wrap_prm",
        "dof_damping",
        "dof_armature",
    ):
        np.testing.assert_allclose(
            getattr(theirs, name), getattr(ours, name), rtol=KEPT, err_msg=name
        )
    np.testing.assert_allclose(theirs.jnt_stiffness, ours.jnt_stiffness, rtol=KEPT)


@cases
def test_one_hinge_per_body_is_the_same_mechanism(case):
    """The function of docs/howto/simulators.md, in plain MuJoCo."""
    parted = mujoco.MjModel.from_xml_path(str(FILES / f"{case}_newton.xml"))
    shift = frequencies(parted) / frequencies(compiled(case)) - 1.0
    assert np.abs(shift).max() < TINY
    assert (parted.nbody > compiled(case).nbody) == (case in ("mast", "drive"))


# -- motion ----------------------------------------------------------------------------------------
@cases
@forms
def test_free_motion_with_mujoco(case, form):
    assert apart(case, form, cpu=True) < MOTION


@pytest.mark.parametrize(
    ("case", "form", "bound"),
    [("array", "USD", MOTION), ("mast", "MJCF", MOTION), ("drive", "MJCF", WIDE)],
)
def test_free_motion_with_mujoco_warp(case, form, bound):
    assert apart(case, form, cpu=False) < bound


def apart(case: str, form: str, cpu: bool) -> float:
    """How far the free motion in Newton is from that in plain MuJoCo."""
    model = compiled(case)
    velocity = kicked(model)
    reference = in_mujoco(model, velocity, SECONDS)
    found = in_newton(file_of(case, form), model.opt.timestep, velocity, SECONDS, cpu)
    worst = difference(found, reference, model)
    by = "MuJoCo" if cpu else "MuJoCo Warp"
    print(f"{case} as {form}, stepped by {by}, {SECONDS:g} s: {worst:.1e}")  # noqa: T201
    return worst


def rung(times: np.ndarray, angle: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """Frequencies [rad/s] of decaying oscillations fitted to a hinge's angle, undamped."""

    def columns(poles: np.ndarray) -> np.ndarray:
        decay, turn = np.exp(np.outer(times, -poles[::2])), np.outer(times, poles[1::2])
        ones = np.ones((times.size, 1))
        return np.hstack([decay * np.cos(turn), decay * np.sin(turn), ones])

    def residual(poles: np.ndarray) -> np.ndarray:
        basis = columns(poles)
        return (angle - basis @ np.linalg.lstsq(basis, angle, rcond=None)[0]) / np.abs(angle).max()

    start = np.column_stack([0.005 * guess, guess]).ravel()
    done = least_squares(residual, start, x_scale=np.abs(start), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return np.hypot(done.x[::2], done.x[1::2])


@forms
def test_the_modes_ring_at_their_frequencies(form):
    """A file timed for its step rings in Newton as the model without time steps does."""
    model = compiled("array")
    expected = frequencies(compiled("untimed"))
    velocity = np.concatenate([np.zeros(6), [1e-3, 1e-3]])  # [rad/s]; the motion stays small
    motion = in_newton(file_of("array", form), model.opt.timestep, velocity, 60.0, cpu=True)
    times = model.opt.timestep * np.arange(len(motion))
    found = rung(times, motion[:, 7], expected)
    print(f"array as {form}: first modes from 60 s, {np.abs(found / expected - 1.0)}")  # noqa: T201
    assert np.abs(found / expected - 1.0)[0] < RUNG


def test_modal_amplitudes_are_lengths_of_tendons():
    """Of the state before a step, as in MuJoCo; for a spacecraft whose sensors are not read."""
    model = compiled("drive")
    data = mujoco.MjData(model)
    data.qpos[7:] = np.linspace(0.01, 0.02, model.nq - 7)
    mujoco.mj_forward(model, data)
    held, solver = imported(file_of("drive", "USD"))
    with wp.ScopedDevice("cpu"):
        now, then = held.state(), held.state()
        coordinates = now.joint_q.numpy()
        coordinates[7:] = data.qpos[7:]
        now.joint_q.assign(coordinates)
        solver.step(now, then, held.control(), None, model.opt.timestep)
    np.testing.assert_allclose(solver.mj_data.ten_length, data.ten_length, rtol=1e-5)
    assert (model.nsensor > 0, solver.mj_model.nsensor) == (True, 0)


# -- as Isaac Lab reads a stage --------------------------------------------------------------------
def as_isaac_lab(case: str) -> dict[str, object]:
    """Arguments of add_usd: the prim of the spacecraft alone, without the schemas of MuJoCo."""
    root = {"drive": "/drive", "planar": "/planar"}.get(case, "/craft")
    schemas = [newton.usd.SchemaResolverNewton(), newton.usd.SchemaResolverPhysx()]
    return {"root_path": root, "schema_resolvers": schemas, "skip_mesh_approximation": True}


@cases
def test_frequencies_as_isaac_lab_reads_usd(case):
    _, solver = imported(file_of(case, "USD"), **as_isaac_lab(case))
    expected = frequencies(compiled(case))
    worst = float(np.abs(frequencies(solver.mj_model) / expected - 1.0).max())
    print(f"{case} as Isaac Lab reads USD: {worst:.1e}")  # noqa: T201
    assert worst < FREQUENCY
    # the scene's options are not read
    assert solver.mj_model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST


def test_worlds_of_one_spacecraft():
    """Three copies, each kicked by another factor, in MuJoCo Warp."""
    model, factors, seconds = compiled("array"), np.array([1.0, -0.5, 0.25]), 5.0
    one = builder_of(file_of("array", "USD"), **as_isaac_lab("array"))
    many = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    many.replicate(one, len(factors))
    with wp.ScopedDevice("cpu"):
        made = many.finalize()
        solver = newton.solvers.SolverMuJoCo(made)
        now, then, control = made.state(), made.state(), made.control()
        now.joint_qd.assign(np.outer(factors, kicked(model)).ravel())
        for _ in range(round(seconds / model.opt.timestep)):
            solver.step(now, then, control, None, model.opt.timestep)
            now, then = then, now
        found = now.joint_q.numpy().reshape(len(factors), -1)[:, 7:]
    for factor, angles in zip(factors, found, strict=True):
        reference = in_mujoco(model, factor * kicked(model), seconds)[:, 7:]
        assert np.abs(angles - reference[-1]).max() < MOTION * np.abs(reference).max()


# -- what docs/howto/simulators.md warns of: fails when Newton or the converter changes ------------
@pytest.mark.parametrize("file", ["mast.xml", "mast_as_written.usdc"])
def test_tendons_at_several_hinges_of_a_body_are_dropped(file):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        _, solver = imported(FILES / file)
    assert (solver.mj_model.ntendon, compiled("mast").ntendon > 0) == (0, True)
    assert any("invalid D6 joint" in str(one.message) for one in said)


@forms
@pytest.mark.parametrize(("case", "least"), [("array", 1.70e-3), ("mast", 4.73e-3)])
def test_collapsed_fixed_joints_change_the_frequencies(case, least, form):
    _, solver = imported(file_of(case, form), collapse_fixed_joints=True)
    wrong = frequencies(solver.mj_model) / frequencies(compiled(case)) - 1.0
    print(f"{case} as {form}, collapse_fixed_joints=True: {wrong}")  # noqa: T201
    assert wrong[0] == pytest.approx(least, rel=0.02)


def test_gravity_of_an_mjcf_file_is_not_read():
    for form, expected in (("MJCF", -9.81), ("USD", 0.0)):
        _, solver = imported(file_of("array", form), gravity=(0.0, 0.0, -9.81))
        assert solver.mj_model.opt.gravity[2] == pytest.approx(expected, rel=1e-6)


def sampled(model: mujoco.MjModel) -> np.ndarray:
    """Frequencies [rad/s] of the discrete system that MuJoCo's steps are."""
    step = np.zeros((2 * model.nv, 2 * model.nv))
    data = mujoco.MjData(model)
    mujoco.mjd_transitionFD(model, data, 1e-6, True, step, None, None, None)
    poles = np.log(np.linalg.eigvals(step).astype(complex)) / model.opt.timestep
    return np.sort(np.abs(poles[poles.imag > 1.0]))


def test_another_step_or_integrator_than_the_file_is_timed_for():
    """What the rows on step and integrator in docs/howto/simulators.md cost, in plain MuJoCo."""
    expected = frequencies(compiled("untimed"))
    model = compiled("array")
    assert sampled(model) == pytest.approx(expected, rel=1e-6)
    model.opt.timestep = 1.0 / 60.0
    assert sampled(model) / expected - 1.0 == pytest.approx([-5.6e-4, -1.38e-2], rel=0.03)
    model = compiled("euler")
    assert sampled(model) == pytest.approx(expected, rel=1e-6)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert sampled(model) / expected - 1.0 == pytest.approx([-1.23e-3, -3.45e-3], rel=0.03)


def test_the_step_of_the_file_is_not_read():
    for form in FORMS:
        _, solver = imported(file_of("array", form))
        assert solver.mj_model.opt.timestep == 0.002  # MuJoCo's own


def test_euler_becomes_implicitfast_through_usd():
    kinds = mujoco.mjtIntegrator
    expected = {"MJCF": kinds.mjINT_EULER, "USD": kinds.mjINT_IMPLICITFAST}
    for form in FORMS:
        _, solver = imported(file_of("euler", form))
        assert solver.mj_model.opt.integrator == expected[form]
