"""The reports of embed and stability: self-contained, sound, their numbers those of the results,
their commands true."""

import re
import shlex
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from lxml import html

import beamchain as bc
from beamchain.steps.budget import HOST
from command import call
from examples import EXAMPLES, example
from spacecraft import CRAFTS, frequencies, spec

pytestmark = pytest.mark.slow  # its pages take seconds

SAME = 1e-12  # the same computation once more
CREST = 0.01  # how far a crest may rise between the points of the grid (3e-4 measured)
SHOWN = 5e-7  # seven digits are shown


@pytest.fixture(scope="module")
def observer():
    return bc.embed(
        CRAFTS / "observer.xml", {"left": spec("array_left"), "boom_mount": spec("boom")}
    )


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The page of `inspect --steps`, and its record."""
    folder = tmp_path_factory.mktemp("stability") / "out"
    answer = call("inspect", example("seed_boom"), "--steps", "-o", folder, "--json")
    assert answer.status == 0, answer.err
    return (folder / "report.html").read_text(), answer.record


@pytest.fixture(scope="module")
def pages(observer, study):
    return {"embed": observer.report("observer.xml", "out.xml"), "stability": study[0]}


def rows(page, title):
    """Cells of the tables of a section."""
    root = html.fromstring(page)
    (section,) = root.xpath(f"//section[.//h2[text()='{title}']]")
    return [
        [cell.text_content() for cell in row.iter("th", "td")]
        for row in section.xpath(".//tbody/tr")
    ]


@pytest.mark.parametrize("name", ["embed", "stability"])
def test_page_is_self_contained_and_sound(name, pages):
    page = pages[name]
    assert not re.search(
        r"""(src|href|srcset|action|data)\s*=\s*["']?\s*(https?:|//|file:)""", page
    )
    assert not re.search(r"<(link|iframe|object|embed)\b", page)
    pictures = html.fromstring(page).xpath("//img/@src | //source/@srcset")
    assert all(address.startswith("data:image/webp;base64,") for address in pictures)
    assert not re.search(r"url\((?!#)", page)
    assert "default-src 'none'" in page
    root = html.fromstring(page)
    ids = root.xpath("//@id")
    assert len(ids) == len(set(ids))
    used = set(re.findall(r"url\(#([^)]+)\)", page)) | {
        a[1:] for a in root.xpath("//@href") if a.startswith("#")
    }
    assert used <= set(ids)
    assert all(svg.get("aria-label") and svg.get("role") == "img" for svg in root.iter("svg"))
    assert all(figure.find("figcaption").text_content().strip() for figure in root.iter("figure"))
    levels = [int(e.tag[1]) for e in root.iter("h1", "h2", "h3", "h4")]
    assert levels.count(1) == 1
    assert all(b <= a + 1 for a, b in pairwise(levels))


def test_coupled_modes_are_those_of_the_file(observer, pages):
    shown = rows(pages["embed"], "Coupled modes of the whole spacecraft")
    ours = [float(row[3]) for row in shown if row[3] != "left out"]
    np.testing.assert_allclose(
        np.sort(ours), frequencies(observer.untimed)[-len(ours) :], rtol=1e-5
    )  # by forces, not by A and B
    exact = [float(row[1]) for row in shown if row[1] != "-"]
    assert exact == sorted(exact)
    for row, mode in zip(shown, observer.assembly.modes, strict=True):
        within = mode.exact is not None and mode.exact <= observer.assembly.band
        assert row[5] == (
            "yes" if mode.kept and within else "kept, beyond the band" if mode.kept else "no"
        )
        if mode.exact is not None:
            assert float(row[1]) == pytest.approx(mode.exact, rel=SHOWN)


def test_error_over_frequency_has_the_in_band_error_as_its_largest(observer):
    assembly = observer.assembly
    inside = assembly.omega <= assembly.common
    # the grid's highest point by A and B, and the crest between its points
    assert assembly.in_band == observer.promise.poses["rest"]
    assert assembly.error[inside].max() == pytest.approx(assembly.in_band, rel=CREST)
    assert np.all(assembly.error >= 0.0)
    assert not np.all(inside)


def test_what_is_missing_is_said(observer, pages):
    root = html.fromstring(pages["embed"])
    (section,) = root.xpath("//section[.//h2[text()='Left out']]")
    gone = [m.exact for m in observer.assembly.modes if m.mujoco is None]
    assert gone
    assert all(f"{w:.5g}" in section.text_content() for w in gone)


def test_commands_of_the_embed_page_make_the_same_file(pages, observer, tmp_path, monkeypatch):
    root = html.fromstring(pages["embed"])
    (section,) = root.xpath("//section[.//h2[text()='To reproduce']]")
    first, *specs = [code.text_content() for code in section.iter("code")]
    for name, text in zip([h.text_content() for h in section.iter("h3")], specs, strict=True):
        (tmp_path / name).write_text(text)
    for item in ("observer.xml", "parts"):
        (tmp_path / item).symlink_to(CRAFTS / item)
    monkeypatch.chdir(tmp_path)
    assert call(*shlex.split(first.replace("\\\n", " "))[1:]).status == 0
    again = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    np.testing.assert_allclose(frequencies(again), frequencies(observer.model), rtol=SAME)
    assert (tmp_path / "out_report.html").read_text() == pages["embed"]


def test_no_report_where_none_is_wanted(tmp_path):
    words = ["embed", str(CRAFTS / "planar.xml"), "--mount", f"mount={spec('rod')}"]
    assert call(*words, "-o", tmp_path / "out.xml", "--no-report").status == 0
    assert [path.name for path in tmp_path.iterdir()] == ["out.xml"]


def test_less_than_asked_for_stands_in_the_verdict(tmp_path):
    text = spec("rod").read_text().replace("xy = 2", "xy = 12") + '\n[fit]\nsprings = "hinges"\n'
    (tmp_path / "many.toml").write_text(text)
    done = bc.embed(CRAFTS / "planar.xml", {"mount": tmp_path / "many.toml"})
    assert not done.appendages[0].fit.status.ok
    root = html.fromstring(done.report())
    (verdict,) = root.xpath("//p[contains(@class, 'verdict')]")
    assert "missed" in verdict.get("class")
    assert "Less than was asked for at mount" in verdict.text_content()


def test_limits_are_those_of_the_study(study, pages):
    shown = rows(pages["stability"], "Largest stable step")
    stated = [
        [limits["name"], integrator, "no limit" if step is None else f"{step:.4g}"]
        for limits in study[1]["budgets"]
        for integrator, step in limits["largest_step"].items()
        if integrator != HOST
    ]
    assert [row[:3] for row in shown] == stated


def test_damping_shown_is_the_budgets(study, pages):
    shown = rows(pages["stability"], "Damping that the step adds")
    modes = study[1]["budgets"][0]["modes"]
    for row, mode in zip(shown, modes, strict=False):
        assert float(row[0]) == pytest.approx(mode["frequency"], rel=1e-5)
        ratio = mode["shown"]["discrete"]["damping"]
        assert float(row[list(mode["shown"]).index("discrete") + 2]) == pytest.approx(
            ratio, rel=1e-3
        )


def test_the_picture_of_a_craft_is_the_hubs_accelerance(observer):
    assert html.fromstring(observer.picture().encode()).xpath("//svg")


def test_stability_of_a_foreign_model(tmp_path):
    path = bc.embed(CRAFTS / "planar.xml", {"mount": spec("rod")}).write(tmp_path / "craft.xml")[-1]
    answer = call("inspect", path, "--steps", "-o", tmp_path / "out")
    assert answer.status == 0, answer.err
    assert "beamchain retime" not in answer.out  # its springs are on its hinges
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Large motion" not in page
    assert "beamchain inspect craft.xml --steps -o craft-stability" in page


def test_names_of_the_user_keep_their_letters():
    """A site `py` is no word to begin a sentence with."""
    text = """<mujoco><worldbody><body name="hub"><joint name="turn" axis="0 0 1"/>
    <geom size=".5" mass="50"/>
    <body name="rotor"><joint name="drive" axis="1 0 0"/><geom size=".1" mass="2"/><site name="py"/>
    </body></body>
    </worldbody></mujoco>"""
    done = bc.embed(text, {"py": spec("rod")})
    assert any(warning.startswith("py: ") for warning in done.warnings)
    page = done.report()
    assert "py: stands behind the hinge joint drive" in page
    assert "Py:" not in page
    assert "Gravity is 0 0 -9.81" in page


def test_dollars_in_a_name_are_no_formula(tmp_path):
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body name="hub"><freejoint/>
    <geom size=".5" mass="50"/>
    <body><joint name="drive" axis="1 0 0" stiffness="3"/><geom size=".1" mass="2" pos="0 .4 0"/>
    </body></body></worldbody>
    <actuator><motor name="push$1$" joint="drive"/></actuator></mujoco>"""
    (tmp_path / "craft.xml").write_text(text)
    words = ["plant", tmp_path / "craft.xml", "--from", "push$1$", "--to", "attitude"]
    answer = call(*words, "-o", tmp_path / "plant.npz")
    assert answer.status == 0, answer.err
    assert "attitude_x per push$1$" in (tmp_path / "plant_report.html").read_text()


def test_equal_appendages_are_shown_once():
    bus = (EXAMPLES / "satellite.xml").read_text()
    bus = bus.replace("<freejoint/>", '<joint name="turn" axis="0 0 1"/>')  # no turn is drawn
    craft = bc.embed(bus, {"left": spec("rod"), "right": spec("rod")})
    root = html.fromstring(craft.report("satellite.xml", "out.xml"))
    titles = [title.text_content() for title in root.iter("h2")]
    assert titles.count("rod at left and right") == 1
    assert not any(title in ("rod at left", "rod at right") for title in titles)
    assert len(root.xpath("//svg[contains(@aria-label, 'The chain drawn to scale')]")) == 1
    (section,) = root.xpath("//section[.//h2[text()='To reproduce']]")
    assert [title.text_content() for title in section.iter("h3")] == ["rod.toml"]
    (band,) = root.xpath(
        "//section[.//h2[text()='rod at left and right']]//table[caption='In-band error']"
    )
    assert {row[0].text_content() for row in band.iter("tr")} == {"at", "left", "right"}


def test_plot_draws_one_motion_into_the_axes_given(observer):
    from matplotlib.figure import Figure

    ax = Figure().add_subplot()
    assert observer.plot(ax, motion="x") is ax
    place = observer.assembly.motions.index(3)
    np.testing.assert_array_equal(
        ax.lines[0].get_ydata(), np.abs(observer.assembly.achieved[place, place])
    )
    with pytest.raises(bc.InputError, match="motion = 'roll' is unknown; choose one of"):
        observer.plot(motion="roll")
