"""Drives that are louder than drives are: a floor that was made with so much noise hides faults, and may be one.

    loud = loud_joint(noise, rated)     of the joint whose noise is the largest share of its rated torque, where that is too much

What shakes an arm, a gap say, is taken for noise where nothing else tells it, and raises the floor. Logs of motion do not tell
which of the two it is: a healthy arm with drives that are as loud is no fault, so "nothing is wrong" stands, and this with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.words import plain_number

__all__ = ["Loud", "loud_joint", "only_if_loud"]

_LOUD = 0.01  # of the rated torque: three times the noise of the test bench's drives at ten times their usual one


@dataclass(frozen=True)
class Loud:
    """The noise that the twin was given at one joint."""

    joint: int  # 1-based
    noise: float  # [N m]
    share: float  # of its rated torque


def loud_joint(noise: Array, rated: Sequence[float]) -> Loud | None:
    """None where the noise (joints,) [N m] of no joint is more than drives have, or nobody knows what they are `rated` [N m]."""
    share = np.array([noise[j] / rated[j] if j < len(rated) and rated[j] > 0.0 else 0.0 for j in range(len(noise))])
    share = np.nan_to_num(share, nan=0.0, posinf=0.0)
    if not len(share) or share.max() <= _LOUD:
        return None
    j = int(share.argmax())
    return Loud(j + 1, float(noise[j]), float(share[j]))


def only_if_loud(noise: Array, rated: Sequence[float], revolute: Sequence[bool]) -> str:
    """", and only if its drives are as noisy as 0.35 N m at joint 3 (2.3 % of the rated torque)"; empty where they need not be."""
    if (loud := loud_joint(noise, rated)) is None:
        return ""
    unit = "N m" if revolute[loud.joint - 1] else "N"
    return (f", and only if its drives are as noisy as {plain_number(loud.noise, 2)} {unit} at joint {loud.joint} "
            f"({plain_number(100.0 * loud.share, 2)} % of the rated torque), which may be a fault")
