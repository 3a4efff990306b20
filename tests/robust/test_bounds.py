"""Upper bounds of worst cases against craft whose values are written into MuJoCo's fields here,
linearised and closed here: no sample lies above the drawn steps, and the largest step is close to
the largest gain found.

`GAP`: of the largest step above the largest gain found. `ABOVE`: rounding of a sample's gain, whose
lightly damped resonances amplify that of the matrices. `CLOSED`: of the step above the closed form;
steps are brought to 2 % of the largest gain. `FOUND`: of a gain at the top of a peak that a grid
has found. `IDLE`: of a step above the gains in its interval. The environment variable
BEAMCHAIN_SAMPLES says how many samples: 2,000 by hand.
"""

import copy
import json
import os
import re
import sys
from itertools import product
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain import robust
from beamchain.robust.bounds import GainBound
from command import run
from mechanics import damping_matrix, mass_matrix, stiffness_matrix

GAP, ABOVE, CLOSED, FOUND, IDLE = 0.10, 1e-6, 0.03, 1e-3, 1.4
SAMPLES = int(os.environ.get("BEAMCHAIN_SAMPLES", "20"))
FREQUENCIES = 2_000
SECONDS = 60.0
CRAFT = """<mujoco model="craft"><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 80 70"/>
<site name="mount" pos="0.5 0 0"/><site name="left" pos="0 0.5 0" euler="0 0 1.5707963267948966"/>
<body name="rotor" pos="0 -0.5 0"><joint name="drive" axis="0 1 0" stiffness="60" damping="0.9"/>
<inertial pos="0 0 0" mass="5" diaginertia="0.3 0.2 0.3"/></body></body></worldbody></mujoco>"""
TWINS = CRAFT.replace(
    '"mount" pos="0.5 0 0"', '"right" pos="0 -0.5 0" euler="0 0 -1.5707963267948966"'
)
SPINNING = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="50" diaginertia="9 8 7"/><body name="rotor">
<joint name="drive" axis="0 0 1" stiffness="12" damping="0.04"/>
<inertial pos="0 0 0" mass="5" diaginertia="1 1 2"/></body></body></worldbody></mujoco>"""
TOP, BOTTOM = (200.0, 30.0), (0.05, 1.0)


def uniform(**given):
    return bc.spec.Uncertainty(distribution="uniform", **given)


def boom(stiffness, ratio):
    section = bc.Equivalent(
        bending_stiffness_xy=stiffness, bending_stiffness_xz=1.6 * stiffness, linear_mass=4.0
    )
    return bc.Spec(
        name="boom",
        segment=(bc.Segment(length=8.0, section=section),),
        modes=bc.Modes(xy=1, xz=1),
        damping=bc.Damping(ratio=ratio),
        fit=bc.spec.FitOptions(springs="modes"),
    )


def controller(delay, top=TOP, bottom=BOTTOM, axes="xyz"):
    return bc.spec.Controller(
        loop=tuple(
            bc.spec.Loop(
                input=f"torque_{axis}",
                output=f"attitude_{axis}",
                numerator=top,
                denominator=bottom,
                delay=delay,
            )
            for axis in axes
        )
    )


PULLED = controller(0.1, (8.0, 3.0), axes="z")
EACH = {
    "boom_mount_": bc.spec.UncertainModes(frequency=uniform(relative=0.1, each=True)),
    "boom_left_": bc.spec.UncertainModes(damping=uniform(relative=0.5, each=True)),
}
COMMON = {"boom_": bc.spec.UncertainModes(frequency=uniform(relative=0.15))}
# two equal booms, of which the controlled axis hardly moves or sees that they oppose each other
EQUAL = {
    prefix: bc.spec.UncertainModes(frequency=uniform(relative=0.04, each=True))
    for prefix in ("boom_left_", "boom_right_")
}
CASES = {
    "each mode, inertia, a drive": SimpleNamespace(
        uncertain=bc.spec.UncertainCraft(
            appendage=EACH,
            body={"bus": bc.spec.UncertainBody(inertia_zz=uniform(relative=0.05))},
            joint={"drive": bc.spec.UncertainJoint(stiffness=uniform(relative=0.2))},
        ),
        craft=CRAFT,
        booms={"mount": 2e3, "left": 1.3e3},
        ratio=0.005,
        delay=0.1,
        output="rate_z",
    ),
    "one number for all modes": SimpleNamespace(
        uncertain=bc.spec.UncertainCraft(appendage=COMMON),
        craft=CRAFT,
        booms={"mount": 2e3},
        ratio=0.003,
        delay=0.2,
        output="rate_z",
    ),
    "two equal booms": SimpleNamespace(
        uncertain=bc.spec.UncertainCraft(
            appendage=EQUAL, body={"bus": bc.spec.UncertainBody(inertia_zz=uniform(relative=0.03))}
        ),
        craft=TWINS,
        booms={"left": 2e3, "right": 2e3},
        ratio=0.005,
        delay=0.02,
        output="rate_z",
    ),
}


def made(case):
    booms = {site: boom(stiffness, case.ratio) for site, stiffness in case.booms.items()}
    embedded = bc.embed(case.craft, booms, retime=False)
    plant = bc.plant(embedded, ["torque:bus"], ["attitude", "rate"])
    return embedded.model, robust.uncertain(plant, case.uncertain)


# -- the truth: MuJoCo's fields, mass matrix and tendons -------------------------------------------
def edited(model, values):
    """A model with other numbers in its fields; a mode's damping ratio stays where only its
    frequency moves."""
    out = copy.copy(model)
    for name, value in values.items():
        owner, _, kind = name.rpartition(".")
        if kind.startswith("inertia"):
            body = out.body(owner).id
            assert np.allclose(out.body_iquat[body], [1.0, 0.0, 0.0, 0.0])
            out.body_inertia[body, "xyz".index(kind[-1])] = value
        elif kind == "stiffness":
            out.jnt_stiffness[out.joint(owner).id] = value
        else:
            tendon = out.tendon(owner).id
            omega = np.sqrt(out.tendon_stiffness[tendon])
            ratio = out.tendon_damping[tendon] / (2.0 * omega)
            omega = value if kind == "frequency" else omega
            ratio = value if kind == "damping" else ratio
            out.tendon_stiffness[tendon] = omega**2
            out.tendon_damping[tendon] = 2.0 * ratio * omega
    return out


def matrices(model):
    """Mass, with the armature of tendons, damping and stiffness at rest."""
    return mass_matrix(model), damping_matrix(model), stiffness_matrix(model)


def gains(model, loops, output, omega):
    """|output per torque_z| of the closed loop, loops from attitudes to torques."""
    mass, damping, stiffness = matrices(model)
    s = 1j * omega[:, None, None]
    turned = np.zeros((model.nv, 3))
    turned[3:6] = np.eye(3)
    plant = turned.T @ np.linalg.solve(stiffness + s * damping + s**2 * mass, turned[None])
    k = np.array([law(loop, 1j * omega) for loop in loops.loop]).T[:, :, None]
    torque = np.linalg.solve(np.eye(3) + k * plant, np.eye(3)[:, 2:][None])
    attitude = (plant @ torque)[:, 2, 0]
    return np.abs(attitude * (1j * omega if output == "rate_z" else 1.0))


def law(loop, s):
    top, bottom = np.polyval(loop.numerator, s), np.polyval(loop.denominator, s)
    return top / bottom * np.exp(-s * loop.delay)


def ranges(model, case):
    """Nominal values and half widths by name, in groups that share a number."""
    groups = []
    for prefix, table in case.uncertain.appendage.items():
        names = [
            model.tendon(i).name
            for i in range(model.ntendon)
            if model.tendon(i).name.startswith(f"{prefix}mode")
        ]
        for kind in ("frequency", "damping"):
            if (how := getattr(table, kind)) is not None:
                rows = [(f"{name}.{kind}", how.relative) for name in names]
                groups += [[row] for row in rows] if how.each else [rows]
    if any(len(rows) > 1 for rows in groups):  # one number for all
        groups = [[row for rows in groups for row in rows]]
    for owner, table in case.uncertain.body.items():
        groups.append([(f"{owner}.inertia_zz", table.inertia_zz.relative)])
    for owner, table in case.uncertain.joint.items():
        groups.append([(f"{owner}.stiffness", table.stiffness.relative)])
    return groups


def nominal(model, name):
    owner, _, kind = name.rpartition(".")
    if kind.startswith("inertia"):
        return model.body_inertia[model.body(owner).id, 2]
    if kind == "stiffness":
        return model.jnt_stiffness[model.joint(owner).id]
    tendon = model.tendon(owner).id
    omega = np.sqrt(model.tendon_stiffness[tendon])
    return omega if kind == "frequency" else model.tendon_damping[tendon] / (2.0 * omega)


def frequencies(model):
    """Half of them about the resonances of the free craft."""
    mass, _, stiffness = matrices(model)
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real
    modes = np.sqrt(squares[squares > 1e-3])
    near = 1.0 + 0.05 * np.sinh(np.linspace(-6.0, 6.0, FREQUENCIES // (2 * modes.size))) / np.sinh(
        6
    )
    about = np.outer(modes, near).ravel()
    return np.sort(np.append(about, np.geomspace(0.01, 60.0, FREQUENCIES - about.size)))


@pytest.mark.slow
@pytest.mark.parametrize("name", list(CASES))
def test_no_sample_lies_above_the_steps(name, capsys):
    case = CASES[name]
    model, uncertain = made(case)
    loops = controller(case.delay)
    worst = uncertain.worst_case(
        loops, "torque_z", case.output, simulate=False, bound=True, seconds=SECONDS
    )
    bound = worst.bound
    assert bound.stable
    assert bound.gains.size <= 200
    rng = np.random.default_rng(11)
    groups = ranges(model, case)
    best = worst.gain
    most = 0.0
    for k in range(SAMPLES):
        low_or_high = rng.choice([-1.0, 1.0], len(groups))
        deltas = low_or_high if k % 4 == 0 else rng.uniform(-1.0, 1.0, len(groups))
        values = {
            each: nominal(model, each) * (1.0 + delta * relative)
            for delta, rows in zip(deltas, groups, strict=True)
            for each, relative in rows
        }
        sample = edited(model, values)
        omega = frequencies(sample)
        gain = gains(sample, loops, case.output, omega)
        most = max(most, float((gain / bound.at(omega)).max()))
        best = max(best, float(gain.max()))
    gap = bound.gain / best - 1.0
    with capsys.disabled():
        sys.stdout.write(
            f"\n{name}: {SAMPLES} samples at {FREQUENCIES} frequencies, highest {most:.6f} of its "
            f"step; largest step {100.0 * gap:.2f} % above the best sample, "
            f"at {worst.frequency:.4g} rad/s; {bound.sentence}"
        )
    assert most <= 1.0 + ABOVE
    assert gap < GAP
    assert bound.late or (bound.gains / bound.sampled).max() < IDLE
    # the worst sample that is stated has the gain that is stated
    sample = edited(model, worst.values)
    stated = gains(sample, loops, case.output, np.array([worst.frequency]))[0]
    assert stated == pytest.approx(worst.gain, rel=ABOVE)


# -- closed forms ----------------------------------------------------------------------------------
def oscillator(relative=0.3):
    """A rotor on a sprung hinge about the axis of a bus: two inertias, one frequency."""
    plant = bc.plant(mujoco.MjModel.from_xml_string(SPINNING), ["torque:bus"], ["attitude"])
    given = bc.spec.UncertainJoint(stiffness=uniform(relative=relative))
    return robust.uncertain(plant, bc.spec.UncertainCraft(joint={"drive": given}))


def closed_form(stiffness, omega, loop):
    """|attitude per torque| of the bus: I1 = 7, I2 = 2, one loop about the axis."""
    s = 1j * omega
    spring = 0.04 * s + stiffness
    bus = (2.0 * s**2 + spring) / (s**2 * (14.0 * s**2 + 9.0 * spring))
    return np.abs(bus / (1.0 + law(loop, s) * bus))


@pytest.fixture(scope="module")
def bounded():
    return oscillator().worst_case(PULLED, samples=5, simulate=False, bound=True)


@pytest.mark.slow
def test_the_bound_of_an_oscillator_is_its_worst_gain(bounded):
    loops = PULLED
    bound = bounded.bound
    assert bound.stable
    omega = np.geomspace(0.01, 50.0, 2_000)
    stiffness = np.linspace(0.7 * 12.0, 1.3 * 12.0, 201)
    every = closed_form(stiffness[:, None], omega, loops.loop[0])
    assert np.all(every.max(axis=0) <= bound.at(omega) * (1.0 + ABOVE))
    assert every.max() * (1.0 - FOUND) <= bound.gain <= every.max() * (1.0 + CLOSED)
    # and no step is idle
    for low, high, step in zip(bound.edges[:-1], bound.edges[1:], bound.gains, strict=True):
        inside = (omega >= low) & (omega <= high)
        if inside.sum() > 5:
            assert step < IDLE * every[:, inside].max()


@pytest.mark.slow
def test_where_some_values_are_unstable_there_is_no_bound_and_it_says_so():
    loops = controller(0.3, (20.0, 10.0), axes="z")
    uncertain = oscillator(0.6)
    worst = uncertain.worst_case(loops, samples=20, bound=True)
    assert not worst.stable
    assert worst.bound is None
    bound = uncertain.bound(loops, samples=20, seconds=3.0)
    none = ~np.isfinite(bound.gains)
    low, high = bound.edges[:-1][none].min(), bound.edges[1:][none].max()
    assert 0.99 * low < worst.frequency < 1.01 * high
    assert high < 1.5 * low  # elsewhere there is one, the range being parted
    assert max(bound.boxes) > 1
    assert not bound.stable
    assert "drive.stiffness" in bound.sentence
    assert bound.as_dict()["gain"] is None


def test_steps_are_read_on_both_sides_of_an_edge():
    ends = np.array([0.0, 1.0, 2.0, np.inf])
    steps = np.array([2.0, 5.0, np.inf])
    bound = GainBound(ends, steps, steps / 2.0, (1, 1, 32), ("a",), True, 3, 1.0)
    assert bound.at([0.0, 0.5, 1.0, 1.5, 2.0, 1e9]).tolist() == [2, 2, 5, 5, np.inf, np.inf]
    assert bound.gain == np.inf
    assert "no bound in 1 of 3 intervals" in bound.sentence
    assert "a are too wide" in bound.sentence
    assert json.dumps(bound.as_dict(), allow_nan=False)
    early = GainBound(ends, steps, steps / 2.0, (1, 1, 1), ("a",), True, 3, 1.0)
    assert "time was up" in early.sentence
    assert "too wide" not in early.sentence


def test_the_steps_are_drawn_as_steps_and_not_across_what_has_no_bound(bounded):
    worst = bounded
    steps = [patch for patch in worst.plot().patches if patch.get_label() == "no value exceeds"]
    values, edges, _ = steps[0].get_data()
    assert values.tolist() == worst.bound.gains.tolist()
    assert np.all(np.diff(edges) >= 0.0)


# -- values, margins, poses ------------------------------------------------------------------------
def test_the_worst_values_stand_beside_the_nominal_ones():
    worst = oscillator().worst_case(PULLED, samples=5, simulate=False)
    [row] = worst.table.records()
    assert row["quantity"] == "drive.stiffness"
    assert row["nominal"] == 12.0
    assert row["unit"] == "N m/rad"
    assert row["worst"] == pytest.approx(12.0 * (1.0 + 0.3 * row["percent"] / 100.0))
    assert worst.as_dict()["quantities"] == [row]


@pytest.mark.slow
def test_worst_margins_of_one_loop_are_those_of_its_open_loop():
    loops = PULLED
    loop = loops.loop[0]
    margins = oscillator().worst_margins(loops, samples=10, bound=True, seconds=10.0)
    omega = np.geomspace(0.05, 60.0, 40_000)
    s = 1j * omega
    disks, factors, phases = [], [], []
    for stiffness in np.linspace(8.4, 15.6, 101):
        spring = 0.04 * s + stiffness
        opened = law(loop, s) * (2.0 * s**2 + spring) / (s**2 * (14.0 * s**2 + 9.0 * spring))
        disks.append(2.0 / np.abs((1.0 - opened) / (1.0 + opened)).max())
        at = np.flatnonzero((opened.imag[1:] * opened.imag[:-1] < 0) & (opened.real[1:] < 0))
        factors.append(min((f for f in -1.0 / opened.real[at] if f > 1.0), default=np.inf))
        at = np.flatnonzero(np.diff(np.abs(opened) > 1.0))
        phases.append(np.degrees(np.abs(np.angle(-opened[at]))).min())
    rows = {row.kind: row for row in margins.margins if row.at == "torque_z"}
    assert rows["disk"].worst == pytest.approx(min(disks), rel=FOUND)
    assert rows["gain up, factor"].worst == pytest.approx(min(factors), rel=5.0 * FOUND)
    assert rows["phase"].worst == pytest.approx(min(phases), rel=5.0 * FOUND)
    assert margins.all_at_once.worst == pytest.approx(rows["disk"].worst, rel=FOUND)
    assert rows["disk"].worst * (1.0 - CLOSED) <= rows["disk"].proved <= rows["disk"].worst
    assert margins.stable
    assert margins.least().values.keys() == {"drive.stiffness"}
    for row in margins:
        [delta] = row.deltas.values()
        assert row.values["drive.stiffness"] == pytest.approx(12.0 * (1.0 + 0.3 * delta))
    assert margins.least("phase") == rows["phase"]
    with pytest.raises(bc.InputError, match="'gain'.*choose from disk, gain up"):
        margins.least("gain")


SKEW = """<mujoco model="craft"><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0.04 -0.03 0.05" mass="240" fullinertia="80 95 110 4 -6 3"/>
<site name="mount" pos="0.6 0.1 0.2" euler="10 20 -15"/>
<site name="left" pos="-0.1 0.5 0.1" xyaxes="0 1 0 -1 0 0"/></body></worldbody></mujoco>"""
BUS = {
    "bus.mass": (240.0, 12.0),
    "bus.centre_y": (-0.03, 0.03),
    "bus.inertia_zz": (110.0, 11.0),
    "bus.inertia_xz": (-6.0, 4.0),
}


def with_bus(model, values):
    """A model with other mass properties of its bus."""
    out = copy.copy(model)
    bus = out.body("bus").id
    inertia = np.array([[80.0, 4.0, -6.0], [4.0, 95.0, 3.0], [-6.0, 3.0, 110.0]])
    inertia[2, 2] = values["bus.inertia_zz"]
    inertia[0, 2] = inertia[2, 0] = values["bus.inertia_xz"]
    out.body_mass[bus] = values["bus.mass"]
    out.body_ipos[bus, 1] = values["bus.centre_y"]
    sizes, axes = np.linalg.eigh(inertia)
    out.body_inertia[bus] = sizes
    mujoco.mju_mat2Quat(out.body_iquat[bus], (axes * np.linalg.det(axes)).ravel())
    return out


def least_disks(model, loops, omega):
    """Disk margin at every input, the loops of the others closed, and of all at once at most."""
    mass, damping, stiffness = matrices(model)
    s = 1j * omega[:, None, None]
    turned = np.zeros((model.nv, 3))
    turned[3:6] = np.eye(3)
    plant = turned.T @ np.linalg.solve(stiffness + s * damping + s**2 * mass, turned[None])
    k = np.array([law(loop, 1j * omega) for loop in loops.loop]).T[:, :, None]
    e = np.linalg.inv(np.eye(3) + k * plant) - np.eye(3) / 2.0
    single = 1.0 / np.abs(np.einsum("kii->ki", e)).max(axis=0)
    # mu of diagonal complex numbers is at least the spectral radius
    return np.append(single, 1.0 / np.abs(np.linalg.eigvals(e)).max())


@pytest.mark.slow
def test_no_corner_of_nine_ranges_is_worse_than_stated_and_the_table_agrees_with_itself():
    """The worst lies at the mode of a peak that is not the highest of the nominal loop."""
    tube = bc.Tube(outer_diameter=0.06, wall=0.0025)
    aluminium = bc.Material(youngs_modulus=6.5e10, density=2650.0, poissons_ratio=0.3)
    long = bc.Spec(
        name="ba",
        segment=(bc.Segment(length=7.0, section=tube, material=aluminium),),
        lump=(bc.Lump(x=7.0, mass=2.5, inertia=(0.05, 0.07, 0.06)),),
        damping=bc.Damping(ratio=0.004),
        modes=bc.Modes(xy=1, xz=1),
        fit=bc.spec.FitOptions(springs="modes"),
    )
    flat = bc.Equivalent(
        bending_stiffness_xy=9e3, bending_stiffness_xz=4e3, linear_mass=3.1, polar_inertia=0.2
    )
    short = bc.Spec(
        name="bb",
        segment=(bc.Segment(length=5.0, section=flat),),
        damping=bc.Damping(ratio=0.006),
        modes=bc.Modes(xy=1, xz=1),
        fit=bc.spec.FitOptions(springs="modes"),
    )
    embedded = bc.embed(SKEW, {"mount": long, "left": short}, retime=False)
    model = embedded.model
    each = uniform(relative=0.12, each=True), uniform(relative=0.4, each=True)
    uncertain = robust.uncertain(
        bc.plant(embedded, ["torque:bus"], ["attitude"]),
        bc.spec.UncertainCraft(
            appendage={
                "ba_": bc.spec.UncertainModes(frequency=each[0], damping=each[1]),
                "bb_": bc.spec.UncertainModes(frequency=uniform(relative=0.1)),
            },
            body={
                "bus": bc.spec.UncertainBody(
                    mass=uniform(relative=0.05),
                    centre_y=uniform(absolute=0.03),
                    inertia_zz=uniform(relative=0.1),
                    inertia_xz=uniform(absolute=4.0),
                )
            },
        ),
    )
    lag = 0.05, 1.0
    laws = (((220.0, 50.0), lag, 0.03), ((300.0, 60.0), (0.04, 1.0), 0.04))
    loops = bc.spec.Controller(
        loop=tuple(
            bc.spec.Loop(
                input=f"torque_{axis}",
                output=f"attitude_{axis}",
                numerator=top,
                denominator=tuple(np.polymul(bottom, (0.02, 1.0)).tolist())
                if axis == "y"
                else bottom,
                delay=delay,
            )
            for axis, (top, bottom, delay) in zip(
                "xyz", (*laws, ((330.0, 70.0), lag, 0.05)), strict=True
            )
        )
    )
    found = uncertain.worst_margins(loops, samples=20)
    disks = [row.worst for row in found if row.kind == "disk"]
    omega = np.geomspace(0.1, 60.0, 2_000)
    start = [row.nominal for row in found if row.kind == "disk" and row.at != "all loops at once"]
    assert start == pytest.approx(least_disks(model, loops, omega)[:3], rel=1e-2)
    rng = np.random.default_rng(0)
    names = [model.tendon(i).name for i in range(model.ntendon)]
    least = np.full(4, np.inf)
    for _ in range(25):
        values = {
            f"{name}.{kind}": nominal(model, f"{name}.{kind}") * (1.0 + side * relative)
            for name in names
            if name.startswith("ba_mode")
            for kind, relative in (("frequency", 0.12), ("damping", 0.4))
            for side in rng.choice([-1.0, 1.0], 1)
        }
        common = 1.0 + 0.1 * rng.choice([-1.0, 1.0])
        values |= {
            f"{name}.frequency": common * nominal(model, f"{name}.frequency")
            for name in names
            if name.startswith("bb_mode")
        }
        bus = {name: at + rng.choice([-1.0, 1.0]) * reach for name, (at, reach) in BUS.items()}
        corner = with_bus(edited(model, values), bus)
        least = np.minimum(least, least_disks(corner, loops, omega))
    assert np.all(disks <= 1.01 * least)
    for axis, disk in zip("xyz", disks, strict=False):
        row = {each.kind: each.worst for each in found if each.at == f"torque_{axis}"}
        up = row["gain up, factor"]
        assert disk <= 2.0 * (up - 1.0) / (up + 1.0) * (1.0 + ABOVE)
        assert disk <= 2.0 * np.tan(np.radians(abs(row["phase"])) / 2.0) * (1.0 + ABOVE)
        assert disks[-1] <= disk * (1.0 + ABOVE)


@pytest.fixture
def turning(tmp_path):
    """A craft with a boom on a drive, its loops and what is uncertain, as files."""
    section = bc.Equivalent(bending_stiffness_xy=2e3, bending_stiffness_xz=900.0, linear_mass=4.0)
    spec = bc.Spec(
        name="boom",
        segment=(bc.Segment(length=6.0, section=section),),
        modes=bc.Modes(xy=1, xz=1),
        damping=bc.Damping(ratio=0.005),
        fit=bc.spec.FitOptions(springs="modes"),
    )
    text = CRAFT.replace(
        '<inertial pos="0 0 0" mass="5"', '<site name="end"/><inertial pos="0 0 0" mass="5"'
    )
    embedded = bc.embed(text, {"end": spec}, retime=False)
    embedded.write(tmp_path / "craft.xml")
    (tmp_path / "uncertain.toml").write_text(
        '[appendage.boom_]\nfrequency = { relative = 0.05, distribution = "uniform" }\n'
    )
    (tmp_path / "loops.toml").write_text(
        "".join(
            f'[[loop]]\ninput = "torque_{axis}"\noutput = "attitude_{axis}"\n'
            f"numerator = {list(TOP)}\ndenominator = {list(BOTTOM)}\n"
            for axis in "xyz"
        )
    )
    return SimpleNamespace(folder=tmp_path, embedded=embedded)


@pytest.mark.slow
def test_a_worst_case_per_pose_and_the_worst_of_them(turning):
    scheduled = bc.plant(turning.embedded, ["torque:bus"], pose={"drive": [0.0, 1.2]})
    files = turning.folder / "uncertain.toml", turning.folder / "loops.toml"
    cases = robust.worst_case(
        scheduled, *files, "torque_x", "attitude_x", samples=3, simulate=False
    )
    alone = [
        robust.uncertain(plant, files[0]).worst_case(
            files[1], "torque_x", "attitude_x", samples=3, simulate=False
        )
        for plant in scheduled.plants
    ]
    assert [case.gain for case in cases] == [case.gain for case in alone]
    assert cases.labels == ("drive 0°", "drive 68.7549°")
    assert cases.worst.gain == max(case.gain for case in alone)
    assert cases.worst.pose in cases.worst.sentence
    assert len(cases) == 2
    assert cases.stable


@pytest.mark.slow
def test_the_command_says_the_worst_pose_by_pose(turning, capsys, monkeypatch):
    folder = turning.folder
    words = ["worst-case", folder / "craft.xml", "--from", "torque:bus", "--to", "attitude"]
    words += ["--pose", "drive=0,60", "--controller", folder / "loops.toml"]
    words += ["--uncertain", folder / "uncertain.toml", "-o", folder / "worst.html"]
    status, out, err = run([str(word) for word in words], capsys, monkeypatch)
    assert status == 0, err
    assert re.findall(r"worst case, (.*?): ", out) == ["drive 0°", "drive 60°"]
    percent = [float(found) for found in re.findall(r"([-+]?[\d.]+) +│\n", out)]
    assert percent
    assert all(abs(share) <= 100.0 for share in percent)
    page = (folder / "worst.html").read_text(encoding="utf-8")
    assert "Values of the worst sample at drive 60°" in page


@pytest.mark.slow
def test_delays_wide_apart_are_bounded_by_their_size():
    """All signs of a delayed loop far above its band are allowed for: the steps there hold for the
    loop at any phase."""
    loops = controller(0.5, (2.0, 0.3), (0.05, 1.0), axes="z")
    bound = oscillator().bound(loops, samples=2)
    assert bound.stable
    omega = np.geomspace(20.0, 400.0, 500)
    for stiffness, delay in product((8.4, 12.0, 15.6), (0.0, 0.5, 0.51)):
        changed = SimpleNamespace(numerator=(2.0, 0.3), denominator=(0.05, 1.0), delay=delay)
        far = omega > 2.0 * 12.0
        assert np.all(closed_form(stiffness, omega[far], changed) <= 1.02 * bound.at(omega[far]))
