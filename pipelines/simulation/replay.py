"""Simulate short windows open loop, from where a smoother saw the arm: for unknown controllers.

Every window starts at the reconstructed position and speed and follows the logged torque; all
windows run at once. Without feedback an error grows with the square of time, so that windows must
be short, and their error is one of position after that time, no tracking error.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion
from pipelines.errors import InputRejected
from pipelines.io.log import ExperimentLog
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.integrate import RungeKutta
from pipelines.simulation.plant import Plant

__all__ = ["Windows", "held_torque", "simulate_windows"]

Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Windows:
    """Simulated motion over consecutive windows; NaN in samples outside them."""

    q: Array  # [rad] (samples, joints) as the encoders would see it
    dq: Array  # [rad/s]
    first: Indices  # sample at which each window starts
    length: int  # samples
    steps: int  # of the integrator, a sample


@dataclass(frozen=True, eq=False)
class _Followed:
    """A plant, the motion whose states windows start from, and the torque that they follow."""

    plant: Plant
    motion: Motion
    tau: Array  # [N m] (samples, joints)
    sample_time: float  # [s]
    length: int  # samples of a window

    @np.errstate(all="ignore")  # a window may run away: its steps do not settle then
    def states(self, first: Indices, steps: int) -> Array:
        """Return q and dq (windows, length, 2 joints) of the windows that start at `first`."""
        moving, motion, n = self.plant.prepared(len(first)), self.motion, self.tau.shape[1]
        integrator = RungeKutta(moving, self.sample_time, steps)
        t, ddq = motion.t[first].copy(), motion.ddq[first].T
        state = moving.settled(t, motion.q[first].T, motion.dq[first].T, ddq)
        # memories count from the start of the log
        begun = np.full_like(t, motion.t[0])
        states = moving.at_start(begun, state[:n], state[n:], ddq)
        out = np.empty((self.length, 2 * n, len(first)))
        for k in range(self.length):
            out[k] = state
            out[k, :n] = moving.measured(state[:n], states)
            command = np.ascontiguousarray(self.tau[first + k].T)
            states = moving.updated(t, state[:n], state[n:], states, command)
            states = integrator.advance(t, state, states, command)
            t = t + self.sample_time
        return np.ascontiguousarray(np.moveaxis(out, 2, 0))

    def steps(self, first: Indices, share: float) -> int:
        """Return the fewest steps a sample whose halving changes no position by too much."""
        n = self.tau.shape[1]
        seen, coarse = self.motion.q[first[:, None] + np.arange(self.length)], None
        for steps in (*SIMULATION.steps, 2 * SIMULATION.steps[-1]):
            fine = self.states(first, steps)[..., :n]
            if coarse is not None:
                if np.abs(fine - coarse).max() <= SIMULATION.window_error:
                    return steps // 2
                if share > 0.0 and (_rms(fine - coarse) <= share * _rms(fine - seen)).all():
                    return steps // 2
            coarse = fine
        raise InputRejected(
            "D17", f"{SIMULATION.steps[-1]} steps a sample do not settle the simulation",
            remedy="friction that changes sign within a very small speed needs a lower sharpness")


def simulate_windows(plant: Plant, motion: Motion, tau: Array, sample_time: float,  # noqa: PLR0913
                     length: int, usable: Mask | None = None, share: float = 0.0,
                     steps: int | None = None) -> Windows:
    """Follow `tau` (samples, joints) from the motion's state at the start of every window.

    Args:
        tau: held from each sample to the next.
        length: samples of a window.
        usable: (samples,) where motion and torque are known without gaps; else everywhere.
        share: of the distance from `motion`, that a position may be wrong by (root mean square,
            joint by joint), where that is more than the usual 1e-7 rad.
        steps: of the integrator, a sample; by default as few as this asks for.

    Raises:
        InputRejected: T08, no window fits; D15, the model's inertia matrix is singular or worse;
            D17, the step would be too small to be of use.
    """
    good: Mask = np.asarray(np.isfinite(tau).all(axis=1) & np.isfinite(motion.q).all(axis=1))
    if usable is not None:
        good = good & usable
    uneven = np.abs(np.diff(motion.t) - sample_time) > 0.5 * sample_time
    first = _starts(good, uneven, length)
    if not len(first):
        words, remedy = f"no window of {length} samples is without a gap", "ask for shorter windows"
        raise InputRejected("T08", words, remedy=remedy)
    plant.refuse_unphysical(motion.q[first])
    followed = _Followed(plant, motion, tau, sample_time, length)
    if steps is None:
        count = min(len(first), SIMULATION.windows_tried)
        steps = followed.steps(first[np.linspace(0, len(first) - 1, count).astype(int)], share)
    q, dq = np.full((2, *motion.q.shape), np.nan)
    for begin in range(0, len(first), SIMULATION.windows_together):
        some = first[begin:begin + SIMULATION.windows_together]
        rows = (some[:, None] + np.arange(length)).ravel()
        moved = followed.states(some, steps)
        q[rows], dq[rows] = (part.reshape(len(rows), -1) for part in np.split(moved, 2, axis=2))
    return Windows(q, dq, first, length, steps)


def _starts(good: Mask, uneven: Mask, length: int) -> Indices:
    """Return the first samples of windows of good samples, side by side.

    `uneven` (samples - 1,) tells where the clock jumps.
    """
    ends = [0, *(np.flatnonzero((good[1:] != good[:-1]) | uneven) + 1).tolist(), len(good)]
    runs = [np.arange(a, b - length + 1, length) for a, b in pairwise(ends) if good[a]]
    return np.concatenate([np.zeros(0, dtype=np.intp), *runs])


def _rms(x: Array) -> Array:
    """Return the root of the mean square (joints,) over windows and samples."""
    return np.asarray(np.sqrt(np.mean(np.square(x), axis=(0, 1))))


def held_torque(log: ExperimentLog) -> Array:
    """Return the torque that acts from each sample to the next.

    A command is held; of a measurement the mean of its ends is taken.
    """
    if log.torque != "measured":
        return log.tau
    return np.concatenate([0.5 * (log.tau[1:] + log.tau[:-1]), log.tau[-1:]])
