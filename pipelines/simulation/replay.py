"""Simulate short windows open loop, from where a smoother saw the arm: for unknown controllers.

Every window follows the logged torque; all run at once. Without feedback an error grows with the
square of time: it is one of position after that time, no tracking error.
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


def simulate_windows(  # noqa: PLR0913
    plant: Plant,
    motion: Motion,
    tau: Array,
    sample_time: float,
    length: int,
    usable: Mask | None = None,
    share: float = 0.0,
    steps: int | None = None,
) -> Windows:
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
    good = good if usable is None else good & usable
    uneven = np.abs(np.diff(motion.t) - sample_time) > 0.5 * sample_time
    # windows of good samples side by side, none across a jump of the clock
    ends = [0, *(np.flatnonzero((good[1:] != good[:-1]) | uneven) + 1).tolist(), len(good)]
    runs = [np.arange(a, b - length + 1, length) for a, b in pairwise(ends) if good[a]]
    first = np.concatenate([np.zeros(0, dtype=np.intp), *runs])
    if not len(first):
        words, remedy = f"no window of {length} samples is without a gap", "ask for shorter windows"
        raise InputRejected("T08", words, remedy=remedy)
    plant.refuse_unphysical(motion.q[first])

    def follow(some: Indices, steps: int) -> Array:
        return _follow(
            plant, motion, tau[some[:, None] + np.arange(length)], sample_time, some, steps
        )

    if steps is None:
        count = min(len(first), SIMULATION.windows_tried)
        tried = first[np.linspace(0, len(first) - 1, count).astype(int)]
        seen, coarse = motion.q[tried[:, None] + np.arange(length)], None
        for steps in (*SIMULATION.steps, 2 * SIMULATION.steps[-1]):
            fine = follow(tried, steps)[..., : plant.n_joints]
            if coarse is not None and _settled(fine, coarse, seen, share):
                steps //= 2
                break
            coarse = fine
        else:
            words = f"{SIMULATION.steps[-1]} steps a sample do not settle the simulation"
            remedy = "friction that changes sign within a very small speed needs a lower sharpness"
            raise InputRejected("D17", words, remedy=remedy)
    q, dq = np.full((2, *motion.q.shape), np.nan)
    for begin in range(0, len(first), SIMULATION.windows_together):
        some = first[begin : begin + SIMULATION.windows_together]
        rows = (some[:, None] + np.arange(length)).ravel()
        moved = follow(some, steps)
        q[rows], dq[rows] = (part.reshape(len(rows), -1) for part in np.split(moved, 2, axis=2))
    return Windows(q, dq, first, length, steps)


@np.errstate(all="ignore")  # a window may run away: its steps do not settle then
def _follow(
    plant: Plant, motion: Motion, tau: Array, sample_time: float, first: Indices, steps: int
) -> Array:
    """Return q and dq (windows, length, 2 joints) that follow tau (windows, length, joints)."""
    moving, n = plant.prepared(len(first)), plant.n_joints
    integrator, t = RungeKutta(moving, sample_time, steps), motion.t[first].copy()
    begun = np.full_like(t, motion.t[0])  # memories count from the start of the log
    q, dq, ddq = (np.ascontiguousarray(x[first].T) for x in (motion.q, motion.dq, motion.ddq))
    state, states = moving.begin(t, q, dq, ddq, begun)
    out = np.empty((tau.shape[1], 2 * n, len(first)))
    for k in range(len(out)):
        out[k] = state
        out[k, :n] = moving.measured(state[:n], states)
        command = np.ascontiguousarray(tau[:, k].T)
        states = moving.updated(t, state[:n], state[n:], states, command)
        states = integrator.advance(t, state, states, command)
        t = t + sample_time
    return np.ascontiguousarray(np.moveaxis(out, 2, 0))


def _settled(fine: Array, coarse: Array, seen: Array, share: float) -> bool:
    """Return whether halving the steps changed no position (windows, samples, joints) by much."""
    if np.abs(fine - coarse).max() <= SIMULATION.window_error:
        return True
    changed, far = (np.sqrt(np.mean(np.square(fine - x), axis=(0, 1))) for x in (coarse, seen))
    return bool(share > 0.0 and (changed <= share * far).all())


def held_torque(log: ExperimentLog) -> Array:
    """Return the torque that acts from each sample to the next.

    A command is held; of a measurement the mean of its ends is taken.
    """
    if log.torque != "measured":
        return log.tau
    return np.concatenate([0.5 * (log.tau[1:] + log.tau[:-1]), log.tau[-1:]])
