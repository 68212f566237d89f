"""Hold the logged torque against what the log's own controller commands on its encoders.

    for check in against_command(Subject(log)): ...

A controller that the log describes, with its gains and references, says to the last digit what it
commanded, whatever the arm did. A torque that is that, but so many times as large, or so much
later, was not recorded as the drive got it: motor current, another side of the gear, another clock.
Where it is something else the controller's description may be wrong, and nothing is said. What a
drive makes of its command, or a recorder that smooths what it logs, is a cause for `diagnose`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.first_order import lagging
from pipelines.errors import Check, InputRejected
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.subject import Subject
from pipelines.simulation.config import COMMAND
from pipelines.simulation.controller import Controlling
from pipelines.simulation.experiment import Experiment

__all__ = ["against_command", "commanded"]


@dataclass(frozen=True)
class Likeness:
    """Of one joint's torque to its command: tau(t) = scale · command(t - late)."""

    scale: float
    late: int  # samples
    before: float  # share of the torque's standard deviation by which it differs from the command
    left: float  # with both

    @property
    def sure(self) -> bool:
        """Return whether it is the command, but for scale and time."""
        return self.left <= COMMAND.left and self.before >= COMMAND.better * self.left


def commanded(log: ExperimentLog) -> Array | None:
    """Return the command (samples, joints) [N m] from the first sample on.

    Returns None where the log does not say how it was controlled, or has gaps.
    """
    try:
        experiment = Experiment.of_log(log)
    except InputRejected:
        return None
    model = experiment.feedforward_arm
    if "tau" not in log or (model is not None and model.n_joints != log.n_joints):
        return None
    known = np.isfinite(log.q).all(axis=1)
    count = min(COMMAND.longest, log.n_samples if known.all() else int(np.argmin(known)))
    if count < COMMAND.fewest:
        return None
    with np.errstate(all="ignore"):  # a filter described for another sample time may run away
        wanted = Controlling(experiment, 1).commanded(log.q[:count])
    return wanted if np.isfinite(wanted).all() else None


def against_command(s: Subject) -> tuple[Check, ...]:
    """S14, T06, and S10 of all joints or S15 of some, by the controller; nothing without one.

    A gear ratio or a unit may be that of the torque or that of position and reference, from which
    the command follows.
    """
    wanted = commanded(s.log)
    if wanted is None:
        return ()
    latest = round(COMMAND.latest / s.log.sample_time)
    pairs = enumerate(zip(s.log.tau[: len(wanted)].T, wanted.T, strict=True))
    likes = {j: _likeness(tau, command, latest) for j, (tau, command) in pairs}
    sure = {j: like for j, like in likes.items() if like is not None and like.sure}
    every = len(sure) == s.log.n_joints and all(_scaled(s, like) for like in sure.values())
    said = (_said(s, j, like, wanted[:, j], every) for j, like in sure.items())
    return tuple(check for check in said if check is not None)


def _scaled(s: Subject, like: Likeness) -> bool:
    most = COMMAND.scale_measured if s.log.torque == "measured" else COMMAND.scale
    return not 1.0 / most < abs(like.scale) < most


def _said(s: Subject, j: int, like: Likeness, wanted: Array, every: bool) -> Check | None:
    late, size = like.late * s.log.sample_time, abs(like.scale)
    if like.scale < 0.0:
        code, words = "S14", f"{like.scale:.3g} times what the controller of this log commands"
        remedy = "change the sign of this torque on import, or those of the controller's gains"
    elif _scaled(s, like):
        code, what = "S15", "another gear ratio or torque constant"
        if every:
            code, what = "S10", "motor current in A, or torque of another side of the gear"
        words = f"{size:.3g} times what the controller of this log commands: {what}; or its "
        words += f"position and reference are {1.0 / size:.3g} times as large as they should be"
        remedy = f"divide it by {size:.3g}: import the recording anew with torque constants and "
        remedy += "gear ratios, or declare its unit; or correct the gains of the controller"
    elif s.log.torque != "measured" and _stamped(s, j, like, wanted):
        code, side = "T06", "after" if late > 0 else "before"
        words = f"stamped {1e3 * abs(late):.3g} ms {side} the controller of this log commands it"
        remedy = "stamp position and torque by one clock: shift this torque by as much on import; "
        remedy += "or correct the gains of the controller"
    else:
        return None
    words = f"tau of joint {j + 1} is {words}"
    return s.say(code, "warn", words, signal="tau", joint=j, gate=True, remedy=remedy)


def _stamped(s: Subject, j: int, like: Likeness, wanted: Array) -> bool:
    """Return whether a torque is the command at another time, not smoothed by a recorder."""
    late, tau = abs(like.late), s.log.tau[: len(wanted), j]
    if late <= COMMAND.samples or late * s.log.sample_time < COMMAND.late:
        return False
    if like.left > COMMAND.left_late:
        return False
    t = np.arange(len(wanted), dtype=np.float64)
    for lag in [factor * late for factor in COMMAND.lags] if like.late > 0 else []:
        off = (tau - lagging(wanted, t, lag, digital=True))[max(1, round(5.0 * lag)) :]
        if len(off) > 1 and np.std(off) <= like.left * max(float(np.std(tau)), 1e-300):
            return False
    return True


def _likeness(tau: Array, command: Array, most: int) -> Likeness | None:
    """Return how a torque (samples,) follows its command best; None of one that does not change.

    No more than `most` samples later or earlier.
    """
    n = len(tau)
    if n <= 4 * most or not np.isfinite(tau).all() or np.std(command) == 0.0:
        return None
    inner = tau[most : n - most]
    if np.ptp(inner) == 0.0:
        return None
    # row k: the command k - most samples before
    every = np.lib.stride_tricks.sliding_window_view(command, len(inner))[::-1]
    x, y = every - every.mean(axis=1, keepdims=True), inner - inner.mean()
    power, product = np.einsum("ij,ij->i", x, x), x @ y
    left = 1.0 - product**2 / np.maximum(power * float(y @ y), 1e-300)
    best = int(np.argmin(left))
    scale = float(product[best] / max(power[best], 1e-300))
    plain = float(np.sum(np.square(y - x[most])) / float(y @ y))
    return Likeness(scale, best - most, plain**0.5, max(float(left[best]), 0.0) ** 0.5)
