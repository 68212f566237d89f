"""The torque that sets a resting joint in motion, either way: from slow ramps, and from logs of a joint that holds still.

Kostić et al. 2004 leave it out of eq. (10), where friction is zero at rest: it is reported, not fitted. A joint rests while it
creeps more slowly than `_CREEP` of the speeds it is driven at; what its drive gives beyond gravity and acceleration is carried
by friction, and the most of it before the joint runs is the break-away torque. A joint that never runs shows a least value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.one_joint import gravity_columns
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.rigid.body import Array

__all__ = ["REST", "WITHIN", "BreakAway", "break_away", "held_at_least"]

_CREEP = 5e-3  # of the fastest speed
REST = 0.1  # [s] rest before a break-away
_RUNS = 5.0  # times the creeping speed: the joint runs
WITHIN = 1.0  # [s] from creeping to running, or it was no break-away
_SMOOTH = 0.01  # [s] mean over which torque is taken


@dataclass(frozen=True)
class BreakAway:
    """Break-away torque in one direction."""

    direction: int  # 1 or -1
    torque: float  # [N m] mean of the events
    std: float  # of one event; of a single event what its torque varies by within a mean
    events: int


def break_away(stretches: Sequence[Stretch], fit: LawFit) -> tuple[BreakAway, ...]:
    """Every direction in which the joint was set in motion from rest."""
    found: dict[int, list[float]] = {1: [], -1: []}
    noise: list[float] = []
    fastest = max(float(np.abs(stretch.dq).max()) for stretch in stretches)
    for stretch in stretches:
        load = friction_torque(stretch, fit)
        step = float(np.median(np.diff(stretch.t)))
        size = max(1, round(_SMOOTH / step))
        smooth = np.convolve(load, np.full(size, 1.0 / size), mode="same")
        noise.append(float(np.std(load - smooth)) / np.sqrt(size))
        for direction, first, last in _events(stretch, _CREEP * fastest, step):
            found[direction].append(float(np.max(direction * smooth[first:last])))
    return tuple(BreakAway(side, float(np.mean(values)), float(np.std(values, ddof=1)) if len(values) > 1 else max(noise),
                           len(values)) for side, values in found.items() if values)


def friction_torque(stretch: Stretch, fit: LawFit) -> Array:
    """What torque leaves for friction (samples,) [N m]: less inertia, gravity and the sway of held joints."""
    arm, coupling = fit.at(stretch)
    tau = np.where(np.isfinite(stretch.tau), stretch.tau, 0.0)
    if stretch.held:
        tau = np.concatenate([tau[:1], 0.5 * (tau[1:] + tau[:-1])])
    rigid = arm.inertia * np.gradient(stretch.dq, stretch.t) + gravity_columns(stretch.q, stretch.revolute) @ np.array(arm.gravity)
    return np.asarray(tau - rigid - stretch.sway @ coupling)


def _events(stretch: Stretch, creep: float, step: float) -> list[tuple[int, int, int]]:
    """Direction, last moments of rest and first of running, as samples, of every break-away."""
    slow = np.abs(stretch.dq) < creep
    edges = np.flatnonzero(np.diff(slow.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    found = []
    for begin, end in edges.tolist():
        if (end - begin) * step < REST or end >= len(slow):
            continue
        ahead = np.abs(stretch.dq[end:end + round(WITHIN / step)])
        runs = np.flatnonzero(ahead > _RUNS * creep)
        again = np.flatnonzero(ahead < creep)
        if runs.size and not (again.size and again[0] < runs[0]) and not stretch.spoilt[begin:end + runs[0]].any():
            found.append((int(np.sign(stretch.dq[end + runs[0]])), max(begin, end - round(WITHIN / step)), end + int(runs[0])))
    return found


def held_at_least(stretches: Sequence[Stretch], fit: LawFit) -> tuple[float, float] | None:
    """Smallest and largest torque (back, forth) [N m] that friction carried while the joint stood still throughout."""
    load = [friction_torque(replace_motion(stretch), fit)[~stretch.spoilt] for stretch in stretches]
    whole = np.concatenate(load) if load else np.zeros(0)
    return (float(np.quantile(whole, 0.01)), float(np.quantile(whole, 0.99))) if whole.size else None


def replace_motion(stretch: Stretch) -> Stretch:
    """At rest: the speed that is left is noise."""
    return stretch.moved(stretch.q, np.zeros_like(stretch.dq))
