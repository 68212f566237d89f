"""Search, tell causes apart, rehearse: the best motion of all that this finds.

    found = best(task, pair, Effort(seconds=30), seed, rehearse=True)
    found.design, found.rehearsal, found.apart
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from pipelines.model.excitation.apart import Apart, Pair, judged_again, told_apart
from pipelines.model.excitation.design import Design, Effort, design
from pipelines.model.excitation.rehearse import Rehearsal, rehearsed_design
from pipelines.model.excitation.task import Task

__all__ = ["Found", "best"]


@dataclass(frozen=True, eq=False)
class Found:
    """A motion as the robot is to execute it."""

    design: Design
    rehearsal: Rehearsal | None = None
    failed: str = ""  # why there is no rehearsal
    apart: Apart | None = None  # where two causes were to be told apart

    @property
    def safe(self) -> bool:
        """Nothing is said against it by a rehearsal."""
        return not self.failed and (self.rehearsal is None or self.rehearsal.safe)


def best(task: Task, pair: Pair | None, effort: Effort, seed: int, rehearse: bool) -> Found:
    """The design for the parameters; with a pair, one that tells them apart as well, where that is better as it stands at the end.

    Half the time is given to either search.

    Raises:
        UsageError: C08, no motion keeps the limits: says which one is in the way.
    """
    if pair is None:
        return _rehearsed(task, design(task, effort, seed), effort, seed, rehearse)
    half = replace(effort, seconds=0.5 * effort.seconds)
    plain = design(task, half, seed)
    if plain.stopped:
        return _rehearsed(task, plain, effort, seed, rehearse)
    changed, apart = told_apart(task, plain, pair, half.seconds, half.evaluations, seed, effort.tell)
    found = replace(_rehearsed(task, changed, effort, seed, rehearse), apart=apart)
    if found.design.trajectory is not changed.trajectory:  # made smaller
        apart = judged_again(task, found.design, pair, apart)
        found = replace(found, apart=apart if apart.changed else replace(apart, before=apart.after))
    stopped = found.design.stopped != changed.stopped  # in its rehearsal: no further one is wanted
    if not apart.changed or stopped or (found.safe and apart.gained(task)):
        return found
    return _better(task, found, _rehearsed(task, plain, effort, seed, rehearse), pair, apart)


def _rehearsed(task: Task, found: Design, effort: Effort, seed: int, rehearse: bool) -> Found:
    return Found(*rehearsed_design(task, found, seed, effort.tell)) if rehearse else Found(found)


def _better(task: Task, found: Found, plain: Found, pair: Pair, apart: Apart) -> Found:
    """`found`, which its rehearsal spoilt, or the plain design as its own rehearsal leaves it."""
    before = judged_again(task, plain.design, pair, apart).after
    apart = replace(apart, before=before)
    if apart.gained(task) and (found.safe or not plain.safe):
        return replace(found, apart=apart)
    kept = replace(plain.design, evaluations=found.design.evaluations, stopped=found.design.stopped or plain.design.stopped)
    return replace(plain, design=kept, apart=replace(apart, after=before, changed=False))
