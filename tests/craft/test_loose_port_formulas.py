"""A spacecraft whose ports are loose: its matrices over its own motion and that of the ports
against energies of bodies and springs, written out."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

import beamchain as bc
from formulas import (
    AppendageOnLoad,
    LoadOfPort,
    OperatingPoint,
    Root,
    carrying_of,
    craft_from_text,
    exact_craft,
    loads_of,
    loose_craft,
    mount,
    root_frame,
)
from specs import spec_of

TEXT = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus" pos="0.1 0.2 0.3"
euler="10 -30 20"><freejoint/><inertial pos="0.1 0 0" mass="30" diaginertia="9 8 7"/>
<site name="left" pos="0.5 0.3 0" euler="20 0 60"/>
<site name="right" pos="0 -0.6 0.1" euler="0 40 -90"/>
<body name="elbow" pos="1 1.2 0.1" euler="5 6 7"><joint name="elbow" axis="0 1 0.3" stiffness="40"
damping="0.7"/><inertial pos="0.2 0.1 0" mass="4" diaginertia="0.3 0.2 0.4"/>
<body name="hand" pos="0.5 0 0.2"><joint name="hand" type="slide" axis="1 0.2 0" stiffness="9"/>
<inertial pos="0 0 0.1" mass="2" diaginertia="0.1 0.2 0.2"/></body></body>
<body name="pod" pos="0.3 -1.5 0"><inertial pos="0 0.1 0" mass="3" diaginertia=".4 .5 .6"/></body>
</body></worldbody><keyframe><key name="k" qpos="0 0 0 1 0 0 0 0 0"/></keyframe></mujoco>"""
ON = {"left": ("end", 1.2, "elbow"), "right": ("tip", 0.9, "pod")}


@pytest.fixture(scope="module")
def loose():
    """The bare craft, its pose, the roots of two appendages and what carries them loosely."""
    model = mujoco.MjModel.from_xml_string(TEXT)
    qpos = np.array(model.qpos0)
    qpos[:3], qpos[7:] = [0.3, -0.1, 0.2], [0.4, -0.15]
    qpos[3:7] = Rotation.from_rotvec([0.3, 0.2, -0.5]).as_quat(scalar_first=True)
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    roots, appendages = [], []
    for at, (port, x, body) in ON.items():
        place = mount(model, at, "site", at)
        origin, axes = root_frame(place, data)
        both = np.zeros((2, 3, model.nv))
        mujoco.mj_jac(model, data, both[0], both[1], origin, 1)
        motion = np.vstack([axes.T @ both[0], axes.T @ both[1]])
        bodies = (2, 3) if body == "elbow" else (4,)
        roots.append(Root(at, origin, axes, motion, (LoadOfPort(x, bodies, ()),)))
        spec = SimpleNamespace(further={port: x})
        appendages.append(SimpleNamespace(at=at, carries={port: (body,)}, spec=spec, mount=place))
    embedded = SimpleNamespace(document=craft_from_text(TEXT), appendages=appendages)
    return model, data, roots, loose_craft(embedded, roots), embedded


def test_its_ports_are_loose_and_the_rest_as_it_was(loose):
    model, data, _, made, _ = loose
    assert made.model.nv == model.nv + 12
    assert len(made.own) == model.nv
    assert made.ports.shape == (model.nv + 12, 12)
    assert np.all(made.ports[made.own] == 0.0)
    assert np.all(made.ports.sum(axis=0) == 1.0)
    point = made.point(OperatingPoint(model, data.qpos.copy(), np.arange(1.0, 9.0)))
    there = mujoco.MjData(point.model)
    there.qpos[:] = point.qpos
    mujoco.mj_forward(point.model, there)
    for name in ("bus", "elbow", "hand", "pod"):
        np.testing.assert_allclose(there.body(name).xipos, data.body(name).xipos, atol=1e-12)
        np.testing.assert_allclose(there.body(name).ximat, data.body(name).ximat, atol=1e-12)
    assert point.qvel[made.own].tolist() == list(range(1, 9))
    assert np.count_nonzero(point.qvel) == 8


def test_its_matrices_are_over_its_own_motion_and_that_of_its_ports(loose):
    """The mass is MuJoCo's and that of what the ports move; springs and dampers are its own."""
    model, data, roots, made, _ = loose
    point = made.point(OperatingPoint(model, data.qpos.copy(), np.zeros(model.nv)))
    linear = made.linear(point, [], [])
    own = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, own)
    wanted = carrying_of(model, data, roots).mass.copy()
    wanted[: model.nv, : model.nv] += own
    np.testing.assert_allclose(linear.mass, wanted, atol=1e-9)
    stiffness, damping = np.zeros_like(wanted), np.zeros_like(wanted)
    stiffness[6, 6], stiffness[7, 7], damping[6, 6] = 40.0, 9.0, 0.7
    # what a spring holds turns with the port, so that its own motion alone strains it
    np.testing.assert_allclose(linear.damping, damping, atol=1e-7)
    np.testing.assert_allclose(linear.stiffness[:, 6:8], stiffness[:, 6:8], atol=1e-6)
    names = [name for name, _ in linear.coordinates]
    assert names[8:] == [f"port {k}" for k in range(1, 13)]


def test_the_exact_plant_moves_what_its_modes_carry(loose, monkeypatch):
    """Over the spacecraft's own motion and the modes, which move the ports by their tips."""
    model, data, roots, _, embedded = loose
    random = np.random.default_rng(8)
    rigid = np.diag([9.0, 9.0, 9.0, 3.0, 30.0, 30.0])
    rows, tips = random.uniform(-0.7, 0.7, (2, 2, 6))
    frequencies, ratios = np.array([[2.0, 3.0], [4.0, 7.0]]), np.array([[0.01, 0.02], [0.03, 0.04]])
    wholes = [
        bc.PortModel(
            rigid,
            frequencies[i],
            rows[pick],
            ratios[i],
            tip=tips[pick],
            points=(roots[i].loads[0].x,),
        )
        for i, pick, x in ((0, [0, 1], 1.2), (1, [1, 0], 0.9))
    ]
    items = []
    for i, (a, root) in enumerate(zip(embedded.appendages, roots, strict=True)):
        measured = SimpleNamespace(rigid_mass=rigid)
        a.fit = SimpleNamespace(body=wholes[i], kept=None, measured=measured)
        a.prefix = f"{a.at}_"
        items.append(
            SimpleNamespace(
                mount=a.mount, loads=root.loads, dofs=[8 + i], band={"xy": 9.0}, whole=wholes[i]
            )
        )
    module = "beamchain.craft.linear_craft"
    monkeypatch.setattr(f"{module}.carried", lambda *_: items)
    monkeypatch.setattr(f"{module}.exact_appendage", lambda body, *_: SimpleNamespace(model=body))
    embedded.model, embedded.craft = SimpleNamespace(nv=10), model
    embedded.bare_qpos = lambda qpos: qpos
    point = SimpleNamespace(qpos=data.qpos.copy(), qvel=np.zeros(10))
    found = exact_craft(embedded, point, ["torque:bus"], ["attitude"], 1.0)
    mass = np.zeros((8, 8))
    mujoco.mj_fullM(model, data, mass)
    mass += sum(root.motion.T @ rigid @ root.motion for root in roots)
    pairs = zip(wholes, roots, strict=True)
    pushed = np.vstack([one.participation @ root.motion for one, root in pairs])
    mass = np.block([[mass, pushed.T], [pushed, np.eye(4)]])
    by_modes = block_diag(np.eye(8), *(one.tip.T for one in wholes))
    mass += by_modes.T @ carrying_of(model, data, roots).mass @ by_modes
    np.testing.assert_allclose(found.linear.mass, mass, atol=1e-8)
    w, z = frequencies.ravel(), ratios.ravel()
    squares = np.array([*np.zeros(6), 40.0, 9.0, *w**2])
    damping = np.diag([*np.zeros(6), 0.7, 0.0, *(2.0 * z * w)])
    np.testing.assert_allclose(found.linear.damping, damping, atol=1e-6)
    np.testing.assert_allclose(found.linear.stiffness[:, 6:], np.diag(squares)[:, 6:], atol=1e-5)
    assert [each.name for each in found.linear.coordinates[6:8]] == ["elbow", "hand"]
    assert len(found.names) == 6


def test_a_port_carries_all_that_hangs_on_what_it_carries():
    """An arm with a hand and a tool on its end, and a boom on its middle, on whose end another one
    and an eye stand; a grip is on the tool, a lens on the eye."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="bus"><freejoint/><geom size="1"/>
        <body name="hand"><geom size="1"/><body name="tool"><geom size="1"/></body></body>
        <body name="eye"><geom size="1"/></body><body name="mast"><geom size="1"/></body></body>
        </worldbody></mujoco>"""
    )
    section = {"shape": "equivalent", "bending_stiffness_xy": 900.0, "linear_mass": 1.0}

    def item(body, ports=(), **carries):
        table = {"name": "boom", "segment": [{"length": 3.0, "section": section}]}
        if ports:
            table["port"] = [{"name": name, "x": x} for name, x in ports]
        return AppendageOnLoad(model.body(body).id, spec_of(table), carries)

    found = loads_of(
        model,
        {
            "arm": item("bus", [("end", 3.0), ("mid", 1.5), ("bare", 2.0)], end=("hand",)),
            "grip": item("tool"),
            "arm:mid": item("bus", [("end", 3.0)], end=("eye",)),
            "arm:mid:end": item("bus"),
            "lens": item("eye"),
            "other": item("mast", [("end", 3.0)]),
        },
    )
    hand, tool, eye = (model.body(name).id for name in ("hand", "tool", "eye"))
    ends = ("arm:mid:end", "lens")
    (end, mid), (inner,) = found["arm"], found["arm:mid"]
    assert end == (3.0, (hand, tool), ("grip",))
    assert (mid.x, mid.bodies) == (1.5, (eye,))
    assert sorted(mid.places) == sorted(("arm:mid", *ends))
    assert (inner.x, inner.bodies) == (3.0, (eye,))
    assert sorted(inner.places) == sorted(ends)
    assert [found[name] for name in ("grip", "arm:mid:end", "lens", "other")] == [()] * 4
