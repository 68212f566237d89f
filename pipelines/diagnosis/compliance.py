"""Name compliance by frequency responses: rows alone do not distinguish base, joint and gap.

found = compliance(logs.frf, arm)
found.named              causes that the responses name, with their numbers
untold(found)            causes that they leave open, with the reason
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipelines.diagnosis.config import RESPONSES
from pipelines.diagnosis.result import Answer, NotIdentifiable
from pipelines.dynamics.arm import Acting, Arm
from pipelines.effects import all_effects, find_effect
from pipelines.errors import InputRejected
from pipelines.frequency.findings import Seen, frf_findings
from pipelines.frequency.grouping import Finding
from pipelines.io.log import ExperimentLog

__all__ = ["Compliance", "compliance", "new_causes", "untold"]

_NO_RESPONSES = (
    "a gap is distinguished from a spring by frequency responses that show none, "
    "and there is no frf log"
)
_GIVES_WAY = "the frequency responses show compliance, and a gap is not distinguishable from it"


@dataclass(frozen=True)
class Compliance:
    """Causes in the frequency responses."""

    named: tuple[Acting, ...]
    open: str  # what they leave open, in words; empty where they do not
    seen: tuple[Seen, ...] = field(default=(), repr=False)
    # place of a cause -> joints that show it
    seen_at: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    def answers(self, acting: Acting) -> tuple[Answer, ...]:
        """Return the responses of the first joint that shows a cause."""
        joint = min(self.seen_at.get(acting.place, (0,)))
        return tuple(_answer(one) for one in self.seen if one.measured.joint == joint)


def compliance(
    logs: Sequence[ExperimentLog], arm: Arm, without: Sequence[str] = ()
) -> Compliance | None:
    """Return what frf logs show, None without any; causes in `without` are not named."""
    if not logs:
        return None
    try:
        found = frf_findings(logs, arm)
    except InputRejected as refused:
        return Compliance((), f"the frequency responses are of no use: {refused.message}")
    kinds = {kind.name for kind in all_effects() if kind.evidence == "frequency responses"}
    wanted = [one for one in found.classification if one.cause in kinds.difference(without)]
    named = tuple(_acting(one, arm) for one in wanted)
    left = "; ".join(one.evidence for one in found.undecided)
    shown = {acting.place: one.seen_at for acting, one in zip(named, wanted, strict=True)}
    return Compliance(named, left, found.seen, shown)


def new_causes(now: Compliance | None, before: Compliance | None) -> tuple[Acting, ...]:
    """Return the causes that the reference does not name, or not with these numbers."""
    named, there = (() if one is None else one.named for one in (now, before))
    known = {one.place: one for one in there}
    return tuple(x for x in named if x.place not in known or _moved(x, known[x.place]))


def _moved(now: Acting, before: Acting) -> bool:
    # a joint's frequency moves with the posture, its stiffness does not
    one, other = now.parameters[0], before.parameters[0]
    spread = float(np.hypot(one.std or 0.0, other.std or 0.0))
    return abs(one.value - other.value) > max(
        RESPONSES.deviations * spread, RESPONSES.alike * other.value
    )


def untold(told: Compliance | None, without: Sequence[str] = ()) -> tuple[NotIdentifiable, ...]:
    """Return causes that frequency responses would show, or let be named, and these do not.

    Responses are missing or undecided; a gap is distinguished from a spring only by responses that
    show no spring.
    """
    missing = "only frequency responses tell it, and there is no frf log"
    open_by = {"frequency responses": missing if told is None else told.open}
    if told is None or told.named:
        open_by["reversals"] = _NO_RESPONSES if told is None else _GIVES_WAY
    first = "Measure frequency responses, which tell a spring. " if told is None else ""
    named = () if told is None else tuple(one.effect.name for one in told.named)
    asked = [k for k in all_effects() if k.name not in (*named, *without)]
    ask = {k: (first if k.evidence == "reversals" else "") + k.words.experiment for k in asked}
    return tuple(
        NotIdentifiable(k.name, None, open_by[k.evidence], ask[k])
        for k in asked
        if open_by.get(k.evidence)
    )


def _acting(one: Finding, arm: Arm) -> Acting:
    """Return the cause with the numbers that the responses give."""
    kind = find_effect(one.cause or "")
    joint = one.joint if kind.scope == "joint" else None
    values = {name: x.value for name, x in one.parameters.items()}
    stds = {name: x.std for name, x in one.parameters.items()}
    turning = joint is None or arm.robot.revolute[joint - 1]
    return Acting.of(kind(joint=joint), values, stds, revolute=turning)


def _answer(one: Seen) -> Answer:
    first = one.measured.first
    shown = one.modes.relative.within(*one.modes.band)
    unit = "1" if first.quantity == "r" else "1/(kg m^2)" if first.revolute else "1/kg"
    fitted, at = np.abs(one.modes.fit.response(shown.frequency)), np.asarray(first.posture, float)
    seen = (shown.frequency, np.abs(shown.response), shown.coherence)
    return Answer(one.measured.joint, at, unit, *seen, fitted)
