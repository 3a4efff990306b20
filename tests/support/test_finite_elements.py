"""The finite elements that exact chains are held against: closed forms, published figures,
a shooting method."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import finite_elements as fe

ALU = {"youngs_modulus": 7e10, "density": 2700.0, "poissons_ratio": 0.33}


def unit_beam(**more):
    section = {
        "shape": "equivalent",
        "bending_stiffness_xy": 1.0,
        "linear_mass": 1.0,
        "torsion_stiffness": 1.0,
        "axial_stiffness": 1.0,
        "polar_inertia": 1e-3,
    }
    return {"name": "beam", "segment": [{"length": 1.0, "section": section}], **more}


def roots(function, low, high, steps=4000):
    at = np.linspace(low, high, steps)
    values = [function(x) for x in at]
    return np.array(
        [
            brentq(function, a, b, xtol=1e-14, rtol=1e-15)
            for a, b, u, v in zip(at[:-1], at[1:], values[:-1], values[1:], strict=True)
            if u * v < 0.0
        ]
    )


def stepped():
    """Tapers, a stout segment, joints (one at the root, soft in one plane), lumps,
    one of them at a joint."""
    return {
        "name": "boom",
        "segment": [
            {
                "length": 1.2,
                "section": {"shape": "tube", "outer_diameter": 0.06, "wall": 0.003},
                "section_end": {"shape": "tube", "outer_diameter": 0.03, "wall": 0.002},
                "material": ALU,
                "nonstructural_mass": 0.2,
            },
            {
                "length": 0.7,
                "section": {"shape": "rectangle", "width_y": 0.05, "width_z": 0.12},
                "material": ALU,
                "theory": "timoshenko",
            },
            {
                "length": 2.0,
                "section": {"shape": "box", "width_y": 0.03, "width_z": 0.05, "wall": 0.002},
                "section_end": {"shape": "box", "width_y": 0.02, "width_z": 0.04, "wall": 0.001},
                "material": ALU,
            },
        ],
        "joint": [
            {"after_segment": 0, "stiffness_xz": 900.0},
            {"after_segment": 2, "stiffness_xy": 3000.0, "stiffness_torsion": 500.0},
        ],
        "lump": [{"x": 1.9, "mass": 0.7, "inertia": [0.01, 0.02, 0.015]}, {"x": 3.2, "mass": 0.4}],
    }


def shooting(spec, port, guess):
    """The natural frequency nearest `guess` by marching the beam's equations with an ordinary
    differential solver."""
    bending = port in fe.BENDING
    about = {"xy": 2, "xz": 1, "torsion": 0}[port]

    def tip(w):
        # bending: displacement, rotation, moment, shear; torsion: angle, moment
        state = np.eye(4)[:, 2:] if bending else np.eye(2)[:, 1:]
        x = 0.0
        bodies = sorted(spec.get("lump", ()), key=lambda b: b["x"])
        hinges = {j["after_segment"]: j.get(f"stiffness_{port}") for j in spec.get("joint", ())}
        for i, segment in enumerate(spec["segment"]):
            if hinges.get(i):
                state = state.copy()
                state[1 if bending else 0] += state[2 if bending else 1] / hinges[i]
            ends = [b["x"] for b in bodies if x + 1e-12 < b["x"] < x + segment["length"] - 1e-12]
            for a, b in zip([x, *ends], [*ends, x + segment["length"]], strict=True):

                def rate(s, z, segment=segment, x=x, shape=state.shape):
                    z = z.reshape(shape)
                    at = {
                        k: float(v)
                        for k, v in fe.section_properties(
                            segment, (s - x) / segment["length"]
                        ).items()
                    }
                    if not bending:
                        return np.array(
                            [z[1] / at["torsion"], -(w**2) * at["polar"] * z[0]]
                        ).ravel()
                    shear = (
                        z[3] / at[f"shear_{port}"] if segment.get("theory") == "timoshenko" else 0.0
                    )
                    return np.array(
                        [
                            z[1] + shear,
                            z[2] / at[f"bending_{port}"],
                            -z[3] - w**2 * at[f"rotary_{port}"] * z[1],
                            -(w**2) * at["mass"] * z[0],
                        ]
                    ).ravel()

                done = solve_ivp(
                    rate, (a, b), state.ravel(), method="DOP853", rtol=1e-12, atol=1e-14
                )
                state = done.y[:, -1].reshape(state.shape)
                for body in bodies:
                    if abs(body["x"] - b) < 1e-12:
                        inertia = body.get("inertia", (0.0, 0.0, 0.0))[about]
                        if bending:
                            state[3] -= w**2 * body["mass"] * state[0]
                            state[2] -= w**2 * inertia * state[1]
                        else:
                            state[1] -= w**2 * inertia * state[0]
            x += segment["length"]
        return float(np.linalg.det(state[2:])) if bending else float(state[1, 0])

    return brentq(tip, guess * (1.0 - 1e-3), guess * (1.0 + 1e-3), xtol=1e-13 * guess, rtol=1e-14)


def test_uniform_cantilever():
    beta = roots(lambda b: np.cos(b) + 1.0 / np.cosh(b), 0.5, 26.0)[:8]
    for port in fe.BENDING:
        p = fe.port(unit_beam(), port, 8)
        np.testing.assert_allclose(p.frequencies, beta**2, rtol=2e-12)
        sigma = (np.cos(beta) + np.cosh(beta)) / (np.sin(beta) + np.sinh(beta))
        np.testing.assert_allclose(
            p.participation, np.column_stack([2 * sigma / beta, 2 / beta**2]), rtol=1e-9
        )
        np.testing.assert_allclose(np.abs(p.tip[:, 0]), 2.0, rtol=1e-9)
        # published: effective mass fractions of the first three modes
        np.testing.assert_allclose(
            p.participation[:3, 0] ** 2, [0.613076, 0.188300, 0.064732], atol=1e-6
        )
        np.testing.assert_allclose(
            3.0 * p.participation[:3, 1] ** 2, [0.970688, 0.024716, 0.003152], atol=1e-6
        )
        np.testing.assert_allclose(p.rigid, [[1.0, 0.5], [0.5, 1.0 / 3.0]], rtol=1e-14)


def test_free_beam():
    beta = roots(lambda b: np.cos(b) - 1.0 / np.cosh(b), 1.0, 27.0)[:8]
    np.testing.assert_allclose(fe.port(unit_beam(), "xy", 8).coupled(modes=8), beta**2, rtol=2e-12)


def test_rods():
    spec = unit_beam()
    k = (np.arange(1, 9) - 0.5) * np.pi
    np.testing.assert_allclose(fe.port(spec, "axial", 8).frequencies, k, rtol=1e-12)
    np.testing.assert_allclose(
        fe.port(spec, "torsion", 8).frequencies, k / np.sqrt(1e-3), rtol=1e-12
    )
    np.testing.assert_allclose(
        fe.port(spec, "axial", 8).participation[:, 0], np.sqrt(2.0) / k, rtol=1e-11
    )


def test_published_manipulator_link():
    """DETC2007-35511: 2.82 kg/m, EI 100.64207 N m^2, 3.372 m,
    a payload of 5.18 times the link's mass at its tip."""
    section = {"shape": "equivalent", "bending_stiffness_xy": 5.974**2 * 2.82, "linear_mass": 2.82}
    spec = {"segment": [{"length": 3.372, "section": section}]}
    load = (5.18 * 2.82 * 3.372, (0.0, 0.0, 0.0))
    held = fe.port(spec, "xy", 4, load)
    np.testing.assert_allclose(
        held.frequencies, [0.391031, 8.194197, 26.351741, 54.872162], rtol=2e-6
    )
    # pinned: the displacement held by a huge mass
    pinned = held.coupled(np.diag([1e14, 0.0]), 4)
    np.testing.assert_allclose(pinned, [5.28343, 20.84173, 46.76976, 83.06847], rtol=2e-6)
    mu = 5.18

    def clamped(b):  # 1 + cos cosh + mu b (cos sinh - sin cosh), divided by cosh
        return 1 / np.cosh(b) + np.cos(b) + mu * b * (np.cos(b) * np.tanh(b) - np.sin(b))

    b = roots(clamped, 0.2, 15.0)[:4]
    np.testing.assert_allclose(held.frequencies, b**2 * 5.974 / 3.372**2, rtol=1e-11)


@pytest.mark.slow
def test_stout_cantilever():
    """A Timoshenko cantilever by shooting, and its static deflection."""
    spec = {
        "segment": [
            {
                "length": 2.0,
                "section": {"shape": "rectangle", "width_y": 0.4, "width_z": 0.4},
                "theory": "timoshenko",
                "material": {"youngs_modulus": 1e9, "density": 7850.0, "poissons_ratio": 0.3},
            }
        ]
    }
    p = fe.port(spec, "xy", 3)
    ours = [shooting(spec, "xy", w) for w in p.frequencies]
    np.testing.assert_allclose(p.frequencies, ours, rtol=1e-10)
    at = fe.section_properties(spec["segment"][0], np.array(0.5))
    bend = 2.0**3 / 3.0 / at["bending_xy"]
    shear = 2.0 / at["shear_xy"]
    np.testing.assert_allclose(p.flexibility(2.0)[0, 0], bend + shear, rtol=1e-12)
    assert at["shear_xy"] == pytest.approx(10 * 1.3 / (12 + 11 * 0.3) * 1e9 / 2.6 * 0.16, rel=1e-14)


@pytest.mark.parametrize("port", ["xz", "torsion"])
@pytest.mark.slow
def test_everything_at_once_by_shooting(port):
    spec = stepped()
    p = fe.port(spec, port, 8)
    for w in p.frequencies[1:3]:
        assert shooting(spec, port, w) == pytest.approx(w, rel=2e-11, abs=0.0)


@pytest.mark.parametrize("port", ["xy", "xz", "torsion"])
def test_static_flexibility(port):
    """Mohr's integrals over the drawn stiffness."""
    spec = stepped()
    target = 2.9
    hinges = {0: 0.0, 1: 1.2, 2: 1.9}
    total = np.zeros((2, 2))
    x0 = 0.0
    for segment in spec["segment"]:
        end = min(x0 + segment["length"], target)

        def soft(x, power, segment=segment, x0=x0, kind=port):
            at = fe.section_properties(segment, (x - x0) / segment["length"])
            key = (
                "torsion"
                if kind == "torsion"
                else f"{'shear' if kind.startswith('shear') else 'bending'}_{kind[-2:]}"
            )
            return (target - x) ** power / float(at[key])

        a, b, c = (
            quad(soft, x0, end, args=(power,), epsabs=0.0, epsrel=1e-12)[0] for power in range(3)
        )
        total += [[c, b], [b, a]]
        if segment.get("theory") == "timoshenko" and port != "torsion":
            total[0, 0] += quad(
                lambda x, s=segment, x0=x0: soft(x, 0, s, x0, f"shear_{port}"),
                x0,
                end,
                epsrel=1e-12,
            )[0]
        x0 += segment["length"]
    for joint in spec["joint"]:
        arm = target - hinges[joint["after_segment"]]
        if f"stiffness_{port}" in joint:
            total += np.array([[arm**2, arm], [arm, 1.0]]) / joint[f"stiffness_{port}"]
    expected = total if port != "torsion" else total[1:, 1:]
    np.testing.assert_allclose(fe.port(spec, port, 4).flexibility(target), expected, rtol=1e-9)


def test_rigid_mass_is_that_of_the_rows():
    spec = stepped()
    whole = fe.rigid_mass(spec)
    for port in fe.PORTS:
        turn = fe.into_space(port)
        np.testing.assert_allclose(fe.port(spec, port, 3).rigid, turn.T @ whole @ turn, rtol=1e-12)
    tube = fe.section_properties(spec["segment"][0], np.linspace(0.0, 1.0, 5))
    first = quad(
        lambda x: float(fe.section_properties(spec["segment"][0], x / 1.2)["mass"]), 0.0, 1.2
    )[0]
    assert tube["mass"][0] == pytest.approx(
        np.pi / 4 * (0.06**2 - 0.054**2) * 2700 + 0.2, rel=1e-13
    )
    assert whole[0, 0] > first + 1.1


@pytest.mark.parametrize("port", ["xz", "torsion"])
@pytest.mark.slow
def test_participation_adds_up_to_the_rigid_mass(port):
    """With all modes of the discretisation the effective masses are the rigid
    mass of what moves."""
    p = fe.port(stepped(), port, 400)
    part = p.participation.T @ p.participation
    assert np.all(np.linalg.eigvalsh(p.rigid - part) > -1e-9 * np.linalg.norm(p.rigid))
    np.testing.assert_allclose(part, p.rigid, rtol=1e-2)


def test_coupled_in_space_is_coupled_in_the_planes_for_a_centred_hub():
    spec = stepped()
    hub = np.diag([50.0, 50.0, 50.0, 4.0, 6.0, 7.0])
    apart = np.sort(
        np.concatenate(
            [
                fe.port(spec, p, 6).coupled(fe.into_space(p).T @ hub @ fe.into_space(p), 6)
                for p in fe.PORTS
            ]
        )
    )[:6]
    np.testing.assert_allclose(fe.coupled(spec, hub, 6), apart, rtol=1e-11)
    held = fe.cantilever(spec, {"xy": 4, "xz": 4, "torsion": 2})
    heavy = fe.coupled(spec, 1e13 * np.eye(6), 3)
    np.testing.assert_allclose(heavy, held.frequencies[:3], rtol=1e-9)


def test_payload_is_a_lump():
    spec = stepped()
    load = (2.0, (0.1, 0.2, 0.15))
    lumped = {
        **spec,
        "lump": [*spec["lump"], {"x": fe.length(spec), "mass": 2.0, "inertia": [0.1, 0.2, 0.15]}],
    }
    for port in fe.PORTS:
        np.testing.assert_allclose(
            fe.port(spec, port, 5, load).frequencies,
            fe.port(lumped, port, 5).frequencies,
            rtol=1e-14,
        )
    np.testing.assert_allclose(fe.rigid_mass(spec, load), fe.rigid_mass(lumped), rtol=1e-14)


@pytest.mark.parametrize("make", [unit_beam, stepped])
@pytest.mark.parametrize("port", ["xy", "xz", "torsion"])
def test_two_ports_keep_modes_and_static_flexibility(make, port):
    spec = make()
    n = 3
    x = fe.length(spec)
    model = fe.two_port(spec, port, n, x)
    whole = fe.port(spec, port, n)
    np.testing.assert_allclose(model.frequencies[:n], whole.frequencies, rtol=1e-11)
    np.testing.assert_allclose(model.participation[:n], whole.participation, rtol=1e-8)
    np.testing.assert_allclose(model.motion[:n], whole.tip, rtol=1e-8)
    static = (model.motion.T / model.frequencies**2) @ model.motion
    np.testing.assert_allclose(static, whole.flexibility(x), rtol=1e-10)
    np.testing.assert_allclose(model.coupled((0.0, (0.0,) * 3), n), whole.frequencies, rtol=1e-11)


@pytest.mark.parametrize("ratio", [0.0, 0.1, 1.0, 10.0, 1000.0])
@pytest.mark.parametrize(("modes", "bound"), [(2, 1e-5), (3, 2e-4)])
def test_two_ports_are_good_for_any_payload(modes, bound, ratio):
    """What n normal modes and the static shapes are worth, without any chain:
    a bound for the chains that keep them."""
    load = (ratio, (0.0, 0.0, 0.0))
    truth = fe.port(unit_beam(), "xy", 6, load)
    model = fe.two_port(unit_beam(), "xy", modes)
    np.testing.assert_allclose(model.coupled(load, modes), truth.frequencies[:modes], rtol=bound)
    for weight in (20.0, 1e4):
        hub = weight * np.array([[1.0, -0.2], [-0.2, 0.4]])
        np.testing.assert_allclose(
            model.coupled(load, modes, hub), truth.coupled(hub, modes), rtol=max(bound, 2e-4)
        )
