"""Closed forms beside the slews of a spacecraft's hinges: which are turned, at which steps, and
what is stated of them."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import beamchain as bc
from beamchain.errors import EngineError
from formulas import (
    ModelOfSlew,
    Reference,
    SceneOfSlews,
    Seen,
    SlewBody,
    SlewRow,
    Trial,
    Turn,
    drift_of_momentum,
    drives_of_craft,
    finely_divided,
    modes_finely_divided,
    rk4_words,
    slew_warnings,
    slews_of_file,
    turns_of_hinge,
    wished_hinges,
)

JOINTS = """<mujoco><worldbody><body><freejoint/><geom size="1"/>
<body><joint name="sprung" stiffness="3"/><geom size="1"/></body>
<body><joint name="slides" type="slide"/><geom size="1"/>
<body><joint name="turns"/><joint name="tilts" axis="0 1 0"/><geom size="1"/>
<body><joint type="ball"/><geom size="1"/></body></body></body></body>
<body pos="9 0 0"><joint name="base"/><geom size="1"/></body></worldbody></mujoco>"""


def test_drives_are_hinges_between_bodies_without_a_spring():
    model = mujoco.MjModel.from_xml_string(JOINTS)
    found = [model.joint(j).name for j in drives_of_craft(model)]
    assert found == ["turns", "tilts"]


def test_hinges_are_wished_by_name():
    model = mujoco.MjModel.from_xml_string(JOINTS)
    drives = [model.joint(name).id for name in ("turns", "tilts")]
    assert wished_hinges(model, drives, ["tilts", "turns"]) == drives[::-1]
    assert wished_hinges(model, [*drives, *range(7)], []) == [*drives, 0, 1, 2, 3]
    with pytest.raises(bc.InputError, match="no hinge of that name.*those are: turns, tilts"):
        wished_hinges(model, drives, ["slides"])
    with pytest.raises(bc.InputError, match="the file has none"):
        wished_hinges(model, [], ["slides"])


def test_a_hinge_is_turned_as_little_as_its_range_lets_it():
    text = JOINTS.replace('name="turns"', 'name="turns" range="-4 5"')
    model = mujoco.MjModel.from_xml_string(text)
    found = turns_of_hinge(model, model.joint("turns").id, 3.0)
    assert np.degrees([turn.angle for turn in found]) == pytest.approx([5.0, 5.0])
    assert [turn.duration for turn in found] == [15.0, 30.0]
    held = mujoco.MjModel.from_xml_string(text.replace("-4 5", "0 1e-14"))
    held.jnt_range[held.joint("turns").id] = 0.0
    assert turns_of_hinge(held, held.joint("turns").id, 3.0) == []


def test_static_shapes_are_no_modes_to_divide():
    """Two of each load in bending, one in torsion; the rest three times."""
    assert modes_finely_divided(4, 1, "xy") == modes_finely_divided(6, 2, "xz") == 5 + 1
    assert modes_finely_divided(3, 1, "xz") == modes_finely_divided(2, 1, "torsion") == 3


def test_an_appendage_is_divided_in_the_ports_that_have_modes():
    """Without what a scene chooses by its band; imported modes stay as they are."""
    scene = bc.Scene(bandwidth=3.0, timestep=0.01)
    section = bc.Equivalent(
        bending_stiffness_xy=2e3, torsion_stiffness=500.0, linear_mass=4.0, polar_inertia=0.3
    )
    spec = bc.Spec(
        name="boom",
        segment=(bc.Segment(length=8.0, section=section),),
        port=(bc.spec.Port(name="end", x=0.5),),
        scene=scene,
    )
    target = {"xy": SimpleNamespace(modes=4), "torsion": SimpleNamespace(modes=2)}
    made = SimpleNamespace(spec=spec, fit=SimpleNamespace(target=target))
    found = finely_divided(made)
    assert found.modes == bc.Modes(xy=6, xz=0, torsion=3, axial=0)
    assert found.scene == bc.Scene(timestep=0.01)
    imported = SimpleNamespace(imported="modes")
    assert finely_divided(SimpleNamespace(spec=imported)) is imported


# -- steps -----------------------------------------------------------------------------------------
OSCILLATOR = """<mujoco><option timestep="0.01" integrator="Euler" gravity="0 0 0"/><worldbody>
<body><joint name="x" type="slide" stiffness="{stiffness}" damping="{damping}"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>{tendon}</mujoco>"""
MODE = """<tendon><fixed name="arm_mode1_xy" stiffness="1e6"><joint joint="x" coef="1"/></fixed>
</tendon>"""


def oscillator(stiffness=0.0, damping=0.0, tendon=""):
    text = OSCILLATOR.format(stiffness=stiffness, damping=damping, tendon=tendon)
    return mujoco.MjModel.from_xml_string(text)


def test_rk4_takes_a_step_up_to_a_share_of_its_limit():
    """Undamped it is stable up to sqrt(8) / w; to seven tenths of that the step is taken."""
    placed = ModelOfSlew(oscillator(stiffness=400.0), [0], [1])
    limit = np.sqrt(8.0) / 20.0
    found = placed.under_rk4(0.69 * limit)
    assert found.step == 0.69 * limit
    assert found.limit == pytest.approx(limit, rel=1e-3)
    # nothing of an appendage can be slowed
    found = placed.under_rk4(0.71 * limit)
    assert found.step == pytest.approx(0.7 * limit, rel=1e-3)
    assert found.limit == pytest.approx(limit, rel=1e-3)


def test_a_mode_too_fast_for_rk4_is_slowed_to_the_step():
    """1000 rad/s at 0.01 s; a kv as fast stays what it is."""
    placed = ModelOfSlew(oscillator(tendon=MODE), [0], [1])
    found = placed.under_rk4(0.01)
    assert found.step == 0.01
    assert 0.0102 < found.limit < 0.1
    assert found.model.tendon_armature[0] > 0.1
    assert placed.model.tendon_armature[0] == 0.0


@pytest.mark.parametrize(("part", "taken"), [(0.97, True), (0.99, False)])
def test_what_is_not_slowed_shortens_the_step_close_to_its_limit(part, taken):
    """A damper beside the mode: stable up to 2.785 m / d, of which 98 hundredths are taken."""
    limit = 0.01 / part
    damper = f"""<body><joint name="y" type="slide" damping="{2.78529 / limit}"/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>"""
    text = OSCILLATOR.format(stiffness=0.0, damping=0.0, tendon=MODE)
    model = mujoco.MjModel.from_xml_string(text.replace("</worldbody>", damper))
    found = ModelOfSlew(model, [0], [1]).under_rk4(0.01)
    assert found.limit == pytest.approx(limit, rel=1e-3)
    assert found.step == pytest.approx(0.01 if taken else 0.7 * limit, rel=1e-3)
    assert found.model.tendon_armature[0] > 0.1


def test_a_step_is_compared_with_twice_or_half_of_it():
    """Twice where that is within seven tenths of the limit."""
    for step, other in ((0.34, 0.68), (0.36, 0.18)):
        assert Reference(None, step, 1.0).compared().step == pytest.approx(other)
        assert Reference(None, 3.0 * step, 3.0).compared().step == pytest.approx(3.0 * other)


def test_what_limits_rk4_is_said():
    """Of a damper 2.785 m / d, and its name."""
    text = OSCILLATOR.format(stiffness=0.0, damping=0.0, tendon="").replace(
        "</mujoco>", '<actuator><velocity name="servo" joint="x" kv="500"/></actuator></mujoco>'
    )
    limit = 2.785 / 500.0
    words = rk4_words(Reference(mujoco.MjModel.from_xml_string(text), 0.7 * limit, limit))
    assert words.startswith(" (RK4 is stable up to 0.0056 s: the kv of ")
    assert "servo" in words


@pytest.mark.parametrize("step", ["step", "divided", "timestep"])
def test_a_slew_of_too_many_steps_is_refused(step):
    """400000 steps in the slew and one period after it, of the shortest."""
    for size, refused in ((1.01, False), (0.99, True)):
        steps = {"step": 1.0, "divided": 1.0, "timestep": 1.0}
        steps[step] = size * (37.0 + 3.0) / 400_000
        scene = SimpleNamespace(
            period=3.0,
            step=steps["step"],
            divided=SimpleNamespace(step=steps["divided"]),
            timestep=steps["timestep"],
            limited=" (why)",
        )
        if refused:
            with pytest.raises(EngineError, match=r"of 37 s takes .* of 9.9e-05 s \(why\); it was"):
                SceneOfSlews._check_length(scene, Turn(1.0, 37.0))
        else:
            SceneOfSlews._check_length(scene, Turn(1.0, 37.0))


@pytest.mark.parametrize(
    ("timestep", "period", "spacing", "samples"),
    [(0.01, 3.0, 0.1, 401), (0.013, 3.0, 0.104, 386), (0.5, 3.0, 0.5, 81), (0.01, 3.1, 0.1, 402)],
)
def test_a_slew_has_400_samples_on_its_own_steps(monkeypatch, timestep, period, spacing, samples):
    """Of 37 s and one period more; the hinge is turned on the rigid twin, the others held."""
    given = {}

    def drive(model, joint, held, turn, **more):
        given.update(more, model=model, joint=joint, held=held, turn=turn)
        return SimpleNamespace(qpos="qpos", qvel="qvel")

    monkeypatch.setattr("beamchain.craft.slews.drive_of", drive)
    twin, file = ModelOfSlew("twin", [7, 5, 6], [1]), ModelOfSlew("file", [0, 1, 2], [1])
    scene = SimpleNamespace(
        period=period, timestep=timestep, integrator="Euler", twin=twin, file=file, held=[0, 2],
        own="own", reference="reference",
        _look=lambda *what: what,
        _run_rk4=lambda *what: what,
        _run=lambda *what: what,
    )  # fmt: skip
    found = SceneOfSlews._trial(scene, 2, Turn(1.0, 37.0))
    assert given["spacing"] == pytest.approx(spacing)
    assert given["samples"] == samples
    assert (given["model"], given["joint"], given["held"]) == ("twin", 6, [7, 6])
    assert found.twin == (twin, 2, ("qpos", "qvel"))
    assert found.file == (file, 2, found.drive, "reference")
    assert found.own == (file._replace(model="own"), 2, found.drive, timestep, "Euler")


@pytest.mark.parametrize(
    ("is_own", "by", "mean"),
    [(True, "Euler", True), (True, "RK4", False), (False, "Euler", False), (False, "RK4", False)],
)
def test_means_of_inputs_are_for_the_file_at_its_own_step(monkeypatch, is_own, by, mean):
    given = {}

    def run(model, held, drive, integrator, per_sample, *, mean_input):
        given.update(held=held, by=integrator, count=per_sample, mean=mean_input)
        return "states"

    monkeypatch.setattr("beamchain.craft.slews.run", run)
    model = SimpleNamespace()
    scene = SimpleNamespace(own=model if is_own else None, held=[0, 2], _look=lambda *what: what)
    placed = ModelOfSlew(model, [7, 5, 6], [1])
    drive = SimpleNamespace(spacing=0.1)
    found = SceneOfSlews._run(scene, placed, 2, drive, 0.03, by)
    assert found == (placed, 2, "states")
    assert given == {"held": [7, 6], "by": by, "count": 4, "mean": mean}


BARE = """<mujoco><worldbody><body name="bus"><freejoint/><geom size="1"/>
<body><joint/><geom size="1"/><body><joint type="slide"/><geom size="1"/>
<body><joint type="ball"/><geom size="1"/></body></body></body></body>
<body pos="9 0 0"><joint/><geom size="1"/></body></worldbody></mujoco>"""
SITES = '<mujoco><option timestep="{}" integrator="{}"/><worldbody>{}</worldbody></mujoco>'


@pytest.mark.parametrize(
    ("timestep", "by", "limit", "wanted", "step", "other", "said"),
    [
        (0.01, "Euler", 9.0, 0.005, 0.005, 0.01, ""),  # 8 s / 1600
        (0.004, "Euler", 9.0, 0.004, 0.004, 0.008, ""),
        (0.004, "RK4", 9.0, 0.002, 0.002, 0.004, ""),  # it is no judge of itself
        # a shorter one than is wanted: twice or half of it
        (0.01, "Euler", 0.004, 0.005, 0.004, 0.002, " (why)"),
    ],
)
def test_steps_and_ports_of_the_craft_that_is_slewed(
    monkeypatch, timestep, by, limit, wanted, step, other, said
):
    """RK4 takes 1600 steps in the slowest period, and no longer ones than the file's own; ports
    that carry nothing are looked at, where all three models have them."""
    asked = []

    class Placed(SimpleNamespace):
        def under_rk4(self, step):
            asked.append((self.name, step))
            return Reference(self.name, min(step, limit), limit)

    def placed(_, marked, model):
        sites = {"file": ("end", "eye", "tip"), "fine": ("end", "eye"), "twin": ("eye", "end")}
        names = [f"arm_{name}" for name in sites[marked.name]]
        text = SITES.format(1, "Euler", "".join(f'<site name="{name}"/>' for name in names))
        return Placed(name=marked.name, given=model, model=mujoco.MjModel.from_xml_string(text))

    for name, stub in (
        ("joint_request", lambda specs: SimpleNamespace(tolerance=len(specs))),
        ("_divided", lambda a: f"divided {a.at}"),
        ("without_timing", lambda _: "untimed"),
        ("_rk4_words", lambda reference: " (why)" if reference.model == "fine" else ""),
    ):
        monkeypatch.setattr(f"beamchain.craft.slews.{name}", stub)
    monkeypatch.setattr(SceneOfSlews, "_placed", placed)
    monkeypatch.setattr(SceneOfSlews, "_seen_bodies", lambda *_: [1])
    spec = SimpleNamespace(further={"end": 1.0, "eye": 2.0, "tip": 3.0, "hand": 4.0, "leg": 5.0})
    arm = SimpleNamespace(at="arm", prefix="arm_", spec=spec, carries={"hand": ("palm",)})
    leg = SimpleNamespace(at="arm:leg", prefix="leg_", spec=SimpleNamespace(further={}), carries={})
    given = {}

    def with_specs(specs):
        given.update(specs)
        return SimpleNamespace(name="fine", compiled=lambda: "finely")

    marked = SimpleNamespace(
        name="file",
        craft=mujoco.MjModel.from_xml_string(BARE),
        appendages=[arm, leg],
        with_specs=with_specs,
        as_rigid=lambda: SimpleNamespace(name="twin", compiled=lambda: "rigid"),
    )
    model = mujoco.MjModel.from_xml_string(SITES.format(timestep, by, ""))
    scene = SceneOfSlews(marked, model, 8.0)
    assert given == {"arm": "divided arm", "arm:leg": "divided arm:leg"}
    assert (scene.file.given, scene.fine.given, scene.twin.given) == ("untimed", "finely", "rigid")
    assert asked[:2] == [("file", wanted), ("fine", 0.005)]
    assert (scene.step, scene.other.step) == pytest.approx((step, other))
    assert (scene.timestep, scene.integrator, scene.tolerance) == (timestep, by, 2)
    assert scene.limited == said
    assert scene.held == [1, 2]
    assert scene.ports == ["arm_end", "arm_eye"]


@pytest.mark.parametrize(
    ("count", "joints", "slewed_hinges"),
    [(3, (), [0, 1, 2]), (8, (), [0, 1, 2, 3, 4, 5]), (8, ("h7", "h2"), [7, 2])],
)
def test_hinges_are_slewed_in_every_turn_by_periods_of_the_slowest_mode(
    monkeypatch, count, joints, slewed_hinges
):
    """Of 0.5 rad/s: 5 and 10 periods by 90 degrees, 10 by 180; at most six hinges unless asked."""
    bodies = "".join(f'<body><joint name="h{i}"/><geom size="1"/></body>' for i in range(count))
    bare = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body><freejoint/><geom size="1"/>{bodies}</body></worldbody>
        </mujoco>"""
    )
    hinges = [bare.joint(f"h{i}").id for i in range(count)]
    said, slewn = [], []

    class Scene:
        def __init__(self, marked, model, period):
            self.bare, self.period, self.tolerance = marked.craft, period, None

        def slew(self, joint, name, turn):
            if name == "h2" and turn.angle > 2.0:
                raise EngineError("it blows up")
            slewn.append((joint, turn.angle, turn.duration))
            return name

    for name, stub in (
        ("read_bare", lambda _: (SimpleNamespace(), {"m": "wish"})),
        ("relocate", lambda *_: SimpleNamespace(text="text")),
        ("compile_model", lambda _: bare),
        ("marked_craft", lambda *_: SimpleNamespace(craft=bare)),
        ("_hinges", lambda _: hinges),
        ("_Scene", Scene),
    ):
        monkeypatch.setattr(f"beamchain.craft.slews.{name}", stub)
    found = slews_of_file(None, None, 0.5, said.append, joints)
    period = 4.0 * np.pi
    turns = [(np.pi / 2.0, 5.0 * period), (np.pi / 2.0, 10.0 * period), (np.pi, 10.0 * period)]
    wanted = [(hinges[i], *turn) for i in slewed_hinges for turn in turns]
    wanted.remove((hinges[2], *turns[2]))
    np.testing.assert_allclose(slewn, wanted)
    assert len(found.rows) == len(wanted)
    blown, *more = found.warnings
    assert "slew of h2: it blows up" in blown
    left = count > 6 and not joints
    assert len(more) == left
    if left:
        assert "only the first 6 hinges were slewed, not h6, h7; give joints" in more[0]
    of = len(slewed_hinges)
    assert said[1].endswith(f"by 90 degrees in 62.8 s (hinge 1 of {of}, slew 1 of 3)")
    assert said[-1].endswith(f"(hinge {of} of {of}, slew 3 of 3)")


# -- what is stated --------------------------------------------------------------------------------
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
OUT = np.array([2.0, 3.0, -6.0]) / 7.0


def motion(turns, moves, momentum, share, energy):
    """Two bodies, turned and moved by so much in the last of three samples."""
    rotations = np.broadcast_to(np.eye(3), (3, 2, 3, 3)).copy()
    places = np.zeros((3, 2, 3))
    for i in range(2):
        rotations[2, i] = Rotation.from_rotvec(turns[i] * AXIS).as_matrix()
        places[2, i] = moves[i] * OUT
    spun = np.zeros((3, 3))
    spun[1] = momentum * AXIS
    return Seen(rotations, places, spun, np.array([0.0, *share]), np.array(energy))


@pytest.mark.parametrize(("free", "factor"), [(True, 2.0), (False, 0.5)])
def test_a_row_states_what_elasticity_chains_and_step_do(free, factor):
    twin = motion((0.0, 0.0), (0.0, 0.0), 0.0, (9.0, 9.0), (0.0, 0.0, 0.0))
    file = motion((0.2, 0.3), (1.0, 4.0), 0.06, (4.0, -8.0), (0.0, 3.0, -5.0))
    fine = motion((0.21, 0.27), (1.1, 4.0), 9.0, (1.0, 1.0), (0.0, 9.0, 9.0))
    own = motion((0.26, 0.3), (1.3, 3.5), 0.3, (5.0, 2.0), (0.0, 4.0, -5.5))
    half = motion((0.203, 0.3), (1.0, 4.0), 0.0, (1.0, 1.0), (0.0, 9.0, 9.0))
    step, spacing = 0.01, 0.4
    bare = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="bus"><freejoint/><geom size="1"/></body>'
        '<body pos="9 0 0"><joint/><geom size="1"/></body></worldbody></mujoco>'
    )
    references = {"fine": Reference("fine", 1.0, 1.0), "other": Reference("other", 1.0, 1.0)}
    references["other"] = Reference("other", factor * step, 1.0)
    checked = []
    scene = SimpleNamespace(
        _check_length=checked.append,
        _trial=lambda joint, turn: Trial(SimpleNamespace(spacing=spacing), twin, file, own),
        _run_rk4=lambda placed, joint, drive, reference: {
            ("fine", "divided"): fine,
            ("file", "other"): half,
        }[placed, reference.model],
        fine="fine",
        file="file",
        divided=Reference("divided", 0.5, 1.0),
        other=references["other"],
        step=step,
        bodies=[0, 1] if free else [1, 0],
        _plain=[1, 2],
        ports=["port"],
        bare=bare,
        integrator="Euler",
        timestep=0.03,
    )
    scene.bodies = scene.bodies[:1]  # and the port
    turn = Turn(1.5, 20.0)
    row = SceneOfSlews.slew(scene, 4, "elbow", turn)
    assert checked == [turn]
    bus, port = row.bodies
    assert [bus.name, port.name] == ["bus" if free else "body 2", "port"]
    found = [list(vars(body).values())[1:] for body in (bus, port)]
    assert found[0] == pytest.approx([0.2, 1.0, 0.01, 0.1, 0.06, 0.3])
    assert found[1] == pytest.approx([0.3, 4.0, 0.03, 0.0, 0.0, 0.5], abs=1e-12)
    assert row.joint == "elbow"
    assert (row.angle, row.duration) == turn
    assert row.rate == turn.rate
    assert (row.integrator, row.timestep, row.step_rk4) == ("Euler", 0.03, step)
    if free:
        assert row.momentum == pytest.approx(0.3 / 5.0)
        assert row.momentum_rk4 == pytest.approx(0.06 / 8.0)
    else:
        assert row.momentum is row.momentum_rk4 is None
    assert row.energy == pytest.approx(1.0 / 5.0)
    # an error e h^4 differs by e h^4 (2^4 - 1) at twice the step
    assert row.error_rk4 == pytest.approx(0.003 / abs(factor**4 - 1.0), rel=1e-6)


def test_a_row_has_the_shares_of_its_worst_body():
    one = SlewBody("bus", 0.2, 5.0, 0.01, 0.1, 0.03, 1.0)
    other = SlewBody("hand", 0.4, 2.0, 0.01, 0.3, 0.02, 1.0)
    row = SlewRow("elbow", 1.0, 9.0, 0.3, "Euler", 0.1, (one, other), 0.1, 0.2, 0.3, 0.4, 0.5)
    assert (one.chain_share, other.chain_share) == pytest.approx((0.05, 0.15))
    assert row.chain_share == pytest.approx(0.15)
    assert row.step_share == pytest.approx(0.15)
    record = row.as_dict()
    assert record["chain_share"] == pytest.approx(0.15)
    assert record["bodies"][0]["step_share"] == pytest.approx(0.15)
    assert record["bodies"][1]["name"] == "hand"
    assert (record["joint"], record["momentum"], record["error_rk4"]) == ("elbow", 0.1, 0.5)


def test_drift_is_the_largest_change_over_the_largest_behind_the_hinge():
    found = motion((0.0, 0.0), (0.0, 0.0), 0.6, (-3.0, 2.0), (0.0, 0.0, 0.0))
    assert drift_of_momentum(found) == pytest.approx(0.2)


def slewed(joint, chain, step):
    body = SlewBody("bus", 1.0, 1.0, chain, 0.0, step, 0.0)
    return SlewRow(joint, np.pi / 2.0, 9.0, 0.3, "Euler", 0.1, (body,), 0.1, 0.2, 0.3, 0.4, 0.5)


@pytest.mark.parametrize(
    ("tolerance", "codes"),
    [(0.29, ["slew-chain", "slew-step"]), (0.31, ["slew-step"]), (0.41, []), (None, [])],
)
def test_the_worst_slew_is_said_beyond_the_tolerance(tolerance, codes):
    rows = [slewed("a", 0.1, 0.4), slewed("b", 0.3, 0.2)]
    found = slew_warnings(rows, tolerance)
    assert [each.code for each in found] == codes
    for each in found:
        joint, size = ("b", "0.3") if each.code == "slew-chain" else ("a", "0.4")
        assert str(each).startswith(f"{joint} by 90 degrees in 9 s: ")
        assert f"off by {size} " in str(each)
        assert f"the tolerance {tolerance:g}" in str(each)
    assert slew_warnings([], 0.1) == []
