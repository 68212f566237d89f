"""Arms moved by the controllers of logs, by two processes.

    in_loop(arm, log)                       whether that can be
    in_loops(arms, motions, seconds)        simulated and measured positions of each arm in each log
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.shared_work import shared_out
from pipelines.model.arm import Arm
from pipelines.model.estimation.logs import Motions
from pipelines.model.simulation import Experiment, Plant, Step, choose_step, runs_alone, simulate_together

__all__ = ["Positions", "in_loop", "in_loops"]

Positions = tuple[Array, Array, float]  # simulated and measured (samples, joints) [rad], and the time between samples [s]

T = TypeVar("T")


def in_loop(arm: Arm, log: ExperimentLog) -> bool:
    """Return whether the log's controller is known, and the arm, where the log begins, has an inertia that can be moved."""
    try:
        Plant.of(arm).refuse_unphysical(Experiment.of_log(log).q_ref[:1])
    except InputRejected:
        return False
    return True


def in_loops(arms: Sequence[Arm], motions: Motions, seconds: float) -> list[list[Positions] | None]:
    """Of each arm those in each log, over its first `seconds`; None of one that runs away, or is none that can be simulated.

    Raises:
        InputRejected: a log does not describe its controller.
    """
    first = [_first(log, seconds) for log, _ in motions]
    # One controller and arm: what suffices for a log suffices for the next.
    steps = shared_out(lambda arm: _if_possible(lambda: choose_step(Plant.of(arm), first[0])), arms)
    pieces = [(k, step, places) for k, step in enumerate(steps) if step is not None for places in _apart(arms[k], first)]
    pieces.sort(key=lambda piece: -len(piece[2]))  # what takes arrays takes longest

    def moved(piece: tuple[int, Step, tuple[int, ...]]) -> list[Array] | None:
        k, step, places = piece
        return _if_possible(lambda: _moved(arms[k], [first[place] for place in places], step))

    found: list[dict[int, Array] | None] = [{} if step is not None else None for step in steps]
    for (k, _, places), done in zip(pieces, shared_out(moved, pieces), strict=True):
        before = found[k]
        found[k] = None if before is None or done is None else before | dict(zip(places, done, strict=True))
    return [None if one is None else [(one[place], log.q[:len(one[place])], log.sample_time)
                                      for place, (log, _) in enumerate(motions)] for one in found]


def _apart(arm: Arm, experiments: Sequence[Experiment]) -> list[tuple[int, ...]]:
    """Places of the experiments that are simulated together: each by itself where nothing is saved by others beside it."""
    every = tuple(range(len(experiments)))
    return [(place,) for place in every] if all(runs_alone(arm, one) for one in experiments) else [every]


def _moved(arm: Arm, experiments: Sequence[Experiment], step: Step) -> list[Array]:
    return [done.q[0] for done in simulate_together(arm, experiments, steps={one.sample_time: step for one in experiments})]


def _first(log: ExperimentLog, seconds: float) -> Experiment:
    experiment = Experiment.of_log(log)
    return experiment.part(0, min(experiment.n_samples, round(seconds / log.sample_time)))


def _if_possible(work: Callable[[], T]) -> T | None:
    """What `work` makes; None where no arm can be simulated so (D15, D17)."""
    try:
        return work()
    except InputRejected:
        return None
