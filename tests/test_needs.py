"""What a scene does not need: the promise holds in every random scene, and the choice is tight.

The promise is checked independently of the choice: with the whole beam at twice the modes, with the 6 x 6 definition of
the in-band error written out again here from dynamic masses, on a grid of its own, and for uniform beams with the
transcendental solution in the plane.
"""

from importlib.resources import files

import numpy as np
import pytest
from msgspec import structs

from beamchain.chain.chain import Chain
from beamchain.errors import InputError
from beamchain.fitting.choose import everything
from beamchain.fitting.fit import fit
from beamchain.fitting.hub import Hub
from beamchain.fitting.needs import AXES
from beamchain.fitting.options import Damping, Modes, Root, Scene
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec, read_spec, spec_from_dict
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS
from beamchain.structure.beam import Beam, Joint, Lump, Segment
from beamchain.structure.exact import UniformBeam
from beamchain.structure.material import Material
from beamchain.structure.section import Rectangle, Tube
from random_appendages import tube_and_strip

SCENES = 200
GRID_SLACK = 1.02  # the independent grid may hit a peak a little nearer its top than the choice's own
TIGHT = 0.9  # share of scenes in which one mode fewer breaks the promise
DAMPING = 0.005

ALUMINIUM = Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33)


def random_scene(seed: int) -> Spec:
    rng = np.random.default_rng(seed)
    kind = rng.integers(3)
    length = float(rng.uniform(2.0, 12.0))
    if kind == 0:
        diameter = float(rng.uniform(0.02, 0.1))
        segments: tuple[Segment, ...] = (
            Segment(length=length, section=Tube(outer_diameter=diameter, wall=0.002), material=ALUMINIUM),
        )
    elif kind == 1:
        section = Rectangle(width_y=float(rng.uniform(0.01, 0.05)), width_z=float(rng.uniform(0.1, 0.5)))
        segments = (Segment(length=length, section=section, material=ALUMINIUM),)
    else:
        big = Tube(outer_diameter=0.08, wall=0.002)
        small = Tube(outer_diameter=float(rng.uniform(0.03, 0.07)), wall=0.0015)
        segments = (
            Segment(length=length / 2, section=big, section_end=small, material=ALUMINIUM, nonstructural_mass=0.5),
            Segment(length=length / 2, section=small, material=ALUMINIUM),
        )
    joints = (Joint(after_segment=0, stiffness_xy=float(10 ** rng.uniform(2.5, 5))),) if rng.random() < 0.3 else ()
    lumps = ()
    if rng.random() < 0.3:
        lumps = (Lump(x=length * float(rng.uniform(0.5, 1.0)), mass=float(rng.uniform(0.2, 3.0)), inertia=(0.01,) * 3),)
    beam = Beam(segments=segments, joints=joints, lumps=lumps)
    first = float(beam.port("xy", 4).frequencies[0])
    mass = float(beam.rigid_mass()[0, 0] * 10 ** rng.uniform(0.0, 2.5))
    side = length * float(rng.uniform(0.1, 0.4))
    inertia = tuple(float(mass * side**2 / 6.0 * v) for v in rng.uniform(0.8, 1.2, 3))
    offset = (side / 2, float(rng.choice([0.0, 0.2 * side])), 0.0)
    axes = [("z",), ("y",), ("x", "y", "z"), ("z", "ty"), ("x", "y", "z", "tx", "ty", "tz")][rng.integers(5)]
    return Spec(
        segment=segments,
        joint=joints,
        lump=lumps,
        damping=Damping(ratio=DAMPING),
        root=Root(hub=Hub(mass=mass, inertia=inertia, offset=offset)),
        scene=Scene(
            bandwidth=float(first * 10 ** rng.uniform(-0.7, 1.2)),
            tolerance=float(10 ** rng.uniform(-3.5, -1.5)),
            axes=axes,
        ),
    )


def in_space(models: dict[str, PortModel], rigid: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """`(k, 6, 6)` dynamic mass from the ports' own."""
    out = np.repeat(rigid[None].astype(complex), omega.size, axis=0)
    for port, model in models.items():
        motion = PORT_MOTION[port]
        flexible = np.moveaxis(model.D(omega), -1, 0) - model.rigid_mass
        out += motion @ flexible @ motion.T
    return out


def independent_error(spec: Spec, chain: dict[str, PortModel], beam: dict[str, PortModel]) -> float:
    """The in-band error in space, from its definition."""
    assert spec.scene is not None
    assert spec.scene.bandwidth is not None
    assert spec.root.hub is not None
    hub, band = spec.root.hub.mass_matrix(), spec.scene.bandwidth
    rigid = spec.beam.rigid_mass()
    peaks = [
        m.with_hub(PORT_MOTION[p].T @ hub @ PORT_MOTION[p]).free_frequencies for p, m in [*chain.items(), *beam.items()]
    ]
    peaks += [m.frequencies for m in [*chain.values(), *beam.values()]]
    near = np.concatenate([p[p < 1.1 * band] for p in peaks])
    omega = np.concatenate(
        [np.linspace(band / 700, band, 700), *(near * (1 + d) for d in np.linspace(-0.03, 0.03, 61))]
    )
    omega = np.unique(omega[(omega > 0) & (omega <= band)])
    keep = [AXES[a] for a in spec.scene.axes]
    scale = np.sqrt(np.diag(hub + rigid))

    def response(models: dict[str, PortModel]) -> np.ndarray:
        h = np.linalg.inv(hub + in_space(models, rigid, omega)) * np.outer(scale, scale)
        return h[:, keep][:, :, keep]

    ours, true = response(chain), response(beam)
    frozen = (np.linalg.inv(hub + rigid) * np.outer(scale, scale))[np.ix_(keep, keep)]
    size = np.maximum(np.linalg.norm(true, 2, axis=(1, 2)), np.linalg.norm(frozen, 2))
    return float(np.max(np.linalg.norm(ours - true, 2, axis=(1, 2)) / size))


def whole(spec: Spec, modes: int = 40) -> dict[str, PortModel]:
    return {port: spec.with_ratios(port, spec.beam.port(port, modes)) for port in PORTS}


def of_chain(spec: Spec, chain: Chain, ports: tuple[str, ...]) -> dict[str, PortModel]:
    return {port: spec.with_ratios(port, chain.port(port)) for port in ports}


def breaks_with_one_less(result: Fit, spec: Spec, beam: dict[str, PortModel]) -> bool:
    """Whether taking any one mode away breaks the promise, for the target chosen and in every port that has one."""
    assert result.choice is not None
    assert spec.scene is not None
    hub = result.hub_mass
    assert hub is not None

    def reduced(port: str, count: int) -> PortModel:
        model, motion = beam[port], PORT_MOTION[port]
        if result.kept_for == "clamped":
            out = model.truncated(count)
        else:
            load = motion.T @ hub @ motion if result.kept_for == "hub" else np.zeros((model.motions,) * 2)
            out = model.reduced(count, load)
        return spec.with_ratios(port, out)

    kept = {port: count for port, count in result.choice.modes.items() if count}
    for port in kept:
        fewer = {p: reduced(p, count - (p == port)) for p, count in kept.items()}
        if independent_error(spec, fewer, beam) <= spec.scene.tolerance:
            return False
    return True


@pytest.mark.slow
def test_promise_holds_in_random_scenes_and_the_choice_is_tight():
    broken, tight, flexible, missed = [], 0, 0, 0
    for seed in range(SCENES):
        spec = random_scene(seed)
        assert spec.scene is not None
        result = fit(spec)
        beam = whole(spec)
        found = independent_error(spec, of_chain(spec, result.chain, tuple(result.target)), beam)
        if not result.status.ok:
            missed += 1  # said plainly: allowed, but then it must be true
            assert "above the tolerance" in result.status.message or "keeps" in result.status.message
            continue
        if found > GRID_SLACK * spec.scene.tolerance:
            broken.append((seed, found, spec.scene.tolerance))
        if sum(result.choice.modes.values()) > 0:
            flexible += 1
            tight += breaks_with_one_less(result, spec, beam)
    print(f"{SCENES} scenes: broken {len(broken)}, said not to be met {missed}, tight {tight} of {flexible}")  # noqa: T201
    assert not broken
    assert missed <= SCENES // 10
    assert tight >= TIGHT * flexible


@pytest.mark.parametrize("seed", range(4))
def test_promise_holds_against_the_transcendental_beam(seed):
    rng = np.random.default_rng(seed)
    section = Tube(outer_diameter=float(rng.uniform(0.03, 0.08)), wall=0.002)
    segment = Segment(length=float(rng.uniform(4, 12)), section=section, material=ALUMINIUM)
    beam = Beam(segments=(segment,))
    at = segment.at(np.array([0.0]))
    truth = UniformBeam(segment.length, float(at.bending_xy[0]), float(at.mass[0]))
    hub = Hub(mass=100.0, inertia=(30.0, 40.0, 50.0), offset=(0.5, 0.0, 0.0))
    band = float(truth.cantilever_frequencies(3)[2] * rng.uniform(0.1, 0.9))
    scene = Scene(bandwidth=band, tolerance=1e-3, axes=("z",))
    result = fit(beam, root=Root(hub=hub), scene=scene)
    assert result.status.ok
    load = PORT_MOTION["xy"].T @ hub.mass_matrix() @ PORT_MOTION["xy"]
    omega = np.linspace(band / 500, band, 500)
    # undamped away from the peaks: the response there is that of the exact dynamic mass
    far = np.min(np.abs(omega[:, None] / truth.coupled_frequencies(load, 4)[None] - 1.0), axis=1) > 0.05
    omega = omega[far]
    ours = np.linalg.inv(load + np.moveaxis(result.chain.port("xy").D(omega).real, -1, 0))[:, 1, 1]
    true = np.linalg.inv(load + np.moveaxis(truth.D(omega), -1, 0))[:, 1, 1]
    assert np.max(np.abs(ours - true)) <= scene.tolerance * np.max(np.abs(true)) * 20  # peaks, 0.5 % damped, are 20 x


def tube() -> Beam:
    segment = Segment(length=8.0, section=Tube(outer_diameter=0.05, wall=0.002), material=ALUMINIUM)
    return Beam(segments=(segment,))


HUB = Hub(mass=500.0, inertia=(400.0, 400.0, 500.0), offset=(1.0, 0.0, 0.0))


def test_nothing_flexible_is_kept_where_nothing_is_needed():
    result = fit(tube(), root=Root(hub=HUB), scene=Scene(bandwidth=0.05, tolerance=1e-2, axes=("z",)))
    assert result.status.ok
    assert result.chain.hinges == ()
    assert "joint" not in result.to_mjcf()
    assert np.allclose(result.measured.rigid_mass, tube().rigid_mass(), rtol=1e-12, atol=1e-12)


def test_ports_that_cannot_move_an_axis_that_matters_are_rigid():
    result = fit(tube(), root=Root(hub=HUB), scene=Scene(bandwidth=20.0, tolerance=1e-3, axes=("z",)))
    assert set(result.target) == {"xy"}
    costs = {item.what.split()[0]: item for item in result.left_out}
    assert costs["torsion"].cost == 0.0
    assert "no path to hub axes z" in costs["torsion"].why
    assert any("torsion" in line for line in result.choice.cannot)


def test_a_number_in_modes_overrules_the_choice():
    scene = Scene(bandwidth=20.0, tolerance=1e-3, axes=("z",))
    free = fit(tube(), root=Root(hub=HUB), scene=scene)
    ruled = fit(tube(), root=Root(hub=HUB), scene=scene, modes={"xy": free.choice.modes["xy"] + 1, "torsion": 1})
    assert {p: m.modes for p, m in ruled.target.items()} == {"xy": free.choice.modes["xy"] + 1, "torsion": 1}
    rigid = fit(tube(), root=Root(hub=HUB), scene=scene, modes={"xy": 0})
    assert not rigid.status.ok
    assert "above the tolerance" in rigid.status.message


def test_a_tolerance_no_model_meets_is_said_and_the_best_is_given():
    result = fit(tube(), root=Root(hub=HUB), scene=Scene(bandwidth=3000.0, tolerance=1e-9, axes=("z",)))
    assert not result.status.ok
    assert "above the tolerance" in result.status.message
    assert result.promise > 1e-9
    assert result.target["xy"].modes >= 3


def test_elements_that_nothing_uses_are_left_out():
    scene = Scene(bandwidth=20.0, axes=("z",), visuals=False)
    bare = fit(tube(), root=Root(hub=HUB), scene=scene).to_mjcf()
    assert "<geom" not in bare
    assert "_tip" not in bare
    assert "<tendon" not in bare
    assert "<site" in bare  # the root, which an embedding needs
    solid = fit(tube(), root=Root(hub=HUB), scene=Scene(bandwidth=20.0, axes=("z",), contacts=True, tip=True)).to_mjcf()
    assert 'type="capsule"' in solid
    assert "appendage_tip" in solid


def test_contradictory_wishes_are_refused():
    with pytest.raises(InputError, match="axes"):
        Scene(bandwidth=1.0, axes=())
    with pytest.raises(InputError, match="auto"):
        fit(tube(), root=Root(target="auto"))


def test_steps_keep_the_tolerance_and_the_cheapest_comes_first():
    result = fit(tube(), root=Root(hub=HUB), scene=Scene(bandwidth=20.0, tolerance=1e-2, axes=("z",)))
    costs = [step.cost for step in result.steps]
    assert costs[0] == 1.0
    assert costs == sorted(costs)
    for step in result.steps:
        assert 0.0 < step.step <= result.limits.largest_step[step.integrator]


def test_full_keeps_no_fewer_than_the_scene_needs():
    """A mast with a heavy tip: two modes lie within three times the band, but three are needed."""
    spec = read_spec(str(files("beamchain") / "examples" / "mast.toml"))
    spec = structs.replace(spec, modes=None, scene=Scene(bandwidth=10.0))
    chosen, full = fit(spec), fit(everything(spec))
    assert chosen.choice is not None
    assert all(full.target[port].modes >= count for port, count in chosen.choice.modes.items() if count)
    assert full.promise is not None
    assert full.promise <= 1e-3


def test_no_neighbour_of_the_choice_is_better():
    """The joint that is soft in one plane only: neighbours in both planes were never looked at."""
    spec = spec_from_dict(tube_and_strip(0, {}, scene={"bandwidth": 40.0, "tolerance": 1e-3}), "neighbours")
    spec = structs.replace(spec, modes=None)
    chosen = fit(spec)
    assert chosen.status.ok
    assert chosen.promise is not None
    assert chosen.promise <= 1e-3
    kept = {port: chosen.choice.modes.get(port, 0) for port in PORTS}
    assert spec.scene is not None
    for port in ("xy", "xz"):
        for step in (-1, 1):
            other = fit(structs.replace(spec, modes=Modes(**{**kept, port: kept[port] + step})))
            assert other.promise is not None
            assert other.promise > 1e-3 or step > 0


def test_numbers_beside_a_scene_stay():
    spec = spec_from_dict(tube_and_strip(0, {"xy": 1, "xz": 5}, scene={"bandwidth": 40.0, "tolerance": 1e-3}), "fixed")
    assert {port: model.modes for port, model in fit(spec).target.items() if port in ("xy", "xz")} == {"xy": 1, "xz": 5}
