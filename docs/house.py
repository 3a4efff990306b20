"""Draw the folders and their imports for CONTRIBUTING, house.svg: part of make docs-pictures."""

import re
from collections import Counter
from pathlib import Path

import beamchain

SOURCE = Path(beamchain.__file__).parent
FOLDERS = {
    "ports": "pushes back",
    "structure": "what bends",
    "chain": "rigid links",
    "mjcf": "written",
    "engine": "simulated",
    "steps": "time steps",
    "fitting": "spec to chain",
    "craft": "spacecraft",
    "control": "plants",
    "variants": "drawn",
    "studies": "questions",
    "report": "looked at",
    "cli": "commands",
    "toolkit": "public names",
    "robust": "worst cases",
    "pointing": "jitter",
    "identification": "from logs",
    "worlds": "many",
}
WIDTH, GAP, HEIGHT, TOP = 92, 12, 62, 190
INK, PALE = "#1f3b57", "#6f8faf"


def arrows() -> Counter[tuple[str, str]]:
    """How many import lines lead from folder to folder."""
    found: Counter[tuple[str, str]] = Counter()
    for path in SOURCE.rglob("*.py"):
        here = path.relative_to(SOURCE).with_suffix("").parts[0]
        for name in re.findall(
            r"^\s*from beamchain\.(\w+)", path.read_text(encoding="utf-8"), re.M
        ):
            if here in FOLDERS and name in FOLDERS and here != name:
                found[here, name] += 1
    for name in re.findall(r"^from \.(\w+)", (SOURCE / "toolkit.pyi").read_text("utf-8"), re.M):
        found["toolkit", name] += 1
    return found


def sizes() -> Counter[str]:
    """Modules in each folder."""
    names = (path.relative_to(SOURCE).with_suffix("").parts for path in SOURCE.rglob("*.py"))
    return Counter(parts[0] for parts in names if parts[-1] != "__init__")


def draw() -> str:
    """The picture."""
    order = list(FOLDERS)
    count = sizes()
    middle = {name: 20 + i * (WIDTH + GAP) + WIDTH / 2 for i, name in enumerate(order)}
    width = 20 + len(order) * (WIDTH + GAP) - GAP + 20
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {TOP + 102}" role="img" '
        'font-family="sans-serif">',
        "<title>Folders of the package from left to right, and their imports</title>",
        f'<rect width="{width}" height="{TOP + 102}" fill="#ffffff"/>',
    ]
    for (here, there), lines in sorted(arrows().items(), key=lambda item: item[1]):
        a, b = middle[here], middle[there]
        rise = TOP - 14 - 12 * abs(order.index(here) - order.index(there)) * 1.35
        out.append(
            f'<path d="M{a} {TOP} C{a} {rise} {b} {rise} {b} {TOP}" fill="none" stroke="{PALE}" '
            f'stroke-width="{0.6 + 0.5 * lines**0.5:.1f}" stroke-opacity="0.55">'
            f"<title>{here} imports {there}: {lines} lines</title></path>"
        )
    for name, words in FOLDERS.items():
        x = middle[name] - WIDTH / 2
        modules = f"{count[name]} module{'s' if count[name] != 1 else ''}"
        out += [
            f'<rect x="{x}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" rx="5" fill="#eaf1f7" '
            f'stroke="{INK}"/>',
            *(
                f'<text x="{middle[name]}" y="{TOP + dy}" text-anchor="middle" font-size="{size}" '
                f'font-weight="{weight}" fill="{INK}">{text}</text>'
                for dy, size, weight, text in (
                    (20, 14, 700, name),
                    (37, 11, 400, words),
                    (53, 11, 400, modules),
                )
            ),
        ]
    out += [
        f'<text x="20" y="{TOP + 88}" font-size="11" fill="{INK}">Arcs: a folder imports what '
        "stands to "
        "its left; the thicker, "
        "the more. Below all: errors, checks, files.</text>",
        "</svg>",
    ]
    return "\n".join(out) + "\n"


if __name__ == "__main__":
    (Path(__file__).parent / "house.svg").write_text(draw(), encoding="utf-8")
