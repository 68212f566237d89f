"""The names of figures as people read them; those who compute with them have the keys.

    figure_in_words("extend model cogging joint 2 amplitude 2")     "extend model: cogging at joint 2, second amplitude"
    figure_in_words("coulomb:3:level")                              "Coulomb friction at joint 3, level"
"""

from __future__ import annotations

from pipelines.model.effects import effect_names, find_effect
from pipelines.model.parameter_names import Named, named_in
from pipelines.report.diagnosis_words import named, spoken

__all__ = ["figure_in_words"]


def figure_in_words(name: str, within: bool = False) -> str:
    """`name`, which `log.result_figures` gave, with its cause in words; as it is where it is of none.

    Args:
        within: it stands within a sentence, and begins small.
    """
    found = named_in(name)
    if found is None:
        return name
    said, parameter = _of_a_joint(found) if found.of_law else (named(found.cause, found.joint), found.what)
    parameter = spoken(parameter)
    said = f"{found.before}: {said}" if found.before else said if within else f"{said[:1].upper()}{said[1:]}"
    return f"{said}, {parameter}" if parameter else said


def _of_a_joint(found: Named) -> tuple[str, str]:
    """What fit-friction calls by the law of the joint: a parameter of one of the effects that make the law up, "coulomb.level", of
    an effect that is the law, or of the joint itself, as its inertia is."""
    effect, dot, quantity = found.what.partition(".")
    if dot and effect.replace(" ", "_") in effect_names():
        return named(effect.replace(" ", "_"), found.joint), quantity
    if any(q.name == found.what.replace(" ", "_") for q in find_effect(found.cause).parameters):
        return named(found.cause, found.joint), found.what
    return f"joint {found.joint}", found.what
