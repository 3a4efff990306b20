"""Closed forms beside samples of an uncertain craft: coupled modes without fillers, their gains,
participation, and jobs."""

import copy
import dataclasses
import json
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from msgspec import structs
from scipy.linalg import eigh

import beamchain as bc
from beamchain.engine.model_fields import FIELDS
from beamchain.fitting.uncertain import UncertainBody, UncertainCraft, UncertainModes
from formulas import (
    DrawnModes,
    GainOfModes,
    Samples,
    Sweep,
    correlations_of_craft,
    craft_from_text,
    drawn_samples,
    gain_of_pair,
    nominal_fit,
    normal_shapes,
    scaled_participation,
    spread_of,
    usual_gain,
    varied_fields,
    vary_samples,
)
from varied_crafts import frequencies

RANDOM = np.random.default_rng(6)
CHAIN = """<mujoco><worldbody><body><joint name="drive" type="slide" stiffness="90"/>
<joint name="free" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>
<body><joint name="h1" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<body><joint name="h2" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<body><joint name="h3" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
</body></body></body></body></worldbody><tendon>
<fixed name="arm_mode1_xy" stiffness="30"><joint joint="h1" coef="1.2"/>
<joint joint="h2" coef="0.4"/>
</fixed><fixed name="slack"><joint joint="h3" coef="2"/></fixed>
<fixed name="arm_filler1_xy" stiffness="{filler}"><joint joint="h2" coef="0.9"/></fixed>
<fixed name="arm_mode2_xy" stiffness="200"><joint joint="h3" coef="1.5"/></fixed></tendon>
</mujoco>"""
SPRINGS = np.array(
    [[np.sqrt(90.0), 0, 0, 0, 0], [0, 0, 1.2 * np.sqrt(30.0), 0.4 * np.sqrt(30.0), 0],
     [0, 0, 0, 0, 1.5 * np.sqrt(200.0)]]
)  # fmt: skip


def mass_matrix(coupled):
    half = RANDOM.standard_normal((5, 5))
    return np.diag([5.0, 4.0, 2.0, 1.0, 3.0]) + coupled * half @ half.T


@pytest.mark.parametrize("filler", [0.01, 9.0, 4000.0])
def test_coupled_modes_but_those_that_fillers_hold(filler):
    """Slow, among the others, or fast: the mode with most of its energy in the filler is none."""
    model = mujoco.MjModel.from_xml_string(CHAIN.format(filler=filler))
    for coupled in (0.0, 0.05):
        mass = mass_matrix(coupled)
        held = np.sqrt(filler) * np.array([0, 0, 0, 0.9, 0])
        springs = np.vstack([SPRINGS, held])
        squares, shapes = eigh(springs.T @ springs, mass)
        taut = squares > 1e-9
        squares, shapes = squares[taut], shapes[:, taut]
        assert squares.size == 4
        keep = np.sort(np.argsort((held @ shapes) ** 2 / squares)[:3])
        w, found = normal_shapes(model, mass)
        assert w == pytest.approx(np.sqrt(squares[keep]))
        np.testing.assert_allclose(found.T @ mass @ found, np.eye(3), atol=1e-9)
        alike = np.abs(found.T @ mass @ shapes[:, keep])
        np.testing.assert_allclose(alike, np.eye(3), atol=1e-6)


def test_a_craft_of_which_nothing_is_sprung_has_no_coupled_modes():
    model = mujoco.MjModel.from_xml_string(CHAIN.format(filler=1.0))
    model.jnt_stiffness[:] = 0.0
    model.tendon_stiffness[:] = 0.0
    assert normal_shapes(model, mass_matrix(0.0))[0].size == 0
    model.tendon_stiffness[2] = 5.0  # a filler alone
    assert normal_shapes(model, mass_matrix(0.0))[0].size == 0


@pytest.mark.parametrize(("part", "count"), [(0.9, 1), (1.1, 2)])
def test_springs_that_others_make_superfluous_are_no_modes(part, count):
    """1e-12 of the largest squared frequency, 0.004 1.5^2 / 3, of 5 kg on the drive."""
    model = mujoco.MjModel.from_xml_string(CHAIN.format(filler=1.0))
    model.tendon_stiffness[:] = 0.0
    model.tendon_stiffness[3] = 0.004
    model.jnt_stiffness[0] = part * 1e-12 * 0.003 * 5.0
    w, shapes = normal_shapes(model, np.diag([5.0, 4.0, 2.0, 1.0, 3.0]))
    squares = [part * 1e-12 * 0.003, 0.003][-count:]
    assert w == pytest.approx(np.sqrt(squares), rel=1e-3)
    assert np.abs(shapes[4, -1]) == pytest.approx(1.0 / np.sqrt(3.0))


def test_the_gain_of_a_mode_is_its_largest_singular_value():
    force, position, rate = (RANDOM.standard_normal(s) for s in ((5, 3), (2, 5), (2, 5)))
    w, shapes = np.array([0.7, 3.0, 5.0]), RANDOM.standard_normal((5, 3))
    sizes = GainOfModes("a=b", "", force, position, rate).sizes(w, shapes)
    for k in range(3):
        seen = (position + 1j * w[k] * rate) @ shapes[:, k]
        matrix = np.outer(seen, force.T @ shapes[:, k])
        assert sizes[k] == pytest.approx(np.linalg.svd(matrix, compute_uv=False)[0])


FREE = """<mujoco><option gravity="0 0 0"/><worldbody><body{name}>{joint}
<inertial pos="0 0 0" mass="9" diaginertia="2 3 4"/><body><joint name="w" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body></worldbody>
<actuator><motor name="spin" joint="w" gear="2"/></actuator>
<sensor><accelerometer name="felt" site="s"/><jointvel name="turns" joint="w"/></sensor></mujoco>"""


def free(name=' name="bus"', joint="<freejoint/>"):
    text = FREE.format(name=name, joint=joint)
    return mujoco.MjModel.from_xml_string(text.replace("<inertial", '<site name="s"/><inertial', 1))


def test_signals_whose_modal_gains_are_followed():
    found = gain_of_pair(free(), "torque:bus=attitude")
    np.testing.assert_allclose(found.force, np.eye(7)[:, 3:6], atol=1e-12)
    np.testing.assert_allclose(found.position, np.eye(7)[3:6], atol=1e-9)
    np.testing.assert_allclose(found.rate, 0.0, atol=1e-12)
    assert (found.name, found.unit) == ("torque:bus=attitude", "rad/s^2 per N m")
    found = gain_of_pair(free(), "spin=turns")
    np.testing.assert_allclose(found.force, 2.0 * np.eye(7)[:, 6:], atol=1e-12)
    np.testing.assert_allclose(found.rate, np.eye(7)[6:], atol=1e-9)
    assert found.unit.startswith("(rad/s)/s^2 per")
    for wrong in ("spin", "spin=", "=turns", "torque:bus=felt"):
        with pytest.raises(bc.InputError, match="gain = "):
            gain_of_pair(free(), wrong)


def test_the_usual_gain_is_that_of_a_free_base_with_a_name():
    assert usual_gain(free()) == ("torque:bus=attitude",)
    assert usual_gain(free("")) == ()
    assert usual_gain(free(joint="<joint/>")) == ()
    assert usual_gain(free(joint='<joint type="ball"/>')) == ()


def test_participation_by_the_factors_of_its_tendons():
    rows = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    factors = {
        "arm_mode1_xz": np.array([7.0, 8.0]),
        "arm_mode3_xy": np.array([2.0, 1.0]),
        "arm_mode1_xy": np.array([0.5, 3.0]),
    }
    found = scaled_participation(rows, "xy", factors, 2)
    assert found.tolist() == [
        [[0.5, 1.0], [3.0, 4.0], [10.0, 12.0]],
        [[3.0, 6.0], [3.0, 4.0], [5.0, 6.0]],
    ]


# -- jobs ------------------------------------------------------------------------------------------
class Refitted:
    """Every third sample cannot be made."""

    refits = (None,)

    def fit_and_draw(self, seed, index):
        if index % 3 == 1:
            raise bc.BeamchainError(f"no {index}")
        return Samples([index], {"coupled": np.array([[seed, index]], dtype=float)}, {})


def test_samples_that_cannot_be_made_are_told_apart():
    found = vary_samples(Refitted(), 5, 1, 6)
    assert found.indices == [2, 3, 5]
    assert found.left_out == {1: "no 1", 4: "no 4"}
    assert found.arrays["coupled"].tolist() == [[5, 2], [5, 3], [5, 5]]
    assert vary_samples(Refitted(), 5, 1, 2) == ([], {}, {1: "no 1"})


class Drawn(Refitted):
    """Those of the nominal chains, together."""

    refits = ()

    def draw(self, seed, indices):
        good = [index for index in indices if index % 3 != 1]
        why = {index: f"no {index}" for index in indices if index % 3 == 1}
        return Samples(good, {"coupled": np.array([[seed, i] for i in good])}, why)


def test_all_samples_are_drawn_in_jobs(monkeypatch):
    """As many to a job as are quick, fewer where structures are fitted again; none twice."""
    jobs = []

    def run(work, given, **_):
        jobs.extend((first, end) for _, _, first, end in given)
        return [work(*job) for job in given]

    monkeypatch.setattr("beamchain.variants.sweep.run_jobs", run)
    monkeypatch.setattr("beamchain.variants.sweep.replace", lambda case: case)
    for case in (Drawn(), Refitted()):
        jobs.clear()
        found = drawn_samples(case, seed=2, samples=205, workers=1, progress=None)
        assert [a for a, _ in jobs] == [0, *(b for _, b in jobs[:-1])]
        assert jobs[-1][1] == 205
        sizes = {b - a for a, b in jobs[:-1]}
        assert len(sizes) == 1
        assert found.indices == [k for k in range(205) if k % 3 != 1]
        assert sorted(found.left_out) == [k for k in range(205) if k % 3 == 1]
        assert found.arrays["coupled"][:, 1].tolist() == found.indices


def test_only_fields_that_vary_are_kept():
    model = free()
    nominal = {
        name: np.array(getattr(model, name), dtype=np.float64)
        for name in ("body_mass", "jnt_stiffness")
    }
    arrays = {
        f"field {name}": np.stack([np.array(getattr(model, name), dtype=np.float64)] * 2)
        for name in FIELDS
    }
    arrays["field body_mass"][1, 1] += 0.5
    found = varied_fields(SimpleNamespace(model=model), arrays)
    assert list(found) == ["body_mass"]
    assert found["body_mass"][1, 1] == nominal["body_mass"][1] + 0.5


def test_the_spread_of_values():
    values = np.array([4.0, 1.0, 2.0, 3.0])
    found = spread_of(values)
    assert found["mean"] == 2.5
    assert found["deviation"] == pytest.approx(np.sqrt(1.25))
    assert list(found["quantiles"]) == pytest.approx(np.interp(
        3.0 * np.array([0.05, 0.25, 0.5, 0.75, 0.95]), range(4), np.sort(values)))  # fmt: skip


def test_correlations_are_told_in_the_names_of_the_craft():
    one = bc.spec.Correlation(
        of=("mode1_xy.frequency", "mode2_xy.frequency"), matrix=[[1, 0.5], [0.5, 1]]
    )
    tables = {"left_": SimpleNamespace(correlation=(one,)), "r_": SimpleNamespace(correlation=())}
    (found,) = correlations_of_craft(tables)
    assert found.of == ("left_mode1_xy.frequency", "left_mode2_xy.frequency")


# -- structures ------------------------------------------------------------------------------------
HEAVY = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="1e7" diaginertia="1e8 1e8 1e8"/><site name="left" pos="0.5 0 0"/>
</body></worldbody></mujoco>"""


@pytest.mark.slow
def test_a_boom_on_a_heavy_bus_rings_by_its_drawn_stiffness_and_density():
    """(b L)^2 sqrt(E I / m) / L^2 with both scaled, in the arrays and in the model they make."""
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    boom = bc.Spec(
        name="boom",
        segment=(bc.Segment(length=8.0, section=section),),
        modes=bc.Modes(xy=2),
        fit=bc.spec.FitOptions(springs="modes"),
        uncertain=bc.spec.Uncertain(
            stiffness=bc.spec.Uncertainty(relative=0.1), density=bc.spec.Uncertainty(relative=0.05)
        ),
    )
    found = bc.sweep(HEAVY, 2, mounts={"left": boom}, seed=4)
    assert found.indices.tolist() == [0, 1]
    names = [quantity.name for quantity in found.quantities]
    nominal = np.array([1.8751040687, 4.6940911330]) ** 2 * np.sqrt(500.0) / 64.0
    for row in range(2):
        drawn = dict(zip(names, found.values[row], strict=True))
        stiff, dense = (drawn[f"boom_segment1.{name}"] for name in ("stiffness", "density"))
        assert (stiff, dense) != (1.0, 1.0)
        wanted = nominal * np.sqrt(stiff / dense)
        assert found.coupled[row] == pytest.approx(wanted, rel=1e-3)
        model = copy.copy(found.source.untimed)
        for name, values in found.fields.items():
            getattr(model, name)[:] = values[row]
        assert frequencies(model) == pytest.approx(found.coupled[row], rel=1e-6)
        # the boom alone, beside the bus
        assert model.body_mass.sum() - 1e7 == pytest.approx(32.0 * dense, rel=1e-6)
    with pytest.raises(bc.InputError, match="nothing is uncertain"):
        bc.sweep(HEAVY, 2, mounts={"left": structs.replace(boom, uncertain=None)})


# -- draws and records -----------------------------------------------------------------------------
def test_drawn_modes_have_their_frequencies_and_ratios():
    model = mujoco.MjModel.from_xml_string(CHAIN.format(filler=9.0))
    stiffness, damping = np.array(model.tendon_stiffness), np.array([0.3, 0.4, 0.5, 0.6])
    model.tendon_damping[:] = damping
    drawn = DrawnModes(model, {"frequency": 0.05, "damping": 0.3})
    modes = [0, 2, 3]
    keys = np.array([[[1.0, -0.5, 0.2], [-1.0, 0.4, 0.1]], [[0.0, 0.7, -1.0], [0.3, 1.0, 0.0]]])
    found = drawn.fields(keys)
    faster, more = 1.0 + 0.05 * keys[:, 0], 1.0 + 0.3 * keys[:, 1]
    assert found["tendon_stiffness"][:, modes] == pytest.approx(stiffness[modes] * faster**2)
    assert found["tendon_damping"][:, modes] == pytest.approx(damping[modes] * faster * more)
    assert found["tendon_stiffness"][:, 1].tolist() == [stiffness[1]] * 2
    assert found["tendon_damping"][:, 1].tolist() == [0.4] * 2
    assert drawn.drawn(keys)["frequency"] == pytest.approx(faster)


def swept():
    """Two of three samples of a free body whose mass is drawn."""
    case = SimpleNamespace(
        model=free(),
        gains=(SimpleNamespace(name="spin=turns", unit="1"),),
        quantities=(SimpleNamespace(name="bus.mass", unit="kg", nominal=9.0),),
    )
    return Sweep(
        name="one",
        source=craft_from_text("<mujoco><worldbody/></mujoco>"),
        case=case,
        seed=4,
        indices=np.array([0, 2]),
        values=np.array([[9.5], [8.5]]),
        fields={"body_mass": np.array([[0.0, 9.5, 1.0], [0.0, 8.5, 1.0]])},
        coupled=np.array([[1.0, 3.0], [2.0, 5.0]]),
        gains={"spin=turns": np.array([[0.1, 0.2], [0.3, 0.4]])},
        participation={},
        left_out={1: "too heavy"},
        seconds=0.5,
    )


def test_the_record_of_a_sweep_counts_its_samples():
    found = swept().as_dict()
    assert (found["samples"], found["variants"], found["seed"]) == (3, 2, 4)
    assert found["left_out"] == [{"sample": 1, "why": "too heavy"}]
    assert found["fields"] == {"body_mass": [3]}
    assert [one["mean"] for one in found["coupled_frequencies"]] == [1.5, 4.0]
    (gain,) = found["gains"]
    assert [one["mean"] for one in gain["modes"]] == pytest.approx([0.2, 0.3])


def test_the_record_spreads_participation_mode_by_mode():
    rows = np.array([[[1.0, 2.0], [3.0, 5.0], [7.0, 4.0]], [[3.0, 6.0], [4.0, 5.5], [9.0, 8.0]]])
    record = dataclasses.replace(swept(), participation={"xy": rows}).as_dict()["participation"]
    found = [[one["mean"] for one in mode] for mode in record["xy"]]
    assert found == [[2.0, 4.0], [3.5, 5.25], [8.0, 6.0]]


ARM = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="1e8" diaginertia="1e8 1e8 1e8"/>
<body name="arm_link1"><joint name="h1" axis="0 1 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
<body name="arm_link2"><joint name="h2" axis="1 0 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
<body name="drum"><joint name="drive" axis="0 0 1" stiffness="90"/>
<inertial pos="0 0 0" mass="2" diaginertia="3 3 3"/></body></body></worldbody><tendon>
<fixed name="arm_mode1_xy" stiffness="30" damping="0.1"><joint joint="h1" coef="1"/></fixed>
<fixed name="arm_mode2_xy" stiffness="200" damping="0.2"><joint joint="h2" coef="1"/></fixed>
</tendon></mujoco>"""


def test_one_sample_of_a_craft_s_text_has_the_numbers_that_were_drawn():
    """Modes of mass 1, and a drum of 3 kg m^2 on its drive, beside a heavy bus."""
    tenth = bc.spec.Uncertainty(relative=0.1)
    given = bc.spec.UncertainCraft(
        appendage={"arm_": bc.spec.UncertainModes(frequency=tenth, participation=tenth)},
        joint={"drive": bc.spec.UncertainJoint(stiffness=tenth)},
    )
    found = bc.sweep(ARM, 1, uncertain=given, seed=3)
    names = [quantity.name for quantity in found.quantities]
    drawn = dict(zip(names, found.values[0], strict=True))
    first, second = (drawn[f"arm_mode{k}_xy.frequency"] for k in (1, 2))
    nominal = {name: q.nominal for name, q in zip(names, found.quantities, strict=True)}
    assert nominal["arm_mode1_xy.frequency"] == pytest.approx(np.sqrt(30.0))
    assert nominal["drive.stiffness"] == 90.0
    wanted = np.sort([first, second, np.sqrt(drawn["drive.stiffness"] / 3.0)])
    assert found.coupled[0] == pytest.approx(wanted, rel=1e-6)
    assert found.name == "craft"
    assert 0.0 < found.seconds < 60.0
    # of a port whose modes these are
    rows = np.array([[1.0, 2.0], [3.0, 5.0]])
    case = dataclasses.replace(found.case, participation={"xy": rows})
    factors = [drawn[f"arm_mode{k}_xy.participation"] for k in (1, 2)]
    assert min(np.abs(np.array(factors) - 1.0)) > 1e-3
    sample = case.draw(3, [0]).arrays
    assert sample["port xy"][0] == pytest.approx(rows * np.array(factors)[:, None])
    assert sample["values"][0] == pytest.approx(found.values[0])
    with pytest.raises(bc.InputError, match="nothing is uncertain"):
        bc.sweep(ARM, 1)


def test_samples_whose_modes_take_too_much_mass_are_left_out_alone():
    """Of a hinge of 0.3 kg m^2 whose mode has the mass 1: `w^2 = k / (1 - 0.7 p^2)`."""
    text = ARM.replace(
        'mass="1" diaginertia="1 1 1"/></body>\n<body name="arm_link2">',
        'mass="1" diaginertia="0.3 0.3 0.3"/></body>\n<body name="arm_link2">',
    )
    wide = bc.spec.Uncertainty(relative=0.4, distribution="uniform")
    given = UncertainCraft(
        appendage={
            "arm_": UncertainModes(
                mode=(bc.spec.UncertainMode(number=1, port="xy", participation=wide),)
            )
        }
    )
    found = bc.sweep(text, 40, uncertain=given, seed=3)
    assert found.indices.tolist() == [i for i in range(40) if i not in found.left_out]
    assert 5 < len(found.left_out) < 25
    assert all("takes more mass than the appendage has" in w for w in found.left_out.values())
    p = found.values[:, 0]
    assert max(p) < np.sqrt(1.0 / 0.7)
    for row, factor in zip(found.coupled, p, strict=True):
        own = np.sqrt([30.0 / (1.0 - 0.7 * factor**2), 200.0, 90.0 / 3.0])
        assert row == pytest.approx(np.sort(own), rel=1e-4)
    assert found.fields["tendon_armature"][:, 0] == pytest.approx(1.0 - p**2)


def test_a_sweep_is_written_beside_its_model(tmp_path, monkeypatch):
    monkeypatch.setattr("beamchain.report.sweep_pictures", lambda _: {"a.svg": "<svg/>"})
    written = swept().write(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(p.name for p in written)
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "flexible.xml")).nbody == 1
    with np.load(tmp_path / "variants.npz") as archive:
        assert archive["body_mass"].tolist() == [[0.0, 9.5, 1.0], [0.0, 8.5, 1.0]]
        assert archive["sample"].tolist() == [0, 2]
    assert json.loads((tmp_path / "sweep.json").read_text())["variants"] == 2


@pytest.mark.parametrize("springs", ["auto", "hinges"])
@pytest.mark.parametrize("drawn", [False, True])
def test_modes_that_are_drawn_have_a_tendon_each_unless_springs_are_said(
    springs, drawn, monkeypatch
):
    monkeypatch.setattr("beamchain.variants.sweep.fit", lambda spec: SimpleNamespace(spec=spec))
    section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
    spec = bc.Spec(
        name="rod",
        segment=(bc.Segment(length=1.0, section=section),),
        fit=bc.spec.FitOptions(springs=springs),
    )
    some = bc.spec.Uncertainty(relative=0.1)
    modes = UncertainCraft(appendage={"rod_": UncertainModes(frequency=some)})
    if drawn:
        found = nominal_fit(spec, modes).spec
        assert found.fit.springs == ("modes" if springs == "auto" else springs)
        return
    with pytest.raises(bc.InputError, match="the spec has no .uncertain."):
        nominal_fit(spec, UncertainCraft())
    own = spec.replace(uncertain=bc.spec.Uncertain(stiffness=some))
    for given in (UncertainCraft(), UncertainCraft(body={"bus": UncertainBody(mass=some)})):
        assert nominal_fit(own, given).spec.fit.springs == springs
