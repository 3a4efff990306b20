"""The report and its pictures: self-contained, valid, complete,
right where a number can be held against another."""

import re
import tempfile
from functools import cache
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pytest
from lxml import etree, html

import beamchain as bc
from appendages import panels, seed_boom, stepped_boom, tapered_boom, timoshenko_boom, unit_beam
from beamchain.report.tables.fit import bench_table
from command import call

DRAWN = 1e-4  # coordinates in pt with a few digits

HUB = bc.Hub(mass=500.0, inertia=(500.0, 500.0, 500.0), offset=(1.0, 0.0, 0.0))

FITS = {
    "seed on a hub": lambda: bc.fit(
        seed_boom(), name="boom", modes={"xy": 2}, root=bc.spec.Root(hub=HUB)
    ),
    "free target": lambda: bc.fit(seed_boom(), modes={"xy": 2}, root=bc.spec.Root(target="free")),
    "hub target": lambda: bc.fit(
        seed_boom(), modes={"xy": 2}, root=bc.spec.Root(target="hub", hub=HUB)
    ),
    "one mode in xz": lambda: bc.fit(unit_beam(), modes={"xz": 1}),
    "damped panels": lambda: bc.fit(
        panels(), modes={"xy": 3, "torsion": 1}, damping=bc.Damping(ratio=0.01)
    ),
    "hinge damping": lambda: bc.fit(
        stepped_boom(), modes={"xy": 2}, damping=bc.Damping(ratio=0.004, form="hinge")
    ),
    "timoshenko": lambda: bc.fit(timoshenko_boom(), modes={"xy": 2}),
    "all ports": lambda: bc.fit(tapered_boom(), modes={"xy": 2, "xz": 1, "torsion": 1, "axial": 1}),
}


def report_of(fit, folder):
    """The page and the pictures that a fit writes."""
    fit.write(folder)
    pictures = {path.name: path.read_text() for path in folder.glob("*.svg")}
    return (folder / "report.html").read_text(), pictures


#: the others in the long half
QUICK = ("seed on a hub", "damped panels")
EVERY = [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.slow]) for name in FITS]
#: those of several ports
SEVERAL = ["damped panels", pytest.param("all ports", marks=pytest.mark.slow)]


@cache
def fitted(name):
    """Each fit, made once, when first asked for."""
    return FITS[name]()


@cache
def reported(name):
    """Each fit with its report, likewise."""
    with tempfile.TemporaryDirectory() as folder:
        return (fitted(name), *report_of(fitted(name), Path(folder) / "out"))


@pytest.fixture(scope="module")
def reports():
    return reported


@pytest.fixture(scope="module")
def boom(reports):
    return reports("seed on a hub")


def text_of(page: str) -> str:
    return " ".join(html.fromstring(page).text_content().split())


# -- the page --------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", EVERY)
@pytest.mark.slow
def test_page_is_self_contained_and_sound(reports, name):
    _, page, _ = reports(name)
    assert not re.search(
        r"""(src|href|srcset|action|data)\s*=\s*["']?\s*(https?:|//|file:)""", page
    )
    assert not re.search(r"<(link|iframe|object|embed)\b", page)
    pictures = html.fromstring(page).xpath("//img/@src | //source/@srcset")
    assert all(address.startswith("data:image/webp;base64,") for address in pictures)
    assert (
        page.count("<script>") == page.count("<script") == 1
    )  # it says of what is wider than the page that it scrolls
    assert "default-src 'none'; img-src data:;" in page
    assert "@import" not in page
    assert not re.search(r"url\((?!#)", page)
    root = html.fromstring(page)
    ids = root.xpath("//@id")
    assert len(ids) == len(set(ids))
    used = set(re.findall(r"url\(#([^)]+)\)", page)) | {
        a[1:] for a in root.xpath("//@href") if a.startswith("#")
    }
    assert used
    assert used <= set(ids)
    for svg in root.iter("svg"):
        assert svg.get("aria-label")
        assert svg.get("role") == "img"
    for figure in root.iter("figure"):
        assert figure.find("figcaption").text_content().strip()


@pytest.mark.parametrize("name", ["seed on a hub", *SEVERAL])
@pytest.mark.slow
def test_page_parses_without_errors(reports, name):
    parser = etree.HTMLParser(recover=True)
    etree.fromstring(reports(name)[1].encode(), parser)
    unknown_tag = 801  # libxml2 knows no HTML 5 and no SVG
    assert [str(error) for error in parser.error_log if error.type != unknown_tag] == []


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.slow
def test_headings_do_not_skip_a_level(reports, name):
    levels = [int(e.tag[1]) for e in html.fromstring(reports(name)[1]).iter("h1", "h2", "h3", "h4")]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(b <= a + 1 for a, b in pairwise(levels))


def test_page_holds_the_numbers(boom):
    fit, page, _ = boom
    text = text_of(page)
    for values in (
        fit.target["xy"].frequencies,
        fit.achieved["xy"].frequencies,
        fit.full["xy"].free_frequencies[:2],
    ):
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
    for line in (
        "beamchain fit boom.toml -o boom",
        'section = {shape = "round", diameter = 0.012}',
    ):
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


def test_the_integrator_error_is_that_of_the_scenes_integrator():
    """A step of RK4 is the polynomial of degree 4 of exp."""
    scene = bc.Scene(integrator="RK4", timestep=0.02)
    found = bench_table(bc.fit(seed_boom(), modes={"xy": 2}, scene=scene))
    assert found.title == "Integrator error: RK4 at a step of 0.02 s"
    columns = {column.name: np.array(column.values, dtype=float) for column in found.columns}
    x = 0.02j * columns["continuous"]
    step = 1.0 + x + x**2 / 2.0 + x**3 / 6.0 + x**4 / 24.0
    assert columns["at this step"] == pytest.approx(np.abs(np.log(step)) / 0.02, rel=1e-8)


@pytest.mark.parametrize("name", SEVERAL)
def test_several_ports_each_have_their_tables_and_pictures(reports, name):
    fit, page, pictures = reports(name)
    assert len(fit.target) > 1
    assert set(pictures) == {*(f"response_{port}.svg" for port in fit.target), "chain.svg"}
    text = text_of(page)
    for port in fit.target:
        assert f"Model error in {port}" in text
    assert ("stiffness axial, N/m" in text) == ("axial" in fit.target)
    assert "stiffness torsion, N m/rad" in text


@pytest.mark.parametrize(
    ("name", "ratio"),
    [
        ("damped panels", "0.01"),
        pytest.param("hinge damping", "0.004", marks=pytest.mark.slow),
    ],
)
def test_damping_ratios_are_shown_where_there_are_any(reports, name, ratio):
    assert "damping ratio, asked" not in reports("seed on a hub")[1]
    fit, page, _ = reports(name)
    assert "damping ratio, asked" in page
    assert ratio in text_of(page)
    assert f"{fit.achieved['xy'].damping[1]:.4g}" in text_of(page)


@pytest.mark.parametrize("name", EVERY)
def test_spec_reads_back_as_the_same_spec(reports, name, tmp_path):
    """The specification that stands in the page."""
    fit, page, _ = reports(name)
    (section,) = html.fromstring(page).xpath("//section[.//h2[text()='To reproduce']]")
    (tmp_path / "spec.toml").write_text([code.text_content() for code in section.iter("code")][-1])
    assert bc.read_spec(tmp_path / "spec.toml") == fit.spec


# -- the pictures ----------------------------------------------------------------------------------
@pytest.mark.parametrize("name", EVERY)
def test_pictures_are_well_formed_text(reports, name):
    _, _, pictures = reports(name)
    for file, content in pictures.items():
        root = etree.fromstring(content.encode())
        words = " ".join(root.itertext())
        assert "x from the root, m" in words if file == "chain.svg" else "frequency, rad/s" in words
        assert "nan" not in re.findall(r"[\w.]+", content)
        ids = root.xpath("//@id")
        assert len(ids) == len(set(ids))


def test_what_was_not_asked_for_is_hatched_and_hertz_stand_above(boom):
    """The scale in Hz, read from its labels, says where the hatching begins;
    it reaches to the panel's end."""
    fit, _, pictures = boom
    root = etree.fromstring(pictures["response_xy.svg"].encode())
    (panel,) = root.xpath("//*[@id='response_xy-panel_1']")
    patterns = {f"url(#{name})" for name in root.xpath("//*[local-name()='pattern']/@id")}
    hatched = [
        p for p in panel.iter("{*}path") if any(x in (p.get("style") or "") for x in patterns)
    ]
    (span,) = [corners(p)[:, 0] for p in hatched]
    assert "not asked for" in " ".join(root.itertext())
    ticks = panel.xpath(
        ".//*[contains(@id, '-hz')]//*[contains(@id, 'xtick')]//*[local-name()='text']"
    )
    places = np.array([float(tick.get("x")) for tick in ticks])
    logarithms = np.log([2.0 * np.pi * float(tick.text) for tick in ticks])
    assert len(ticks) > 2
    slope, offset = np.polyfit(places, logarithms, 1)
    np.testing.assert_allclose(slope * places + offset, logarithms, atol=DRAWN)
    assert np.exp(slope * span.min() + offset) == pytest.approx(fit.bandwidth["xy"], rel=DRAWN)
    assert span.max() == pytest.approx(corners(next(panel.iter("{*}path")))[:, 0].max(), rel=DRAWN)


def corners(path):
    """`(n, 2)` points of a path in the SVG [pt]."""
    return np.array(re.findall(r"-?[\d.]+", path.get("d")), dtype=float).reshape(-1, 2)


def test_the_legend_stands_in_the_picture_on_the_page_too(boom):
    _, page, pictures = boom
    legends = html.fromstring(page).xpath("//figure//svg//*[contains(@id, 'legend')]")
    assert legends
    words = [" ".join("".join(legend.itertext()).split()) for legend in legends]
    assert any("our chain, through MuJoCo" in text and "kept band" in text for text in words)
    assert "legend" in pictures["response_xy.svg"]


def test_plot_returns_its_axes_and_touches_no_global_state(boom):
    from matplotlib import rcParams
    from matplotlib.figure import Figure

    before = dict(rcParams)
    ax = Figure().add_subplot()
    assert boom[0].plot(ax=ax) is ax
    assert {line.get_label() for line in ax.lines} >= {"beam", "our chain, through MuJoCo"}
    assert boom[0].plot().get_ylabel() == "|W|, (m/s²)/N"
    assert dict(rcParams) == before


@pytest.mark.slow
def test_the_page_counts_the_modes_that_are_kept_everywhere_alike(tmp_path):
    """A tip that matters brings two static shapes, which are no modes;
    what a scene chose is not what was asked."""
    fit = bc.fit(
        seed_boom(), modes={"xy": 2, "xz": 0}, scene=bc.Scene(bandwidth=2.0, axes=("z",), tip=True)
    )
    page, _ = report_of(fit, tmp_path / "out")
    text = text_of(page)
    assert fit.target["xy"].modes == 4
    assert "stand for the beam's first 2 modes in xy" in text
    assert "as few as the scene needs; 2 in xy, 0 in xz as given" in text


BARE = """name = "panel"
[[segment]]
length = 6.0
section = { shape = "equivalent", bending_stiffness_xy = 2e4, linear_mass = 3.0 }
[modes]
xy = 1
"""


@pytest.mark.slow
def test_what_stands_in_for_a_table_that_is_left_out_is_said(tmp_path):
    (tmp_path / "bare.toml").write_text(BARE)
    answer = call("fit", tmp_path / "bare.toml", "-o", tmp_path / "bare")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "bare" / "scene.xml"))
    assert not model.dof_damping.any()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    links = range(model.body("hub").id + 1, model.nbody)
    axes = data.ximat.reshape(-1, 3, 3)
    about = sum(axes[i, 0] ** 2 @ model.body_inertia[i] for i in links)
    page = (tmp_path / "bare" / "report.html").read_text().replace("\u00a0", " ")
    for text in (" ".join(answer.out.split()), page):
        assert "No [damping] is given: the file has none, and errors are those at 0.5 %." in text
    said = re.search(
        r"without polar_inertia: .* is (\S+) kg m² in the file", " ".join(answer.out.split())
    )
    assert float(said[1]) == pytest.approx(about, rel=0.05)
    stated = BARE.replace("linear_mass", "polar_inertia = 0.2, linear_mass")
    (tmp_path / "stated.toml").write_text(f"{stated}[damping]\nratio = 0.01\n")
    answer = call("fit", tmp_path / "stated.toml", "-o", tmp_path / "stated")
    assert not re.search(r"No \[damping\]|without polar_inertia", answer.out)
