"""Functions of one number or of an array, so that one equation serves one robot and many replicas.

    torque = lambda q, v, m=NUMBERS: level * m.tanh(sharpness * v)

NumPy costs about a microsecond a call, whatever the size: for a single robot, plain numbers are
ten times faster than arrays of one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["ARRAYS", "NUMBERS", "Functions"]


@dataclass(frozen=True)
class Functions:
    """The functions that equations of joints are written in, beside operators and abs."""

    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    tanh: Callable[[Any], Any]
    exp: Callable[[Any], Any]
    sign: Callable[[Any], Any]
    round: Callable[[Any], Any]
    smaller: Callable[[Any, Any], Any]  # of two values
    larger: Callable[[Any, Any], Any]
    where: Callable[[Any, Any, Any], Any]  # condition, value if it holds, value if not


NUMBERS = Functions(
    math.sin,
    math.cos,
    math.tanh,
    math.exp,
    lambda x: float((x > 0.0) - (x < 0.0)),
    round,
    min,
    max,
    lambda condition, one, other: one if condition else other)
ARRAYS = Functions(
    np.sin, np.cos, np.tanh, np.exp, np.sign, np.rint, np.minimum, np.maximum, np.where
)
