"""A cause that was found several times at one place is one finding: cogging of 7 and of 12 waves a turn.

    once_each(findings)       each cause of a joint once, with the numbers of all its parts
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from pipelines.model.diagnosis.result import Finding, Value

__all__ = ["once_each"]

_NUMBERED = re.compile(r"(.+?)_(\d+)$")


def once_each(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """The strongest part of each cause of a joint with the numbers of the others, counted on: order, order_2, …, order_4, …

    Gain and proof of all its parts are the same; what is explained adds up, and torque of different waves by its squares.
    """
    out: dict[tuple[str, int | None], Finding] = {}
    for one in found:
        key = (one.cause, one.joint)
        if (first := out.get(key)) is None:
            out[key] = one
            continue
        out[key] = replace(first, parameters=first.parameters | _counted_on(first.parameters, one.parameters),
                           explained=min(first.explained + one.explained, 1.0),
                           torque_rms=float(np.hypot(first.torque_rms, one.torque_rms)),
                           of_rated=float(np.hypot(first.of_rated, one.of_rated)),
                           rivals=tuple(rival for rival in first.rivals if (rival.cause, rival.joint) != key))
    return tuple(out.values())


def _counted_on(first: dict[str, Value], more: dict[str, Value]) -> dict[str, Value]:
    """`more` with numbers behind those of `first`."""
    last = max((_split(name)[1] for name in first), default=0)
    return {f"{base}_{last + number}": value for name, value in more.items() for base, number in (_split(name),)}


def _split(name: str) -> tuple[str, int]:
    """Name without its number, and the number: 1 where there is none."""
    found = _NUMBERED.match(name)
    return (found[1], int(found[2])) if found else (name, 1)
