"""The drawings that move on the pages of `fit` and `embed`: they show the modes and the turn that
MuJoCo makes of the files, and stand still in print."""

import re
from functools import cache
from importlib.resources import files

import mujoco
import numpy as np
import pytest
from lxml import etree, html
from scipy.linalg import eigh

import beamchain as bc
from hub_and_beam import HubAndBeam
from mechanics import by_differences, quiet
from modes_of_beam import modes_text
from spacecraft import CRAFTS, spec

pytestmark = pytest.mark.slow  # each makes a page and its drawings

SHIPPED = files("beamchain") / "examples"
SHOWN = 1e-4  # relative: frequencies are shown with five digits
DIGITS = 0.006  # relative: the sizes below a drawing have three digits
# of the largest displacement: the triad's axes have three digits; a chain's tip is the beam's
# to 1.4 % in the first mode (its root is exact, not its tip)
DRAWN = 0.03
KEPT = 0.01  # relative: a tip in five modes of a beam, and in all
RINGING = 4.0  # degrees about the angle of the turn
LARGEST = 1_000_000  # bytes of a page
SVG = "{http://www.w3.org/2000/svg}"
SIZE = re.compile(r"drawn: up to ([\d.e+-]+) m, (.+) turns ([\d.e+-]+)°; time × ([\d.e+-]+)")

# one rod in a plane: EI = 2000 N m^2, 4 kg/m, 8 m, on a hub of 300 kg and 90 kg m^2
ROD = bc.Beam(
    segments=(
        bc.Segment(length=8.0, section=bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)),
    )
)
ROD_TRUTH = HubAndBeam(8.0, 2e3, 4.0, 300.0, 90.0, 0.5)
HUB = bc.Hub(mass=300.0, inertia=(90.0, 90.0, 90.0), offset=(0.5, 0.0, 0.0))


@pytest.fixture(scope="module")
def satellite():
    array = SHIPPED / "array.toml"
    return bc.embed(SHIPPED / "satellite.xml", {"left": array, "right": array})


@cache
def named():
    """Names with characters of HTML, a base without solids, a keyframe."""
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body name="&lt;b&gt;&amp;&quot;hub">
    <freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
    <site name="&lt;i&gt;" pos=".5 0 0"/><body><joint name="drive" axis="0 0 1"/>
    <geom size=".1" mass="2" pos="0 1 0"/></body></body></worldbody>
    <keyframe><key name="&lt;u&gt;" qpos="0 0 0 1 0 0 0 1.5"/></keyframe></mujoco>"""
    return bc.embed(text, {"<i>": spec("rod")})


@cache
def arm():
    at = {"shoulder": SHIPPED / "upper.toml", "forearm": SHIPPED / "fore.toml"}
    return bc.embed(SHIPPED / "arm.xml", at, retime=False)


@pytest.fixture(scope="module")
def pages(satellite):
    """The page of a craft by its name, made once."""
    made = {"satellite": lambda: satellite, "named": named, "arm": arm}
    return cache(lambda name: made[name]().report())


@cache
def rod_page(visuals):
    """The page of a fit of five modes, whose appendage the scene shows or not."""
    scene = bc.Scene(visuals=visuals)
    fit = bc.fit(ROD, name="rod", modes={"xy": 5}, root=bc.spec.Root(hub=HUB), scene=scene)
    return bc.report.fit_report(fit)[0]


def drawings(page):
    """Captions, and the drawings as XML, which is stricter than HTML."""
    found = html.fromstring(page).xpath("//figure[.//svg[@class='replay']]")
    captions = [figure.find("figcaption").text_content().strip() for figure in found]
    texts = re.findall(r'<svg class="replay".*?</svg>', page, re.S)
    assert len(texts) == len(captions)
    return captions, [
        etree.fromstring(text.replace("<svg", f'<svg xmlns="{SVG[1:-1]}"', 1)) for text in texts
    ]


def panels(svg):
    return [g for g in svg.findall(f"{SVG}g") if g.get("role") == "group"]


def texts(panel):
    return ["".join(text.itertext()) for text in panel.findall(f"{SVG}text")]


def points(path):
    """`(k, 2)` of a path of relative lines, in units of the drawing."""
    start, _, steps = path.rstrip("z").removeprefix("M").partition("l")
    numbers = [float(word) for word in re.findall(r"-?\d+", f"{start} {steps}")]
    return np.cumsum(np.array(numbers).reshape(-1, 2), axis=0) / 10.0


def paths(panel, layer, kind):
    group = next(g for g in panel.iter(f"{SVG}g") if g.get("class") == layer)
    return [path for path in group.findall(f"{SVG}path") if path.get("class") == kind]


def frames(path):
    """`(f, k, 2)` of a moving path."""
    values = path.find(f"{SVG}animate").get("values").split(";")
    return np.array([points(value) for value in values])


def modes_of(model, qpos):
    """Frequencies [rad/s] and shapes of a model, by forces and MuJoCo's mass matrix."""
    mass, _, stiffness = by_differences(quiet(model), qpos)
    squares, shapes = eigh((stiffness + stiffness.T) / 2.0, mass)
    moving = squares > 1e-9 * squares.max()
    return np.sqrt(squares[moving]), shapes[:, moving]


def motion(model, qpos, body, place, shape):
    """`(3,)` displacement in a mode of a point of a body, given in its axes, and the point."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ place
    moves = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, moves, None, point, body)
    return moves @ shape, point


# -- modes -----------------------------------------------------------------------------------------
@pytest.mark.parametrize("number", [1, 2])
def test_two_arrays_and_their_bus_move_as_in_mujocos_own_mode(number, satellite, pages):
    model = satellite.untimed
    frequency, shapes = modes_of(model, model.qpos0)
    shape = shapes[:, number - 1]
    captions, (modes, _) = drawings(pages("satellite"))
    assert captions[0].startswith("The coupled modes at rest")
    panel = panels(modes)[number - 1]
    title = texts(panel)[0]
    assert title.startswith(f"mode {number}: ")
    assert float(title.split()[2]) == pytest.approx(frequency[number - 1], rel=SHOWN)

    # what is drawn of tips and of the bus: places at rest and displacements
    ribbons = [frames(path) for path in paths(panel, "moving", "ribbon")]
    ghosts = [
        points(path.get("d"))
        for path in panel.find(f"{SVG}g").findall(f"{SVG}path")
        if path.get("class") == "rest"
    ]
    ends = [
        min(
            (f[:, i : i + 2].mean(axis=1) for f in ribbons for i in range(f.shape[1] - 1)),
            key=lambda pair: float(np.linalg.norm((pair[0] + pair[1]) / 2.0 - ghost[-1])),
        )
        for ghost in ghosts
    ]
    corners = np.concatenate([frames(p) for p in paths(panel, "moving", "solid")], axis=1)
    drawn = np.array([*(end[0] - end[1] for end in ends), *(corners[0] - corners[1]).tolist()])
    at = np.array([ghost[-1] for ghost in ghosts])

    # the same from MuJoCo, on the drawing by the triad's axes
    (triad,) = [g for g in panels(modes)[0].findall(f"{SVG}g") if g.get("class") == "triad"]
    axes = [p.get("d").partition("L")[2].split() for p in triad.findall(f"{SVG}path")]
    project = np.array(axes, dtype=float).T
    names = ["".join(t.itertext()) for t in triad.findall(f"{SVG}text")]
    assert names == ["x", "y", "z"]
    wanted, places = [], []
    for a in satellite.appendages:
        links = a.fit.chain.links
        body = model.body(f"{a.prefix}link{len(links)}").id
        end = np.array([a.fit.chain.length - links[-1].start, 0.0, 0.0])
        moved, place = motion(model, model.qpos0, body, end, shape)
        wanted.append(project @ moved)
        places.append(project @ place)
    scale = np.linalg.norm(at[0] - at[1]) / np.linalg.norm(places[0] - places[1])
    bus = model.body("bus").id
    offset = (at - scale * np.array(places)).mean(axis=0)
    middle = (corners[0] + corners[1]) / 2.0
    box = [
        motion(model, model.qpos0, bus, np.array([x, y, z]), shape)
        for x in (-0.6, 0.6)
        for y in (-0.5, 0.5)
        for z in (-0.5, 0.5)
    ]
    flat = np.array([offset + scale * (project @ place) for _, place in box])
    for corner in middle:
        away = np.linalg.norm(flat - corner, axis=1)
        assert away.min() < 2.0
        wanted.append(project @ box[int(np.argmin(away))][0])
    wanted = np.array(wanted)
    factor = np.sum(wanted * drawn) / np.sum(wanted**2)
    largest = np.abs(drawn).max()
    assert largest > 15.0  # it is seen
    np.testing.assert_allclose(drawn, factor * wanted, atol=DRAWN * largest)


def test_the_base_answers_as_a_hub_of_finite_elements_does():
    """The line is that of the modes kept: with more of them it comes to the beam's."""
    frequencies, shapes = ROD_TRUTH.modes(ROD_TRUTH.whole)
    _, (modes, _) = drawings(rod_page(visuals=True))
    for k, panel in enumerate(panels(modes)[:2]):
        title, *words = texts(panel)
        assert float(title.split()[2]) == pytest.approx(frequencies[2 + k], rel=SHOWN)
        size, name, turned, _ = SIZE.search(" ".join(words)).groups()
        assert name == "hub"
        shape = shapes[:, 2 + k]
        wanted = np.degrees(abs(shape[1])) / np.abs(shape[0::2]).max()
        assert float(turned) / float(size) == pytest.approx(wanted, rel=KEPT)


@pytest.mark.parametrize(
    ("craft", "name", "keys"),
    [
        (named, "named", ["<u>"]),
        (arm, "arm", ["bent", "square"]),
    ],
)
def test_keyframes_have_their_own_modes(craft, name, keys, pages):
    captions, svgs = drawings(pages(name))
    assert [caption.partition(",")[0] for caption in captions[: 1 + len(keys)]] == [
        "The coupled modes at rest",
        *(f"The coupled modes at keyframe {key}" for key in keys),
    ]
    assert ("6 of 20" in captions[0]) == (name == "arm")
    model = craft().untimed
    for key, svg in zip(keys, svgs[1:], strict=False):
        frequency, _ = modes_of(model, np.array(model.key(key).qpos))
        shown = [float(texts(panel)[0].split()[2]) for panel in panels(svg)]
        np.testing.assert_allclose(shown, frequency[: len(shown)], rtol=SHOWN)


def test_rates_are_those_that_the_drawing_states(pages):
    _, (modes, _) = drawings(pages("satellite"))
    for panel in panels(modes):
        title, *words = texts(panel)
        *_, rate = SIZE.search(" ".join(words)).groups()
        (seconds,) = {
            float(animate.get("dur").rstrip("s")) for animate in panel.iter(f"{SVG}animate")
        }
        period = 2.0 * np.pi / float(title.split()[2])
        assert seconds == pytest.approx(period / float(rate), rel=2.0 * DIGITS)


# -- the turn --------------------------------------------------------------------------------------
def test_the_turn_ends_at_its_angle_and_bends_as_far_as_it_says(satellite, pages):
    captions, (_, turn) = drawings(pages("satellite"))
    assert captions[1].startswith("A turn simulated in MuJoCo")
    (panel,) = panels(turn)
    title, played = texts(panel)
    assert title.startswith("bus turned by 40° about z in ")
    assert re.fullmatch(r"elastic motion × [\d.]+; time × [\d.]+", played)
    straight = frames(paths(panel, "moving", "rest")[0])
    ways = straight[:, 1] - straight[:, 0]
    angles = np.degrees(np.unwrap(np.arctan2(-ways[:, 1], ways[:, 0])))
    assert abs(angles[-1] - angles[0]) == pytest.approx(40.0, abs=RINGING)
    # every path of a moving layer has the same frames, or browsers jump between them
    layer = [frames(path).shape[0] for path in panel.iter(f"{SVG}path") if len(path)]
    assert len(set(layer)) == 1
    # the still is where the appendages bend most: the tip is off by what the curve says
    labels = ["".join(text.itertext()) for text in turn.iter(f"{SVG}text")]
    most = next(float(label[:-2]) for label in labels if re.fullmatch(r"[\d.]+ m", label))
    rest = points(paths(panel, "still", "rest")[0].get("d"))
    scale = np.linalg.norm(rest[1] - rest[0]) / satellite.appendages[0].fit.chain.length
    tips = [points(path.get("d")) for path in paths(panel, "still", "ribbon")]
    ends = [(p[i] + p[i + 1]) / 2.0 for p in tips for i in range(len(p) - 1)]
    off = min(float(np.linalg.norm(end - rest[1])) for end in ends) / scale
    factor = float(re.search(r"× ([\d.]+);", played)[1])
    assert off == pytest.approx(factor * most, rel=0.06)


def test_a_turn_of_too_many_steps_is_not_drawn_and_the_page_says_so():
    text = (SHIPPED / "satellite.xml").read_text().replace('"0.125"', '"1e-5"')
    page = bc.embed(text, {"left": spec("rod")}).report()
    captions, _ = drawings(page)
    assert len(captions) == 1
    assert "No turn is drawn: the turn takes" in page


def test_a_base_that_does_not_fly_is_not_turned():
    page = bc.embed(CRAFTS / "planar.xml", {"mount": spec("rod")}).report()
    captions, (modes,) = drawings(page)
    assert captions[0].startswith("The coupled modes at rest")
    assert "No turn" not in page
    assert len(panels(modes)) >= 2


# -- the page --------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["satellite", "arm"])
def test_every_drawing_has_a_still_and_says_what_it_is(name, pages):
    page = pages(name)
    assert len(page.encode()) < LARGEST
    captions, svgs = drawings(page)
    assert all(captions)
    for svg in svgs:
        assert svg.get("role") == "img"
        assert svg.find(f"{SVG}title").text
        width, height = map(float, svg.get("viewBox").split()[2:])
        for panel in panels(svg):
            assert panel.find(f"{SVG}title").text
            assert "time ×" in panel.find(f"{SVG}desc").text
            still = [
                p.get("d") for kind in ("solid", "ribbon") for p in paths(panel, "still", kind)
            ]
            moving = paths(panel, "moving", "solid") + paths(panel, "moving", "ribbon")
            assert len(moving) > 1
            if svg is not svgs[-1]:  # of a mode: the frame of largest displacement
                assert still == [path.get("d") for path in moving]
            shift = np.array(re.findall(r"-?[\d.]+", panel.get("transform")), dtype=float)
            every = np.vstack([frames(path).reshape(-1, 2) for path in moving]) + shift
            assert every.min() >= 0.0
            assert np.all(every <= [width, height])
    css = re.search(r"<style>(.*?)</style>", page, re.S)[1]
    assert "prefers-reduced-motion" in css
    printed = css[css.index("@media print") :]
    assert ".replay .moving { display: none !important; }" in printed
    assert ".replay .still { display: inline; }" in printed


def test_names_with_characters_of_html_and_a_base_without_solids(pages):
    page = pages("named")
    captions, svgs = drawings(page)
    assert captions[1].startswith("The coupled modes at keyframe <u>")
    assert any('<b>&"hub turns' in text for panel in panels(svgs[0]) for text in texts(panel))
    root = html.fromstring(page)
    assert not root.xpath("//b | //i | //u")
    assert len(paths(panels(svgs[0])[0], "moving", "solid")) >= 3  # the box of its inertia


def test_without_visuals_the_appendages_are_drawn_all_the_same():
    drawn = [rod_page(visuals=visuals) for visuals in (True, False)]
    one, other = (re.findall(r'<svg class="replay".*?</svg>', page, re.S) for page in drawn)
    assert len(one) == 2
    assert one == other


def test_imported_modes_are_drawn_by_their_links(tmp_path):
    (tmp_path / "modes.toml").write_text(modes_text(ROD, {"xy": 3}))
    (tmp_path / "rod.toml").write_text('name = "rod"\n[imported]\nfile = "modes.toml"\n')
    page = bc.embed(CRAFTS / "planar.xml", {"mount": tmp_path / "rod.toml"}).report()
    captions, (modes, *_) = drawings(page)
    assert "drawn by the links of its chain" in captions[0]
    ribbon = frames(paths(panels(modes)[0], "moving", "ribbon")[0])
    assert np.abs(ribbon[0] - ribbon[1]).max() > 15.0


def test_a_rigid_appendage_has_no_drawing():
    rod = bc.Spec(
        name="rod",
        segment=ROD.segments,
        scene=bc.Scene(bandwidth=1e-3, axes=("z",), tolerance=0.01),
        root=bc.spec.Root(hub=HUB),
    )
    fit = bc.fit(rod)
    assert not fit.chain.hinges
    assert "replay" not in bc.report.fit_report(fit)[0].partition("<body>")[2]


def test_under_a_load_the_drawings_have_the_modes_of_the_table():
    text = (SHIPPED / "satellite.xml").read_text().replace('gravity="0 0 0"', 'gravity="0 0 -9.81"')
    text = text.replace("<freejoint/>", '<joint name="turn" axis="0 0 1"/>')
    craft = bc.embed(text, {"left": SHIPPED / "array.toml"}, loaded=True)
    _, (modes,) = drawings(craft.report())
    shown = [float(texts(panel)[0].split()[2]) for panel in panels(modes)]
    table = [mode.mujoco for mode in craft.assembly.modes if mode.mujoco is not None]
    np.testing.assert_allclose(shown, table[: len(shown)], rtol=SHOWN)
