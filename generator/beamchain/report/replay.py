"""Replays on the pages: coupled modes of a spacecraft and a turn of it, as drawings that move by
themselves (SMIL in inline SVG), with a still for print and for readers who want no motion.

A mode is drawn to first order, every point moving along a line: two drawings and a cosine between.
"""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from beamchain.craft.appendage import Appendage
from beamchain.craft.mode_names import cantilever_names, strain_holders, strain_shares
from beamchain.engine.displacement import moved_positions
from beamchain.engine.library import mujoco, quiet
from beamchain.engine.linear import linear_at
from beamchain.engine.linearise import compile_model
from beamchain.engine.mount import mount
from beamchain.engine.operating_point import poses, quiet_copy, rest_point
from beamchain.engine.slew import Slew, simulate
from beamchain.errors import EngineError, InputError
from beamchain.ports.motions import Array
from beamchain.report.headlines import strain_words
from beamchain.report.outlines import Drawn, Outlines
from beamchain.report.page import page_text
from beamchain.report.tree_plot import COLOURS
from beamchain.steps.retime import without_timing

if TYPE_CHECKING:
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit

WIDTH = 640.0  # of a drawing
FINE = 10.0  # units of a path per unit of the drawing, so that whole numbers do
GAP, MARGIN = 16.0, 12.0
LINE = 11.5  # of text
LOWEST, HIGHEST = 80.0, 210.0  # of the picture of a mode
TALLEST = 280.0  # of that of a turn
LETTERS = 60  # of a line of text below a mode
MOST_MODES = 6  # at rest, as long as the drawings have not too many points,
MOST_POINTS = 2_500
MOST_AT_KEYFRAME, MOST_KEYFRAMES = 2, 3
SAME = 1e-6  # relative: a keyframe with these frequencies has the modes at rest
SWING = 0.08  # of the craft's extent: the largest displacement drawn,
BENT, TURNED = 0.4, 0.3  # or as much as bends an appendage or turns a body by so much [rad]
SLOWEST, FASTEST = 2.4, 0.5  # seconds on the page for one oscillation
AZIMUTHS = np.radians(np.arange(15.0, 360.0, 30.0))
ELEVATIONS = np.radians([20.0, 35.0, 55.0])

ANGLES = np.radians([40.0, 20.0, 10.0, 5.0, 2.5])  # of the turn: the first that is quick enough
MOST_CYCLES = 16.5  # of the mode that rings, in a turn and its ringing
PER_CYCLE = 14  # frames
FEWEST_FRAMES, MOST_FRAMES = 32, 160
MOST_NUMBERS = 20_000  # of all frames of a turn
MOST_WORK = 1_000_000  # steps times degrees of freedom of the simulations of a turn
SHORTEST, LONGEST = 5.0, 14.0  # seconds on the page
FACTORS = (1.0, 2.0, 5.0)  # times powers of ten: by which an elastic motion is exaggerated
CHART = 74.0  # height of the curves below a turn

SMIL = 'repeatCount="indefinite"'
SINE = ".364 0 .636 1"  # spline of half a cosine
FACES = np.array([0.45, 0.3, 0.84])  # light on the sides of boxes, in the picture's axes


class View(NamedTuple):
    """`right`, `up` and `near` `(3,)` of a picture in the base's axes."""

    axes: Array

    def flat(self, points: Array) -> Array:
        """`(..., 2)` right and up."""
        return points @ self.axes[:2].T

    def depth(self, points: Array) -> Array:
        """`(...)` towards the eye."""
        return points @ self.axes[2]


class Moving(NamedTuple):
    """A mode that is drawn: its number and frequency [rad/s], what is said of it, and its shape
    `(nv,)`."""

    number: int
    omega: float
    words: str
    shape: Array


class Replay(NamedTuple):
    """A drawing and its caption."""

    svg: str
    caption: str


# -- what is drawn ---------------------------------------------------------------------------------
def craft_replays(embedded: "Embedded") -> list[Replay]:
    """Of the coupled modes at rest and at keyframes, then of a turn."""
    model = embedded.untimed
    outlines = Outlines(model, embedded.appendages)
    out: list[Replay] = []
    at_rest = embedded.shapes_at("rest")[0]
    for name, qpos in list(poses(model).items())[: MOST_KEYFRAMES + 1]:
        if name == "rest":
            modes, of = _table_modes(embedded)
            modes = modes[: _limit(outlines, MOST_MODES)]
            where = "The coupled modes at rest"
        else:
            frequency, shapes = embedded.shapes_at(name)
            same = frequency.shape == at_rest.shape
            if same and np.allclose(frequency, at_rest, rtol=SAME, atol=0.0):
                continue
            modes = _named(model, qpos, frequency, shapes)
            modes = modes[: _limit(outlines, MOST_AT_KEYFRAME, MOST_POINTS // MOST_KEYFRAMES)]
            of = frequency.size
            where = f"The coupled modes at keyframe {name}"
        if modes:
            out.append(_mode_replay(outlines, qpos, modes, where, of))
    return [*out, *_turn_replay(outlines, embedded.model)]


def scene_replays(fit: "Fit") -> list[Replay]:
    """Of the modes of a fit's scene, the appendage on its hub, and of a turn of it; of a liquid
    the sentence that it has no mode there."""
    if not fit.chain.hinges:
        return []
    if fit.chain.hung:
        return [
            Replay("", "No mode is drawn: nothing accelerates the liquid in scene.xml at rest.")
        ]
    scene = compile_model(fit.scene_mjcf())
    model = without_timing(scene)
    place = mount(model, "mount", "site", "mount")
    prefix = f"{fit.spec.name}_"
    appendage = Appendage("mount", prefix, mount=place, hub=fit.hub, spec=fit.spec, fit=fit)
    outlines = Outlines(model, [appendage])
    rest = poses(model)["rest"]
    every = linear_at(rest_point(quiet_copy(model))).modes()
    modes = _named(model, rest, every.frequency, every.shapes)
    where = f"The modes of scene.xml, {fit.spec.name} on a hub of {fit.hub.mass:.4g} kg"
    shown = _mode_replay(outlines, rest, modes[: _limit(outlines, MOST_MODES)], where, len(modes))
    return [shown, *_turn_replay(outlines, scene)]


def _limit(outlines: Outlines, most: int, points: int = MOST_POINTS) -> int:
    """How many modes of a craft are drawn at a pose."""
    return max(min(most, points // outlines.corners), 1)


def _table_modes(embedded: "Embedded") -> tuple[list[Moving], int]:
    """The first modes of the table of coupled modes, with its numbers; and how many it has."""
    model = embedded.untimed
    named = _named(model, poses(model)["rest"], *embedded.shapes_at("rest"))
    free = list(range(len(named)))
    out: list[Moving] = []
    table = embedded.assembly.modes
    for number, mode in enumerate(table, 1):
        if mode.mujoco is None or not free:
            continue
        near = min(free, key=lambda k: abs(named[k].omega - (mode.mujoco or 0.0)))
        free.remove(near)
        out.append(named[near]._replace(number=number, words=mode.words or named[near].words))
    return out, len(table)


def _named(model: "mujoco.MjModel", qpos: Array, frequencies: Array, shapes: Array) -> list[Moving]:
    """Modes, with what has their strain energy."""
    linear = linear_at(rest_point(quiet_copy(model), qpos))
    names, rows = cantilever_names(model, linear.mass, linear.stiffness)
    share = strain_shares(rows, shapes)
    columns = zip(frequencies.tolist(), share.T, shapes.T, strict=True)
    return [
        Moving(number, omega, strain_words(strain_holders(names, parts)), shape)
        for number, (omega, parts, shape) in enumerate(columns, 1)
    ]


# -- modes -----------------------------------------------------------------------------------------
def _mode_replay(
    outlines: Outlines, qpos: Array, modes: Sequence[Moving], where: str, of: int
) -> Replay:
    if not modes:
        return Replay("", f"{where}: there is nothing to draw.")
    origin, turn = outlines.frame(qpos)

    def in_base(drawn: Drawn) -> Drawn:
        return _placed(drawn, origin, turn)

    rest = in_base(outlines.at(qpos))
    extent = float(np.ptp(rest.points, axis=0).max())
    name = str(outlines.model.body(outlines.base).name) or "the base"
    # central differences of the points, which are linear in so small a motion
    slopes: list[Drawn] = []
    for mode in modes:
        step = 1e-5 / float(np.abs(mode.shape).max())
        ahead, behind = (
            in_base(outlines.at(moved_positions(outlines.model, qpos, sign * step * mode.shape)))
            for sign in (1.0, -1.0)
        )
        slopes.append(_combined(ahead, behind, 0.5 / step, -0.5 / step))
    reaches = [float(np.linalg.norm(slope.points, axis=1).max()) for slope in slopes]
    turns = [_rotations(slope, rest) for slope in slopes]
    base = next(k for k, solid in enumerate(outlines.solids) if solid.body == outlines.base)
    sizes = [
        1.0
        / max(reach / (SWING * extent), float(turned.max()) / TURNED, _steepest(slope, rest) / BENT)
        for slope, reach, turned in zip(slopes, reaches, turns, strict=True)
    ]
    view = _oblique(rest.points, [s.points for s in slopes])
    ends = [
        tuple(_combined(rest, slope, 1.0, sign * size) for sign in (1.0, -1.0))
        for slope, size in zip(slopes, sizes, strict=True)
    ]
    flat = view.flat(np.vstack([rest.points, *(end.points for pair in ends for end in pair)]))
    columns = 2 if len(modes) > 1 else 1
    across = (WIDTH - (columns - 1) * GAP) / columns
    fit = _Fit(flat, across, LOWEST if columns == 2 else 0.0, HIGHEST)
    outline = _Outline(outlines, rest, view, fit)
    told = [
        _told(
            mode,
            f"drawn: up to {size * reach:.3g} m, {name} turns "
            f"{math.degrees(size * float(turned[base])):.3g}°; time × {_rate(mode, modes[0]):.3g}",
        )
        for mode, size, reach, turned in zip(modes, sizes, reaches, turns, strict=True)
    ]
    lines = max(len(words) for words in told)
    tall = fit.height + LINE * lines + GAP
    panels: list[dict[str, Any]] = []
    for i, (mode, pair) in enumerate(zip(modes, ends, strict=True)):
        panels.append(
            {
                "x": i % columns * (across + GAP),
                "y": i // columns * tall,
                "title": told[i][0],
                "told": told[i],
                "desc": f"{told[i][0]}; {mode.words}; {told[i][-1]}",
                "ghost": outline.ghost(rest),
                "still": outline.shapes([pair[0]]),
                "moving": outline.shapes(pair),
                "animate": f'dur="{_seconds(mode, modes[0]):.3g}s" calcMode="spline" '
                f'keyTimes="0;.5;1" keySplines="{SINE};{SINE}" {SMIL}',
            }
        )
    rows = -(-len(modes) // columns)
    shown = f"{len(modes)} of {of}" if len(modes) < of else f"all {of}"
    caption = f"{where}, {shown}; dashed: at rest.{_left_out(outlines)}"
    if any(not ribbon.motion.shape[2] for ribbon in outlines.ribbons):
        caption += " An imported or rigid appendage is drawn by the links of its chain."
    svg = page_text(
        "replay.svg",
        label=f"{where}, moving: {'; '.join(panel['desc'] for panel in panels)}",
        width=WIDTH,
        height=rows * tall,
        panels=panels,
        picture=fit.height,
        line=LINE,
        triad=_triad(view, fit, rest),
        fine=FINE,
        chart=None,
    )
    return Replay(svg, caption)


def _seconds(mode: Moving, first: Moving) -> float:
    """How long an oscillation takes on the page."""
    return max(SLOWEST * first.omega / mode.omega, FASTEST)


def _rate(mode: Moving, first: Moving) -> float:
    """How much faster than it is a mode is played."""
    return math.tau / mode.omega / _seconds(mode, first)


def _told(mode: Moving, size: str) -> list[str]:
    """Lines below a drawing: which mode, what moves, how large and fast it is drawn."""
    title = f"mode {mode.number}: {mode.omega:.5g} rad/s, {mode.omega / math.tau:.4g} Hz"
    words = textwrap.wrap(mode.words, LETTERS, max_lines=2, placeholder=" …")
    return [title, *words, *textwrap.wrap(size, LETTERS)]


def _steepest(slope: Drawn, rest: Drawn) -> float:
    """The largest change of direction along an appendage per unit of a motion [rad]."""
    most = 0.0
    for moved, middle in zip(slope.middles, rest.middles, strict=True):
        steps = np.linalg.norm(np.diff(middle, axis=0), axis=1)
        long = steps > 1e-3 * steps.sum()
        turned = np.diff(moved, axis=0)[long] / steps[long, None]
        most = max(most, float(np.linalg.norm(turned, axis=1).max(initial=0.0)))
    return most


def _rotations(slope: Drawn, rest: Drawn) -> Array:
    """By how much each solid turns per unit of a motion [rad]: of `d = t + r x p` the size of the r
    that fits its corners."""
    sizes: list[float] = []
    for corners, moved in zip(rest.solids, slope.solids, strict=True):
        arms = corners - corners.mean(axis=0)
        moves = moved - moved.mean(axis=0)
        inertia = np.sum(arms**2) * np.eye(3) - arms.T @ arms
        turn = np.linalg.pinv(inertia) @ np.cross(arms, moves).sum(axis=0)
        sizes.append(float(np.linalg.norm(turn)))
    return np.array(sizes)


def _oblique(points: Array, motions: Sequence[Array]) -> View:
    """The view that shows the craft large and every motion well."""
    best, most = View(np.eye(3)), -1.0
    for elevation in ELEVATIONS:
        for azimuth in AZIMUTHS:
            c, s = math.cos(azimuth), math.sin(azimuth)
            ce, se = math.cos(elevation), math.sin(elevation)
            view = View(np.array([[-s, c, 0.0], [-se * c, -se * s, ce], [ce * c, ce * s, se]]))
            flat = view.flat(points - points.mean(axis=0))
            size = np.ptp(flat, axis=0)
            drawn = min(1.0 / size[0], 0.6 / size[1]) * float(np.linalg.norm(size))
            shown = float(np.linalg.norm(flat) / np.linalg.norm(points - points.mean(axis=0)))
            seen = [
                float(np.linalg.norm(view.flat(motion)) / max(np.linalg.norm(motion), 1e-300))
                for motion in motions
            ]
            worth = drawn * shown**2 * (min(seen) + float(np.mean(seen)))
            if worth > most:
                best, most = view, worth
    return best


# -- a turn ----------------------------------------------------------------------------------------
def _turn_replay(outlines: Outlines, model: "mujoco.MjModel") -> list[Replay]:
    """Of a simulated turn, where the spacecraft flies freely; or why there is none."""
    free = np.flatnonzero(np.asarray(model.jnt_type) == int(mujoco.mjtJoint.mjJNT_FREE))
    if not free.size or int(model.jnt_bodyid[free[0]]) != outlines.base:
        return []
    try:
        slew = _quick_slew(quiet_copy(model))
    except EngineError as error:
        return [Replay("", f"No turn is drawn: {str(error).partition(';')[0]}.")]
    except InputError:  # nothing bends
        return []
    wanted = math.ceil(PER_CYCLE * slew.times[-1] * slew.omega / math.tau)
    few = max(MOST_NUMBERS // outlines.corners, FEWEST_FRAMES)
    frames = min(wanted, few, MOST_FRAMES)
    return [_drawn_turn(outlines, _between_steps(slew, float(model.opt.timestep), frames))]


def _quick_slew(model: "mujoco.MjModel") -> Slew:
    """A turn as large as can be shown in so many frames."""
    for angle in ANGLES.tolist():
        with quiet():
            slew = simulate(model, angle=angle, frames=MOST_FRAMES, most=MOST_WORK // model.nv)
        if slew.times[-1] * slew.omega / math.tau <= MOST_CYCLES:
            return slew
    raise EngineError("even a small turn bends the appendages further than can be believed")


def _between_steps(slew: Slew, step: float, frames: int) -> Slew:
    """The same at other times: as simulated, positions are those of the nearest step."""
    steps, first = np.unique(np.rint(slew.times / step), return_index=True)
    between = CubicSpline(step * steps, slew.positions[first])
    times = np.linspace(0.0, step * steps[-1], frames)
    return replace(slew, times=times, positions=between(times))


def _drawn_turn(outlines: Outlines, slew: Slew) -> Replay:
    origin, turn = outlines.frame(slew.positions[0])

    def drawn(factor: float) -> list[Drawn]:
        return [_placed(outlines.at(qpos), origin, turn) for qpos in slew.shown(factor)]

    rigid = drawn(0.0)
    frames = drawn(1.0)
    extent = float(np.ptp(rigid[0].points, axis=0).max())
    axes = [outlines.frame(qpos)[1] for qpos in slew.positions]
    bends = _elastic(frames, rigid, axes)
    factor = _factor(SWING * extent / max(float(np.abs(bends).max()), 1e-300))
    if factor > 1.0:
        frames = drawn(factor)
    chart = _chart(slew, axes, bends)
    still = int(np.argmax(np.abs(bends)))
    instant = float(slew.times[still])
    points = np.vstack([frame.points for frame in (*frames, *rigid)])
    view = _along(slew.axis, points)
    fit = _Fit(view.flat(points), WIDTH, 0.0, TALLEST)
    outline = _Outline(outlines, rigid[0], view, fit)
    seconds = float(np.clip(slew.times[-1], SHORTEST, LONGEST))
    rate = float(slew.times[-1]) / seconds
    name = "xyz"[slew.axis]
    told = [
        f"{slew.body} turned by {math.degrees(slew.angle):g}° about {name} in "
        f"{slew.duration:.4g} s, ringing at {slew.omega:.5g} rad/s",
        f"elastic motion × {factor:g}; time × {rate:.3g}",
    ]
    panel = {
        "x": 0.0,
        "y": 0.0,
        "title": told[0],
        "told": told,
        "desc": "; ".join(told),
        "ghost": [],
        "still": outline.shapes([frames[still]], ghosts=[rigid[still]]),
        "moving": outline.shapes(frames, ghosts=rigid),
        "animate": f'dur="{seconds:.3g}s" {SMIL}',
    }
    top = fit.height + LINE * len(told) + GAP
    size = "as large as it is" if factor == 1.0 else f"{factor:g} times as large as it is"
    caption = (
        f"A turn simulated in MuJoCo, seen along its axis: a torque on {slew.body} forwards, then "
        f"back. Elastic motion is drawn {size}, the base as it moves; dashed: appendages that stay "
        f"straight. Printed: {instant:.3g} s, where they bend most." + _left_out(outlines)
    )
    svg = page_text(
        "replay.svg",
        label=f"A turn, moving: {panel['desc']}",
        width=WIDTH,
        height=top + CHART + 2.0 * LINE,
        panels=[panel],
        picture=fit.height,
        line=LINE,
        triad=_triad(view, fit, *frames),
        fine=FINE,
        chart={**chart, "y": top, "seconds": seconds},
    )
    return Replay(svg, caption)


def _along(axis: int, points: Array) -> View:
    """The view along an axis of the base in which the craft is drawn larger."""
    around = [(axis + 1) % 3, (axis + 2) % 3]
    right, up, near = np.eye(3)[[*around, axis]]
    views = [View(np.array(rows)) for rows in ((right, up, near), (up, -right, near))]
    sizes = [np.ptp(view.flat(points), axis=0) for view in views]
    scales = [min(WIDTH / size[0], TALLEST / size[1]) for size in sizes]
    return views[int(np.argmax(scales))]


def _elastic(bent: Sequence[Drawn], straight: Sequence[Drawn], turns: Sequence[Array]) -> Array:
    """`(k,)` how far the point of an appendage that moves most is from where it would be if the
    appendage were straight [m], with a sign: in the axes of the base, along its largest
    displacement."""
    away = np.array(
        [
            (np.vstack(a.middles) - np.vstack(b.middles)) @ turn
            for a, b, turn in zip(bent, straight, turns, strict=True)
        ]
    )
    frame, point = np.unravel_index(np.argmax(np.linalg.norm(away, axis=2)), away.shape[:2])
    way = away[frame, point] / max(float(np.linalg.norm(away[frame, point])), 1e-300)
    return away[:, point] @ way


def _factor(most: float) -> float:
    """The largest even factor up to another, 1 at least."""
    if most <= 1.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(most))
    return max(f * power for f in FACTORS if f * power <= most)


def _chart(slew: Slew, axes: Sequence[Array], bends: Array) -> dict[str, Any]:
    """Attitude of the base, of which these are the axes, and elastic displacement over time, below
    the drawing."""
    i, j = (slew.axis + 1) % 3, (slew.axis + 2) % 3
    turned = [axes[0].T @ turn for turn in axes]
    angles = np.degrees([math.atan2(turn[j, i], turn[i, i]) for turn in turned])
    left, right = 44.0, WIDTH - 50.0
    x = left + (right - left) * slew.times / slew.times[-1]

    def height(values: Array) -> Array:
        """From 0 at the top; of zero for the last."""
        low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
        return CHART * (high - np.array([*values, 0.0])) / max(high - low, 1e-300)

    def line(y: Array) -> str:
        return "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y[:-1], strict=True))

    angle, bend = height(angles), height(bends)
    return {
        "height": CHART,
        "left": left,
        "right": right,
        "angle": line(angle),
        "bend": line(bend),
        "zero": float(bend[-1]),
        "most_angle": f"{float(angles.max()):.3g}°" if slew.angle > 0.0 else "0°",
        "most_bend": f"{float(bends.max()):.2g} m",
        "end": f"{slew.times[-1]:.4g} s",
        "colours": ("#1a1a1a", COLOURS[0]),
    }


# -- paths -----------------------------------------------------------------------------------------
ROUGH = 12  # corners of an outline in a turn


class _Fit:
    """From the picture's axes [m] to the drawing."""

    def __init__(self, flat: Array, width: float, lowest: float, highest: float) -> None:
        low, high = flat.min(axis=0), flat.max(axis=0)
        size = np.maximum(high - low, 1e-9 * float((high - low).max()))
        room = width - 2.0 * MARGIN
        self.width = width
        self.scale = min(room / size[0], (highest - 2.0 * MARGIN) / size[1])
        self.height = max(float(self.scale * size[1]) + 2.0 * MARGIN, lowest)
        self._middle = (low + high) / 2.0
        self._to = np.array([width, self.height]) / 2.0

    def __call__(self, flat: Array) -> Array:
        """Whole numbers, y downwards."""
        moved = (flat - self._middle) * [self.scale, -self.scale] + self._to
        return np.rint(FINE * moved).astype(int)


class _Outline:
    """Draws a craft from one view: which sides of boxes are seen, which edge of a ribbon is the
    wide one, and what lies behind what follow from a pose."""

    def __init__(self, outlines: Outlines, rest: Drawn, view: View, fit: _Fit) -> None:
        self.view = view
        self.fit = fit
        self._outlines = outlines
        self._wide = [
            int(np.argmax(np.linalg.norm(view.flat(sides), axis=2).max(axis=0)))
            for sides in rest.sides
        ]
        middle = [
            *(float(view.depth(points).mean()) for points in rest.solids),
            *(float(view.depth(points).mean()) for points in rest.middles),
        ]
        self._order = np.argsort(middle, kind="stable").tolist()
        self._rest = rest

    def ghost(self, drawn: Drawn) -> list[str]:
        """The appendages' middle lines."""
        return [_path(self.fit(self.view.flat(middle)), closed=False) for middle in drawn.middles]

    def shapes(
        self, frames: Sequence[Drawn], *, ghosts: Sequence[Drawn] = ()
    ) -> list[dict[str, Any]]:
        """Paths, farthest first: `d` of the first frame, `values` of all."""
        out: list[dict[str, Any]] = []
        for i in range(len(self._rest.arms)):
            arms = [self.fit(self.view.flat(frame.arms[i])) for frame in frames]
            out.append(_shape(arms, "arm", closed=False))
        for k in self._order:
            if k < len(self._rest.solids):
                out += self._solid(k, frames)
            else:
                out += self._ribbon(k - len(self._rest.solids), frames)
        for i in range(len(self._rest.middles)) if ghosts else ():
            # straight as they are, root and tip are enough
            ends = [self.fit(self.view.flat(line.middles[i][[0, -1]])) for line in ghosts]
            out.append(_shape(ends, "rest", closed=False))
        return out

    def _ribbon(self, i: int, frames: Sequence[Drawn]) -> list[dict[str, Any]]:
        side = self._wide[i]
        out: list[dict[str, Any]] = []
        for first, last in self._outlines.ribbons[i].pieces:
            piece = slice(first, last + 1, 1 if len(frames) <= 2 else 2)
            edges: list[Array] = []
            for frame in frames:
                middle, across = frame.middles[i][piece], frame.sides[i][piece, side]
                edge = np.vstack([middle + across, (middle - across)[::-1]])
                edges.append(self.fit(self.view.flat(edge)))
            out.append(_shape(edges, "ribbon", fill=COLOURS[i % len(COLOURS)]))
        return out

    def _solid(self, i: int, frames: Sequence[Drawn]) -> list[dict[str, Any]]:
        solid = self._outlines.solids[i]
        corners = self._rest.solids[i]
        if len(frames) <= 2 and solid.faces:
            out: list[dict[str, Any]] = []
            for face in solid.faces:
                a, b, c = corners[list(face[:3])]
                normal = np.cross(b - a, c - b)
                normal = self.view.axes @ (normal / max(float(np.linalg.norm(normal)), 1e-300))
                if normal[2] > 1e-3:
                    sides = [self.fit(self.view.flat(f.solids[i][list(face)])) for f in frames]
                    out.append(_shape(sides, "solid", fill=_grey(normal)))
            return out
        flat = [self.view.flat(frame.solids[i]) for frame in frames]
        count = ROUGH if len(frames) > 2 else 2 * ROUGH
        angle = math.tau * (np.arange(count) + 0.5) / count
        ways = np.vstack([np.cos(angle), np.sin(angle)])
        # the corner that lies farthest in each direction: the same number in every frame
        hulls = [self.fit(points[np.argmax(points @ ways, axis=0)]) for points in flat]
        return [_shape(hulls, "solid", fill=_grey(np.array([0.0, 0.0, 1.0])))]


def _grey(normal: Array) -> str:
    level = round(150 + 75 * float(np.clip(FACES @ normal, 0.0, 1.0)))
    return f"#{level:02x}{level:02x}{level + 6:02x}"


def _shape(
    frames: Sequence[Array], kind: str, *, fill: str = "none", closed: bool = True
) -> dict[str, Any]:
    paths = [_path(points, closed=closed) for points in frames]
    values = [*paths, paths[0]] if len(paths) == 2 else paths
    return {"kind": kind, "fill": fill, "d": paths[0], "values": ";".join(values)}


def _path(points: Array, *, closed: bool) -> str:
    """A path of whole numbers `(k, 2)`, each after the one before."""
    first, *steps = np.diff(points, axis=0, prepend=[[0, 0]]).tolist()
    line = "".join(
        f"{a}{_signed(b)}{' ' if i < len(steps) - 1 else ''}" for i, (a, b) in enumerate(steps)
    )
    return f"M{first[0]}{_signed(first[1])}l{line}{'z' if closed else ''}"


def _signed(value: int) -> str:
    return f"{value}" if value < 0 else f" {value}"


def _triad(view: View, fit: _Fit, *frames: Drawn) -> dict[str, Any]:
    """The base's axes, those that are seen, in the corner that is most free."""
    axes: list[dict[str, Any]] = []
    for name, axis in zip("xyz", view.axes.T, strict=True):
        if math.hypot(axis[0], axis[1]) > 0.15:
            axes.append({"name": name, "x": 15.0 * axis[0], "y": -15.0 * axis[1]})
    points = np.vstack([fit(view.flat(frame.points)) for frame in frames]) / FINE
    inset = 30.0
    corners = [
        np.array([x, y]) for y in (inset, fit.height - inset) for x in (inset, fit.width - inset)
    ]
    free = [float(np.linalg.norm(points - corner, axis=1).min()) for corner in corners]
    x, y = corners[int(np.argmax(free))].tolist()
    return {"x": x, "y": y, "axes": axes}


def _placed(drawn: Drawn, origin: Array, turn: Array) -> Drawn:
    """The same in the axes of a base."""
    return Drawn(
        [(points - origin) @ turn for points in drawn.solids],
        [(points - origin) @ turn for points in drawn.middles],
        [sides @ turn for sides in drawn.sides],
        [(points - origin) @ turn for points in drawn.arms],
    )


def _combined(a: Drawn, b: Drawn, by_a: float, by_b: float) -> Drawn:
    """A linear combination of two."""
    pairs: list[list[Array]] = [
        [by_a * x + by_b * y for x, y in zip(one, other, strict=True)]
        for one, other in zip(a, b, strict=True)
    ]
    return Drawn(*pairs)


def _left_out(outlines: Outlines) -> str:
    appendages, solids = outlines.left_out
    parts = [
        f"{count} {what}"
        for count, what in ((appendages, "shorter appendages"), (solids, "smaller solids"))
        if count
    ]
    return f" Not drawn: {' and '.join(parts)}." if parts else ""
