"""Names that users may give to bodies, sites, joints, actuators, sensors and keyframes,
and a spacecraft that bears one."""

import random
import unicodedata
from pathlib import Path
from xml.sax.saxutils import quoteattr

from spacecraft import spec

#: what each of them once broke, or could: a terminal's markup, control's signals, formulas, fonts,
#: pages, terminals
NAMES = {
    "markup closed": "[/red]",
    "markup open": "[bold red]x[/]",
    "markup escaped": "\\[/red]\\",
    "emoji code": "a:bug:b",
    "a point": "wheel.1",
    "points": "..a..b.",
    "formula": r"$\frac{1}{0}$",
    "half a formula": "$",
    "formula escaped": r"\$x\$ $$",
    "formats": "%s %n {0} {x!r} %(a)s",
    "very long": "x" * 5000,
    "long words": "of a spacecraft " * 60,
    "Chinese": "帆板驱动机构",
    "emoji": "\U0001f6f0\ufe0f",
    "right to left": "\u0645\u0631\u062d\u0628\u0627 \u05e9\u05dc\u05d5\u05dd",
    "turned round": "a\u202ecba\u202c",
    "unseen": "a\u200bb\u00adc\ufeff",
    "combining": "e\u0301\u0327" * 30,
    "control characters": "\x85\x9b31m\x7f",
    "line ends": "a\nb\r\nbeamchain: all is well\u2028c",
    "page": "<b>&amp;</b><script>alert(1)</script>",
    "quotes": "\"'`",
    "signs": "-a-b+c*d",
    "slice": "a[0:2]",
    "path": "../../x/y",
    "spaces": "  a  b ",
    "private": "\ue000\U0010fffd",
}
ALPHABET = (
    "[",
    "]",
    "/",
    "\\",
    "$",
    ".",
    ":",
    "{",
    "}",
    "%",
    "<",
    ">",
    "&",
    "_",
    "^",
    "~",
    "#",
    '"',
    "'",
    "=",
    " ",
    "\t",
    "a",
    "B",
    "7",
    "é",
    "中",
    "ש",
    "م",
    "\U0001f680",
    "\u202e",
    "\u200d",
    "\x85",
    "\u0301",
    "\ue000",
    "-",
    ",",
)


def random_name(rng: random.Random) -> str:
    """A name out of the alphabet of trouble, sometimes of any letters at all."""
    letters = list(ALPHABET)
    if rng.random() < 0.3:
        letters = [
            chr(rng.choice((rng.randrange(32, 0x3000), rng.randrange(0xE000, 0xFFFD))))
            for _ in range(12)
        ]
    count = rng.choice((1, 3, 10, 60, 1000))
    return "".join(rng.choice(letters) for _ in range(count))


def craft_text(name: str) -> str:
    """A spacecraft whose bus, mounting site, drive, wheel, motor,
    gyro and keyframe all bear the name."""

    def called(what: str = "name") -> str:
        spelt = quoteattr(name, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})
        return f"{what}={spelt}"

    return f"""<mujoco model={quoteattr(name)}>
  <option gravity="0 0 0" integrator="implicitfast" timestep="0.01"/>
  <worldbody>
    <body {called()}>
      <freejoint/>
      <inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/>
      <site {called()} pos="0.6 0 0"/>
      <body name="wheel" pos="0 0 -0.2">
        <inertial pos="0 0 0" mass="5" diaginertia="0.02 0.02 0.04"/>
        <joint {called()} axis="0 0 1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor {called()} {called("joint")}/></actuator>
  <sensor><gyro {called()} {called("site")}/></sensor>
  <keyframe><key {called()} qpos="0 0 0 1 0 0 0 0"/></keyframe>
</mujoco>
"""


def toml_text(name: str) -> str:
    """A name as a TOML string."""
    spelt = (c if c.isalnum() or c in " ._-" else f"\\U{ord(c):08x}" for c in name)
    return '"' + "".join(spelt) + '"'


def write_files(folder: Path, name: str) -> None:
    """The spacecraft with the name, an appendage for it, a controller, and what is uncertain."""
    (folder / "craft.xml").write_text(craft_text(name), encoding="utf-8", newline="")
    (folder / "rod.toml").write_bytes(spec("rod").read_bytes())
    loop = (
        f'[[loop]]\ninput = {toml_text(name)}\noutput = "attitude_z"\nnumerator = '
        "[-60.0]\ndenominator = [0.05, 1.0]\n"
    )
    (folder / "loops.toml").write_text(loop, encoding="utf-8")
    (folder / "uncertain.toml").write_text(
        f"[body.{toml_text(name)}]\nmass = {{ relative = 0.01 }}\n", encoding="utf-8"
    )


def commands(name: str) -> list[list[str]]:
    """Calls that read these files and show the name,
    in an order in which each finds what it reads."""
    both = ["--from", name, "--to", name, "--to", "attitude"]
    return [
        [
            "embed",
            "craft.xml",
            "--mount",
            f"site:{name}=rod.toml",
            "-o",
            "flexible.xml",
            "--full",
        ],
        ["inspect", "flexible.xml"],
        ["plant", "flexible.xml", *both, "--controller", "loops.toml", "-o", "plant.mat"],
        ["plant", "flexible.xml", *both, "--pose", name, "-o", "pose.npz"],
        [
            "sweep",
            "flexible.xml",
            "--uncertain",
            "uncertain.toml",
            "--gain",
            f"{name}=attitude",
            "--samples",
            "6",
            "-o",
            "variants",
        ],
        ["inspect", "flexible.xml", "--steps", "-o", "steps"],
    ]


def unseen(text: str) -> list[str]:
    """Characters that a terminal or page would act upon,
    with a text's own line ends and tabs left out."""
    return [
        c
        for c in text
        if c not in "\n\t" and unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")
    ]
