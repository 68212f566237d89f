"""Find every effect of causes.toml: its entry says in which file its equation stands.

effect_names()        ("asymmetric_friction", "backlash", …), without importing any
find_effect(name)     the class of one
all_effects()         the classes of all
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from pipelines.effects.parameters import causes
from pipelines.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from pipelines.effects.base import Effect

__all__ = ["all_effects", "effect_names", "find_effect"]


def effect_names() -> tuple[str, ...]:
    """Return the identifiers of all effects, sorted."""
    return tuple(causes())


def find_effect(name: str) -> type[Effect]:
    """Return the effect whose identifier is `name`.

    Raises:
        UsageError: there is no such effect.
    """
    if name not in causes():
        raise UsageError(
            "C02",
            f"'{name}' is not an effect{did_you_mean(name, effect_names())}",
            remedy=f"the effects are {', '.join(effect_names())}",
        )
    module = importlib.import_module(f"{__name__}.{causes()[name].file}")
    return next(
        member
        for member in vars(module).values()
        if isinstance(member, type) and vars(member).get("name") == name
    )


def all_effects() -> tuple[type[Effect], ...]:
    """Return every effect, in the order of their names."""
    return tuple(map(find_effect, effect_names()))
