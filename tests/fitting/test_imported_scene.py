"""Imported modes and [scene]: the modes are chosen, the promise holds,
and every command works or says why not."""

import json

import numpy as np
import pytest

import terminal
from appendages import tapered_boom, tip_loaded_boom
from beamchain import Beam, Equivalent, Hub, ModalData, Scene, Segment, fit
from beamchain.spec import FitOptions, Root
from modes_of_beam import modes_of_beam
from prints import cantilever, plate, whole

AXES = {"tx": 0, "ty": 1, "tz": 2, "x": 3, "y": 4, "z": 5}  # turns are x, y, z of a scene
PRINT = 5e-7  # relative precision of seven printed digits
# the independent grid may hit a peak a little nearer its top than the choice's own
GRID_SLACK = 1.02
RATIO = 0.005  # damping where none is given, SPEC's


def printed(modes, **more) -> ModalData:
    return ModalData(modes.mass, modes.frequencies, modes.participation, precision=PRINT, **more)


SECTION = Equivalent(
    bending_stiffness_xy=900.0,
    bending_stiffness_xz=1600.0,
    torsion_stiffness=300.0,
    axial_stiffness=1e6,
    linear_mass=4.0,
    polar_inertia=0.3,
)


def boom_data() -> ModalData:
    return modes_of_beam(
        Beam(segments=[Segment(length=3.0, section=SECTION)]), {"xy": 5, "xz": 4, "torsion": 3}
    )


def promise(data: ModalData, kept, hub: np.ndarray, scene: Scene) -> float:
    """The in-band error of some modes against all, from SPEC's definition, dense over the band."""
    live = data.live
    hub, mass, rows = (
        hub[np.ix_(live, live)],
        data.rigid_mass[np.ix_(live, live)],
        data.participation[:, live],
    )
    omega = np.linspace(scene.bandwidth / 2000, scene.bandwidth, 2000)
    s = 1j * omega[:, None]
    gain = s**2 / (s**2 + 2 * RATIO * data.frequencies * s + data.frequencies**2)
    scale = np.sqrt(np.diag(hub + mass))
    keep = [i for i, motion in enumerate(live) if motion in {AXES[a] for a in scene.axes}]

    def response(modes):
        flexible = np.einsum("fk,ki,kj->fij", gain[:, modes], rows[modes], rows[modes])
        return (np.linalg.inv(hub + mass - flexible) * np.outer(scale, scale))[:, keep][:, :, keep]

    ours = response(list(kept))
    true = response(list(range(data.modes)))
    frozen = (np.linalg.inv(hub + mass) * np.outer(scale, scale))[np.ix_(keep, keep)]
    # at the same frequency
    size = np.maximum(np.linalg.norm(true, 2, axis=(1, 2)), np.linalg.norm(frozen, 2))
    return float(np.max(np.linalg.norm(ours - true, 2, axis=(1, 2)) / size))


def kept_of(result) -> list[int]:
    w = result.space.target.frequencies
    return [
        k
        for k, own in enumerate(result.space.data.frequencies)
        if np.any(np.abs(w / own - 1.0) < 1e-9)
    ]


ALL = ("x", "y", "z", "tx", "ty", "tz")


@pytest.mark.parametrize(
    ("axes", "band", "tolerance"),
    [(ALL, 1.5, 3e-4), (("x",), 1.5, 3e-4), (("y", "tz"), 6.0, 1e-2)],
)
@pytest.mark.slow
def test_coupled_modes_are_chosen(axes, band, tolerance):
    """A plate: the promise kept, and no longer kept without the lightest of them."""
    data = printed(plate())
    mass = float(data.rigid_mass[0, 0])
    hub = Hub(
        mass=3.0 * mass,
        inertia=tuple(0.02 * mass * v for v in (1.0, 1.2, 1.5)),
        offset=(0.05, 0.01, 0.0),
    )
    scene = Scene(bandwidth=band * float(data.frequencies[0]), tolerance=tolerance, axes=axes)
    result = fit(data, scene=scene, root=Root(hub=hub))
    kept = kept_of(result)
    assert result.status.ok
    assert result.choice is not None
    assert len(kept) == sum(result.choice.modes.values()) < data.modes
    assert result.promise <= tolerance
    assert promise(data, kept, hub.mass_matrix(), scene) <= GRID_SLACK * tolerance
    if kept:
        fewer = min(
            promise(data, [k for k in kept if k != out], hub.mass_matrix(), scene) for out in kept
        )
        assert fewer > tolerance / GRID_SLACK


@pytest.mark.parametrize(
    ("target", "band"),
    [("clamped", 0.01), (None, 1.5), pytest.param("clamped", 8.0, marks=pytest.mark.slow)],
)
def test_decoupled_modes_are_chosen_per_port(band, target):
    data = boom_data()
    hub = Hub(mass=100.0, inertia=(20.0, 30.0, 40.0), offset=(0.3, 0.0, 0.0))
    scene = Scene(bandwidth=band * float(data.frequencies[0]), tolerance=1e-3)
    result = fit(data, scene=scene, root=Root(hub=hub, target=target))
    assert result.status.ok
    assert result.promise <= scene.tolerance
    assert result.left_out
    assert (band < 0.1) == (not result.chain.hinges)
    if target == "clamped":
        assert (
            promise(data, kept_of(result), hub.mass_matrix(), scene) <= GRID_SLACK * scene.tolerance
        )


def test_a_singular_residual_with_a_scene():
    """The printed cantilever on a hub: the hub's modes give no chain, the clamped ones do."""
    data = printed(cantilever(0.3), length=1.0)
    hub = Hub(mass=300.0, inertia=(80.0, 90.0, 100.0), offset=(0.5, 0.0, 0.1))
    result = fit(data, scene=Scene(bandwidth=2.0 * float(data.frequencies[0])), root=Root(hub=hub))
    assert result.status.ok
    assert result.kept_for == "clamped"


@pytest.mark.slow
def test_stated_numbers_overrule():
    data = boom_data()
    scene = Scene(bandwidth=float(data.frequencies[0]) * 1.5)
    assert fit(data, scene=scene, modes={"xy": 4}).choice.modes["xy"] == 4
    data = printed(plate())
    scene = Scene(bandwidth=float(data.frequencies[0]) * 1.5)
    result = fit(data, scene=scene, modes={"xz": 4})
    assert result.choice.modes["xz"] == 4
    assert result.promise <= scene.tolerance


@pytest.mark.parametrize("make", [tapered_boom, tip_loaded_boom])
def test_a_beam_with_a_tendon_per_mode_is_chosen_too(make):
    scene = Scene(
        bandwidth=1.5 * float(make().port("xz", 4).frequencies[0]), tolerance=1e-2, axes=("y", "tz")
    )
    result = fit(make(), scene=scene, options=FitOptions(springs="modes"))
    assert result.status.ok
    assert 0 < sum(t.is_mode for t in result.chain.tendons) == sum(result.choice.modes.values())


@pytest.fixture
def spec(tmp_path):
    """The plate, whose modes couple all ports, in millimetres and tonnes."""
    (tmp_path / "array.f06").write_text(whole(plate().in_units(1e-3, 1e3), weight=False))
    path = tmp_path / "array.toml"
    path.write_text(
        'name = "array"\n[imported]\nfile = "array.f06"\nunits = { length = 1e-3, mass = 1e3 }\n'
        "[scene]\nbandwidth = 500.0\ntolerance = 1e-2\n"
    )
    return path


def run(*words) -> tuple[int, str]:
    """Exit code and what was said."""
    code, out, err = terminal.run(*words)
    return code, out or err


@pytest.mark.slow
def test_commands_on_imported_modes(spec, tmp_path):
    code, said = run("fit", spec, "-o", tmp_path / "fit", "--full")
    assert code == 0, said
    assert "left out" in said
    assert "The imported modes" in (tmp_path / "fit" / "report.html").read_text()
    record = json.loads((tmp_path / "fit" / "fit.json").read_text())
    assert record["scene"]["error"] <= 1e-2
    assert record["left_out"]
    code, said = run("inspect", spec, "--steps", "--json")
    assert code == 0, said
    for budget in json.loads(said)["budgets"]:
        assert all(step is None or step > 0.0 for step in budget["largest_step"].values())
    code, said = run("study", spec, "-o", tmp_path / "study")
    assert code == 2
    assert "imported modes" in said
    assert "[[segment]]" in said
    spec.write_text(spec.read_text() + "[uncertain]\nstiffness = { relative = 0.05 }\n")
    code, said = run("sweep", spec, "-o", tmp_path / "sweep", "--samples", 3)
    assert code == 2
    assert "[uncertain] varies a beam" in said


@pytest.mark.slow
def test_a_rigid_appendage_goes_through_every_command(spec, tmp_path):
    spec.write_text(spec.read_text().replace("bandwidth = 500.0", "bandwidth = 0.1"))
    beam = tmp_path / "beam.toml"
    beam.write_text(
        'name = "boom"\n[[segment]]\nlength = 2.0\nsection = { shape = "round", diameter = 0.05 }\n'
        "material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }\n"
        "[root]\nhub = { mass = 300.0, inertia = [80.0, 90.0, 100.0] }\n[scene]\nbandwidth = 0.1\n"
    )
    craft = tmp_path / "craft.xml"
    craft.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/><inertial '
        'pos="0.1 0 0" mass="300" diaginertia="80 90 100"/><site name="mount" pos="0.2 0.1 '
        '0"/></body></worldbody></mujoco>'
    )
    for source in (spec, beam):
        code, said = run("fit", source, "-o", tmp_path / "fit", "--force", "--full")
        assert code == 0, said
        assert (
            "One rigid body stands for the appendage"
            in (tmp_path / "fit" / "report.html").read_text()
        )
        words = ["--mount", f"mount={source}", "-o", tmp_path / "out.xml"]
        code, said = run("embed", craft, *words, "--force", "--no-report")
        assert code == 0, said
        code, said = run("inspect", source, "--steps")
        assert code == 2
        assert "nothing oscillates" in said
    code, said = run("study", beam, "-o", tmp_path / "study")
    assert code == 2
    assert "needs no mode" in said
