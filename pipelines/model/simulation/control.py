"""The controller of an experiment, sample by sample, for many replicas: laws (23)-(27) of Kostić et al. 2004.

    pd               τ = -Kp ē - Kd dē - Ki ∫e + v                                       eq. (23)
    pd+feedforward   the same, and the chosen parts of the model's torque on the reference   eq. (24)
    computed-torque  τ = D(q̄) r + c(q̄, dq̄) + h(q̄) + τ_f(dq_r),  r = -Kp ē - Kd dē - Ki ∫e + v           eq. (25)-(27)
    open-loop        the logged torque on the joints it drives; the others are held by pd

e = q - q_r. ē and dē come from the observer, eq. (20)-(21), which filters e and starts with zero error, or are e itself and its
backward difference. q̄ = q_r + ē and dq̄ are the observer's wherever the log gives its gains. Friction is compensated at the
speed of the reference: at the measured one it would chatter on a joint at rest.
"""

from __future__ import annotations

import numpy as np

from pipelines.model.rigid.body import Array, Motion
from pipelines.model.simulation.experiment import Experiment

__all__ = ["Controlling", "feedforward_of"]

_RIGID = ("inertia", "coriolis", "gravity")


class Controlling:
    """The memory of the controllers of all replicas: observer, integral, delayed command. Joints first, replicas last."""

    def __init__(self, experiment: Experiment, replicas: int) -> None:
        n = experiment.n_joints
        self._experiment = experiment
        law = experiment.controller
        zeros = np.zeros((n, 1))
        self._kp, self._kd, self._ki = (zeros if gain is None else gain[:, None] for gain in (law.kp, law.kd, law.ki))
        self._integrating = bool(self._ki.any())
        self._integral = np.zeros((n, replicas))
        self._estimate = _estimator(experiment, replicas)
        self._seen = _Observer.of(experiment, replicas) if law.law == "computed-torque" else None
        self._rigid = _among(law.feedforward, _RIGID)
        self._feedforward = feedforward_of(experiment)
        self._waiting = np.repeat(experiment.tau0[:, None], replicas, axis=1)  # of a delayed command
        self._limit = None if law.output_limit is None else law.output_limit[:, None]
        self._resolution = _steps(law.torque_resolution)

    def command(self, k: int, q: Array) -> Array:
        """The torque [N m] that is commanded at sample k, q (joints, replicas) being what the encoders then say."""
        torque = self._limited(self._law(k, *self._fed_back(k, q)))
        if not self._experiment.controller.delay:
            return torque
        held, self._waiting = self._waiting, torque
        return held

    def commanded(self, q: Array) -> Array:
        """The torque (samples, joints) [N m] that one replica is commanded from the first sample on, of encoders that say `q`."""
        every = [np.array(self._fed_back(k, row[:, None])) for k, row in enumerate(q)]
        torque = self._limited(self._law(slice(len(q)), *np.concatenate(every, axis=2)))
        if self._experiment.controller.delay:
            torque = np.concatenate([self._waiting, torque[:, :-1]], axis=1)
        return torque.T

    def _fed_back(self, k: int, q: Array) -> tuple[Array, Array, Array]:
        """The errors of position and speed that a model is linearised about, and what is fed back, before any model of the arm."""
        experiment = self._experiment
        error = q - experiment.q_ref[k][:, None]
        e, de = self._estimate(error)
        feedback = -self._kp * e
        feedback -= self._kd * de
        if self._integrating:
            self._integral += experiment.sample_time * error
            feedback -= self._ki * self._integral
        if experiment.v is not None:
            v = experiment.v[k]
            feedback += v if v.ndim == 2 else v[:, None]
        return *(self._seen(error) if self._seen is not None else (e, de)), feedback

    def _law(self, k: int | slice, e: Array, de: Array, feedback: Array) -> Array:
        experiment = self._experiment
        forward = None if self._feedforward is None else np.atleast_2d(self._feedforward[k]).T
        if experiment.controller.law != "computed-torque":
            if forward is not None:
                feedback += forward
            if experiment.driven is not None and experiment.tau is not None:
                feedback[experiment.driven] = np.atleast_2d(experiment.tau[k, experiment.driven]).T
            return feedback
        assert experiment.feedforward_arm is not None  # Experiment.of_log refuses the law without it
        body, p = experiment.feedforward_arm.body, experiment.feedforward_arm.p
        parts = body.torque_parts(experiment.q_ref[k] + e.T, experiment.dq_ref[k] + de.T, feedback.T, p)
        torque = sum((getattr(parts, name) for name in self._rigid), np.zeros(e.T.shape)).T
        return np.ascontiguousarray(torque if forward is None else torque + forward)

    def _limited(self, torque: Array) -> Array:
        """After the controller's own quantisation and limit, as the log has it."""
        if self._resolution is not None:
            step, inverse = self._resolution
            torque = np.rint(torque * inverse) * step
        return torque if self._limit is None else np.minimum(np.maximum(torque, -self._limit), self._limit)


def _steps(resolution: Array | None) -> tuple[Array, Array] | None:
    """Steps of the command and their inverse (joints, 1); a joint without steps gets ones too fine to see."""
    if resolution is None or not resolution.any():
        return None
    step = np.where(resolution > 0.0, resolution, 1e-12)[:, None]
    return step, 1.0 / step


def feedforward_of(experiment: Experiment) -> Array | None:
    """The model's torque on the reference [N m] (N, n), eq. (24): it does not depend on what the arm does."""
    law = experiment.controller
    named = {"pd+feedforward": law.feedforward or (), "computed-torque": _among(law.feedforward, ("friction",))}.get(law.law, ())
    if not named:
        return None
    t: Array = experiment.start_time + experiment.sample_time * np.arange(experiment.n_samples, dtype=np.float64)
    return _parts(experiment, Motion(t, experiment.q_ref, experiment.dq_ref, experiment.ddq_ref), named)


def _among(named: tuple[str, ...] | None, wanted: tuple[str, ...]) -> tuple[str, ...]:
    """The `wanted` parts that the log names: all of them where it names none, for eq. (25) has them all."""
    return wanted if named is None else tuple(part for part in wanted if part in named)


def _parts(experiment: Experiment, motion: Motion, wanted: tuple[str, ...]) -> Array:
    """Parts of the torque of the controller's own model (samples, joints) [N m]."""
    assert experiment.feedforward_arm is not None  # Experiment.of_log refuses the law without it
    parts = experiment.feedforward_arm.nominal.torque_parts(motion)
    return np.asarray(np.sum([getattr(parts, name) for name in wanted], axis=0))


class _Observer:
    """x̂ = E x̂, then x̂ + k (e - c x̂); E of three integrators. Kostić et al. 2004, eq. (16), (20)."""

    def __init__(self, gain: Array, sample_time: float, replicas: int) -> None:
        n, h = len(gain), sample_time
        self._transition = np.array([[1.0, h, h * h / 2.0], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
        self._gain = np.ascontiguousarray(gain.T)[..., None]
        self._state = np.zeros((3, n, replicas))
        self._next = np.empty_like(self._state)
        self._work = np.empty_like(self._state)

    @classmethod
    def of(cls, experiment: Experiment, replicas: int) -> _Observer | None:
        gain = experiment.controller.observer_gain
        return None if gain is None else cls(gain, experiment.sample_time, replicas)

    def __call__(self, error: Array) -> tuple[Array, Array]:
        state, ahead = self._state, self._next
        np.matmul(self._transition, state.reshape(3, -1), out=ahead.reshape(3, -1))
        np.multiply(self._gain, error - ahead[0], out=self._work)
        np.add(ahead, self._work, out=state)
        return state[0], state[1]


class _BackwardDifference:
    """dē = (e_k - e_{k-1})/T, zero at the first sample."""

    def __init__(self, sample_time: float) -> None:
        self._rate = 1.0 / sample_time
        self._last: Array | None = None

    def __call__(self, error: Array) -> tuple[Array, Array]:
        before, self._last = error if self._last is None else self._last, error
        return error, (error - before) * self._rate


def _estimator(experiment: Experiment, replicas: int) -> _Observer | _BackwardDifference:
    observer = _Observer.of(experiment, replicas) if experiment.controller.velocity == "observer" else None
    return _BackwardDifference(experiment.sample_time) if observer is None else observer
