"""Of causes that explain nearly the same, the plainest.

    best = fewest(tried)            of hypotheses fitted exactly, best first
    count = different(places)       how many causes there are
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence

from pipelines.model.diagnosis.searched.ledger import Tried

__all__ = ["PARSIMONY", "different", "fewest"]

PARSIMONY = 0.02  # of what the best takes away
_WORSE = 1.1  # times what the best leaves of its joint: a fault far above the noise tells such causes apart


def fewest(tried: Sequence[Tried]) -> Tried | None:
    """Of those at the joint of the best that leave nearly as little, one whose further number is worth it, else the one with
    fewest; where the best is of the arm, of those at any joint; none where the best leaves no less, held out or on a par.

    What happened once is ranked by the log that it was fitted to, which is no held-out error: what lasts, leaves as little of the
    fitted logs and less of the others is better.
    """
    possible = [one for one in tried if max(one.error, one.rank) < 1.0 and one.possible]
    if not possible:
        return None
    if possible[0].log is not None:
        possible = [one for one in possible if one.log is None and one.done.rss <= possible[0].done.rss] or possible
    best = possible[0]
    joint = best.screened.joint
    own = slice(None) if joint is None else slice(joint - 1, joint)
    there = [one for one in possible if joint in (None, one.screened.joint)
             and (one.done.rms[own] <= _WORSE * best.done.rms[own]).all()]
    near = [one for one in there if one.rank - best.rank <= PARSIMONY * (1.0 - best.rank) or _as_good(one, best)]
    return min(near, key=lambda one: (not one.sure, one.done.model.effects[-1].count, one.rank))


def _as_good(plain: Tried, best: Tried) -> bool:
    """Whether the further numbers of the best take less than chance lets them, beside a cause it could be mistaken for: a number is
    worth log n of the squared residual in units of its variance (Schwarz 1978), fitted and held out.

    Under much noise a polynomial with six numbers always leaves a little less than the constant torque that is there.
    """
    further = best.done.model.effects[-1].count - plain.done.model.effects[-1].count
    if further < 1 or best.sure or plain.log is not None or plain.effect.name not in best.effect.twins:
        return False
    rows = best.done.data.rows
    price = further * math.log(rows) / rows
    return plain.done.rss - best.done.rss < price * best.done.rss and plain.error - best.error < price * best.error


def different(places: Iterable[tuple[str, int | None]]) -> int:
    """How many causes these are, by name and joint: one that is there at several joints counts once, two at one joint twice."""
    there = Counter(places)
    return sum(max(count for (name, _), count in there.items() if name == wanted) for wanted in {name for name, _ in there})
