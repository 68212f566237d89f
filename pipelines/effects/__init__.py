"""Find every effect in this folder. A new file is a new effect: nothing has to be registered.

    effect_names()        ("coulomb", "three_sigmoid", …), without importing any
    find_effect(name)     the class of one
    all_effects()         the classes of all
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import lru_cache
from typing import TYPE_CHECKING

from pipelines.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from pipelines.effects.base import Effect

__all__ = ["all_effects", "effect_names", "find_effect"]

_CONTRACT = ("base", "config", "drive_apart", "kinds", "terms")  # what every effect is written in


@lru_cache(maxsize=1)
def effect_names() -> tuple[str, ...]:
    """Return the identifiers of all effects, sorted."""
    return tuple(
        sorted(module.name for module in pkgutil.iter_modules(__path__)
               if module.name not in _CONTRACT))


def find_effect(name: str) -> type[Effect]:
    """Return the effect whose file and identifier is `name`.

    Raises:
        UsageError: there is no such effect.
    """
    if name not in effect_names():
        raise UsageError("C02", f"'{name}' is not an effect{did_you_mean(name, effect_names())}",
                         remedy=f"the effects are {', '.join(effect_names())}")
    module = importlib.import_module(f"{__name__}.{name}")
    found: type[Effect] = next(member for member in vars(module).values()
                               if getattr(member, "name", None) == name)
    return found


def all_effects() -> tuple[type[Effect], ...]:
    """Every effect, in the order of their names."""
    return tuple(find_effect(name) for name in effect_names())
