"""Let mixed-up columns speak first: a sign or a scale that looks wrong beside them is no fault of its own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pipelines.errors import Check

__all__ = ["columns_first"]

_EXPLAINED = ("RRID-S14", "RRID-S15")


def columns_first(checks: Iterable[Check]) -> tuple[Check, ...]:
    """`checks` of logs of one recorder; where one of them finds columns in each other's places (S13), nobody is sent to turn a sign
    or to change a scale (S14, S15): a log that moves one joint alone cannot tell the one from the other."""
    every = tuple(checks)
    mixed = next((check for check in every if check.code == "RRID-S13" and check.gate), None)
    if mixed is None:
        return every
    remedy = f"nothing yet: the columns that are mixed up ({mixed.code}) can explain it; put them right first"
    return tuple(replace(check, remedy=remedy) if check.code in _EXPLAINED and check.level != "ok" else check for check in every)
