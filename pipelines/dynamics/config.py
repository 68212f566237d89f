"""Numbers that decide how effects follow from the arm, each with its meaning and source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ORDERS"]


@dataclass(frozen=True)
class OrdersConfig:
    """Orders of waves along a joint's angle that are looked for.

    Stops leave many joints 330 or 340 degrees, which tell waves of neighbouring whole orders apart;
    a drive with 7, 12 and 28 waves, recorded over .95 of a turn, was taken for 6.8 and its like.
    """

    nearly: float = 0.1  # of a turn, that may be missing where whole orders are looked for
    closed: float = 0.02  # the same, where what a joint does comes back to where it began
    waves: float = 1.5  # in the travel at least: fewer are the curve of a spring (causes.md)
    highest: float = 150.0  # order that is searched for; of a slide: of its whole travel
    finest: float = 1000.0  # of a slide: a wave of 6 mm, as leads of screws have them
    most: int = 200  # orders on the grid
    least: float = 1e-3  # [rad or m] of travel, that a grid is made for


ORDERS = OrdersConfig()
