"""Angles in degrees, as people write them and encoders count them, to the nearest double in radians and back."""

from __future__ import annotations

import math
from fractions import Fraction

_HALF_TURN = Fraction("3.14159265358979323846264338327950288419716939937510")


def radians_of(degrees: str) -> float:
    """Radians of an angle written in degrees as a decimal, rounded once.

    Multiplying doubles rounds twice, and leaves about one double in radians out of ten without any double in degrees; a
    decimal has as many digits as it takes.

    Raises
    ------
    ValueError
        The text is no finite number.
    """
    value = float(degrees)
    if not math.isfinite(value):
        raise ValueError(f"{degrees} is not finite")
    return exact_radians(Fraction(degrees)) if value else value


def exact_radians(degrees: Fraction) -> float:
    """Radians of an angle in degrees, rounded once."""
    return float(degrees * _HALF_TURN / 180)


def degrees_of(radians: float) -> str:
    """The shortest decimal in degrees that :func:`radians_of` turns into exactly ``radians``."""
    if not radians:
        return str(radians)
    exact = Fraction(radians) * 180 / _HALF_TURN
    exponent = math.floor(math.log10(abs(exact)))
    for digits in range(1, 40):
        places = digits - 1 - exponent
        scaled = round(exact * Fraction(10) ** places)
        text = _decimal(scaled, places)
        if radians_of(text) == radians:
            return text
    raise ValueError(f"{radians} has no decimal in degrees")


def _decimal(scaled: int, places: int) -> str:
    """``scaled / 10**places`` as a plain decimal with at least one place."""
    if places <= 0:
        return f"{scaled * 10**-places}.0"
    sign, text = "-" if scaled < 0 else "", str(abs(scaled)).rjust(places + 1, "0")
    return f"{sign}{text[:-places]}.{text[-places:]}"
