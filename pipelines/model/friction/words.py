"""Numbers in sentences of a friction fit."""

from __future__ import annotations

import numpy as np

__all__ = ["plain_number"]


def plain_number(value: float, digits: int = 2) -> str:
    """`value` with that many significant digits and no power of ten: 120, 0.00021."""
    rounded = float(f"{value:.{digits - 1}e}")
    return np.format_float_positional(rounded, trim="-")
