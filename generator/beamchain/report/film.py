"""Frames to files: PNG and GIF with Pillow (which matplotlib brings), MP4 with ffmpeg,
installed or from imageio-ffmpeg."""

import io
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from beamchain.errors import EngineError

Frame = NDArray[np.uint8]  # (height, width, 3)

COLOURS = 96  # in a GIF
DRAWN = 24  # in a drawing as WebP


def png(frame: Frame) -> bytes:
    """One frame as PNG."""
    return _encode(Image.fromarray(frame), format="PNG", optimize=True)


def gif(frames: Sequence[Frame], rate: float) -> bytes:
    """All frames, `rate` per second, as a GIF that repeats for ever."""
    # one palette for all, from a strip of them:
    # else colours flicker and nothing stays the same between frames
    palette = Image.fromarray(np.concatenate(frames[:: max(len(frames) // 8, 1)], axis=0)).quantize(
        COLOURS
    )
    first, *rest = [
        Image.fromarray(f).quantize(palette=palette, dither=Image.Dither.NONE) for f in frames
    ]
    each = round(1000.0 / rate)
    return _encode(
        first, format="GIF", save_all=True, append_images=rest, duration=each, loop=0, optimize=True
    )


def webp(drawings: Sequence[Image.Image], each: int) -> bytes:
    """Drawings, each shown for so many ms, as an animated WebP that repeats for ever: without loss
    but for the colours of the first one, as edges are then sharp and the file is small."""
    palette = drawings[0].quantize(DRAWN, Image.Quantize.MAXCOVERAGE)
    first, *rest = [
        drawing.quantize(palette=palette, dither=Image.Dither.NONE).convert("RGB")
        for drawing in drawings
    ]
    return _encode(
        first,
        format="WEBP",
        save_all=True,
        append_images=rest,
        duration=each,
        loop=0,
        lossless=True,
        method=1,
        quality=20,
        kmin=len(drawings),  # all but the first as what changes: in less time, and no larger
        kmax=len(drawings) + 1,
    )


def _encode(picture: Image.Image, **options: Any) -> bytes:
    stream = io.BytesIO()
    picture.save(stream, **options)
    return stream.getvalue()


def mp4(frames: Sequence[Frame], rate: float) -> bytes | None:
    """All frames as H.264 in MP4; None where there is no ffmpeg."""
    program = ffmpeg()
    if program is None:
        return None
    height, width = frames[0].shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "film.mp4"
        given = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {rate:g} -i -"
        made = "-vf pad=ceil(iw/2)*2:ceil(ih/2)*2 -pix_fmt yuv420p -movflags +faststart"
        command = [program, "-loglevel", "error", *given.split(), *made.split(), str(place)]
        pixels = b"".join(frame.tobytes() for frame in frames)
        try:
            done = subprocess.run(command, input=pixels, capture_output=True, check=False)
        except OSError as error:
            raise EngineError(f"{program} could not be run: {error.strerror}.") from None
        if done.returncode != 0:
            said = done.stderr.decode(errors="replace").strip()[:200]
            raise EngineError(f"{program} made no film: {said or 'it does not say why'}")
        return place.read_bytes()


def ffmpeg() -> str | None:
    """Path of ffmpeg, installed or of imageio-ffmpeg; None where there is none."""
    program = shutil.which("ffmpeg")
    if program is None and find_spec("imageio_ffmpeg") is not None:
        try:
            return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
        except RuntimeError:  # installed without its program
            return None
    return program


def write_text(frame: Frame, text: str) -> Frame:
    """The frame with a line of text at its lower left, small enough to be read to its end."""
    picture = Image.fromarray(frame)
    size = max(frame.shape[0] // 24, 14)
    font: Any = ImageFont.load_default(size)
    room = frame.shape[1] - 1.6 * size
    if (length := font.getlength(text)) > room:
        font = ImageFont.load_default(size * room / length)
    ImageDraw.Draw(picture).text(
        (size * 0.8, frame.shape[0] - size * 1.9), text, fill=(205, 212, 224), font=font
    )
    return np.asarray(picture)
