"""Numbers that decide in the comparison of sessions."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["DriftConfig"]


@dataclass(frozen=True)
class DriftConfig:
    """When a figure of one session has moved against those of the others."""

    limit: float = 3.0  # [std] beyond which a value has moved; by chance 1 of 370 is
    enough: int = 5  # items, to judge a residual by its scatter
    false_alarms: float = 0.01  # share of robots without drift that are reported with one
