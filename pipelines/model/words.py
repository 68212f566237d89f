"""Numbers and titles within a sentence."""

from __future__ import annotations

import numpy as np

__all__ = ["plain_number", "within"]

_PERSONS = ("Coulomb", "Stribeck")


def plain_number(value: float, digits: int = 2) -> str:
    """`value` with that many significant digits and no power of ten: 120, 0.00021."""
    rounded = float(f"{value:.{digits - 1}e}")
    return np.format_float_positional(rounded, trim="-")


def within(words: str) -> str:
    """A title or a sentence as a part of another: without its capital, but that of a person, and its full stop."""
    return (words if words.startswith(_PERSONS) else words[:1].lower() + words[1:]).rstrip(".")
