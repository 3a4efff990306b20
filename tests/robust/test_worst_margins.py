"""Least margins of uncertain loops against equations of motion written here: the limits at rest and
at infinite frequency, the sign of a phase, the worst of all corners of a box, tables that do not
contradict themselves, and unstable values.

`FOUND`: relative, of what is stated beside the least that is found here on grids.
"""

from itertools import product

import control
import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

import beamchain as bc
from beamchain import robust

FOUND = 1e-3
MASS, DAMPING, STIFFNESS, PUSH = 5.0, 0.6, 20.0, 2.0
SPRUNG = f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="bus">
<joint name="drive" axis="0 0 1" stiffness="{STIFFNESS}" damping="{DAMPING}"/>
<inertial pos="0 0 0" mass="1" diaginertia="{MASS} {MASS} {MASS}"/></body></worldbody></mujoco>"""
SLIDING = f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="bus">
<joint name="drive" type="slide" axis="1 0 0" stiffness="{STIFFNESS}" damping="{DAMPING}"/>
<inertial pos="0 0 0" mass="{MASS}" diaginertia="1 1 1"/><site name="felt"/></body></worldbody>
<sensor><accelerometer name="felt" site="felt"/></sensor></mujoco>"""


def uniform(relative):
    return bc.spec.Uncertainty(relative=relative, distribution="uniform")


def loop(at, seen, top, bottom=(1.0,), delay=0.0):
    return bc.spec.Loop(input=at, output=seen, numerator=top, denominator=bottom, delay=delay)


def rows(found, at):
    return {row.kind: row for row in found if row.at == at}


def pushed(mass, stiffness, power):
    """Least gain up, disk and signed phase [degrees] of `L = -PUSH s^power/(m s^2 + d s + k)`."""

    def opened(omega):
        s = 1j * omega
        return -PUSH * s**power / (mass * s**2 + DAMPING * s + stiffness)

    # |L| = 1 with x = omega^2: (k - m x)^2 + d^2 x = PUSH^2 x^power
    squares = np.array([mass**2, DAMPING**2 - 2.0 * mass * stiffness, stiffness**2])
    squares[2 - power] -= PUSH**2
    x = np.roots(squares)
    phases = np.degrees(np.angle(-opened(np.sqrt(x[x.imag == 0.0].real))))
    values = opened(np.geomspace(1e-2, 1e3, 20_000))
    disk = 2.0 / np.abs((1.0 - values) / (1.0 + values)).max()
    return [stiffness, None, mass][power] / PUSH, disk, phases[np.argmin(np.abs(phases))]


@pytest.mark.parametrize(
    ("model", "ends", "power", "where"),
    [
        (SPRUNG, ("torque:bus", "attitude", "torque_z", "attitude_z"), 0, 0.0),
        (SLIDING, ("force:bus", "felt", "force_x", "felt_x"), 2, np.inf),
    ],
)
@pytest.mark.slow
def test_limits_at_rest_and_at_infinite_frequency_and_signs_of_phases_count(
    model, ends, power, where
):
    """A push along, which a spring holds at rest, or an inertia at high frequency."""
    plant = bc.plant(mujoco.MjModel.from_xml_string(model), [ends[0]], [ends[1]])
    body = {"bus": bc.spec.UncertainBody(mass=uniform(0.2))} if power else {}
    uncertain = robust.uncertain(
        plant,
        bc.spec.UncertainCraft(
            joint={"drive": bc.spec.UncertainJoint(stiffness=uniform(0.2))}, body=body
        ),
    )
    controller = bc.spec.Controller(loop=(loop(*ends[2:], (-PUSH,)),))
    found = rows(uncertain.worst_margins(controller, samples=3), ends[2])
    shares = np.linspace(0.8, 1.2, 9)
    masses = MASS * (shares if power else np.ones(1))
    every = [pushed(m, STIFFNESS * k, power) for m, k in product(masses, shares)]
    gain, disk, phase = zip(*every, strict=True)
    nominal = pushed(MASS, STIFFNESS, power)
    assert found["gain up, factor"].nominal == pytest.approx(nominal[0], rel=FOUND)
    assert found["gain up, factor"].worst == pytest.approx(min(gain), rel=FOUND)
    assert found["gain up, factor"].frequency == where
    assert found["disk"].worst == pytest.approx(min(disk), rel=FOUND)
    assert found["phase"].nominal == pytest.approx(nominal[2], rel=FOUND)
    assert found["phase"].worst == pytest.approx(min(phase, key=abs), rel=FOUND)


def at_samples(stiffness, top, bottom, step, z):
    """Angle per torque that is held between samples, and the open loop of a law in z."""
    n = np.zeros((3, 3))
    n[:2] = [[0.0, 1.0, 0.0], [-stiffness / MASS, -DAMPING / MASS, 1.0 / MASS]]
    held = expm(n * step)
    x = np.linalg.solve(z[:, None, None] * np.eye(2) - held[:2, :2], held[:2, 2:])
    plant = x[:, 0, 0]
    return plant, plant * np.polyval(top, z) / np.polyval(bottom, z)


def test_sampled_loops_are_searched_at_their_samples():
    """A law in z at 0.25 s; the springs are 14 to 26 N m/rad."""
    step, top, bottom = 0.25, [60.0, -57.0], [1.0, -0.3]
    plant = bc.plant(mujoco.MjModel.from_xml_string(SPRUNG), ["torque:bus"], ["attitude"])
    joint = {"drive": bc.spec.UncertainJoint(stiffness=uniform(0.3))}
    uncertain = robust.uncertain(plant, bc.spec.UncertainCraft(joint=joint))
    law = {("torque_z", "attitude_z"): control.tf(top, bottom, step)}
    found = rows(uncertain.worst_margins(law, samples=3), "torque_z")
    gain = uncertain.worst_case(law, samples=3)
    z = np.exp(1j * np.geomspace(1e-3, np.pi, 40_000))
    every = [at_samples(k, top, bottom, step, z) for k in np.linspace(14.0, 26.0, 25)]
    disks = [2.0 / np.abs((1.0 - opened) / (1.0 + opened)).max() for _, opened in every]
    assert found["disk"].worst == pytest.approx(min(disks), rel=FOUND)
    assert min(disks) < 0.9 * found["disk"].nominal
    gains = [np.abs(seen / (1.0 + opened)).max() for seen, opened in every]
    assert gain.gain == pytest.approx(max(gains), rel=FOUND)
    assert gain.frequency < np.pi / step
    assert np.isnan(gain.simulated)
    again = bc.margins(uncertain.sample(found["disk"].values), law).loops[0]
    assert found["disk"].worst == pytest.approx(again.disk, rel=1e-6)
    # what a search went by
    loop = uncertain.loops(law)
    deltas = np.array([0.4])
    sizes, omega = loop.reach(deltas)
    moved = [np.log(loop.reach(deltas + h).sizes) for h in (1e-2, -1e-2)]
    for figure in np.flatnonzero(sizes > 0.1):
        slope = loop.slope(figure, deltas, omega[figure])
        assert slope[0] == pytest.approx((moved[0] - moved[1])[figure] / 2e-2, rel=2e-2, abs=2e-3)


def test_what_one_search_finds_counts_for_the_others():
    """Of two springs one is softer than the push; the margins are asked for with no sample that
    shows it, and are nothing all the same."""
    plant = bc.plant(mujoco.MjModel.from_xml_string(SPRUNG), ["torque:bus"], ["attitude"])
    joint = {"drive": bc.spec.UncertainJoint(stiffness=uniform(0.2))}
    uncertain = robust.uncertain(plant, bc.spec.UncertainCraft(joint=joint))
    push = bc.spec.Controller(loop=(loop("torque_z", "attitude_z", (-0.9 * STIFFNESS,)),))
    assert not uncertain.worst_case(push, samples=0).stable
    weak = bc.spec.Controller(loop=(loop("torque_z", "attitude_z", (-0.5 * STIFFNESS,)),))
    told = []
    assert uncertain.worst_margins(weak, samples=0).stable
    found = uncertain.worst_margins(push, samples=0, progress=told.append)
    assert not found.stable
    assert found.least().worst == 0.0
    # the nominal one, and then what the first search had found
    assert told == ["samples tried: 1", "samples tried: 2"]


def test_no_bound_is_sought_where_an_unstable_sample_is_found():
    """The push is stronger than the softest spring."""
    plant = bc.plant(mujoco.MjModel.from_xml_string(SPRUNG), ["torque:bus"], ["attitude"])
    joint = {"drive": bc.spec.UncertainJoint(stiffness=uniform(0.2))}
    uncertain = robust.uncertain(plant, bc.spec.UncertainCraft(joint=joint))
    push = bc.spec.Controller(loop=(loop("torque_z", "attitude_z", (-0.9 * STIFFNESS,)),))
    found = uncertain.worst_margins(push, samples=0, bound=True, seconds=1.0)  # corners alone
    assert not found.stable
    assert all(abs(delta) <= 1.0 for row in found for delta in row.deltas.values())
    assert found.bounds == {}
    rest = rows(found, "torque_z")
    assert rest["disk"].worst == rest["disk"].proved == rest["phase"].worst == 0.0
    assert rest["gain up, factor"].worst == 1.0
    assert rest["disk"].values["drive.stiffness"] < 0.9 * STIFFNESS


def test_a_file_of_an_uncertain_plant_is_its_craft_at_any_deltas(tmp_path):
    """Place per force of the slide: 1/(m s^2 + d s + k), closed here by deltas of m and k."""
    text = SLIDING.replace('<accelerometer name="felt" site="felt"/>', '<jointpos joint="drive"/>')
    text = text.replace("<jointpos", '<jointpos name="place"')
    plant = bc.plant(mujoco.MjModel.from_xml_string(text), ["force:bus"], ["place"])
    given = bc.spec.UncertainCraft(
        body={"bus": bc.spec.UncertainBody(mass=uniform(0.2))},
        joint={"drive": bc.spec.UncertainJoint(stiffness=uniform(0.3))},
    )
    uncertain = robust.uncertain(plant, given)
    found = np.load(uncertain.write(tmp_path / "m.npz"))
    names = [str(name) for name in found["QuantityName"]]
    assert sorted(names) == ["bus.mass", "drive.stiffness"]
    assert dict(zip(names, found["Nominal"], strict=True)) == {
        "bus.mass": MASS,
        "drive.stiffness": STIFFNESS,
    }
    assert dict(zip(names, found["Reach"], strict=True)) == pytest.approx(
        {"bus.mass": 0.2 * MASS, "drive.stiffness": 0.3 * STIFFNESS}
    )
    deltas = {"bus.mass": 0.7, "drive.stiffness": -0.4}
    of_block = [deltas[str(name)] for name in found["BlockName"]]
    assert [int(number) for number in found["QuantityBlock"]] == [
        1 + [str(name) for name in found["BlockName"]].index(name) for name in names
    ]
    delta = np.diag(np.repeat(of_block, found["BlockRepetitions"]))
    n = len(delta)
    row = [str(name) for name in found["OutputName"]].index("place")
    column = [str(name) for name in found["InputName"]].index("force_x")
    for s in (0.3 + 1.0j, 4.0j):
        m = found["C"] @ np.linalg.solve(s * np.eye(len(found["A"])) - found["A"], found["B"])
        m = m + found["D"]
        inner = delta @ np.linalg.solve(np.eye(n) - m[:n, :n] @ delta, m[:n, [column]])
        mass, stiffness = MASS * (1.0 + 0.2 * 0.7), STIFFNESS * (1.0 - 0.3 * 0.4)
        wanted = 1.0 / (mass * s**2 + DAMPING * s + stiffness)
        np.testing.assert_allclose((m[row, column] + m[[row], :n] @ inner)[0], wanted, rtol=1e-9)
    changed = uncertain.model({"bus.mass": 5.5, "drive.stiffness": 21.0})
    assert (changed.body_mass[1], changed.jnt_stiffness[0]) == (5.5, 21.0)
