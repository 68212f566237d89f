"""Numbers that decide how much of a result a report shows."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["REPORT"]


@dataclass(frozen=True)
class ReportConfig:
    """Limits of what is drawn and listed, so that a page stays short; result.json has all."""

    previews: int = 8  # logs whose signals `inspect` draws
    findings: int = 200  # that `inspect` lists
    visible_jitter: float = 1e-3  # rms, in sample times, from which intervals are drawn
    reconstructed: int = 8  # logs whose motion is drawn
    simulated: int = 4  # logs whose simulation is drawn
    inputs: int = 40  # at the foot of a page
    headline: int = 240  # characters of a cause's line, of which the next action may be left out
    fault_numbers: int = 3  # of a finding that `demo` tells, where it hid another


REPORT = ReportConfig()
