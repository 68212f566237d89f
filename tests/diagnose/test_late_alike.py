"""Logs that are late before and after alike show nothing that has changed: the verdict says all the same that they are late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from pipelines import diagnose as stage
from pipelines.errors import Check

LATE = Check.of("T06", "warn", "torque lies 39.80 ± 0.20 samples (39.8 ms) behind the motion, alike in 3 joints",
                where="/logs/excitation-1.h5, signal tau")
OTHER = Check.of("T02", "warn", "a gap of 3 samples", where="/logs/excitation-1.h5")


@dataclass(frozen=True)
class Told:
    verdict: str
    reason: str = ""
    summary: str = "Nothing is wrong with this arm, as far as these logs can tell."


@pytest.mark.parametrize(("verdict", "said", "told"), [
    ("no-fault-found", (OTHER, LATE), True), ("no-fault-found", (OTHER,), False), ("cause", (LATE,), False)])
@pytest.mark.parametrize("reason", ["", "no floor"])
def test_that_all_logs_are_late_is_in_the_verdict(verdict: str, said: tuple[Check, ...], told: bool, reason: str) -> None:
    before: Any = Told(verdict, reason)
    found = stage._beside_clocks(before, said)
    assert found.reason.startswith(reason)
    assert ("39.8 ms" in found.reason and "39.8 ms" in found.summary and "excitation-1.h5 torque" in found.summary) is told
    assert (found is before) is not told
