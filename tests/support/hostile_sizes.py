"""Spacecraft that ask for too much by a number, or lead to themselves: files by name,
and the word of the answer."""

import random

PLACE = (
    '<body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="90 90 '
    '90"/><site name="mount"/>{}</body>'
)


def craft(before: str = "", inside: str = "", behind: str = "") -> str:
    """MJCF text of a free body with a place for an appendage."""
    return f"<mujoco>{before}<worldbody>{PLACE.format(inside)}{behind}</worldbody></mujoco>"


def replicated(*counts: int) -> str:
    """Bodies in nested replications."""
    inside = '<body><geom size="0.1"/></body>'
    for count in counts:
        inside = f'<replicate count="{count}" offset="1 0 0">{inside}</replicate>'
    return craft(behind=inside)


def soft(count: str, dimension: int) -> str:
    """A soft grid."""
    return craft(
        inside=f'<body name="holder"><flexcomp name="soft" type="grid" count="{count}" '
        f'dim="{dimension}"/></body>'
    )


def attaching(file: str, body: str = "bus") -> str:
    """A craft that attaches a file."""
    asset = f'<asset><model name="other" file="{file}"/></asset>'
    return craft(asset, f'<frame><attach model="other" body="{body}" prefix="x_"/></frame>')


def doubling(files: int) -> dict[str, str]:
    """Files of which each attaches the next one twice: two to their number of bodies."""
    out = {}
    for i in range(files):
        asset = f'<asset><model name="other" file="part{i + 1}.xml"/></asset>'
        twice = "".join(
            f'<frame><attach model="other" body="bus" prefix="{p}"/></frame>' for p in ("a_", "b_")
        )
        out["craft.xml" if i == 0 else f"part{i}.xml"] = craft(asset, twice)
    return {**out, f"part{files}.xml": craft()}


SIZES: dict[str, tuple[dict[str, str], str]] = {
    "keyframes": ({"craft.xml": craft('<size nkey="1000000000"/>')}, "nkey"),
    "memory": ({"craft.xml": craft('<size memory="100G"/>')}, "memory"),
    "user data": ({"craft.xml": craft('<size nuserdata="1000000000"/>')}, "nuserdata"),
    "user data of bodies": ({"craft.xml": craft('<size nuser_body="100000000"/>')}, "nuser_body"),
    "contacts": ({"craft.xml": craft('<size nconmax="1000000000"/>')}, "nconmax"),
    "replicated": ({"craft.xml": replicated(100_000)}, "copies by <replicate>"),
    "replicated again": ({"craft.xml": replicated(100, 100, 100)}, "copies by <replicate>"),
    "a soft body": ({"craft.xml": soft("100 100 100", 3)}, "points of soft bodies"),
    "a soft sheet": ({"craft.xml": soft("1000 1000 1", 2)}, "points of soft bodies"),
    "a height field": (
        {
            "craft.xml": craft(
                '<asset><hfield name="h" nrow="20000" ncol="20000" size="1 1 1 1"/></asset>'
            )
        },
        "height fields",
    ),
    "a texture": (
        {
            "craft.xml": craft(
                '<asset><texture name="t" type="2d" builtin="flat" width="40000" '
                'height="40000"/></asset>'
            )
        },
        "pixels of textures",
    ),
    "a cube of textures": (
        {
            "craft.xml": craft(
                '<asset><texture name="t" type="cube" builtin="flat" width="8000"/></asset>'
            )
        },
        "pixels of textures",
    ),
    "attaches itself": ({"craft.xml": attaching("craft.xml")}, "cycle"),
    "a ring of attached files": (
        {
            "craft.xml": attaching("b.xml"),
            "b.xml": attaching("c.xml"),
            "c.xml": attaching("craft.xml"),
        },
        "cycle",
    ),
    "a ring behind an included file": (
        {"craft.xml": craft('<include file="b.xml"/>'), "b.xml": attaching("craft.xml")},
        "cycle",
    ),
    "includes itself": ({"craft.xml": craft('<include file="craft.xml"/>')}, "cycle"),
    "doubled by every file": (doubling(30), "elements"),
}


def random_sizes(seed: int) -> str:
    """A craft that asks for some size between little and far too much."""
    rng = random.Random(seed)
    count = int(10.0 ** rng.uniform(0.0, 9.0))
    kinds = (
        lambda: craft(
            "<size "
            f'{rng.choice(("nkey", "nuserdata", "nconmax", "njmax", "nuser_geom"))}="{count}"/>'
        ),
        lambda: craft(f'<size memory="{count}{rng.choice(("", "K", "M", "G", "T"))}"/>'),
        lambda: replicated(*[max(int(count ** (1.0 / 3.0)), 1)] * rng.randint(1, 3)),
        lambda: craft(f'<asset><hfield name="h" nrow="{count}" ncol="2" size="1 1 1 1"/></asset>'),
    )
    return rng.choice(kinds)()
