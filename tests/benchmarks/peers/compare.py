"""Peers beside our own models: the table, and the study's figure with the peers in it.

Run: python tests/benchmarks/peers/compare.py build/study/study.json build/peers/*.json
"""

import json
import math
import sys
from pathlib import Path

TARGETS = (1e-2, 1e-3, 1e-4)


def cheapest(points: list[dict], target: float, metric: str) -> dict | None:
    """The cheapest setting whose finer steps all meet the target too."""
    best: dict | None = None
    for key in {(p["n"], p["integrator"]) for p in points}:
        worst = 0.0
        for p in sorted(
            (p for p in points if (p["n"], p["integrator"]) == key), key=lambda p: p["timestep"]
        ):
            worst = max(worst, p[metric])
            if worst <= target and (best is None or p["seconds"] < best["seconds"]):
                best = p
    return best


def main(study: Path, files: list[Path]) -> None:
    record = json.loads(study.read_text())
    peers: dict[str, list[dict]] = {}
    for file in files:
        for point in json.loads(file.read_text()):
            peers.setdefault(f"{point['model']} ({point['note']})", []).append(point)
    reached = record["to_reach"]
    metric = "error"
    print("error as simulated; times for 60 s, and over ours")
    for target in TARGETS:
        ours = reached[f"1e{round(math.log10(target))}"]
        print(
            f"  {target:g}: {ours['model']} n={ours['n']} {ours['integrator']} "
            f"h={ours['timestep']:.4g}: {1e3 * ours['seconds']:.3f} ms"
        )
        for name, points in peers.items():
            best = cheapest(points, target, metric)
            said = (
                f"never, {min(p[metric] for p in points):.1e} at best"
                if best is None
                else f"n={best['n']} h={best['timestep']:.4g}: {1e3 * best['seconds']:.3f} ms, "
                f"{best['seconds'] / ours['seconds']:.2f} x"
            )
            print(f"      {name:45} {said}")
    figure(record, peers, files[0].parent / "error_against_run_time.svg")


def figure(record: dict, peers: dict[str, list[dict]], path: Path) -> None:
    """The points of study.json and of the peers in one picture."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({"font.size": 9.0, "svg.fonttype": "none"}):
        drawn = Figure(figsize=(7.2, 4.8), layout="constrained")
        peer_panel(drawn.add_subplot(), record["points"], peers, "error")
        drawn.axes[0].legend(fontsize=7.5)
        drawn.savefig(path)
    print(f"wrote {path}")


def peer_panel(ax, own: list[dict], peers: dict[str, list[dict]], metric: str) -> None:
    """Fronts of the points of study.json and of other simulators' points by name,
    in one set of axes."""
    from beamchain.report.study_plots import COLOURS, MARKS, STUDY_TITLE, WORST

    ax.set(
        xscale="log",
        yscale="log",
        title=STUDY_TITLE,
        ylabel="error / largest elastic motion",
        xlabel="time, ms",
    )
    ax.grid(which="major", color="#e6e6e6", linewidth=0.6)
    models = list(dict.fromkeys(str(p["model"]) for p in own))
    curves = [(m, [p for p in own if p["model"] == m]) for m in models] + list(peers.items())
    for i, (name, points) in enumerate(curves):
        lower: list[tuple[float, float]] = []
        for seconds, error in sorted(
            (1e3 * p["seconds"], p[metric]) for p in points if p[metric] < WORST
        ):
            if not lower or error < lower[-1][1]:
                lower.append((seconds, error))
        colour = COLOURS.get(name, "#9a9a9a" if name in models else "#a5641e")
        style = {"linestyle": "solid" if name in models else (0, (4, 2)), "markersize": 4.0}
        if lower:
            ax.plot(
                *zip(*lower, strict=True),
                color=colour,
                marker=MARKS[i % len(MARKS)],
                label=name,
                **style,
            )


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(word) for word in sys.argv[2:]])
