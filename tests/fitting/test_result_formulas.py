"""What a fit says of itself, of models whose errors are known."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

import beamchain as bc
import beamchain.fitting.result as result_module
from beamchain import PortModel
from beamchain.errors import OutputError
from beamchain.fitting.fit import decide
from formulas import (
    Body,
    InSpace,
    Kept,
    ShiftedPeak,
    cure_sentence,
    limits_of_chain,
    look_of,
    tip_sentence,
)

LIMITS = SimpleNamespace(largest_step={})


def comparison(matches, frequency, participation, in_band):
    return bc.results.Comparison(
        np.array(matches), np.array(frequency), np.array(participation), 0.0, in_band
    )


def plane(w, ratios, tip):
    rows = np.ones((len(w), 2)) / 10.0
    return PortModel(
        np.eye(2), np.array(w), rows, np.array(ratios), tip=np.array(tip)[:, None] * [1.0, 0.3]
    )


def made(**given):
    """Two planes: of xy the second mode was found first."""
    target = {
        "xy": plane([2.0, 5.0], [0.01, 0.02], [1.0, -2.0]),
        "xz": plane([3.0], [0.03], [4.0]),
    }
    achieved = {
        "xy": plane([2.1, 5.5], [0.011, 0.022], [1.0, -2.0]),
        "xz": plane([3.3], [0.033], [4.0]),
    }
    errors = {
        "xy": comparison([[1, 1], [0, 0]], [0.1, 0.05], [0.4, 0.3], 1e-3),
        "xz": comparison([[0, 0]], [0.1], [0.2], 4e-3),
    }
    chain = SimpleNamespace(
        port={
            "xy": plane([2.0, 5.0], [0, 0], [1.005, -1.985]),
            "xz": plane([3.0], [0], [4.02]),
        }.get,
        tendons=(),
        mass=8.0,
    )
    spec = SimpleNamespace(scene=None, root=SimpleNamespace(hub=None), exact_step=0.0)
    measured = SimpleNamespace(rigid_mass=np.eye(6))
    base = {
        "spec": spec,
        "body": Body(spec, target),
        "kept": Kept("clamped", {"xy": 2, "xz": 1}),
        "chain": chain,
        "line": None,
        "target": target,
        "achieved": achieved,
        "readback_error": errors,
        "measured": measured,
        "limits": LIMITS,
        "how": "springs on the hinges",
        "seconds": {},
        "bandwidth": {"xy": 7.0, "xz": 9.0},
    }
    return bc.Fit(**{**base, **given})


def scene(**given):
    step = given.pop("step", 0.0)
    hub = given.pop("hub", None)
    return SimpleNamespace(scene=bc.Scene(**given), root=SimpleNamespace(hub=hub), exact_step=step)


def sampled(fit, error):
    """The error at the samples is known."""
    object.__setattr__(fit, "__dict__", {**fit.__dict__})
    fit.__dict__["_sampled"] = None if error is None else SimpleNamespace(error=error)
    return fit


def test_modes_are_listed_slowest_first_with_what_was_found_of_them():
    rows = made().modes
    assert rows == [
        ("xy", 1, 2.0, 2.1, 0.011, 0.05, 0.3),
        ("xy", 2, 5.0, 5.5, 0.022, 0.1, 0.4),
        ("xz", 1, 3.0, 3.3, 0.033, 0.1, 0.2),
    ]


def test_all_modes_are_those_of_the_body_and_how_they_were_chosen_is_with_what_is_kept():
    """Of a file they are what moves the ports of the chain, wherever it belongs."""
    fit = made()
    assert fit.full is not fit.target
    assert {port: model.frequencies.tolist() for port, model in fit.full.items()} == {
        "xy": [2.0, 5.0],
        "xz": [3.0],
    }
    assert (fit.kept_for, fit.choice) == ("clamped", None)
    on_hub = made(kept=Kept("hub", {"xy": 1}, choice="choice"))
    assert (on_hub.kept_for, on_hub.choice) == ("hub", "choice")
    rows = np.array(ROWS)
    rows[1, 1] = 0.3  # belongs to xz, and moves xy
    data = bc.ModalData(RIGID, np.array([2.0, 3.0, 5.0, 7.0, 9.0]), rows)
    of_file = made(body=Body(fit.spec, {}, data), target={"xy": fit.target["xy"]})
    assert list(of_file.full) == ["xy"]
    assert of_file.full["xy"].frequencies.tolist() == [2.0, 3.0, 5.0]


def test_the_worst_port_says_the_error():
    fit = made()
    assert fit.worst_port == "xz"
    assert fit.in_band_error == 4e-3
    assert fit.headline == "in-band error 4.00e-03 up to 9 rad/s (xz, worst of 2 ports)"
    one = {"xz": fit.readback_error["xz"]}
    alone = made(readback_error=one, target={"xz": fit.target["xz"]})
    assert alone.headline == "in-band error 4.00e-03 up to 9 rad/s (xz)"
    promised = made(promise=2e-4, spec=scene(bandwidth=11.0))
    assert promised.in_band_error == 2e-4
    assert promised.headline == (
        "in-band error 2.00e-04 up to 11 rad/s, in the motions the scene asks for"
    )
    rigid = made(readback_error={}, target={}, promise=2e-4, spec=scene(bandwidth=11.0))
    assert rigid.headline == "in-band error 2.00e-04 up to 11 rad/s, rigid"
    assert made(readback_error={}, target={}).headline.startswith("rigid: no in-band error")


@pytest.mark.parametrize(
    ("second", "told"),
    [(-1.982, None), (-1.978, "-1.1% in mode 2 of xy"), (-2.1, "+5.0% in mode 2 of xy")],
)
def test_the_tip_is_told_beyond_a_hundredth(second, told):
    tips = {"xy": plane([2.0, 5.0], [0, 0], [1.005, second]), "xz": plane([3.0], [0], [4.02])}
    fit = made(chain=SimpleNamespace(port=tips.get, tendons=(), mass=8.0))
    assert fit.tip_error["xy"] == pytest.approx([0.005, second / -2.0 - 1.0])
    assert fit.tip_error["xz"] == pytest.approx([0.005])
    assert (tip_sentence(fit) is None) == (told is None)
    if told:
        assert told in tip_sentence(fit)
        assert fit.headline.endswith(tip_sentence(fit))


def test_static_shapes_behind_the_modes_are_not_told():
    errors = {**made().readback_error, "xy": comparison([[0, 0]], [0.1], [0.2], 1e-3)}
    tips = {"xy": plane([2.0, 5.0], [0, 0], [1.005, -9.0]), "xz": plane([3.0], [0], [4.02])}
    fit = made(readback_error=errors, chain=SimpleNamespace(port=tips.get, tendons=(), mass=8.0))
    assert tip_sentence(fit) is None


@pytest.mark.parametrize(
    ("damping", "stiffness", "damped", "sprung"),
    [(0.0, 0.0, False, False), (0.02, 0.0, True, False), (0.0, 0.03, False, True)],
)
def test_tendons_that_damp_or_spring(damping, stiffness, damped, sprung, monkeypatch):
    tendons = (
        SimpleNamespace(damping=0.0, stiffness=0.0),
        SimpleNamespace(damping=damping, stiffness=stiffness),
    )
    fit = made(chain=SimpleNamespace(tendons=tendons))
    assert (fit.tendon_damped, fit.tendon_sprung) == (damped, sprung)
    monkeypatch.setattr("beamchain.fitting.proof.coupled_limits", lambda *_, **how: how)
    assert limits_of_chain(fit.chain, "motion", None) == {"tendon": damped, "sprung": sprung}


HUB = bc.Hub(mass=7.0, inertia=(3.0, 4.0, 5.0))


@pytest.mark.parametrize(
    ("given", "error", "promise", "decisive", "met"),
    [
        ({"bandwidth": 10.0, "hub": HUB}, None, 0.98e-3, 0.98e-3, True),
        ({"bandwidth": 10.0, "hub": HUB}, None, 0.995e-3, 0.995e-3, False),
        ({"bandwidth": 10.0, "hub": HUB}, 0.5e-3, 2e-3, 0.5e-3, True),  # of its one hub
        ({"bandwidth": 10.0}, 0.5e-3, 2e-3, 2e-3, False),  # of three hubs too
        ({"bandwidth": 10.0}, 3e-3, 2e-3, 3e-3, False),
        ({"bandwidth": 10.0, "hub": HUB, "step": 0.25}, 0.5e-3, 2e-3, 0.5e-3, True),
        ({"bandwidth": 10.0, "hub": HUB, "step": 0.27}, 0.5e-3, 2e-3, np.inf, False),  # 2.6 rad
        ({}, 3e-3, 2e-3, 3e-3, None),
    ],
)
def test_the_error_that_a_tolerance_is_held_against(given, error, promise, decisive, met):
    fit = sampled(made(promise=promise, spec=scene(tolerance=1e-3, **given)), error)
    assert fit.decisive == decisive
    assert fit.met is met


@pytest.mark.parametrize(("error", "ruined"), [(0.099, False), (0.101, True), (None, False)])
def test_a_step_that_ruins_the_motion_where_no_tolerance_is_stated(error, ruined):
    assert sampled(made(), error).ruined is ruined
    assert not sampled(made(promise=1e-4, spec=scene(bandwidth=1.0)), error).ruined


@pytest.mark.parametrize(("hub", "offset"), [((0.4, 0.2, -0.3), 0.4), (None, 0.0)])
def test_large_motion_is_that_of_kept_modes_beside_the_hub(hub, offset, monkeypatch):
    """A liquid and imported modes have no chain of 60 links."""
    monkeypatch.setattr(result_module, "large_limits", lambda *given: given)
    stated = hub and bc.Hub(mass=7.0, inertia=(3.0, 4.0, 5.0), offset=hub)
    spec = SimpleNamespace(is_beam=True, beam="beam", root=SimpleNamespace(hub=stated))
    fit = made(spec=spec)
    assert fit.large_motion == (fit.chain, "beam", {"xy": 2, "xz": 1}, offset)
    for slosh in (None, "liquid"):
        limits, (caution,) = made(spec=SimpleNamespace(is_beam=False, slosh=slosh)).large_motion
        assert limits == {}
        assert caution.code == "large-motion-unknown"


def test_the_turn_is_that_of_the_hub_with_its_appendage(monkeypatch):
    """7 kg and 3, 4, 5 kg m^2 at the root, 2 kg and no inertia 1.5 m out along x."""
    asked = []
    monkeypatch.setattr(result_module, "turn_error", lambda *given: asked.append(given) or 0.25)
    monkeypatch.setattr(result_module, "scene_step", lambda *_: 0.05)
    arm = np.diag([2.0, 2.0, 2.0, 0.0, 4.5, 4.5])
    arm[1, 5] = arm[5, 1] = 3.0
    arm[2, 4] = arm[4, 2] = -3.0
    rates = (0.1, 0.2, -0.3)
    spec = scene(rates=rates, integrator="RK4", hub=HUB)
    fit = made(spec=spec, measured=SimpleNamespace(rigid_mass=arm))
    assert fit.turn_error == 0.25
    ((inertia, *rest),) = asked
    reduced = 7.0 * 2.0 / 9.0 * 1.5**2
    assert inertia == pytest.approx(np.diag([3.0, 4.0 + reduced, 5.0 + reduced]), abs=1e-12)
    assert rest[0] == rates
    assert rest[1:] == [0.05, "RK4"]
    assert made(spec=scene(rates=rates)).turn_error is None
    assert made(spec=scene(hub=HUB)).turn_error is None


@pytest.mark.parametrize("made_for_it", [True, False])
def test_a_file_that_is_made_for_its_step_has_no_other(made_for_it, monkeypatch):
    """The marks of timing stand in the file itself, not in the one that it is compared with."""
    monkeypatch.setattr(result_module, "timing_marks", lambda text: ["mark"] * (text == "timed"))
    monkeypatch.setattr(result_module, "choose_step", lambda model, hub, keep, *_, **__: keep)
    mass = SimpleNamespace(rigid_mass=np.eye(6))
    measured = SimpleNamespace(motion=mass, live=tuple(range(6)), rigid_mass=np.eye(6))
    spec = scene(bandwidth=10.0, integrator="RK4", step=0.02, axes=("z", "ty"))
    spec.undamped_ratio = 0.005
    fit = made(spec=spec, measured=measured)
    fit.__dict__["time_error"] = object()
    fit.__dict__["_scenes"] = ("timed", "plain") if made_for_it else ("plain", "timed")
    if made_for_it:
        ((integrator, step, *_, cost),) = map(dataclasses.astuple, fit.steps)
        assert (integrator, step, cost) == ("RK4", 0.02, 1.0)
    else:  # of the motions that matter
        assert fit.steps == [1, 5]
    assert made().steps == ()


@pytest.mark.parametrize("first", [0, 1])
def test_the_resonance_that_a_step_shifts_is_blamed_on_the_tendon_it_strains_most(
    first, monkeypatch
):
    """Two tendons, each strained by one of two modes twice as much as the other; the mode next to
    the peak counts."""
    rows = np.array([[2.0, 1.0], [1.0, 2.0]])[:, [first, 1 - first]]
    still = SimpleNamespace(squares=np.array([4.0, 25.0]), shapes=np.eye(2))
    modal = SimpleNamespace(names=("one", "two"), rows=rows, stiffness=np.array([3.0, 3.0]))
    peak = ShiftedPeak(2.2, 0.005, shift=0.01, damped=0.0, change=1.0)
    monkeypatch.setattr(result_module, "motion_at", lambda _: still)
    monkeypatch.setattr(result_module, "shifted_peak", lambda *_: peak)
    monkeypatch.setattr(result_module, "modal_tendons", lambda _: modal)

    def mode(error, promise=1e-4):
        spec = scene(tolerance=1e-3, bandwidth=10.0, hub=HUB, step=0.01)
        spec.undamped_ratio = 0.005
        fit = sampled(made(promise=promise, spec=spec), error)
        fit.__dict__["_sampled"].frequency = 2.0
        fit.__dict__["_scenes"] = (None, None)
        return fit.cause and fit.cause.mode

    assert mode(5e-3) == ("one", "two")[first]
    modal.stiffness[:] = np.array([1.0, 5.0])[[first, 1 - first]]
    assert mode(5e-3) == ("two", "one")[first]
    assert mode(5e-4) is mode(np.inf) is mode(5e-3, promise=4e-3) is None
    modal.names = ()
    assert mode(5e-3) == ""


# -- imported modes --------------------------------------------------------------------------------
RIGID = np.diag([8.0, 8.0, 8.0, 0.5, 30.0, 30.0])
ROWS = np.zeros((5, 6))
ROWS[0, 1], ROWS[1, 2], ROWS[2, 1], ROWS[3, 3], ROWS[4, 2] = 1.0, 1.0, 0.5, 0.3, 0.4


def in_space(numbers, rows=ROWS):
    data = bc.ModalData(RIGID, np.array([2.0, 3.0, 5.0, 7.0, 9.0]), rows)
    return InSpace(data, "", None, None, None, None, (), numbers)


def test_modes_are_numbered_as_in_the_file():
    some = in_space((2, 3, 4, 5))
    assert some.in_file("mode3") == 4
    assert some.in_file("mode2_xz") == 5
    assert some.in_file("mode1_xy") == 3
    assert some.in_file("mode1_torsion") == 4
    assert not some.couples
    assert not in_space(()).couples
    mixed = np.array(ROWS)
    mixed[0, 2] = 0.4
    assert in_space((1, 4), mixed).couples
    assert not in_space((3, 4), mixed).couples


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ((), "none of the 5 modes of the file"),
        ((2,), "mode 2 of the 5 of the file"),
        ((2, 4), "modes 2, 4 of the 5 of the file"),
        ((1, 2, 3, 4, 5), "all 5 modes of the file"),
    ],
)
def test_kept_modes_in_words(numbers, words):
    assert in_space(numbers).kept_words == words


@pytest.mark.parametrize(
    ("scene", "is_beam", "drawn"),
    [
        (None, True, "skin"),
        (bc.Scene(), True, "skin"),
        (None, False, "boxes"),
        (bc.Scene(contacts=True), True, "contacts"),
        (bc.Scene(visuals=False), True, "nothing"),
    ],
)
def test_surfaces_follow_the_kept_modes_at_their_stations(scene, is_beam, drawn, monkeypatch):
    """Further points stand between the stations at 0, 1, 2.5 and 4 m or at one of them."""
    asked = []
    stated = np.array([0.0, 1.0, 2.5, 4.0])
    kept = SimpleNamespace(truncated=lambda count: ("kept", count))
    replaced = {
        "beam_surfaces": lambda _: ["surface"],
        "stations": lambda _: stated,
        "snapped": lambda _, x: x,
        "sampled_model": lambda _, *given: asked.append(given) or "full",
        "reduced_to_kept": lambda *given: asked.append(given) or kept,
        "mode_motion": lambda _, port, kept, x, at: (port, kept, at.tolist()),
        "skins": lambda chain, surfaces, modes: (modes, [0.02]),
    }
    for name, made in replaced.items():
        monkeypatch.setattr(f"beamchain.fitting.look.{name}", made)
    beam = SimpleNamespace(segments=(), joints=(), lumps=())
    spec = SimpleNamespace(scene=scene, is_beam=is_beam, beam=beam, further={"b": 2.5, "a": 1.7})
    counts = Kept("clamped", {"xy": 2, "xz": 0})
    found = look_of(SimpleNamespace(spec=spec, body="body", kept=counts, chain="chain"))
    assert found.drawn == drawn
    if drawn != "skin":
        assert asked == []
        return
    assert asked == [
        ("xy", 8, (0.0, 1.0, 1.7, 2.5, 4.0)),
        ("body", counts, "xy", 2, "full", [2.5, 1.7]),
    ]
    assert found.skins == (("xy", ("kept", 2), [0.0, 1.0, 2.5, 4.0]),)
    assert found.residual == {"xy": 0.02}


@pytest.mark.parametrize("sprung", [True, False])
def test_an_appendage_is_timed_for_any_hub_unless_it_shall_not_be(sprung, monkeypatch):
    asked = []
    monkeypatch.setattr(
        "beamchain.fitting.result.put_timing",
        lambda tree, spec, **how: asked.append((tree.tag, spec, how)),
    )
    fit = SimpleNamespace(_untimed=b"<mujoco/>", spec="spec", tendon_sprung=sprung)
    assert bc.Fit.appendage(fit, timed=False).tag == "mujoco"
    assert asked == []
    bc.Fit.appendage(fit)
    assert asked == [("mujoco", "spec", {"sprung": sprung, "form": 2})]


def test_the_files_of_a_fit(tmp_path, monkeypatch):
    page = "page", {"modes.svg": "<svg/>", "modes.png": b"png"}
    monkeypatch.setattr("beamchain.fitting.result.report.fit_report", lambda _: page)
    fit = SimpleNamespace(
        to_mjcf=lambda: "<appendage/>", scene_mjcf=lambda: "<scene/>", as_dict=lambda: {"ok": True}
    )
    names = [path.name for path in bc.Fit.write(fit, tmp_path / "out")]
    assert sorted(names[:-1]) == [
        "appendage.xml", "modes.png", "modes.svg", "report.html", "scene.xml",
    ]  # fmt: skip
    assert names[-1] == "fit.json"
    found = {name: (tmp_path / "out" / name).read_text() for name in names}
    assert (found["appendage.xml"], found["scene.xml"]) == ("<appendage/>", "<scene/>")
    assert (found["report.html"], found["modes.png"]) == ("page", "png")
    assert json.loads(found["fit.json"]) == {"ok": True}
    with pytest.raises(OutputError):
        bc.Fit.write(fit, tmp_path / "out")


@dataclasses.dataclass(frozen=True)
class Made:
    """A fit in band by some error, whose damping has some form."""

    spec: SimpleNamespace
    met: bool | None
    in_band_error: float | None
    ruined: bool = False
    at_step: bool = False
    cautions: tuple = ()
    cure: object = None
    missed = bc.Fit.missed


@pytest.mark.parametrize(
    ("form", "met", "error", "ruined", "missed", "cured"),
    [
        ("hinge", None, 0.11, False, False, True),
        ("hinge", None, 0.09, False, False, False),
        ("hinge", None, None, False, False, False),
        ("hinge", True, 0.5, False, False, False),
        ("modal", None, 0.5, False, False, False),
        ("modal", False, 0.01, False, True, True),
        ("modal", None, None, True, True, True),
        (None, None, 0.5, False, False, False),
    ],
)
def test_what_was_asked_for_and_missed_is_cured(
    form, met, error, ruined, missed, cured, monkeypatch
):
    """And dampers in hinges that are off by a tenth, where no tolerance is stated."""
    cure = SimpleNamespace(words="Do this.")
    monkeypatch.setattr("beamchain.fitting.fit.cure_of", lambda *_: cure)
    spec = SimpleNamespace(damping=form and SimpleNamespace(form=form), scene=None, exact_step=0.0)
    found = decide(Made(spec, met, error, ruined))
    assert found.missed is missed
    assert found.cure is (cure if cured else None)
    assert cure_sentence(found) == ("Do this." if missed else "")
    assert len(found.cautions) == (cured and not missed)
