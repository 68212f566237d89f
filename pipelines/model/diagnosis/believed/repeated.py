"""Whether a step of a search repeats: in every log, and beside all that was found, as when it was found.

    at_odds(found, k, prepared, case)     why logs do not agree on it; empty where they do
    vague(found, k, prepared, case)       whether it gains no more than chance, then and beside the others
"""

from __future__ import annotations

from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.believed.chance import no_gain
from pipelines.model.diagnosis.believed.fewer import all_but, without
from pipelines.model.diagnosis.named.findings import unlike
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found

__all__ = ["at_odds", "vague"]


def vague(found: Found, k: int, prepared: Prepared, case: Case) -> bool:
    """Whether step `k` gained no more than chance when it was found, nor does beside all the others."""
    step, others = found.steps[k], [j for j, one in enumerate(found.steps) if one.best is not None and j != k]
    if step.best is None or step.best.log is not None:
        return False
    done = step.best.done
    if not no_gain(step.before, done, len(done.model.effects) - 1, prepared.judge, case.blocks):
        return False
    return not others or no_gain(without(found, others, case), found.final, k, case.judge, case.blocks)


def at_odds(found: Found, k: int, prepared: Prepared, case: Case) -> str:
    """Why step `k` does not do the same in every log, neither when it was found nor beside all the others; empty where it does.

    What was found after it stood in the residual then, and one log may have more of that than another.
    """
    step, last = found.steps[k], max(j for j, one in enumerate(found.steps) if one.best is not None)
    if step.best is None or step.best.log is not None:
        return ""
    why = unlike(step.before, step.best.done, k, prepared, case.blocks)
    if not why or k == last:
        return why
    return unlike(all_but(found, k, case), found.final, k, prepared, case.blocks)
