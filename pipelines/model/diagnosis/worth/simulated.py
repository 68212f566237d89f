"""Measured over simulated: the nominal and the extended model in closed loop, under the controller and references of a log.

    followed = as_simulated((nominal, extended))
    found = with_simulation(found, followed)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.diagnosis.worth.gains import Simulation

__all__ = ["Followed", "as_simulated", "with_simulation"]

_SECONDS = 3.0  # of the log that are shown at most
_POINTS = 1500


@dataclass(frozen=True, eq=False)
class Followed:
    """How arms follow the references of a log."""

    log: str  # its name
    t: Array  # [s] (points,) since it began
    errors: tuple[Array, ...]  # [rad] of each arm (points, joints), simulated minus measured


def as_simulated(arms: Sequence[Simulation]) -> Followed | None:
    """What simulations of arms, made for what these gain, have of the first of their logs; None where one of them has nothing.

    They are the arms as they were judged: what sampling has moved their numbers by, which is little, was not taken out yet.
    """
    first = [one.first for one in arms if one.first is not None]
    if not 0 < len(first) == len(arms):
        return None
    return _shown(first[0].log, first[0].t, [one.error for one in first])


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
