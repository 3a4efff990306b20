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
from appendages import panels, tapered_boom
from beamchain.chain.baselines import equal_links
from beamchain.fitting.options import Payload
from beamchain.fitting.spec import spec_from_dict
from beamchain.fitting.spec_text import spec_toml
from beamchain.report import curves, plots
from beamchain.report.craft_plots import assembly_figure
from beamchain.report.page import capitalise
from beamchain.report.pages.fit import fit_report
from beamchain.report.svg import to_svg
from beamchain.structure.exact import UniformBeam
from examples import example
from spacecraft import CRAFTS, spec

CURVE = 1e-3  # rivals add their own peaks to the grid, so that it is not the in-band error's own
MARK = 1e-3  # poles and zeros are marked where the refined grid changes sign

__all__ = ["boom", "reports"]  # the fixtures


@pytest.mark.slow
def test_in_band_errors_stand_beside_the_classical_chains(boom):
    fit, page, _ = boom
    classical = equal_links(fit.spec.beam, 2, "classical").port("xy")
    hub = HUB.mass_matrix()[np.ix_([1, 5], [1, 5])]
    theirs = bc.compare(classical, fit.full["xy"], hub, fit.bandwidth["xy"]).accelerance_in_band
    row = html.fromstring(page).xpath("//caption[text()='In-band error']/../tbody/tr")[0]
    cells = [cell.text_content() for cell in row]
    assert cells[2] == plots.percent(fit.readback_error["xy"].accelerance_in_band)
    assert cells[3] == plots.percent(theirs)


@pytest.mark.slow
def test_verdict(boom):
    fit, page, _ = boom
    verdict = html.fromstring(page).xpath("//p[contains(@class, 'verdict')]")[0]
    assert "missed" not in verdict.get("class")
    assert "3 rigid links on 2 hinges" in verdict.text_content()
    assert plots.percent(fit.readback_error["xy"].accelerance_in_band) in verdict.text_content()
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
        figure = plots.accelerance_figure(fit, port)
        assert len(figure.axes) == 2 * (3 if port in ("xy", "xz") else 1)
        assert figure.axes[-1].get_xlabel() == "frequency, rad/s"
        for above, below in zip(figure.axes[::2], figure.axes[1::2], strict=True):
            assert above.get_ylabel().startswith("|W|, (")
            assert below.get_ylabel() == "phase, °"
            assert above.get_xlim() == below.get_xlim()
        (ax,) = plots.error_figure(fit, port).axes
        assert ax.get_xlabel() == "frequency, rad/s"
        assert "relative" in ax.get_ylabel()
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


@pytest.mark.slow
def test_titles_say_what_is_per_what(boom):
    titles = [ax.get_title(loc="left") for ax in plots.accelerance_figure(boom[0], "xy").axes[::2]]
    assert titles[0] == "acceleration of the root per force"
    assert titles[2] == "angular acceleration of the root per moment"


def test_same_fit_same_picture(boom):
    fit, _, pictures = boom
    assert to_svg(plots.error_figure(fit, "xy"), "error_xy") == pictures["error_xy.svg"]


def test_poles_and_zeros_are_where_they_belong(boom):
    fit = boom[0]
    beam = curves.responses(fit, "xy", with_rivals=False)["beam"]
    exact = UniformBeam(
        15.0, 2.06e11 * np.pi * 0.012**4 / 64, fit.spec.beam.rigid_mass()[0, 0] / 15.0
    )
    free = exact.coupled_frequencies(np.zeros((2, 2)), 6)
    for i, j in ((0, 0), (0, 1), (1, 1)):
        poles, zeros = beam.crossings(i, j)
        inside = free[(free > beam.omega[0]) & (free < beam.omega[-1])]
        np.testing.assert_allclose(poles, inside, rtol=MARK)
        for zero in zeros:
            left, right = exact.W([zero * (1.0 - MARK), zero * (1.0 + MARK)])[i, j]
            assert left * right < 0.0


def test_phase_turns_where_the_poles_and_zeros_are(boom):
    beam = curves.responses(boom[0], "xy", with_rivals=False)["beam"]
    for i, j in ((0, 0), (0, 1), (1, 1)):
        omega, turned = beam.phase(i, j)
        assert set(turned) == {0.0, 180.0}
        at = np.flatnonzero(np.diff(turned))
        middle = (omega[at] + omega[at + 1]) / 2.0
        np.testing.assert_allclose(middle, np.sort(np.concatenate(beam.crossings(i, j))), rtol=MARK)
        assert omega[[0, -1]] == pytest.approx(beam.omega[[0, -1]])


def test_a_curve_stands_where_the_axes_say(boom):
    """Its last point and its peak in the SVG are the curve's own."""
    fit, _, pictures = boom
    root = etree.fromstring(pictures["error_xy.svg"].encode())
    figure = plots.error_figure(fit, "xy")
    (across, high), ax = 72.0 * figure.get_size_inches(), figure.axes[0]
    place = ax.get_position()
    left = place.x0 * across
    top = (1.0 - place.y1) * high
    width = place.width * across
    height = place.height * high
    group = root.xpath("//*[@id='error_xy-panel_1']")[0]
    path = [
        p
        for p in group.xpath(".//*[local-name()='path'][@clip-path]")
        if "stroke: #0a5fb4" in p.get("style", "")
    ]
    points = np.array(re.findall(r"-?[\d.]+", path[0].get("d")), dtype=float).reshape(-1, 2)
    hub, _ = curves.worst_hub(fit, "xy")
    (curve,) = curves.error_curves(
        fit, "xy", [fit.measured.damped_port("xy")], hub, curves.span(fit, "xy")
    )
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    omega = x0 * (x1 / x0) ** ((points[:, 0] - left) / width)
    error = y0 * (y1 / y0) ** ((top + height - points[:, 1]) / height)
    assert omega[-1] == pytest.approx(curve.omega[-1], rel=DRAWN)
    peak = int(np.argmax(error))
    # drawing leaves points out, rivals add some
    assert error[peak] == pytest.approx(curve.error.max(), rel=0.05)


@pytest.mark.slow
def test_what_was_left_out_stands_with_its_cost():
    spec = bc.read_spec(example("array_scene"))
    fit = bc.fit(spec)
    rows = html.fromstring(fit_report(fit)[0]).xpath("//th[text()='why']/ancestor::table/tbody/tr")
    assert [row[0].text_content() for row in rows] == [item.what for item in fit.left_out]
    for row, item in zip(rows, fit.left_out, strict=True):
        assert row[2].text_content() == (plots.percent(item.cost) if item.cost else "nothing")


@pytest.mark.parametrize("name", EVERY)
def test_error_curve_peaks_at_the_in_band_error(name):
    fit = fitted(name)
    for port, error in fit.readback_error.items():
        hub, _ = curves.worst_hub(fit, port)
        (curve,) = curves.error_curves(
            fit, port, [fit.measured.damped_port(port)], hub, curves.span(fit, port)
        )
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
        (0.0057, "0.57\u00a0%"),
        (-0.391, "-39.1\u00a0%"),
        (1.07, "107\u00a0%"),
        (12.345, "1234\u00a0%"),
        (9.06e-12, "9.1\u00a0×\u00a010⁻¹²"),
        (1e3, "1.0\u00a0×\u00a010³"),
    ],
)
def test_percent(value, text):
    assert plots.percent(value) == text


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


@pytest.mark.slow
def test_panels_in_hertz_have_ids_of_their_own():
    embedded = bc.embed(CRAFTS / "planar.xml", {"mount": spec("rod")})
    picture = assembly_figure(embedded.assembly)  # two panels stand uppermost
    hertz = re.findall(r'id="(a-hz\d+)"', to_svg(picture, "a"))
    assert len(hertz) == len(set(hertz)) == min(len(embedded.assembly.motions), 2) == 2


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
