"""Trigonometry of angles in degrees that gives the same bits on every machine.

C libraries and NumPy builds differ in the last bit of sin, cos and tan. These evaluate with 40 digits and round
once, so the result is the correctly rounded one.
"""

from functools import cache

import mpmath

_DIGITS = 40


@cache
def sin_degrees(angle: float) -> float:
    """Sine of an angle in degrees."""
    with mpmath.workdps(_DIGITS):
        return float(mpmath.sinpi(mpmath.mpf(angle) / 180))


@cache
def cos_degrees(angle: float) -> float:
    """Cosine of an angle in degrees."""
    with mpmath.workdps(_DIGITS):
        return float(mpmath.cospi(mpmath.mpf(angle) / 180))


@cache
def tan_degrees(angle: float) -> float:
    """Tangent of an angle in degrees."""
    with mpmath.workdps(_DIGITS):
        half_turns = mpmath.mpf(angle) / 180
        return float(mpmath.sinpi(half_turns) / mpmath.cospi(half_turns))
