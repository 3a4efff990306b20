"""Stated against true errors of random craft with damped drives: tests/craft/test_damped_drives.py,
for many craft.

Run: python tests/benchmarks/craft_promise.py [FIRST END], seeds 0 to 200 where left out.
"""

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from craft_truth import craft_error
from damped_crafts import embedded, random_craft

AGREE, ROUNDING, BEYOND = 0.05, 1e-8, 1.02


def main() -> None:
    first, end = (int(word) for word in (sys.argv[1:3] if len(sys.argv) == 3 else ("0", "200")))
    off = beyond = missed = 0
    worst = 0.0
    for seed in range(first, end):
        craft, band, tolerance, axes, angles = random_craft(seed)
        with tempfile.TemporaryDirectory() as folder:
            done, file = embedded(craft, angles, Path(folder))
            true, where = craft_error(craft, file, band, axes, angles)
        gap = abs(done.craft_error - true)
        worst = max(worst, gap / true if gap > ROUNDING else 0.0)
        off += gap > AGREE * true + ROUNDING
        beyond += bool(done.met) and true > BEYOND * tolerance
        missed += not done.met
        print(
            f"{seed}: stated {done.craft_error:.4e}, true {true:.4e} at {where:.5g} rad/s, "
            f"tolerance {tolerance:.2e}",
            flush=True,
        )
    print(
        f"{end - first} craft: {off} off by more than {AGREE:.0%} (worst {worst:.1e}), {beyond} "
        f"beyond the tolerance at exit 0, {missed} exit 3"
    )


main()
