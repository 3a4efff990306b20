"""`beamchain render`: pictures."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from beamchain.cli.common import (
    LONGEST,
    SHORTEST,
    Folder,
    Force,
    Torque,
    explain,
    read_commands,
)
from beamchain.cli.output import print_all, print_files, print_warnings
from beamchain.errors import EngineError, InputError

if TYPE_CHECKING:
    from beamchain.engine.library import mujoco
    from beamchain.fitting.result import Fit
    from beamchain.ports.motions import Array

# frames of a turn (at least), a run and an oscillation; how many a second; a GIF has every second
FRAMES, RUN, CYCLE, RATE = 108, 168, 48, 25.0
SKIP = 2

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
        float | None,
        typer.Option(
            metavar="DEG",
            help="Angle of the turn in degrees. Left out: the hub turns as on the page, within the "
            "torque of its actuators; a hinge turns by 20.",
        ),
    ] = None,
    joint: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Turn this hinge of the spacecraft in place of its hub."),
    ] = None,
    modes: Annotated[
        int, typer.Option(metavar="N", help="Draw the first N coupled modes in place of a turn.")
    ] = 0,
    run: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", help="Film a simulation of so many seconds in place of a turn."
        ),
    ] = None,
    torque: Torque = None,
    pose: Annotated[
        str | None,
        typer.Option(metavar="KEYFRAME", help="Where --run or --torque starts."),
    ] = None,
    latch: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HINGES",
            help="Hinges that latch at their stops in --run: names with * and ?, separated by "
            "commas. Given again: held until those before have latched.",
        ),
    ] = None,
    width: Annotated[int, typer.Option(help="Width of the pictures in pixels, 8:5.")] = 640,
    force: Force = False,
) -> None:
    """Draw the turning spacecraft and its vibrating appendage, or its modes: PNG, GIF,
    and MP4 if ffmpeg or `beamchain[mp4]` is installed.

    The hub turns from rest to rest in a time that excites its first mode.
    A rigid appendage is drawn faintly for comparison.
    With --joint a hinge without a spring turns in place of the hub, such as the elbow of an arm.
    With --modes each coupled mode of the whole spacecraft is a film of one oscillation.
    With --run the scene is simulated as it is, from the keyframe --pose, beside a faint picture of
    its start; --latch unfolds an array panel by panel. With --torque its actuators follow a history
    of your own, to its last time or as long as --run says, beside rigid appendages. A GIF of a turn
    or mode begins where the appendages bend furthest. Needs EGL or OSMesa, but no screen.

    Example: beamchain render boom.toml -o pictures

    Example: beamchain render boom/scene.xml -o pictures --exaggerate 5

    Example: beamchain render boom/scene.xml -o pictures --modes 2

    Example: beamchain render flexible.xml -o pictures --joint elbow --angle 90

    Example: beamchain render wing.xml -o pictures --run 20 --pose folded --latch "hinge1_*"

    Example: beamchain render flexible.xml -o pictures --torque wheels.csv
    """
    is_run = run is not None or torque is not None
    longer = "--run" if torque is None else "--torque"
    asked = {"--joint": joint is not None, "--modes": modes != 0, longer: is_run}
    both = [option for option, is_given in asked.items() if is_given]
    if len(both) > 1:
        raise InputError(f"render: {both[0]} and {both[1]} are both given; leave one out.")
    for option, is_given in (("--pose", pose is not None), ("--latch", bool(latch))):
        if is_given and not is_run:
            raise InputError(f"render: {option} is of a run; give --run or --torque too.")
    if angle is not None and (is_run or modes):
        raise InputError("render: --angle is of a turn; leave it out.")
    if is_run and torque is None and exaggerate != 1.0:
        raise InputError("render: --run is drawn to scale; leave --exaggerate out.")
    for name, value, low, high in (
        ("exaggerate", exaggerate, 0.0, 1e6),
        ("angle", 0.0 if angle is None else angle, -360.0, 360.0),
        ("run", 1.0 if run is None else run, SHORTEST, LONGEST),
        ("width", width, 64, 4096),
        ("modes", modes, 0, 100),
    ):
        if not low <= value <= high:
            raise InputError(
                f"render: --{name} = {value:g} is out of range; give a value from {low:g} to "
                f"{high:g}."
            )
    from beamchain.engine import backend

    backend.choose_renderer()
    from beamchain.files import check_outputs, write_files

    name, model, fit = load(scene)
    stems = [f"{name}_mode{k}" for k in range(1, modes + 1)] or [name]
    check_outputs([output / f"{stem}.png" for stem in stems], force=force)
    if modes:
        shots = _modes(model, modes, exaggerate)
    elif is_run:
        shots = [_run(model, run, pose, latch or [], torque, exaggerate)]
    else:
        turned = None if angle is None else math.radians(angle)
        shots = [_turn(model, turned, joint, exaggerate, fit)]
    out: dict[Path, str | bytes] = {}
    for stem, shot in zip(stems, shots, strict=True):
        for ending, content in _filmed(model, shot, width).items():
            out[output / f"{stem}.{ending}"] = content
    write_files(out, force=force)
    for shot in shots:
        print_all(*shot.sentences)
        print_warnings(shot.warnings)
    print_files(out)


class Shot(NamedTuple):
    """What is filmed: positions `(k, nq)` beside faint ones, each with a line of text; the number
    of the still and of what a GIF begins with; what the terminal and warnings say of it."""

    shown: "Array"
    ghosts: "Array"
    texts: Sequence[str]
    still: int
    first: int
    sentences: list[str]
    warnings: Sequence[str] = ()


def _filmed(model: "mujoco.MjModel", shot: Shot, width: int) -> dict[str, bytes]:
    """PNG, GIF and, where there is ffmpeg, MP4, by the endings of their files."""
    from beamchain.engine.displacement import spacecraft_body
    from beamchain.engine.draw import draw_frames
    from beamchain.report import film

    skip = 1 if film.ffmpeg() else SKIP
    drawn = [*range(0, len(shot.shown), skip), shot.still]
    shown, ghosts = shot.shown[drawn], shot.ghosts[drawn]
    body = spacecraft_body(model)
    frames = draw_frames(model, body, shown, ghosts, width=width, height=width * 5 // 8)
    told = [film.write_text(frame, shot.texts[k]) for frame, k in zip(frames, drawn, strict=True)]
    *moving, still = told
    few, first = moving[:: SKIP // skip], shot.first // SKIP
    made = {"png": film.png(still), "gif": film.gif(few[first:] + few[:first], RATE / SKIP)}
    try:
        mp4 = film.mp4(moving, RATE)
    except EngineError as error:
        explain(f"no MP4: {error}")
        return made
    return made if mp4 is None else {**made, "mp4": mp4}


def _rate(seconds: float, frames: int) -> str:
    """How fast a film of so many frames shows what takes so long."""
    return f"time x {seconds / (frames - 1) * RATE:.2g}"


def _scale(exaggerate: float) -> str:
    return "to scale" if exaggerate == 1.0 else f"x {exaggerate:g}"


def _clock(times: "Array", note: str) -> list[str]:
    """The time and a note, for every frame."""
    digits = 0 if times[-1] >= 100 else 1
    return [f"{t:.{digits}f} s   {note}" for t in times]


def _turn(
    model: "mujoco.MjModel",
    angle: float | None,
    joint: str | None,
    exaggerate: float,
    fit: "Fit | None",
) -> Shot:
    """A turn by `angle` [rad], of the hub or of a hinge; None: the chosen turn."""
    from beamchain.engine.slew import simulate
    from beamchain.report.replay import turn_limits
    from beamchain.steps.retime import without_timing

    plain = without_timing(model)
    slew = simulate(model, angle=angle, frames=FRAMES, joint=joint, untimed=plain)
    note = f"{_rate(slew.times[-1], len(slew.times))}, bending {_scale(exaggerate)}"
    axis = None if slew.joint else "xyz"[slew.axis]
    sentence = (
        f"{slew.joint or slew.body} turned by {math.degrees(slew.angle):.4g} degrees"
        f"{f' about {axis}' if axis else ''} in "
        f"{slew.duration:.4g} s, ringing at {slew.omega:.4g} rad/s; {note}"
    )
    roots = {} if fit is None or slew.joint else {f"{fit.spec.name}_link1": fit}
    limits = turn_limits(model, slew, roots)
    texts = _clock(slew.times, note)
    shown, rigid = slew.shown(exaggerate), slew.shown(0.0)
    return Shot(shown, rigid, texts, slew.loudest, slew.loudest, [sentence], limits)


def _run(
    model: "mujoco.MjModel",
    seconds: float | None,
    key: str | None,
    latch: list[str],
    torque: Path | None,
    exaggerate: float,
) -> Shot:
    """A simulated run, beside its start or rigid appendages."""
    from beamchain.steps.deployment import hinge_stages, simulate_run

    given = None if torque is None else read_commands(model, torque, seconds)
    if seconds is None:
        assert given is not None
        seconds = float(given.times[-1])
    done = simulate_run(model, key, seconds, RUN, hinge_stages(model, latch), given)
    note = f"{_rate(seconds, RUN)}, {_scale(exaggerate)}"
    shown, ghosts = done.positions, done.start
    if given is not None:
        shown, ghosts = done.rigid + exaggerate * (done.positions - done.rigid), done.rigid
    begin = "the pose of the file" if key is None else f"keyframe {key!r}"
    under = "" if given is None else f" under commands of {', '.join(given.actuators)}"
    told = [f"simulated for {seconds:g} s from {begin}{under}; {note}"]
    told += [f"{one.joint} latched at {one.time:.3f} s" for one in done.latched]
    late = f"{', '.join(done.waiting)} had not latched after {seconds:g} s; give a longer --run."
    warnings = [late] if done.waiting else []
    texts = _clock(done.times, note)
    return Shot(shown, ghosts, texts, RUN // 2, 0, told, warnings)


def _modes(model: "mujoco.MjModel", count: int, exaggerate: float) -> list[Shot]:
    """An oscillation of each coupled mode."""
    from beamchain.craft.moving_modes import moving_modes

    shots: list[Shot] = []
    for k, mode in enumerate(moving_modes(model, count, CYCLE, exaggerate), 1):
        text = f"mode {k}, {mode.name}: "
        hz = mode.omega / math.tau
        period = math.tau / mode.omega
        note = f"{_rate(period * (CYCLE - 1) / CYCLE, CYCLE)}, moves {mode.swing:.2g} m at most"
        rest = mode.rest[None].repeat(CYCLE, 0)
        texts = [f"{text}{hz:.4g} Hz   {note}"] * CYCLE
        told = [f"{text}{mode.omega:.4g} rad/s, {hz:.4g} Hz; {note}"]
        still = CYCLE // 4
        shots.append(Shot(mode.positions, rest, texts, still, still, told))
    return shots
