"""Replays on the pages: films of a spacecraft's coupled modes and of a turn or a run, drawn from
the scene that MuJoCo itself makes of the model, without a screen."""

import base64
import copy
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.spatial.transform import Rotation

from beamchain.craft.mode_names import cantilever_names, strain_holders, strain_shares
from beamchain.craft.moving_modes import oscillation
from beamchain.engine.displacement import spacecraft_body
from beamchain.engine.draw import azimuth_of, thicken, view_frame
from beamchain.engine.geometry import CORNERS, drawn_points
from beamchain.engine.library import mujoco, quiet, rest
from beamchain.engine.linear import linear_at
from beamchain.engine.linearise import compile_model
from beamchain.engine.model_rows import sprung
from beamchain.engine.operating_point import quiet_copy, rest_point
from beamchain.engine.slew import Slew, simulate
from beamchain.errors import EngineError, InputError
from beamchain.ports.motions import Array
from beamchain.report.film import webp
from beamchain.report.headlines import strain_words
from beamchain.steps.deployment import Commands, Run, simulate_run
from beamchain.steps.driven import Driven, driven, limit_sentences, run_of_turn
from beamchain.steps.retime import without_timing

if TYPE_CHECKING:
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit

MODES = 4  # that are shown
WIDTH, HIGHEST, MARGIN = 376, 240, 8  # of a picture [pixels],
FINE = 2  # of which so many times as many are drawn
SLIMMEST = 1.0 / 140.0  # of the craft's size: thinner solids would vanish
CYCLE, TURN, RUN = 14, 27, 54  # frames of an oscillation, and of a turn or a run at most,
EACH, SLOWER = 90, 110  # and ms that each of them is shown
SWING = 0.08  # of the craft's size: elastic displacement up to which a turn is drawn
STILL = 1e-9  # of the same: less is rounding, and drawn as it is
FACTORS = (1.0, 2.0, 5.0)  # times powers of ten, by which that may be drawn larger than it is
FINER = 9  # times the frames of a run: positions at most, from which its rates are taken
MOST_WORK = 400_000  # steps times degrees of freedom of the simulation of a turn
SLOW = 0.1  # of an appendage's first frequency: a slower turn is within all limits of spin
ROUND = 12  # corners of a circle
MOST_FACES = 2000  # of a mesh, which is else drawn as the box around it
GHOST = (218, 224, 232)
LAMP = np.array([-0.4, 0.75, -0.55])  # towards it: right, up, forward


class Replay(NamedTuple):
    """A film and its first frame, as addresses of images that stand in the page themselves, its
    title and what is told below."""

    film: str
    still: str
    width: int
    height: int
    title: str
    told: str


class Replays(NamedTuple):
    """Films, and why there is none where one is expected."""

    films: Sequence[Replay]
    note: str = ""


class _Mode(NamedTuple):
    """Its number, frequency [rad/s], what holds its strain energy, and its shape `(nv,)`."""

    number: int
    omega: float
    words: str
    shape: Array


# -- what is shown ---------------------------------------------------------------------------------
def craft_replays(embedded: "Embedded", given: Commands | None = None) -> Replays:
    """Of the first kept modes in the table of an embedded craft, and of a turn or, where they
    are given, of a run under commands of its actuators."""
    modes = _named(embedded.untimed, *embedded.shapes_at("rest"))
    shown: list[_Mode] = []
    for number, row in enumerate(embedded.assembly.modes, 1):
        if row.kept and row.mujoco is not None and modes and len(shown) < MODES:
            omega = row.mujoco
            near = min(range(len(modes)), key=lambda k: abs(modes[k].omega - omega))
            shown.append(modes.pop(near)._replace(number=number))
    roots = {f"{a.prefix}link1": a.fit for a in embedded.appendages}
    return _replays(embedded.model, embedded.untimed, shown, roots, given)


def scene_replays(fit: "Fit") -> Replays:
    """Of the first modes of a fit's scene, the appendage on its hub, and of a turn of it."""
    if not fit.chain.hinges:
        return Replays(())
    if fit.chain.hung:
        return Replays((), "No mode is drawn: nothing accelerates the liquid in scene.xml at rest.")
    scene = compile_model(fit.scene_mjcf())
    model = without_timing(scene)
    modes = linear_at(rest_point(quiet_copy(model))).modes()
    shown = _named(model, modes.frequency[:MODES], modes.shapes[:, :MODES])
    return _replays(scene, model, shown, {f"{fit.spec.name}_link1": fit})


def _named(model: "mujoco.MjModel", frequencies: Array, shapes: Array) -> list[_Mode]:
    """Modes, with what holds their strain energy."""
    linear = linear_at(rest_point(quiet_copy(model)))
    names, rows = cantilever_names(model, linear.mass, linear.stiffness)
    columns = zip(frequencies.tolist(), strain_shares(rows, shapes).T, shapes.T, strict=True)
    return [
        _Mode(number, omega, strain_words(strain_holders(names, share)), shape)
        for number, (omega, share, shape) in enumerate(columns, 1)
    ]


def _replays(
    timed: "mujoco.MjModel",
    model: "mujoco.MjModel",
    modes: Sequence[_Mode],
    roots: "Mapping[str, Fit]",
    given: Commands | None = None,
) -> Replays:
    """Of modes of a model without timing, and of a turn of the same with its timing or its run
    under commands; `roots`: the appendages by the bodies that are their roots."""
    artist = _Artist(model)
    films = [_mode_replay(artist, mode) for mode in modes]
    try:
        with quiet():
            if given is not None:
                return Replays([*films, _run_replay(artist, timed, given, roots)])
            most = MOST_WORK // model.nv
            slew = simulate(quiet_copy(timed), angle=None, frames=TURN, most=most, untimed=model)
    except EngineError as error:
        if given is not None:
            raise
        return Replays(films, f"No turn is drawn: {str(error).partition(';')[0]}.")
    except InputError:  # it does not fly freely, or nothing bends
        return Replays(films)
    return Replays([*films, _turn_replay(artist, slew, roots)])


def _mode_replay(artist: "_Artist", mode: _Mode) -> Replay:
    """One oscillation from where the mode bends most, over the pose at rest."""
    still = np.array(artist.model.qpos0)
    swing = np.cos(2.0 * np.pi * np.arange(CYCLE // 2 + 1) / CYCLE)
    there, moves = oscillation(artist.model, still, mode.shape, swing)
    pictures = artist.pictures(there, [still])
    title = f"mode {mode.number}: {mode.omega:.5g} rad/s, {mode.omega / math.tau:.4g} Hz"
    told = f"{mode.words}; drawn with {moves:.2g} m at most, not to scale"
    return _replay([*pictures, *pictures[-2:0:-1]], EACH, title, told.removeprefix("; "))


def _turn_replay(artist: "_Artist", slew: Slew, roots: "Mapping[str, Fit]") -> Replay:
    """A turn."""
    title = (
        f"{slew.body} turned by {math.degrees(slew.angle):.3g}° about {'xyz'[slew.axis]} in "
        f"{slew.duration:.4g} s"
    )
    torque = f", by {slew.torque:.3g} N m, all that its actuators have" if slew.torque else ""
    how = f"simulated in MuJoCo{torque}; it rings at {slew.omega:.5g} rad/s"
    # it bends so little that only its spin can exceed a limit: what a chain leaves of a fine one
    # grows as the squares of bending and spin
    fast = {
        name: fit
        for name, fit in roots.items()
        if slew.rate
        > SLOW * min((full.frequencies[0] for full in fit.full.values()), default=np.inf)
    }
    limits = turn_limits(artist.model, slew, fast)
    shown = slew.positions, slew.shown(0.0)
    return _motion_replay(artist, slew.times, *shown, TURN, title, [how, *limits])


def _run_replay(
    artist: "_Artist", model: "mujoco.MjModel", given: Commands, roots: "Mapping[str, Fit]"
) -> Replay:
    """A run under commands of actuators to their last time."""
    seconds = float(given.times[-1])
    step = float(model.opt.timestep)
    # so many steps apart, all of them: rates are taken from how positions follow each other
    apart = step * max(math.ceil(seconds / step / (FINER * RUN)), 1)
    spaces = max(round(seconds / apart), 2)
    run = simulate_run(model, None, spaces * apart, spaces + 1, given=given)
    title = f"{seconds:.4g} s under commands of {', '.join(given.actuators)}"
    told = ["simulated in MuJoCo", *run_limits(model, run, roots)]
    return _motion_replay(artist, run.times, run.positions, run.rigid, RUN, title, told)


def _motion_replay(
    artist: "_Artist",
    times: Array,
    positions: Array,
    straight: Array,
    most: int,
    title: str,
    told: Sequence[str],
) -> Replay:
    """A motion of a craft over the same with rigid appendages, positions `(k, nq)` at times `(k,)`,
    in so many frames at most; from where they bend most. `told`: how it was made, and what limits
    it exceeds."""
    some = np.s_[:: math.ceil(times.size / most)]
    shown, rigid = positions[some], straight[some]
    away = [artist.points(a) - artist.points(b) for a, b in zip(shown, rigid, strict=True)]
    sizes = np.linalg.norm(away, axis=2).max(axis=1)
    bends = float(sizes.max()) > STILL * artist.size
    larger = max(SWING * artist.size / float(sizes.max()), 1.0) if bends else 1.0
    power = 10.0 ** math.floor(math.log10(larger))
    factor = max(f * power for f in FACTORS if f * power <= larger)
    pictures = artist.pictures(rigid + factor * (shown - rigid), rigid)
    first = int(np.argmax(sizes))
    rate = float(times[-1]) / (len(pictures) * SLOWER / 1000.0)
    scale = "to scale" if factor == 1.0 else f"drawn {factor:g} times as large"
    how, *exceeded = (said.rstrip(".") for said in told)
    off = (
        f"appendages are off rigid ones, drawn faintly, by {float(sizes.max()):.2g} m at most, "
        f"{scale}; {rate:.3g} times as fast as it is"
    )
    frames = [*pictures[first:], *pictures[:first]]
    return _replay(frames, SLOWER, title, "; ".join([how, off, *exceeded]))


def turn_limits(model: "mujoco.MjModel", slew: Slew, roots: "Mapping[str, Fit]") -> list[str]:
    """Sentences for the limits of large motion that a turn of the hub exceeds; `roots`: the
    appendages by the bodies that are their roots."""
    data = rest(model, slew.positions[0])
    hub = spacecraft_body(model)

    def turned(root: int) -> Driven:
        turn = data.xmat[root].reshape(3, 3).T
        axis = turn @ data.xmat[hub].reshape(3, 3)[:, slew.axis]
        offset = turn @ (data.xpos[root] - data.subtree_com[hub])
        return run_of_turn(slew.rate, slew.acceleration, axis, offset)

    return _exceeded(model, roots, turned)


def run_limits(model: "mujoco.MjModel", run: Run, roots: "Mapping[str, Fit]") -> list[str]:
    """The same for a run, by how its positions follow each other."""
    states = [rest(model, qpos) for qpos in run.positions]

    def moved(root: int) -> Driven:
        places = np.array([state.xpos[root] for state in states])
        axes = np.array([state.xmat[root] for state in states]).reshape(-1, 3, 3)
        motion = np.hstack([places, Rotation.from_matrix(axes).as_rotvec()])
        return driven(motion, float(run.times[1]), np.zeros(3))

    return _exceeded(model, roots, moved)


def _exceeded(
    model: "mujoco.MjModel", roots: "Mapping[str, Fit]", moved: Callable[[int], Driven]
) -> list[str]:
    """Sentences for the limits that appendages exceed; `moved`: what a root goes through."""
    out: list[str] = []
    for name, fit in roots.items():
        if fit.space is None:
            out += limit_sentences(fit.large_motion[0], moved(model.body(name).id))
    return out


def _replay(frames: Sequence[Image.Image], each: int, title: str, told: str) -> Replay:
    film, still = (
        "data:image/webp;base64," + base64.b64encode(webp(shown, each)).decode("ascii")
        for shown in (frames, frames[:1])
    )
    return Replay(film, still, *frames[0].size, title, told)


# -- how it is drawn -------------------------------------------------------------------------------
class _Artist:
    """Draws a model from one place: all faces that are seen, the farthest first."""

    def __init__(self, model: "mujoco.MjModel") -> None:
        self.model = model
        still = rest(model)
        points = drawn_points(model, still)
        self.size = float(np.linalg.norm(np.ptp(points, axis=0)))
        self._drawn = copy.copy(model)
        thicken(self._drawn, SLIMMEST * self.size)
        self._data = mujoco.MjData(self._drawn)
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        self._bare = _is_bare(model)
        self._option.flags[int(mujoco.mjtVisFlag.mjVIS_INERTIA)] = self._bare
        self._scene = mujoco.MjvScene(self._drawn, model.ngeom + model.nbody + 100)
        self._frame = view_frame(azimuth_of(points, still.subtree_com[0]))
        self._make_faces()

    def _make_faces(self) -> None:
        """Corners in the axes of their solids, faces of four corners, and colours."""
        self._update(np.array(self._drawn.qpos0))
        corners: list[Array] = [np.zeros((0, 3))]
        faces: list[NDArray[np.intp]] = []
        colours: list[Array] = []
        owner: list[int] = []
        for number, geom in enumerate(self._scene.geoms[: self._scene.ngeom]):
            own, own_faces = _solid(self._drawn, geom)
            faces.append(own_faces + len(owner))
            rgba = _colour(self._drawn, geom.matid, geom.rgba)
            colours.append(np.tile(rgba, (len(own_faces), 1)))
            corners.append(own)
            owner += [number] * len(own)
        for skin in range(self._drawn.nskin):
            start = int(self._drawn.skin_faceadr[skin])
            own_faces = self._drawn.skin_face[start : start + int(self._drawn.skin_facenum[skin])]
            own_faces = own_faces[:, [0, 1, 2, 2]] + int(self._scene.skinvertadr[skin])
            faces.append(own_faces + len(owner))
            rgba = _colour(self._drawn, self._drawn.skin_matid[skin], self._drawn.skin_rgba[skin])
            colours.append(np.tile(rgba, (len(own_faces), 1)))
        self._corners, self._owner = np.vstack(corners), np.array(owner, dtype=np.intp)
        self._faces, self._colours = np.vstack(faces), np.vstack(colours)

    def _update(self, qpos: Array) -> None:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._drawn, self._data)
        mujoco.mj_comPos(self._drawn, self._data)
        seen = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
        if self._bare:
            seen += int(mujoco.mjtCatBit.mjCAT_DECOR)
        camera = mujoco.MjvCamera()
        mujoco.mjv_updateScene(
            self._drawn, self._data, self._option, None, camera, seen, self._scene
        )

    def points(self, qpos: Array) -> Array:
        """`(n, 3)` corners of all solids and skins at positions `(nq,)` [m]: right, up and
        forward."""
        self._update(qpos)
        geoms = self._scene.geoms[: self._scene.ngeom]
        places = np.array([geom.pos for geom in geoms]).reshape(-1, 3)[self._owner]
        turns = np.array([geom.mat for geom in geoms]).reshape(-1, 3, 3)[self._owner]
        placed = places + np.einsum("nij,nj->ni", turns, self._corners)
        skins = np.array(self._scene.skinvert, dtype=np.float64).reshape(-1, 3)
        return np.vstack([placed, skins]) @ self._frame

    def pictures(
        self, shown: Sequence[Array] | Array, ghosts: Sequence[Array] | Array
    ) -> list[Image.Image]:
        """One of each positions `(k, nq)`, all to one scale, over a faint one of each of the
        ghosts, or over the only one."""
        moved, faint = ([self.points(qpos) for qpos in each] for each in (shown, ghosts))
        every = np.vstack([*moved, *faint])[:, :2]
        low, high = every.min(axis=0), every.max(axis=0)
        across, up = np.maximum(high - low, 1e-9 * float((high - low).max()))
        scale = min((WIDTH - 2 * MARGIN) / across, (HIGHEST - 2 * MARGIN) / up)
        height = math.ceil(scale * up) + 2 * MARGIN
        shift = np.array([WIDTH, height]) / 2.0 - scale * np.array([1.0, -1.0]) * (low + high) / 2.0

        def drawn(points: Array, below: Image.Image | None) -> Image.Image:
            flat = FINE * (points[:, :2] * [scale, -scale] + shift)
            return self._draw(points, flat, below, (FINE * WIDTH, FINE * height))

        below = [drawn(points, None) for points in faint]
        below = below * (len(moved) // len(below))
        return [drawn(a, b).reduce(FINE) for a, b in zip(moved, below, strict=True)]

    def _draw(
        self, points: Array, flat: Array, below: Image.Image | None, size: tuple[int, int]
    ) -> Image.Image:
        """Faces seen from their front, the farthest first, over a picture or as the faint one."""
        corners = points[self._faces]
        # outwards; swapped, as right, up and forward are left-handed
        normals = np.cross(corners[:, 3] - corners[:, 1], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        front = np.flatnonzero(normals[:, 2] < 0.0)
        order = front[np.argsort(-corners[front, :, 2].mean(axis=1), kind="stable")]
        shade = 0.6 + 0.4 * np.clip(normals @ LAMP / np.linalg.norm(LAMP), 0.0, 1.0)
        colours = np.rint(255.0 * self._colours * shade[:, None]).astype(int)
        image = Image.new("RGB", size, "white") if below is None else below.copy()
        canvas = ImageDraw.Draw(image)
        outlines = flat[self._faces[order]].reshape(-1, 8).tolist()
        for outline, colour in zip(outlines, colours[order].tolist(), strict=True):
            colour = GHOST if below is None else tuple(colour)
            canvas.polygon(outline, fill=colour, outline=colour)
        return image


def _is_bare(model: "mujoco.MjModel") -> bool:
    """Whether a file draws nothing of its appendages: then MuJoCo draws the bodies' inertia."""
    bodies = [int(model.jnt_bodyid[j]) for j in sprung(model)]
    geoms = sum(int(model.body_geomnum[body]) for body in bodies)
    return bool(bodies) and model.nskin + geoms == 0


def _colour(model: "mujoco.MjModel", material: int, rgba: Array) -> Array:
    """`(3,)` of a solid or skin, with the mean of its texture, as it looks before white."""
    colour = np.array(rgba if material < 0 else model.mat_rgba[material], dtype=np.float64)
    if material >= 0:
        texture = int(model.mat_texid[material, int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
        if texture >= 0:
            start, channels = int(model.tex_adr[texture]), int(model.tex_nchannel[texture])
            count = int(model.tex_height[texture] * model.tex_width[texture])
            texels = model.tex_data[start : start + channels * count].reshape(-1, channels)
            colour[:3] *= texels[:, :3].mean(axis=0) / 255.0
    return 1.0 - colour[3] * (1.0 - colour[:3])


def _solid(model: "mujoco.MjModel", geom: "mujoco.MjvGeom") -> tuple[Array, NDArray[np.intp]]:
    """Corners `(n, 3)` in the axes of a solid of a scene, and faces of four corners, anticlockwise
    from outside; none of what has no surface here, such as a plane."""
    kinds = mujoco.mjtGeom
    kind, size = int(geom.type), np.array(geom.size, dtype=np.float64)
    arc = np.radians(np.linspace(-90.0, 90.0, 7))
    if kind in (int(kinds.mjGEOM_SPHERE), int(kinds.mjGEOM_ELLIPSOID), int(kinds.mjGEOM_CYLINDER)):
        radii, heights = np.cos(arc), np.sin(arc)
        if kind == int(kinds.mjGEOM_CYLINDER):
            radii, heights = np.array([[0.0, 1.0, 1.0, 0.0], [-1.0, -1.0, 1.0, 1.0]])
        corners, faces = _revolved(radii, heights)
        return corners * size, faces
    if kind == int(kinds.mjGEOM_CAPSULE):
        both = arc[[0, 1, 2, 3, 3, 4, 5, 6]]
        heights = size[0] * np.sin(both) + size[2] * np.repeat([-1.0, 1.0], 4)
        return _revolved(size[0] * np.cos(both), heights)
    if kind == int(kinds.mjGEOM_BOX):
        return CORNERS * size, _BOX
    if kind == int(kinds.mjGEOM_MESH):
        mesh = int(geom.dataid) // 2  # MuJoCo numbers each and its convex hull
        start, first = int(model.mesh_faceadr[mesh]), int(model.mesh_vertadr[mesh])
        faces = model.mesh_face[start : start + int(model.mesh_facenum[mesh])]
        corners = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])]
        if len(faces) > MOST_FACES:
            low, high = corners.min(axis=0), corners.max(axis=0)
            return (low + high) / 2.0 + CORNERS * (high - low) / 2.0, _BOX
        return np.array(corners, np.float64), np.array(faces[:, [0, 1, 2, 2]], np.intp)
    return np.zeros((0, 3)), np.zeros((0, 4), np.intp)


_BOX = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)


def _revolved(radii: Array, heights: Array) -> tuple[Array, NDArray[np.intp]]:
    """A surface around z, from the lowest circle up."""
    angle = math.tau * np.arange(ROUND) / ROUND
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    circles = radii[:, None, None] * ring
    corners = np.column_stack([circles.reshape(-1, 2), np.repeat(heights, ROUND)])
    here = np.arange(ROUND)
    there = (here + 1) % ROUND
    face = np.column_stack([here, there, there + ROUND, here + ROUND])
    return corners, np.vstack([face + ROUND * k for k in range(len(radii) - 1)])
