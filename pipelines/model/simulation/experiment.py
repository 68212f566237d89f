"""What an experiment asks of the arm: references, controller, encoders, where it starts. Read from the log to imitate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.io.log import Array, Controller, ExperimentLog
from pipelines.io.model_file import parse_model
from pipelines.model.arm import Arm

__all__ = ["Experiment"]

_UNEVEN = 0.05  # of a sample: beyond it the controller did not run at its nominal rate
_WHERE = "the log can still be simulated in short windows: --windowed"
# Without these a law cannot be followed.
_NEEDED = {"pd": ("kp", "kd"), "pd+feedforward": ("kp", "kd", "feedforward"), "computed-torque": ("kp", "kd", "model"),
           "open-loop": ()}


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

    def part(self, first: int, samples: int) -> Experiment:
        """`samples` of it from `first` on, started on the reference; for tests of the step."""
        rows = slice(first, first + samples)
        cut = {name: value[rows] for name in ("q_ref", "dq_ref", "ddq_ref", "v", "tau")
               if (value := getattr(self, name)) is not None}
        start = {} if first == 0 else {"q0": self.q_ref[first], "dq0": self.dq_ref[first]}
        return replace(self, start_time=self.start_time + first * self.sample_time, **cut, **start)

    @classmethod
    def of_log(cls, log: ExperimentLog, start: tuple[Array, Array] | None = None) -> Experiment:
        """The experiment that `log` recorded, or plans.

        Args:
            start: q and dq (n,) at the first sample, where something knows them better than the log: a smoother.

        Raises:
            InputRejected: S22, the log does not say what its controller did, or a signal of it is missing or has gaps.
        """
        controller = _controller(log)
        _even(log)
        model = None
        if controller.model is not None and controller.law in ("pd+feedforward", "computed-torque"):
            model = Arm.from_model(parse_model(controller.model, where=_place(log)), where=_place(log))
        driven, tau = _driven(log, controller)
        references = _references(log, driven)
        q0, dq0 = start if start is not None else _start(log, references)
        tau0 = log.tau[0] if "tau" in log and np.isfinite(log.tau[0]).all() else np.zeros(log.n_joints)
        resolution = np.array([joint.encoder_resolution or 0.0 for joint in log.robot.joints])
        v = _whole(log, "v") if "v" in log else None
        return cls(log.sample_time, float(log.t[0]), controller, *references, q0, dq0, tau0, resolution, v, tau, driven, model)


def _place(log: ExperimentLog) -> str:
    return log.source or log.name


def _controller(log: ExperimentLog) -> Controller:
    """S22 where the log's controller cannot be followed."""
    given = log.controller
    law = given.law if given is not None else "unknown"
    if given is None or law == "unknown":
        raise InputRejected("S22", "the log does not say how its controller works", where=_place(log), remedy=_WHERE)
    missing = [key for key in _NEEDED[law] if getattr(given, key) is None]
    if law == "pd+feedforward" and given.feedforward and given.model is None:
        missing.append("model")
    if law != "open-loop" and given.velocity is None:
        missing.append("velocity")
    if given.velocity == "observer" and given.observer_gain is None:
        missing.append("observer_gain")
    if missing:
        raise InputRejected("S22", f"the controller, {law}, lacks {', '.join(missing)}", where=_place(log),
                            remedy=f"write them into the log's controller group; {_WHERE}")
    return given


def _even(log: ExperimentLog) -> None:
    if log.n_samples < 2 or np.abs(np.diff(log.t) - log.sample_time).max() > _UNEVEN * log.sample_time:
        raise InputRejected("T05", "a controller runs at an even rate, and this log has gaps or an uneven clock", where=_place(log),
                            remedy=f"cut the log at its gaps, or resample it with 'rrrid import'; {_WHERE}")


def _whole(log: ExperimentLog, name: str) -> Array:
    """A signal without gaps."""
    if name not in log:
        raise InputRejected("S22", f"without the signal {name} nothing says what the controller followed", where=_place(log),
                            remedy=f"log it; {_WHERE}")
    if not np.isfinite(log[name]).all():
        raise InputRejected("D02", f"the signal {name} has missing samples", where=_place(log), remedy="cut the log there")
    return log[name]


def _driven(log: ExperimentLog, controller: Controller) -> tuple[npt.NDArray[np.bool_] | None, Array | None]:
    """Which joints the logged torque drives: of an open-loop log its moving joint, or all where no joint is named."""
    if controller.law != "open-loop":
        return None, None
    driven = np.ones(log.n_joints, dtype=bool) if log.joint is None else np.arange(1, log.n_joints + 1) == log.joint
    held = not driven.all()
    if held and (controller.kp is None or controller.kd is None or controller.velocity is None):
        raise InputRejected("S22", f"joint {log.joint} is driven open loop, but the log does not say how the others are held",
                            where=_place(log), remedy=f"give their kp, kd and velocity in the controller group; {_WHERE}")
    return driven, _whole(log, "tau")


def _references(log: ExperimentLog, driven: npt.NDArray[np.bool_] | None) -> tuple[Array, Array, Array]:
    """q_ref, dq_ref, ddq_ref. A joint that is held where no reference is logged stays where it starts."""
    if driven is not None and "q_ref" not in log:
        start = np.where(np.isfinite(log.q[0]), log.q[0], 0.0)
        return np.tile(start, (log.n_samples, 1)), np.zeros(log.q.shape), np.zeros(log.q.shape)
    q_ref = _whole(log, "q_ref")
    dq_ref = _whole(log, "dq_ref") if "dq_ref" in log else np.gradient(q_ref, log.sample_time, axis=0)
    feedforward = log.controller is not None and bool(log.controller.feedforward)
    if "ddq_ref" in log or feedforward:
        return q_ref, dq_ref, _whole(log, "ddq_ref")
    return q_ref, dq_ref, np.zeros_like(q_ref)  # nothing asks for it


def _start(log: ExperimentLog, references: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Where the reference starts, or, where the arm measurably is elsewhere, where its encoders see it."""
    q_ref, dq_ref, _ = references
    if "q" not in log or not np.isfinite(log.q[0]).all():
        return q_ref[0], dq_ref[0]
    step = np.array([joint.encoder_resolution or 0.0 for joint in log.robot.joints])
    return np.where(np.abs(log.q[0] - q_ref[0]) <= step, q_ref[0], log.q[0]), dq_ref[0]
