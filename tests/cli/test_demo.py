"""What `make demo` runs: it succeeds without a renderer, and says then what to install."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from beamchain.engine import backend

DEMO = Path(__file__).parents[2] / "docs" / "demo.py"
PAGES = ["report.html", "satellite_report.html", "satellite.xml"]
FILM = "satellite.gif"
pytestmark = pytest.mark.skipif(
    not DEMO.is_file(), reason="docs are not beside the tests (an installed wheel)"
)


def demo(folder, renderer):
    """What it prints, and the names of the files that it points to."""
    keep = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, str(DEMO), str(folder)],
        capture_output=True,
        text=True,
        check=False,
        env={**keep, "MUJOCO_GL": renderer},
    )
    assert done.returncode == 0, done.stderr
    said = done.stdout.splitlines()
    paths = [Path(line) for line in said if line.startswith(str(folder))]
    assert all(path.stat().st_size > 1000 for path in paths)
    return said, [path.name for path in paths]


@pytest.mark.slow
def test_demo_without_a_renderer_says_what_to_install(tmp_path):
    if backend._works("glfw"):
        pytest.skip("glfw draws here without a screen")
    said, made = demo(tmp_path, "glfw")
    assert made == PAGES
    (missing,) = [line for line in said if "no picture" in line]
    assert "apt-get install" in missing
    assert [line.split()[2] for line in said if line.startswith("$ ")] == ["fit", "embed"]
    assert (tmp_path / "appendage.xml").is_file()
    assert not (tmp_path / FILM).exists()


@pytest.mark.slow
def test_demo_ends_with_a_film(tmp_path):
    renderer = next((name for name in ("egl", "osmesa") if backend._works(name)), None)
    if renderer is None:
        pytest.skip("MuJoCo cannot draw on this machine")
    (tmp_path / FILM).write_text("of an earlier run")
    said, made = demo(tmp_path, renderer)
    assert made == [FILM, *PAGES]
    assert "no picture" not in "".join(said)
    with Image.open(tmp_path / FILM) as moving:
        assert moving.n_frames > 20
