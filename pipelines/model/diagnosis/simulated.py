"""Measured over simulated: the nominal and the extended model in closed loop, under the controller and references of a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.shared_work import shared_out
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.gains import in_loop
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.simulation import Experiment, simulate

__all__ = ["with_simulation"]

_SECONDS = 3.0  # of the log that are shown
_POINTS = 1500
_TRIED = 2  # logs: where an arm runs away in both, others are hardly worth the time


def with_simulation(found: Diagnosis, logs: Sequence[ExperimentLog]) -> Diagnosis:
    """`found` with the position error of both models in the first log in which neither runs away; as it is where that is neither of
    the first two that can be simulated."""
    if not found.evidence or found.nominal is None:
        return found
    arms = (found.nominal, *(() if found.extended is None or not found.findings else (found.extended,)))
    for log in islice(filter(partial(in_loop, found.nominal), logs), _TRIED):
        error, *more = shared_out(partial(_error, log=log), arms)
        if error is None or any(other is None for other in more):
            continue
        t = log.t[:len(error)] - log.t[0]
        every = max(1, len(t) // _POINTS)
        first = replace(found.evidence[0], simulated_t=t[::every], simulated_position_error=error[::every], simulated_log=log.name,
                        extended_position_error=more[0][::every] if more and more[0] is not None else None)
        return replace(found, evidence=(first, *found.evidence[1:]))
    return found


def _error(arm: Arm, log: ExperimentLog) -> Array | None:
    """(samples, joints) [rad] simulated minus measured position; None without a controller, or where the arm runs away."""
    try:
        experiment = Experiment.of_log(log)
        samples = min(experiment.n_samples, round(_SECONDS / log.sample_time))
        return np.asarray(simulate(arm, experiment.part(0, samples)).q[0] - log.q[:samples])
    except InputRejected:
        return None
