"""The whole walk: `fit`, what it hands out, what it writes,
how it says that less came out than was asked for. `files.to_json` is internal."""

import dataclasses
import json

import mujoco
import numpy as np
import pytest
from lxml import etree

import beamchain as bc
import finite_elements as fe
from appendages import close, seed_boom
from arrays import deployed_array, tube
from beamchain import linearise
from beamchain.files import to_json
from command import run
from planar_truth import Plane
from solver import body_mass
from spec_tables import table_of

# frequencies through MuJoCo's centred differences; 1e-11 on the bench, 1e-9 with a free joint
MODES = 1e-8
KEPT = {"xy": 2, "xz": 2, "torsion": 1}
HUB = bc.Hub(mass=500.0, inertia=(400.0, 400.0, 500.0), offset=(1.0, 0.2, 0.0))

TUBE = """
name = "boom"
[[segment]]
length = 8.0
section = { shape = "tube", outer_diameter = 0.05, wall = 0.002 }
material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }
"""


def coupled_as_kept(hub):
    """Frequencies of the kept modes of the tube on a hub,
    from finite elements and the hub's numbers."""
    kept = fe.cantilever(table_of(tube()), KEPT)
    carried = body_mass(hub.mass, [-v for v in hub.offset], hub.inertia)
    return Plane(kept.rigid, kept.frequencies, kept.participation).free_frequencies(carried)


def silent(model, data):
    return not any(int(warning.number) for warning in data.warning)


# -- Python ----------------------------------------------------------------------------------------
def test_a_fit_is_frozen_and_complete():
    result = bc.fit(tube(), name="boom", modes=KEPT, root=bc.spec.Root(hub=HUB))
    assert result.status.ok
    assert list(result.target) == list(result.achieved) == list(result.readback_error) == list(KEPT)
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.status = None  # type: ignore[misc]
    assert set(result.seconds) == {"model", "realise", "write", "verify"}
    assert all(value >= 0.0 for value in result.seconds.values())
    for error in result.readback_error.values():
        assert error.frequency < MODES
        assert error.accelerance_in_band is not None
    assert result.hub_mass is not None
    assert result.hub_mass[0, 0] == 500.0
    assert result.limits.largest_step["discrete"] == float("inf")


def test_beam_and_spec_and_modes_as_table_are_the_same():
    beam = tube()
    one = bc.fit(beam, name="boom", modes={"xy": 2})
    two = bc.fit(bc.Spec(name="boom", segment=beam.segments, modes=bc.Modes(xy=2)))
    three = bc.fit(bc.Spec(segment=beam.segments), name="boom", modes=bc.Modes(xy=2))
    assert one.to_mjcf() == two.to_mjcf() == three.to_mjcf()


def test_two_modes_in_both_planes_where_nothing_is_said():
    assert {port: model.modes for port, model in bc.fit(tube()).target.items()} == {
        "xy": 2,
        "xz": 2,
    }


def test_a_plane_left_out_without_a_word_is_a_warning():
    assert any(text.startswith("xz is rigid") for text in bc.fit(tube(), modes={"xy": 2}).warnings)
    assert not any("xz" in text for text in bc.fit(tube(), modes={"xy": 2, "xz": 0}).warnings)


def test_the_model_s_error_comes_before_the_readback():
    result = bc.fit(tube(), modes={"xy": 2, "xz": 0})
    assert result.in_band_error == result.readback_error["xy"].accelerance_in_band
    assert result.readback_error["xy"].frequency < 1e-9 < result.in_band_error
    lines = repr(result).splitlines()
    assert "in-band error" in lines[1]
    assert "tip motion off by" in lines[1]
    entry = result.as_dict()["ports"]["xy"]
    assert entry["error"]["in_band"] == result.in_band_error
    assert entry["error"]["band"] == result.bandwidth["xy"]
    assert set(entry["readback"]) == {"reading", "distance"}


@pytest.mark.parametrize(
    ("target", "poles"), [("clamped", "frequencies"), ("free", "free_frequencies")]
)
def test_targets_keep_the_modes_they_promise(target, poles):
    result = bc.fit(tube(), modes={"xy": 3}, root=bc.spec.Root(target=target))
    wanted = getattr(tube().port("xy", 8), poles)[:3]
    assert getattr(result.achieved["xy"], poles)[:3] == close(wanted, rel=MODES)


# -- MJCF ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("make", [tube, deployed_array])
@pytest.mark.slow
def test_the_drop_in_file_compiles_and_is_named_after_the_appendage(make):
    text = bc.fit(make(), name="wing", modes=KEPT, damping=bc.Damping(ratio=0.01)).to_mjcf()
    tree = etree.fromstring(text)
    names = [element.get("name") for element in tree.iter() if element.get("name")]
    assert names
    assert all(name.startswith("wing_") for name in names)
    assert len(set(zip((e.tag for e in tree.iter() if e.get("name")), names, strict=True))) == len(
        names
    )
    model = mujoco.MjModel.from_xml_string(text)
    modes = [
        model.tendon(i).name
        for i in range(model.ntendon)
        if model.tendon(i).name.startswith("wing_mode")
    ]
    assert sorted(modes) == sorted(
        f"wing_mode{k}_{port}" for port, n in KEPT.items() for k in range(1, n + 1)
    )
    # springs on shared hinges: not a joint and not a tendon more than there are modes
    if make is tube:
        assert model.nv == model.ntendon == sum(KEPT.values())
    else:  # two hinge lines stand, and each hinge beyond the modes is a filler
        fillers = [
            i for i in range(model.ntendon) if model.tendon(i).name.startswith("wing_filler")
        ]
        assert model.nv == sum(KEPT.values()) + len(fillers)
    assert {"wing_root", "wing_tip"} == {model.site(i).name for i in range(model.nsite)}


@pytest.mark.parametrize(
    ("make", "integrator"),
    [
        (seed_boom, "implicit"),
        (seed_boom, "discrete"),
        pytest.param(deployed_array, "implicitfast", marks=pytest.mark.slow),
    ],
)
def test_the_scene_steps_without_a_warning(make, integrator):
    kept = {"xy": 2} if make is seed_boom else KEPT
    beam = make()
    safe = bc.fit(beam, modes=kept)
    step = 0.2 * min(safe.limits.largest_step[integrator], safe.limits.largest_step["Euler"])
    scene = bc.Scene(integrator=integrator, timestep=step)
    result = bc.fit(beam, name="boom", modes=kept, damping=bc.Damping(ratio=0.005), scene=scene)
    model = mujoco.MjModel.from_xml_string(result.scene_mjcf())
    assert model.opt.timestep == close(step, rel=1e-12)
    data = mujoco.MjData(model)
    data.qvel[:6] = [0.0, 0.01, 0.005, 0.002, 0.003, 0.01]
    mujoco.mj_step(model, data, nstep=400)
    assert silent(model, data)
    assert np.all(np.isfinite(data.qpos))
    assert np.max(np.abs(data.qpos[7:])) < 1.0


def test_the_scene_has_the_coupled_modes():
    result = bc.fit(tube(), modes=KEPT, root=bc.spec.Root(hub=HUB))
    found = linearise(result.scene_mjcf()).frequencies()
    coupled = coupled_as_kept(HUB)
    assert found == close(coupled, rel=1e-7)


@pytest.mark.parametrize(
    ("integrator", "hub"),
    [(name, bc.Hub(mass=3.0, inertia=(0.2, 0.3, 0.3))) for name in ("Euler", "implicitfast")]
    + [("RK4", None)],
)
@pytest.mark.slow
def test_a_scene_without_a_step_is_written_with_one_that_is_stable(tmp_path, integrator, hub):
    """A thin boom with fast modes, alone and on a light hub: run by mj_step, it does not grow."""
    boom = bc.Beam(
        segments=(
            bc.Segment(
                length=2.4,
                section=bc.Tube(outer_diameter=0.012, wall=0.0004),
                material=bc.Material(youngs_modulus=7e10, density=1600.0),
            ),
        )
    )
    scene = bc.Scene(bandwidth=40.0, integrator=integrator)
    result = bc.fit(boom, scene=scene, hub=hub, damping=0.002)
    model = mujoco.MjModel.from_xml_string(result.scene_mjcf())
    assert model.opt.timestep <= 0.01
    data = mujoco.MjData(model)
    data.qvel[6:] = np.random.default_rng(7).normal(size=model.nv - 6)
    mujoco.mj_forward(model, data)
    start = np.abs(data.qvel).max()
    mujoco.mj_step(model, data, nstep=3000)
    assert data.time == pytest.approx(3000 * model.opt.timestep)  # MuJoCo did not start it again
    assert np.abs(data.qvel).max() < 2.0 * start


def test_the_default_scene_has_a_safe_round_step():
    result = bc.fit(tube(), modes=KEPT)
    model = mujoco.MjModel.from_xml_string(result.scene_mjcf())
    assert model.opt.timestep <= 0.2 * result.limits.largest_step["implicitfast"]
    digits = f"{model.opt.timestep:e}".partition("e")[0].rstrip("0").rstrip(".")
    assert digits in ("1", "2", "5")


# -- attach ----------------------------------------------------------------------------------------
def craft():
    spec = mujoco.MjSpec()
    spec.option.gravity = [0.0, 0.0, 0.0]
    body = spec.worldbody.add_body(
        name="bus", mass=500.0, inertia=[400.0, 400.0, 500.0], explicitinertial=True
    )
    body.add_freejoint()
    body.add_site(name="port_side", pos=[1.0, 0.2, 0.0])
    body.add_site(name="starboard", pos=[-1.0, 0.0, 0.0], quat=[0.0, 0.0, 0.0, 1.0])
    return spec


def test_attach_to_a_site_of_an_mjspec():
    result = bc.fit(tube(), name="boom", modes=KEPT, damping=bc.Damping(ratio=0.01))
    spec = craft()
    result.attach(spec, "port_side")
    model = spec.compile()
    alone = mujoco.MjModel.from_xml_string(result.to_mjcf())
    for kind, count in (
        ("body", alone.nbody),
        ("joint", alone.njnt),
        ("tendon", alone.ntendon),
        ("site", alone.nsite),
    ):
        for i in range(1 if kind == "body" else 0, count):
            # names as in the file
            assert getattr(model, kind)(getattr(alone, kind)(i).name) is not None
    hub = bc.Hub(mass=500.0, inertia=(400.0, 400.0, 500.0), offset=(1.0, 0.2, 0.0))
    coupled = coupled_as_kept(hub)
    assert linearise(model).frequencies() == close(coupled, rel=1e-7)
    assert mujoco.MjModel.from_xml_string(spec.to_xml()).nv == model.nv


def test_attach_twice_under_two_names():
    spec = craft()
    for name, site in (("left", "port_side"), ("right", "starboard")):
        bc.fit(tube(), name=name, modes={"xy": 2}).attach(spec, site)
    model = spec.compile()
    assert model.nv == 6 + 4
    data = mujoco.MjData(model)
    for _ in range(50):
        mujoco.mj_step(model, data)
    assert silent(model, data)


# -- writing ---------------------------------------------------------------------------------------
SHORT_PAGE = {"torsion": 1, "xy": 0, "xz": 0}  # whose page is made soonest


@pytest.mark.slow
def test_write_gives_every_file_and_asks_before_it_replaces(tmp_path):
    result = bc.fit(tube(), name="boom", modes=SHORT_PAGE, damping=0.01)
    files = result.write(tmp_path / "out")
    names = {path.name for path in files}
    assert {"appendage.xml", "scene.xml", "report.html", "fit.json"} <= names
    assert {p.name for p in (tmp_path / "out").iterdir()} == names
    assert files[-1].name == "fit.json"
    for name in ("appendage.xml", "scene.xml"):
        assert mujoco.MjModel.from_xml_path(str(tmp_path / "out" / name)).nv > 0
    written = (tmp_path / "out" / "fit.json").read_text()
    assert written == to_json(result.as_dict())
    page = (tmp_path / "out" / "report.html").read_text()
    assert "The damping tendons are made for implicit" in page
    assert "damping ratio, asked" in page
    with pytest.raises(OSError, match="--force"):
        result.write(tmp_path / "out")
    before = (tmp_path / "out" / "appendage.xml").read_text()
    result.write(tmp_path / "out", force=True)
    assert (tmp_path / "out" / "appendage.xml").read_text() == before


def test_nothing_is_left_behind_when_a_folder_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OSError, match="cannot write to"):
        bc.fit(tube(), modes=SHORT_PAGE).write(tmp_path / "file" / "out")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


# -- fit.json --------------------------------------------------------------------------------------
def test_json_holds_what_the_contract_says():
    result = bc.fit(
        tube(), name="wing", modes=KEPT, root=bc.spec.Root(hub=HUB), damping=bc.Damping(ratio=0.01)
    )
    record = json.loads(to_json(result.as_dict()))
    assert record["name"] == "wing"
    assert record["beamchain"] == bc.__version__
    assert record["mujoco"] == mujoco.__version__
    for mass in (record["mass"], record["mass"]["target"]):
        assert len(mass["com"]) == 3
        assert np.array(mass["inertia"]).shape == (3, 3)
    assert record["mass"]["mass"] == close(record["mass"]["target"]["mass"], rel=1e-10)
    assert set(record["ports"]) == set(KEPT)
    for port, count in KEPT.items():
        entry = record["ports"][port]
        motions = 2 if port in ("xy", "xz") else 1
        for side in ("target", "achieved"):
            size = len(entry[side]["frequencies"])
            assert size == count
            assert np.array(entry[side]["participation"]).shape == (size, motions)
            assert len(entry[side]["free_frequencies"]) == size
        assert set(entry["error"]) == {
            "frequency",
            "participation",
            "in_band",
            "band",
        }
        assert entry["achieved"]["damping"][:count] == close([0.01] * count, rel=1e-6)
        assert entry["achieved"]["frequencies"][:count] == close(
            entry["target"]["frequencies"], rel=1e-9
        )
    links = record["chain"]["links"]
    hinges = record["chain"]["hinges"]
    assert len(links) == len(hinges) + 1
    assert {"length", "mass", "com", "inertia"} <= set(links[0])
    assert {"x", "stiffness", "damping"} <= set(hinges[0])
    assert set(record["tip"]) == set(KEPT)
    assert set(record["stability"]["largest_step"]) == {
        "Euler",
        "implicit",
        "implicitfast",
        "discrete",
        "RK4",
    }
    assert record["stability"]["largest_step"]["discrete"] is None  # no limit
    assert record["stability"]["hub"]["mass"] == 500.0
    assert set(record["accuracy"]["RK4"]) == {"1%", "0.1%"}
    assert record["ok"] is True
    assert isinstance(record["left_out"], list)
    assert [one["message"] for one in record["warnings"]] == list(result.warnings)
    assert set(record["seconds"]) == {"model", "realise", "write", "verify"}


# -- command line ----------------------------------------------------------------------------------
@pytest.fixture
def unwritten(monkeypatch):
    """What a fit prints is said without its files, of which the page takes seconds."""
    monkeypatch.setattr(bc.Fit, "write", lambda self, folder, **_: [folder / "fit.json"])


def test_command_line_prints_wanted_and_achieved_damping(unwritten, tmp_path, monkeypatch, capsys):
    spec = tmp_path / "boom.toml"
    spec.write_text(
        TUBE
        + "[modes]\nxy = 2\ntorsion = 1\n[damping]\nratio = { xy = [0.001, 0.05], torsion = [0.02] "
        "}\n"
    )
    words = ["fit", str(spec), "-o", str(tmp_path / "out"), "--full"]
    code, shown, _ = run(words, capsys, monkeypatch)
    assert code == 0
    assert "damping" in shown  # two headings, wrapped to the terminal's width
    assert "asked" in shown
    assert "through" in shown
    for ratio in ("0.001", "0.05", "0.02"):
        assert shown.count(f" {ratio} ") >= 2
    words = " ".join(shown.split())
    assert "made for implicit, implicitfast and RK4" in words
    assert "wrote" in words


def test_one_in_band_error_is_printed_where_a_scene_asks(unwritten, tmp_path, capsys, monkeypatch):
    """That of the axes asked for; those of single ports, over all motions and other hubs,
    would contradict it."""
    text = (
        'name = "boom"\n[[segment]]\nlength = 6.0\nsection = { shape = "round", diameter = 0.03 }\n'
    )
    text += "material = { youngs_modulus = 7e10, density = 2700.0 }\n[modes]\ntorsion = 1\n"
    for scene, lines in (("", 1), ('[scene]\nbandwidth = 5.0\naxes = ["z"]\n', 0)):
        (tmp_path / "boom.toml").write_text(text + scene)
        words = [
            "fit",
            str(tmp_path / "boom.toml"),
            "-o",
            str(tmp_path / "out"),
            "--force",
            "--full",
        ]
        _, told, _ = run(words, capsys, monkeypatch)
        assert told.count("the worst of three, 0.1, 1 and 10 times") == lines
        assert "in-band error" in told


def test_fewer_modes_than_asked_for_exits_with_three(unwritten, tmp_path, monkeypatch, capsys):
    spec = tmp_path / "boom.toml"
    spec.write_text(TUBE + '[modes]\nxy = 8\n[fit]\nsprings = "hinges"\n')
    code, out, _ = run(
        ["fit", str(spec), "-o", str(tmp_path / "out"), "--json"], capsys, monkeypatch
    )
    assert code == 3
    record = json.loads(out)
    assert record["ok"] is False
    assert len(record["ports"]["xy"]["achieved"]["frequencies"]) == 7


def test_a_status_that_is_not_ok_is_not_hidden():
    result = bc.fit(tube(), modes={"xy": 8}, options=bc.spec.FitOptions(springs="hinges"))
    assert not result.status.ok
    assert result.status.history
    assert result.target["xy"].modes == 7


def test_a_plane_left_rigid_is_no_error_of_the_step():
    """At a short step the error at the samples is that in continuous time, in the same plane."""
    spec = bc.Spec(
        segment=tube().segments,
        modes=bc.Modes(xy=2, xz=0),
        root=bc.spec.Root(target="hub", hub=bc.Hub(mass=100.0, inertia=(50.0, 50.0, 50.0))),
        scene=bc.Scene(timestep=1e-4),
    )
    result = bc.fit(spec)
    assert result.sampled_error == pytest.approx(result.in_band_error, rel=0.02)
