"""Which friction model and which thresholds the figures of a stage rest on, where these come from, and how to have others.

Figures of a stage on its own and within a run differ where they rest on different ones: whoever lays them side by side is told.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipelines.model.diagnosis.answered.outcome import Result as Diagnosed
from pipelines.model.diagnosis.asked.unasked import FewerTerms
from pipelines.model.diagnosis.floor.thresholds import OF_THE_RESIDUAL, SHARE
from pipelines.model.diagnosis.floor.wide import TIMES
from pipelines.model.effects import find_effect
from pipelines.model.estimation.result import Result as Estimated

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

_PARTS = "parts of "  # how the origin of thresholds begins that come from parts of the logs themselves


def fewer_words(fewer: Sequence[FewerTerms]) -> tuple[str, ...]:
    """One sentence for all joints at which the same laws stand in place of the same one."""
    found = []
    for law, taken in dict.fromkeys((one.law, one.taken) for one in fewer):
        places = [f"joint {one.joint} ({one.reason})" for one in fewer if (one.law, one.taken) == (law, taken)]
        instead = ", ".join(find_effect(name).title for name in taken)
        found.append(f"The terms of \"{find_effect(law).title}\" are not told apart at {', '.join(places)}; "
                     f"fitted there instead: {instead}.")
    return tuple(found)


def threshold_words(result: Diagnosed) -> str:
    """Of diagnose: what says how much of a cause an arm in order shows, and whether an earlier diagnosis had found it."""
    origins = sorted({one.origin for one in result.thresholds})
    told = "; ".join(map(_by, origins)) or "none, for no cause was looked for"
    if result.calibrated_with:
        return f"Thresholds: {told}. An earlier diagnosis has stored them, of {', '.join(result.calibrated_with)}."
    if origins and all(origin.startswith(_PARTS) for origin in origins):
        return f"Thresholds: {told}. They were made here."
    return f"Thresholds: {told}. They were made here; --calibration DIR takes those of an earlier diagnosis."


def _by(origin: str) -> str:
    """What a cause has to take off, by where that comes from."""
    if origin == OF_THE_RESIDUAL:
        return (f"a cause has to take {100.0 * SHARE:g} % off the mean square of the residual, all joints together, each in units "
                "of its own rms: a fixed number, for nothing here tells what an arm in order would show; and time that it was not "
                "chosen by has to bear it out")
    if origin.startswith(_PARTS):
        return (f"a cause has to exceed what chance gives any cause with a probability of 1 %, and what {origin} differ by; and "
                "blocks of time that it was not fitted to have to bear it out")
    return (f"a cause has to take off {TIMES:g} times what it, or its like, takes off by chance where nothing is wrong, by "
            f"{origin}")
