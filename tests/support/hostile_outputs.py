"""Outputs onto inputs and onto each other, and names that no file can have: calls made at random,
and what they may do."""

import os
import random
import shutil
from pathlib import Path

from beamchain.cli.shipped import examples
from command import COMMANDS
from spacecraft import CRAFTS, spec

#: what may be written where, `{}` is the place: by what a call reads,
#: which therefore must stay as it is
CALLS = (
    (["embed", "craft.xml", "--mount", "mount=rod.toml", "-o", "{}"], ("rod.toml",)),
    (["embed", "flexible.xml", "--remove", "-o", "{}"], ()),
    (["retime", "flexible.xml", "--timestep", "0.01", "-o", "{}"], ()),
    (
        ["plant", "flexible.xml", "--controller", "loops.json", "-o", "{}"],
        ("flexible.xml", "loops.json"),
    ),
    (
        [
            "identify",
            "log.csv",
            "--craft",
            "craft.xml",
            "--mount",
            "mount",
            "--prior",
            "rod.toml",
            "-o",
            "{}",
        ],
        ("log.csv", "craft.xml", "rod.toml"),
    ),
    (["fit", "rod.toml", "-o", "{}"], ("rod.toml",)),
    (["fit", "modal.toml", "-o", "{}"], ("modal.toml", "fit.json")),
    (
        [
            "sweep",
            "flexible.xml",
            "--uncertain",
            "bus.toml",
            "--samples",
            "2",
            "-o",
            "{}",
        ],
        ("flexible.xml", "bus.toml"),
    ),
    (["init", "boom", "-o", "{}"], ()),
)
PLACES = (
    "",
    ".",
    "..",
    "/",
    "//",
    "./",
    "folder",
    "folder/",
    "folder/..",
    "rod.toml",
    "./rod.toml",
    "folder/../craft.xml",
    "craft.xml",
    "flexible.xml",
    "flexible_report.html",
    "loops.json",
    "link",
    "hard",
    "dangling",
    "fit.json",
    "log.csv",
    "rod.toml/x",
    "new/out.xml",
    "out.xml",
    "out_report.html",
    "p.npz",
    "p_report.html",
    "link.npz",
    "x" * 300,
    "x" * 255,
    "a\udcff.xml",
    "\udc80",
    "/dev/null",
    "/dev/full",
    "/proc/x",
    "fifo",
    "-",
    "--",
    "-o",
    "~",
    "*",
    "a\nb.xml",
    "\u202e.xml",
    "$HOME",
    "[/red].xml",
    "CON",
    " ",
    "...",
)
MODES = (
    '{"mass": '
    "[[30,0,0,0,0,0],[0,30,0,0,0,120],[0,0,30,0,-120,0],"
    "[0,0,0,20,0,0],[0,0,-120,0,600,0],[0,120,0,0,0,600]], "
    '"frequencies": [1.3], "participation": [[0],[4],[0],[0],[0],[23]]}'
)
LOOPS = (
    '[[loop]]\ninput = "torque_z"\noutput = "attitude_z"\nnumerator = [60.0]\ndenominator = '
    "[0.05, 1.0]\n"
)


def prepare(folder: Path, flexible: bytes) -> None:
    """What the calls read, with links to some of it; `flexible`: a spacecraft with an appendage."""
    shutil.copy(CRAFTS / "planar.xml", folder / "craft.xml")
    shutil.copy(spec("rod"), folder / "rod.toml")
    (folder / "flexible.xml").write_bytes(flexible)
    (folder / "loops.json").write_text(LOOPS)
    (folder / "fit.json").write_text(MODES)
    (folder / "modal.toml").write_text('name = "array"\n[imported]\nfile = "fit.json"\n')
    (folder / "bus.toml").write_text("[body.bus]\nmass = { relative = 0.01 }\n")
    (folder / "log.csv").write_text(
        "time,torque_z,rate_z\n" + "".join(f"{i},0.1,0.0\n" for i in range(30))
    )
    (folder / "folder").mkdir()
    (folder / "link").symlink_to("rod.toml")
    (folder / "link.npz").symlink_to("loops.json")
    (folder / "hard").hardlink_to(folder / "craft.xml")
    (folder / "dangling").symlink_to("nowhere")
    os.mkfifo(folder / "fifo")
    shutil.copy(next(one.path for one in examples() if one.name == "boom"), folder / "boom.toml")


def random_call(rng: random.Random) -> tuple[list[str], tuple[str, ...], bool]:
    """A call with places in it, the files that it must leave alone,
    and whether it may replace others."""
    words, kept = rng.choice([one for one in CALLS if one[0][0] in COMMANDS])
    force = rng.random() < 0.7
    # what writes into a folder may write into any: not into that of the system
    places = [
        place for place in PLACES if words[0] not in ("fit", "sweep") or place not in ("/", "//")
    ]
    call = [rng.choice(places) if word == "{}" else word for word in words]
    return [*call, *(["--force"] if force else [])], kept, force


def state(folder: Path) -> dict[str, bytes | str]:
    """Everything in a folder: contents of files, targets of links, and what else there is."""
    out: dict[str, bytes | str] = {}
    for path in sorted(folder.rglob("*")):
        kind = str(path.relative_to(folder))
        out[kind] = (
            os.readlink(path)
            if path.is_symlink()
            else path.read_bytes()
            if path.is_file()
            else "no file"
        )
    return out
