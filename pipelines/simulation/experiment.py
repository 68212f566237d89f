"""An experiment to simulate: references, controller, encoders, start."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import InputRejected
from pipelines.io.log import Array, Controller, ExperimentLog
from pipelines.io.model_file import parse_model
from pipelines.simulation.config import SIMULATION

__all__ = ["Experiment"]

_WHERE = "the log can still be simulated in short windows: --windowed"
# Without these a law cannot be followed.
_NEEDED = {
    "pd": ("kp", "kd", "velocity"),
    "pd+feedforward": ("kp", "kd", "feedforward", "velocity"),
    "computed-torque": ("kp", "kd", "model", "velocity"),
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
        names = ("q_ref", "dq_ref", "ddq_ref", "v")
        cut = {name: getattr(self, name)[rows] for name in names if getattr(self, name) is not None}
        start = {} if first == 0 else {"q0": self.q_ref[first], "dq0": self.dq_ref[first]}
        return replace(self, start_time=self.start_time + first * self.sample_time, **cut, **start)

    @classmethod
    def of_log(cls, log: ExperimentLog) -> Experiment:
        """Return the experiment that `log` recorded, or plans.

        Raises:
            InputRejected: S22, the log does not say what its controller did, or had none; T05, its
                clock is uneven; S22, D02, a signal of it is missing or has gaps.
        """
        controller, where = _controller(log), log.source or log.name
        uneven = log.n_samples < 2  # noqa: PLR2004
        if uneven or np.abs(np.diff(log.t) / log.sample_time - 1.0).max() > SIMULATION.uneven:
            words = "a controller runs at an even rate, and this log has gaps or an uneven clock"
            remedy = f"cut the log at its gaps, or resample it with 'rrrid import'; {_WHERE}"
            raise InputRejected("T05", words, where=where, remedy=remedy)
        model = None
        if controller.model is not None and controller.law != "pd":
            model = Arm.from_model(parse_model(controller.model, where=where), where=where)
        q_ref = _whole(log, "q_ref")
        given = "dq_ref" in log
        dq_ref = _whole(log, "dq_ref") if given else np.gradient(q_ref, log.sample_time, axis=0)
        ddq_ref = np.zeros_like(q_ref)  # nothing asks for it
        if "ddq_ref" in log or controller.feedforward:
            ddq_ref = _whole(log, "ddq_ref")
        resolution = np.array([joint.encoder_resolution or 0.0 for joint in log.robot.joints])
        # the start of the reference, or where the encoders see an arm that is elsewhere
        q0 = q_ref[0]
        if "q" in log and np.isfinite(log.q[0]).all():
            q0 = np.where(np.abs(log.q[0] - q0) <= resolution, q0, log.q[0])
        started = "tau" in log and bool(np.isfinite(log.tau[0]).all())
        return cls(
            log.sample_time,
            float(log.t[0]),
            controller,
            q_ref,
            dq_ref,
            ddq_ref,
            q0,
            dq_ref[0],
            log.tau[0] if started else np.zeros(log.n_joints),
            resolution,
            _whole(log, "v") if "v" in log else None,
            model,
        )


def _controller(log: ExperimentLog) -> Controller:
    """Return the log's controller; S22 where it cannot be followed."""
    given, where = log.controller, log.source or log.name
    if given is None or given.law == "unknown":
        words = "the log does not say how its controller works"
        raise InputRejected("S22", words, where=where, remedy=_WHERE)
    if given.law == "open-loop":
        words = "an experiment in open loop has no controller to follow"
        raise InputRejected("S22", words, where=where, remedy=_WHERE)
    missing = [key for key in _NEEDED[given.law] if getattr(given, key) is None]
    if given.law == "pd+feedforward" and given.feedforward and given.model is None:
        missing.append("model")
    if given.velocity == "observer" and given.observer_gain is None:
        missing.append("observer_gain")
    if missing:
        words = f"the controller, {given.law}, lacks {', '.join(missing)}"
        remedy = f"write them into the log's controller group; {_WHERE}"
        raise InputRejected("S22", words, where=where, remedy=remedy)
    return given


def _whole(log: ExperimentLog, name: str) -> Array:
    """Return a signal without gaps."""
    where = log.source or log.name
    if name not in log:
        words = f"without the signal {name} nothing says what the controller followed"
        raise InputRejected("S22", words, where=where, remedy=f"log it; {_WHERE}")
    if not np.isfinite(log[name]).all():
        words = f"the signal {name} has missing samples"
        raise InputRejected("D02", words, where=where, remedy="cut the log there")
    return log[name]
