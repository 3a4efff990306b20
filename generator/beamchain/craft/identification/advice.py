"""What torque would determine what a log leaves open, as far as information grows with the square of the excitation."""

from collections.abc import Sequence

import numpy as np

from beamchain.ports.motions import Array


def advice(poles: Array, factors: Sequence[float], axes: Array, *, prior: bool) -> tuple[str, ...]:
    """Sentences on a further test.

    Args:
        poles: `(n,)` frequencies of the free craft [rad/s], of the modes in question.
        factors: by which each mode's intervals are too wide; 1 or less where they are good.
        axes: `(3, a)` that were driven.
        prior: whether there was one.
    """
    out = list[str]()
    for w, factor in zip(poles, factors, strict=True):
        if factor > 1.0:
            out.append(
                f"for the mode near {w:.4g} rad/s on the free craft: torque steps of {np.pi / w:.3g} s each "
                "way, half its period, keep "
                f"it swinging; at the excitation that this log has near it, {min(factor, 1e6):.3g} times the torque or "
                f"{min(factor**2, 1e12):.3g} times the duration would determine it."
            )
    quiet = [name for name, row in zip("xyz", axes, strict=True) if not np.any(np.abs(row) > 1e-9)]
    if quiet:
        out.append(
            f"torque about the mount's {' and '.join(quiet)}, with the rates about it, would determine the "
            "moments about it."
        )
    if not prior:
        out.append(
            "no torque determines participation in force while the craft floats freely: only a prior, a "
            "thruster's force, or a test with "
            "the root held does."
        )
    return tuple(out)
