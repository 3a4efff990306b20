"""Write the spacecraft of test_newton.py as MJCF and USD: `python tests/hosts/write_usd.py FOLDER`.

Run by run.py in an environment of its own: mujoco-usd-converter needs an older MuJoCo than Newton.
NAME.xml is what embed writes, NAME_newton.xml the same with one hinge per body where tendons pull,
by the function of docs/howto/simulators.md. NAME.usdc is made of that,
NAME_as_written.usdc of NAME.xml.
"""

import re
import sys
from pathlib import Path

import msgspec
import mujoco_usd_converter

import beamchain as bc

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "support"))

from spacecraft import APPENDAGES, CRAFTS  # noqa: E402

EXAMPLES = Path(bc.__file__).parent / "examples"
CRAFT = (EXAMPLES / "craft.xml").read_text()
STEP = 'integrator="implicitfast" timestep="0.05"'
TIMED = CRAFT.replace('integrator="Euler" timestep="0.01"', STEP)


def on_hinges(spec: bc.Spec) -> bc.Spec:
    """The specification with springs and dampers on its hinges, no tendons."""
    damping = msgspec.structs.replace(spec.damping, form="hinge")
    return msgspec.structs.replace(spec, fit=bc.spec.FitOptions(springs="hinges"), damping=damping)


def with_sensors(spec: bc.Spec) -> bc.Spec:
    """The specification with a sensor of every modal amplitude."""
    sensors = msgspec.structs.replace(spec.sensors, modes=True)
    return msgspec.structs.replace(spec, sensors=sensors)


#: name: spacecraft, site, appendage, whether it is timed for its step
CASES = {
    "array": (TIMED, "mount", bc.read_spec(EXAMPLES / "array.toml"), True),
    "untimed": (TIMED, "mount", bc.read_spec(EXAMPLES / "array.toml"), False),
    "euler": (
        TIMED.replace("implicitfast", "Euler"),
        "mount",
        bc.read_spec(EXAMPLES / "array.toml"),
        True,
    ),
    "mast": (TIMED, "mount", bc.read_spec(EXAMPLES / "mast.toml"), True),
    "drive": (
        (CRAFTS / "drive.xml").read_text(),
        "panel_mount",
        with_sensors(bc.read_spec(APPENDAGES / "array_left.toml")),
        False,
    ),
    "boom": (TIMED, "mount", on_hinges(bc.read_spec(EXAMPLES / "boom.toml")), False),
    "planar": (
        (CRAFTS / "planar.xml").read_text(),
        "mount",
        bc.read_spec(APPENDAGES / "rod.toml"),
        False,
    ),
}


def main(folder: Path) -> None:
    page = (ROOT / "docs" / "howto" / "simulators.md").read_text("utf-8")
    names: dict[str, object] = {}
    (block,) = re.findall(r"^```python\n(import xml.*?)^```", page, re.S | re.M)
    exec(block, names)
    folder.mkdir(parents=True, exist_ok=True)
    for name, (craft, site, spec, timed) in CASES.items():
        written = bc.embed(craft, {site: spec}, retime=timed).to_mjcf()
        (folder / f"{name}.xml").write_text(written)
        (folder / f"{name}_newton.xml").write_text(names["one_hinge_per_body"](written))
        for source, target in ((f"{name}_newton", name), (name, f"{name}_as_written")):
            converter = mujoco_usd_converter.Converter(layer_structure=False)
            made = converter.convert(str(folder / f"{source}.xml"), str(folder / target))
            Path(made.path).replace(folder / f"{target}.usdc")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
