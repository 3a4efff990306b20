"""What surfaces that bend cost: `python tests/benchmarks/looks.py`, with MUJOCO_GL=egl or osmesa.

Per shipped example and look: the size of appendage.xml, the time to compile scene.xml, a step of it
and a frame of 640 x 400 pixels, the median of several; how far the skin misses a mode at most; then
the sizes of pages with their replays.
"""

import statistics
import tempfile
import time
from pathlib import Path

import msgspec
import mujoco
import numpy as np

import beamchain as bc
from beamchain.cli import shipped

EXAMPLES = ("array", "boom", "mast")
LOOKS = ("skin", "boxes", False)
FRAMES = 40
STEPS = 2000


def milliseconds(act, count):
    """Median time of a call [ms]."""
    act()
    times = []
    for _ in range(count):
        start = time.perf_counter()
        act()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def measured(text):
    """Compile [ms], step [us] and frame [ms] of a scene."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[:] = 1e-3 * np.ones(model.nv)
    compiled = milliseconds(lambda: mujoco.MjModel.from_xml_string(text), 10)
    step = 1e3 * milliseconds(lambda: mujoco.mj_step(model, data, STEPS), 5) / STEPS
    with mujoco.Renderer(model, 400, 640) as renderer:

        def frame():
            renderer.update_scene(data)
            renderer.render()

        return compiled, step, milliseconds(frame, FRAMES)


def main():
    print("example  look   vertices  file kB  compile ms  step us  frame ms  misses a mode by")
    for name in EXAMPLES:
        spec = bc.read_spec(shipped.pick(shipped.examples(), name, "example").path)
        for visuals in LOOKS:
            scene = msgspec.structs.replace(spec.scene or bc.Scene(), visuals=visuals)
            fit = bc.fit(spec, scene=scene)
            compiled, step, frame = measured(fit.scene_mjcf())
            worst = max((max(each) for each in fit.look.residual.values()), default=0.0)
            print(
                f"{name:8} {visuals or 'false':6} {fit.look.vertices:8} "
                f"{len(fit.to_mjcf()) / 1e3:8.1f} {compiled:11.2f} {step:8.2f} {frame:9.2f} "
                f"{worst:16.1e}"
            )
    pages()


def pages():
    """Sizes of the pages of the shipped examples' fits, of a satellite and of an arm."""
    examples = Path(shipped.pick(shipped.examples(), "array", "example").path).parent
    crafts = {
        "satellite": ("craft.xml", {"left": "array.toml", "right": "array.toml"}),
        "arm": ("arm.xml", {"shoulder": "upper.toml", "forearm": "fore.toml"}),
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for example in EXAMPLES:
            bc.fit(examples / f"{example}.toml").write(folder / example)
        for craft, (file, at) in crafts.items():
            embedded = bc.embed(examples / file, {k: examples / v for k, v in at.items()})
            page = embedded.report()
            (folder / f"{craft}.html").write_text(page, encoding="utf-8")
        for page in sorted(folder.rglob("*.html")):
            print(f"{page.stat().st_size / 1e3:8.0f} kB  {page.relative_to(folder)}")


if __name__ == "__main__":
    main()
