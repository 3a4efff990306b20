"""Exact chains: every figure read from the exported file through MuJoCo,
against finite elements of the tests' own."""

import numpy as np
import pytest

import beamchain as bc
import finite_elements as fe
import frames
import readback as rb
from random_appendages import random_appendage, toml, tube_and_strip, uniform
from solver import body_mass

RATIOS = (0.1, 1000.0)  # payload over appendage mass; none is the second port itself
RANDOM, QUICK = 16, 4  # random appendages, and those of them in the quick half


def fitted(spec, folder):
    """The fit of a spec given as a dict, by way of its file."""
    path = folder / f"{spec['name']}.toml"
    path.write_text(toml(spec))
    return bc.fit(bc.read_spec(path))


def exported(spec, folder):
    """The exported file's text."""
    fit = fitted(spec, folder)
    assert fit.status.ok, fit.status.message
    return fit.to_mjcf()


def some_slow(values, quick):
    """All values, those after the first `quick` marked slow."""
    return [
        v if i < quick else pytest.param(v, marks=pytest.mark.slow) for i, v in enumerate(values)
    ]


def check_rigid(reading, expected, tolerance):
    """Rigid mass; where no polar inertia is stated MuJoCo still needs some,
    which must be next to nothing."""
    expected = expected.copy()
    if expected[3, 3] == 0.0:
        assert 0.0 <= reading.rigid[3, 3] < 2e-3 * expected[4, 4]
        expected[3, 3] = reading.rigid[3, 3]
    assert rb.mass_error(reading.rigid, expected) < tolerance


def check_ports(reading, spec, frequency, participation, ratio=1e-5):
    """Kept modes of every port of a straight appendage; further modes lie above them."""
    assert reading.coupling() < 1e-9
    for port, count in spec["modes"].items():
        w, rows, ratios = reading.port(port)
        if not count:
            assert w.size == 0
            continue
        truth = fe.port(spec, port, count)
        assert w.size >= count
        assert np.all(w[count:] > w[count - 1])
        off, rows_off = rb.mode_error(
            (w[:count], rows[:count]),
            (truth.frequencies, truth.participation),
            truth.rigid,
            near=0.0,
        )
        assert off < frequency, f"{port}: frequencies off by {off:.1e}"
        assert rows_off < participation, f"{port}: participation off by {rows_off:.1e}"
        # the residual mass is what the truth leaves: no weight goes elsewhere
        if "damping" in spec:
            np.testing.assert_allclose(ratios[:count], spec["damping"]["ratio"], rtol=ratio)


# -- straight appendages ---------------------------------------------------------------------------
@pytest.mark.parametrize(("joint_at", "xy", "xz"), [(0, 2, 2), (1, 3, 2), (0, 6, 6)])
def test_a_hinge_that_is_soft_in_one_plane(tmp_path, joint_at, xy, xz):
    """A tube and a strip; no cut serves both planes' recursions,
    least squares left errors near 1."""
    spec = tube_and_strip(joint_at, {"xy": xy, "xz": xz}, damping={"ratio": 0.005})
    reading = rb.read(exported(spec, tmp_path))
    check_ports(reading, spec, 1e-9, 1e-8)
    check_rigid(reading, fe.rigid_mass(spec), 1e-12)


@pytest.mark.parametrize("joint_at", [0, 1])
def test_the_same_with_torsion(tmp_path, joint_at):
    spec = tube_and_strip(joint_at, {"xy": 3, "xz": 2, "torsion": 2})
    reading = rb.read(exported(spec, tmp_path))
    check_ports(reading, spec, 1e-9, 1e-8)
    check_rigid(reading, fe.rigid_mass(spec), 1e-12)


@pytest.mark.parametrize("modes", [1, 3, 8, 12])
@pytest.mark.slow
def test_one_plane(tmp_path, modes):
    """A planar chain, up to 12 modes; the other plane is left rigid on purpose."""
    spec = uniform({"xy": modes, "xz": 0})
    reading = rb.read(exported(spec, tmp_path))
    check_ports(reading, spec, 1e-9, 1e-8)
    check_rigid(reading, fe.rigid_mass(spec), 1e-11)


def test_random_appendages_hold_what_they_should():
    specs = [random_appendage(seed) for seed in range(RANDOM)]
    hinged = [{j["after_segment"]: j for j in spec.get("joint", ())} for spec in specs]
    one_plane = [
        h for h in hinged if 0 in h and ("stiffness_xy" in h[0]) != ("stiffness_xz" in h[0])
    ]
    assert sum(0 in h for h in hinged) > 5
    assert len(one_plane) > 3
    assert sum(any("section_end" in s for s in spec["segment"]) for spec in specs) > 7
    assert sum("lump" in spec for spec in specs) > 8
    assert sum("root" in spec for spec in specs) > 5
    counts = [(spec["modes"]["xy"], spec["modes"]["xz"]) for spec in specs]
    assert {n for pair in counts for n in pair} == set(range(1, 7))
    assert sum(xy != xz for xy, xz in counts) > 8


@pytest.mark.parametrize("seed", some_slow(range(RANDOM), QUICK))
def test_random_appendages(tmp_path, seed):
    spec = random_appendage(seed)
    fit = fitted(spec, tmp_path)
    assert fit.status.ok, fit.status.message
    reading = rb.read(fit.to_mjcf())
    check_ports(reading, spec, 1e-7, 1e-7)
    check_rigid(reading, fe.rigid_mass(spec), 1e-9)


@pytest.mark.parametrize("seed", [0, 3, 8])
@pytest.mark.slow
def test_coupled_to_a_hub_as_the_kept_modes_say(tmp_path, seed):
    """The file on a free base, through MuJoCo's derivatives,
    against finite elements reduced to the kept modes."""
    spec = random_appendage(seed)
    reading = rb.read(exported(spec, tmp_path))
    counts = {port: n for port, n in spec["modes"].items() if n}
    kept = fe.cantilever(spec, counts)
    hub = body_mass(50.0, (-0.3, 0.1, 0.2), (30.0, 35.0, 40.0))
    mass = np.eye(kept.frequencies.size) - kept.participation @ np.linalg.solve(
        hub + kept.rigid, kept.participation.T
    )
    w = kept.frequencies
    inverse = np.linalg.eigvalsh(mass / np.outer(w, w))
    expected = 1.0 / np.sqrt(inverse[::-1])
    found = reading.coupled(hub)
    if found.size == expected.size:  # no further modes
        np.testing.assert_allclose(found, expected, rtol=1e-7)
    else:
        np.testing.assert_allclose(
            found[: expected.size // 2], expected[: expected.size // 2], rtol=1e-3
        )


# -- coupled modes ---------------------------------------------------------------------------------
def frame_spec(seed, folder):
    """An L or skew frame as a modes file: 4 to 12 modes, rotated axes, mm and tonnes,
    an offset reference point."""
    count = 4 + (5 * seed) % 9
    found = frames.l_frame(seed, count)
    length, mass = ((1.0, 1.0), (1e-3, 1e3))[seed % 2]
    axes = frames.turned_axes(seed) if seed % 4 else np.eye(3)
    reference = np.array([0.3, -0.2, 0.5]) / length * (seed % 3 > 0)
    table = frames.write_modes(
        folder / f"modes{('.toml', '.json')[seed // 2 % 2]}",
        found,
        length,
        mass,
        axes,
        reference,
        hertz=seed % 5 == 4,
    )
    return {"name": f"frame{seed}", "imported": table}, found


@pytest.mark.parametrize("seed", some_slow([0, 4, 7], 1))
def test_frames_out_of_one_axis(tmp_path, seed):
    """All six participations, in SI about the port, of frames whose motions couple."""
    spec, found = frame_spec(seed, tmp_path)
    reading = rb.read(exported(spec, tmp_path))
    n = found.frequencies.size
    assert reading.frequencies.size >= n
    kept = (reading.frequencies[:n], reading.participation[:n])
    frequency, rows = rb.mode_error(
        kept, (found.frequencies, found.participation), found.rigid, near=1e-6
    )
    assert frequency < 1e-7
    assert rows < 1e-7
    assert np.all(reading.frequencies[n:] > reading.frequencies[n - 1])
    assert rb.mass_error(reading.rigid, found.rigid) < 1e-9
    np.testing.assert_allclose(reading.ratios[:n], 0.005, rtol=1e-5)


@pytest.mark.slow
def test_a_frame_pushes_back_as_its_modes_do(tmp_path):
    """Dynamic mass over the band in all six motions,
    which does not care how close modes are turned."""
    spec, found = frame_spec(0, tmp_path)
    reading = rb.read(exported(spec, tmp_path))
    size = np.sqrt(np.diag(found.rigid))
    w = found.frequencies
    rows = found.participation
    for at in np.geomspace(0.3 * w[0], w[-1], 60):
        s = 1j * at
        gain = s**2 / (s**2 + 0.01 * w * s + w**2)
        expected = (found.rigid - (rows.T * gain) @ rows) / np.outer(size, size)
        got = reading.dynamic_mass(at) / np.outer(size, size)
        if reading.frequencies.size == w.size:
            assert np.linalg.norm(got - expected) < 1e-5 * np.linalg.norm(expected)
        else:  # further modes above the band push too
            assert np.linalg.norm(got - expected) < 0.2 * np.linalg.norm(expected)


# -- two ports -------------------------------------------------------------------------------------
def tip_specs():
    """Appendages that carry a payload at the tip, and one with a further port along the way:
    (spec, site, x)."""
    load = {"mass": 5.0, "inertia": [0.1, 0.1, 0.1]}
    two, three = ({"xy": n, "xz": n} for n in (2, 3))
    camera = [{"name": "camera", "x": 4.2}]
    return {
        "uniform": (uniform(two, payload=load), "boom_tip", 6.0),
        "root hinge": (tube_and_strip(0, three, payload=load), "array_tip", 6.0),
        "mid hinge": (tube_and_strip(1, two, payload=load), "array_tip", 6.0),
        "camera": (uniform({**two, "torsion": 1}, port=camera), "boom_camera", 4.2),
    }


TIPS = tip_specs()
SLOW_TIPS = ("mid hinge", "camera")
QUICK_TIPS = [name for name in TIPS if name not in SLOW_TIPS]
BOUND = {2: 2e-4, 3: 5e-4}


@pytest.fixture(
    scope="module",
    params=[*QUICK_TIPS, *(pytest.param(t, marks=pytest.mark.slow) for t in SLOW_TIPS)],
)
def carried(request, tmp_path_factory):
    """A spec with two ports, its site, where that is, and the exported file."""
    spec, site, x = TIPS[request.param]
    return spec, site, x, exported(spec, tmp_path_factory.mktemp("tip"))


def payload(spec, ratio):
    """A payload of so many appendage masses, with some inertia."""
    mass = ratio * fe.rigid_mass(spec)[0, 0]
    return mass, (0.002 * mass, 0.003 * mass, 0.0025 * mass)


@pytest.mark.slow
def test_the_second_port_is_exact(carried):
    """Normal modes at both ends, and the static flexibility of the second port."""
    spec, site, x, text = carried
    reading = rb.read(text)
    flexibility = reading.flexibility(site)
    for port, count in spec["modes"].items():
        w, rows, _ = reading.port(port)
        truth = fe.port(spec, port, count)
        np.testing.assert_allclose(w[:count], truth.frequencies, rtol=1e-9)
        size = np.sqrt(np.diag(truth.rigid))
        np.testing.assert_allclose(rows[:count] / size, truth.participation / size, atol=1e-8)
        turn = fe.into_space(port)
        static = truth.flexibility(x)
        big = np.sqrt(np.diag(static))
        np.testing.assert_allclose(
            (turn.T @ flexibility @ turn - static) / np.outer(big, big), 0.0, atol=1e-7
        )
    check_rigid(reading, fe.rigid_mass(spec), 1e-11)


def test_every_kept_mode_moves_the_site_as_the_beam_does(carried):
    spec, site, x, text = carried
    reading = rb.read(text)
    motion = reading.site(site)
    for port, count in spec["modes"].items():
        truth = fe.port(spec, port, count)
        turn = fe.into_space(port)
        for w, row, there in zip(
            truth.frequencies, truth.participation, truth.motion(x), strict=True
        ):
            close = np.abs(reading.frequencies / w - 1.0) < 1e-8
            # of modes in both planes at one frequency, the part in this plane:
            # participation times motion
            got = reading.participation[close].T @ motion[close]
            expected = np.outer(row, there)
            assert np.max(np.abs(turn.T @ got @ turn - expected)) < 1e-7 * np.linalg.norm(expected)


@pytest.mark.parametrize("ratio", RATIOS)
def test_a_payload_of_any_mass_welded_to_the_site(carried, ratio):
    """Root held, the payload in the file: the first n coupled frequencies
    against finite elements."""
    spec, site, x, text = carried
    mass, inertia = payload(spec, ratio)
    reading = rb.read(rb.with_payload(text, site, mass, inertia) if mass else text)
    for port, count in spec["modes"].items():
        truth = fe.port(spec, port, count, (mass, inertia, x)).frequencies
        np.testing.assert_allclose(
            reading.port(port)[0][:count], truth, rtol=BOUND.get(count, 2e-4), err_msg=port
        )


@pytest.mark.parametrize("ratio", RATIOS)
def test_a_payload_of_any_mass_and_a_hub(carried, ratio):
    """Root free on a hub of 20 appendages: the lowest coupled frequencies of a plane."""
    spec, site, x, text = carried
    mass, inertia = payload(spec, ratio)
    own = fe.rigid_mass(spec)[0, 0]
    hub = np.diag([20.0 * own] * 3 + [10.0 * own] * 3)
    found = rb.read(text).coupled(hub, site=site, payload=(mass, inertia))
    for port, count in spec["modes"].items():
        turn = fe.into_space(port)
        truth = fe.port(spec, port, count + 2, (mass, inertia, x)).coupled(
            turn.T @ hub @ turn, count
        )
        for w in truth:
            assert np.min(np.abs(found / w - 1.0)) < BOUND.get(count, 2e-4)


@pytest.mark.parametrize("ratio", RATIOS)
def test_the_file_is_the_modal_model(carried, ratio):
    """Modes and static shapes, no more: where the file has no further modes MuJoCo agrees with
    that model closely."""
    spec, site, x, text = carried
    mass, inertia = payload(spec, ratio)
    reading = rb.read(rb.with_payload(text, site, mass, inertia) if mass else text)
    for port, count in spec["modes"].items():
        model = fe.two_port(spec, port, count, x)
        w = reading.port(port)[0]
        bare = model.frequencies.size == w.size
        np.testing.assert_allclose(
            w[:count],
            model.coupled((mass, inertia), count),
            rtol=1e-8 if bare else BOUND.get(count, 2e-4),
        )
