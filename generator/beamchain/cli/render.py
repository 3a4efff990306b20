"""`beamchain render` and `beamchain view`: pictures and MuJoCo's viewer."""

import math
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.caution import warnings_record
from beamchain.cli.common import Folder, Force, Json, Quiet, console, explain
from beamchain.cli.output import print_warnings, tell
from beamchain.errors import EngineError, InputError

if TYPE_CHECKING:
    from beamchain.engine.library import mujoco
    from beamchain.engine.slew import Slew
    from beamchain.fitting.result import Fit

FRAMES, RATE = 108, 24.0  # four and a half seconds

Scene = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE.xml|SPEC.toml",
        help="A MuJoCo scene, or a specification, which is fitted first.",
        show_default=False,
    ),
]


def load(source: Path) -> "tuple[str, mujoco.MjModel, Fit | None]":
    """Name and model of a scene, or of the scene that a spec's fit writes, and that fit."""
    from beamchain.engine.linearise import compile_model

    if source.suffix.lower() == ".toml":
        from beamchain.fitting.fit import fit
        from beamchain.fitting.spec import read_spec

        found = fit(read_spec(source))
        return found.spec.name, compile_model(found.scene_mjcf()), found
    return source.stem, compile_model(source), None


def render(
    scene: Scene,
    output: Folder,
    exaggerate: Annotated[float, typer.Option(help="Factor on the elastic motion.")] = 1.0,
    angle: Annotated[float, typer.Option(metavar="DEG", help="Angle of the turn in degrees.")] = 40.0,
    width: Annotated[int, typer.Option(help="Width of the pictures in pixels.")] = 640,
    height: Annotated[int, typer.Option(help="Height of the pictures in pixels.")] = 400,
    want_mp4: Annotated[bool, typer.Option("--mp4/--no-mp4", help="Write an MP4 too; needs ffmpeg.")] = True,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Draw the turning spacecraft and its vibrating appendage: PNG, GIF, and MP4 if ffmpeg is installed.

    The hub turns from rest to rest in a time that excites its first mode.
    A rigid appendage is drawn faintly for comparison.
    Without ffmpeg there is no MP4, and the exit status is 3. Needs EGL or OSMesa, but no screen.

    Example: beamchain render boom.toml -o pictures

    Example: beamchain render boom/scene.xml -o pictures --exaggerate 5
    """
    sizes = (("width", width, 64, 4096), ("height", height, 64, 4096))
    for name, value, low, high in (("exaggerate", exaggerate, 0.0, 1e6), ("angle", angle, -360.0, 360.0), *sizes):
        if not low <= value <= high:
            raise InputError(f"render: --{name} = {value:g} is out of range; give a value from {low:g} to {high:g}.")
    from beamchain.engine import backend

    chosen = backend.choose()
    from beamchain.engine.slew import film, simulate
    from beamchain.files import write_files
    from beamchain.report import film as files

    name, model, fit = load(scene)
    slew = simulate(model, angle=math.radians(angle), frames=FRAMES)
    warnings = [] if fit is None else too_far(fit, slew)
    faster = slew.times[-1] / (FRAMES - 1) * RATE
    note = f"time x {faster:.3g}" + ("" if exaggerate == 1.0 else f", elastic motion x {exaggerate:g}")
    digits = 0 if slew.times[-1] >= 100 else 1
    drawn = film(model, slew, exaggerate=exaggerate, width=width, height=height)
    frames = [files.written(f, f"{t:.{digits}f} s   {note}") for t, f in zip(slew.times, drawn, strict=True)]
    out: dict[Path, str | bytes] = {
        output / f"{name}.png": files.png(frames[slew.loudest]),
        output / f"{name}.gif": files.gif(frames, RATE),
    }
    moving = files.mp4(frames, RATE) if want_mp4 else None
    if moving is not None:
        out[output / f"{name}.mp4"] = moving
    write_files(out, force=force)
    axis = "xyz"[slew.axis]
    turn = {"body": slew.body, "axis": axis, "angle": slew.angle, "seconds": slew.duration, "omega": slew.omega}
    record = {"files": list(map(str, out)), "renderer": chosen, "exaggerate": exaggerate, "slew": turn}

    def show() -> None:
        console().print(
            f"{slew.body} turned by {angle:g} degrees about {axis} in {slew.duration:.4g} s, ringing at "
            f"{slew.omega:.4g} rad/s; {note}"
        )
        print_warnings(warnings)

    tell(lambda: {**record, **warnings_record(warnings)}, show, out, as_json, quiet)
    if want_mp4 and moving is None:
        explain(
            f"no {name}.mp4 was made, as there is no ffmpeg on the PATH; install ffmpeg, or use the GIF and give --no-mp4."
        )
        raise typer.Exit(3)


def too_far(fit: "Fit", slew: "Slew") -> list[str]:
    """Sentences for a turn beyond what the fit's chain is right for."""
    from beamchain.steps.driven import exceeded, turned

    if fit.space is not None:
        return []
    return exceeded(fit.large_motion[0], turned(slew.rate, slew.acceleration, slew.axis, fit.hub.offset))


def view(scene: Scene, as_json: Json = False, quiet: Quiet = False) -> None:
    """Open MuJoCo's viewer on a scene, or on the fitted scene of a specification.

    Example: beamchain view boom/scene.xml
    """
    from beamchain.engine import backend

    if not backend.has_screen():
        raise EngineError(
            "view: there is no screen here (neither DISPLAY nor WAYLAND_DISPLAY is set); use beamchain render, which "
            "needs none."
        )
    _, model, _ = load(scene)
    try:
        viewer = import_module("mujoco.viewer")
    except ImportError as error:
        raise EngineError(f"view: MuJoCo's viewer cannot be loaded ({error}); use beamchain render instead.") from None
    viewer.launch(model)
