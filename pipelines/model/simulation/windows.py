"""Simulate short windows open loop, from where a smoother saw the arm: for logs whose controller nobody knows.

Every window starts at the reconstructed position and speed and follows the logged torque; all windows run at once. Without
feedback an error grows with the square of time, so that windows must be short, and their error is one of position after that
time, no tracking error.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.model.rigid.body import Array, Motion
from pipelines.model.simulation.integrate import RungeKutta
from pipelines.model.simulation.plant import Plant

__all__ = ["Windows", "simulate_windows"]

Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.intp]

_AT_ONCE = 256  # windows
_TOLERANCE = 1e-7  # [rad] of the step
_CANDIDATES = (1, 2, 4, 8, 16, 32, 64)


@dataclass(frozen=True, eq=False)
class Windows:
    """Simulated motion over the windows, one behind the other; NaN in samples that no window covers."""

    q: Array  # [rad] (samples, joints) as the encoders would see it
    dq: Array  # [rad/s]
    first: Indices  # sample at which each window starts
    length: int  # samples
    steps: int  # of the integrator, a sample


def simulate_windows(plant: Plant, motion: Motion, tau: Array, sample_time: float, length: int,
                     usable: Mask | None = None, share: float = 0.0, steps: int | None = None) -> Windows:
    """Follow `tau` (samples, joints) from the state that `motion` has at the start of every window of `length` samples.

    Args:
        tau: held from each sample to the next.
        usable: (samples,) where motion and torque are known without gaps; everywhere where left out.
        share: of the distance from `motion`, that a position may be wrong by (root mean square, joint by joint), where that is more
            than the usual 1e-7 rad.
        steps: of the integrator, a sample; by default as few as this asks for.

    Raises:
        InputRejected: T08, no window fits; D15, the model's inertia matrix is singular or worse; D17, the step would be too small
            to be of use.
    """
    good: Mask = np.asarray(np.isfinite(tau).all(axis=1) & np.isfinite(motion.q).all(axis=1))
    if usable is not None:
        good = good & usable
    uneven = np.abs(np.diff(motion.t) - sample_time) > 0.5 * sample_time
    first = _starts(good, uneven, length)
    if not len(first):
        raise InputRejected("T08", f"no window of {length} samples is without a gap", remedy="ask for shorter windows")
    plant.refuse_unphysical(motion.q[first])
    tried = first[np.linspace(0, len(first) - 1, min(len(first), 32)).astype(int)]
    if steps is None:
        steps = _steps(plant, motion, tau, sample_time, tried, length, share)
    q, dq = np.full(motion.q.shape, np.nan), np.full(motion.q.shape, np.nan)
    for begin in range(0, len(first), _AT_ONCE):
        some = first[begin:begin + _AT_ONCE]
        rows = (some[:, None] + np.arange(length)).ravel()
        moved = _follow(plant, motion, tau, sample_time, some, length, steps)
        q[rows], dq[rows] = (part.reshape(len(rows), -1) for part in np.split(moved, 2, axis=2))
    return Windows(q, dq, first, length, steps)


def _starts(good: Mask, uneven: Mask, length: int) -> Indices:
    """First samples of windows of `length` good samples, side by side; `uneven` (samples - 1,) tells where the clock jumps."""
    ends = [0, *(np.flatnonzero((good[1:] != good[:-1]) | uneven) + 1).tolist(), len(good)]
    runs = [np.arange(a, b - length + 1, length) for a, b in pairwise(ends) if good[a]]
    return np.concatenate([np.zeros(0, dtype=np.intp), *runs])


def _steps(plant: Plant, motion: Motion, tau: Array, sample_time: float, first: Indices, length: int, share: float) -> int:
    """The fewest steps a sample whose halving changes no position by more than the tolerance."""
    seen, coarse = motion.q[first[:, None] + np.arange(length)], None
    for steps in (*_CANDIDATES, 2 * _CANDIDATES[-1]):
        with np.errstate(all="ignore"):
            fine = _follow(plant, motion, tau, sample_time, first, length, steps)[..., :tau.shape[1]]
            if coarse is not None and (np.abs(fine - coarse).max() <= _TOLERANCE
                                       or (share > 0.0 and (_rms(fine - coarse) <= share * _rms(fine - seen)).all())):
                return steps // 2
        coarse = fine
    raise InputRejected("D17", f"{_CANDIDATES[-1]} steps a sample do not settle the simulation",
                        remedy="friction that changes sign within a very small speed needs a lower sharpness")


def _rms(x: Array) -> Array:
    """(joints,) over windows and samples."""
    return np.asarray(np.sqrt(np.mean(np.square(x), axis=(0, 1))))


@np.errstate(all="ignore")  # a window may run away: its steps do not settle then
def _follow(plant: Plant, motion: Motion, tau: Array, sample_time: float, first: Indices, length: int, steps: int) -> Array:
    """q and dq (windows, length, 2 joints) of the windows that start at `first`."""
    moving = plant.prepared(len(first))
    integrator = RungeKutta(moving, sample_time, steps)
    n = tau.shape[1]
    state = np.ascontiguousarray(np.concatenate([motion.q[first], motion.dq[first]], axis=1).T)
    t = motion.t[first].copy()
    ddq = motion.ddq[first].T
    state[:] = moving.settled(t, state[:n], state[n:], ddq)
    # memories count from the start of the log
    states = moving.at_start(np.full_like(t, motion.t[0]), state[:n], state[n:], ddq)
    out = np.empty((length, 2 * n, len(first)))
    for k in range(length):
        out[k] = state
        out[k, :n] = moving.measured(state[:n], states)
        command = np.ascontiguousarray(tau[first + k].T)
        if moving.n_states:
            states = moving.updated(t, state[:n], state[n:], states, command)
        states = integrator.advance(t, state, states, command)
        t = t + sample_time
    return np.ascontiguousarray(np.moveaxis(out, 2, 0))
