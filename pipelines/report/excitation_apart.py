"""How alike two causes look in a designed motion, and on which side of what diagnose calls alternatives that is."""

from __future__ import annotations

from pipelines.model.excitation.apart import Apart
from pipelines.report.diagnosis_words import without_keys
from pipelines.report.report import Section, Table
from pipelines.report.style import format_number

__all__ = ["alike_words", "apart_section", "are_rivals"]

RIVALS = 0.8  # similarity from which two causes explain the same


def are_rivals(found: Apart | None) -> bool:
    """Return whether the design leaves two causes so alike that a diagnosis of its log would call them alternatives."""
    return found is not None and found.after.similarity > RIVALS


def alike_words(found: Apart) -> str:
    """Return how alike two causes look, and whether the plain design was kept."""
    before, after = (_on_its_side(one.similarity) for one in (found.before, found.after))
    judged = (f"more than {RIVALS:g}: diagnose would still call them alternatives, and a longer search or wider limits may "
              "tell them apart" if are_rivals(found) else f"no more than {RIVALS:g}: diagnose would not call them alternatives")
    beside = (f"in a design for the parameters alone {before}" if found.changed else
              "this is the design for the parameters alone, for no better one was found that keeps what it keeps")
    return f"{' and '.join(map(without_keys, found.causes))} look alike by {after} (1: the same; {beside}), {judged}"


def _on_its_side(similarity: float) -> str:
    """With as many digits as it takes to stand on its own side of what makes alternatives."""
    for digits in (2, 3):
        shown = float(f"{similarity:.{digits}g}")
        if shown != RIVALS and (shown > RIVALS) == (similarity > RIVALS):
            return format_number(similarity, digits)
    return format_number(similarity, 4)


def apart_section(found: Apart | None) -> Section | None:
    """How well two causes can be told apart in it."""
    if found is None:
        return None
    judged = (("design for the parameters alone", found.before), ("this design", found.after))[0 if found.changed else 1:]
    rows = tuple((name, one.similarity, *one.identifiability, one.condition_number) for name, one in judged)
    a, b = map(without_keys, found.causes)
    words = ("Similarity: how much of one cause the other can imitate, when base parameters and friction are fitted beside both; "
             f"above {RIVALS:g} diagnose calls them alternatives. Visible: what base parameters and friction cannot take up.")
    return Section(f"Telling {a} from {b}", (words,), (Table(
        ("motion", "similarity", f"{a}, visible", f"{b}, visible", "condition number"), rows),))
