"""How reports write numbers: plain text, which a terminal shows, and its typography on pages."""

import math
import re
from collections.abc import Callable, Iterable
from typing import Any

Format = Callable[[Any], str]

#: what the error of a study is called in its table and picture
STUDY_TITLE = "Error of the hub's motion as simulated"

ROUNDING = 1e-9  # damping ratio that computing alone makes

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_POWER_OF_TEN = re.compile(r"(?<![\w.])(-?\d(?:\.\d+)?)e([-+]\d+)(?!\w)")


def digits(count: int) -> Format:
    """The format with so many significant digits, and no minus before a zero."""

    def text(value: float) -> str:
        """A number with so many significant digits."""
        return f"{value + 0.0:.{count}g}"

    return text


number = digits(6)  #: frequencies, masses, lengths, stiffnesses


def whole(value: int) -> str:
    """A count, or the number of a mode."""
    return str(int(value))


def hundredths(value: float) -> str:
    """Two places after the point, as programs print percentages."""
    return f"{round(value, 2) + 0.0:.2f}"


def vector(values: Iterable[float]) -> str:
    """Five digits each."""
    return ", ".join(f"{value:.5g}" for value in values)


def short(value: float) -> str:
    """Three digits without an exponent where that reads well."""
    return f"{float(f'{value:.3g}'):.15g}" if 1e-4 <= abs(value) < 1e5 else f"{value:.3g}"


def damping_ratio(value: float) -> str:
    """Four digits; below 1e-9 it is rounding, and NaN is that of a step that is unstable."""
    if math.isnan(value):
        return "unstable"
    return "0" if abs(value) < ROUNDING else f"{value:.4g}"


def step_text(value: float) -> str:
    """A time step [s], or that there is no limit."""
    return "no limit" if math.isinf(value) else f"{value:.4g}"


def relative(value: float) -> str:
    """A relative error: three digits, a power of ten below 0.1."""
    if value == 0.0:
        return "0"
    return f"{value:.2e}" if not 0.09995 <= abs(value) < 100.0 else f"{value:.3g}"


def typeset(text: str) -> str:
    """A number or a sentence as pages show it: powers of ten as such, and no break before %."""
    return _POWER_OF_TEN.sub(
        lambda m: f"{m[1]}\u00a0×\u00a010{superscript(int(m[2]))}", text.replace(" %", "\u00a0%")
    )


def superscript(exponent: int) -> str:
    """An exponent as it stands above the line."""
    return str(exponent).translate(_SUPERSCRIPT)


def typeset_unit(unit: str) -> str:
    """A unit as pages show it, with its squares as such."""
    return unit.replace("^2", "²")


def error_text(value: float) -> str:
    """A relative error in a sentence of a page."""
    return typeset(relative(value))
