"""Arguments of a wrong type, and arrays that are not finite,
are answered with a sentence that names them."""

import numpy as np
import pytest

import beamchain as bc

CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.05"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/><site name="mount" pos="0.5 0 0"/></body>
</worldbody></mujoco>"""
NAN = float("nan")


@pytest.fixture(scope="module")
def spec():
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    return bc.Spec(
        segment=(bc.Segment(length=8.0, section=section),),
        modes=bc.Modes(xy=1),
        fit=bc.FitOptions(springs="modes"),
    )


@pytest.fixture(scope="module")
def made(spec):
    return bc.embed(CRAFT, {"mount": spec})


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: bc.sweep(CRAFT, samples="3"), "samples = '3' must be a whole number"),
        (lambda: bc.sweep(CRAFT, seed=0.5), "seed = 0.5 must be a whole number"),
        (lambda: bc.sweep(CRAFT, workers="2"), "workers = '2' must be a whole number"),
        (lambda: bc.sweep(CRAFT, workers=0), "workers = 0 must be a whole number"),
        (
            lambda: bc.sweep(CRAFT, gains="torque:bus=attitude"),
            "gains = .* must be a list of names",
        ),
        (lambda: bc.sweep(CRAFT, at=[1]), r"at = \[1\] is a list; give appendages by place"),
        (
            lambda: bc.identify({}, CRAFT, at=5),
            "at = 5 is a int; give the name of the spacecraft's site or body",
        ),
        (lambda: bc.identify({}, CRAFT, "mount", map=5), "map = 5 is a int; give names by column"),
        (
            lambda: bc.embed(CRAFT, {5: "array.toml"}),
            "a place in at = 5 is a int; give the name of a site or body",
        ),
        (
            lambda: bc.embed(
                5,
                {
                    "mount": bc.Beam(
                        segments=(
                            bc.Segment(
                                length=1.0,
                                section=bc.Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0),
                            ),
                        )
                    )
                },
            ),
            "craft = 5 is a int; give the path or the text",
        ),
        (
            lambda: bc.embed(CRAFT, {"mount": "array.toml"}, form=np.zeros(2)),
            "form = .* is unknown",
        ),
        (
            lambda: bc.embed(CRAFT, {"mount": "array.toml"}, prefixes="a_"),
            "prefixes = 'a_' must be a list of names",
        ),
        (
            lambda: bc.embed(CRAFT, {"mount": "array.toml"}, retime=np.zeros((2, 2))),
            "retime = .* is a ndarray; give True or False",
        ),
        (
            lambda: bc.embed(CRAFT, {"mount": "array.toml"}, rigid="no"),
            "rigid = 'no' is a str; give True or False",
        ),
        (
            lambda: bc.plant(CRAFT, ["torque:bus"], at=[[1, 2], [3]]),
            r"at\[0\] has the shape \(2,\); give qpos with shape",
        ),
        (lambda: bc.plant(5), "model = 5 is a int; give"),
        (lambda: bc.linearise(CRAFT, data="now"), "data = 'now' is a str; give a mujoco.MjData"),
        (lambda: bc.compare(5, 6), "a = 5 is a int; give a PortModel"),
        (
            lambda: bc.retime("flexible.xml", 0.1),
            "model = 'flexible.xml' is a str; give a compiled mujoco.MjModel",
        ),
        (
            lambda: bc.start_velocity(None, [0.0], [0.0]),
            "model = None is a NoneType; give a compiled mujoco.MjModel",
        ),
        (lambda: bc.stability(5), "source = 5 is a int; give a Spec"),
        (lambda: bc.study(5), "spec = 5 is a int; give a Spec"),
        (lambda: bc.read_spec(5), "spec = 5 is a int; give a Spec"),
        (lambda: bc.read_modes(5), "path = 5 is a int; give the path of a file of modes"),
        (lambda: bc.HeldInput(NAN), "before is nan; finite numbers are needed"),
        (lambda: bc.HeldInput()([0.0, NAN]), r"now\[1\] is nan; finite numbers are needed"),
        (
            lambda: bc.PortModel("3", [1.0], [[0.1]]),
            "rigid_mass = '3' is a str; numbers are needed",
        ),
    ],
)
def test_the_argument_is_named(call, sentence):
    with pytest.raises(bc.InputError, match=sentence):
        call()


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda made: bc.plant(made, 5), "inputs = 5 must be a list of names"),
        (lambda made: bc.plant(made, rates=5), "rates = 5 is a int; give speeds by joint"),
        (lambda made: bc.plant(made, ["torque:bus"], at=[NAN] * made.model.nq), r"at\[0\] is nan"),
        (
            lambda made: bc.plant(made, ["torque:bus"]).truncation([1.0, NAN]),
            r"omega\[1\] is nan; finite numbers \(rad/s\)",
        ),
        (lambda made: bc.plant(made, ["torque:bus"]).truncation("fast"), "omega = 'fast' is a str"),
        (lambda made: bc.plant(made, ["torque:bus"]).write(5), "path = 5 is a int"),
        (lambda made: made.write(None), "path = None is a NoneType"),
        (lambda made: made.modes_at(5), "key = 5 is a int; give the name of a keyframe"),
        (lambda made: bc.retime(made.model, "0.1"), "timestep = '0.1'"),
        (lambda made: bc.retime(made.model, 0.1, qpos=[NAN] * made.model.nq), r"qpos\[0\] is nan"),
        (
            lambda made: bc.start_velocity(made.model, made.model.qpos0, [NAN] * made.model.nv),
            r"qvel\[0\] is nan",
        ),
        (
            lambda made: bc.start_velocity(made.model, [0.0], [0.0]),
            r"qpos = .* has the shape \(1,\)",
        ),
        (lambda made: bc.worlds(made, count=2, seed="3"), "seed = '3' must be a whole number"),
        (lambda made: bc.worlds(made, count=2, observe=5), "observe = 5 must be a list of names"),
        (lambda made: bc.worlds(made, {5: 1.0}, count=2), "a field of variants = 5 is a int"),
        (
            lambda made: bc.worlds(made, count=2).restore(5),
            r"state = 5 is a int; give what state\(\) of these worlds gave",
        ),
        (
            lambda made: bc.worlds(made, count=2).model_of(2),
            "world = 2 must be a whole number from 0 to 1",
        ),
    ],
)
def test_what_is_asked_of_a_craft(made, call, sentence):
    with pytest.raises(bc.InputError, match=sentence):
        call(made)


@pytest.mark.parametrize("values", [[NAN], [1.0, float("inf")], "fast"])
def test_frequencies_of_port_models(spec, values):
    port = bc.Beam(segments=spec.segment).port("xy", 2)
    for response in (port.D, port.W):
        with pytest.raises(bc.InputError, match="omega"):
            response(values)
    with pytest.raises(bc.InputError, match="hub_mass"):
        port.with_hub([[NAN, 0.0], [0.0, 1.0]])


def test_the_environment_takes_finite_numbers_only():
    gymnasium = pytest.importorskip("gymnasium")
    env = gymnasium.make(
        "beamchain.gym:beamchain/FlexibleSatellite-v0", variants=None, disable_env_checker=True
    )
    with pytest.raises(bc.InputError, match=r"turn\[1\] is nan"):
        env.reset(seed=0, options={"turn": (0.1, NAN, 0.0)})
    env.reset(seed=0)
    with pytest.raises(bc.InputError, match="is nan"):
        env.step(np.array([NAN, 0.0, 0.0]))
    with pytest.raises(bc.InputError, match=r"action = .* has the shape \(2,\)"):
        env.step(np.zeros(2))
    env.close()


def test_a_step_is_one_number(spec):
    for wrong in (np.zeros((2, 2)), [[1, 2], [3]], ()):
        with pytest.raises(bc.InputError, match="timestep = .* is not a number"):
            bc.fit(spec, timestep=wrong)
