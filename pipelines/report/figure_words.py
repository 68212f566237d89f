"""The names of figures as people read them; those who compute with them have the keys.

    figure_in_words("extend model cogging joint 2 amplitude 2")     "extend model: cogging at joint 2, second amplitude"
    figure_in_words("coulomb:3:level")                              "Coulomb friction at joint 3, level"
"""

from __future__ import annotations

import re

from pipelines.model.effects import effect_names, find_effect
from pipelines.report.diagnosis_words import named, spoken

__all__ = ["figure_in_words"]

_WORD = re.compile(r"\S+")
_CAUSES = (re.compile(r"([a-z_]+)(?::(\d+))?:([a-z_0-9]+)"),  # "coulomb:3:level", "payload:mass"
           re.compile(r"([a-z_]+)(?: joint (\d+))?(?: (.+))?"))  # "coulomb joint 3 level", "payload mass"
_HARMONIC = re.compile(r" ([2-9]|[1-9][0-9]+)$")
_METHOD = re.compile(r"(?:varpro|output-error|ekf) ")


def figure_in_words(name: str, within: bool = False) -> str:
    """`name`, which `log.result_figures` gave, with its cause in words; as it is where it is of none.

    Args:
        within: it stands within a sentence, and begins small.
    """
    for start in (word.start() for word in _WORD.finditer(name)):
        for pattern in _CAUSES:
            if (found := pattern.fullmatch(name, start)) is not None and found[1] in effect_names():
                return _told(name[:start].strip(), found[1], None if found[2] is None else int(found[2]), found[3] or "",
                             within)
    return name


def _told(before: str, cause: str, joint: int | None, what: str, within: bool) -> str:
    method = _METHOD.match(what)
    said, parameter = _of_a_joint(cause, joint, what[method.end():]) if method else (named(cause, joint), what)
    parameter = spoken(_HARMONIC.sub(r"_\1", parameter))
    said = f"{before}: {said}" if before else said if within else f"{said[:1].upper()}{said[1:]}"
    return f"{said}, {parameter}" if parameter else said


def _of_a_joint(law: str, joint: int | None, what: str) -> tuple[str, str]:
    """What fit-friction calls by the law of the joint: a parameter of one of the effects that make the law up, "coulomb.level", of
    an effect that is the law, or of the joint itself, as its inertia is."""
    effect, dot, quantity = what.partition(".")
    if dot and effect.replace(" ", "_") in effect_names():
        return named(effect.replace(" ", "_"), joint), quantity
    if any(q.name.replace("_", " ") == what for q in find_effect(law).parameters):
        return named(law, joint), what
    return f"joint {joint}", what
