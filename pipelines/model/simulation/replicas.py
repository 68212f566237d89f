"""Simulate an experiment in closed loop: the arm in continuous time, its controller sample by sample, many replicas at once.

    simulated = simulate(arm, Experiment.of_log(log), noise, seeds=range(10))
    simulated.q[3], simulated.tau[3]             what replica 3 would have logged

What a drive adds to the command is white torque noise, held over each sample; encoders count steps of their resolution.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from pipelines.errors import InputRejected
from pipelines.model.rigid.body import Array
from pipelines.model.simulation.control import Controlling
from pipelines.model.simulation.experiment import Experiment
from pipelines.model.simulation.integrate import RungeKutta
from pipelines.model.simulation.one_rrr import OneRRR
from pipelines.model.simulation.plant import MovingPlant, Plant

__all__ = ["Noise", "Simulated", "run"]

_CHUNK = 2048  # samples whose noise is drawn at once
_POSTURES = 32  # of the reference in which the inertia matrix is looked at
_RUNAWAY = 1e4  # [rad], [rad/s]: no arm is ever there


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations of what is random; zero without it."""

    torque: Array  # [N m] (n,) of the drive, white from sample to sample
    position: Array  # [rad] (n,) of the encoder, before it counts

    @classmethod
    def none(cls, n_joints: int) -> Noise:
        return cls(np.zeros(n_joints), np.zeros(n_joints))


@dataclass(frozen=True, eq=False)
class Simulated:
    """What the replicas did. Each array (replicas, samples, joints)."""

    t: Array  # [s] (samples,)
    q: Array  # [rad] as the encoders counted it
    tau: Array  # [N m] as it was commanded, or as the recorder passed it on
    true_q: Array  # [rad]
    true_dq: Array  # [rad/s]
    steps: int  # of the integrator, a sample


def run(plant: Plant, experiment: Experiment, steps: int, noise: Noise | None = None, seeds: Iterable[int] = (0,)) -> Simulated:
    """One replica for each seed, with `steps` Runge-Kutta steps a sample.

    Raises:
        InputRejected: D15, the model's inertia matrix is singular or worse; D17, the simulated arm runs away.
    """
    seeds = tuple(seeds)
    plant.refuse_unphysical(experiment.q_ref[::max(1, experiment.n_samples // _POSTURES)])
    replicas, n = len(seeds), experiment.n_joints
    moving, control = plant.prepared(replicas), Controlling(experiment, replicas)
    integrator = _integrator(moving, experiment.sample_time, steps)
    state = np.ascontiguousarray(np.repeat(np.concatenate([experiment.q0, experiment.dq0])[:, None], replicas, axis=1))
    t = np.full(replicas, experiment.start_time)
    state[:] = moving.settled(t, state[:n], state[n:])
    states = moving.at_start(t, state[:n], state[n:])
    shape = (experiment.n_samples, n, replicas)
    counted, commanded, motion = np.empty(shape), np.empty(shape), np.empty((shape[0], 2 * n, replicas))
    draws = _draws(noise or Noise.none(n), seeds, experiment.n_samples)
    count = _Encoder(experiment.resolution)
    for k in range(experiment.n_samples):
        extra_torque, extra_position = next(draws)
        motion[k] = state
        counted[k] = count(_seen(moving, state[:n], states) + extra_position)
        commanded[k] = command = control.command(k, counted[k])
        applied = command + extra_torque
        if moving.n_states:
            states = moving.updated(t, state[:n], state[n:], states, applied)
        states = integrator.advance(t, state, states, applied)
        t += experiment.sample_time
        if k % 64 == 0:
            _refuse_runaway(state, k, experiment)
    times: Array = experiment.start_time + experiment.sample_time * np.arange(shape[0], dtype=np.float64)
    _refuse_runaway(state, shape[0], experiment)
    q, tau, moved = (np.ascontiguousarray(np.moveaxis(x, 2, 0)) for x in (counted, commanded, motion))
    if plant.records:
        tau = np.stack([plant.logged(times, one) for one in tau])
    return Simulated(times, q, tau, moved[..., :n], moved[..., n:], steps)


def _integrator(moving: MovingPlant, sample_time: float, steps: int) -> RungeKutta | OneRRR:
    if moving.replicas == 1 and OneRRR.fits(moving.plant):
        return OneRRR(moving.plant, sample_time, steps)
    return RungeKutta(moving, sample_time, steps)


def _seen(moving: MovingPlant, q: Array, states: Array) -> Array:
    return moving.measured(q, states) if moving.plant.hooks else q


def _draws(noise: Noise, seeds: tuple[int, ...], samples: int) -> Iterator[tuple[Array | float, Array | float]]:
    """Torque and position noise of each sample (joints, replicas). Every replica has a generator of its own, so that it
    does the same alone and among others."""
    n = len(noise.torque)
    size = np.concatenate([noise.torque, noise.position])
    if not size.any():
        for _ in range(samples):
            yield 0.0, 0.0
        return
    generators = [np.random.default_rng(seed) for seed in seeds]
    for first in range(0, samples, _CHUNK):
        count = min(_CHUNK, samples - first)
        drawn = np.stack([g.standard_normal((count, 2 * n)) * size for g in generators], axis=-1)
        for one in drawn:
            yield one[:n], one[n:]


class _Encoder:
    """q counted in steps of the resolution; joints of resolution 0 are not counted."""

    def __init__(self, resolution: Array) -> None:
        self._counting = bool(resolution.any())
        self._step = np.where(resolution > 0.0, resolution, 1e-15)[:, None]

    def __call__(self, q: Array) -> Array:
        return np.rint(q / self._step) * self._step if self._counting else q


def _refuse_runaway(state: Array, k: int, experiment: Experiment) -> None:
    # not >: what is not a number is no motion either
    if not np.abs(state).max() <= _RUNAWAY:
        n = experiment.n_joints
        joint = int(np.argmax(~(np.abs(state) <= _RUNAWAY).all(axis=1))) % n + 1
        raise InputRejected("D17", f"the simulated arm runs away: joint {joint}, after {k * experiment.sample_time:.3g} s",
                            remedy="check the model's inertia and friction, and the gains that the log gives")
