"""What a scene does not need: the promise holds in every random scene, and the choice is tight.

The promise is checked independently of the choice: the written file through MuJoCo's own matrices
against finite elements, with the 6 x 6 definition of the in-band error written out again here, on a
grid of its own; for uniform beams against the closed forms of the cantilever. No scene and no
frequency is left out.
"""

from importlib.resources import files

import numpy as np
import pytest
from msgspec import structs
from scipy.linalg import eigh

import finite_elements as fe
import readback as rb
from beamchain import (
    Beam,
    Damping,
    Fit,
    Hub,
    Joint,
    Lump,
    Material,
    Modes,
    Rectangle,
    Scene,
    Segment,
    Spec,
    Tube,
    fit,
    read_spec,
)
from beamchain.spec import Root
from every_mode import everything
from random_appendages import random_appendage
from solver import body_mass
from spec_tables import spec_of, table_of
from uniform_beam import held_roots

AXES = {"tx": 0, "ty": 1, "tz": 2, "x": 3, "y": 4, "z": 5}  # turns are x, y, z of a scene
SCENES = 16
# the independent grid may hit a peak a little nearer its top than the choice's own
GRID_SLACK = 1.02
TIGHT = 0.9  # share of scenes in which one mode fewer breaks the promise
DAMPING = 0.005
# relative: promise and what is found; both grids may miss the top of the worst peak a little
AGREE = 0.03
MODES = {"xy": 16, "xz": 16, "torsion": 6, "axial": 4}  # in finite elements: far above every band
SERIES = 12  # clamped modes of the closed form

ALUMINIUM = Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33)


def random_scene(seed: int) -> Spec:
    rng = np.random.default_rng(seed)
    kind = rng.integers(3)
    length = float(rng.uniform(2.0, 12.0))
    if kind == 0:
        diameter = float(rng.uniform(0.02, 0.1))
        segments: tuple[Segment, ...] = (
            Segment(
                length=length, section=Tube(outer_diameter=diameter, wall=0.002), material=ALUMINIUM
            ),
        )
    elif kind == 1:
        section = Rectangle(
            width_y=float(rng.uniform(0.01, 0.05)), width_z=float(rng.uniform(0.1, 0.5))
        )
        segments = (Segment(length=length, section=section, material=ALUMINIUM),)
    else:
        big = Tube(outer_diameter=0.08, wall=0.002)
        small = Tube(outer_diameter=float(rng.uniform(0.03, 0.07)), wall=0.0015)
        segments = (
            Segment(
                length=length / 2,
                section=big,
                section_end=small,
                material=ALUMINIUM,
                nonstructural_mass=0.5,
            ),
            Segment(length=length / 2, section=small, material=ALUMINIUM),
        )
    joints = (
        (Joint(after_segment=0, stiffness_xy=float(10 ** rng.uniform(2.5, 5))),)
        if rng.random() < 0.3
        else ()
    )
    lumps = ()
    if rng.random() < 0.3:
        lumps = (
            Lump(
                x=length * float(rng.uniform(0.5, 1.0)),
                mass=float(rng.uniform(0.2, 3.0)),
                inertia=(0.01,) * 3,
            ),
        )
    beam = Beam(segments=segments, joints=joints, lumps=lumps)
    first = float(beam.port("xy", 4).frequencies[0])
    mass = float(beam.rigid_mass()[0, 0] * 10 ** rng.uniform(0.0, 2.5))
    side = length * float(rng.uniform(0.1, 0.4))
    inertia = tuple(float(mass * side**2 / 6.0 * v) for v in rng.uniform(0.8, 1.2, 3))
    offset = (side / 2, float(rng.choice([0.0, 0.2 * side])), 0.0)
    axes = [("z",), ("y",), ("x", "y", "z"), ("z", "ty"), ("x", "y", "z", "tx", "ty", "tz")][
        rng.integers(5)
    ]
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


def independent_error(spec: Spec, result: Fit) -> float:
    """The in-band error of the file that is written, frequency by frequency, from its definition.

    The file's dynamic mass is of MuJoCo's own matrices, the beam's of finite elements:
    the package computes none of it.
    """
    assert spec.scene is not None
    assert spec.scene.bandwidth is not None
    assert spec.root.hub is not None
    hub = body_mass(spec.root.hub.mass, [-v for v in spec.root.hub.offset], spec.root.hub.inertia)
    beam = table_of(spec)
    band = spec.scene.bandwidth
    rigid = fe.rigid_mass(beam)
    modes = fe.cantilever(beam, MODES)
    whole = np.block(
        [
            [hub + rigid, modes.participation.T],
            [modes.participation, np.eye(modes.frequencies.size)],
        ]
    )
    squares = eigh(
        np.diag(np.concatenate([np.zeros(6), modes.frequencies**2])), whole, eigvals_only=True
    )
    peaks = [np.sqrt(squares[6:]), modes.frequencies]
    w = np.zeros(0)
    rows = np.zeros((0, 6))
    damping = np.zeros((0, 0))
    mass = result.measured.rigid_mass
    if result.chain.hinges:
        model = rb.read(result.to_mjcf())
        mass = model.rigid
        w = model.frequencies
        rows = model.participation
        damping = model.damping
        peaks += [model.coupled(hub), w]
    peak = np.concatenate(peaks)
    around = DAMPING * np.geomspace(0.05, 30.0, 40)
    near = np.outer(peak[peak < 1.2 * band], 1.0 + np.concatenate([-around, [0.0], around])).ravel()
    omega = np.unique(np.concatenate([np.linspace(band / 500, band, 500), near]))
    omega = omega[(omega > 0) & (omega <= band)]
    keep = [AXES[a] for a in spec.scene.axes]
    scale = np.sqrt(np.diag(hub + rigid))[keep]

    def response(
        mass: np.ndarray, rows: np.ndarray, squares: np.ndarray, damping: np.ndarray
    ) -> np.ndarray:
        s = 1j * omega[:, None, None]
        inner = s**2 * np.eye(len(rows)) + s * damping + np.diag(squares)
        felt = rows.T @ np.linalg.solve(inner, s**2 * rows)
        return np.linalg.inv(hub + mass - felt)[:, keep][:, :, keep] * np.outer(scale, scale)

    ours = response(mass, rows, w**2, damping)
    true = response(
        rigid, modes.participation, modes.frequencies**2, np.diag(2.0 * DAMPING * modes.frequencies)
    )
    frozen = np.linalg.inv(hub + rigid)[np.ix_(keep, keep)] * np.outer(scale, scale)
    size = np.maximum(np.linalg.norm(true, 2, axis=(1, 2)), np.linalg.norm(frozen, 2))
    return float(np.max(np.linalg.norm(ours - true, 2, axis=(1, 2)) / size))


def breaks_with_one_less(result: Fit, spec: Spec) -> bool:
    """Whether every fit with one mode less, in whichever port has one, breaks the promise."""
    assert result.choice is not None
    assert spec.scene is not None
    kept = {port: result.choice.modes.get(port, 0) for port in fe.PORTS}
    for port in (p for p in fe.PORTS if kept[p]):
        less = structs.replace(spec, modes=Modes(**{**kept, port: kept[port] - 1}))
        if independent_error(less, fit(less)) <= spec.scene.tolerance:
            return False
    return True


@pytest.mark.slow
def test_promise_holds_in_random_scenes_and_the_choice_is_tight():
    broken = []
    missed = []
    tight = 0
    flexible = 0
    for seed in range(SCENES):
        spec = random_scene(seed)
        assert spec.scene is not None
        result = fit(spec)
        found = independent_error(spec, result)
        if not result.status.ok:  # the most modes that are tried: said, and true
            missed.append(seed)
            assert result.promise == pytest.approx(found, rel=AGREE)
            assert found > spec.scene.tolerance
        elif found > GRID_SLACK * spec.scene.tolerance:
            broken.append((seed, found, spec.scene.tolerance))
        if sum(result.choice.modes.values()) > 0:
            flexible += 1
            tight += breaks_with_one_less(result, spec)
    print(  # noqa: T201
        f"{SCENES} scenes: broken {len(broken)}, said not to be met {missed}, tight {tight} of "
        f"{flexible}"
    )
    assert not broken
    assert len(missed) <= 1
    assert tight >= TIGHT * flexible


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2, 5])
def test_promise_holds_where_tapers_joints_and_lumps_abound(seed):
    given = random_appendage(seed)
    rng = np.random.default_rng(seed)
    mass = float(fe.rigid_mass(given)[0, 0] * 10.0 ** rng.uniform(0.5, 2.0))
    given = {key: given[key] for key in ("name", "segment", "joint", "lump") if key in given} | {
        "damping": {"ratio": DAMPING},
        "root": {"hub": {"mass": mass, "inertia": [0.4 * mass] * 3, "offset": [0.5, 0.0, 0.1]}},
        "scene": {
            "bandwidth": float(fe.port(given, "xy").frequencies[0] * rng.uniform(1.0, 8.0)),
            "tolerance": float(10.0 ** rng.uniform(-3.5, -1.5)),
        },
    }
    spec = spec_of(given)
    result = fit(spec)
    found = independent_error(spec, result)
    assert result.promise == pytest.approx(found, rel=AGREE)
    assert result.status.ok
    assert found <= GRID_SLACK * spec.scene.tolerance


@pytest.mark.slow
def test_dampers_that_couple_the_modes_are_part_of_the_promise():
    """Plain joint damping couples the modes, which a diagonal approximation misses:
    1.0e-3 at a tolerance of 7.5e-4, and 2.1e-4 stated by it."""
    spec = random_scene(11)
    result = fit(spec)
    found = independent_error(spec, result)
    assert result.status.ok
    assert found <= GRID_SLACK * spec.scene.tolerance
    assert found <= (1.0 + AGREE) * result.promise
    assert not any(hinge.damping for hinge in result.chain.hinges)
    plain = fit(structs.replace(spec, damping=Damping(ratio=DAMPING, form="hinge")))
    assert plain.promise == pytest.approx(independent_error(spec, plain), rel=AGREE)
    assert not any(tendon.damping for tendon in plain.chain.tendons)


@pytest.mark.parametrize("seed", [0, 1])
def test_promise_holds_against_the_transcendental_beam(seed):
    rng = np.random.default_rng(seed)
    section = Tube(outer_diameter=float(rng.uniform(0.03, 0.08)), wall=0.002)
    segment = Segment(length=float(rng.uniform(4, 12)), section=section, material=ALUMINIUM)
    beam = Beam(segments=(segment,))
    table = table_of(beam)
    at = fe.section_properties(table["segment"][0], 0.0)
    length = segment.length
    line = float(at["mass"])
    beta = held_roots(SERIES)
    w = beta**2 * np.sqrt(float(at["bending_xy"]) / line) / length**2
    hub = Hub(mass=100.0, inertia=(30.0, 40.0, 50.0), offset=(0.5, 0.0, 0.0))
    band = float(w[2] * rng.uniform(0.1, 0.9))
    scene = Scene(bandwidth=band, tolerance=1e-3, axes=("z",))
    result = fit(beam, root=Root(hub=hub), scene=scene, damping=Damping(ratio=DAMPING))
    assert result.status.ok
    load = rb.into_space("xy").T @ hub.mass_matrix() @ rb.into_space("xy")
    # 0.5 % in every mode: the exact series of the clamped modes, with what they leave of the mass
    mass = line * length
    sigma = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
    rows = np.sqrt(mass) * np.column_stack([2.0 * sigma / beta, 2.0 * length / beta**2])
    rigid = mass * np.array([[1.0, length / 2.0], [length / 2.0, length**2 / 3.0]])
    peaks = np.concatenate(
        [fe.port(table, "xy", 8).coupled(load, 6), w, result.achieved["xy"].frequencies]
    )
    around = np.concatenate(
        [-DAMPING * np.geomspace(0.05, 30.0, 40), [0.0], DAMPING * np.geomspace(0.05, 30.0, 40)]
    )
    omega = np.unique(
        np.concatenate([np.linspace(band / 500, band, 500), np.outer(peaks, 1.0 + around).ravel()])
    )
    omega = omega[(omega > 0.0) & (omega <= band)]
    s = 1j * omega[:, None, None]
    gain = s**2 / (s**2 + 2.0 * DAMPING * w * s + w**2)
    dynamic = rigid - np.einsum("kfn,ni,nj->kij", gain, rows, rows, optimize=True)
    true = np.linalg.inv(load + dynamic)[:, 1, 1]
    file = rb.read(result.to_mjcf())
    turn = rb.into_space("xy")
    found, lines, ratios = file.port("xy")
    gain = s**2 / (s**2 + 2.0 * ratios * found * s + found**2)
    dynamic = turn.T @ file.rigid @ turn - np.einsum(
        "kfn,ni,nj->kij", gain, lines, lines, optimize=True
    )
    ours = np.linalg.inv(load + dynamic)[:, 1, 1]
    floor = np.linalg.inv(load + rigid)[1, 1]
    worst = np.max(np.abs(ours - true) / np.maximum(np.abs(true), floor))
    assert worst <= GRID_SLACK * scene.tolerance
    assert result.promise == pytest.approx(worst, rel=AGREE)


def tube() -> Beam:
    segment = Segment(length=8.0, section=Tube(outer_diameter=0.05, wall=0.002), material=ALUMINIUM)
    return Beam(segments=(segment,))


HUB = Hub(mass=500.0, inertia=(400.0, 400.0, 500.0), offset=(1.0, 0.0, 0.0))


def test_nothing_flexible_is_kept_where_nothing_is_needed():
    result = fit(
        tube(), root=Root(hub=HUB), scene=Scene(bandwidth=0.05, tolerance=1e-2, axes=("z",))
    )
    assert result.status.ok
    assert result.chain.hinges == ()
    assert "joint" not in result.to_mjcf()
    assert np.allclose(result.measured.rigid_mass, tube().rigid_mass(), rtol=1e-12, atol=1e-12)


def test_ports_that_cannot_move_an_axis_that_matters_are_rigid():
    result = fit(
        tube(), root=Root(hub=HUB), scene=Scene(bandwidth=20.0, tolerance=1e-3, axes=("z",))
    )
    assert set(result.target) == {"xy"}
    costs = {item.what.split()[0]: item for item in result.left_out}
    assert costs["torsion"].cost == 0.0
    assert "no path to hub axes z" in costs["torsion"].why
    assert any("torsion" in line for line in result.choice.cannot)


@pytest.mark.slow
def test_a_number_in_modes_overrules_the_choice():
    scene = Scene(bandwidth=20.0, tolerance=1e-3, axes=("z",))
    free = fit(tube(), root=Root(hub=HUB), scene=scene)
    ruled = fit(
        tube(),
        root=Root(hub=HUB),
        scene=scene,
        modes={"xy": free.choice.modes["xy"] + 1, "torsion": 1},
    )
    assert {p: m.modes for p, m in ruled.target.items()} == {
        "xy": free.choice.modes["xy"] + 1,
        "torsion": 1,
    }
    rigid = fit(tube(), root=Root(hub=HUB), scene=scene, modes={"xy": 0})
    assert not rigid.status.ok
    assert "above the tolerance" in rigid.status.message


@pytest.mark.slow
def test_a_tolerance_no_model_meets_is_said_and_the_best_is_given():
    result = fit(
        tube(), root=Root(hub=HUB), scene=Scene(bandwidth=100.0, tolerance=1e-9, axes=("z",))
    )
    assert not result.status.ok
    assert "above the tolerance" in result.status.message
    assert result.promise > 1e-9
    assert result.target["xy"].modes >= 3


@pytest.mark.slow
def test_free_ports_do_not_fill_up_where_typed_modes_miss_the_tolerance():
    hub = Hub(mass=30.0, inertia=(10.0, 12.0, 15.0), offset=(0.5, 0.4, 0.3))
    result = fit(
        tube(),
        root=Root(hub=hub),
        scene=Scene(bandwidth=60.0, tolerance=1e-3),
        modes={"xy": 1, "xz": 1, "torsion": 0},
    )
    assert not result.status.ok
    assert result.choice.modes["axial"] <= 1  # further ones lower the error by less than 1 %


def test_elements_that_nothing_uses_are_left_out():
    kept = {"xy": 1, "xz": 0}
    bare = fit(tube(), modes=kept, scene=Scene(visuals=False)).to_mjcf()
    assert "<geom" not in bare
    assert "_tip" not in bare
    assert "<tendon" not in bare
    assert "<site" in bare  # the root, which an embedding needs
    solid = fit(tube(), modes=kept, scene=Scene(contacts=True, tip=True)).to_mjcf()
    assert 'type="capsule"' in solid
    assert "appendage_tip" in solid


def test_steps_keep_the_tolerance_and_the_cheapest_comes_first():
    result = fit(
        tube(), root=Root(hub=HUB), scene=Scene(bandwidth=20.0, tolerance=1e-2, axes=("z",))
    )
    costs = [step.cost for step in result.steps]
    assert costs[0] == 1.0
    assert costs == sorted(costs)
    for step in result.steps:
        assert 0.0 < step.step <= result.limits.largest_step[step.integrator]


@pytest.mark.slow
def test_full_keeps_no_fewer_than_the_scene_needs():
    """A mast with a heavy tip: two modes lie within three times the band, but three are needed."""
    spec = read_spec(str(files("beamchain") / "examples" / "instrument_mast.toml"))
    spec = structs.replace(spec, modes=None, scene=Scene(bandwidth=10.0))
    chosen = fit(spec)
    assert chosen.choice is not None
    full = everything(spec)
    assert all(getattr(full.modes, port) >= count for port, count in chosen.choice.modes.items())
    assert fit(full).promise <= 1e-3
