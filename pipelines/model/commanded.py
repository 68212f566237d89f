"""Hold the logged torque against what the log's own controller commands on what the log's encoders said.

    for check in against_command(Subject(log)): ...

A controller that the log describes, with its gains and references, says to the last digit what it commanded, whatever the arm did.
A torque that is that, but so many times as large, or so much later, was not recorded as the drive got it: motor current, another
side of the gear, another clock. Where it is something else the controller's description may be wrong, and nothing is said. A drive
that gives more or less than it is told is none of this: what is logged is what it was told. Of a torque that was measured it is
not: what a drive makes of its command is a cause then, as is a recorder that smooths what it logs. Both are for `diagnose`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.errors import Check, InputRejected
from pipelines.io.log import ExperimentLog
from pipelines.quality.subject import Subject
from pipelines.simulation import Experiment
from pipelines.simulation.controller import Controlling

__all__ = ["against_command", "commanded"]

_LONGEST = 6000  # samples that are followed, from the first on: an observer starts there
_FEWEST = 200
_LATEST = 0.1  # [s]
_LATE, _SAMPLES = 8e-3, 1  # [s]: a filter that is not described is later by less; nor is it known of one sample whose it is
# Of the torque's standard deviation, that scale and time leave of a torque that is the commanded one; of one that is late. Half
# the damping that was described looks like 11 ms, and leaves .021.
_LEFT, _LEFT_LATE = 0.05, 0.015
_BETTER = 3.0  # times what they leave, that the torque differs by as it stands
_SCALE, _SCALE_MEASURED = 1.3, 2.5  # by which a description may err, or a constant of a drive; a drive itself
_LAGS = (0.5, 0.7, 1.0, 1.4)  # times how late a torque is, of a low-pass that makes it as late


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
        return self.left <= _LEFT and self.before >= _BETTER * self.left


def commanded(log: ExperimentLog) -> Array | None:
    """(samples, joints) [N m] from the first sample on; None where the log does not say how it was controlled, or has gaps."""
    if log.controller is None or log.controller.law == "open-loop" or "tau" not in log:
        return None
    try:
        experiment = Experiment.of_log(log)
    except InputRejected:
        return None
    model = experiment.feedforward_arm
    if model is not None and model.n_joints != log.n_joints:
        return None
    known = np.isfinite(log.q).all(axis=1)
    count = min(_LONGEST, log.n_samples if known.all() else int(np.argmin(known)))
    if count < _FEWEST:
        return None
    law = Controlling(experiment, 1)
    with np.errstate(all="ignore"):  # a filter that was described for another sample time may run away
        wanted = law.commanded(log.q[:count])
    return wanted if np.isfinite(wanted).all() else None


def against_command(s: Subject) -> tuple[Check, ...]:
    """S14, T06, and S10 of all joints or S15 of some, by the controller; nothing where it says nothing, or what was logged.

    A gear ratio or a unit may be that of the torque or that of position and reference, from which the command follows.
    """
    wanted = commanded(s.log)
    if wanted is None:
        return ()
    most = round(_LATEST / s.log.sample_time)
    found = [_likeness(s.log.tau[:len(wanted), j], wanted[:, j], most) for j in range(s.log.n_joints)]
    likes = {j: like for j, like in enumerate(found) if like is not None and like.sure}
    every = len(likes) == s.log.n_joints and all(_scaled(s, like) for like in likes.values())
    return tuple(check for j, like in likes.items() if (check := _said(s, j, like, wanted[:, j], every)) is not None)


def _scaled(s: Subject, like: Likeness) -> bool:
    most = _SCALE_MEASURED if s.log.torque == "measured" else _SCALE
    return not 1.0 / most < abs(like.scale) < most


def _said(s: Subject, j: int, like: Likeness, wanted: Array, every: bool) -> Check | None:
    late, size = like.late * s.log.sample_time, abs(like.scale)
    if like.scale < 0.0:
        return s.say("S14", "warn", f"tau of joint {j + 1} is {like.scale:.3g} times what the controller of this log commands",
                     signal="tau", joint=j, gate=True,
                     remedy="change the sign of this torque on import, or those of the controller's gains")
    if _scaled(s, like):
        what = "motor current in A, or torque of another side of the gear" if every else "another gear ratio or torque constant"
        return s.say("S10" if every else "S15", "warn",
                     f"tau of joint {j + 1} is {size:.3g} times what the controller of this log commands: {what}; or its position "
                     f"and reference are {1.0 / size:.3g} times as large as they should be", signal="tau", joint=j, gate=True,
                     remedy=f"divide it by {size:.3g}: import the recording anew with torque constants and gear ratios, or declare "
                     "its unit; or correct the gains of the controller")
    if s.log.torque != "measured" and _stamped(s, j, like, wanted):
        return s.say("T06", "warn", f"tau of joint {j + 1} is stamped {1e3 * abs(late):.3g} ms {'after' if late > 0 else 'before'} "
                     "the controller of this log commands it", signal="tau", joint=j, gate=True,
                     remedy="stamp position and torque by one clock: shift this torque by as much on import; or correct the gains "
                     "of the controller")
    return None


def _stamped(s: Subject, j: int, like: Likeness, wanted: Array) -> bool:
    """Return whether a torque is the commanded one at another time, and not smoothed by what it was logged through."""
    if abs(like.late) <= _SAMPLES or abs(like.late) * s.log.sample_time < _LATE or like.left > _LEFT_LATE:
        return False
    lags = [_smoothed_left(s.log.tau[:len(wanted), j], wanted, factor * like.late) for factor in _LAGS] if like.late > 0 else []
    return all(left > like.left for left in lags)


def _smoothed_left(tau: Array, command: Array, samples: float) -> float:
    """Share of the torque's standard deviation that a first-order low-pass of the command leaves of it."""
    keep, now, lagged = float(np.exp(-1.0 / samples)), float(command[0]), []
    for value in command.tolist():
        now = keep * now + (1.0 - keep) * value
        lagged.append(now)
    late = max(1, round(5.0 * samples))  # until it has forgotten where it began
    x, y = np.array(lagged[late:]), tau[late:]
    return float(np.std(y - x) / max(float(np.std(y)), 1e-300)) if len(x) > 1 else np.inf


def _likeness(tau: Array, command: Array, most: int) -> Likeness | None:
    """How a torque (samples,) follows its command best, no more than `most` samples later or earlier; None of one that does not
    change."""
    n = len(tau)
    if n <= 4 * most or not np.isfinite(tau).all() or np.std(tau) == 0.0 or np.std(command) == 0.0:
        return None
    inner = tau[most:n - most]
    if np.ptp(inner) == 0.0:
        return None
    every = np.lib.stride_tricks.sliding_window_view(command, len(inner))[::-1]  # row k: command k - most samples before
    x, y = every - every.mean(axis=1, keepdims=True), inner - inner.mean()
    power, product = np.einsum("ij,ij->i", x, x), x @ y
    left = 1.0 - product**2 / np.maximum(power * float(y @ y), 1e-300)
    best = int(np.argmin(left))
    scale = float(product[best] / max(power[best], 1e-300))
    plain = float(np.sum(np.square(y - x[most])) / float(y @ y))
    return Likeness(scale, best - most, float(np.sqrt(plain)), float(np.sqrt(max(left[best], 0.0))))
