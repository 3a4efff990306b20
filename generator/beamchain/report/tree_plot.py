"""A picture of a tree of appendages: which hangs where, what their ports carry, and the joints
between, at rest and at every keyframe."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from beamchain.craft.appendage import moved_bodies, names
from beamchain.engine.library import mujoco
from beamchain.engine.model_diff import ids_of
from beamchain.engine.mount import JOINT_KINDS
from beamchain.engine.operating_point import base_body, poses
from beamchain.ports.motions import Array
from beamchain.report.plots import BEAM, OURS, WIDTH, drawing, literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.craft.appendage import Appendage
    from beamchain.craft.embedded import Embedded

MOST = 4  # poses in the picture
FLAT = 0.15  # of the largest extent: a craft that is thinner is drawn from the side
HIGH = 4.6  # height of the highest panel [inch]
ROOM = 0.55  # above and below what is drawn, for names [inch]
COLOURS = (OURS, "#b3541e", "#2f7d4f", "#7a3f9d", "#8a6d00", "#00707a")
TEXT = 9.5  # points
MARKER = 6.0  # half a marker [points]
REACH = (9.0, 15.0, 22.0, 31.0, 42.0)  # of a name from what it names [points]
WAYS = 12  # round it
# from above the corner of the box, y to the right and z up
OBLIQUE = np.array([[-0.5, 0.866, 0.0], [-0.25, -0.433, 0.9]])


class _Line(NamedTuple):
    """An appendage at a pose: `points` `(k, 3)`, its root, its hinges and its end; `holder`: the
    body that its root is welded to."""

    appendage: "Appendage"
    points: Array
    holder: int


class _Scene(NamedTuple):
    """The spacecraft at a pose, in the axes of its base: appendages, and bodies by their numbers
    in the compiled model."""

    name: str
    lines: list[_Line]
    bodies: dict[int, Array]


@drawing()
def tree_figure(embedded: "Embedded") -> Figure:
    """The spacecraft at rest and at its keyframes, from the side or obliquely, a panel each."""
    model = embedded.model
    scenes = [_scene(embedded, name, qpos) for name, qpos in list(poses(model).items())[:MOST]]
    view, labels = _view(scenes)
    flat = [np.vstack([p @ view.T for p in _points(scene)]) for scene in scenes]
    low, high = (pick([pick(p, axis=0) for p in flat], axis=0) for pick in (np.min, np.max))
    width = float(np.max(high - low))
    margin = 0.07 * width
    highest = max(float(np.ptp(p[:, 1])) for p in flat)
    across = WIDTH - 0.9
    inches = min(
        across / (float(high[0] - low[0]) + 2.0 * margin), (HIGH - 2.0 * ROOM) / max(highest, 1e-9)
    )
    tall = [inches * float(np.ptp(p[:, 1])) + 2.0 * ROOM for p in flat]
    figure = Figure(figsize=(WIDTH, sum(tall) + 0.42 * len(tall) + 0.95))
    FigureCanvasAgg(figure)
    height = figure.get_figheight()
    grid = figure.add_gridspec(
        len(scenes),
        1,
        height_ratios=tall,
        left=0.075,
        right=0.985,
        top=1.0 - 0.28 / height,
        bottom=1.05 / height,
        hspace=0.42 * len(tall) / sum(tall),
    )
    for row, (scene, points) in enumerate(zip(scenes, flat, strict=True)):
        ax = figure.add_subplot(grid[row])
        middle = (points[:, 1].min() + points[:, 1].max()) / 2.0
        half = tall[row] / inches / 2.0
        ax.set(
            xlim=float(low[0] + high[0]) / 2.0 + across / inches / 2.0 * np.array([-1.0, 1.0]),
            ylim=(middle - half, middle + half),
            aspect="equal",
            title=literal("at rest" if scene.name == "rest" else f"keyframe {scene.name}"),
            ylabel=labels[1],
        )
        ax.tick_params(labelbottom=row == len(scenes) - 1)
        if view is OBLIQUE:
            _triad(ax)
        _draw(ax, embedded, scene, view)
    figure.axes[-1].set_xlabel(labels[0])
    handles, words = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, words, loc="lower center", ncols=2, handlelength=1.4, columnspacing=1.4)
    return figure


def _scene(embedded: "Embedded", name: str, qpos: Array) -> _Scene:
    model = embedded.model
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    base = base_body(model, model.body(f"{embedded.appendages[0].prefix}link1").id)
    turn = data.xmat[base].reshape(3, 3)
    origin = data.xpos[base].copy()
    lines: list[_Line] = []
    own: set[int] = set()
    for a in embedded.appendages:
        links = ids_of(model, names([a]))["body"]
        own |= set(links)
        last = links[-1]
        rest = a.fit.chain.length - a.fit.chain.links[-1].start
        end = data.xpos[last] + rest * data.xmat[last].reshape(3, 3)[:, 0]
        points = np.vstack([data.xpos[links], end[None]])
        holder = int(model.body_parentid[links[0]])
        lines.append(_Line(a, (points - origin) @ turn, holder))
    bodies = {i: (data.xpos[i] - origin) @ turn for i in range(1, model.nbody) if i not in own}
    return _Scene(name, lines, bodies)


def _points(scene: _Scene) -> list[Array]:
    return [*(line.points for line in scene.lines), np.array(list(scene.bodies.values()))]


def _view(scenes: Sequence[_Scene]) -> tuple[Array, tuple[str, str]]:
    """`(2, 3)` axes of the picture, and their names: along the thinnest axis of a flat craft."""
    points = np.vstack([p for scene in scenes for p in _points(scene)])
    extents = np.ptp(points, axis=0)
    thin = int(np.argmin(extents[::-1] > FLAT * extents.max()))
    thin = 2 - thin
    if extents[thin] > FLAT * extents.max():
        return OBLIQUE, ("seen obliquely", "")
    across = [axis for axis in range(3) if axis != thin]
    return np.eye(3)[across], (f"{'xyz'[across[0]]}, m", f"{'xyz'[across[1]]}, m")


def _triad(ax: "Axes") -> None:
    """The axes of the base, where the picture has others."""
    ax.set(xticks=[], yticks=[])
    inches: Any = ax.figure.dpi_scale_trans
    fractions: Any = ax.transAxes
    for axis, name in zip(OBLIQUE.T, "xyz", strict=True):
        foot = ScaledTranslation(26.0 / 72.0, -34.0 / 72.0, inches)
        line = Line2D(*(np.vstack([np.zeros(2), axis / 3.0]).T), color="#777777", linewidth=1.2)
        to_corner = ScaledTranslation(0.0, 1.0, fractions)
        line.set_transform(inches + foot + to_corner)
        ax.add_artist(line)
        ax.annotate(
            name,
            (0.0, 1.0),
            xycoords="axes fraction",
            xytext=tuple(34.0 * axis + np.array([26.0, -34.0])),
            textcoords="offset points",
            ha="center",
            va="center",
            color="#555555",
        )


def _draw(ax: "Axes", embedded: "Embedded", scene: _Scene, view: Array) -> None:
    model = embedded.model
    labels: list[tuple[Array, str, str]] = []
    crowd: list[Array] = []
    places = {a.at: a for a in embedded.appendages}
    for number, (a, points, holder) in enumerate(scene.lines):
        colour = COLOURS[number % len(COLOURS)]
        flat = points @ view.T
        if holder in scene.bodies:
            _thin_line(ax, scene.bodies[holder] @ view.T, flat[0])
        ax.plot(*flat.T, color=colour, linewidth=2.6, solid_capstyle="butt", zorder=2)
        hinges = flat[1:-1]
        label = "hinge lines of the chains" if number == 0 else None
        ax.plot(
            *hinges.T,
            linestyle="none",
            marker="o",
            markersize=3.6,
            markerfacecolor="white",
            markeredgecolor=BEAM,
            markeredgewidth=0.8,
            label=label,
            zorder=3,
        )
        name = a.spec.name if len(places) == len({x.spec.name for x in places.values()}) else ""
        text = f"{name} at {a.at}" if name else a.prefix.rstrip("_")
        labels.append(((flat[0] + flat[-1]) / 2.0, text, colour))
        crowd.append(_along(flat))
    carried = [int(model.body(name).id) for name in moved_bodies(embedded.appendages)]
    shown: set[str] = set()
    for body, place in scene.bodies.items():
        parent = int(model.body_parentid[body])
        flat = place @ view.T
        start = _foot(model, scene, body, parent)
        if start is not None:
            crowd.append(_thin_line(ax, start @ view.T, flat))
        kind = _kind(model, body, carried)
        if kind is None:
            continue
        marker, size, legend = kind
        ax.plot(
            *flat,
            linestyle="none",
            marker=marker,
            markersize=size,
            color="#444444" if marker == "s" else BEAM,
            markerfacecolor="#444444" if marker == "s" else "white",
            markeredgewidth=1.4,
            label=None if legend in shown else legend,
            zorder=4,
        )
        shown.add(legend)
        labels.append((flat, _words(model, body, carried), BEAM))
        crowd.append(flat[None])
    _write(ax, labels, np.vstack(crowd))


def _thin_line(ax: "Axes", start: Array, end: Array) -> Array:
    """A rigid distance; points along it."""
    line = np.vstack([start, end])
    ax.plot(*line.T, color="#777777", linewidth=1.2, zorder=1)
    return _along(line)


def _foot(model: "mujoco.MjModel", scene: _Scene, body: int, parent: int) -> Array | None:
    """Where a line to a body starts: at the body or the port that holds it."""
    if parent in scene.bodies:
        return scene.bodies[parent]
    ends = [line.points[-1] for line in scene.lines]
    place = scene.bodies[body]
    near = min(ends, key=lambda end: float(np.linalg.norm(end - place)))
    name = str(model.body(parent).name)
    return near if parent and name else None


def _kind(
    model: "mujoco.MjModel", body: int, carried: Sequence[int]
) -> tuple[str, float, str] | None:
    """Marker, size and what it stands for; None for a body that is not shown."""
    joints = model.jnt_type[model.jnt_bodyid == body].tolist()
    if int(model.body_parentid[body]) == 0 or 0 in joints:
        return "s", 13.0, "the spacecraft's base"
    if any(kind != 0 for kind in joints):
        return "o", 9.0, "body on a joint of the spacecraft"
    return (
        ("s", 7.0, "body welded where it hangs") if body in carried or _holds(model, body) else None
    )


def _holds(model: "mujoco.MjModel", body: int) -> bool:
    """Whether a body weighs as much as to be seen by itself."""
    return bool(model.body(body).name) and float(model.body_mass[body]) > 0.0


def _words(model: "mujoco.MjModel", body: int, carried: Sequence[int]) -> str:
    """Name of a body and the kind of its joint."""
    name = str(model.body(body).name) or f"body {body}"
    joints = np.flatnonzero(model.jnt_bodyid == body)
    if not joints.size:
        return f"{name}, welded" if body in carried else name
    kinds = [JOINT_KINDS[int(model.jnt_type[j])] for j in joints]
    if kinds == ["free"]:
        return f"{name}, free"
    joint = str(model.joint(int(joints[0])).name)
    if joints.size > 1:
        return f"{name}, {joints.size} joints"
    return f"{name}, {kinds[0]}" if joint in ("", name) else f"{name}, {kinds[0]} {joint}"


def _along(line: Array) -> Array:
    """Points along a line, close to each other."""
    share = np.linspace(0.0, 1.0, 25)[:, None]
    return np.vstack([a + share * (b - a) for a, b in zip(line[:-1], line[1:], strict=True)])


def _write(ax: "Axes", labels: Sequence[tuple[Array, str, str]], crowd: Array) -> None:
    """Names beside what they name, where they cover least of the lines and of each other."""
    figure = ax.figure
    assert isinstance(figure, Figure)
    figure.draw_without_rendering()  # so that places in points are known
    canvas: Any = figure.canvas
    renderer = canvas.get_renderer()
    scale = figure.dpi / 72.0
    lines = ax.transData.transform(crowd) / scale
    turn = 2.0 * np.pi * np.arange(12) / 12.0
    ring = MARKER * np.column_stack([np.cos(turn), np.sin(turn)])  # what markers cover
    marked = (
        ax.transData.transform([place for place, _, colour in labels if colour == BEAM]) / scale
    )
    lines = np.vstack([lines, *(place + ring for place in marked)])
    frame = ax.get_window_extent(renderer)
    box = np.array([frame.x0, frame.y0, frame.x1, frame.y1]) / scale
    taken: list[Array] = []
    for place, name, colour in labels:
        text = literal(name)
        probe = ax.text(0.0, 0.0, text, fontsize=TEXT)
        extent = probe.get_window_extent(renderer)
        probe.remove()
        size = np.array([1.08 * extent.width, 1.1 * extent.height]) / scale
        anchor = ax.transData.transform(place) / scale
        corner = _free_corner(anchor, size, lines, taken, box)
        taken.append(np.concatenate([corner, corner + size]))
        leader = _along(np.vstack([anchor, np.clip(anchor, corner, corner + size)]))
        far = float(np.linalg.norm(leader[-1] - anchor)) > 12.0
        lines = np.vstack([lines, leader]) if far else lines
        ax.annotate(
            text,
            (float(place[0]), float(place[1])),
            xytext=tuple(corner + size / 2.0 - anchor),
            textcoords="offset points",
            ha="center",
            va="center",
            color=colour,
            fontsize=TEXT,
            arrowprops={"arrowstyle": "-", "color": "#999999", "linewidth": 0.7, "shrinkB": 5.0}
            if far
            else None,
            zorder=5,
        )


def _free_corner(
    anchor: Array, size: Array, lines: Array, taken: Sequence[Array], frame: Array
) -> Array:
    """Lower left corner `(2,)` of a box near a point that covers least."""
    best, least = anchor, np.inf
    for reach in REACH:
        for angle in np.pi / 2.0 + 2.0 * np.pi * np.arange(WAYS) / WAYS:
            way = np.array([np.cos(angle), np.sin(angle)])
            # the near side of the box at `reach`
            low = anchor + way * (reach + np.abs(way) @ size / 2.0) - size / 2.0
            high = low + size
            inside = np.all((lines > low - 2.0) & (lines < high + 2.0), axis=1)
            covered = sum(
                float(np.prod(np.maximum(np.minimum(high, b[2:]) - np.maximum(low, b[:2]), 0.0)))
                for b in taken
            )
            out = float(
                np.sum(np.maximum(frame[:2] - low, 0.0) + np.maximum(high - frame[2:], 0.0))
            )
            leader = _along(np.vstack([anchor, np.clip(anchor, low, high)]))
            crossed = sum(
                int(np.any(np.all((leader > b[:2]) & (leader < b[2:]), axis=1))) for b in taken
            )
            cost = 20.0 * float(inside.sum()) + covered + 30.0 * out + 100.0 * crossed + reach
            if cost < least:
                best, least = low, cost
    return best
