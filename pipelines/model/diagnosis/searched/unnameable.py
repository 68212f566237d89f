"""What explains the most and cannot be named by a residual: something that gives way, where no frequency response was recorded.

    other = unnameable(passing, best, tried, now, case)

It is no cause that a model gets, and not fitted exactly; but where it explains more than all that has a name, no name is given. So
it is held to what a cause is held to: among dozens of shapes one always explains some of the noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.model.diagnosis.fitted.nominal import fit_columns, rigid_rows
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.fitted.slopes import slopes_of
from pipelines.model.diagnosis.screened.screen import Screened
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.hypotheses import laid_whole
from pipelines.model.diagnosis.searched.ledger import Tried
from pipelines.model.diagnosis.worth.held_out import held_out_left

__all__ = ["unnameable"]

_MORE = 1.05  # times what the best takes away
_REPEATS = 0.3  # of the share that it takes of the fitted squared residual, held out


def unnameable(passing: Sequence[Screened], best: Tried | None, tried: Sequence[Tried], now: Refined,
               case: Case) -> Screened | None:
    """What gives way explains more than all that the residual can name, to first order even, and does so held out; what was not
    fitted exactly counts with what it explains to first order."""
    there = [one for one in passing if one.family.shapes[0].evidence not in case.nameable]
    most = max(there, key=lambda one: one.gain[0], default=None)
    known = {id(one.screened) for one in tried}
    untried = [float(one.gain[0]) for one in passing if one.family.shapes[0].evidence in case.nameable and id(one) not in known]
    taken = max([0.0 if best is None else now.rss - best.done.rss, *untried])
    if most is None or most.gain[0] <= _MORE * taken:
        return None
    return most if _repeated(most, now, case) else None


def _repeated(one: Screened, now: Refined, case: Case) -> bool:
    """Whether it takes enough off the held-out logs, to first order: chance takes as much as it may off those it was fitted to."""
    if case.judge is None:
        return True
    share = float(one.gain[0]) / max(now.rss, 1e-300)
    table = laid_whole(case.data, one.shape[0], now.model.arm)
    beta = fit_columns(case.data, np.concatenate([now.slopes, table]), now.left, now.weight).beta
    slopes, _ = slopes_of(now.model, case.judge, rigid_rows(case.judge, now.model.columns))
    seen = np.concatenate([slopes, laid_whole(case.judge, one.shape[0], now.model.arm)])
    left, weights = held_out_left(now, case.judge, case.blocks), now.weight[case.judge.joint]
    before, after = (float(np.sum(np.square(x * weights))) for x in (left, left - beta @ seen))
    return after <= (1.0 - _REPEATS * share) * before
