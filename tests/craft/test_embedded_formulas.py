"""What an embedded spacecraft says of itself, beside numbers put in by hand; its places, and the
hubs of its appendages: two booms on a bus, one of them behind a drive."""

from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.craft.fits import Fits, _same_hub
from beamchain.errors import RealisationError
from formulas import (
    Body,
    Candidate,
    CraftError,
    Embedded,
    Kept,
    Placed,
    SampledError,
    Setting,
    carried_by_craft,
    fits_that_keep,
    joint_request,
    lightest_of_bodies,
    realised_or_before,
    warnings_of_loads,
)

LINE, LENGTH = 4.0, 8.0
CRAFT = """<mujoco><option gravity="0 0 0" timestep="{step}"/><worldbody>
<body name="bus" pos="1 2 3" euler="0 0 {turn}"><freejoint/>
<inertial pos="0.1 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
<site name="fixed" pos="0.5 0.2 0" euler="0 0 30"/>
<body name="drive" pos="-0.5 0 0.1"><joint name="drive" axis="0 0 1"{held}/>
<inertial pos="0 0 0" mass="{small}" diaginertia="{tiny} {tiny} {tiny}"/>
<site name="turning" euler="0 0 180"/></body>
<body name="wheel"><joint name="wheel" axis="1 0 0"/>
<inertial pos="0 0 0" mass="{small}" diaginertia="{tiny} {tiny} {tiny}"/></body>
</body></worldbody><keyframe><key name="turned" qpos="0 0 0 1 0 0 0 0.7 0"/></keyframe></mujoco>"""


def craft(step=0.01, mass=300.0, turn=0.0, held=""):
    sizes = {"inertia": 0.3 * mass, "small": 0.02 * mass, "tiny": 0.002 * mass}
    return CRAFT.format(step=step, mass=mass, turn=turn, held=held, **sizes)


def boom(stiff=2e3, line=LINE, **more):
    section = bc.Equivalent(bending_stiffness_xy=stiff, linear_mass=line)
    segment = bc.Segment(length=LENGTH, section=section)
    return bc.Spec(name="boom", segment=(segment,), modes=bc.Modes(xy=1), **more)


@pytest.fixture(scope="module")
def made():
    scene = bc.Scene(bandwidth=0.8, tolerance=0.05, axes=("z",))
    return bc.embed(craft(turn=25.0), {"fixed": boom(scene=scene), "turning": boom()}, retime=False)


def with_numbers(made, errors, sampled, tolerance=None, growth=None, band=0.8, loaded=False):
    """The same with errors put in by hand."""
    out = replace_of(made, loaded=loaded)
    worst = max(errors.values())
    promise = CraftError(worst, band, dict(errors), (5,), "bus", growth or {})
    out.__dict__["promise"] = promise
    out.__dict__["sampled_poses"] = {
        name: SampledError(error, 0.5) for name, error in sampled.items()
    }
    out.__dict__["_asked"] = SimpleNamespace(tolerance=tolerance, band=band, motions=(5,))
    words = SimpleNamespace(loading=SimpleNamespace(words="the thrust"))
    out.__dict__["_exact_poses"] = {name: [words] for name in errors}
    return out


def replace_of(made, **changes):
    """A copy without what was worked out."""
    names = ("appendages", "craft", "model", "warnings", "document")
    return type(made)(**{name: getattr(made, name) for name in names}, **changes)


@pytest.mark.parametrize(
    ("craft_error", "sampled", "tolerance", "loaded", "growth", "met"),
    [
        (0.5, 0.0198, 0.02, False, False, True),  # 1.01 times the error within it
        (0.0, 0.0199, 0.02, False, False, False),
        (0.5, 0.0198, 0.02, True, False, False),
        (0.01, 0.0198, 0.02, True, False, True),
        (0.01, 0.01, 0.02, True, True, False),
        (0.01, 0.01, None, False, False, None),
        (0.01, 0.01, None, True, True, False),
    ],
)
def test_the_larger_error_is_held_against_the_tolerance(
    made, craft_error, sampled, tolerance, loaded, growth, met
):
    grows = {"burn": (0.2, 0.0)} if growth else {}
    found = with_numbers(
        made, {"rest": craft_error}, {"rest": sampled}, tolerance, grows, loaded=loaded
    )
    assert found.by_step
    assert found.met is met
    assert found.sampled_error == sampled


def test_a_step_that_turns_by_more_than_26_tenths_in_the_band_meets_nothing(made):
    for band, met in ((259.0, True), (261.0, False)):  # 0.01 s
        found = with_numbers(made, {"rest": 0.0}, {"rest": 0.0}, 0.1, band=band)
        assert found.met is met


@pytest.mark.parametrize(
    ("sampled", "tolerance", "ruined"), [(0.11, None, True), (0.09, None, False), (0.5, 0.6, False)]
)
def test_a_step_ruins_the_motion_above_a_tenth(made, sampled, tolerance, ruined):
    found = with_numbers(made, {"rest": 0.0}, {"rest": 0.01, "turned": sampled}, tolerance)
    assert found.ruined is ruined
    assert ("above 0.1;" in found.headline) is ruined


def test_the_worst_of_several_poses_is_named(made):
    one = with_numbers(made, {"rest": 0.011}, {"rest": 0.012})
    assert "worst" not in one.headline
    several = with_numbers(
        made, {"rest": 0.011, "near": 0.031, "turned": 0.02}, {"rest": 0.042, "turned": 0.012}
    )
    assert "3.10e-02 (worst of 3 poses: near)" in several.headline
    assert "4.20e-02 when stepped by Euler at 0.01 s (worst: rest)" in several.headline
    only = with_numbers(made, {"rest": 0.011, "near": 0.031}, {"rest": 0.012})
    assert "(worst: " not in only.headline
    assert "(worst of 2 poses: near)" in only.headline


def test_rates_of_growth_are_said_as_times(made):
    rates = {"burn": (0.25, 0.0), "slow": (0.0, 0.01)}
    found = with_numbers(
        made, {"rest": 0.0, "burn": 0.0, "slow": 0.0}, {"rest": 0.0}, None, rates, loaded=True
    )
    burn, slow = found.headline.split("Unstable at ")[1:]
    assert burn.startswith("burn, the thrust: the exact spacecraft grows by a factor of e in 4 s")
    assert "the file does not grow" in burn
    assert "the exact spacecraft does not grow" in slow
    assert "the file grows by a factor of e in 100 s" in slow
    assert found.growth == {
        "burn": {"exact": 0.25, "mujoco": 0.0}, "slow": {"exact": 0.0, "mujoco": 0.01},
    }  # fmt: skip


def test_without_a_step_the_error_is_that_of_the_continuous_motion(made):
    found = with_numbers(made, {"rest": 0.03}, {"rest": 0.5}, 0.1)
    assert found._error_at(Setting("Euler", 0.0, None)) == 0.03
    # 0.8 rad/s at 3.3 s: beyond 2.6 rad
    assert found._error_at(Setting("Euler", 3.3, None)) == np.inf


def test_a_step_without_bound_is_not_blamed_on_a_resonance(made):
    found = with_numbers(made, {"rest": 0.03, "turned": 0.03}, {"rest": 0.5, "turned": np.inf}, 0.1)
    assert found.met is False
    assert found.cause is None


# -- places ----------------------------------------------------------------------------------------
def test_positions_of_the_bare_craft_by_joint(made):
    model, bare = made.model, made.craft
    qpos = np.arange(1.0, model.nq + 1.0)
    found = made.bare_qpos(qpos)
    assert found.size == bare.nq == 9
    assert found[:7].tolist() == qpos[:7].tolist()
    for name in ("drive", "wheel"):
        there = model.jnt_qposadr[model.joint(name).id]
        assert found[bare.jnt_qposadr[bare.joint(name).id]] == qpos[there]


def test_mass_centres_are_told_from_the_base_in_its_axes(made):
    """4 m out along each; turned by 30 and by 180 degrees on a bus that is turned itself."""
    out = LENGTH / 2.0 * np.array([np.cos(np.pi / 6.0), 0.5, 0.0])
    assert made.mass_centres["fixed"] == pytest.approx(np.array([0.5, 0.2, 0.0]) + out, abs=1e-9)
    assert made.mass_centres["turning"] == pytest.approx([-4.5, 0.0, 0.1], abs=1e-9)
    whole = made.composite
    # bus, drive and wheel of 6 kg each, two booms of 32 kg
    masses = np.array([300.0, 6.0, 6.0, 32.0, 32.0])
    places = np.array([[0.1, 0, 0], [-0.5, 0, 0.1], [0, 0, 0], *made.mass_centres.values()])
    assert whole.mass == pytest.approx(masses.sum(), rel=1e-9)
    assert whole.centre == pytest.approx(masses @ places / masses.sum(), abs=1e-9)


# -- hubs ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("mass", [5e-4, 2e6])
def test_only_a_loose_joint_makes_a_hub_another_than_what_is_rigidly_behind(mass):
    """Of half a gram or of thousands of tons."""
    light = boom(7.0 * mass, 0.01 * mass)
    loose = bc.embed(craft(mass=mass), {"turning": light}, rigid=True)
    (a,) = loose.appendages
    assert a.hub.apparent is not None
    apparent = np.array(a.hub.apparent)
    assert a.hub.mass == pytest.approx(0.02 * mass)
    # along the drive and its arm the root moves bus and wheel too, about its axis only itself
    assert apparent[[0, 2], [0, 2]] == pytest.approx([1.04 * mass] * 2)
    assert apparent[5, 5] == pytest.approx(0.002 * mass, rel=1e-6)
    (a,) = bc.embed(craft(mass=mass), {"fixed": light}, rigid=True).appendages
    assert a.hub.apparent is not None  # the wheel spins freely, and the drive turns
    held = craft(mass=mass).replace('<joint name="drive" axis="0 0 1"/>', "")
    held = held.replace('<joint name="wheel" axis="1 0 0"/>', "").replace(" 0.7 0", "")
    (a,) = bc.embed(held, {"fixed": light}, rigid=True).appendages
    assert a.hub.apparent is None
    assert a.hub.mass == pytest.approx(1.04 * mass)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_a_hub_is_the_same_to_rounding_of_its_own_size(size):
    hub = bc.Hub(mass=3.0 * size, inertia=(2.0 * size, 2.5 * size, 1.5 * size))
    for change, same in ((1e-13, True), (1e-11, False)):
        for other in (
            bc.Hub(mass=hub.mass * (1.0 + change), inertia=hub.inertia),
            bc.Hub(mass=hub.mass, inertia=(2.0 * size, 2.5 * size * (1.0 + change), 1.5 * size)),
        ):
            assert _same_hub(hub.mass_matrix(), other) is same
    assert not _same_hub(None, hub)


def fits_of(monkeypatch, **given):
    """Fits whose choices and chains are counted."""
    chosen, made = [], []

    def choose(spec, data):
        chosen.append((spec.root.target, data))
        return Body(spec, {}, data), Kept("clamped", {"xy": 1})

    def fitted(body, kept):
        made.append((body.spec, body.data, kept))
        return SimpleNamespace(hub_mass=body.hub, number=len(made))

    monkeypatch.setattr("beamchain.craft.fits.body_and_kept", choose)
    monkeypatch.setattr("beamchain.craft.fits.fit_kept", fitted)
    return Fits(**given), chosen, made


HUBS = [bc.Hub(mass=mass, inertia=(2.0, 2.5, 1.5)) for mass in (3.0, 4.0)]


def test_a_boom_is_fitted_once_for_a_hub_a_target_and_its_data(monkeypatch):
    fits, chosen, made = fits_of(monkeypatch, held={"c": "modes"})
    one, other = boom(), boom(stiff=3e3)
    asked = [
        ("a", one, "hub", 0, 1), ("b", one, "hub", 0, 1), ("b", other, "hub", 0, 2),
        ("a", one, "free", 0, 3), ("a", one, "hub", 1, 4), ("c", one, "hub", 0, 5),
        ("c", one, "hub", 0, 5), ("a", one, "hub", 0, 1),
    ]  # fmt: skip
    for at, spec, target, hub, number in asked:
        root = bc.spec.Root(target=target)
        fit, item = fits.candidate(at, spec.replace(root=root), HUBS[hub])
        assert (item.body.spec.root.target, fit) == (target, None)
        assert (item.kept.counts, item.measured, item.added) == ({"xy": 1}, None, "")
        assert item.body.hub.tolist() == HUBS[hub].mass_matrix().tolist()
        assert fits(item).number == number
    assert [data for _, data in chosen] == [None] * 4 + ["modes"]
    assert [data for _, data, _ in made] == [None] * 4 + ["modes"]


def test_a_chain_with_more_modes_is_made_once_for_their_numbers(monkeypatch):
    fits, chosen, made = fits_of(monkeypatch)
    first, second = (fits.candidate(at, boom(), HUBS[0])[1] for at in "ab")
    assert len(chosen) == 1

    def grown(item, **counts):
        return replace(item, kept=Kept("clamped", counts), added="one more")

    asked = [
        (first, 1), (grown(first, xy=2), 2), (grown(second, xy=2), 2),
        (grown(second, xy=1, torsion=1), 3), (grown(first, xy=2), 2), (second, 1),
    ]  # fmt: skip
    for item, number in asked:
        assert fits(item).number == number
    assert [kept.counts for *_, kept in made] == [{"xy": 1}, {"xy": 2}, {"xy": 1, "torsion": 1}]
    assert [spec.modes for spec, *_ in made] == [
        bc.Modes(xy=1),
        bc.Modes(xy=2, xz=0, torsion=0, axial=0),
        bc.Modes(xy=1, xz=0, torsion=1, axial=0),
    ]


@pytest.mark.parametrize(("mass", "ready"), [(3.0, True), (3.1, False)])
def test_a_fit_at_hand_is_taken_for_its_hub_alone(monkeypatch, mass, ready):
    hub = bc.Hub(mass=mass, inertia=(2.0, 2.5, 1.5))
    body = Body(boom(root=bc.spec.Root(hub=HUBS[0])), {})
    kept = Kept("clamped", {"xy": 3})
    spec = body.spec.replace(name="renamed")
    measured = SimpleNamespace(space="as MuJoCo has it")
    made = SimpleNamespace(
        hub_mass=HUBS[0].mass_matrix(), body=body, kept=kept, spec=spec, measured=measured
    )
    fits, chosen, _ = fits_of(monkeypatch, ready={"a": made})
    fit, found = fits.candidate("a", boom(), hub)
    assert len(chosen) == (not ready)
    if ready:
        assert (fit, found.body.spec, found.kept) == (made, spec, kept)
    else:
        assert fit is None
        assert found.body.hub[0, 0] == mass
        assert found.measured is None
    fit, found = fits.candidate("b", boom(), HUBS[0])
    assert (fit, found.measured) == (None, None)


def test_where_no_scene_states_a_band_what_is_ready_is_taken_and_the_rest_fitted_once():
    model = mujoco.MjModel.from_xml_string(craft())
    ready, body = object(), Body(boom(), {})
    items = [
        Placed(at, "mount", (), Candidate(body, Kept("clamped", {"xy": n})), fit)
        for at, n, fit in (("a", 1, ready), ("b", 2, None))
    ]
    nothing = joint_request([])
    made, steps = fits_that_keep(model, items, nothing, 12, lambda item: f"fit of {item.modes}")
    assert (made, steps) == ([ready, "fit of 2"], ())


@pytest.mark.parametrize("loads", [(), ("load",)])
def test_of_an_appendage_that_carries_the_model_stays_what_was_asked_for(loads):
    """MuJoCo's has no motion of its ports."""
    body = Body(boom(), {})
    item = Placed("a", "mount", loads, Candidate(body, Kept("clamped", {"xy": 3})))
    kept = Kept("clamped", {"xy": 2})  # fewer than were asked for
    fit = SimpleNamespace(kept=kept, measured=SimpleNamespace(space="as MuJoCo has it"))
    longer = Candidate(body, Kept("clamped", {"xy": 4}), added="mode 4 in xy", newest=3.0)
    found = item.with_fit(longer, fit)
    assert (found.at, found.mount, found.loads, found.fit) == ("a", "mount", loads, fit)
    assert (found.candidate.kept, found.candidate.added) == (kept, "mode 4 in xy")
    assert found.candidate.measured == (None if loads else "as MuJoCo has it")


@pytest.mark.parametrize(
    ("most", "kept", "refused"), [(5, 5, []), (3, 3, [5, 4]), (2, 2, [5, 4, 3]), (1, None, None)]
)
def test_where_no_chain_has_all_modes_the_last_before_them_that_has_one_is_taken(
    most, kept, refused
):
    """Five modes are wanted, grown from two."""
    body = Body(boom(root=bc.spec.Root(hub=HUBS[0])), {})
    grown = Candidate(body, Kept("clamped", {"xy": 2}))
    item = Placed("a", "mount", (), grown)
    for n in (3, 4, 5):
        grown = replace(grown, kept=Kept("clamped", {"xy": n}), before=grown)

    def fit(candidate):
        if candidate.modes > most:
            raise RealisationError(f"not {candidate.modes}.")
        return SimpleNamespace(kept=candidate.kept, measured=SimpleNamespace(space="measured"))

    if kept is None:
        with pytest.raises(RealisationError, match="a: not 2"):
            realised_or_before(item, grown, fit)
        return
    found, failed = realised_or_before(item, grown, fit)
    assert (found.candidate.modes, found.candidate.measured) == (kept, "measured")
    assert failed == [f"a: no chain has {n} modes: not {n}." for n in refused]
    # where it had a chain before, that one stands
    before = Placed("a", "mount", (), item.candidate, "fit of two")
    found, failed = realised_or_before(before, grown, fit)
    assert (found is before) == (kept == 2)


def test_equal_booms_on_unequal_hubs_have_fits_of_their_own():
    both = bc.embed(craft(), {"fixed": boom(), "turning": boom()}, retime=False)
    first, second = both.appendages
    assert first.hub.mass != pytest.approx(second.hub.mass)
    for a in both.appendages:
        np.testing.assert_allclose(a.fit.hub_mass, a.hub.mass_matrix(), rtol=1e-9, atol=1e-9)
    assert first.fit.hub_mass[0, 0] != pytest.approx(second.fit.hub_mass[0, 0])


def test_what_the_exact_craft_is_compared_up_to(made):
    """The last kept cantilever frequency, of each port."""
    first, second = carried_by_craft(made.model, made.appendages)
    wanted = 1.8751040687**2 * np.sqrt(2e3 / LINE) / LENGTH**2
    for item, a in ((first, made.appendages[0]), (second, made.appendages[1])):
        assert item.band == pytest.approx({"xy": wanted}, rel=1e-4)
        assert [made.model.joint(int(made.model.dof_jntid[dof])).name for dof in item.dofs] == [
            name for name in map(str, joints(made.model)) if name.startswith(a.prefix)
        ]
    (bare, _) = carried_by_craft(None, made.appendages)
    assert bare.dofs == []
    assert lightest_of_bodies(made.appendages)[0] == pytest.approx(
        min(made.model.body_mass[i] for i in range(made.model.nbody) if moves(made, i))
    )


@pytest.mark.parametrize("loaded", [True, False])
def test_a_loaded_craft_is_assembled_about_its_loaded_pose_of_rest(monkeypatch, loaded):
    given = []
    monkeypatch.setattr("beamchain.craft.embedded.carried", lambda *_: "exact")
    monkeypatch.setattr("beamchain.craft.embedded.assembly_at_rest", lambda *of: given.append(of))
    of_poses = {"bent": [1.0], "rest": [2.0]}
    made = SimpleNamespace(
        craft="craft", model="model", untimed="untimed", appendages=(), promise="promise", _own=[3],
        _asked=SimpleNamespace(band=0.8), loaded=loaded, _exact_poses=of_poses,
    )  # fmt: skip
    Embedded.assembly.func(made)
    pose = 2.0 if loaded else None
    assert given == [("craft", "untimed", "exact", "promise", 0.8, [3], pose)]


@pytest.mark.parametrize(("bandwidth", "band"), [(None, 2.0), (7.0, 7.0), ("no scene", 2.0)])
def test_a_rigid_body_is_compared_up_to_what_its_scene_asks_for(bandwidth, band):
    """Else up to its first mode."""
    whole = bc.PortModel(np.diag([4.0] * 6), np.array([2.0, 3.0]), np.eye(6)[:2])
    exact = SimpleNamespace(model=whole, kept=np.zeros(2, bool), band={})
    scene = None if bandwidth == "no scene" else SimpleNamespace(bandwidth=bandwidth)
    spec = SimpleNamespace(scene=scene, slosh=None, undamped_ratio=0.03)
    body = SimpleNamespace(spec=spec, data="imported")
    given = SimpleNamespace(fit=SimpleNamespace(body=body, _exact=exact), mount="place", loads=())
    (found,) = carried_by_craft(None, [given])
    assert found.band == {"rigid": band}
    assert (found.mount, found.whole, found.undamped, found.line) == ("place", whole, 0.03, None)


def joints(model):
    return [model.joint(i).name for i in range(model.njnt)]


def moves(made, body):
    """Whether it is a link of an appendage that a hinge moves."""
    name = made.model.body(body).name
    of_booms = any(name.startswith(a.prefix) for a in made.appendages)
    return of_booms and made.model.body_jntnum[body] > 0


def test_a_thrust_beside_the_mass_centre_is_said_of_its_own_keyframe():
    """2 N at 0.3 m from the centre, on at one keyframe of three."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" mass="9"
        diaginertia="1 1 1"/><site name="jet" pos="0 0.3 0"/></body></worldbody>
        <actuator><general site="jet" gear="2 0 0 0 0 0"/></actuator><keyframe>
        <key name="still"/><key name="burn" ctrl="1"/><key name="coast"/></keyframe></mujoco>"""
    )
    result = SimpleNamespace(appendages=[SimpleNamespace(rigid=False)], craft=model, model=model)
    loadings = {("still", 1): None, ("burn", 1): None, ("coast", 1): None, ("rest", 1): None}
    (said,) = warnings_of_loads(result, [], loadings)
    assert said.code == "thrust-offset"
    assert "at burn" in said
    assert "300 mm" in said
    assert "0.6 N m" in said
    result.appendages[0].rigid = True
    assert warnings_of_loads(result, [], loadings) == []
