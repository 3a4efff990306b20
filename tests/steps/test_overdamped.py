"""Step limits where modes are overdamped, or the scene asks for a step it cannot take: said,
and found again by MuJoCo.

Tolerances: SAME is between two ways of computing one number from A and B;
MEASURED the bound of the issue of stability.
"""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from examples import example
from limits import inspected, largest_steps
from mechanics import with_integrator

SAME = 1e-6
MEASURED = 0.01
SIMULATED = [0.05, 0.9]

ROD = bc.Beam(
    segments=[
        bc.Segment(
            length=5.0,
            section=bc.Round(diameter=0.02),
            material=bc.Material(youngs_modulus=7e10, density=2700.0),
        )
    ]
)
HUB = bc.Hub(mass=85.0, inertia=(1.0, 1.0, 1.0), offset=(0.25, 0.0, 0.0))


def fitted(ratio, form="modal", **more):
    damping = bc.Damping(ratio=ratio, form=form)
    return bc.fit(
        ROD, name="rod", modes={"xy": 2}, damping=damping, root=bc.spec.Root(hub=HUB), **more
    )


@pytest.mark.parametrize("ratio", [0.0, 0.005, 0.04, 0.05, 0.3, 0.9])
def test_fit_inspect_and_stability_agree(ratio, tmp_path):
    fit = fitted(ratio)
    (tmp_path / "scene.xml").write_text(fit.scene_mjcf())
    seen = largest_steps(tmp_path / "scene.xml")
    for name, step in fit.limits.largest_step.items():
        assert step == pytest.approx(seen[name], rel=SAME), name
    if ratio == SIMULATED[-1]:  # it simulates as well, which takes a while
        found = bc.stability(tmp_path / "scene.xml").budgets[0].largest_step
        assert fit.limits.largest_step["Euler"] == pytest.approx(found["Euler"], rel=SAME)


def stays_small(model, integrator, timestep, steps=1000):
    """Whether a small perturbation stays small in MuJoCo's own steps."""
    model = with_integrator(model, integrator, timestep)
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(
        mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_AUTORESET
    )
    data = mujoco.MjData(model)
    data.qvel[6:] = 1e-7 / timestep * np.random.default_rng(0).standard_normal(model.nv - 6)
    start = np.linalg.norm(data.qvel)
    mujoco.set_mju_user_warning(lambda _: None)  # what blows up is what is looked for
    try:
        for _ in range(steps // 10):
            mujoco.mj_step(model, data, 10)
            if not np.linalg.norm(data.qvel) < 300.0 * start:
                return False
    finally:
        mujoco.set_mju_user_warning(None)
    return True


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
@pytest.mark.parametrize("ratio", SIMULATED)
def test_the_limit_is_where_mujoco_blows_up(ratio, integrator):
    fit = fitted(ratio)
    predicted = fit.limits.largest_step[integrator]
    model = mujoco.MjModel.from_xml_string(fit.scene_mjcf())
    assert stays_small(model, integrator, (1.0 - MEASURED) * predicted)
    assert not stays_small(model, integrator, (1.0 + MEASURED) * predicted)


def test_an_unstable_step_of_the_scene_is_said():
    hinges = bc.spec.FitOptions(springs="hinges")
    fit = fitted(
        0.01, form="hinge", options=hinges, scene=bc.Scene(timestep=10.0, integrator="Euler")
    )
    said = [
        w
        for w in fit.warnings
        if w.startswith("scene.xml takes Euler at 10 s, ") and "unstable" in w
    ]
    assert len(said) == 1
    assert f"{fit.limits.largest_step['Euler']:.4g} s" in said[0]


@pytest.mark.slow
def test_a_step_that_misses_the_tolerance_is_said_and_a_good_one_is_not():
    root = bc.spec.Root(hub=HUB)
    asked = {"bandwidth": 5.0, "axes": ("z",)}
    springs = {
        "damping": bc.Damping(ratio=0.01, form="hinge"),
        "options": bc.spec.FitOptions(springs="hinges"),
    }
    coarse = bc.fit(ROD, root=root, scene=bc.Scene(**asked, timestep=0.02), **springs)
    assert any("above the tolerance 0.001" in w for w in coarse.warnings)
    best = coarse.steps[0]
    fine = bc.Scene(**asked, integrator=best.integrator, timestep=0.99 * best.step)
    assert not any(
        "scene.xml takes" in w for w in bc.fit(ROD, root=root, scene=fine, **springs).warnings
    )
    exact = bc.fit(
        ROD, damping=bc.Damping(ratio=0.01), root=root, scene=bc.Scene(**asked, timestep=0.02)
    )
    # one tendon per mode: exact in time at its step
    assert not any("scene.xml takes" in w for w in exact.warnings)


def test_nothing_that_rings_is_said_with_its_steps(tmp_path):
    source = """<mujoco><option gravity="0 0 0"/><worldbody><body>
    <joint type="hinge" stiffness="1" damping="10"/>
    <geom size=".1" mass="1" pos="1 0 0"/></body></worldbody></mujoco>"""
    (tmp_path / "slack.xml").write_text(source)
    with pytest.raises(bc.BeamchainError, match=r"overdamped .* RK4 0\.\d+ s"):
        bc.stability(tmp_path / "slack.xml")
    assert np.isfinite(largest_steps(source)["RK4"])


def test_a_rigid_free_flyer_has_no_limit():
    free = inspected(
        '<mujoco><worldbody><body><freejoint/><geom size=".1"/></body></worldbody><option '
        'gravity="0 0 0"/></mujoco>'
    )
    assert set(free["stability"]["largest_step"].values()) == {None}  # no limit


def test_neighbours_alike_are_one():
    bay = bc.Segment(
        length=0.025, section=bc.Round(diameter=0.02), material=ROD.segments[0].material
    )
    many = bc.fit(bc.Beam(segments=[bay] * 200), modes={"xy": 2}).target["xy"]
    assert many.frequencies == pytest.approx(fitted(0.0).full["xy"].frequencies[:2], rel=1e-11)


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    path = tmp_path / "boom.toml"
    path.write_bytes(b"\xef\xbb\xbf" + example("seed_boom").read_bytes())
    assert bc.read_spec(path).name == "boom"
    path.write_text("[segment]\nlength = 1.0\n")
    with pytest.raises(bc.BeamchainError, match=r"\[\[segment\]\]"):
        bc.read_spec(path)


@pytest.mark.slow
def test_an_embedding_has_no_scene_to_warn_of():
    segment = ROD.segments[0]
    scene = bc.Scene(bandwidth=5.0, axes=("z",), timestep=0.02)
    springs = {
        "damping": bc.Damping(ratio=0.01, form="hinge"),
        "fit": bc.spec.FitOptions(springs="hinges"),
    }
    spec = bc.Spec(name="rod", segment=(segment,), scene=scene, **springs)
    craft = """<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody><body name="bus">
    <freejoint/>
    <inertial pos="0 0 0" mass="85" diaginertia="1 1 1"/><site name="mount" pos=".25 0 0"/></body>
    </worldbody></mujoco>"""
    done = bc.embed(craft, {"mount": spec})
    assert any("scene.xml takes" in w for w in done.appendages[0].fit.warnings)
    assert not any("scene.xml" in w for w in done.warnings)
