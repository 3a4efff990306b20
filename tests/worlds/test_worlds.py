"""Many worlds against MuJoCo one by one, their draws and checkpoints.

SAME: MuJoCo's batch computes what a loop computes; what may differ is rounding in the numbers of
the tendons. DRAWN: numbers of tendons that are computed for all worlds at once, against
`bc.retime` of each.
"""

import copy
import gc
import pickle
import re
import sys
import tracemalloc

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain import worlds
from examples import EXAMPLES
from many_worlds import CRAFT, UNFOLDS, flexible

SAME = 1e-9
DRAWN = 1e-12
RANGES = {"frequency": 0.1, "damping": 0.5}


@pytest.fixture(scope="module")
def craft() -> bc.Embedded:
    return flexible(retime=True)


class Alone:
    """Plain MuJoCo, one world: positions and rates after every step of an input `(t, nu)`,
    and the data at the end."""

    def __init__(self, model: mujoco.MjModel, given: np.ndarray, half: bool = True) -> None:
        self.data, before = mujoco.MjData(model), np.zeros(model.nu)
        self.qpos, self.qvel = np.zeros((len(given), model.nq)), np.zeros((len(given), model.nv))
        for k, now in enumerate(given):
            self.data.ctrl[:] = (now + before) / 2.0 if half else now
            mujoco.mj_step(model, self.data)
            before = now
            self.qpos[k], self.qvel[k] = self.data.qpos, self.data.qvel
        mujoco.mj_forward(model, self.data)


def retimed(plain: mujoco.MjModel, world: mujoco.MjModel, step: float) -> mujoco.MjModel:
    """The model of a world made anew: the plain one with its frequencies and damping,
    through `bc.retime`."""
    out = copy.copy(plain)
    bc.retime(out, 0.0)
    modal = [i for i in range(out.ntendon) if out.tendon_stiffness[i] > 0.0]
    out.tendon_stiffness[modal] = world.tendon_stiffness[modal]
    out.tendon_damping[modal] = world.tendon_solimp_lim[modal, 3]
    bc.retime(out, step)
    return out


# -- the same as MuJoCo ----------------------------------------------------------------------------
def test_randomised_worlds_are_those_of_mujoco(craft):
    count = 4
    many = worlds.make(craft, RANGES, count=count, seed=3)
    given = 0.5 * np.random.default_rng(1).normal(size=(20, count, 3))
    seen = [many.step(now) for now in given]
    for i in range(count):
        model = retimed(craft.model, many.model_of(i), 0.25)
        for name in ("tendon_armature", "tendon_damping"):
            np.testing.assert_allclose(
                getattr(model, name), getattr(many.model_of(i), name), rtol=DRAWN, atol=1e-15
            )
        one = Alone(model, given[:, i])
        peak = np.abs(one.qpos).max()
        np.testing.assert_allclose(many.qpos[i], one.qpos[-1], atol=SAME * peak)
        for name, theirs in (
            ("attitude", one.qpos[:, 3:7]),
            ("rate", one.qvel[:, 3:6]),  # the mean rate over the step
            ("wheels", one.qvel[:, 6:7]),
        ):
            ours = np.array([s[name][i] for s in seen])
            np.testing.assert_allclose(ours, theirs, atol=SAME * np.abs(theirs).max(), err_msg=name)
        last = one.data
        np.testing.assert_allclose(seen[-1]["modes"][i], last.ten_length, atol=SAME)
        np.testing.assert_allclose(seen[-1]["gyro"][i], last.sensor("gyro").data, atol=SAME)
        np.testing.assert_allclose(
            seen[-1]["place"][i], last.sensor("place").data, atol=SAME * peak
        )


@pytest.mark.parametrize(("integrator", "step"), [("EULER", 0.02), ("IMPLICITFAST", 1.0)])
def test_draws_at_once_are_those_of_retime(craft, integrator, step):
    model = copy.copy(craft.model)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    many = worlds.make(model, RANGES, count=3, timestep=step)
    for i in range(3):
        one = many.model_of(i)
        theirs = retimed(one, one, step)
        for name in ("tendon_armature", "tendon_damping"):
            np.testing.assert_allclose(
                getattr(one, name), getattr(theirs, name), rtol=DRAWN, atol=1e-15
            )


def test_an_input_over_several_steps_is_halved_once(craft):
    many = worlds.make(craft, count=2, observe="rate")
    given = np.repeat([[1.0, 0.5, 0.0], [-2.0, 0.0, 0.0]], 4, axis=0)
    many.step(given[0], nstep=4)
    seen = many.step(given[4], nstep=4)["rate"]
    one = Alone(craft.model, given)
    turn = np.zeros(3)
    np.testing.assert_allclose(many.qpos[1], one.qpos[-1], atol=1e-15)
    mujoco.mju_subQuat(turn, one.qpos[-1, 3:7], one.qpos[3, 3:7])
    np.testing.assert_allclose(seen[0], turn / 1.0, atol=1e-12)  # 4 steps of 0.25 s


def test_a_command_beyond_its_range_is_its_end():
    model = copy.copy(flexible(retime=True).model)
    model.actuator_ctrllimited[:2] = 1  # the third has no range
    model.actuator_ctrlrange[:2] = 0.4
    model.actuator_ctrlrange[:2, 0] *= -1.0
    wide = model.actuator_ctrlrange * [[[1.0]], [[1.0]], [[2.0]]]
    many = worlds.make(model, {"actuator_ctrlrange": wide})
    on = np.where(np.arange(12) % 6 < 3, 1.0, 0.0)[:, None] * [0.4, -0.4, 0.1]
    far = on * [100.0, 100.0, 1.0]
    held = bc.HeldInput(model=model)
    data = mujoco.MjData(model)
    for low, high in zip(on, far, strict=True):
        many.step([low, high, high])
        data.ctrl[:] = held(high)
        mujoco.mj_step(model, data)
    truth = Alone(model, on).qpos[-1]  # within the range, where nothing is cut
    for i in range(2):
        np.testing.assert_allclose(many.qpos[i], truth, rtol=0.0, atol=1e-14)
    np.testing.assert_array_equal(data.qpos, truth)
    assert np.abs(many.qpos[2] - truth).max() > 1e-6  # a world of another range
    with pytest.raises(bc.InputError, match="3 actuators"):
        held([1.0, 2.0])
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    assert bc.HeldInput(model=model)([40.0, 0.0, 0.0])[0] == 20.0  # nothing is cut there


def test_a_sensor_does_not_take_the_name_of_what_is_observed(craft):
    text = craft.to_mjcf().replace('name="gyro"', 'name="rate"')
    same = mujoco.MjModel.from_xml_string(text.replace('name="place"', 'name="modes"'))
    seen, other = (
        worlds.make(one, count=1).step([1.0, 0.5, 0.0], nstep=4) for one in (craft, same)
    )
    for name in ("rate", "modes"):
        np.testing.assert_allclose(other[name], seen[name], atol=1e-12)


def test_a_model_that_is_not_exact_in_time_is_given_its_input_as_it_is(craft):
    many = worlds.make(craft.untimed, count=1)
    given = np.ones((8, 3))
    for now in given:
        many.step(now)
    np.testing.assert_allclose(
        many.qpos[0], Alone(craft.untimed, given, half=False).qpos[-1], atol=1e-15
    )
    assert np.all(worlds.make(craft.untimed, RANGES, count=2).fields["tendon_armature"] == 0.0)


def test_sensors_are_of_the_state_that_is_seen(craft):
    many = worlds.make(craft, count=2, observe=("gyro", "place"))
    start = np.zeros(craft.model.nv)
    start[:6] = [0.1, 0.2, -0.1, 0.3, -0.2, 0.1]
    data = mujoco.MjData(craft.model)

    def agree(seen):
        mujoco.mj_forward(craft.model, data)
        for name in ("gyro", "place"):
            np.testing.assert_allclose(seen[name][1], data.sensor(name).data, atol=1e-12)

    data.qvel[:] = start
    agree(many.reset(qvel=start))
    for _ in range(3):
        mujoco.mj_step(craft.model, data)
    agree(many.step(np.zeros(3), nstep=3))
    kept = many.state()
    many.step([1.0, 0.0, 0.0])
    agree(many.restore(kept))


@pytest.mark.parametrize(
    "files",
    [
        {
            "memory.max": "4000000000",
            "memory.current": "3900000000",
            "memory.stat": "inactive_file 50000000",
        },
        {
            "memory/memory.limit_in_bytes": "4000000000",
            "memory/memory.usage_in_bytes": "3900000000",
            "memory/memory.stat": "cache 7\ntotal_inactive_file 50000000",
        },
    ],
    ids=["version 2", "version 1"],
)
def test_memory_that_a_container_uses_already_is_not_free(files, craft, tmp_path, monkeypatch):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text + "\n")
    monkeypatch.setattr("beamchain.worlds.hosts.CGROUP", tmp_path)
    with pytest.raises(bc.InputError, match="150 MB"):
        worlds.make(craft, count=10_000_000)


# -- variants --------------------------------------------------------------------------------------
def test_fields_of_a_sweep(craft):
    made = copy.copy(craft.untimed)
    made.opt.timestep = 0.02
    rng = np.random.default_rng(0)
    fields = {
        name: getattr(made, name) * rng.uniform(0.9, 1.1, (3, 1))
        for name in ("tendon_stiffness", "wrap_prm")
    }
    fields["body_mass"] = made.body_mass * rng.uniform(0.9, 1.1, (3, made.nbody))
    many = worlds.make(made, fields, count=5)
    many.reset(qvel=np.full(made.nv, 0.01))
    for _ in range(20):
        seen = many.step(np.zeros(made.nu))
    for i in range(5):
        one = copy.copy(made)
        for name, values in fields.items():
            getattr(one, name)[:] = values[i % 3]
        data = mujoco.MjData(one)
        mujoco.mj_setConst(one, data)
        data.qvel[:] = 0.01
        for _ in range(20):
            mujoco.mj_step(one, data)
        np.testing.assert_allclose(many.qpos[i], data.qpos, atol=1e-12)
        mujoco.mj_forward(one, data)
        np.testing.assert_allclose(seen["modes"][i], data.ten_length, atol=1e-12)


def test_variants_are_made_exact_each_for_itself(craft):
    model = craft.model
    factor = np.array([1.0, 0.9, 1.1])[:, None]
    drag = np.array([1.0, 2.0, 1.0])[:, None]
    # of the hub, the links keep theirs
    bus = np.where(np.arange(model.nbody) == 1, [[1.0], [0.2], [1.0]], 1.0)
    plain = copy.copy(model)
    bc.retime(plain, 0.0)
    fields = {
        "body_mass": model.body_mass * bus,
        "body_inertia": model.body_inertia * bus[:, :, None],
        "tendon_stiffness": plain.tendon_stiffness * factor,
        "tendon_damping": plain.tendon_damping * drag,
    }
    many = worlds.make(model, fields)
    again = worlds.make(model, many.fields)  # exact already: taken as they are
    for i in range(3):
        one = copy.copy(plain)
        for name, values in fields.items():
            getattr(one, name)[:] = values[i]
        bc.retime(one, 0.25)
        for name in ("tendon_armature", "tendon_damping", "tendon_solimp_lim"):
            np.testing.assert_allclose(
                getattr(many.model_of(i), name), getattr(one, name), rtol=1e-9, atol=1e-12
            )
            np.testing.assert_array_equal(
                getattr(again.model_of(i), name), getattr(many.model_of(i), name)
            )
    with pytest.raises(bc.InputError, match="is not 1"):
        worlds.make(
            model,
            {
                "body_mass": model.body_mass * factor,
                "body_inertia": model.body_inertia * factor[:, :, None],
            },
        )


@pytest.mark.parametrize(
    "modes",
    ["", "[appendage.other_]\nfrequency = { relative = 0.05 }\n"],
    ids=["bodies", "modes too"],
)
def test_a_sweep_of_bodies_on_a_craft_that_is_exact_in_time(craft, modes, tmp_path):
    file = craft.write(tmp_path / "flexible.xml")[-1]
    uncertain = tmp_path / "uncertain.toml"
    text = "[body.bus]\nmass = { relative = 0.2 }\ninertia_zz = { relative = 0.1 }\n"
    uncertain.write_text(text + modes, encoding="utf-8")
    swept = bc.sweep(file, 4, uncertain=uncertain)
    many = worlds.make(file, swept, count=6)
    assert list(many.drawn["row"]) == [0, 1, 2, 3, 0, 1]
    mass = many.fields["body_mass"][:, craft.model.body("bus").id]
    np.testing.assert_allclose(many.drawn["bus.mass"], mass)
    model = mujoco.MjModel.from_xml_path(str(file))
    given = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 3))
    for ctrl in given:
        many.step(ctrl)
    for i in range(6):
        one = copy.copy(model)
        for name, values in swept.fields.items():
            getattr(one, name)[:] = values[i % 4]
        mujoco.mj_setConst(one, mujoco.MjData(one))
        np.testing.assert_allclose(many.qpos[i], Alone(one, given).qpos[-1], atol=SAME)
    assert np.ptp(many.qpos[:4, 6]) > 1e-6
    many.retime(0.1)  # each for its own mass
    one = many.model_of(1)
    bc.retime(one, 0.0)
    bc.retime(one, 0.1)
    np.testing.assert_allclose(
        many.model_of(1).tendon_armature, one.tendon_armature, rtol=1e-9, atol=DRAWN
    )


def test_seeds_and_resets(craft):
    first, second = (worlds.make(craft, RANGES, count=8, seed=5) for _ in range(2))
    for name, values in first.fields.items():
        np.testing.assert_array_equal(values, second.fields[name])
    before = first.fields["tendon_stiffness"].copy()
    kept = first.step([1.0, 0.0, 0.0])["attitude"]
    copied = kept.copy()
    first.reset([2, 5], draw=True)
    np.testing.assert_array_equal(kept, copied)  # what was observed stays as it was
    changed = np.flatnonzero(np.any(first.fields["tendon_stiffness"] != before, axis=1))
    assert list(changed) == [2, 5]
    assert np.all(first.qpos[[2, 5]] == craft.model.qpos0)
    assert np.all(first.qpos[0] != craft.model.qpos0, axis=0).any()
    second.step([1.0, 0.0, 0.0])
    second.reset(np.isin(np.arange(8), [2, 5]), draw=True)
    np.testing.assert_array_equal(
        first.step([0.0, 1.0, 0.0])["rate"], second.step([0.0, 1.0, 0.0])["rate"]
    )
    width = np.sqrt(first.fields["tendon_stiffness"]) / np.sqrt(craft.model.tendon_stiffness) - 1.0
    assert 0.01 < np.abs(width).max() <= RANGES["frequency"] + 1e-12


def test_a_seed_moves_bit_for_bit_whatever_threads_and_count(craft):
    """Of more worlds than one thread takes by itself."""
    inputs = np.random.default_rng(0).normal(size=(10, 48, 3))

    def flown(count, threads):
        many = worlds.make(craft, RANGES, count=count, threads=threads, seed=5)
        for now in inputs:
            many.step(now[:count])
        return np.hstack([many.qpos, many.qvel])[:36]

    kept = flown(36, 1)
    assert len(np.unique(kept, axis=0)) == 36
    for count, threads in ((36, 0), (36, 3), (48, 2)):
        np.testing.assert_array_equal(flown(count, threads), kept)


def test_checkpoint_and_retime(craft):
    many = worlds.make(craft, RANGES, count=4)
    many.step([1.0, 2.0, 0.1])
    kept = many.state()
    first = [many.step([0.0, 1.0, 0.0], 2), many.reset([1], draw=True), many.step([0.3, 0.0, 0.0])][
        -1
    ]
    many.restore(kept)
    again = [many.step([0.0, 1.0, 0.0], 2), many.reset([1], draw=True), many.step([0.3, 0.0, 0.0])][
        -1
    ]
    for name, values in first.items():
        np.testing.assert_array_equal(values, again[name])
    before = many.fields["tendon_stiffness"].copy()
    many.retime(0.1)
    np.testing.assert_array_equal(many.fields["tendon_stiffness"], before)  # the same worlds
    theirs = retimed(craft.model, many.model_of(3), 0.1)
    np.testing.assert_allclose(
        many.model_of(3).tendon_armature, theirs.tendon_armature, rtol=DRAWN, atol=1e-15
    )
    with pytest.raises(bc.InputError, match="checkpoint"):
        many.restore(kept)


# -- divergence, memory ----------------------------------------------------------------------------
@pytest.mark.parametrize("nstep", [1, 3])
def test_a_world_that_diverges_is_reported_and_started_again(craft, nstep):
    many, other = (worlds.make(craft, RANGES, count=6) for _ in range(2))
    many.reset([4], qvel=np.full(craft.model.nv, 1e20))
    ours = many.step([1.0, 0.0, 0.0], nstep)
    theirs = other.step([1.0, 0.0, 0.0], nstep)
    assert list(many.diverged) == [4]
    assert list(many.restarts) == [0, 0, 0, 0, 1, 0]
    assert np.all(many.qpos[4] == craft.model.qpos0)
    for name, values in ours.items():
        rest = [0, 1, 2, 3, 5]
        np.testing.assert_array_equal(values[rest], theirs[name][rest])
    many.step([1.0, 0.0, 0.0])
    assert many.diverged.size == 0
    assert np.all(np.isfinite(many.qpos))


@pytest.mark.slow
def test_resets_leak_nothing(craft):
    many = worlds.make(craft, RANGES, count=4)
    for _ in range(20):
        many.step(many.reset([0, 3], draw=True)["wheels"][0, 0] * np.ones(3))
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for k in range(300):
            many.reset([k % 4], draw=True)
        gc.collect()  # what only waits for the collector is no leak
        left = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert left < 30_000  # bytes: 100 per reset, where a world's own numbers are thousands


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the process's memory is read from /proc")
def test_full_resets_leave_the_process_as_large(craft):
    def resident() -> int:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * 4096

    many = worlds.make(craft, RANGES, count=64)
    for _ in range(50):
        many.reset(draw=True)
    before = resident()
    for _ in range(300):
        many.reset(draw=True)
    # 64 worlds hold 0.2 MB: a leak of one reset in forty would be 1.5 MB
    assert resident() - before < 1_500_000


def test_what_does_not_fit_in_memory_is_refused_with_its_size(craft):
    with pytest.raises(bc.InputError) as refused:
        worlds.make(craft, RANGES, count=10**12)
    assert "1000000000000 worlds need" in str(refused.value)
    form = r"\(([0-9.e+]+) kB each\), and ([0-9.e+]+) GB .* at most (\d+) fit"
    each, free, most = (float(text) for text in re.search(form, str(refused.value)).groups())
    assert most == pytest.approx(1e6 * free / each, rel=0.02)  # three digits are told


def test_a_state_is_pickled(craft):
    many = worlds.make(craft, count=2)
    kept = pickle.loads(pickle.dumps(many.state()))
    many.step([1.0, 0.0, 0.0])
    after = many.qpos
    many.restore(kept)
    many.step([1.0, 0.0, 0.0])
    np.testing.assert_array_equal(many.qpos, after)


# -- hinges that latch -----------------------------------------------------------------------------
DRIVES = {"jnt_stiffness": [[0.0, 2.0, 1.0], [0.0, 3.0, 1.0], [0.0, 2.0, 2.5]]}
HELD = {"stiffness": 300.0, "damping": 1.0, "armature": 0.01}


def unfolded(model, steps):
    """Plain MuJoCo, one world, with `bc.latch` before every step."""
    data, left, done = mujoco.MjData(model), ["one", "two"], {}
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for k in range(steps):
        data.ctrl[:] = np.sin(0.01 * (k - 1)) if k else 0.0  # of the step before
        mujoco.mj_forward(model, data)
        for name in list(left):
            energy = bc.latch(model, data, name, impact=name == "two", **HELD)
            if energy is not None:
                left.remove(name)
                done[name] = energy
        data.ctrl[:] = np.sin(0.01 * k)
        mujoco.mj_step(model, data)
    return data, done


@pytest.mark.slow
def test_hinges_latch_in_every_world_as_they_do_alone():
    model = mujoco.MjModel.from_xml_string(UNFOLDS.format("Euler"))
    many = worlds.make(model, DRIVES, observe=["attitude", "rate"])
    start = {"qpos": model.key(0).qpos, "qvel": model.key(0).qvel}
    many.reset(**start)
    done = [{} for _ in range(3)]
    for k in range(250):
        for name in ("one", "two"):
            energies = many.latch(name, impact=name == "two", **HELD)
            for world, energy in enumerate(energies):
                if energy is not None:
                    done[world][name] = energy
        many.step(np.full(1, np.sin(0.01 * k)))
    for world in range(3):
        plain = copy.copy(model)
        plain.jnt_stiffness[:] = DRIVES["jnt_stiffness"][world]
        data, alone = unfolded(plain, 250)
        assert set(done[world]) == set(alone) == {"one", "two"}
        for name, energy in alone.items():
            assert float(done[world][name]) == pytest.approx(float(energy), rel=SAME)
            assert done[world][name].time == pytest.approx(energy.time, rel=SAME)
        np.testing.assert_allclose(many.qpos[world], data.qpos, atol=SAME)
        np.testing.assert_allclose(many.qvel[world], data.qvel, atol=SAME)
        for name in ("jnt_stiffness", "jnt_limited", "dof_damping", "jnt_solimp"):
            np.testing.assert_array_equal(getattr(many.model_of(world), name), getattr(plain, name))
    assert many.latched("one").all()


def test_latches_are_part_of_a_checkpoint_and_end_with_a_reset():
    model = mujoco.MjModel.from_xml_string(UNFOLDS.format("RK4"))
    many = worlds.make(model, DRIVES, count=4, observe=["attitude"])
    many.reset(qpos=model.key(0).qpos)
    fresh = many.state()
    assert many.latch("two", [1, 2], angle=-3.0, **HELD)[1] is not None
    assert list(many.latched("two")) == [False, True, True, False]
    many.step([0.1], 3)
    kept = many.state()
    first = [many.step([0.2], 20), many.qpos][1]
    many.restore(fresh)
    assert not many.latched("two").any()
    many.restore(kept)
    many.step([0.2], 20)
    np.testing.assert_array_equal(many.qpos, first)
    assert list(many.latched("two")) == [False, True, True, False]
    brought = many.unlatch("two", [2])
    assert brought[0] > 0.0
    assert many.model_of(2).jnt_stiffness[2] == 2.5
    many.reset([1], draw=True)
    assert not many.latched("two").any()
    drawn = [list(row) for row in DRIVES["jnt_stiffness"]]
    assert list(many.model_of(1).jnt_stiffness) in drawn
    many.latch("two", [0], angle=-3.0, **HELD)
    many.retime(0.006)
    assert not many.latched("two").any()


# -- what worlds say of themselves -----------------------------------------------------------------
def test_drawn_factors_are_those_of_the_fields(craft):
    many = worlds.make(craft, RANGES, count=3, seed=4)
    own = [
        i for i in range(craft.model.ntendon) if craft.model.tendon_stiffness[i] > 0.0
    ]  # modes and fillers
    assert many.mode_names == tuple(craft.model.tendon(i).name for i in own)
    assert many.observe()["modes"].shape == (3, len(own))
    before = many.drawn["frequency"]
    for world in range(3):
        plain, nominal = copy.copy(many.model_of(world)), copy.copy(craft.model)
        for model in (plain, nominal):
            bc.retime(model, 0)
        frequency = np.sqrt(plain.tendon_stiffness[own] / nominal.tendon_stiffness[own])
        damping = plain.tendon_damping[own] / nominal.tendon_damping[own] / frequency
        np.testing.assert_allclose(before[world], frequency, rtol=DRAWN)
        np.testing.assert_allclose(many.drawn["damping"][world], damping, rtol=DRAWN)
    assert np.abs(before - 1.0).max() <= RANGES["frequency"]
    many.reset([1], draw=True)
    changed = np.any(many.drawn["frequency"] != before, axis=1)
    assert list(changed) == [False, True, False]


def test_rows_of_arrays_are_told_as_drawn(craft):
    arrays = worlds.make(craft, {"body_mass": np.stack([craft.model.body_mass] * 2)}, count=3)
    assert {name: list(rows) for name, rows in arrays.drawn.items()} == {"row": [0, 1, 0]}
    assert worlds.make(craft, count=2).drawn == {}


@pytest.mark.slow
def test_slowed_modes_and_liquids_without_weight_are_said(craft):
    def codes(many):
        return [warning.code for warning in many.warnings]

    assert codes(worlds.make(craft, count=1)) == []
    hopeless = worlds.make(craft, RANGES, count=1, timestep=100.0)
    assert codes(hopeless) == ["slowed-modes"]
    hopeless.retime(0.01)
    assert codes(hopeless) == []
    tank = bc.read_spec(EXAMPLES / "tank.toml")
    model = bc.embed(CRAFT.format(""), {"mount": tank}).model
    for gravity, said in ((0.0, ["slosh-weightless"]), (-1.0, [])):
        model.opt.gravity[2] = gravity
        assert codes(worlds.make(model, count=1)) == said
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    (said,) = worlds.make(model, count=1).warnings
    assert "tank: no gravity acts" in said


def test_fields_that_connect_a_model_may_be_its_own(craft):
    own = np.stack([craft.model.body_dofadr] * 2)
    worlds.make(craft, {"body_dofadr": own})  # the model's own


@pytest.fixture(scope="module")
def satellite() -> bc.Embedded:
    text = (
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>'
        '<inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/>'
        '<site name="mount" pos="0.6 0 0"/></body></worldbody></mujoco>'
    )
    return bc.embed(text, {"mount": bc.read_spec(EXAMPLES / "array.toml")}, retime=True)


@pytest.mark.parametrize(("rate", "lost"), [(0.26, 0.0315), (0.066, 0.0030)])
@pytest.mark.slow
def test_tumbling_costs_euler_its_angular_momentum(satellite, rate, lost):
    """What docs/products/worlds.md states of its first spacecraft; RK4 without timing loses
    nothing."""
    plain = copy.copy(satellite.untimed)
    plain.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    plain.opt.timestep = 0.1
    losses = []
    for many in (worlds.make(satellite, count=1, timestep=0.1), worlds.make(plain, count=1)):
        data = mujoco.MjData(many.model)
        momenta = []
        start = np.zeros(many.model.nv)
        start[3:6] = rate / np.sqrt(3.0)
        many.reset(qvel=start)
        for count in (0, 600):  # a minute
            if count:
                many.step([], nstep=count)
            data.qpos[:], data.qvel[:] = many.qpos[0], many.qvel[0]
            mujoco.mj_forward(many.model, data)
            mujoco.mj_subtreeVel(many.model, data)
            momenta.append(data.subtree_angmom[0].copy())
        change = np.linalg.norm(momenta[1] - momenta[0])
        losses.append(change / np.linalg.norm(momenta[0]))
    assert losses[0] == pytest.approx(lost, rel=0.02)
    assert losses[1] < 1e-7


def test_a_rigid_craft_shows_no_modes():
    model = mujoco.MjModel.from_xml_string(CRAFT.format(""))
    assert "modes" not in worlds.make(model, count=2).observe()
