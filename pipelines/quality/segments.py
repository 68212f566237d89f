"""Say which samples of a log a stage may use: contiguous stretches, and a mask of what is missing or spoilt in them.

    good = usable(log)
    for run in good.runs:                      slices of good.log without a gap or a step of the clock
        q = good.log.q[run]
        fit only where good.fit[run] holds     nothing missing, saturated or spiky on any joint

A recording is never changed: `good.log` is a copy in memory in which time runs in seconds, repeated samples are
dropped and a wrapped encoder is unwrapped. Missing values are NaN there; nothing is interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.io.experiment import Array, ExperimentLog, Signal
from pipelines.io.limits import GAP_LIMIT, GAP_TICKS, SHORTEST
from pipelines.io.order_statistics import quantile
from pipelines.quality.faults import (
    Mask,
    TimeBase,
    jumps,
    missing,
    quantum,
    saturated,
    spikes,
    time_base,
    torque_limit,
)
from pipelines.quality.stop import emergency_stop

__all__ = ["SHORTEST", "Usable", "unwrapped", "usable"]

_COUNTERS = tuple(2**bits for bits in (12, 13, 14, 16, 17, 18, 19, 20, 24, 32))


@dataclass(frozen=True, eq=False)
class Usable:
    """A log as a stage may use it. Masks have the shape of `log.q`."""

    log: ExperimentLog  # mended copy
    steps: tuple[float | None, ...]  # [rad] (joints) in which each encoder counts, where it can be seen
    kept: npt.NDArray[np.intp]  # (samples,) index of each sample in the recording
    runs: tuple[slice, ...]  # contiguous stretches of at least SHORTEST samples, in time order of recording
    missing: Mask  # no measurement of position or torque
    position_spikes: Mask
    torque_spikes: Mask
    saturated: Mask
    wrapped: Array  # (samples, joints) [rad] what wraps had added to the recorded position
    jumped: Mask  # first sample after a jump of the position that is no wrap
    end: int  # samples from here on come after an emergency stop
    time: TimeBase  # of the recording

    @property
    def spikes(self) -> Mask:
        return self.position_spikes | self.torque_spikes

    @property
    def fit(self) -> Mask:
        """(samples,) nothing is wrong with any joint's sample, and it lies in a run."""
        inside = np.zeros(self.log.n_samples, dtype=bool)
        for run in self.runs:
            inside[run] = True
        return inside & ~(self.missing | self.spikes | self.saturated).any(axis=1)


def usable(log: ExperimentLog) -> Usable:
    """What of `log` can be used, and how; a log that `checks` rejects may have no run at all."""
    time = time_base(log)
    keep = np.ones(log.n_samples, dtype=bool)
    keep[time.undefined] = False
    keep[time.repeated + 1] = False
    keep[time.conflicting + 1] = False
    kept = np.flatnonzero(keep)
    signals = {name: replace(signal, values=signal.values[kept]) for name, signal in log.signals.items()}
    signals["t"] = Signal(signals["t"].values * time.scale, "s", signals["t"].long_name)
    lost = {name: missing(signal.values) for name, signal in signals.items() if name != "t"}
    for name, mask in lost.items():
        signals[name] = replace(signals[name], values=np.where(mask, np.nan, signals[name].values))
    wrapped, jumped = unwrapped(replace(log, signals=signals))
    signals["q"] = replace(signals["q"], values=signals["q"].values - wrapped)
    mended = replace(log, signals=signals)
    gone = lost["q"] | lost["tau"]
    steps = tuple(quantum(column) for column in mended.q.T)
    smallest = _position_floor(mended, steps)
    glitches = spikes(mended.q, True, smallest), spikes(mended.tau, False, _torque_floor(mended, smallest))
    stop = emergency_stop(mended)
    end = len(kept) if stop is None else stop[0]
    return Usable(mended, steps, kept, _runs(mended, time, gone, jumped, end), gone, *glitches, saturated(mended), wrapped,
                  jumped, end, time)


def _position_floor(log: ExperimentLog, shown: tuple[float | None, ...]) -> Array:
    """(joints,) [rad] no deviation below eight encoder steps is a glitch."""
    steps = [max(step or 0.0, joint.encoder_resolution or 0.0) for step, joint in zip(shown, log.robot.joints, strict=True)]
    return np.maximum(8.0 * np.array(steps), 1e-9)


def _torque_floor(log: ExperimentLog, smallest: Array) -> Array:
    """(joints,) [N m] 5 % of the range, 1 % of the limit, and what one encoder step does through the controller."""
    with np.errstate(invalid="ignore"):
        finite = np.where(np.isfinite(log.tau), log.tau, 0.0)
    low, high = (quantile(finite, share) if len(finite) else np.zeros(log.n_joints) for share in (0.01, 0.99))
    limit = torque_limit(log)
    floor = np.maximum(0.05 * (high - low), np.where(np.isfinite(limit), 0.01 * limit, 0.0))
    control = log.controller
    if control is not None and control.kp is not None and control.kd is not None and control.law.startswith("pd"):
        floor = np.maximum(floor, (control.kp + control.kd / log.sample_time) * smallest / 4.0)
    return np.asarray(np.maximum(floor, 1e-9))


def unwrapped(log: ExperimentLog) -> tuple[Array, Mask]:
    """What wraps at full turns and counter roll-overs added to each position (samples, joints) [rad]; and the first
    sample after every jump that is neither."""
    nothing = np.zeros_like(log.q), np.zeros(log.q.shape, dtype=bool)
    jump, size = jumps(log.q)
    jump &= (np.abs(np.diff(log.t)) < 1.5 * log.sample_time)[:, None]  # across a gap the arm may have gone anywhere
    if not jump.any():
        return nothing
    undo = np.zeros_like(size)
    for j, joint in enumerate(log.robot.joints):
        step = joint.encoder_resolution or quantum(log.q[:, j])
        periods = ([2.0 * np.pi] if joint.revolute else []) + ([step * c for c in _COUNTERS] if step else [])
        for period in periods:
            turns = np.rint(size[:, j] / period)
            # what is left beside whole periods must be small beside the period, and few periods at once
            fits = jump[:, j] & (turns != 0) & (np.abs(size[:, j] - turns * period) < 0.05 * period) & (np.abs(turns) < 3)
            undo[fits, j] = turns[fits] * period
            jump[fits, j] = False
    first = np.zeros((1, log.n_joints))
    return np.concatenate([first, np.cumsum(undo, axis=0)]), np.concatenate([first > 0, jump])


def _runs(log: ExperimentLog, time: TimeBase, gone: Mask, jumped: Mask, end: int) -> tuple[slice, ...]:
    """Stretches between steps of the clock, gaps, long missing blocks and position jumps."""
    tick = log.sample_time if time.known else time.median
    with np.errstate(invalid="ignore"):
        ticks = np.diff(log.t) / tick
        cut = (ticks <= 0.0) | (ticks > GAP_TICKS) | _any_joint(jumped[1:])
    blocks = long_blocks(_any_joint(gone))
    bad = np.zeros(log.n_samples, dtype=bool)
    for start, stop in blocks:
        bad[start:stop] = True
    bad[end:] = True
    edges = np.concatenate(([0], np.flatnonzero(cut | (bad[1:] != bad[:-1])) + 1, [log.n_samples]))
    return tuple(slice(int(a), int(b)) for a, b in pairwise(edges)
                 if b - a >= SHORTEST and not bad[a])


def _any_joint(mask: Mask) -> Mask:
    return np.asarray(mask.any(axis=1))


def long_blocks(mask: Mask) -> list[tuple[int, int]]:
    """From-to of the runs of `mask` that are longer than an observer can predict through."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8))).reshape(-1, 2)
    return [(int(a), int(b)) for a, b in edges if b - a > GAP_LIMIT]
