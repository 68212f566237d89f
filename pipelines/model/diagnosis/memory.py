"""What was worked out of some logs, for whoever asks the same of them again: the extension after a diagnosis.

    memory.of("rows", logs, settings, work)       what `work()` makes, made once for the same logs and settings
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, TypeVar

from pipelines.errors import Check
from pipelines.estimation.checks.boundary import Boundary
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.asked.gates import examined
from pipelines.model.diagnosis.asked.inputs import Logs, Prepared, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.given.terms_apart import with_terms_told_apart

__all__ = ["Memory"]

A = TypeVar("A")


class Memory:
    """Of one process; nothing of it is stored."""

    def __init__(self) -> None:
        self._known: list[tuple[str, tuple[object, ...], Hashable, Any]] = []

    def of(self, what: str, things: Sequence[object], settings: Hashable, work: Callable[[], A]) -> A:
        """`things` are the very same objects, `settings` equal ones."""
        for name, others, asked, found in self._known:
            if (name, asked, len(others)) == (what, settings, len(things)) and all(
                    a is b for a, b in zip(things, others, strict=True)):
                answer: A = found
                return answer
        made = work()
        self._known.append((what, tuple(things), settings, made))
        return made

    def prepared(self, logs: Logs, chosen: DiagnosisSettings, arm: Arm | None, stored: tuple[str, ...] = ()) -> Prepared:
        """As `prepare`, for laws of friction whose terms these logs tell apart, or that thresholds are `stored` for."""
        parts = (logs.identify, logs.validate, logs.reference, logs.frf, logs.frf_before)
        settings = (tuple(map(len, parts)), chosen.cutoff_hz, chosen.decimation, chosen.min_speed)
        rows = self.of("rows", (arm, *(log for part in parts for log in part)), settings, lambda: prepare(logs, chosen, arm))
        return self.of("terms", (rows,), (chosen.blocks, stored), lambda: with_terms_told_apart(rows, chosen.blocks, stored))

    def instead(self, before: A, after: A) -> None:
        """Who would be given `before` is given `after`, which a diagnosis has found to be better: rows for laws that fit better, a
        comparison that knows more of what stands."""
        self._known = [(name, things, asked, after if found is before else found) for name, things, asked, found in self._known]

    def examined(self, logs: Logs, allow_mismatch: bool) -> tuple[tuple[Check, ...], Boundary | None]:
        """As `examined` of all that a diagnosis looks at."""
        every = (*logs.identify, *logs.validate, *logs.reference, *logs.frf, *logs.frf_before)
        return self.of("said", every, allow_mismatch, lambda: examined(every, allow_mismatch))
