"""Tests internals: figures and curves of `report.plots` and `report.curves`,
before they are drawn into a page.

What the pages and pictures say is tested through the public door in test_report.py.
"""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from lxml import etree, html
from test_report import DRAWN, EVERY, HUB, boom, fitted, reports

import beamchain as bc
from appendages import panels, seed_boom, tapered_boom
from beamchain.chain.baselines import equal_links
from beamchain.fitting.options import Payload
from beamchain.fitting.spec import spec_from_dict
from beamchain.fitting.spec_text import spec_toml
from beamchain.report import curves, plots
from beamchain.report.headlines import spring_sentence
from beamchain.report.page import capitalise
from beamchain.report.pages.fit import fit_report
from beamchain.report.svg import to_svg
from beamchain.structure.exact import UniformBeam
from examples import example

CURVE = 1e-3  # the grid of the picture is not the in-band error's own
MARK = 1e-3  # poles and zeros are marked where the refined grid changes sign

__all__ = ["boom", "reports"]  # the fixtures


@pytest.mark.slow
def test_verdict(boom):
    fit, page, _ = boom
    verdict = html.fromstring(page).xpath("//p[contains(@class, 'verdict')]")[0]
    assert "missed" not in verdict.get("class")
    assert "3 rigid links on 2 hinges" in verdict.text_content()
    assert plots.error_text(fit.readback_error["xy"].accelerance_in_band) in verdict.text_content()
    strict = bc.fit(tapered_boom(), modes={"torsion": 1}, scene=bc.Scene(tolerance=1e-6))
    missed = html.fromstring(fit_report(strict)[0]).xpath("//p[contains(@class, 'missed')]")[0]
    assert "more than the tolerance" in missed.text_content()


@pytest.mark.slow
def test_status_is_told_and_escaped():
    fit = bc.fit(tapered_boom(), modes={"torsion": 1})
    missing = ("xy keeps 1 < 2 modes & more.",)
    fit = replace(fit, how="one & the same", missing=missing, history=("first <try>",))
    page, _ = fit_report(fit)
    assert "Less than was asked for: exact chain (one &amp; the same), modes kept: 1 in" in page
    assert "xy keeps 1 &lt; 2 modes &amp; more" in page
    assert "first &lt;try&gt;" in page


def test_spec_text_holds_every_kind_of_value():
    drawn = bc.Equivalent(
        bending_stiffness_xy=2.0, linear_mass=1.0, draw=bc.spec.Draw(width=1.2, thickness=0.02)
    )
    spec = bc.Spec(
        name="all",
        segment=(*panels().segments, bc.Segment(length=1.0, section=drawn)),
        joint=panels().joints,
        lump=panels().lumps,
        payload=Payload(mass=2.0),
        damping=bc.Damping(ratio={"xy": (0.005, 0.004), "torsion": (0.01,)}, form="hinge"),
        modes=bc.Modes(xy=2, torsion=1),
        root=bc.spec.Root(target="clamped", hub=HUB),
        fit=bc.spec.FitOptions(springs="modes", cuts=(1.0, 2.0)),
        scene=bc.Scene(bandwidth=10.0, axes=("z",), tip=True, visuals=False),
    )
    assert spec_from_dict(tomllib.loads(spec_toml(spec))) == spec


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.slow
def test_axes_have_labels_with_units(name):
    fit = fitted(name)
    for port in fit.target:
        above, below = plots.response_figure(fit, port).axes
        assert below.get_xlabel() == "frequency, rad/s"
        assert above.get_ylabel().startswith("|W|, (")
        assert above.get_xlim() == below.get_xlim()
        assert "relative" in below.get_ylabel()
    assert plots.chain_figure(fit).axes[-1].get_xlabel() == "x from the root, m"


@pytest.mark.parametrize("name", EVERY)
def test_no_label_of_the_chain_overlaps_another(name):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = plots.chain_figure(fitted(name))
    renderer = FigureCanvasAgg(figure).get_renderer()
    for ax in figure.axes:
        boxes = [
            text.get_window_extent(renderer) for text in [*ax.texts, ax.title] if text.get_text()
        ]
        for i, box in enumerate(boxes):
            assert box.x0 >= 0.0
            assert box.x1 <= figure.bbox.width
            assert not any(box.overlaps(other) for other in boxes[i + 1 :])


def test_same_fit_same_picture(boom):
    fit, _, pictures = boom
    assert to_svg(plots.response_figure(fit, "xy"), "response_xy") == pictures["response_xy.svg"]


def test_poles_and_zeros_are_where_they_belong(boom):
    fit = boom[0]
    beam, _ = curves.responses(fit, "xy")
    exact = UniformBeam(
        15.0, 2.06e11 * np.pi * 0.012**4 / 64, fit.spec.beam.rigid_mass()[0, 0] / 15.0
    )
    free = exact.coupled_frequencies(np.zeros((2, 2)), 6)
    poles, zeros = beam.crossings()
    inside = free[(free > beam.omega[0]) & (free < beam.omega[-1])]
    np.testing.assert_allclose(poles, inside, rtol=MARK)
    assert zeros.size
    for zero in zeros:
        left, right = exact.W([zero * (1.0 - MARK), zero * (1.0 + MARK)])[0, 0]
        assert left * right < 0.0


@pytest.mark.slow
def test_planes_of_a_round_boom_are_drawn_once_unless_their_hubs_differ():
    round_boom = {"modes": {"xy": 2, "xz": 2, "torsion": 1}}
    alone = bc.fit(seed_boom(), **round_boom)
    assert curves.alike_ports(alone) == [("xy", "xz"), ("torsion",)]
    hub = bc.Hub(mass=500.0, inertia=(500.0, 500.0, 400.0))
    held = bc.fit(seed_boom(), **round_boom, root=bc.spec.Root(hub=hub))
    assert curves.alike_ports(held) == [("xy",), ("xz",), ("torsion",)]


def test_a_curve_stands_where_the_axes_say(boom):
    """Its last point and its peak in the SVG are the curve's own."""
    fit, _, pictures = boom
    root = etree.fromstring(pictures["response_xy.svg"].encode())
    figure = plots.response_figure(fit, "xy")
    to_svg(figure, "response_xy")  # panels get their places when they are drawn
    (across, high), ax = 72.0 * figure.get_size_inches(), figure.axes[1]
    place = ax.get_position()
    left = place.x0 * across
    top = (1.0 - place.y1) * high
    width = place.width * across
    height = place.height * high
    group = root.xpath("//*[@id='response_xy-panel_2']")[0]
    path = [
        p
        for p in group.xpath(".//*[local-name()='path'][@clip-path]")
        if "stroke: #0a5fb4" in p.get("style", "")
    ]
    points = np.array(re.findall(r"-?[\d.]+", path[0].get("d")), dtype=float).reshape(-1, 2)
    hub, _ = curves.worst_hub(fit, "xy")
    curve = curves.error_curve(fit, "xy", hub, curves.span(fit, "xy"))
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    omega = x0 * (x1 / x0) ** ((points[:, 0] - left) / width)
    error = y0 * (y1 / y0) ** ((top + height - points[:, 1]) / height)
    assert omega[-1] == pytest.approx(curve.omega[-1], rel=DRAWN)
    peak = int(np.argmax(error))
    # drawing leaves points out
    assert error[peak] == pytest.approx(curve.error.max(), rel=0.05)


@pytest.mark.slow
def test_what_was_left_out_stands_with_its_cost():
    spec = bc.read_spec(example("array_scene"))
    fit = bc.fit(spec)
    rows = html.fromstring(fit_report(fit)[0]).xpath("//th[text()='why']/ancestor::table/tbody/tr")
    assert [row[0].text_content() for row in rows] == [item.what for item in fit.left_out]
    for row, item in zip(rows, fit.left_out, strict=True):
        assert row[2].text_content() == (plots.error_text(item.cost) if item.cost else "nothing")


@pytest.mark.slow
def test_where_the_springs_of_a_chain_stand():
    """On its hinges, on a tendon per mode with that mode's stiffness, or nowhere."""
    assert spring_sentence(bc.fit(bc.read_spec(example("seed_boom")))).startswith("Each hinge has")
    damped = bc.fit(bc.read_spec(example("boom")))
    said = re.findall(r"mode\d_x[yz] ([\d.]+[\d])", spring_sentence(damped))
    frequencies = np.concatenate([damped.target[port].frequencies for port in ("xy", "xz")])
    np.testing.assert_allclose([float(word) for word in said], frequencies**2, rtol=1e-3)
    assert spring_sentence(bc.fit(bc.read_spec(example("tank")))) == ""
    section = bc.Equivalent(bending_stiffness_xy=1e6, linear_mass=1.0)
    stiff = bc.Spec(
        segment=(bc.Segment(length=1.0, section=section),), scene=bc.Scene(bandwidth=0.1)
    )
    assert spring_sentence(bc.fit(stiff)) == ""


@pytest.mark.parametrize("name", EVERY)
def test_error_curve_peaks_at_the_in_band_error(name):
    fit = fitted(name)
    for port, error in fit.readback_error.items():
        hub, _ = curves.worst_hub(fit, port)
        curve = curves.error_curve(fit, port, hub, curves.span(fit, port))
        assert curve.error[curve.peak(fit.bandwidth[port])] == pytest.approx(
            error.accelerance_in_band, rel=CURVE
        )


def test_a_hinge_at_the_root_has_a_finite_response():
    fit = fitted("seed on a hub")
    port = equal_links(fit.spec.beam, 3, "classical").port("xy")
    assert np.linalg.matrix_rank(port.residual_mass, tol=1e-9) < 2
    found = curves.response(curves.undamped_accelerance(port), curves.span(fit, "xy"))
    assert np.all(np.isfinite(found.values))
    assert found.omega.size > 280


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.0057, "5.70\u00a0×\u00a010⁻³"),
        (-0.391, "-0.391"),
        (1.07, "1.07"),
        (12.345, "12.3"),
        (9.06e-12, "9.06\u00a0×\u00a010⁻¹²"),
        (1e3, "1.00\u00a0×\u00a010³"),
    ],
)
def test_error_text(value, text):
    assert plots.error_text(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (56.56, "56.6 N"),
        (1563.0, "1560 N"),
        (53210.0, "53.2 kN"),
        (1.69e8, "169 MN"),
        (2e9, "2 GN"),
    ],
)
def test_prefixes(value, text):
    assert plots.with_si_prefix(value, "N") == text


@pytest.mark.parametrize(
    ("text", "names", "shown"),
    [
        ("gravity is there.", (), "Gravity is there."),
        ("boom: a word", ("boom",), "boom: a word"),
        ("boom on its hub: a word", ("boom",), "boom on its hub: a word"),
        ("segment[0]: a word", (), "segment[0]: a word"),
        ("damping.ratio = 0.3", (), "damping.ratio = 0.3"),
        ("xy keeps 1 mode", (), "xy keeps 1 mode"),
        ("", (), ""),
    ],
)
def test_how_a_sentence_begins(text, names, shown):
    assert capitalise(text, names) == shown
