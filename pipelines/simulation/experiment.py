"""An experiment to simulate: references, controller, encoders, start."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.arm import Arm
from pipelines.errors import InputRejected
from pipelines.io.log import Array, Controller, ExperimentLog
from pipelines.io.model_file import parse_model
from pipelines.simulation.config import SIMULATION

__all__ = ["Experiment"]

_WHERE = "the log can still be simulated in short windows: --windowed"
# Without these a law cannot be followed.
_NEEDED = {
    "pd": ("kp", "kd"),
    "pd+feedforward": ("kp", "kd", "feedforward"),
    "computed-torque": ("kp", "kd", "model"),
    "open-loop": (),
}


@dataclass(frozen=True, eq=False)
class Experiment:
    """One experiment on an arm of n joints, N samples long."""

    sample_time: float  # T [s]
    start_time: float  # [s] of the first sample
    controller: Controller
    q_ref: Array  # [rad] (N, n)
    dq_ref: Array  # [rad/s] (N, n)
    ddq_ref: Array  # [rad/s^2] (N, n)
    q0: Array  # [rad] (n,) position at the first sample, as an encoder without steps reads it
    dq0: Array  # [rad/s] (n,)
    tau0: Array  # [N m] (n,) what a controller with delay has commanded before the first sample
    resolution: Array  # [rad] (n,) of the encoders; 0 where they do not quantise
    v: Array | None = None  # (N, n) injected excitation, or (N, n, replicas) where each has its own
    tau: Array | None = None  # [N m] (N, n) torque of the joints that are driven open loop
    driven: npt.NDArray[np.bool_] | None = None  # (n,) which joints are
    feedforward_arm: Arm | None = None  # the model that the controller used

    @property
    def n_samples(self) -> int:
        return len(self.q_ref)

    @property
    def n_joints(self) -> int:
        return int(self.q_ref.shape[1])

    @property
    def t(self) -> Array:
        """[s] (N,)"""
        samples: Array = np.arange(self.n_samples, dtype=np.float64)
        return self.start_time + self.sample_time * samples

    def part(self, first: int, samples: int) -> Experiment:
        """Return `samples` of it from `first` on, started on the reference."""
        rows = slice(first, first + samples)
        names = ("q_ref", "dq_ref", "ddq_ref", "v", "tau")
        cut = {name: getattr(self, name)[rows] for name in names if getattr(self, name) is not None}
        start = {} if first == 0 else {"q0": self.q_ref[first], "dq0": self.dq_ref[first]}
        return replace(self, start_time=self.start_time + first * self.sample_time, **cut, **start)

    @classmethod
    def of_log(cls, log: ExperimentLog) -> Experiment:
        """Return the experiment that `log` recorded, or plans.

        Raises:
            InputRejected: S22, the log does not say what its controller did; T05, its clock is
                uneven; S22, D02, a signal of it is missing or has gaps.
        """
        controller = _controller(log)
        if log.n_samples < 2 or _jitter(log) > SIMULATION.uneven:  # noqa: PLR2004
            words = "a controller runs at an even rate, and this log has gaps or an uneven clock"
            remedy = f"cut the log at its gaps, or resample it with 'rrrid import'; {_WHERE}"
            raise InputRejected("T05", words, where=_place(log), remedy=remedy)
        model = None
        if controller.model is not None and controller.law in ("pd+feedforward", "computed-torque"):
            stored = parse_model(controller.model, where=_place(log))
            model = Arm.from_model(stored, where=_place(log))
        driven, tau = _driven(log, controller)
        references = _references(log, driven)
        started = "tau" in log and bool(np.isfinite(log.tau[0]).all())
        tau0 = log.tau[0] if started else np.zeros(log.n_joints)
        v = _whole(log, "v") if "v" in log else None
        return cls(
            log.sample_time,
            float(log.t[0]),
            controller,
            *references,
            *_start(log, references),
            tau0,
            _resolution(log),
            v,
            tau,
            driven,
            model,
        )


def _place(log: ExperimentLog) -> str:
    return log.source or log.name


def _jitter(log: ExperimentLog) -> float:
    """Return the largest deviation of an interval, in samples."""
    return float(np.abs(np.diff(log.t) - log.sample_time).max()) / log.sample_time


def _resolution(log: ExperimentLog) -> Array:
    return np.array([joint.encoder_resolution or 0.0 for joint in log.robot.joints])


def _controller(log: ExperimentLog) -> Controller:
    """Return the log's controller; S22 where it cannot be followed."""
    given = log.controller
    if given is None or given.law == "unknown":
        raise InputRejected(
            "S22", "the log does not say how its controller works", where=_place(log), remedy=_WHERE
        )
    missing = [key for key in _NEEDED[given.law] if getattr(given, key) is None]
    if given.law == "pd+feedforward" and given.feedforward and given.model is None:
        missing.append("model")
    if given.law != "open-loop" and given.velocity is None:
        missing.append("velocity")
    if given.velocity == "observer" and given.observer_gain is None:
        missing.append("observer_gain")
    if missing:
        words = f"the controller, {given.law}, lacks {', '.join(missing)}"
        remedy = f"write them into the log's controller group; {_WHERE}"
        raise InputRejected("S22", words, where=_place(log), remedy=remedy)
    return given


def _whole(log: ExperimentLog, name: str) -> Array:
    """Return a signal without gaps."""
    if name not in log:
        words = f"without the signal {name} nothing says what the controller followed"
        raise InputRejected("S22", words, where=_place(log), remedy=f"log it; {_WHERE}")
    if not np.isfinite(log[name]).all():
        words = f"the signal {name} has missing samples"
        raise InputRejected("D02", words, where=_place(log), remedy="cut the log there")
    return log[name]


def _driven(
    log: ExperimentLog, controller: Controller
) -> tuple[npt.NDArray[np.bool_] | None, Array | None]:
    """Return which joints the logged torque drives, and that torque.

    In an open-loop log that is its moving joint, or all where no joint is named.
    """
    if controller.law != "open-loop":
        return None, None
    driven = np.ones(log.n_joints, dtype=bool)
    if log.joint is not None:
        driven = np.arange(1, log.n_joints + 1) == log.joint
    known = (controller.kp, controller.kd, controller.velocity)
    if not driven.all() and any(one is None for one in known):
        words = (
            f"joint {log.joint} is driven open loop, but the log does not say how the others "
            "are held"
        )
        remedy = f"give their kp, kd and velocity in the controller group; {_WHERE}"
        raise InputRejected("S22", words, where=_place(log), remedy=remedy)
    return driven, _whole(log, "tau")


def _references(
    log: ExperimentLog, driven: npt.NDArray[np.bool_] | None
) -> tuple[Array, Array, Array]:
    """Return q_ref, dq_ref, ddq_ref; a joint that is held without one stays where it starts."""
    if driven is not None and "q_ref" not in log:
        start = np.where(np.isfinite(log.q[0]), log.q[0], 0.0)
        return np.tile(start, (log.n_samples, 1)), np.zeros(log.q.shape), np.zeros(log.q.shape)
    q_ref = _whole(log, "q_ref")
    if "dq_ref" in log:
        dq_ref = _whole(log, "dq_ref")
    else:
        dq_ref = np.gradient(q_ref, log.sample_time, axis=0)
    feedforward = log.controller is not None and bool(log.controller.feedforward)
    if "ddq_ref" in log or feedforward:
        return q_ref, dq_ref, _whole(log, "ddq_ref")
    return q_ref, dq_ref, np.zeros_like(q_ref)  # nothing asks for it


def _start(log: ExperimentLog, references: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Return where the reference starts, or where the encoders see an arm that is elsewhere."""
    q_ref, dq_ref, _ = references
    if "q" not in log or not np.isfinite(log.q[0]).all():
        return q_ref[0], dq_ref[0]
    near = np.abs(log.q[0] - q_ref[0]) <= _resolution(log)
    return np.where(near, q_ref[0], log.q[0]), dq_ref[0]
