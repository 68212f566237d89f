"""Hold the logged torque against what the log's own controller commands on what the log's encoders said.

    for check in against_command(Subject(log)): ...

A controller that the log describes, with its gains and references, says to the last digit what it commanded, whatever the arm did.
A torque that is that, but so many times as large, or so much later, was not recorded as the drive got it: motor current, another
side of the gear, another clock. Where it is something else the controller's description may be wrong, and nothing is said. A drive
that gives more or less than it is told is none of this: what is logged is what it was told.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.errors import Check, InputRejected
from pipelines.log.doctor.checks_subject import Subject
from pipelines.log.experiment import ExperimentLog
from pipelines.model.rigid.body import Array
from pipelines.model.simulation import Experiment
from pipelines.model.simulation.control import Controlling

__all__ = ["against_command", "commanded"]

_LONGEST = 6000  # samples that are followed, from the first on: an observer starts there
_FEWEST = 200
_LATEST = 0.1  # [s]
_LATE = 8e-3  # [s]: a recorder that smooths what it logs, or a drive, is later by less; those are causes, for `diagnose`
_LEFT = 0.05  # of the torque's standard deviation, that scale and time leave of a torque that is the commanded one
_BETTER = 3.0  # times what they leave, that the torque differs by as it stands
_SCALE = 1.3  # by which a description may err, or a constant of a drive


@dataclass(frozen=True)
class Likeness:
    """Of one joint's torque to its command: tau(t) = scale · command(t - late)."""

    scale: float
    late: int  # samples
    before: float  # share of the torque's standard deviation by which it differs from the command
    left: float  # with both


def commanded(log: ExperimentLog) -> Array | None:
    """(samples, joints) [N m] from the first sample on; None where the log does not say how it was controlled, or has gaps."""
    if log.controller is None or log.controller.law == "open-loop" or "tau" not in log:
        return None
    try:
        experiment = Experiment.of_log(log)
    except InputRejected:
        return None
    known = np.isfinite(log.q).all(axis=1)
    count = min(_LONGEST, log.n_samples if known.all() else int(np.argmin(known)))
    if count < _FEWEST:
        return None
    law = Controlling(experiment, 1)
    return np.array([law.command(k, log.q[k][:, None])[:, 0] for k in range(count)])


def against_command(s: Subject) -> tuple[Check, ...]:
    """S14, T06, and S10 of all joints or S15 of some, by the controller; nothing where it says nothing, or what was logged.

    A gear ratio or a unit may be that of the torque or that of position and reference, from which the command follows.
    """
    wanted = commanded(s.log)
    if wanted is None:
        return ()
    most = round(_LATEST / s.log.sample_time)
    likes = {j: like for j in range(s.log.n_joints)
             if (like := _likeness(s.log.tau[:len(wanted), j], wanted[:, j], most)) is not None}
    every = all(_scaled(like) for like in likes.values())
    return tuple(check for j, like in likes.items() if (check := _said(s, j, like, every)) is not None)


def _scaled(like: Likeness) -> bool:
    return not 1.0 / _SCALE < abs(like.scale) < _SCALE


def _said(s: Subject, j: int, like: Likeness, every: bool) -> Check | None:
    late, size = like.late * s.log.sample_time, abs(like.scale)
    if like.left > _LEFT or like.before < _BETTER * like.left:
        return None
    if like.scale < 0.0:
        return s.say("S14", "warn", f"tau of joint {j + 1} is {like.scale:.3g} times what the controller of this log commands",
                     signal="tau", joint=j, gate=True, remedy="change the sign of this torque on import")
    if _scaled(like):
        what = "motor current in A, or torque of another side of the gear" if every else "another gear ratio or torque constant"
        return s.say("S10" if every else "S15", "warn",
                     f"tau of joint {j + 1} is {size:.3g} times what the controller of this log commands: {what}; or its position "
                     f"and reference are {1.0 / size:.3g} times as large as they should be", signal="tau", joint=j, gate=True,
                     remedy=f"divide it by {size:.3g}: import the recording anew with torque constants and gear ratios, or declare "
                     "its unit; or correct the gains of the controller")
    if abs(late) >= _LATE:
        return s.say("T06", "warn", f"tau of joint {j + 1} is stamped {1e3 * abs(late):.3g} ms {'after' if late > 0 else 'before'} "
                     "the controller of this log commands it", signal="tau", joint=j, gate=True,
                     remedy="stamp position and torque by one clock: shift this torque by as much on import")
    return None


def _likeness(tau: Array, command: Array, most: int) -> Likeness | None:
    """How a torque (samples,) follows its command best, no more than `most` samples later or earlier; None of one that does not
    change."""
    n = len(tau)
    if n <= 4 * most or not np.isfinite(tau).all() or np.std(tau) == 0.0 or np.std(command) == 0.0:
        return None
    inner = tau[most:n - most]
    every = np.lib.stride_tricks.sliding_window_view(command, len(inner))[::-1]  # row k: command k - most samples before
    x, y = every - every.mean(axis=1, keepdims=True), inner - inner.mean()
    power, product = np.einsum("ij,ij->i", x, x), x @ y
    left = 1.0 - product**2 / np.maximum(power * float(y @ y), 1e-300)
    best = int(np.argmin(left))
    scale = float(product[best] / max(power[best], 1e-300))
    plain = float(np.sum(np.square(y - x[most])) / float(y @ y))
    return Likeness(scale, best - most, float(np.sqrt(plain)), float(np.sqrt(max(left[best], 0.0))))
