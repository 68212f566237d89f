"""Define what friction laws and events have beyond the contract of an effect.

    FrictionLaw    every column takes power out of its joint
    Event          happens once, in one log
    sign_curve     the curve by which dry friction changes its sign
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Self

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import ArmModel, Effect, SpeedCurve

__all__ = ["Event", "FrictionLaw", "plainer", "sign_curve"]

# x/√(1 + x²) and (2/π) arctan x as sigmoids, within 0.0012 of them at every x: sharpnesses, as
# parts of w, and heights. tanh is a sigmoid itself.
_TANH = ((1.0, 1.0),)  # numerics: exact
_ROOT = ((1.307, 0.608), (0.563, 0.344), (0.1505, 0.048))  # numerics: within 0.0012
_ARCTAN = (  # numerics: within 0.0012
    (1.1537, 0.3622), (0.4719, 0.4021), (0.1463, 0.1731), (0.0335, 0.052), (0.004, 0.0106))


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
        """Return windows that may explain `residual` (samples, joints) [N m].

        They are a few tens at most.
        """

    @abstractmethod
    def course(self, t: Array) -> Array:
        """Return how large it is (samples,) at `t` since the start of the log, of its largest."""


def plainer(law: Effect) -> tuple[tuple[str, ...], ...]:
    """Return the names of laws with fewer terms; none where `law` is no law of friction."""
    return law.plainer if isinstance(law, FrictionLaw) else ()


def sign_curve(level: float, sharpness: float, roundness: float = 1.0) -> SpeedCurve:
    """Return dry friction of a level [N m], by sharpness w [s/rad] and roundness r, as sigmoids.

    The law of `Coulomb`.
    """
    w, more = sharpness, roundness - 1.0
    if more == 0.0:
        return SpeedCurve(heights=(level,), sharpnesses=(w,))
    sharper, rounder = (_TANH, _ROOT) if more <= 1.0 else (_ROOT, _ARCTAN)
    share = more if more <= 1.0 else more - 1.0
    return SpeedCurve(
        heights=tuple(level * part * height
                      for part, curve in ((1.0 - share, sharper), (share, rounder))
                      for _, height in curve),
        sharpnesses=tuple(w * part for part, _ in (*sharper, *rounder)))
