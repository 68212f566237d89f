"""Which friction model and which thresholds the figures of a stage rest on, where these come from, and how to have others.

Figures of a stage on its own and within a run differ where they rest on different ones: whoever lays them side by side is told.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipelines.diagnosis.result import Result as Diagnosed
from pipelines.model.effects import find_effect
from pipelines.model.estimation.result import Result as Estimated
from pipelines.model.rows.prepare import FewerTerms

__all__ = ["fewer_words", "friction_words", "laws_words", "threshold_words"]


def friction_words(result: Estimated) -> str:
    """Of estimate-bps: friction is fitted with the rest, or held as somebody has found it."""
    if result.friction == "fitted":
        return ("Friction: Coulomb and viscous, fitted with the rest, for no other was given. A run holds that of its stage "
                "fit-friction where every joint was driven alone: --model RUN/fit-friction/model.json does the same here.")
    if result.friction_of == "fit-friction":
        return ("Friction: held, that of fit-friction, earlier in this run. On its own estimate-bps fits Coulomb and viscous "
                "friction with the rest; --model RUN/fit-friction/model.json gives it these figures.")
    return (f"Friction: held, that of {result.friction_of or 'another model'}, as --model asked. Without it, Coulomb and viscous "
            "friction is fitted with the rest.")


def laws_words(laws_of: str, in_run: str = "", fewer: Sequence[FewerTerms] = ()) -> str:
    """Of diagnose and extend, which fit the numbers of their laws themselves; `in_run`: the option that a run has for it."""
    if laws_of:
        return " ".join((f"Friction laws: those of {laws_of}, as asked for; their numbers are fitted here.", *fewer_words(fewer)))
    other = f" (in a run {in_run})" if in_run else ""
    return ("Friction laws: Coulomb and viscous to begin with, fitted here, alone and in a run: no earlier fit of friction is "
            f"taken. --model FILE takes the laws of a model{other}.")



def fewer_words(fewer: Sequence[FewerTerms]) -> tuple[str, ...]:
    """One sentence for all joints at which the same laws stand in place of the same one."""
    found = []
    for law, taken in dict.fromkeys((one.law, one.taken) for one in fewer):
        places = [f"joint {one.joint} ({one.reason})" for one in fewer if (one.law, one.taken) == (law, taken)]
        instead = ", ".join(find_effect(name).words.title for name in taken)
        found.append(f"The terms of \"{find_effect(law).words.title}\" are not distinguishable at {', '.join(places)}; "
                     f"fitted there instead: {instead}.")
    return tuple(found)


def threshold_words(result: Diagnosed) -> str:
    """Return what a cause has to exceed."""
    origins = sorted({one.origin for one in result.thresholds})
    if not origins:
        return "Thresholds: none, no cause was looked for."
    return (
        "Thresholds: a cause has to exceed what noise gives any cause with a probability of 1 %, and the "
        f"difference between {'; '.join(origins)}; without reference logs, a thousandth of its joint's torque; and "
        "it has to predict blocks of time that it was not fitted to."
    )
