"""Closed forms beside what an appendage would be with one mode more, what may cure a craft, what a
step makes of it, and what a load makes of a liquid: uniform booms across a bus."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.special import jnp_zeros

import beamchain as bc
from formulas import (
    Loading,
    RetimedCraft,
    Setting,
    Slosh,
    base_place,
    bent_keyframes,
    candidate_of,
    carries_of,
    changes_of,
    error_of_step,
    liquid_cautions,
    models_at_setting,
    more_modes,
    mount,
    numbered,
    retime_craft,
    split_port,
    with_liquids_sprung,
)

STIFF, LINE, LENGTH = 2e3, 4.0, 8.0  # N m^2, kg/m, m
CLAMPED = np.array([1.8751040687, 4.6940911330, 7.8547574382])
BENT = CLAMPED**2 * np.sqrt(STIFF / LINE) / LENGTH**2  # rad/s
TURNED = np.array([1.0, 3.0, 5.0]) * np.pi / 2.0 * np.sqrt(500.0 / 0.3) / LENGTH
CRAFT = """<mujoco><option gravity="0 0 0" timestep="{}"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0.1 0 0" mass="300" diaginertia="90 80 70"/>
<site name="left" pos="0 0.5 0" euler="0 0 90"/><site name="right" pos="0 -0.5 0" euler="0 0 -90"/>
</body></worldbody></mujoco>"""


def boom(scene=True, **more):
    """Bends in two planes and twists."""
    section = bc.Equivalent(
        bending_stiffness_xy=STIFF, torsion_stiffness=500.0, linear_mass=LINE, polar_inertia=0.3
    )
    if scene:
        more["scene"] = bc.Scene(bandwidth=0.5, tolerance=0.05, axes=("z",))
    return bc.Spec(name="boom", segment=(bc.Segment(length=LENGTH, section=section),), **more)


def embedded(step=0.01, **specs):
    return bc.embed(CRAFT.format(step), specs, retime=False)


@pytest.fixture(scope="module")
def pair():
    return embedded(left=boom(), right=boom())


def test_one_mode_more_of_every_port(pair):
    """Cantilever frequencies by the roots of cos cosh = -1, and those of a rod in torsion."""
    a = pair.appendages[0]
    now = candidate_of(a)
    assert (now.modes, now.kept.counts, now.added) == (1, {"xy": 1}, "")
    assert now.measured is a.fit.measured.space
    assert now.model is now.measured
    assert now.model.frequencies == pytest.approx(BENT[:1], rel=1e-4)
    more = now.offers(9.0)
    assert {port: one.newest for port, one in more.items()} == pytest.approx(
        {"xy": BENT[1], "xz": BENT[0], "torsion": TURNED[0]}, rel=1e-4
    )
    for port, one in more.items():
        assert (one.modes, one.measured) == (2, None)
        wanted = {"xy": 1, "xz": 0, "torsion": 0}
        wanted[port] += 1
        assert one.kept.counts == {axis: count for axis, count in wanted.items() if count}
        assert {axis: getattr(one.stated.modes, axis) for axis in wanted} == wanted
        assert one.stated.root == bc.spec.Root(target=a.fit.kept_for, hub=a.hub)
        assert one.added == f"mode {wanted[port]} in {port}"
    third = more["xy"].offers(9.0)["xy"]
    assert (third.modes, third.newest) == (3, pytest.approx(BENT[2], rel=1e-4))
    assert third.model.frequencies == pytest.approx(BENT, rel=1e-4)
    both = third.offers(9.0)["torsion"]
    lowest = np.sort([*BENT, TURNED[0]])
    assert both.model.frequencies == pytest.approx(lowest, rel=1e-4)


def test_all_modes_but_those_of_one_port(pair):
    now = candidate_of(pair.appendages[0])
    left = now.without("xy").frequencies
    every = np.sort([*BENT, *BENT, *TURNED])  # of both planes
    once = np.sort([BENT[0], *BENT, *TURNED])
    below = every < BENT[2]
    count = int(np.sum(once < BENT[2]))
    assert left[:count] == pytest.approx(once[:count], rel=1e-4)
    whole = now.without("none").frequencies
    assert whole[: int(below.sum())] == pytest.approx(every[below], rel=1e-4)


def test_changes_that_may_help(pair):
    """Equal appendages together; of one mode more the two that leave the least error."""
    exact, places = pair._exact_poses, ["left", "right"]
    found = changes_of(pair.appendages, places, exact)
    assert len(found) == 2
    counts = []
    for specs in found.values():
        assert sorted(specs) == places
        assert specs["left"] == specs["right"]
        modes = specs["left"].modes
        counts.append((modes.xy, modes.xz, modes.torsion))
    # about z only the bend in the plane of the bus is felt
    assert counts[0] == (2, 0, 0)
    assert set(counts[1:]) < {(1, 1, 0), (1, 0, 1)}
    for specs in changes_of(pair.appendages, ["right"], exact).values():
        assert list(specs) == ["right"]


@pytest.mark.slow
def test_typed_numbers_and_dampers_on_hinges_are_changes_as_well():
    hinged = bc.Damping(ratio=0.01, form="hinge")
    one = embedded(
        left=boom(modes=bc.Modes(xy=1)), right=boom(damping=hinged, modes=bc.Modes(xy=1))
    )
    found = list(changes_of(one.appendages, ["left", "right"], one._exact_poses).values())
    assert len(found) == 5
    assert found[0]["right"].damping.form == "modal"
    assert [list(each) for each in found[-2:]] == [["left"], ["right"]]
    assert [each.modes for last in found[-2:] for each in last.values()] == [None, None]
    for specs in found[1:3]:
        assert sum(specs[next(iter(specs))].modes.given().values()) == 2
    still = embedded(left=boom(False, modes=bc.Modes(xy=1)))
    (more, other) = changes_of(still.appendages, ["left"], still._exact_poses).values()
    assert more["left"].modes is not None
    assert other["left"].modes is not None


def test_more_modes_are_allowed_where_all_that_may_be_are_kept(pair):
    assert list(more_modes(pair.appendages, 1).values()) == [2]
    assert more_modes(pair.appendages, 2) == {}
    assert more_modes(pair.appendages, 0) == {}
    long = embedded(left=boom(modes=None, scene=False, fit=bc.spec.FitOptions()))
    most = candidate_of(long.appendages[0]).modes
    assert most > 1
    assert list(more_modes(long.appendages, most).values()) == [2 * most]


@pytest.mark.parametrize(
    ("step", "timing", "timed"),
    [(0.001, None, False), (0.001, True, True), (0.3, False, False), (1.8, None, True)],
)
def test_models_at_another_step(pair, step, timing, timed):
    """Euler without damping is unstable beyond 2 / w."""
    asked = []

    def build(appendages):
        asked.append([sum(t.stiffness > 0.0 for t in a.fit.chain.tendons) for a in appendages])
        return pair._compiled(appendages)

    plain, other = models_at_setting(
        Setting("Euler", step, timing), pair.model, pair.appendages, build, joints=False
    )
    assert plain is not pair.model
    assert plain.opt.timestep == step
    assert plain.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert pair.model.opt.timestep == 0.01
    assert (other is not None) == timed
    if timed:
        assert other.opt.timestep == step
        assert asked in ([], [[1, 1]])


# -- steps -----------------------------------------------------------------------------------------
SLIDES = """<mujoco><option gravity="0 0 0" timestep="0.02" integrator="Euler"/><worldbody>
<body><joint type="slide" stiffness="8" damping="0.08"/><inertial pos="0 0 0" mass="2"
diaginertia="1 1 1"/></body><body><joint type="slide" stiffness="75"/><inertial pos="0 0 0"
mass="3" diaginertia="1 1 1"/></body></worldbody>
<keyframe><key name="there" qpos="0.2 0.1"/></keyframe></mujoco>"""


def of_euler(mass, damping, stiffness, h):
    """Poles of `v' = v + h a, (m + h d) a = -k q - d v, q' = q + h v'` and the exact ones."""
    pull, drag = np.array([stiffness, damping]) * h / (mass + h * damping)
    z = np.linalg.eigvals([[1.0 - h * pull, h - h * drag], [-pull, 1.0 - drag]])
    found = np.log(z.astype(complex)) / h
    exact = np.roots([mass, damping, stiffness]).astype(complex)
    upper = found[np.argmax(found.imag)], exact[np.argmax(exact.imag)]
    return abs(upper[0] - upper[1]) / abs(upper[1])


@pytest.mark.parametrize(
    ("bands", "tolerances", "allowed"),
    [((3.0, None), (0.03, 0.01), 0.003), ((3.0, 1.5), (0.03, 0.02), 0.002), ((), (), 1e-4)],
)
def test_error_of_a_step_in_the_band_and_beyond(bands, tolerances, allowed):
    """At 2 rad/s, of ratio 0.01, and 5 rad/s, undamped: 0.04 where none is."""
    model = mujoco.MjModel.from_xml_string(SLIDES)
    scenes = [
        SimpleNamespace(bandwidth=band, tolerance=most)
        for band, most in zip(bands, tolerances, strict=True)
    ]
    appendages = [
        SimpleNamespace(
            fit=SimpleNamespace(spec=SimpleNamespace(scene=scene)),
            spec=SimpleNamespace(undamped_ratio=ratio),
        )
        for scene, ratio in zip([*scenes, None, None], (0.04, 0.3, 0.04, 0.3), strict=False)
    ]
    slow, fast = of_euler(2.0, 0.08, 8.0, 0.02), of_euler(3.0, 0.0, 75.0, 0.02)
    share = (3.0 / 5.0) ** 2
    changed = [100.0 * slow, 2.0 * share / (1.0 - share) * fast] if scenes else [slow, fast]
    error, most = error_of_step(model, appendages)
    assert error == pytest.approx(max(changed), rel=1e-5)
    assert most == pytest.approx(allowed)
    model.opt.timestep = 0.41  # beyond 2 / w
    assert error_of_step(model, appendages)[0] == np.inf
    free = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>'
    )
    assert error_of_step(free, appendages) == (0.0, pytest.approx(allowed))


# -- liquids ---------------------------------------------------------------------------------------
TANK = """<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="9"
diaginertia="1 1 1"/><site name="tank" euler="0 -90 0"/><body><joint stiffness="3"/>
<joint type="slide" stiffness="5"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
</body></worldbody>
<keyframe><key name="burn" qpos="0 0 0 1 0 0 0 0 0"/></keyframe></mujoco>"""


def loading(*field):
    nothing = np.zeros(0)
    return Loading(np.zeros(3), nothing, nothing, np.array(field), 0, nothing)


def tank(model, springs=(0.7, 0.2)):
    place = mount(model, "tank", "site", "tank")  # its x is the z of the bus
    return SimpleNamespace(mount=place, springs=springs and np.array(springs), dofs=[6, 7])


def codes(given, *items):
    model = mujoco.MjModel.from_xml_string(TANK)
    items = items or (tank(model),)
    return [each.code for each in liquid_cautions(model, items, given)]


@pytest.mark.parametrize(
    ("degrees", "code"), [(0.0, []), (9.9, []), (10.1, ["slosh-tilt"]), (89.0, ["slosh-tilt"])]
)
def test_how_far_a_load_pulls_a_liquid_off_its_axis(degrees, code):
    """What is felt points against the axis."""
    angle = np.radians(degrees)
    felt = loading(0.2 * np.sin(angle), 0.0, -0.2 * np.cos(angle))
    assert codes({("burn", 1): felt}) == ["slosh-weightless", *code]
    assert codes({("rest", 1): felt, ("burn", 1): felt}) == 2 * code
    # seen from a bus that is turned
    model = mujoco.MjModel.from_xml_string(TANK)
    model.key_qpos[0, 3:7] = [np.cos(angle / 2.0), 0.0, -np.sin(angle / 2.0), 0.0]
    down = {("burn", 1): loading(0.0, 0.0, -3.0)}
    found = [each.code for each in liquid_cautions(model, [tank(model)], down)]
    assert found == ["slosh-weightless", *code]


def test_a_liquid_that_is_lifted_off_the_bottom_is_refused():
    for field in ((0.0, 0.0, 0.2), (0.2, 0.0, 0.0), (0.2, 0.0, -1e-11)):
        with pytest.raises(bc.InputError, match="tank at burn"):
            codes({("burn", 1): loading(*field)})
    assert codes({("burn", 1): loading(0.2, 0.0, -1e-9)})[-1] == "slosh-tilt"
    assert codes(None) == ["slosh-weightless"]
    model = mujoco.MjModel.from_xml_string(TANK)
    assert codes({}, tank(model, None)) == []


def test_liquids_on_springs():
    model = mujoco.MjModel.from_xml_string(TANK)
    found = with_liquids_sprung(model, [tank(model)])
    assert np.ravel(found.jnt_stiffness) == pytest.approx([0.0, 3.7, 5.2])
    assert np.ravel(model.jnt_stiffness) == pytest.approx([0.0, 3.0, 5.0])
    assert with_liquids_sprung(model, [tank(model, None)]) is model


def test_a_pendulum_more():
    """sqrt(a xi / R tanh(xi h / R)), of each lateral mode twice."""
    tank = Slosh(
        shape="cylinder", radius=0.6, height=0.9, density=800.0, ratio=0.01, acceleration=2.5
    )
    text = CRAFT.format(0.01).replace('euler="0 0 90"', 'euler="0 -90 0"')
    made = bc.embed(text, {"left": bc.Spec(name="tank", slosh=tank)})
    a = made.appendages[0]
    now = candidate_of(a)
    xi = jnp_zeros(1, 12)
    wanted = np.sqrt(2.5 * xi / 0.6 * np.tanh(xi * 0.9 / 0.6))
    count = now.modes // 2
    assert now.modes == 2 * count
    assert (now.measured, now.added) == (a.fit.measured.space, "")
    ((offer, more),) = now.offers(9.0).items()
    assert (more.modes, more.measured) == (2 * count + 2, None)
    assert more.added == f"pendulum {count + 1}"
    assert more.newest == pytest.approx(wanted[count], rel=1e-6)
    assert more.model.frequencies == pytest.approx(np.repeat(wanted[: count + 1], 2), rel=1e-6)
    assert more.stated.slosh.modes == count + 1
    # nothing of it is exact but its pendulums
    for one, pendulums in ((now, count), (more, count + 1)):
        left = one.without(one.part(offer)).frequencies
        assert left == pytest.approx(np.repeat(wanted[:pendulums], 2), rel=1e-6)
    fifth, sixth = (replace(now, kept=numbered(now.body, range(1, 2 * n + 1))) for n in (5, 6))
    assert [one.modes for one in fifth.offers(9.0).values()] == [12]
    assert sixth.offers(9.0) == {}
    assert candidate_of(a, more.stated).offers(9.0) == {}


@pytest.mark.slow
def test_one_mode_more_keeps_what_a_load_on_a_port_bends():
    """x^3 / 3 EI and x^2 / 2 EI of a force, x / EI of a moment."""
    x = 0.6 * LENGTH
    one = embedded(left=boom(port=(bc.spec.Port(name="mid", x=x),)))
    more = candidate_of(one.appendages[0]).offers(9.0)["xy"].model
    tip = more.tip / more.frequencies[:, None]
    y, turned = 6 + 1, 6 + 5  # of the port, behind the tip's six
    found = (tip.T @ tip)[np.ix_([y, turned], [y, turned])]
    wanted = np.array([[x**3 / 3.0, x**2 / 2.0], [x**2 / 2.0, x]]) / STIFF
    np.testing.assert_allclose(found, wanted, rtol=5e-2)
    assert found[0, 0] == pytest.approx(wanted[0, 0], rel=1e-3)


# -- ports, keyframes, other steps -----------------------------------------------------------------
def test_places_of_appendages_on_ports_of_others():
    places = ["a", "a:end", "a:end:tip", "b:c"]
    assert split_port("a:end", places) == ("a", "end")
    assert split_port("a:end:tip", places) == ("a:end", "tip")
    assert split_port("b:c", places) is None
    assert split_port("a", places) is None
    assert base_place("a:end:tip:x", places) == "a"
    assert base_place("b:c", places) == "b:c"
    assert base_place("b:c:d", places) == "b:c"
    port = bc.spec.Port(name="end", x=1.0, carries=("own",))
    other = bc.spec.Port(name="mid", x=0.5)
    spec = boom(port=(port, other))
    given = {"a:end:tip": ("x",), "a:end": ("y",), "b:mid": ("z",), "a:mid": ("w", "v")}
    assert carries_of("a", spec, given) == {"end": ("y",), "mid": ("w", "v")}
    assert carries_of("b", spec, given) == {"end": ("own",), "mid": ("z",)}
    assert carries_of("c", spec, given) == {"end": ("own",)}
    with pytest.raises(bc.InputError, match="'tip'"):
        carries_of("a:end", spec, given)


def test_keyframes_that_bend_an_elastic_hinge():
    """From where it rests, 0.3 rad in one of them; a slide and another's hinge are none."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><compiler angle="radian"/><worldbody><body><joint name="drive"/>
        <joint name="slide" type="slide"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
        <body><joint name="one" ref="0.3"/><joint name="two" axis="1 0 0"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body></worldbody>
        <keyframe><key name="rest" qpos="2 3 0.3 0"/><key name="bent" qpos="0 0 0.1 -0.05"/>
        <key name="other" qpos="0 0 0.3 -0.07"/><key name="none" qpos="0 0 0.3 0"/></keyframe>
        </mujoco>"""
    )
    own = SimpleNamespace(
        spec=SimpleNamespace(slosh=None), elements={"jnt": frozenset({"one", "two", "slide"})}
    )
    tank = SimpleNamespace(
        spec=SimpleNamespace(slosh="tank"), elements={"jnt": frozenset({"drive"})}
    )
    first, second = bent_keyframes(model, [own, tank])
    assert first.code == second.code == "bent-keyframe"
    assert "'bent'" in first
    assert "-0.2 rad for 'one'" in first
    assert "'other'" in second
    assert "-0.07 rad for 'two'" in second
    assert bent_keyframes(model, [tank]) == []


def test_a_file_whose_timing_was_taken_out_is_not_judged():
    proof = SimpleNamespace(sampled_error=0.02, cure="cure", tolerance=0.03, band=2.0)
    made = RetimedCraft(None, 0.01, proof, "")
    assert (made.sampled_error, made.cure, made.met) == (0.02, "cure", True)
    still = RetimedCraft(None, 0.0, proof, "")
    assert (still.time_error, still.sampled_error, still.cure, still.met) == (None,) * 4
    unknown = RetimedCraft(None, 0.01, None, "why")
    assert (unknown.sampled_error, unknown.cure, unknown.met, unknown.band) == (None,) * 4
    # 1.01 of the error keeps it, and a step of up to 2.6 rad
    for error, step, met in ((0.0297, 0.01, True), (0.0298, 0.01, False), (0.02, 1.31, False)):
        proof.sampled_error = error
        assert RetimedCraft(None, step, proof, "").met is met


def test_a_file_is_judged_by_its_marks_where_it_has_timing(monkeypatch):
    asked = []

    def retimed(path, timestep, integrator, folder, band="none", joints=None):
        asked.append((path, timestep, integrator, folder, band, joints))
        return "file"

    marks = []
    monkeypatch.setattr("beamchain.craft.retiming.retimed_file", retimed)
    monkeypatch.setattr("beamchain.craft.retiming.marked_appendages", marks.append)
    still = retime_craft("path", 0.0, None, "folder")
    assert (still.file, still.timestep, still.proof, still.unknown) == ("file", 0.0, None, "")
    assert marks == []
    made = retime_craft("path", 0.02, "Euler", "folder", joints=True)
    assert (made.file, made.timestep, made.proof) == ("file", 0.02, None)
    assert "does not say what its appendages are" in made.unknown
    assert marks == ["path"]
    assert asked == [
        ("path", 0.0, None, "folder", "none", None),
        ("path", 0.02, "Euler", "folder", None, True),
    ]


@dataclass
class OnTendons:
    """An appendage whose one mode stands on a tendon."""

    fit: SimpleNamespace
    spec: SimpleNamespace


def test_a_model_with_timing_turns_by_w_h_in_a_step():
    """q_2 + q_0 = 2 cos(w h) q_1 of exact samples, where the step has 2 asin(w h / 2)."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody><body>
        <joint name="h1" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia=".2 .2 .25"/>
        </body></worldbody><tendon><fixed name="arm_mode1" stiffness="35">
        <joint joint="h1" coef="0.5"/></fixed></tendon></mujoco>"""
    )
    chain = SimpleNamespace(hung=False, hinges=(1,), tendons=(SimpleNamespace(stiffness=35.0),))
    spec = SimpleNamespace(scene=None, undamped_ratio=0.01)
    made = OnTendons(SimpleNamespace(chain=chain, spec=spec), spec)
    plain, timed = models_at_setting(
        Setting("implicitfast", 0.05, True), model, (made,), lambda _: None, joints=False
    )
    turn = np.sqrt(35.0) * 0.05
    for each, cosine in ((plain, np.cos(2.0 * np.arcsin(turn / 2.0))), (timed, np.cos(turn))):
        assert each.opt.timestep == 0.05
        assert each.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        data = mujoco.MjData(each)
        data.qpos[0] = 0.1
        places = []
        for _ in range(3):
            places.append(float(data.qpos[0]))
            mujoco.mj_step(each, data)
        assert places[2] + places[0] == pytest.approx(2.0 * cosine * places[1], rel=1e-9)
