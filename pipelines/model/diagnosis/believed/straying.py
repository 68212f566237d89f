"""Whether the simulated arm comes nearer to the measured one with what was found.

    simulated = simulated_steps(found, case, prepared)      the nominal arm, then the arm after each accepted step
    why = strays(...)                                       why it comes no nearer with one of them
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.searched.beside import acted
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found
from pipelines.model.diagnosis.worth.gains import Simulation, no_nearer, simulation_errors

__all__ = ["simulated_steps", "strays"]


def simulated_steps(found: Found, case: Case, prepared: Prepared) -> tuple[Simulation, ...]:
    arms = [found.nominal.model.arm, *(step.best.done.model.arm for step in found.steps if step.best is not None)]
    return tuple(simulation_errors([acted(arm, case.beside) for arm in arms], prepared.judging or prepared.motions))


def strays(found: Found, plain: Found, k: int, simulated: Sequence[Simulation], prepared: Prepared, case: Case, late: bool,
           rest: Callable[[], Refined]) -> str:
    """Why the simulated arm is no nearer with step `k`, neither when it was found, as steady rows or rows weighed alike have it,
    nor beside all the others; empty where it is.

    Where every joint is late, one that is told so alone no longer fits the others, and their loops stray until they are told too.

    Args:
        plain: the same steps as rows weighed alike have them.
        rest: fits the final model without this step.
    """
    why = no_nearer(simulated[k], simulated[k + 1], late=late)
    best, last = plain.steps[k].best, max(j for j, one in enumerate(found.steps) if one.best is not None)
    if why and best is not None and best is not found.steps[k].best:
        why = _between(plain.steps[k].before, best.done, prepared, case, late)
    if not why or k == last or simulated[k].how != "closed-loop":
        return why
    return _between(rest(), found.final, prepared, case, late)


def _between(before: Refined, after: Refined, prepared: Prepared, case: Case, late: bool) -> str:
    arms = [acted(one.model.arm, case.beside) for one in (before, after)]
    return no_nearer(*simulation_errors(arms, prepared.judging or prepared.motions), late=late)
