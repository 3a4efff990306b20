"""The films on the pages of `fit` and `embed`: they show the modes and the turn that MuJoCo makes
of the files, drawn as MuJoCo sees them."""

import base64
import io
import re
from functools import cache
from importlib.resources import files

import mujoco
import numpy as np
import pytest
from lxml import html
from PIL import Image
from scipy.linalg import eigh

import beamchain as bc
from beamchain.report import replay
from beamchain.steps.deployment import commands
from command import call
from mechanics import by_differences, quiet
from spacecraft import CRAFTS, spec

SHIPPED = files("beamchain") / "examples"
SHOWN = 1e-4  # relative: frequencies are shown with five digits
LARGEST = 250_000  # bytes of a page

HUB = bc.Hub(mass=300.0, inertia=(90.0, 90.0, 90.0), offset=(0.5, 0.0, 0.0))
ROD = (bc.Segment(length=8.0, section=bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)),)


@cache
def satellite():
    array = SHIPPED / "array.toml"
    return bc.embed(SHIPPED / "satellite.xml", {"left": array, "right": array})


@cache
def replays():
    return replay.craft_replays(satellite())


@cache
def rod(visuals):
    spec = bc.Spec(
        name="rod", segment=ROD, root=bc.spec.Root(hub=HUB), scene=bc.Scene(visuals=visuals)
    )
    return bc.fit(spec)


@pytest.mark.slow
def test_a_spacecraft_without_a_name_is_filmed():
    """Its base body, as MuJoCo allows it."""
    text = (
        '<mujoco><option gravity="0 0 0"/><worldbody><body><freejoint/>'
        '<inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/><site name="m"/>'
        "</body></worldbody></mujoco>"
    )
    films, note = replay.craft_replays(bc.embed(text, {"m": bc.Spec(name="rod", segment=ROD)}))
    assert not note
    assert films[-1].title.startswith("body 1 turned by ")


def frames(address):
    """The pictures of an address as arrays `(k, height, width, 3)`."""
    kind, _, data = address.partition(",")
    assert kind == "data:image/webp;base64"
    film = Image.open(io.BytesIO(base64.b64decode(data)))
    shown = []
    for k in range(film.n_frames):
        film.seek(k)
        shown.append(np.asarray(film.convert("RGB")).astype(int))
    return np.array(shown)


def modes_of(model):
    """Frequencies [rad/s] of a model at rest, by forces and MuJoCo's mass matrix."""
    mass, _, stiffness = by_differences(quiet(model), model.qpos0)
    squares = eigh((stiffness + stiffness.T) / 2.0, mass, eigvals_only=True)
    return np.sqrt(squares[squares > 1e-9 * squares.max()])


def drawn(text):
    """An artist of a model, and of a body of it."""
    return replay._Artist(mujoco.MjModel.from_xml_string(text))


def body(*geoms, more=""):
    geoms = "".join(f"<geom {geom}/>" for geom in geoms)
    return (
        f'<mujoco>{more}<worldbody><geom type="plane" size="9 9 1"/><body pos="1 2 3" '
        f'euler="20 30 40"><freejoint/>{geoms}</body></worldbody></mujoco>'
    )


# -- what MuJoCo sees ------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("geom", "volume"),
    [
        ('type="box" size=".3 .4 .5"', 8.0 * 0.3 * 0.4 * 0.5),
        ('type="cylinder" size=".3 .5"', np.pi * 0.09 * 1.0),
        ('type="capsule" size=".3 .5"', np.pi * (0.09 + 4.0 / 3.0 * 0.027)),
        ('type="sphere" size=".5"', 4.0 / 3.0 * np.pi * 0.125),
        ('type="ellipsoid" size=".3 .4 .5"', 4.0 / 3.0 * np.pi * 0.06),
        ('type="mesh" mesh="wedge"', 1.0 / 6.0),
    ],
)
def test_every_solid_is_closed_and_its_faces_look_outwards(geom, volume):
    """By Gauss's theorem: the volume within the faces, of circles of twelve corners."""
    more = '<asset><mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>'
    artist = drawn(body(geom, more=more))
    points = artist.points(np.array(artist.model.qpos0))
    corners = points[artist._faces]
    # right, up and forward are left-handed
    a, b, c, d = corners.transpose(1, 0, 2)
    found = (
        -sum(np.einsum("ni,ni->", x, np.cross(y, z)) for x, y, z in ((a, b, c), (a, c, d))) / 6.0
    )
    assert 0.85 * volume < found < 1.001 * volume


def test_planes_and_what_is_hidden_are_not_drawn():
    artist = drawn(body('size=".1"', 'size=".2" group="4"', 'size=".3" rgba="1 1 1 0"'))
    points = artist.points(np.array(artist.model.qpos0))
    assert np.ptp(points, axis=0).max() == pytest.approx(0.2, rel=0.05)


def test_a_skin_is_drawn_where_mujoco_puts_it():
    fit = bc.fit(SHIPPED / "boom.toml")
    model = mujoco.MjModel.from_xml_string(fit.scene_mjcf())
    assert model.nskin == 1
    artist = replay._Artist(model)
    qpos = np.array(model.qpos0)
    qpos[7:] = 0.1
    tip = (
        artist.points(qpos)[-model.nskinvert :]
        - artist.points(np.array(model.qpos0))[-model.nskinvert :]
    )
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    end = data.body(model.nbody - 1)
    length = fit.chain.length - fit.chain.links[-1].start
    moved = end.xpos + length * end.xmat.reshape(3, 3)[:, 0]
    data.qpos[:] = model.qpos0
    mujoco.mj_kinematics(model, data)
    at_rest = end.xpos + length * end.xmat.reshape(3, 3)[:, 0]
    largest = np.linalg.norm(tip, axis=1).max()
    assert largest == pytest.approx(np.linalg.norm(moved - at_rest), rel=0.1)


def test_a_texture_and_transparency_give_the_colour_that_is_seen():
    more = """<asset><texture name="t" type="2d" builtin="flat" rgb1="1 0 0" width="4" height="4"/>
        <material name="m" texture="t" rgba="1 1 1 .5"/></asset>"""
    artist = drawn(body('size=".1" material="m"', 'size=".2" rgba="0 0 1 1"', more=more))
    assert {tuple(row) for row in artist._colours.round(6)} == {(1.0, 0.5, 0.5), (0.0, 0.0, 1.0)}


def test_what_is_nearer_hides_what_is_behind_it():
    artist = drawn(
        '<mujoco><worldbody><body><freejoint/><geom type="box" size=".5 .5 .5" rgba="1 0 0 1"/>'
        '</body><body pos="0 0 0"><freejoint/><geom type="box" size=".2 .2 .2" rgba="0 0 1 1"/>'
        "</body></worldbody></mujoco>"
    )
    towards = -artist._frame[:, 2]
    at_rest = np.array(artist.model.qpos0)
    seen = []
    for place in (3.0 * towards, -3.0 * towards):
        qpos = at_rest.copy()
        qpos[7:10] = place
        (picture,) = artist.pictures([qpos], [qpos])
        colours = np.asarray(picture).reshape(-1, 3)
        seen.append(bool(np.any((colours[:, 2] > 120) & (colours[:, 0] < 50))))
    assert seen == [True, False]


def test_without_visuals_inertia_is_drawn():
    artists = [
        replay._Artist(mujoco.MjModel.from_xml_string(rod(visuals).scene_mjcf()))
        for visuals in (True, False)
    ]
    spans = [np.ptp(a.points(np.array(a.model.qpos0)), axis=0).max() for a in artists]
    assert spans[1] == pytest.approx(spans[0], rel=0.3)


# -- modes -----------------------------------------------------------------------------------------
@pytest.mark.slow
def test_films_show_the_first_modes_of_the_table_from_where_they_bend_most():
    films = replays().films
    frequencies = modes_of(satellite().untimed)
    for k, film in enumerate(films[:-1]):
        number, omega, hz = re.fullmatch(
            r"mode (\d+): ([\d.]+) rad/s, ([\d.]+) Hz", film.title
        ).groups()
        assert int(number) == k + 1
        assert float(omega) == pytest.approx(frequencies[k], rel=SHOWN)
        assert float(hz) == pytest.approx(frequencies[k] / 2.0 / np.pi, rel=5.0 * SHOWN)
        assert "bending xy" in film.told
        assert "not to scale" in film.told
        shown = frames(film.film)
        assert len(shown) == replay.CYCLE
        np.testing.assert_array_equal(shown[0], frames(film.still)[0])
        away = [np.abs(each - shown[0]).sum() for each in shown]
        assert int(np.argmax(away)) == replay.CYCLE // 2  # the other end of the oscillation
        np.testing.assert_array_equal(shown[1:], shown[:0:-1])  # and back
    assert len(films) == replay.MODES + 1


@pytest.mark.slow
def test_under_a_load_the_films_have_the_modes_of_the_table():
    text = (SHIPPED / "satellite.xml").read_text().replace('gravity="0 0 0"', 'gravity="0 0 -9.81"')
    text = text.replace("<freejoint/>", '<joint name="turn" axis="0 0 1"/>')
    craft = bc.embed(text, {"left": SHIPPED / "array.toml"}, loaded=True)
    films, note = replay.craft_replays(craft)
    assert not note
    assert not any("turned" in film.title for film in films)  # it does not fly
    shown = [float(film.title.split()[2]) for film in films]
    table = [mode.mujoco for mode in craft.assembly.modes if mode.mujoco is not None]
    np.testing.assert_allclose(shown, table[: len(shown)], rtol=SHOWN)


# -- the turn --------------------------------------------------------------------------------------
@pytest.mark.slow
def test_the_turn_has_no_more_torque_than_the_wheels():
    film = replays().films[-1]
    body, degrees, axis, seconds = re.fullmatch(
        r"(\w+) turned by ([\d.]+)° about (\w) in ([\d.]+) s", film.title
    ).groups()
    assert (body, axis) == ("bus", "z")
    assert "by 0.5 N m, all that its actuators have" in film.told
    mass = satellite().composite
    inertia = mass.inertia[2][2]
    angle, duration = np.radians(float(degrees)), float(seconds)
    assert 4.0 * angle * inertia / duration**2 == pytest.approx(0.5, rel=0.05)


@pytest.mark.slow
def test_a_turn_of_too_many_steps_is_not_drawn_and_the_page_says_so():
    text = (SHIPPED / "satellite.xml").read_text().replace('"0.125"', '"1e-5"')
    craft = bc.embed(text, {"left": spec("rod")})
    films, note = replay.craft_replays(craft)
    assert films
    assert note.startswith("No turn is drawn: the turn takes")
    assert note in craft.report()


# -- a run -----------------------------------------------------------------------------------------
COMMANDED = """<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody><body name="bus">
<freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
<geom type="box" size=".5 .5 .5" mass="0"/><site name="mount" pos=".5 0 0"/></body></worldbody>
<actuator><motor name="z" site="mount" gear="0 0 0 0 0 1" ctrlrange="-5 5"/></actuator></mujoco>"""
HISTORY = "time,z\n0,5\n2,-5\n4,0\n8,0\n"


def films_of(page):
    """Addresses and captions of the films of a page."""
    figures = html.fromstring(page).xpath("//div[@class='films']/figure")
    return {
        figure.find("figcaption").text_content(): figure.find(".//img").get("src")
        for figure in figures
    }


@pytest.mark.slow
def test_the_page_films_the_users_own_commands(tmp_path):
    """Its frames are drawn of the positions that the written file has when it is stepped in plain
    MuJoCo."""
    (tmp_path / "craft.xml").write_text(COMMANDED)
    (tmp_path / "h.csv").write_text(HISTORY)
    words = ["embed", tmp_path / "craft.xml", "--mount", f"mount={spec('rod')}"]
    words += ["-o", tmp_path / "out.xml", "--torque"]
    answer = call(*words, tmp_path / "h.csv")
    assert answer.status in {0, 3}, answer.err
    films = films_of((tmp_path / "out_report.html").read_text())
    (told,) = (caption for caption in films if "simulated" in caption)
    assert told.startswith("8 s under commands of z")
    assert not any(" turned by " in caption for caption in films)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    data = mujoco.MjData(model)
    positions = [data.qpos.copy()]
    for step in range(800):
        data.ctrl[0] = 5.0 if step < 200 else -5.0 if step < 400 else 0.0
        mujoco.mj_step(model, data)
        positions.append(data.qpos.copy())
    film = frames(films[told])
    assert replay.TURN < len(film) <= replay.RUN
    shown = np.array(positions[:: 800 // (len(film) - 1)])
    rigid = shown.copy()
    rigid[:, 7:] = 0.0
    artist = replay._Artist(model)
    away = [np.abs(artist.points(a) - artist.points(b)) for a, b in zip(shown, rigid, strict=True)]
    off = [np.linalg.norm(each, axis=1).max() for each in away]
    stated = float(re.search(r"drawn faintly, by (\S+) m at most", told)[1])
    assert max(off) == pytest.approx(stated, rel=0.05)
    factor = re.search(r"drawn (\S+) times as large", told)
    larger = rigid + (1.0 if factor is None else float(factor[1])) * (shown - rigid)
    wanted = np.array([np.asarray(picture) for picture in artist.pictures(larger, rigid)])
    found = np.roll(film, int(np.argmax(off)), axis=0)
    assert found.shape == wanted.shape
    changes = np.abs(np.diff(wanted.astype(int), axis=0)).mean(axis=(1, 2, 3)).max()
    assert np.abs(found - wanted).mean(axis=(1, 2, 3)).max() < 0.5 * changes


@pytest.mark.slow
def test_a_run_in_which_nothing_moves_is_drawn_to_scale():
    craft = bc.embed(COMMANDED, {"mount": spec("rod")})
    given = commands(craft.model, "time,z\n0,0\n0.005,0\n", "h")  # less than a step
    told = replay.craft_replays(craft, given).films[-1].told
    assert "by 0 m at most, to scale" in told


@pytest.mark.parametrize(
    ("history", "more", "said"),
    [
        ("time,y\n0,1\n1,0\n", [], "give a column time, one or more of z, and at least two rows"),
        ("time,z\n0,9\n1,0\n", [], "z = 9 is beyond its ctrlrange [-5, 5]"),
        ("time,z\n0,1\n1e-6,0\n", [], "--torque ends at 1e-06 s; give times from 0.001"),
        (HISTORY, ["--no-report"], "the page of a new file; leave --no-report out"),
        ("time,z\n0,5\n1e5,0\n", [], "a fast spin needs RK4 or less torque"),
    ],
)
def test_commands_that_cannot_be_filmed_are_refused_and_nothing_is_written(
    history, more, said, tmp_path
):
    (tmp_path / "craft.xml").write_text(COMMANDED)
    (tmp_path / "h.csv").write_text(history)
    words = ["embed", tmp_path / "craft.xml", "--mount", f"mount={spec('rod')}", *more]
    answer = call(*words, "-o", tmp_path / "out.xml", "--torque", tmp_path / "h.csv")
    assert answer.status == 2
    assert answer.err.count("\n") == 1
    assert said in answer.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["craft.xml", "h.csv"]


# -- the page --------------------------------------------------------------------------------------
@pytest.mark.slow
def test_the_page_shows_every_film_and_a_still_for_print_and_for_less_motion():
    page = satellite().report()
    assert len(page.encode()) < LARGEST
    figures = html.fromstring(page).xpath("//div[@class='films']/figure")
    assert len(figures) == len(replays().films)
    for figure, film in zip(figures, replays().films, strict=True):
        (image,) = figure.iter("img")
        (source,) = figure.iter("source")
        assert image.get("src") == film.film
        assert source.get("srcset") == film.still
        assert source.get("media") == "print, (prefers-reduced-motion: reduce)"
        assert image.get("alt").startswith(film.title)
        assert (int(image.get("height")), int(image.get("width"))) == frames(film.still).shape[1:3]
        caption = figure.find("figcaption").text_content()
        assert film.title in caption
        assert film.told in caption


@pytest.mark.slow
def test_names_with_characters_of_html_stay_text():
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body name="&lt;b&gt;&amp;&quot;hub">
    <freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
    <site name="&lt;i&gt;" pos=".5 0 0"/></body></worldbody></mujoco>"""
    page = bc.embed(text, {"<i>": spec("rod")}).report()
    assert '<b>&"hub turned by' in html.fromstring(page).text_content()
    assert not html.fromstring(page).xpath("//b | //i")


def test_a_rigid_appendage_has_no_film():
    rigid = bc.Spec(
        name="rod",
        segment=ROD,
        scene=bc.Scene(bandwidth=1e-3, axes=("z",), tolerance=0.01),
        root=bc.spec.Root(hub=HUB),
    )
    fit = bc.fit(rigid)
    assert not fit.chain.hinges
    assert replay.scene_replays(fit) == replay.Replays(())


@pytest.mark.slow
def test_a_liquid_has_a_sentence_in_place_of_films():
    films, note = replay.scene_replays(bc.fit(SHIPPED / "tank.toml"))
    assert not films
    assert note.startswith("No mode is drawn")


@pytest.mark.slow
def test_a_base_that_does_not_fly_is_not_turned():
    films, note = replay.craft_replays(bc.embed(CRAFTS / "planar.xml", {"mount": spec("rod")}))
    assert not note
    assert [film.title.partition(" ")[0] for film in films] == ["mode"] * len(films)
