"""Uncertain plants against MuJoCo models whose XML was written anew with other numbers,
and worst cases against samples.

`TRUTH`: the plant of a recompiled model and the LFT come from the same differences of five points,
each to rounding; lightly damped modes amplify that a hundredfold. Where the XML compiler refuses a
model (a participation above one is a negative armature), the truth is assembled here in numpy.
`PEAK`: of a peak in MuJoCo, whose dead times are Pade approximations.
"""

import re
from itertools import pairwise

import control
import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain import robust
from loops import scaled, written
from mechanics import mass_matrix, tendon_rows
from random_appendages import toml
from specs import spec_of

TRUTH, PEAK, RANK = 1e-8, 0.01, 1e-9
CRAFT = """<mujoco model="craft"><compiler angle="radian"/>
<option gravity="0 0 0" timestep="0.0005"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0.01 -0.02 0.03" mass="300" fullinertia="90 80 70 1 2 -3"/>
<site name="mount" pos="0.5 0 0"/>
<site name="left" pos="0 0.5 0" euler="0 0 1.5707963267948966"/>
<body name="rotor" pos="0 -0.5 0"><joint name="drive" axis="0 1 0" stiffness="60" damping="0.9"/>
<inertial pos="0 0 0" mass="5" diaginertia="0.3 0.2 0.3"/>
<site name="right" pos="0 -0.1 0" euler="0 0 -1.5707963267948966"/></body>
</body></worldbody></mujoco>"""


def boom(stiffness):
    section = bc.Equivalent(
        bending_stiffness_xy=stiffness, bending_stiffness_xz=1.7 * stiffness, linear_mass=3.0
    )
    return bc.Spec(
        name="boom",
        segment=(bc.Segment(length=6.0, section=section),),
        modes=bc.Modes(xy=1, xz=1),
        damping=bc.Damping(ratio=0.005),
        fit=bc.spec.FitOptions(springs="modes"),
    )


def u(**given):
    return {"distribution": "uniform", **given}


MODES = {"frequency": u(relative=0.1, each=True), "damping": u(relative=0.5)}
BODY = {
    "mass": u(relative=0.1),
    "centre_x": u(absolute=0.05),
    "centre_y": u(absolute=0.04),
    "centre_z": u(absolute=0.06),
    "inertia_xx": u(relative=0.1),
    "inertia_yy": u(relative=0.05),
    "inertia_zz": u(relative=0.1),
    "inertia_xy": u(absolute=3.0),
    "inertia_xz": u(absolute=2.0),
    "inertia_yz": u(absolute=4.0),
}
DRIVE = {"stiffness": u(relative=0.3), "damping": u(relative=0.4)}
ALL = {
    "appendage": {"boom_mount_": MODES, "boom_left_": MODES},
    "body": {"bus": BODY},
    "joint": {"drive": DRIVE},
}
INPUTS = ["torque:bus", "force:bus", "wrench:mount"]
OMEGA = np.geomspace(0.2, 8.0, 12)
SINGLE = {
    "appendage": {"boom_mount_": {"damping": u(relative=0.3, each=True)}},
    "body": {"bus": {"inertia_xx": u(relative=0.05), "inertia_zz": u(relative=0.05)}},
    "joint": {"drive": {"stiffness": u(relative=0.05)}},
}
LOOPS = [
    {
        "input": f"torque_{axis}",
        "output": f"attitude_{axis}",
        "numerator": [200.0, 40.0],
        "denominator": [0.05, 1.0],
        "delay": 0.02,
    }
    for axis in "xyz"
]


@pytest.fixture
def file_of(tmp_path):
    """Writes what is uncertain of a craft, or a controller's loops, and gives the file."""

    def make(given):
        if isinstance(given, list):
            return written(given, tmp_path)
        path = tmp_path / "craft.toml"
        path.write_text(toml(given))
        return path

    return make


def closed(system, gain):
    """A system with `input = gain output + further input`:
    `A + B gain (1 - D gain)^-1 C` and so on; all its signals stay."""
    a, b, c, d = system
    left = np.linalg.inv(np.eye(d.shape[0]) - d @ gain)
    back = b @ gain @ left
    return a + back @ c, b + back @ d, left @ c, left @ d


def with_deltas(system, deltas):
    """A system with its first signals closed by deltas; all its signals stay."""
    gain = np.zeros(system[3].T.shape)
    np.fill_diagonal(gain[: deltas.size, : deltas.size], deltas)
    return closed(system, gain)


@pytest.fixture(scope="module")
def embedded():
    return bc.embed(
        CRAFT, {"mount": boom(2e3), "left": boom(900.0), "right": boom(900.0)}, retime=False
    )


@pytest.fixture(scope="module")
def plant(embedded):
    return bc.plant(embedded, INPUTS)


@pytest.fixture(scope="module")
def small(embedded, tmp_path_factory):
    path = tmp_path_factory.mktemp("small") / "craft.toml"
    path.write_text(toml(SINGLE))
    return robust.uncertain(bc.plant(embedded, ["torque:bus"], ["attitude", "rate"]), path)


def rewritten(text, nominal, values):
    """The file with other numbers, each at its own place."""
    of = {name.partition(".")[0]: {} for name in values}
    for name, value in values.items():
        owner, _, kind = name.rpartition(".")
        of.setdefault(owner, {})[kind] = value
    bus = {k: of["bus"][k] for k in of["bus"]}
    full = [bus[f"inertia_{pair}"] for pair in ("xx", "yy", "zz", "xy", "xz", "yz")]
    line = (
        f'<inertial pos="{bus["centre_x"]!r} {bus["centre_y"]!r} {bus["centre_z"]!r}" '
        f'mass="{bus["mass"]!r}" fullinertia="{" ".join(map(repr, full))}"/>'
    )
    text, count = re.subn(r'<inertial pos="0\.01 -0\.02 0\.03"[^>]*/>', line, text)
    assert count == 1
    text, count = re.subn(
        r'stiffness="60" damping="0\.9"',
        f'stiffness="{of["drive"]["stiffness"]!r}" damping="{of["drive"]["damping"]!r}"',
        text,
    )
    assert count == 1
    for owner, new in of.items():
        if "frequency" in new:
            w = new["frequency"]

            def changed(found, w=w, new=new):
                tag = re.sub(r' stiffness="[^"]*"', f' stiffness="{w * w!r}"', found[0])
                return re.sub(r' damping="[^"]*"', f' damping="{2.0 * new["damping"] * w!r}"', tag)

            text, count = re.subn(rf'<fixed name="{owner}"[^>]*>', changed, text)
            assert count == 1
    return text


def off(one, two, omega):
    a, b = (np.asarray(system(1j * omega, squeeze=False)) for system in (one, two))
    return float((np.abs(a - b) / np.abs(b).max(axis=1, keepdims=True)).max())


def test_samples_are_plants_of_recompiled_models(embedded, plant, file_of):
    given = file_of(ALL)
    uncertain = robust.uncertain(plant, given)
    omega = np.geomspace(0.05, 3.0 * plant.frequency.max(), 60)
    for values in uncertain.draw(4, seed=7):
        model = mujoco.MjModel.from_xml_string(rewritten(embedded.to_mjcf(), plant, values))
        assert off(uncertain.sample(values), bc.plant(model, INPUTS), omega) < TRUTH


def test_participation_against_an_assembly_in_numpy(embedded, file_of):
    """`b -> b/p` and armature `1 - p^2`, put into the matrices of MuJoCo's own model."""
    given = file_of({"appendage": {"boom_mount_": {"participation": u(relative=0.1, each=True)}}})
    uncertain = robust.uncertain(bc.plant(embedded, ["torque:bus"], ["attitude"]), given)
    model = embedded.model
    mass, rows = mass_matrix(model), tendon_rows(model)
    jacobian = np.zeros((model.nv, 3))
    for i in range(model.ntendon):  # the nominal appendage has none
        assert model.tendon_armature[i] == 0.0
    jacobian[3:6] = np.eye(3)
    for p in (0.9, 1.1):
        m = mass.copy()
        k = np.zeros_like(mass)
        c = np.diag(model.dof_damping)
        k[np.ix_(model.jnt_dofadr[1:], model.jnt_dofadr[1:])] = np.diag(model.jnt_stiffness[1:])
        for i, row in enumerate(rows):
            factor = p if model.tendon(i).name.startswith("boom_mount_mode") else 1.0
            k += model.tendon_stiffness[i] * np.outer(row, row) / factor**2
            c = c + model.tendon_damping[i] * np.outer(row, row) / factor**2
            m += (1.0 - factor**2) * np.outer(row, row) / factor**2
        sample = uncertain.sample({q.name: p for q in uncertain.quantities})
        for omega in (0.3, 1.7, 2.9, 6.0):
            true = jacobian.T @ np.linalg.solve(k + 1j * omega * c - omega**2 * m, jacobian)
            assert np.abs(sample(1j * omega) - true).max() < TRUTH * np.abs(true).max()


def test_repetitions_are_minimal(plant, file_of):
    """The rank of the Hankel matrix of a system's series in one delta, the others fixed,
    is the least number of repetitions.

    The series is that of the dynamic stiffness, from samples of the second-order matrices; here
    through the plant's inverse on its own channels: `F(delta) = D21 delta (1 - D11 delta)^-1 D12`
    of M at a frequency, whose powers of delta are `n21 n11^k n12` with all channels of one delta,
    and all inputs and outputs of the craft's motion.
    """
    expected = {
        "frequency": 2,
        "damping": 1,
        "participation": 2,
        "stiffness": 1,
        "mass": 3,
        "centre": 4,
    }
    modes = {kind: u(relative=0.1, each=True) for kind in ("frequency", "damping", "participation")}
    given = {"appendage": {"boom_mount_": modes}, "body": {"bus": BODY}, "joint": {"drive": DRIVE}}
    uncertain = robust.uncertain(plant, file_of(given))
    system = tuple(np.asarray(getattr(uncertain.nominal, name)) for name in "ABCD")
    total = system[3].shape[1] - len(uncertain.inputs)
    ends = np.cumsum([0, *(block.repetitions for block in uncertain.blocks)])
    rng = np.random.default_rng(1)
    system = with_deltas(system, np.zeros(total))
    for block, (start, stop) in zip(uncertain.blocks, pairwise(ends), strict=True):
        kind = block.name.rpartition(".")[2]
        damping_of_joint = block.name == "drive.damping"
        count = expected.get(kind.partition("_")[0], 1 if kind[-1] == kind[-2] else 2)
        assert block.repetitions == (1 if damping_of_joint else count), block
        deltas = rng.uniform(-0.5, 0.5, total)  # the others anywhere
        deltas[start:stop] = 0.0
        a, b, c, d = with_deltas(system, deltas)
        mine = slice(start, stop)
        rest_in = slice(total, None)
        rest_out = slice(total, None)
        columns, rows = [], []
        for s in (0.4 + 1.0j, 1.1 + 2.3j, 0.2 + 5.0j):
            m = c @ np.linalg.solve(s * np.eye(a.shape[0]) - a, b) + d
            reach = [m[mine, rest_in]]
            see = [m[rest_out, mine]]
            for _ in range(block.repetitions):
                reach.append(m[mine, mine] @ reach[-1])
                see.append(see[-1] @ m[mine, mine])
            hankel = np.vstack(see) @ np.hstack(reach)
            size = np.linalg.svd(hankel / np.abs(hankel).max(), compute_uv=False)
            columns.append(
                np.linalg.matrix_rank(np.hstack(reach), RANK * np.abs(np.hstack(reach)).max())
            )
            rows.append(int(np.sum(size > RANK**1.5)))
        assert max(columns) == block.repetitions, block
        assert max(rows) == block.repetitions, block


def test_a_sensor_that_reads_the_quantity_is_refused(embedded, file_of):
    text = embedded.to_mjcf().replace(
        "</worldbody>", "</worldbody><sensor><subtreecom name='com' body='rotor'/></sensor>", 1
    )
    given = file_of({"body": {"rotor": {"centre_x": u(absolute=0.05)}}})
    with pytest.raises(bc.InputError, match=r"com_.* rotor\.centre_x"):
        robust.uncertain(
            bc.plant(mujoco.MjModel.from_xml_string(text), ["torque:bus"], ["com"]), given
        )


def test_a_wheel_that_turns_is_refused(file_of):
    text = CRAFT.replace('stiffness="60" damping="0.9"', "")
    craft = bc.embed(text, {"mount": boom(2e3)}, retime=False)
    given = file_of({"body": {"rotor": {"inertia_yy": u(relative=0.1)}}})
    with pytest.raises(bc.InputError, match="rotor.inertia_yy"):
        robust.uncertain(bc.plant(craft, ["torque:bus"], rates={"drive": 100.0}), given)


def test_of_specifications():
    segment = {
        "length": 6.0,
        "section": {"shape": "equivalent", "bending_stiffness_xy": 2e3, "linear_mass": 3.0},
    }
    given = {"frequency": u(relative=0.05), "stiffness": u(relative=0.1)}
    spec = boom(2e3).replace(
        uncertain=spec_of({"segment": [segment], "uncertain": given}).uncertain
    )
    uncertain = robust.uncertain(bc.plant(bc.embed(CRAFT, {"mount": spec}, retime=False)))
    assert [(block.name, block.repetitions) for block in uncertain.blocks] == [
        ("boom_.frequency", 4)
    ]
    assert "structural" in uncertain.warnings[0]


# -- worst cases -----------------------------------------------------------------------------------
def below(uncertain, loops, count):
    """The worst case, whose gain no sample exceeds: with `control` alone (Pade delays),
    random deltas and corners, at the frequencies of the result."""
    found = uncertain.worst_case(loops, "torque_x", "rate_x", OMEGA, samples=20)
    pade = control.ss(control.tf(*control.pade(0.02, 6)) * control.tf([200.0, 40.0], [0.05, 1.0]))
    three = control.ss(control.append(pade, pade, pade))
    rng = np.random.default_rng(3)
    omega = found.omega
    most = 0.0
    for k in range(count):
        deltas = (
            rng.uniform(-1.0, 1.0, len(uncertain.blocks))
            if k % 2
            else rng.choice([-1.0, 1.0], len(uncertain.blocks))
        )
        g, h = (
            np.moveaxis(np.asarray(one(1j * omega, squeeze=False)), -1, 0)
            for one in (uncertain.sample(deltas), three)
        )
        closed = g @ np.linalg.inv(np.eye(3) + h @ g[:, :3])
        gain = np.abs(closed[:, 3, 0])
        most = max(most, float(gain.max()))
    assert most <= found.gain * (1.0 + 1e-6)
    return found


@pytest.mark.slow
def test_samples_lie_below_the_worst_and_mujoco_confirms(small, file_of):
    found = below(small, file_of(LOOPS), 60)
    assert found.stable
    assert abs(found.simulated / found.gain - 1.0) < PEAK


@pytest.mark.slow
def test_an_unstable_sample_is_found(embedded, file_of):
    """A loop just inside its gain margin, which less inertia, damping or stiffness takes away."""
    plant = bc.plant(embedded, ["torque:bus"], ["attitude"])
    limit = bc.margins(plant, file_of(LOOPS)).loops[2].gain
    uncertain = robust.uncertain(plant, file_of(SINGLE))
    near = scaled(LOOPS, 2, 0.995 * limit)
    found = uncertain.worst_case(file_of(near), "torque_z", "attitude_z", samples=10)
    assert not found.stable
    worst = uncertain.sample(found.deltas)  # closed here, with dead times as Pade approximations
    k = control.ss(control.tf(*control.pade(0.02, 6)) * control.tf([200.0, 40.0], [0.05, 1.0]))
    third = control.ss(
        control.tf(*control.pade(0.02, 6))
        * control.tf([200.0 * 0.995 * limit, 40.0 * 0.995 * limit], [0.05, 1.0])
    )
    poles = control.feedback(
        control.ss(worst.A, worst.B, worst.C, worst.D), control.append(k, k, third)
    ).poles()
    assert poles.real.max() > 0.0
    with pytest.raises(bc.InputError, match="not stable"):
        uncertain.worst_case(file_of(scaled(LOOPS, 2, 1.1 * limit)))


@pytest.mark.slow
def test_one_loop_of_a_craft_whose_axes_couple(small, file_of):
    """What drifts about the other axes takes no part;
    a peak at low frequency is a long run for the fast modes."""
    found = small.worst_case(file_of(LOOPS[2:]), "torque_z", "attitude_z", [1.0], samples=5)
    assert found.stable
    assert found.frequency < 0.3
    assert abs(found.simulated / found.gain - 1.0) < PEAK


@pytest.mark.slow
def test_loops_on_one_input_add_up(small, file_of):
    """One loop, and the same as two of unequal share."""
    one = LOOPS[2]
    parts = [scaled([one], 0, share)[0] for share in (0.3, 0.7)]
    ends = ("torque_z", "attitude_z", [1.0])
    whole, both = (small.worst_case(file_of(loops), *ends, samples=5) for loops in ([one], parts))
    assert both.gain == pytest.approx(whole.gain, rel=1e-6)
    assert abs(both.simulated / both.gain - 1.0) < PEAK


def test_a_plant_per_angle(embedded, file_of):
    scheduled = bc.plant(embedded, ["torque:bus"], pose={"drive": [0.0, 0.5]})
    for one, uncertain in zip(
        scheduled.plants, robust.uncertain(scheduled, file_of(SINGLE)), strict=True
    ):
        assert off(uncertain.sample({}), one, OMEGA) < TRUTH


def test_printed_values_may_be_typed_back(small):
    """Tables print six digits: the end of a range, rounded outwards, is that end."""
    ends = np.where(np.arange(len(small.blocks)) % 2, -1.0, 1.0)
    exact = small.values(ends)
    printed = {name: float(f"{value:.6g}") for name, value in exact.items()}
    assert any(printed[name] != exact[name] for name in exact)
    np.testing.assert_allclose(small.sample(printed).A, small.sample(exact).A, rtol=1e-4, atol=1e-9)
    small.model(printed)
    name = next(iter(exact))
    low, high = (small.values(side * np.ones(len(small.blocks)))[name] for side in (-1.0, 1.0))
    with pytest.raises(bc.InputError, match="outside") as told:
        small.sample({name: high + 1e-3 * (high - low)})
    assert f"{low:.9g} to {high:.9g}" in str(told.value)


def test_a_sampled_controller_has_no_bound(small):
    law = {
        (f"torque_{axis}", f"attitude_{axis}"): control.tf([20.0, -19.5], [1.0, -0.2], 0.1)
        for axis in "xyz"
    }
    with pytest.raises(bc.InputError, match="bounds take continuous loops"):
        small.bound(law, samples=0)
