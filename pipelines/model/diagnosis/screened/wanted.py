"""Causes that somebody names, and why a model cannot take one up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pipelines.errors import UsageError
from pipelines.model.diagnosis.screened.candidates import Family, place_of
from pipelines.model.effects.base import Effect, everywhere

__all__ = ["Wanted", "usable"]


@dataclass(frozen=True)
class Wanted:
    """A cause to extend the model by, and where its non-linear numbers start."""

    effect: Effect
    start: Mapping[str, float] = field(default_factory=dict)

    @property
    def place(self) -> str:
        return place_of(self.effect.name, self.effect.joint)


def usable(mine: Family | None, one: Wanted, laws: Sequence[Effect], revolute: Sequence[bool]) -> Family:
    """The shapes of a wanted cause, `mine`, where a model with such friction `laws` can take it up.

    Raises:
        UsageError: C02, it cannot.
    """
    if mine is None:
        why, remedy = _missing(one, laws, revolute)
        raise UsageError("C02", f"{one.place}: {why}", where="--with", remedy=remedy)
    if mine.event:
        raise UsageError("C02", f"{one.place} happens once: no model of the arm holds it", where="--with",
                         remedy="leave the moment out of the logs instead")
    return mine


def _missing(one: Wanted, laws: Sequence[Effect], revolute: Sequence[bool]) -> tuple[str, str]:
    """Why nothing can be fitted there, and what to do."""
    effect = one.effect
    if effect.name in {law.name for law in laws}:
        return "the nominal model has it already", "name a cause that the nominal model lacks"
    if effect.evidence == "none":
        return "it is a law of friction for a nominal model, and no cause", "extend a model that has it: --model FILE"
    if effect.evidence == "base parameters":
        return ("the base parameters take it up, and no reference logs show that they moved as it moves them",
                "name reference logs from before it: --reference PATH")
    places = [place_of(other.name, other.joint) for other in everywhere(type(effect), revolute)]
    return ("this arm does not have it there",
            f"write {' or '.join(places)}" if places else "name another cause: no place of this arm has it")
