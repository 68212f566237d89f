"""Measured over simulated: the nominal and the extended model in closed loop, under the controller and references of a log.

    followed = followed_by(arms_of(found), logs)      what takes a simulation
    followed = as_simulated((nominal, extended))      what was simulated already
    found = with_simulation(found, followed)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.shared_work import shared_out
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.diagnosis.worth.closed_loop import in_loop
from pipelines.model.diagnosis.worth.gains import Simulation
from pipelines.model.simulation import Experiment, simulate

__all__ = ["Followed", "arms_of", "as_simulated", "followed_by", "with_simulation"]

_SECONDS = 3.0  # of the log that are shown at most
_POINTS = 1500
_TRIED = 2  # logs: where an arm runs away in both, others are hardly worth the time


@dataclass(frozen=True, eq=False)
class Followed:
    """How arms follow the references of a log."""

    log: str  # its name
    t: Array  # [s] (points,) since it began
    errors: tuple[Array, ...]  # [rad] of each arm (points, joints), simulated minus measured


def arms_of(found: Diagnosis) -> tuple[Arm, ...]:
    """The nominal model, and the extended one where something was found."""
    nominal = () if found.nominal is None else (found.nominal,)
    return nominal if found.extended is None or not found.findings else (*nominal, found.extended)


def as_simulated(arms: Sequence[Simulation]) -> Followed | None:
    """What simulations of arms, made for what these gain, have of the first of their logs; None where one of them has nothing.

    They are the arms as they were judged: what sampling has moved their numbers by, which is little, was not taken out yet.
    """
    first = [one.first for one in arms if one.first is not None]
    if not 0 < len(first) == len(arms):
        return None
    return _shown(first[0].log, first[0].t, [one.error for one in first])


def followed_by(arms: Sequence[Arm], logs: Logs) -> Followed | None:
    """The first log in which no arm runs away, held-out ones first; None where that is neither of the first two that can be run."""
    if not arms:
        return None
    for log in islice(filter(partial(in_loop, arms[0]), (*logs.validate, *logs.identify)), _TRIED):
        errors = [error for error in shared_out(partial(_error, log=log), arms) if error is not None]
        if len(errors) == len(arms):
            return _shown(log.name, log.t[:len(errors[0])] - log.t[0], errors)
    return None


def _shown(log: str, t: Array, errors: Sequence[Array]) -> Followed:
    samples = int(np.searchsorted(t, _SECONDS))
    every = max(1, samples // _POINTS)
    return Followed(log, t[:samples:every], tuple(error[:samples:every] for error in errors))


def with_simulation(found: Diagnosis, followed: Followed | None) -> Diagnosis:
    """`found` with the position errors of a nominal and an extended arm in its first picture; without any where they could not be
    simulated."""
    if not found.evidence:
        return found
    t, log = (None, "") if followed is None else (followed.t, followed.log)
    nominal, extended = (*(() if followed is None else followed.errors), None, None)[:2]
    first = replace(found.evidence[0], simulated_t=t, simulated_position_error=nominal, simulated_log=log,
                    extended_position_error=extended)
    return replace(found, evidence=(first, *found.evidence[1:]))


def _error(arm: Arm, log: ExperimentLog) -> Array | None:
    """(samples, joints) [rad] simulated minus measured position; None without a controller, or where the arm runs away."""
    try:
        experiment = Experiment.of_log(log)
        samples = min(experiment.n_samples, round(_SECONDS / log.sample_time))
        return np.asarray(simulate(arm, experiment.part(0, samples)).q[0] - log.q[:samples])
    except InputRejected:
        return None
