"""Sliders that ride in one another: one mass serves up to three modes with perpendicular directions."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beamchain.motion import Array

SAME_MASS = 1e-9  # relative: two sliders that heavy move one body


class Slide(NamedTuple):
    """A mode as a point mass on a slide.

    Args:
        mode: number.
        omega: [rad/s].
        ratio: damping ratio.
        mass: that must move along `axis` [kg].
        axis: `(3,)` unit vector.
        at: `(3,)` from the mass centre; along the axis it is free [m].
    """

    mode: int
    omega: float
    ratio: float
    mass: float
    axis: Array
    at: Array


Stack = list[Slide]


def place(stack: Sequence[Slide], reach: float) -> list[tuple[float, Array]] | None:
    """Own mass and place of every slider of a stack, outermost first; None where they do not fit.

    What slides with the outer one, inner ones included, must have the outer one's mass and stand, in the two directions
    across its axis, where the outer one wants it.

    Args:
        stack: outermost first, masses falling, axes perpendicular.
        reach: how far from the mass centre a body may stand [m].
    """
    inner_mass, inner_at = 0.0, np.zeros(3)
    out: list[tuple[float, Array]] = []
    for i in range(len(stack) - 1, -1, -1):
        slide = stack[i]
        at = slide.at.copy()
        if i > 0:  # stand where the next outer one wants the whole, along this one's own axis
            at = at + slide.axis * float(slide.axis @ (stack[i - 1].at - at))
        own = slide.mass - inner_mass
        if inner_mass == 0.0:
            where = at
        elif own <= SAME_MASS * slide.mass:
            gap = inner_at - at
            gap = gap - slide.axis * float(slide.axis @ gap)
            if float(np.linalg.norm(gap)) > SAME_MASS * reach or own < -SAME_MASS * slide.mass:
                return None
            out.append((0.0, at))
            inner_mass, inner_at = slide.mass, inner_at
            continue
        else:
            across = (slide.mass * at - inner_mass * inner_at) / own
            where = across + slide.axis * float(slide.axis @ (inner_at - across))
            if float(np.linalg.norm(where)) > reach:
                return None
        out.append((own, where))
        total = own + inner_mass
        inner_at = (own * where + inner_mass * inner_at) / total
        inner_mass = total
    return out[::-1]


def stacked(slides: Sequence[Slide], precision: float, reach: float) -> list[Stack]:
    """Sliders gathered into stacks, heaviest first: each joins the stack that keeps its bodies nearest to the centre.

    Args:
        slides: all of them.
        precision: how far from perpendicular two axes may be.
        reach: see `place`.
    """
    out: list[Stack] = []
    for slide in sorted(slides, key=lambda s: -s.mass):
        best: tuple[float, int] | None = None
        for i, stack in enumerate(out):
            if any(abs(float(slide.axis @ other.axis)) > max(precision, 1e-12) for other in stack):
                continue
            fitted = place([*stack, slide], reach)
            if fitted is None:
                continue
            far = sum(mass * float(at @ at) for mass, at in fitted) - sum(
                m * float(a @ a) for m, a in place(stack, reach) or []
            )
            if best is None or far < best[0]:
                best = far, i
        if best is None:
            out.append([slide])
        else:
            out[best[1]].append(slide)
    return out
