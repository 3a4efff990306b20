"""Frames to files: PNG and GIF with Pillow (which matplotlib brings), MP4 where ffmpeg is there."""

import io
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.errors import EngineError

Frame = NDArray[np.uint8]

COLOURS = 96  # in a GIF


def png(frame: Frame) -> bytes:
    """One frame as PNG."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(frame).save(stream, format="PNG", optimize=True)
    return stream.getvalue()


def gif(frames: Sequence[Frame], rate: float) -> bytes:
    """All frames as a GIF that repeats for ever.

    Args:
        frames: `(height, width, 3)` each.
        rate: frames per second.
    """
    from PIL import Image

    pictures = [Image.fromarray(frame) for frame in frames]
    # one palette for all, from a strip of them: else colours flicker and nothing stays the same between frames
    strip = Image.fromarray(np.concatenate(frames[:: max(len(frames) // 8, 1)], axis=0))
    palette = strip.quantize(COLOURS)
    plain = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    stream = io.BytesIO()
    plain[0].save(
        stream, format="GIF", save_all=True, append_images=plain[1:], duration=round(1000.0 / rate), loop=0,
        optimize=True,
    )  # fmt: skip
    return stream.getvalue()


def mp4(frames: Sequence[Frame], rate: float) -> bytes | None:
    """All frames as H.264 in MP4; None where there is no ffmpeg.

    Raises:
        EngineError: ffmpeg refuses.
    """
    program = shutil.which("ffmpeg")
    if program is None:
        return None
    height, width = frames[0].shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "film.mp4"
        command = [
            program, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
            "-r", f"{rate:g}", "-i", "-", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p",
            "-movflags", "+faststart", str(place),
        ]  # fmt: skip
        done = subprocess.run(command, input=b"".join(f.tobytes() for f in frames), capture_output=True, check=False)
        if done.returncode != 0:
            raise EngineError(f"ffmpeg made no film: {done.stderr.decode(errors='replace').strip()[:200]}")
        return place.read_bytes()


def written(frame: Frame, text: str) -> Frame:
    """The frame with a line of text at its lower left."""
    from PIL import Image, ImageDraw, ImageFont

    picture = Image.fromarray(frame)
    size = max(frame.shape[0] // 26, 11)
    font: Any = ImageFont.load_default(size)
    ImageDraw.Draw(picture).text((size * 0.8, frame.shape[0] - size * 1.9), text, fill=(205, 212, 224), font=font)
    return np.asarray(picture)
