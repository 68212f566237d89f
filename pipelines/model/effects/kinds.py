"""What effects of one kind have beyond the contract, and no other effect does.

    FrictionLaw    every column takes power out of its joint
    Event          happens once, in one log
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Self

from pipelines.model.effects.base import ArmModel, Effect
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Event", "FrictionLaw", "plainer"]


@dataclass(frozen=True)
class FrictionLaw(Effect):
    """A law of friction."""

    plainer: ClassVar[tuple[tuple[str, ...], ...]] = ()  # the same law with fewer terms, from most
    # to fewest, each by the names of its laws: for logs that do not tell the terms apart


@dataclass(frozen=True)
class Event(Effect):
    """An effect whose shapes are a window of time [s] from the start of its log."""

    clock = "log"

    @abstractmethod
    def promising(self, motion: Motion, arm: ArmModel, residual: Array) -> Iterator[Self]:
        """Return windows that may explain `residual` (samples, joints) [N m], at most a few tens."""

    @abstractmethod
    def course(self, t: Array) -> Array:
        """Return how large it is (samples,) at `t` since the start of the log, of its largest."""


def plainer(law: Effect) -> tuple[tuple[str, ...], ...]:
    """Return the names of laws with fewer terms; none where `law` is no law of friction."""
    return law.plainer if isinstance(law, FrictionLaw) else ()
