"""A hand-made appendage on the bench: a body at the root, and one on two hinges, whose modes are
those of pendulums."""

import numpy as np
import pytest
from lxml import etree

from beamchain import PortModel
from beamchain.errors import EngineError
from formulas import measure

ROOT, ROOT_AT, ROOT_OWN = 2.0, 0.5, np.array([0.1, 0.2, 0.3])
TIP, ARM, TIP_OWN = 3.0, 0.8, np.array([0.25, 0.4, 0.6])
HINGE = 1.0
STIFF = {"xy": 30.0, "xz": 50.0}
DAMPED = {"xy": 0.6, "xz": 0.2}
CLOSE = 1e-9


def appendage(xz=50.0, dampers=("xy", "xz"), root=True):
    damping = {port: DAMPED[port] * (port in dampers) for port in DAMPED}
    inertial = f"""<inertial pos="{ROOT_AT} 0 0" mass="{ROOT}" diaginertia=".1 .2 .3"/>"""
    return etree.fromstring(
        f"""<mujoco><worldbody><body name="a_link1">{inertial if root else ""}
        <body name="a_link2" pos="{HINGE} 0 0">
        <joint name="a_h1_xy" axis="0 0 1" stiffness="30" damping="{damping["xy"]}"/>
        <joint name="a_h1_xz" axis="0 -1 0" stiffness="{xz}" damping="{damping["xz"]}"/>
        <inertial pos="{ARM} 0 0" mass="{TIP}" diaginertia=".25 .4 .6"/></body></body></worldbody>
        </mujoco>"""
    )


def rigid(root=True):
    """`(6, 6)` about the root of bodies on the axis."""
    out = np.zeros((6, 6))
    bodies = [(TIP, HINGE + ARM, TIP_OWN)] + [(ROOT, ROOT_AT, ROOT_OWN)] * root
    for mass, x, own in bodies:
        out += np.diag([mass, mass, mass, own[0], own[1] + mass * x**2, own[2] + mass * x**2])
        out[1, 5] += mass * x
        out[2, 4] -= mass * x
    return out + np.tril(out.T, -1)


def mode(port, stiffness=None):
    """Frequency, participation in the plane's displacement and rotation, and ratio."""
    own = TIP_OWN[2 if port == "xy" else 1]
    about = own + TIP * ARM**2
    row = np.array([TIP * ARM, own + TIP * ARM * (HINGE + ARM)]) / np.sqrt(about)
    w = np.sqrt((STIFF[port] if stiffness is None else stiffness) / about)
    return w, row, DAMPED[port] / about / (2.0 * w)


@pytest.mark.parametrize("blocks", [[["xy"], ["xz"], ["torsion"]], [["xy", "xz"]], [["xz"]]])
def test_ports_of_an_appendage_on_the_bench(blocks):
    found = measure(appendage(), blocks, timestep=0.01)
    assert found.rigid_mass == pytest.approx(rigid(), abs=1e-9)
    named = {port for block in blocks for port in block}
    assert set(found.lost) == named
    assert max(found.lost.values()) < 1e-6
    for port in named - {"torsion"}:
        w, row, ratio = mode(port)
        model = found.ports[port]
        assert model.frequencies == pytest.approx([w], rel=CLOSE)
        assert np.abs(model.participation) == pytest.approx(np.abs(row[None]), rel=1e-8)
        assert model.damping == pytest.approx([ratio], rel=1e-7)
    if "torsion" in named:
        assert found.ports["torsion"].rigid_mass == pytest.approx(np.array([[0.35]]), rel=CLOSE)
        assert found.ports["torsion"].modes == 0
    labels = [model.labels for model, _ in found.blocks]
    assert labels[0] == ((blocks[0][0],) if len(blocks[0]) == 1 else ("", ""))
    assert set(found.couplings) == {
        f"{a[0]}, {b[0]}" for i, a in enumerate(blocks) for b in blocks[i + 1 :]
    }
    assert found.coupling < 1e-6


def test_where_a_and_b_have_lost_digits_bodies_are_read_one_by_one(monkeypatch):
    """Where they say nothing, or a frequency that is off by a thousandth."""

    def nothing(*_):
        raise EngineError("no modes.")

    def off(*_):
        w, row, ratio = mode("xy")
        plane = rigid()[np.ix_([1, 5], [1, 5])]
        return PortModel(plane, np.array([1.001 * w]), row[None], np.array([ratio]))

    for found_by, port, lost in ((nothing, "xy", 1.0), (nothing, "xz", 1.0), (off, "xy", 1e-3)):
        monkeypatch.setattr("beamchain.engine.bench._from_linearisation", found_by)
        found = measure(appendage(dampers=("xy",)), [[port]], timestep=0.01)
        w, row, ratio = mode(port)
        assert found.lost[port] == pytest.approx(lost, rel=1e-2)
        assert found.ports[port].frequencies == pytest.approx([w], rel=CLOSE)
        assert np.abs(found.ports[port].participation) == pytest.approx(np.abs(row[None]), rel=1e-8)
        wanted = [ratio] if port == "xy" else [0.0]
        assert found.ports[port].damping == pytest.approx(wanted, rel=1e-7, abs=0.0)


def test_the_plane_xz_turns_about_minus_y():
    found = measure(appendage(), [["xy", "xz"]], timestep=0.01)
    ((model, motions),) = found.blocks
    assert motions == [1, 2, 4, 5]
    assert model.rigid_mass == pytest.approx(rigid()[np.ix_(motions, motions)], rel=CLOSE)
    by_frequency = sorted((mode(port)[0], port) for port in STIFF)
    for (_, port), row in zip(by_frequency, model.participation, strict=True):
        wanted = np.zeros(4)
        values = mode(port)[1]
        if port == "xy":
            wanted[[0, 3]] = values
        else:
            wanted[[1, 2]] = values * [1.0, -1.0]
        assert np.sign(row @ wanted) * row == pytest.approx(wanted, abs=1e-8)


def test_modes_of_equal_frequency_stay_in_their_planes():
    """xz as stiff as makes it as fast."""
    xz = mode("xy")[0] ** 2 * (TIP_OWN[1] + TIP * ARM**2)
    found = measure(appendage(xz=xz, dampers=()), [["xy", "xz"]], timestep=0.01)
    ((model, _),) = found.blocks
    rows = np.abs(model.participation)
    planes = np.array([[1, 0, 0, 1], [0, 1, 1, 0]], dtype=bool)
    for row in rows:
        assert min(np.max(row[plane]) for plane in planes) < 1e-8
    both = model.participation.T @ model.participation
    first, second = mode("xy")[1], mode("xz", xz)[1] * [1.0, -1.0]
    wanted = np.zeros((4, 4))
    wanted[np.ix_([0, 3], [0, 3])] = np.outer(first, first)
    wanted[np.ix_([1, 2], [1, 2])] = np.outer(second, second)
    assert both == pytest.approx(wanted, abs=1e-7)


def test_a_massless_root_is_carried_by_ballast_that_is_taken_off():
    ballast = np.array([5.0, 2.0, 3.0, 4.0])
    found = measure(
        appendage(root=False), [["xy"], ["xz"], ["torsion"]], timestep=0.01, ballast=ballast
    )
    assert found.rigid_mass == pytest.approx(rigid(root=False), abs=1e-8)
    assert max(found.lost.values()) < 1e-6
    for port, (displacement, rotation) in {"xy": (1, 5), "xz": (2, 4)}.items():
        model = found.ports[port]
        own = rigid(root=False)[np.ix_([displacement, rotation], [displacement, rotation])]
        assert np.abs(model.rigid_mass) == pytest.approx(np.abs(own), abs=1e-8)
        assert model.frequencies == pytest.approx([mode(port)[0]], rel=CLOSE)
    assert found.ports["torsion"].rigid_mass == pytest.approx(np.array([[0.25]]), abs=1e-9)


def test_motions_without_inertia_are_left_out():
    found = measure(appendage(), [["xy", "torsion"]], timestep=0.01, live=(0, 1, 2, 4, 5))
    ((model, motions),) = found.blocks
    assert motions == [1, 5]
    assert model.rigid_mass.shape == (2, 2)
    assert set(found.lost) == {"xy"}
    assert found.motion.motions == 5


@pytest.mark.parametrize("dampers", [(), ("xz",)])
def test_a_damped_joint_makes_a_whole_damping_matrix(dampers):
    blocks = [["xy"], ["xz"]]
    found = measure(appendage(dampers=dampers), blocks, timestep=0.01)
    assert (found.coupled is None) == (not dampers)
    if not dampers:
        assert found.damped_motion is found.motion
        return
    assert found.damped_motion is found.coupled
    w, row, ratio = mode("xz")
    k = int(np.argmin(np.abs(found.coupled.frequencies - w)))
    wanted = np.zeros((2, 2))
    wanted[k, k] = 2.0 * ratio * w
    assert found.coupled.damping_matrix == pytest.approx(wanted, abs=1e-9)
    seen = found.coupled.participation[k]
    assert np.sign(seen[2]) * seen == pytest.approx([0, 0, row[0], 0, -row[1], 0], abs=1e-9)
    assert found.coupled.rigid_mass == pytest.approx(rigid(), abs=1e-9)
