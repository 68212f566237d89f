"""Find the torque that sets a resting joint in motion, either way.

It shows in slow ramps, and in logs of a joint that holds still. Kostić et al. 2004 leave it out of
eq. (10), where friction is zero at rest: it is reported, not fitted. A joint rests while it creeps
more slowly than a part of the speeds it is driven at; what its drive gives beyond gravity and
acceleration is carried by friction, and the most of it before the joint runs is the break-away
torque. A joint that never runs shows a least value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.friction.config import BreakAwayConfig
from pipelines.friction.fit import LawFit, Value
from pipelines.friction.laws import gravity_columns
from pipelines.friction.weak_form import Stretch

__all__ = ["Event", "break_away", "held_at_least"]


_CONFIG = BreakAwayConfig()


@dataclass(frozen=True)
class Event:
    """Break-away torque in one direction: the mean of its events and the deviation of one."""

    direction: int
    torque: Value
    events: int


def break_away(stretches: Sequence[Stretch], fit: LawFit) -> tuple[Event, ...]:
    """Return every direction in which the joint was set in motion from rest.

    The deviation of a single event is what torque varies by within a mean.
    """
    torques: dict[int, list[float]] = {1: [], -1: []}
    noise: list[float] = []
    fastest = max(float(np.abs(stretch.dq).max()) for stretch in stretches)
    for stretch in stretches:
        load = _friction(stretch, fit)
        step = float(np.median(np.diff(stretch.t)))
        size = max(1, round(_CONFIG.smooth / step))
        smooth = np.convolve(load, np.full(size, 1.0 / size), mode="same")
        noise.append(float(np.std(load - smooth)) / np.sqrt(size))
        for direction, first, last in _events(stretch, _CONFIG.creep * fastest, step):
            torques[direction].append(float(np.max(direction * smooth[first:last])))
    unit, events = fit.joint.units[0], []
    for side, values in torques.items():
        if values:
            std = float(np.std(values, ddof=1)) if len(values) > 1 else max(noise)
            events.append(Event(side, Value(float(np.mean(values)), std, unit), len(values)))
    return tuple(events)


def held_at_least(stretches: Sequence[Stretch], fit: LawFit) -> tuple[float, float] | None:
    """Return the least and largest torque [N m] that friction carried while a joint rested.

    The speed that is left is noise.
    """
    loads = [_friction(replace(stretch, dq=np.zeros_like(stretch.dq)), fit)[~stretch.spoilt]
             for stretch in stretches]
    load = np.concatenate([*loads, np.zeros(0)])
    return (float(np.quantile(load, 0.01)), float(np.quantile(load, 0.99))) if load.size else None


def _friction(stretch: Stretch, fit: LawFit) -> Array:
    """Return what torque leaves for friction (samples,) [N m]."""
    arm, coupling = fit.at(stretch)
    tau = stretch.known_tau
    tau = np.concatenate([tau[:1], 0.5 * (tau[1:] + tau[:-1])])
    weight = gravity_columns(stretch.q, stretch.revolute) @ np.array(arm.gravity)
    rigid = arm.inertia * np.gradient(stretch.dq, stretch.t) + weight
    return np.asarray(tau - rigid - stretch.sway @ coupling)


def _events(stretch: Stretch, creep: float, step: float) -> list[tuple[int, int, int]]:
    """Return direction, last sample of rest and first of running, of every break-away."""
    slow, events = np.abs(stretch.dq) < creep, []
    edges = np.flatnonzero(np.diff(slow.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    near = round(_CONFIG.within / step)
    for begin, end in edges.tolist():
        if (end - begin) * step < _CONFIG.rest or end >= len(slow):
            continue
        ahead = np.abs(stretch.dq[end:end + near])
        runs = np.flatnonzero(ahead > _CONFIG.runs * creep)
        again = np.flatnonzero(ahead < creep)
        if not runs.size or (again.size and again[0] < runs[0]):
            continue
        run = end + int(runs[0])
        if not stretch.spoilt[begin:run].any():
            events.append((int(np.sign(stretch.dq[run])), max(begin, end - near), run))
    return events
