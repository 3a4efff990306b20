"""`beamchain render` and `beamchain view`: pictures and MuJoCo's viewer."""

import math
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamchain.caution import warnings_record
from beamchain.cli.common import Folder, Force, Json, Quiet, console, explain
from beamchain.cli.output import print_warnings, tell
from beamchain.errors import EngineError, InputError

if TYPE_CHECKING:
    from beamchain.engine.draw import Frame
    from beamchain.engine.library import mujoco
    from beamchain.engine.slew import Slew
    from beamchain.fitting.result import Fit

    Film = tuple[Frame, list[Frame]]  # a still, and all frames
    Told = tuple[list[str], dict[str, Any]]  # sentences, and facts for --json

FRAMES, CYCLE, RATE = 108, 48, 24.0  # of a turn: four and a half seconds; of a mode: two

Scene = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE.xml|SPEC.toml",
        help="A MuJoCo scene, or a specification, which is fitted first.",
    ),
]


def load(source: Path) -> "tuple[str, mujoco.MjModel, Fit | None]":
    """Name and model of a scene, or of the scene that a spec's fit writes, and that fit."""
    from beamchain.engine.draw import stage

    if source.suffix.lower() == ".toml":
        from beamchain.fitting.fit import fit
        from beamchain.fitting.spec import read_spec

        found = fit(read_spec(source))
        return found.spec.name, stage(found.scene_mjcf()), found
    return source.stem, stage(source), None


def render(
    scene: Scene,
    output: Folder,
    exaggerate: Annotated[float, typer.Option(help="Factor on the elastic motion.")] = 1.0,
    angle: Annotated[
        float, typer.Option(metavar="DEG", help="Angle of the turn in degrees.")
    ] = 40.0,
    joint: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Turn this hinge of the spacecraft in place of its hub."),
    ] = None,
    modes: Annotated[
        int, typer.Option(metavar="N", help="Draw the first N coupled modes in place of a turn.")
    ] = 0,
    width: Annotated[int, typer.Option(help="Width of the pictures in pixels.")] = 640,
    height: Annotated[int, typer.Option(help="Height of the pictures in pixels.")] = 400,
    want_mp4: Annotated[
        bool, typer.Option("--mp4/--no-mp4", help="Write an MP4 too; needs ffmpeg.")
    ] = True,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Draw the turning spacecraft and its vibrating appendage, or its modes: PNG, GIF,
    and MP4 if ffmpeg is installed.

    The hub turns from rest to rest in a time that excites its first mode.
    A rigid appendage is drawn faintly for comparison.
    With --joint a hinge without a spring turns in place of the hub, such as the elbow of an arm.
    With --modes each coupled mode of the whole spacecraft is a film of one oscillation, slow or
    fast as it may be. Without ffmpeg there is no MP4, and the exit status is 3. Needs EGL or
    OSMesa, but no screen.

    Example: beamchain render boom.toml -o pictures

    Example: beamchain render boom/scene.xml -o pictures --exaggerate 5

    Example: beamchain render boom/scene.xml -o pictures --modes 2

    Example: beamchain render flexible.xml -o pictures --joint elbow --angle 90
    """
    if joint is not None and modes:
        raise InputError("render: --joint and --modes are both given; leave one out.")
    sizes = (("width", width, 64, 4096), ("height", height, 64, 4096), ("modes", modes, 0, 100))
    for name, value, low, high in (
        ("exaggerate", exaggerate, 0.0, 1e6),
        ("angle", angle, -360.0, 360.0),
        *sizes,
    ):
        if not low <= value <= high:
            raise InputError(
                f"render: --{name} = {value:g} is out of range; give a value from {low:g} to "
                f"{high:g}."
            )
    from beamchain.engine import backend

    chosen = backend.choose()
    from beamchain.files import check_outputs, write_files
    from beamchain.report import film as files

    name, model, fit = load(scene)
    stems = [f"{name}_mode{k}" for k in range(1, modes + 1)] or [name]
    check_outputs([output / f"{stem}.png" for stem in stems], force=force)
    size = {"width": width, "height": height}
    if modes:
        films, told = _modes(model, name, modes, exaggerate, size)
        warnings: list[str] = []
    else:
        film, told, slew = _turn(model, math.radians(angle), joint, exaggerate, size)
        films = {name: film}
        warnings = [] if fit is None else too_far(fit, slew)
    out: dict[Path, str | bytes] = {}
    for stem, (still, frames) in films.items():
        out |= {
            output / f"{stem}.png": files.png(still),
            output / f"{stem}.gif": files.gif(frames[::2], RATE / 2.0),
        }
        if want_mp4 and (moving := files.mp4(frames, RATE)) is not None:
            out[output / f"{stem}.mp4"] = moving
    write_files(out, force=force)
    sentences, facts = told
    record = {"files": list(map(str, out)), "renderer": chosen, "exaggerate": exaggerate, **facts}

    def show() -> None:
        for sentence in sentences:
            console().print(sentence)
        print_warnings(warnings)

    tell(lambda: {**record, **warnings_record(warnings)}, show, out, as_json, quiet)
    if want_mp4 and len(out) < 3 * len(films):
        explain(
            f"no {next(iter(films))}.mp4 was made, as there is no ffmpeg; install ffmpeg, or pip "
            "install "
            '"beamchain[mp4]", or use the GIF and give --no-mp4.'
        )
        raise typer.Exit(3)


def _turn(
    model: "mujoco.MjModel",
    angle: float,
    joint: str | None,
    exaggerate: float,
    size: dict[str, int],
) -> "tuple[Film, Told, Slew]":
    """The film of a turn by `angle` [rad], of the hub or of a hinge."""
    from beamchain.engine.draw import draw_frames
    from beamchain.engine.slew import simulate
    from beamchain.report.film import write_text

    slew = simulate(model, angle=angle, frames=FRAMES, joint=joint)
    note = f"time x {slew.times[-1] / (FRAMES - 1) * RATE:.3g}"
    note += "" if exaggerate == 1.0 else f", elastic motion x {exaggerate:g}"
    digits = 0 if slew.times[-1] >= 100 else 1
    texts = [f"{t:.{digits}f} s   {note}" for t in slew.times]
    shown = slew.shown(exaggerate)
    rigid = slew.shown(0.0)
    k = slew.loudest
    frames = [
        write_text(*pair)
        for pair in zip(draw_frames(model, slew.body, shown, rigid, **size), texts, strict=True)
    ]
    still = write_text(
        next(draw_frames(model, slew.body, shown[[k]], rigid[[k]], **size)), texts[k]
    )
    axis = None if slew.joint else "xyz"[slew.axis]
    facts = {
        "body": slew.body,
        "joint": slew.joint or None,
        "axis": axis,
        "angle": slew.angle,
        "seconds": slew.duration,
        "omega": slew.omega,
    }
    sentence = (
        f"{slew.joint or slew.body} turned by {math.degrees(angle):g} degrees"
        f"{f' about {axis}' if axis else ''} in "
        f"{slew.duration:.4g} s, ringing at {slew.omega:.4g} rad/s; {note}"
    )
    return (still, frames), ([sentence], {"slew": facts}), slew


def _modes(
    model: "mujoco.MjModel", name: str, count: int, exaggerate: float, size: dict[str, int]
) -> "tuple[dict[str, Film], Told]":
    """A film per coupled mode, by the stem of its files."""
    from beamchain.craft.moving_modes import moving_modes
    from beamchain.engine.draw import draw_frames
    from beamchain.report.film import write_text

    films: dict[str, Film] = {}
    sentences: list[str] = []
    facts: list[dict[str, Any]] = []
    for k, mode in enumerate(moving_modes(model, count, CYCLE, exaggerate), 1):
        text = f"mode {k}, {mode.name}: {mode.omega:.4g} rad/s, {mode.omega / math.tau:.4g} Hz"
        rest = mode.rest[None].repeat(CYCLE, 0)
        frames = [
            write_text(frame, text)
            for frame in draw_frames(model, mode.body, mode.positions, rest, **size)
        ]
        films[f"{name}_mode{k}"] = frames[CYCLE // 4], frames
        sentences.append(text)
        facts.append({"name": mode.name, "omega": mode.omega, "hz": mode.omega / math.tau})
    return films, (sentences, {"modes": facts})


def too_far(fit: "Fit", slew: "Slew") -> list[str]:
    """Sentences for a turn beyond what the fit's chain is right for."""
    from beamchain.steps.driven import limit_sentences, run_of_turn

    if fit.space is not None:
        return []
    return limit_sentences(
        fit.large_motion[0], run_of_turn(slew.rate, slew.acceleration, slew.axis, fit.hub.offset)
    )


def view(scene: Scene, as_json: Json = False, quiet: Quiet = False) -> None:
    """Open MuJoCo's viewer on a scene, or on the fitted scene of a specification.

    Example: beamchain view boom/scene.xml
    """
    from beamchain.engine import backend

    if not backend.has_screen():
        raise EngineError(
            "view: there is no screen here (neither DISPLAY nor WAYLAND_DISPLAY is set); use "
            "beamchain render, which needs none."
        )
    _, model, _ = load(scene)
    try:
        viewer = import_module("mujoco.viewer")
    except ImportError as error:
        raise EngineError(
            f"view: MuJoCo's viewer cannot be loaded ({error}); use beamchain render instead."
        ) from None
    viewer.launch(model)
