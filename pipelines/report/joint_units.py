"""The units of an arm's joints in the headings of tables and figures: N m and rad, N and m of a joint that slides, or both.

    units = units_in(diagnosis)             units.torque == "N m or N" where some turn and some slide
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from pipelines.diagnosis.result import Diagnosis, Extension

__all__ = ["Units", "each", "joined", "unit_of", "units_in"]

_TURNING = {"position": "rad", "speed": "rad/s", "acceleration": "rad/s^2", "torque": "N m"}


@dataclass(frozen=True)
class Units:
    """Of all joints together, or of one."""

    turning: tuple[bool, ...] = ()  # joint by joint; none: all turn

    @property
    def torque(self) -> str:
        return joined(("N m" if turns else "N" for turns in self.turning), "N m")

    @property
    def position(self) -> str:
        return joined(("rad" if turns else "m" for turns in self.turning), "rad")

    @property
    def thousandths(self) -> str:
        """Of position."""
        return each(self.position, before="m")

    def at(self, joint: int | None) -> Units:
        """Of one joint, from 1; of all where it is none."""
        return self if joint is None or joint > len(self.turning) else Units(self.turning[joint - 1:joint])


def each(units: str, behind: str = "", before: str = "") -> str:
    """"rad/s or m/s" of "rad or m" and "/s"."""
    return joined(f"{before}{unit}{behind}" for unit in units.split(" or "))


def joined(units: Iterable[str], otherwise: str = "") -> str:
    """"N m or N": each once, in their order; `otherwise` where there is none."""
    return " or ".join(dict.fromkeys(units)) or otherwise


class Limited(Protocol):
    """What says the unit of a quantity of a joint: a limit, or how near a motion comes to it."""

    @property
    def quantity(self) -> str: ...  # "position" | "speed" | "acceleration" | "torque" | of the tip
    @property
    def joint(self) -> int | None: ...
    @property
    def unit(self) -> str: ...


def unit_of(limits: Iterable[Limited], quantity: str) -> str:
    """Of a quantity of the joints, "rad" or "rad or m"; where no limit is described, that of a joint that turns."""
    told = (one.unit for one in limits if one.quantity == quantity and one.joint is not None)
    return joined(told, _TURNING[quantity])


def units_in(found: Diagnosis | Extension) -> Units:
    """By what a result says of its joints: a diagnosis in the curves over their positions, an extension itself."""
    if isinstance(found, Extension):
        return Units(found.revolute)
    sliding = {curve.joint for one in found.evidence for curve in one.curves if curve.against == "position" and curve.unit == "m"}
    return Units(tuple(j + 1 not in sliding for j in range(len(found.residual_rms.identify))))
