"""The controller of an experiment, sample by sample: laws (23)-(27) of Kostić et al. 2004.

    pd               τ = -Kp ē - Kd dē - Ki ∫e + v                                    eq. (23)
    pd+feedforward   the same, and parts of the model's torque on the reference       eq. (24)
    computed-torque  τ = D(q̄) r + c(q̄, dq̄) + h(q̄) + τ_f(dq_r)                       eq.
    (25)-(27)
                     r = -Kp ē - Kd dē - Ki ∫e + v

e = q - q_r. ē and dē come from the observer, eq. (20)-(21), which filters e, or are e itself and
its backward difference; q̄ = q_r + ē and dq̄ are the observer's where the log gives its gains.
Friction is compensated at the speed of the reference: at the measured one it would chatter.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pipelines.dynamics.body import Motion
from pipelines.dynamics.functions import ARRAYS, NUMBERS, Functions
from pipelines.io.log import Array
from pipelines.simulation.experiment import Experiment

__all__ = ["Controlling", "Feedback", "ahead_of"]

_RIGID = ("inertia", "coriolis", "gravity")

Estimate = Callable[[Any], tuple[Any, Any]]  # error -> its filtered value and its speed


def _backward_difference(sample_time: float) -> Estimate:
    """dē = (e_k - e_{k-1})/T, zero at the first sample."""
    rate, last = 1.0 / sample_time, None

    def estimate(error: Any) -> tuple[Any, Any]:
        nonlocal last
        before, last = error if last is None else last, error
        return error, (error - before) * rate

    return estimate


def _observer(gain: tuple[Any, Any, Any], sample_time: float) -> Estimate:
    """x̂ = E x̂, then x̂ + k (e - c x̂); E of three integrators. Eq. (16), (20)."""
    k1, k2, k3 = gain
    h, half = sample_time, 0.5 * sample_time**2
    position = speed = acceleration = 0.0

    def estimate(error: Any) -> tuple[Any, Any]:
        nonlocal position, speed, acceleration
        ahead = position + h * speed + half * acceleration
        off = error - ahead
        position = ahead + k1 * off
        speed = speed + h * acceleration + k2 * off
        acceleration = acceleration + k3 * off
        return position, speed

    return estimate


class Feedback:
    """Feedback and command of one joint in numbers, or of all joints and replicas in arrays."""

    def __init__(self, experiment: Experiment, joint: int | None = None) -> None:
        """Take the gains of `joint` (from 0), or of all joints as columns."""
        law, time = experiment.controller, experiment.sample_time

        def own(values: Array | None) -> Any:
            if values is None:
                values = np.zeros(experiment.n_joints)
            return values[:, None] if joint is None else float(values[joint])

        self.functions: Functions = ARRAYS if joint is None else NUMBERS
        self.kp, self.kd, self.ki = own(law.kp), own(law.kd), own(law.ki)
        self.sample_time, self.integral = time, 0.0
        self.gain, self.estimate = None, _backward_difference(time)
        if law.observer_gain is not None:
            self.gain = tuple(own(column) for column in law.observer_gain.T)
            if law.velocity == "observer":
                self.estimate = _observer(self.gain, time)
        self.seen: tuple[Any, Any] = (0.0, 0.0)  # the last estimate
        self.counts = _counter(own(experiment.resolution), self.functions)
        self.steps = _counter(own(law.torque_resolution), self.functions)
        self.limit = None if law.output_limit is None else own(law.output_limit)
        self.waiting, self.delay = own(experiment.tau0), bool(law.delay)  # of a delayed command

    def __call__(self, error: Any, ahead: Any) -> Any:
        """Return -Kp ē - Kd dē - Ki ∫e and what is `ahead` [N m]."""
        position, speed = self.seen = self.estimate(error)
        self.integral = self.integral + self.sample_time * error
        return ahead - self.kp * position - self.kd * speed - self.ki * self.integral

    def limited(self, torque: Any) -> Any:
        """Return a torque after the controller's own steps and limit, as the log has it."""
        if self.steps is not None:
            torque = self.steps(torque)
        if self.limit is not None:
            torque = self.functions.smaller(self.functions.larger(torque, -self.limit), self.limit)
        return torque

    def delayed(self, torque: Any) -> Any:
        """Return the torque that acts: of a controller with delay the one before."""
        if not self.delay:
            return torque
        before, self.waiting = self.waiting, torque
        return before


def _counter(step: Any, m: Functions) -> Callable[[Any], Any] | None:
    """Return the function that counts in steps; None for an encoder without steps."""
    if not np.any(step):
        return None
    fine = m.where(step > 0.0, step, 1e-15)  # numerics: a joint without steps beside others
    return lambda x: m.round(x / fine) * fine


class Controlling:
    """The controllers of all replicas in arrays. Joints first, replicas last."""

    def __init__(self, experiment: Experiment, replicas: int) -> None:
        self._experiment, self._feedback = experiment, Feedback(experiment)
        self._zeros = np.zeros((experiment.n_joints, replicas))
        self._seen: Estimate | None = None
        if experiment.controller.law == "computed-torque" and self._feedback.gain is not None:
            self._seen = _observer(self._feedback.gain, experiment.sample_time)
        self._rigid = _among(experiment.controller.feedforward, _RIGID)
        self._ahead = _model_ahead(experiment)

    def counted(self, q: Array) -> Array:
        """Return the positions (…, joints) that the encoders count at q."""
        counts = self._feedback.counts
        return q if counts is None else np.asarray(counts(q))

    def command(self, k: int, q: Array) -> Array:
        """Return the torque [N m] at sample k; q (joints, replicas) is what the encoders say."""
        torque = self._feedback.limited(self._law(k, *self._fed_back(k, q)))
        return np.asarray(self._feedback.delayed(torque)) + self._zeros

    def commanded(self, q: Array) -> Array:
        """Return the torque (samples, joints) [N m] of one replica whose encoders say `q`."""
        every = [np.array(self._fed_back(k, row[:, None])) for k, row in enumerate(q)]
        law = self._law(slice(len(q)), *np.concatenate(every, axis=2))
        torque = np.asarray(self._feedback.limited(law))
        if self._experiment.controller.delay:
            torque = np.concatenate([self._experiment.tau0[:, None], torque[:, :-1]], axis=1)
        return torque.T

    def _fed_back(self, k: int, q: Array) -> tuple[Array, Array, Array]:
        """Return errors of position and speed about which a model acts, and the feedback."""
        error = q - self._experiment.q_ref[k][:, None]
        v: Any = 0.0 if self._experiment.v is None else self._experiment.v[k]
        feedback = self._feedback(error, v[:, None] if np.ndim(v) == 1 else v)
        seen = self._feedback.seen if self._seen is None else self._seen(error)
        return *seen, feedback

    def _law(self, k: int | slice, e: Array, de: Array, feedback: Array) -> Array:
        experiment, model = self._experiment, self._experiment.feedforward_arm
        ahead = 0.0 if self._ahead is None else np.atleast_2d(self._ahead[k]).T
        if experiment.controller.law != "computed-torque":
            return np.asarray(feedback + ahead)
        assert model is not None  # Experiment.of_log refuses the law without
        q, dq = experiment.q_ref[k] + e.T, experiment.dq_ref[k] + de.T
        if self._rigid == _RIGID:
            torque = model.body.torque(q, dq, feedback.T, model.p).T
        else:
            parts = model.body.torque_parts(q, dq, feedback.T, model.p)
            torque = sum((getattr(parts, name) for name in self._rigid), np.zeros(e.T.shape)).T
        return np.ascontiguousarray(torque + ahead)


def ahead_of(experiment: Experiment) -> Array:
    """Return what is added to the feedback (samples, joints): excitation and feed-forward [N m].

    Raises:
        ValueError: the excitation is not as long as the experiment.
    """
    ahead, model = np.zeros(experiment.q_ref.shape), _model_ahead(experiment)
    if experiment.v is not None:
        if experiment.v.shape != ahead.shape:
            raise ValueError(f"v has the shape {experiment.v.shape}, wanted is {ahead.shape}")
        ahead = ahead + experiment.v
    return ahead if model is None else ahead + model


def _model_ahead(experiment: Experiment) -> Array | None:
    """Return the model's torque on the reference [N m] (samples, joints), eq. (24)."""
    law = experiment.controller
    named: tuple[str, ...] = ()
    if law.law == "pd+feedforward":
        named = law.feedforward or ()
    elif law.law == "computed-torque":
        named = _among(law.feedforward, ("friction",))
    if not named:
        return None
    motion = Motion(experiment.t, experiment.q_ref, experiment.dq_ref, experiment.ddq_ref)
    assert experiment.feedforward_arm is not None  # Experiment.of_log refuses the law without it
    parts = experiment.feedforward_arm.nominal.torque_parts(motion)
    return np.asarray(np.sum([getattr(parts, name) for name in named], axis=0))


def _among(named: tuple[str, ...] | None, wanted: tuple[str, ...]) -> tuple[str, ...]:
    """Return the `wanted` parts that the log names, all where it names none: eq. (25) has all."""
    return wanted if named is None else tuple(part for part in wanted if part in named)
