"""Analyse what a fitted model leaves: over time, and against all that it may depend on.

evidence(fit, floor, …)           the residual over time, and against all that it may depend on
proof(before, after, joint, …)    of the joint that shows most of a finding
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.estimation.config import ResidualConfig
from pipelines.estimation.filters import welch
from pipelines.estimation.model_fit import Refined
from pipelines.estimation.rows import Data, LogData
from pipelines.io.log import Array
from pipelines.simulation.comparison import Simulation

_CONFIG = ResidualConfig()


@dataclass(frozen=True)
class Proof:
    """The figure that proves a finding: the residual before and after, and what the cause predicts.

    Of the joint that shows most of it, over the signal that the cause depends on, in bins of equal
    count, or, where it depends on none, the amplitudes of all three over frequency.
    """

    joint: int  # 1-based, whose residual is shown
    against: str  # a signal of `signals`, or "frequency"
    unit: str
    x: Array  # (bins,) middle of each
    before: Array  # (bins,) [N m] mean residual without the finding
    after: Array  # with it
    predicted: Array  # what the finding predicts of `before`
    spread: Array  # (bins,) [N m] standard error of `before`; none over frequency


@dataclass(frozen=True)
class Curve:
    """The residual against one signal of its joint, in bins of equal count."""

    joint: int
    against: str
    unit: str
    x: Array  # (bins,)
    mean: Array  # [N m]
    spread: Array  # [N m] standard deviation within the bin
    explained: float  # share of the residual's power that the means hold


@dataclass(frozen=True)
class Evidence:
    """Residual analysis of one log."""

    log: str  # name of the log that is shown
    t: Array  # [s] (points,)
    measured: Array  # [N m] (points, joints) after the low-pass
    predicted: Array
    residual: Array
    simulated_t: Array | None  # [s] (points,)
    simulated_position_error: Array | None  # [rad] (points, joints) simulated minus measured
    curves: tuple[Curve, ...]
    above_noise_floor: Array  # (joints,) share of the residual's power that is above the floor
    band: Array  # (joints, 2) [Hz] in which most of that lies
    simulated_log: str = ""  # name of the log that was simulated in closed loop
    extended_position_error: Array | None = None  # [rad] (points, joints) of the extended model


# name, unit, and values at the moments of one joint's rows, logs one behind the other
Signal = tuple[str, str, Array]


def binned(x: Array, y: Array, bins: int = _CONFIG.curve_bins) -> tuple[Array, Array, Array, Array]:
    """Return x, mean and standard deviation of `y`, and count, in bins of equal count of `x`."""
    order = np.argsort(x, kind="stable")
    edges = np.linspace(0, len(x), min(bins, max(1, len(x) // _CONFIG.rows)) + 1).astype(int)
    first, count = edges[:-1], np.diff(edges).astype(np.float64)
    mean_x, mean, square = (np.add.reduceat(v[order], first) / count for v in (x, y, y**2))
    return mean_x, mean, np.sqrt(np.maximum(square - mean**2, 0.0)), count


def _followed(signal: Signal, y: Array) -> float:
    """Return the power of `y` that survives averaging over a signal: the sum of squared means."""
    _, mean, _, count = binned(signal[2], y)
    return float(np.sum(count * mean**2))


def signals(data: Data, joint: int, load: Array) -> list[Signal]:
    """Return what the residual of `joint` (from 0) may depend on; `load` (rows,) is the torque."""
    revolute = data.logs[0].log.robot.revolute
    q, dq = (_at_rows(data, name) for name in ("q", "dq"))
    angle, force = ("rad", "N m") if revolute[joint] else ("m", "N")
    travel = np.concatenate([_travel(one, joint) for one in data.logs])
    found = [
        ("time", "s", np.concatenate([one.t - one.t[0] for one in data.logs])),
        ("position", angle, q[:, joint]),
        ("speed", f"{angle}/s", dq[:, joint]),
        ("load", force, load[data.joint == joint]),
        ("travel since reversal", angle, travel),
    ]
    for other, turns in enumerate(revolute):
        if other != joint:
            unit = "rad" if turns else "m"
            found.append((f"position of joint {other + 1}", unit, q[:, other]))
            found.append((f"speed of joint {other + 1}", f"{unit}/s", dq[:, other]))
    return found


def _at_rows(data: Data, name: str) -> Array:
    return np.concatenate([one.at_rows(getattr(one.motion, name)) for one in data.logs])


def _travel(one: LogData, joint: int) -> Array:
    """Return the signed distance from where the joint last reversed."""
    q = one.motion.q[:, joint]
    begin = np.append(0, np.flatnonzero(np.diff(np.sign(one.motion.dq[:, joint])) != 0) + 1)
    which = np.searchsorted(begin, np.arange(len(q)), side="right") - 1
    return np.asarray(one.at_rows(q - q[begin[which]]))


def evidence(done: Refined, floor: Array, nominal: Simulation, extended: Simulation) -> Evidence:
    """Return the residual of the nominal model over the first log, curves over all,
    and the position errors of both models where both ran in closed loop.
    """
    data, left, n = done.data, done.left, done.data.n_joints
    predicted = data.y - left
    measured, modelled, rest = (next(iter(data.split(x))).T for x in (data.y, predicted, left))
    curves, bands = list[Curve](), np.full((n, 2), np.nan)
    parts = list(data.split(left))
    longest = max(range(len(parts)), key=lambda k: len(parts[k][0]))
    for joint in range(n):
        own = left[data.joint == joint]
        power = max(float(own @ own), 1e-300)
        for one in signals(data, joint, predicted):
            x, mean, spread, count = binned(one[2], own)
            share = float(np.sum(count * mean**2)) / power
            curves.append(Curve(joint + 1, one[0], one[1], x, mean, spread, share))
        lines = _over_frequency(data.logs[longest], parts[longest][joint])
        if lines is not None:
            total = np.cumsum(np.square(lines[1])) / max(float(np.sum(lines[1] ** 2)), 1e-300)
            ends = np.searchsorted(total, (0.5 - 0.5 * _CONFIG.band, 0.5 + 0.5 * _CONFIG.band))
            bands[joint] = lines[0][np.minimum(ends, len(total) - 1)]
    every = slice(None, None, max(1, -(-len(measured) // _CONFIG.series)))
    first = nominal.first if extended.first is not None else None
    shown = slice(0)
    if first is not None:
        samples = int(np.searchsorted(first.t, _CONFIG.seconds))
        shown = slice(0, samples, max(1, samples // _CONFIG.points))
    return Evidence(
        log=data.logs[0].log.name,
        t=data.logs[0].t[every],
        measured=measured[every],
        predicted=modelled[every],
        residual=rest[every],
        simulated_t=None if first is None else first.t[shown],
        simulated_position_error=None if first is None else first.error[shown],
        curves=tuple(curves),
        above_noise_floor=np.clip(1.0 - np.square(floor / done.rms), 0.0, 1.0),
        band=bands,
        simulated_log="" if first is None else first.log,
        extended_position_error=None
        if first is None or extended.first is None
        else extended.first.error[shown],
    )


def _over_frequency(one: LogData, x: Array) -> tuple[Array, Array] | None:
    """Return frequencies [Hz] and amplitudes of bins of x (rows,); None of too short a log.

    The squares of the amplitudes add up to the mean square of x.
    """
    if len(x) < 64:
        return None
    step = float(np.median(np.diff(one.t)))
    frequency, density = welch(x[:, None], 1.0 / step, min(_CONFIG.segment, len(x) // 2))
    return frequency, np.sqrt(density[:, 0] * (frequency[1] - frequency[0]))


def proof(
    before: Refined, after: Refined, joint: int | None, log: int | None = None, event: bool = False
) -> Proof:
    """Return the residual over the signal by which the cause is predicted best.

    Over frequency where no signal is: what a resonance adds is not alike along an angle or a speed.
    An event is shown over the time of its log; one that comes in every log over that of all.

    Args:
        log: place of the log it happened in, among those of the rows.
        event: whether it happened.
    """
    data = before.data
    three = (before.left, after.left, before.left - after.left)
    shown = joint - 1 if joint is not None else int(np.argmax(data.rms(three[2]) / before.rms))
    parts = [x[data.joint == shown] for x in three]
    if log is not None:
        there = data.log_of[data.joint == shown] == log
        best: Signal = ("time", "s", data.logs[log].t)
        return _over(best, [x[there] for x in parts], shown)
    time, *others = signals(data, shown, data.y - before.left)
    power = {one[0]: _followed(one, parts[2]) for one in (time, *others)}
    # in a log that goes once through its range anything is shown over time: when, and not by what
    best = max(others, key=lambda one: power[one[0]])
    if event or power[best[0]] < _CONFIG.as_much * power["time"]:
        best = time
    if not event and power[best[0]] < _CONFIG.shown * float(parts[2] @ parts[2]):
        own = [[x[shown] for x in data.split(whole)] for whole in three]
        place = max(range(len(own[2])), key=lambda k: float(np.sum(np.square(own[2][k]))))
        lines = [_over_frequency(data.logs[place], x[place]) for x in own]
        if found := [one for one in lines if one is not None]:
            hertz, none = found[0][0], np.zeros(len(found[0][0]))
            without, with_it, predicted = (amplitude for _, amplitude in found)
            curves = (hertz, without, with_it, predicted, none)
            return Proof(shown + 1, "frequency", "Hz", *curves)
    return _over(best, parts, shown)


def _over(signal: Signal, parts: Sequence[Array], joint: int) -> Proof:
    """Return `parts`, without the finding, with it and what it predicts, over a signal."""
    name, unit, values = signal
    x, without, spread, count = binned(values, parts[0], _CONFIG.bins)
    with_it, predicted = (binned(values, part, _CONFIG.bins)[1] for part in parts[1:])
    curves = (x, without, with_it, predicted, spread / np.sqrt(count))
    return Proof(joint + 1, name, unit, *curves)
