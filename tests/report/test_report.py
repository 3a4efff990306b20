"""The report and its pictures: self-contained, valid, complete, right where a number can be held against another."""

import json
import re
import tomllib
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from lxml import etree, html

import beamchain as bc
from appendages import panels, seed_boom, stepped_boom, tapered_boom, timoshenko_boom, unit_beam
from beamchain.chain.build import Status
from beamchain.chain.rivals import equal_links
from beamchain.cli import shipped
from beamchain.fitting.options import Payload
from beamchain.fitting.spec import spec_from_dict
from beamchain.fitting.spec_text import spec_toml
from beamchain.report import curves, plots
from beamchain.report.html import fit_report
from beamchain.report.svg import to_svg
from beamchain.structure.exact import UniformBeam

CURVE = 1e-3  # rivals add their own peaks to the grid, so that it is not the in-band error's own
DRAWN = 1e-4  # coordinates in pt with a few digits
MARK = 1e-3  # poles and zeros are marked where the refined grid changes sign

HUB = bc.Hub(mass=500.0, inertia=(500.0, 500.0, 500.0), offset=(1.0, 0.0, 0.0))

FITS = {
    "seed on a hub": lambda: bc.fit(seed_boom(), name="boom", modes={"xy": 2}, root=bc.Root(hub=HUB)),
    "free target": lambda: bc.fit(seed_boom(), modes={"xy": 2}, root=bc.Root(target="free")),
    "hub target": lambda: bc.fit(seed_boom(), modes={"xy": 2}, root=bc.Root(target="hub", hub=HUB)),
    "one mode in xz": lambda: bc.fit(unit_beam(), modes={"xz": 1}),
    "damped panels": lambda: bc.fit(panels(), modes={"xy": 3}, damping=bc.Damping(ratio=0.01)),
    "hinge damping": lambda: bc.fit(stepped_boom(), modes={"xy": 2}, damping=bc.Damping(ratio=0.004, form="hinge")),
    "timoshenko": lambda: bc.fit(timoshenko_boom(), modes={"xy": 2}),
    "classical": lambda: bc.fit(seed_boom(), modes={"xy": 2}, options=bc.FitOptions(method="classical", links=20)),
    "naive": lambda: bc.fit(seed_boom(), modes={"xy": 2}, options=bc.FitOptions(method="naive", links=3)),
    "midpoint": lambda: bc.fit(tapered_boom(), modes={"xy": 2}, options=bc.FitOptions(method="midpoint", links=3)),
    "paper": lambda: bc.fit(seed_boom(), modes={"xy": 2}, options=bc.FitOptions(method="seed")),
    "all ports": lambda: bc.fit(tapered_boom(), modes={"xy": 2, "xz": 1, "torsion": 1, "axial": 1}),
}


@pytest.fixture(scope="module")
def reports():
    """Each fit with its report, made once, when first asked for."""
    made = {}

    def get(name):
        if name not in made:
            fit = FITS[name]()
            made[name] = (fit, *fit_report(fit))
        return made[name]

    return get


@pytest.fixture(scope="module")
def boom(reports):
    return reports("seed on a hub")


def text_of(page: str) -> str:
    return " ".join(html.fromstring(page).text_content().split())


# -- the page --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", FITS)
def test_page_is_self_contained_and_sound(reports, name):
    _, page, _ = reports(name)
    assert not re.search(r"""(src|href|srcset|action|data)\s*=\s*["']?\s*(https?:|//|file:)""", page)
    assert not re.search(r"<(link|iframe|img|object|embed)\b", page)
    assert page.count("<script>") == page.count("<script") == 1  # the one that zooms, and it stands in the page
    assert "default-src 'none'" in page
    assert "@import" not in page
    assert not re.search(r"url\((?!#)", page)
    root = html.fromstring(page)
    ids = root.xpath("//@id")
    assert len(ids) == len(set(ids))
    used = set(re.findall(r"url\(#([^)]+)\)", page)) | {a[1:] for a in root.xpath("//@href") if a.startswith("#")}
    assert used
    assert used <= set(ids)
    for svg in root.iter("svg"):
        assert svg.get("aria-label")
        assert svg.get("role") == "img"
    for figure in root.iter("figure"):
        assert figure.find("figcaption").text_content().strip()


@pytest.mark.parametrize("name", ["seed on a hub", "all ports"])
def test_page_parses_without_errors(reports, name):
    parser = etree.HTMLParser(recover=True)
    etree.fromstring(reports(name)[1].encode(), parser)
    unknown_tag = 801  # libxml2 knows no HTML 5 and no SVG
    assert [str(error) for error in parser.error_log if error.type != unknown_tag] == []


@pytest.mark.parametrize("name", FITS)
def test_headings_do_not_skip_a_level(reports, name):
    levels = [int(e.tag[1]) for e in html.fromstring(reports(name)[1]).iter("h1", "h2", "h3", "h4")]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(b <= a + 1 for a, b in pairwise(levels))


def test_page_holds_the_numbers(boom):
    fit, page, _ = boom
    text = text_of(page)
    for values in (fit.target["xy"].frequencies, fit.achieved["xy"].frequencies, fit.full["xy"].free_frequencies[:2]):
        for value in values:
            assert f"{value:.6g}" in text
    for row in fit.target["xy"].participation:
        assert ", ".join(f"{v:.5g}" for v in row) in text
    for link in fit.chain.links:
        for value in (link.length, link.mass, link.com):
            assert f"{value:.6g}" in text
    for hinge in fit.chain.hinges:
        assert f"{hinge.x:.6g}" in text
        assert f"{hinge.stiffness['xy']:.6g}" in text
    for name, step in fit.limits.largest_step.items():
        assert name in text
        assert ("no limit" if np.isinf(step) else f"{step:.4g}") in text
    assert f"{fit.limits.omega_max:.6g}" in text
    assert "500 kg, inertia 500, 500, 500 kg m²" in text
    assert bc.__version__ in text
    assert fit.status.message in text
    for line in ("beamchain fit boom.toml -o boom", 'section = { shape = "round", diameter = 0.012 }'):
        assert line in page.replace("&#34;", '"')


def test_integrator_and_model_error_stand_apart(boom):
    fit, page, _ = boom
    linear = fit.measured.linearisation
    discrete, _ = linear.discrete_frequencies()
    text = text_of(page)
    assert f"Integrator error: {linear.integrator} at a step of {linear.timestep:g} s" in text
    assert "Model error in xy" in text
    for value in discrete:
        assert f"{value:.6g}" in text


def test_in_band_errors_stand_beside_the_classical_chains(boom):
    fit, page, _ = boom
    classical = equal_links(fit.spec.beam, 2, "classical").port("xy")
    hub = HUB.mass_matrix()[np.ix_([1, 5], [1, 5])]
    theirs = bc.compare(classical, fit.full["xy"], hub, fit.bandwidth["xy"]).accelerance_in_band
    row = html.fromstring(page).xpath("//caption[text()='In-band error']/../tbody/tr")[0]
    cells = [cell.text_content() for cell in row]
    assert cells[2] == plots.percent(fit.error["xy"].accelerance_in_band)
    assert cells[3] == plots.percent(theirs)


def test_verdict(boom):
    fit, page, _ = boom
    verdict = html.fromstring(page).xpath("//p[contains(@class, 'verdict')]")[0]
    assert "missed" not in verdict.get("class")
    assert "3 rigid links on 2 hinges" in verdict.text_content()
    assert plots.percent(fit.error["xy"].accelerance_in_band) in verdict.text_content()
    strict = bc.fit(fit.spec, scene=bc.Scene(tolerance=1e-6))
    missed = html.fromstring(fit_report(strict)[0]).xpath("//p[contains(@class, 'missed')]")[0]
    assert "more than the tolerance" in missed.text_content()


def test_status_is_told_and_escaped(boom):
    fit = replace(boom[0], status=Status(False, "xy keeps 1 < 2 modes & more", ("first <try>",)))
    page, _ = fit_report(fit)
    assert "Less than was asked for: xy keeps 1 &lt; 2 modes &amp; more" in page
    assert "first &lt;try&gt;" in page


def test_several_ports_each_have_their_tables_and_pictures(reports):
    fit, page, pictures = reports("all ports")
    wanted = {f"{kind}_{port}.svg" for kind in ("accelerance", "error") for port in fit.target} | {"chain.svg"}
    assert set(pictures) == wanted
    text = text_of(page)
    for port in ("xy", "xz", "torsion", "axial"):
        assert f"Model error in {port}" in text
        assert f"Port {port}" in text
    assert "stiffness axial, N/m" in text
    assert "stiffness torsion, N m/rad" in text


def test_damping_ratios_are_shown_where_there_are_any(reports):
    assert "damping ratio, asked" not in reports("seed on a hub")[1]
    for name, ratio in (("damped panels", "0.01"), ("hinge damping", "0.004")):
        fit, page, _ = reports(name)
        assert "damping ratio, asked" in page
        assert ratio in text_of(page)
        assert f"{fit.achieved['xy'].damping[1]:.4g}" in text_of(page)


@pytest.mark.parametrize("name", FITS)
def test_spec_reads_back_as_the_same_spec(reports, name):
    spec = reports(name)[0].spec
    assert spec_from_dict(tomllib.loads(spec_toml(spec))) == spec


def test_spec_text_holds_every_kind_of_value():
    drawn = bc.Equivalent(bending_stiffness_xy=2.0, linear_mass=1.0, draw=bc.Draw(width=1.2, thickness=0.02))
    spec = bc.Spec(
        name="all",
        segment=(*panels().segments, bc.Segment(length=1.0, section=drawn)),
        joint=panels().joints,
        lump=panels().lumps,
        payload=Payload(mass=2.0),
        damping=bc.Damping(ratio={"xy": (0.005, 0.004), "torsion": (0.01,)}, form="hinge"),
        modes=bc.Modes(xy=2, torsion=1),
        root=bc.Root(target="clamped", hub=HUB),
        fit=bc.FitOptions(method="least_squares", links=(2.0, 2.0, 2.0), free=("stiffness",)),
        scene=bc.Scene(bandwidth=10.0, axes=("z",), tip=True, visuals=False),
    )
    assert spec_from_dict(tomllib.loads(spec_toml(spec))) == spec


# -- the pictures ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", FITS)
def test_pictures_are_well_formed_text(reports, name):
    _, _, pictures = reports(name)
    for file, content in pictures.items():
        root = etree.fromstring(content.encode())
        words = " ".join(root.itertext())
        assert "x from the root, m" in words if file == "chain.svg" else "frequency, rad/s" in words
        assert "nan" not in re.findall(r"[\w.]+", content)
        ids = root.xpath("//@id")
        assert len(ids) == len(set(ids))


@pytest.mark.parametrize("name", FITS)
def test_axes_have_labels_with_units(reports, name):
    fit = reports(name)[0]
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


@pytest.mark.parametrize("name", FITS)
def test_no_label_of_the_chain_overlaps_another(reports, name):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = plots.chain_figure(reports(name)[0])
    renderer = FigureCanvasAgg(figure).get_renderer()
    for ax in figure.axes:
        boxes = [text.get_window_extent(renderer) for text in [*ax.texts, ax.title] if text.get_text()]
        for i, box in enumerate(boxes):
            assert box.x0 >= 0.0
            assert box.x1 <= figure.bbox.width
            assert not any(box.overlaps(other) for other in boxes[i + 1 :])


def in_units(told, axis, place):
    """The value at a place of the SVG on a logarithmic axis that `data-plot` describes."""
    left, _, width, _ = told["box"]
    low, high = told[axis]
    return low * (high / low) ** ((place - left) / width)


@pytest.mark.parametrize("file", ["accelerance_xy.svg", "error_xy.svg"])
def test_what_was_not_asked_for_is_hatched_and_hertz_stand_above(boom, file):
    fit, _, pictures = boom
    root = etree.fromstring(pictures[file].encode())
    told = json.loads(root.get("data-plot"))[0]
    panel = root.xpath(f"//*[@id='{told['id']}']")[0]
    patterns = {f"url(#{name})" for name in root.xpath("//*[local-name()='pattern']/@id")}
    hatched = [p for p in panel.iter("{*}path") if any(x in (p.get("style") or "") for x in patterns)]
    (span,) = [np.array(re.findall(r"-?[\d.]+", p.get("d")), dtype=float).reshape(-1, 2) for p in hatched]
    ends = [in_units(told, "x", x) for x in (span[:, 0].min(), span[:, 0].max())]
    assert ends == pytest.approx([fit.bandwidth["xy"], told["x"][1]], rel=DRAWN)
    assert "not asked for" in " ".join(root.itertext())
    ticks = root.xpath("//*[contains(@id, '-hz')]//*[contains(@id, 'xtick')]//*[local-name()='text']")
    assert len(ticks) > 1
    for tick in ticks:
        omega = in_units(told, "x", float(tick.get("x")))
        assert 2.0 * np.pi * float(tick.text) == pytest.approx(omega, rel=DRAWN)


def test_titles_say_what_is_per_what(boom):
    titles = [ax.get_title(loc="left") for ax in plots.accelerance_figure(boom[0], "xy").axes[::2]]
    assert titles[0] == "acceleration of the root per force"
    assert titles[2] == "angular acceleration of the root per moment"


def test_the_legend_of_a_page_is_text_with_the_marks_of_the_picture(boom):
    _, page, pictures = boom
    first = html.fromstring(page).xpath("//ul[@class='legend']")[0]
    labels = [item.text_content().strip() for item in first]
    assert labels[:3] == ["beam", "our chain, through MuJoCo", "kept band"]
    assert all(item.xpath(".//path | .//use") for item in first)
    inside = html.fromstring(page).xpath("//figure/div/svg//*[contains(@id, 'legend')]")
    assert inside == []
    assert "legend" in pictures["accelerance_xy.svg"]  # which stands alone


def test_same_fit_same_picture(boom):
    fit, _, pictures = boom
    assert to_svg(plots.error_figure(fit, "xy"), "error_xy") == pictures["error_xy.svg"]


def test_plot_returns_its_axes_and_touches_no_global_state(boom):
    from matplotlib import rcParams
    from matplotlib.figure import Figure

    before = dict(rcParams)
    ax = Figure().add_subplot()
    assert boom[0].plot(ax=ax) is ax
    assert {line.get_label() for line in ax.lines} >= {"beam", "our chain, through MuJoCo"}
    assert boom[0].plot().get_ylabel() == "|W|, (m/s²)/N"
    assert dict(rcParams) == before


def test_poles_and_zeros_are_where_they_belong(boom):
    fit = boom[0]
    beam = curves.responses(fit, "xy", with_rivals=False)["beam"]
    exact = UniformBeam(15.0, 2.06e11 * np.pi * 0.012**4 / 64, fit.spec.beam.rigid_mass()[0, 0] / 15.0)
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


def test_zoom_is_told_where_the_axes_are(boom):
    """A curve's first and last points in the SVG, through what the page's script is told, are the curve's own."""
    fit, _, pictures = boom
    root = etree.fromstring(pictures["error_xy.svg"].encode())
    (told,) = json.loads(root.get("data-plot"))
    left, top, width, height = told["box"]
    group = root.xpath(f"//*[@id='{told['id']}']")[0]
    path = [p for p in group.xpath(".//*[local-name()='path'][@clip-path]") if "stroke: #0a5fb4" in p.get("style", "")]
    points = np.array(re.findall(r"-?[\d.]+", path[0].get("d")), dtype=float).reshape(-1, 2)
    hub, _ = curves.worst_hub(fit, "xy")
    (curve,) = curves.error_curves(fit, "xy", [fit.achieved["xy"]], hub, curves.span(fit, "xy"))
    (x0, x1), (y0, y1) = told["x"], told["y"]
    omega = x0 * (x1 / x0) ** ((points[:, 0] - left) / width)
    error = y0 * (y1 / y0) ** ((top + height - points[:, 1]) / height)
    assert omega[-1] == pytest.approx(curve.omega[-1], rel=DRAWN)
    peak = int(np.argmax(error))
    assert error[peak] == pytest.approx(curve.error.max(), rel=0.05)  # drawing leaves points out, rivals add some
    assert told["log"]


def test_shapes_are_in_the_page_once_per_port(reports):
    fit, page, _ = reports("all ports")
    root = html.fromstring(page)
    assert len(root.xpath("//svg[@class='shapes']")) == len(fit.target)
    assert len(root.xpath("//input[@type='checkbox']")) == len(fit.target)


def test_what_was_left_out_stands_with_its_cost():
    spec = bc.read_spec(next(one.path for one in shipped.examples() if one.name == "array_scene"))
    fit = bc.fit(spec)
    rows = html.fromstring(fit_report(fit)[0]).xpath("//th[text()='why']/ancestor::table/tbody/tr")
    assert [row[0].text_content() for row in rows] == [item.what for item in fit.left_out]
    for row, item in zip(rows, fit.left_out, strict=True):
        assert row[2].text_content() == (plots.percent(item.cost) if item.cost else "nothing")


@pytest.mark.parametrize("name", FITS)
def test_error_curve_peaks_at_the_in_band_error(reports, name):
    fit = reports(name)[0]
    for port, error in fit.error.items():
        hub, _ = curves.worst_hub(fit, port)
        (curve,) = curves.error_curves(fit, port, [fit.achieved[port]], hub, curves.span(fit, port))
        assert curve.error[curve.peak(fit.bandwidth[port])] == pytest.approx(error.accelerance_in_band, rel=CURVE)


def test_a_hinge_at_the_root_has_a_finite_response(reports):
    fit = reports("naive")[0]
    assert np.linalg.matrix_rank(fit.chain.port("xy").residual_mass, tol=1e-9) < 2
    found = curves.response(curves.undamped(fit.chain.port("xy")), curves.span(fit, "xy"))
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
    ("value", "text"), [(56.56, "56.6 N"), (1563.0, "1560 N"), (53210.0, "53.2 kN"), (1.69e8, "169 MN"), (2e9, "2 GN")]
)
def test_prefixes(value, text):
    assert plots.prefixed(value, "N") == text


def test_the_page_counts_the_modes_that_are_kept_everywhere_alike():
    """A tip that matters brings two static shapes, which are no modes; what a scene chose is not what was asked."""
    fit = bc.fit(seed_boom(), modes={"xy": 2, "xz": 0}, scene=bc.Scene(bandwidth=2.0, axes=("z",), tip=True))
    page, _ = fit_report(fit)
    text = text_of(page)
    assert fit.target["xy"].modes == 4
    assert "stand for the beam's first 2 modes in xy" in text
    assert "as few as the scene needs; 2 in xy, 0 in xz as given" in text
    assert "Shapes of the first 2 cantilever modes in xy" in page
