"""Stated against true errors at the step, of random craft: tests/steps/test_time_error.py,
for many craft.

Run: python tests/benchmarks/stepped_craft.py [FIRST END], seeds 0 to 40 where left out.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import numpy as np

import stepped

AGREE, POLES, RESPONSE, STEPS, GROWTH = 0.1, 2e-7, 2e-5, 20_000, 3.0


def main() -> None:
    first, end = (int(word) for word in (sys.argv[1:3] if len(sys.argv) == 3 else ("0", "40")))
    off = grown = 0
    for seed in range(first, end):
        drawn = stepped.draw(seed)
        made = stepped.embedded(drawn, retime=True)
        poles, _ = stepped.time_error(made.model, made.untimed, drawn.band)
        response, _ = stepped.sampled_error(drawn, made.model)
        stated = made.time_error.error, made.sampled_error
        apart = (
            abs(stated[0] - poles) > AGREE * poles + POLES,
            abs(stated[1] - response) > AGREE * response + RESPONSE,
        )
        z = np.linalg.eigvals(stepped.stepped(made.model)[0])
        largest = float(np.max(np.abs(z[np.abs(z - 1.0) > 1e-4]), initial=0.0))
        growth = stepped.grows(made.model, STEPS)
        off += any(apart)
        grown += growth > GROWTH
        print(
            f"{seed}: {drawn.integrator} {drawn.step:.3g} s: poles {stated[0]:.3e} ({poles:.3e}), "
            f"response {stated[1]:.3e} ({response:.3e}), |z| - 1 = {largest - 1.0:.1e}, grows "
            f"{growth:.2f} times {'OFF' if any(apart) else ''}",
            flush=True,
        )
    print(
        f"{end - first} craft: {off} off by more than {AGREE:.0%}, {grown} grew within {STEPS} "
        "steps"
    )


if __name__ == "__main__":
    main()
