"""The answer of a diagnosis, read from the object that `rrrid diagnose --json` prints
(cli-contract.md).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

Place = tuple[str, int | None]


@dataclass(frozen=True)
class Found:
    """One accepted cause."""

    cause: str
    joint: int | None
    parameters: Mapping[str, tuple[Any, float]]  # name -> value, std (0 where it is unknown)
    torque_after: tuple[
        float, ...
    ]  # [N m] held-out rms of each joint, with this cause and those before it
    simulated: (
        tuple[float, float] | None
    )  # [rad] rms of all joints before and after; None: nothing was simulated


@dataclass(frozen=True)
class Said:
    """One answer."""

    verdict: str
    """"cause", "no-fault-found", "unknown", "cannot-judge"; "refused" and "crashed" where there is
    none.
    """
    findings: tuple[Found, ...] = ()
    standing: tuple[Place, ...] = ()
    not_identifiable: Mapping[str, str] = field(default_factory=dict)  # cause -> reason
    floor: tuple[float, ...] = ()  # [N m] of each joint


def read_verdict(answer: Mapping[str, Any]) -> Said:
    """Return the answer as numbers; what is null becomes NaN.

    Raises:
        KeyError: a field that the contract promises is missing.
    """
    return Said(
        answer["verdict"],
        tuple(_found(one) for one in answer["findings"]),
        tuple((one["cause"], one["joint"]) for one in answer["baseline_effects"]),
        {one["cause"]: one["reason"] for one in answer["not_identifiable"]},
        _numbers(answer["residual_rms"]["noise_floor"]),
    )


def _found(one: Mapping[str, Any]) -> Found:
    gain = one["gain"]
    values = {
        name: (number["value"], number["std"] or 0.0) for name, number in one["parameters"].items()
    }
    return Found(
        one["cause"],
        one["joint"],
        values,
        _numbers(gain["validate_torque_rms"]["after"]),
        _simulated(gain),
    )


def _simulated(gain: Mapping[str, Any]) -> tuple[float, float] | None:
    position = gain["simulated_position_rms"]
    if gain["simulation"] == "none" or position is None:
        return None
    before, after = (math.hypot(*_numbers(position[when])) for when in ("before", "after"))
    return before, after


def _numbers(values: Sequence[float | None] | None) -> tuple[float, ...]:
    return tuple(math.nan if value is None else float(value) for value in values or ())
