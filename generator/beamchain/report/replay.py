"""Replays on the pages: coupled modes of a spacecraft and a turn of it, as drawings that move by
themselves (SMIL in inline SVG), with a still for print and for readers who want no motion.

A mode is drawn to first order, every point moving along a line: two drawings and a cosine between.
"""

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamchain.craft.appendage import Appendage
from beamchain.craft.mode_names import cantilever_names, mode_names
from beamchain.craft.timing import without_timing
from beamchain.engine.library import mujoco, quiet
from beamchain.engine.linear import linear_at
from beamchain.engine.linearise import compile_model
from beamchain.engine.mount import mount
from beamchain.engine.operating_point import poses, quiet_copy, rest_point
from beamchain.engine.slew import Slew, simulate
from beamchain.errors import BeamchainError
from beamchain.ports.motions import Array
from beamchain.report.outlines import Drawn, Outlines
from beamchain.report.page import page_text
from beamchain.report.tree_plot import COLOURS

if TYPE_CHECKING:
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit

WIDTH = 640.0  # of a drawing
FINE = 10.0  # units of a path per unit of the drawing, so that whole numbers do
GAP, MARGIN = 16.0, 12.0
LINE = 11.5  # of text
LOWEST, HIGHEST = 80.0, 210.0  # of the picture of a mode
TALLEST = 330.0  # of that of a turn
LETTERS = 62  # of a line of text below a mode
MOST_MODES = 6  # at rest
MOST_AT_KEYFRAME, MOST_KEYFRAMES = 2, 3
SWING = 0.08  # of the craft's extent: the largest displacement drawn,
BENT, TURNED = 0.4, 0.15  # or as much as bends an appendage or turns the base by so much [rad]
SLOWEST, FASTEST = 2.4, 0.5  # seconds on the page for one oscillation
AZIMUTHS = np.radians(np.arange(15.0, 360.0, 30.0))
ELEVATIONS = np.radians([20.0, 35.0, 55.0])

ANGLES = np.radians([40.0, 20.0, 10.0, 5.0, 2.5])  # of the turn: the first that is quick enough
MOST_CYCLES = 16.5  # of the mode that rings, in a turn and its ringing
PER_CYCLE = 14  # frames
MOST_FRAMES = 160
MOST_NUMBERS = 40_000  # of all frames of a turn
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
    for name, qpos in list(poses(model).items())[: MOST_KEYFRAMES + 1]:
        if name == "rest":
            modes, of = _table_modes(embedded)
            where = "The coupled modes at rest"
        elif _is_rest(model, qpos):
            continue
        else:
            every = embedded.shapes_at(name)
            modes = _named(model, qpos, every.frequency, every.shapes)[:MOST_AT_KEYFRAME]
            of = every.frequency.size
            where = f"The coupled modes at keyframe {name}"
        if modes:
            out.append(_mode_replay(outlines, qpos, modes, where, of))
    return [*out, *_turn_replay(outlines, embedded.model)]


def scene_replays(fit: "Fit") -> list[Replay]:
    """Of the modes of a fit's scene, the appendage on its hub, and of a turn of it."""
    if not fit.chain.hinges:
        return []
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
    shown = _mode_replay(outlines, rest, modes[:MOST_MODES], where, len(modes))
    return [shown, *_turn_replay(outlines, scene)]


def _table_modes(embedded: "Embedded") -> tuple[list[Moving], int]:
    """The first modes of the table of coupled modes, with its numbers; and how many it has."""
    model = embedded.untimed
    every = embedded.shapes_at("rest")
    named = _named(model, poses(model)["rest"], every.frequency, every.shapes)
    free = list(range(len(named)))
    out: list[Moving] = []
    table = embedded.assembly.modes
    for number, mode in enumerate(table, 1):
        if mode.mujoco is None or not free or len(out) == MOST_MODES:
            continue
        near = min(free, key=lambda k: abs(named[k].omega - (mode.mujoco or 0.0)))
        free.remove(near)
        out.append(named[near]._replace(number=number, words=mode.words or named[near].words))
    return out, len(table)


def _named(
    model: "mujoco.MjModel", qpos: Array, frequencies: Array, shapes: Array
) -> list[Moving]:
    """Modes with the names of the cantilever modes that have most of their energy."""
    linear = linear_at(rest_point(quiet_copy(model), qpos))
    words = mode_names(shapes, *cantilever_names(model, linear.mass, linear.stiffness))
    rows = zip(frequencies.tolist(), words, shapes.T, strict=True)
    return [Moving(k, omega, f"mostly {name}", shape) for k, (omega, name, shape) in enumerate(rows, 1)]


def _is_rest(model: "mujoco.MjModel", qpos: Array) -> bool:
    """Whether all joints but free ones are where they are at rest."""
    motion = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, motion, 1.0, model.qpos0, qpos)
    free = np.asarray(model.jnt_type)[np.asarray(model.dof_jntid)] == 0
    return bool(np.all(np.abs(motion[~free]) < 1e-9))


# -- modes -----------------------------------------------------------------------------------------
def _mode_replay(
    outlines: Outlines, qpos: Array, modes: Sequence[Moving], where: str, of: int
) -> Replay:
    origin, turn = outlines.frame(qpos)

    def in_base(drawn: Drawn) -> Drawn:
        return _placed(drawn, origin, turn)

    rest = in_base(outlines.at(qpos))
    extent = float(np.ptp(rest.points, axis=0).max())
    # central differences of the points, which are linear in so small a motion
    slopes: list[Drawn] = []
    for mode in modes:
        step = 1e-5 / float(np.abs(mode.shape).max())
        ahead, behind = (
            in_base(outlines.at(outlines.moved(qpos, sign * step * mode.shape)))
            for sign in (1.0, -1.0)
        )
        slopes.append(_combined(ahead, behind, 0.5 / step, -0.5 / step))
    reaches = [float(np.linalg.norm(slope.points, axis=1).max()) for slope in slopes]
    turns = [_rotation(outlines, slope, rest) for slope in slopes]
    sizes = [
        1.0
        / max(reach / (SWING * extent), turned / TURNED, _steepest(slope, rest) / BENT)
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
    text = {
        mode.number: textwrap.wrap(mode.words, LETTERS, max_lines=2, placeholder=" …")
        for mode in modes
    }
    lines = 2 + max(len(words) for words in text.values())
    tall = fit.height + LINE * lines + GAP
    panels: list[dict[str, Any]] = []
    slowest = modes[0].omega
    base = _base_name(outlines)
    for i, (mode, pair) in enumerate(zip(modes, ends, strict=True)):
        seconds = max(SLOWEST * slowest / mode.omega, FASTEST)
        rate = math.tau / mode.omega / seconds
        largest = sizes[i] * reaches[i]
        degrees = math.degrees(sizes[i] * turns[i])
        told = [
            f"mode {mode.number}: {mode.omega:.5g} rad/s, {mode.omega / math.tau:.4g} Hz",
            *text[mode.number],
            f"drawn: largest displacement {largest:.2g} m, {base} turns {degrees:.2g}°; "
            f"time × {rate:.3g}",
        ]
        panels.append(
            {
                "x": i % columns * (across + GAP),
                "y": i // columns * tall,
                "title": told[0],
                "told": told,
                "desc": f"{told[0]}; {mode.words}; {told[-1]}",
                "ghost": outline.ghost(rest),
                "still": outline.shapes([pair[0]]),
                "moving": outline.shapes(pair),
                "animate": f'dur="{seconds:.3g}s" calcMode="spline" keyTimes="0;.5;1" '
                f'keySplines="{SINE};{SINE}" {SMIL}',
                "swings": True,
            }
        )
    rows = -(-len(modes) // columns)
    shown = f"{len(modes)} of {of} are drawn" if len(modes) < of else "all are drawn"
    caption = (
        f"{where}: {shown}. A mode has no size of its own: each is drawn so large that it is "
        "seen, all in proportion, so that the base answers as it does in the file. Appendages are "
        "bent as the beam is in the modes kept; dashed: at rest. Time × 2: played at twice its "
        "rate." + _left_out(outlines)
    )
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
        triad=_triad(view),
        fine=FINE,
        chart=None,
    )
    return Replay(svg, caption)


def _base_name(outlines: Outlines) -> str:
    return str(outlines.model.body(outlines.base).name) or "the base"


def _steepest(slope: Drawn, rest: Drawn) -> float:
    """The largest change of direction along an appendage per unit of a motion [rad]."""
    most = 0.0
    for moved, middle in zip(slope.middles, rest.middles, strict=True):
        steps = np.linalg.norm(np.diff(middle, axis=0), axis=1)
        long = steps > 1e-3 * steps.sum()
        turned = np.diff(moved, axis=0)[long] / steps[long, None]
        most = max(most, float(np.linalg.norm(turned, axis=1).max(initial=0.0)))
    return most


def _rotation(outlines: Outlines, slope: Drawn, rest: Drawn) -> float:
    """By how much a solid of the base turns per unit of a motion [rad]: of `d = t + r x p` the r
    that fits its corners."""
    i = next(k for k, solid in enumerate(outlines.solids) if solid.body == outlines.base)
    arms = rest.solids[i] - rest.solids[i].mean(axis=0)
    moves = slope.solids[i] - slope.solids[i].mean(axis=0)
    inertia = np.sum(arms**2) * np.eye(3) - arms.T @ arms
    return float(np.linalg.norm(np.linalg.pinv(inertia) @ np.cross(arms, moves).sum(axis=0)))


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
    """Of a simulated turn, where the spacecraft flies freely; else nothing, or why."""
    free = np.flatnonzero(np.asarray(model.jnt_type) == int(mujoco.mjtJoint.mjJNT_FREE))
    if not free.size or int(model.jnt_bodyid[free[0]]) != outlines.base:
        return []
    try:
        slew = _quick_slew(quiet_copy(model))
    except BeamchainError:
        return []
    return [] if slew is None else [_drawn_turn(outlines, slew)]


def _quick_slew(model: "mujoco.MjModel") -> Slew | None:
    """A turn that a page can show, as large as can be; None where it takes too many steps."""
    frames = MOST_FRAMES
    for angle in ANGLES.tolist():
        with quiet():
            slew = simulate(model, angle=angle, frames=frames, most=MOST_WORK // model.nv)
        if slew.times[-1] * slew.omega / math.tau <= MOST_CYCLES:
            return slew
    return None


def _drawn_turn(outlines: Outlines, slew: Slew) -> Replay:
    cycles = float(slew.times[-1]) * slew.omega / math.tau
    points = sum(_corner_count(outlines))
    wanted = min(math.ceil(PER_CYCLE * cycles), MOST_FRAMES, max(MOST_NUMBERS // points, 24))
    pick = np.unique(np.linspace(0, len(slew.times) - 1, wanted).round().astype(int))
    origin, turn = outlines.frame(slew.positions[0])

    def drawn(factor: float) -> list[Drawn]:
        return [_placed(outlines.at(qpos), origin, turn) for qpos in slew.shown(factor)[pick]]

    rigid = drawn(0.0)
    plain = drawn(1.0)
    extent = float(np.ptp(rigid[0].points, axis=0).max())
    bends = np.array([_elastic(a, b) for a, b in zip(plain, rigid, strict=True)])
    factor = _factor(SWING * extent / max(float(bends.max()), 1e-300))
    frames = plain if factor == 1.0 else drawn(factor)
    axes = np.eye(3)[[[1, 2, 0], [0, 2, 1], [0, 1, 2]][slew.axis]]
    axes[2] *= -1.0 if slew.axis == 1 else 1.0
    view = View(axes)
    flat = view.flat(np.vstack([frame.points for frame in (*frames, *rigid)]))
    fit = _Fit(flat, WIDTH, 0.0, TALLEST)
    still = int(np.argmax(bends))
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
        "still": outline.shapes([frames[still]], ghost=rigid[still]),
        "moving": outline.shapes(frames, ghosts=rigid),
        "animate": f'dur="{seconds:.3g}s" {SMIL}',
        "swings": False,
    }
    chart = _chart(slew, outlines, pick, bends, fit.height + LINE * len(told) + GAP)
    caption = (
        f"A turn, simulated in MuJoCo and seen along its axis: torque on {slew.body}, forwards and "
        f"back. Elastic motion of the appendages is drawn {factor:g} times as large as it is; the "
        f"base as it moves. Dashed: appendages that stay straight. Still: "
        f"{slew.times[pick][still]:.3g} s, where they bend most." + _left_out(outlines)
    )
    svg = page_text(
        "replay.svg",
        label=f"A turn, moving: {panel['desc']}",
        width=WIDTH,
        height=chart["y"] + CHART + 2.0 * LINE,
        panels=[panel],
        picture=fit.height,
        line=LINE,
        triad=_triad(view),
        fine=FINE,
        chart={**chart, "seconds": seconds},
    )
    return Replay(svg, caption)


def _elastic(bent: Drawn, straight: Drawn) -> float:
    """The largest distance of an appendage from where it would be straight, as its root is."""
    pairs = zip(bent.middles, straight.middles, strict=True)
    return max(float(np.linalg.norm(a - b, axis=1).max()) for a, b in pairs)


def _factor(most: float) -> float:
    """The largest even factor up to another, 1 at least."""
    if most <= 1.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(most))
    return max(f * power for f in FACTORS if f * power <= most)


def _corner_count(outlines: Outlines) -> list[int]:
    return [
        *(ribbon.links.size + 6 for ribbon in outlines.ribbons),
        *(ROUGH for _ in outlines.solids),
    ]


def _chart(
    slew: Slew, outlines: Outlines, pick: Array, bends: Array, top: float
) -> dict[str, Any]:
    """Attitude of the base and elastic displacement over time, below the drawing."""
    _, start = outlines.frame(slew.positions[0])
    angles = []
    for qpos in slew.positions[pick]:
        turned = start.T @ outlines.frame(qpos)[1]
        i, j = (slew.axis + 1) % 3, (slew.axis + 2) % 3
        angles.append(math.degrees(math.atan2(turned[j, i], turned[i, i])))
    times = slew.times[pick]
    left, right = 44.0, WIDTH - 50.0
    x = left + (right - left) * times / times[-1]

    def line(values: Array) -> str:
        low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
        y = CHART * (1.0 - (values - low) / max(high - low, 1e-300))
        return "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))

    return {
        "y": top,
        "height": CHART,
        "left": left,
        "right": right,
        "angle": line(np.array(angles)),
        "bend": line(bends),
        "most_angle": f"{max(angles, key=abs):.3g}°",
        "most_bend": f"{float(bends.max()):.2g} m",
        "end": f"{times[-1]:.4g} s",
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
        self,
        frames: Sequence[Drawn],
        *,
        ghost: Drawn | None = None,
        ghosts: Sequence[Drawn] = (),
    ) -> list[dict[str, Any]]:
        """Paths, farthest first: `d` of the first frame, `values` of all."""
        lines = ghosts or ([] if ghost is None else [ghost])
        out: list[dict[str, Any]] = []
        for i in range(len(self._rest.arms)):
            arms = [self.fit(self.view.flat(frame.arms[i])) for frame in frames]
            out.append(_shape(arms, "arm", closed=False))
        for k in self._order:
            if k < len(self._rest.solids):
                out += self._solid(k, frames)
            else:
                out += self._ribbon(k - len(self._rest.solids), frames)
        for i in range(len(self._rest.middles)) if lines else ():
            # straight as they are, root and tip are enough
            ends = [self.fit(self.view.flat(line.middles[i][[0, -1]])) for line in lines]
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
                normal = self.view.axes @ (normal / np.linalg.norm(normal))
                if normal[2] > 1e-3:
                    sides = [self.fit(self.view.flat(f.solids[i][list(face)])) for f in frames]
                    out.append(_shape(sides, "solid", fill=_grey(normal)))
            return out
        flat = [self.view.flat(frame.solids[i]) for frame in frames]
        count = ROUGH if len(frames) > 2 else 2 * ROUGH
        angle = math.tau * (np.arange(count) + 0.5) / count
        ways = np.vstack([np.cos(angle), np.sin(angle)])
        # the corner that lies farthest in each direction: the same number in every frame
        if len(frames) > 2:
            hulls = [points[np.argmax(points @ ways, axis=0)] for points in flat]
        else:
            seen = np.argmax(self.view.flat(corners) @ ways, axis=0)
            hulls = [points[seen] for points in flat]
        return [_shape([self.fit(hull) for hull in hulls], "solid", fill=_grey(np.array([0.0, 0.0, 1.0])))]


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
    line = "".join(f"{a}{_signed(b)}{' ' if i < len(steps) - 1 else ''}" for i, (a, b) in enumerate(steps))
    return f"M{first[0]}{_signed(first[1])}l{line}{'z' if closed else ''}"


def _signed(value: int) -> str:
    return f"{value}" if value < 0 else f" {value}"


def _triad(view: View) -> list[dict[str, Any]]:
    """The base's axes, those that are seen."""
    out: list[dict[str, Any]] = []
    for name, axis in zip("xyz", view.axes.T, strict=True):
        if math.hypot(axis[0], axis[1]) > 0.15:
            out.append({"name": name, "x": 15.0 * axis[0], "y": -15.0 * axis[1]})
    return out


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
