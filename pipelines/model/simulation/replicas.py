"""Simulate an experiment in closed loop: the arm in continuous time, its controller sample by sample, many replicas at once.

    simulated = simulate(arm, Experiment.of_log(log), noise, seeds=range(10))
    simulated.q[3], simulated.tau[3]             what replica 3 would have logged

What a drive adds to the command is white torque noise, held over each sample; encoders count steps of their resolution.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.model.rigid.body import Array
from pipelines.model.simulation.control import Controlling
from pipelines.model.simulation.experiment import Experiment
from pipelines.model.simulation.integrate import HeldBody, RungeKutta
from pipelines.model.simulation.one_hooked import OneHooked
from pipelines.model.simulation.one_loop import OneLoop
from pipelines.model.simulation.one_rrr import OneRRR
from pipelines.model.simulation.plant import MovingPlant, Plant

__all__ = ["Noise", "Simulated", "run", "run_together"]

Integrator = RungeKutta | OneRRR | OneHooked

_CHUNK = 2048  # samples whose noise is drawn at once
_POSTURES = 32  # of the reference in which the inertia matrix is looked at
_FEW = 8  # robots that are simulated one after the other, where a loop without arrays can
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


def run(plant: Plant, experiment: Experiment, steps: int, noise: Noise | None = None, seeds: Iterable[int] = (0,),
        exact: bool = True) -> Simulated:
    """One replica for each seed, with `steps` steps of the integrator a sample; `exact` as in `run_together`.

    Raises:
        InputRejected: D15, the model's inertia matrix is singular or worse; D17, the simulated arm runs away.
    """
    return run_together(plant, (experiment,), steps, noise, seeds, exact)[0]


def run_together(plant: Plant, experiments: Sequence[Experiment], steps: int, noise: Noise | None = None,
                 seeds: Iterable[int] = (0,), exact: bool = True) -> list[Simulated]:
    """`run` of several experiments at once, which costs hardly more than the longest alone. They have one sample time.

    Args:
        exact: with a rigid body that is nowhere held.

    Raises:
        InputRejected: D15, the model's inertia matrix is singular or worse; D17, the simulated arm runs away.
    """
    drawn = tuple(seeds)
    every = [_Lane(plant, experiment, noise or Noise.none(experiment.n_joints), drawn) for experiment in experiments]
    alone = [lane for lane in every if len(every) * len(drawn) <= _FEW and OneLoop.fits(plant, lane.experiment)]
    for lane in alone:
        lane.run_alone(steps, drawn, exact)
    active, k = sorted((lane for lane in every if lane not in alone), key=lambda lane: -lane.experiment.n_samples), 0
    before: Integrator | None = None
    while active:
        own = plant if plant.p.ndim == 1 else replace(plant, p=np.tile(plant.p, (len(active), 1)))
        moving = own.prepared(len(drawn) * len(active))
        last = active[-1].experiment.n_samples
        integrator = _integrator(moving, active[0].experiment.sample_time, steps, exact)
        if isinstance(integrator, HeldBody) and isinstance(before, HeldBody):
            integrator.go_on_from(before)
        _advance(moving, integrator, active, k, last)
        active, k, before = [lane for lane in active if lane.experiment.n_samples > last], last, integrator
    return [lane.simulated(steps) for lane in every]


@np.errstate(all="ignore")  # of an arm that runs away numbers are no longer finite, some samples before it is refused
def _advance(moving: MovingPlant, integrator: Integrator, lanes: Sequence[_Lane], first: int, last: int) -> None:
    """All lanes from sample `first` to `last`, side by side."""
    n, width = moving.plant.n_joints, len(lanes[0].t)
    own = [slice(i * width, (i + 1) * width) for i in range(len(lanes))]
    t = np.concatenate([lane.t for lane in lanes])
    state = np.concatenate([lane.state for lane in lanes], axis=1)
    states = np.concatenate([lane.states for lane in lanes])
    applied, step = np.empty((n, len(t))), lanes[0].experiment.sample_time
    for k in range(first, last):
        seen = _seen(moving, state[:n], states)
        for lane, part in zip(lanes, own, strict=True):
            applied[:, part] = lane.applied(k, state[:, part], seen[:, part])
        if moving.n_states:
            states = moving.updated(t, state[:n], state[n:], states, applied)
        states = integrator.advance(t, state, states, applied)
        t += step
        if k % 64 == 0:
            _refuse_runaway(state, k, step)
    _refuse_runaway(state, last, step)
    for lane, part in zip(lanes, own, strict=True):
        lane.t, lane.state, lane.states = t[part], state[:, part], states[part]


class _Lane:
    """One experiment on the way: its controllers, and what its replicas would have logged."""

    def __init__(self, plant: Plant, experiment: Experiment, noise: Noise, seeds: tuple[int, ...]) -> None:
        plant.refuse_unphysical(experiment.q_ref[::max(1, experiment.n_samples // _POSTURES)])
        replicas, n = len(seeds), experiment.n_joints
        moving = plant.prepared(replicas)
        self.plant, self.experiment = plant, experiment
        self.t = np.full(replicas, experiment.start_time)
        begin = np.repeat(np.concatenate([experiment.q0, experiment.dq0])[:, None], replicas, axis=1)
        self.state = np.ascontiguousarray(moving.settled(self.t, begin[:n], begin[n:]))
        self.states = moving.at_start(self.t, self.state[:n], self.state[n:])
        shape = (experiment.n_samples, n, replicas)
        self._counted, self._commanded, self._motion = np.empty(shape), np.empty(shape), np.empty((shape[0], 2 * n, replicas))
        self._noise, self._draws = noise, _draws(noise, seeds, experiment.n_samples)
        self._count = _Encoder(experiment.resolution)
        self._control = Controlling(experiment, replicas)

    def applied(self, k: int, state: Array, seen: Array) -> Array:
        """Torque (joints, replicas) from sample k on, where the arm is in `state` and its sensors without noise say `seen`."""
        extra_torque, extra_position = next(self._draws)
        self._motion[k] = state
        self._counted[k] = self._count(seen + extra_position)
        self._commanded[k] = command = self._control.command(k, self._counted[k])
        return command + extra_torque

    def run_alone(self, steps: int, seeds: tuple[int, ...], exact: bool) -> None:
        """One replica after the other, each from the first to the last sample."""
        experiment, loop = self.experiment, OneLoop(self.plant, self.experiment, steps, exact)
        for r, seed in enumerate(seeds):
            pieces = _pieces(self._noise, (seed,), experiment.n_samples)
            own = None if pieces is None else (piece[..., 0] for piece in pieces)
            start = np.concatenate([self.state[:, r], self.states[r]])
            ran = loop.run(start, own, lambda now, k: _refuse_runaway(now[:, None], k, experiment.sample_time))
            self._motion[..., r], self._counted[..., r], self._commanded[..., r] = ran

    def simulated(self, steps: int) -> Simulated:
        experiment, n = self.experiment, self.experiment.n_joints
        samples = np.arange(experiment.n_samples, dtype=np.float64)
        times: Array = experiment.start_time + experiment.sample_time * samples
        q, tau, moved = (np.ascontiguousarray(np.moveaxis(x, 2, 0)) for x in (self._counted, self._commanded, self._motion))
        if self.plant.records:
            tau = np.stack([self.plant.logged(times, one) for one in tau])
        return Simulated(times, q, tau, moved[..., :n], moved[..., n:], steps)


def _integrator(moving: MovingPlant, sample_time: float, steps: int, exact: bool) -> Integrator:
    if moving.replicas == 1 and OneRRR.fits(moving.plant):
        return OneRRR(moving.plant, sample_time, steps)
    if moving.replicas == 1 and OneHooked.fits(moving.plant):
        return OneHooked(moving, sample_time, steps)
    if not exact and HeldBody.fits(moving):
        return HeldBody(moving, sample_time, steps)
    return RungeKutta(moving, sample_time, steps)


def _seen(moving: MovingPlant, q: Array, states: Array) -> Array:
    return moving.measured(q, states) if moving.plant.hooks else q


def _draws(noise: Noise, seeds: tuple[int, ...], samples: int) -> Iterator[tuple[Array | float, Array | float]]:
    """Torque and position noise of each sample (joints, replicas)."""
    pieces, n = _pieces(noise, seeds, samples), len(noise.torque)
    if pieces is None:
        yield from itertools.repeat((0.0, 0.0), samples)
    else:
        yield from ((one[:n], one[n:]) for piece in pieces for one in piece)


def _pieces(noise: Noise, seeds: tuple[int, ...], samples: int) -> Iterator[Array] | None:
    """Noise of some samples at a time, (samples, 2 joints, replicas), of torques, then of positions; None where there is none.

    Every replica has a generator of its own, so that it does the same alone and among others.
    """
    size = np.concatenate([noise.torque, noise.position])
    if not size.any():
        return None
    generators = [np.random.default_rng(seed) for seed in seeds]
    counts = (min(_CHUNK, samples - first) for first in range(0, samples, _CHUNK))
    return (np.stack([g.standard_normal((count, len(size))) * size for g in generators], axis=-1) for count in counts)


class _Encoder:
    """q counted in steps of the resolution; joints of resolution 0 are not counted."""

    def __init__(self, resolution: Array) -> None:
        self._counting = bool(resolution.any())
        self._step = np.where(resolution > 0.0, resolution, 1e-15)[:, None]

    def __call__(self, q: Array) -> Array:
        return np.rint(q / self._step) * self._step if self._counting else q


def _refuse_runaway(state: Array, k: int, sample_time: float) -> None:
    # not >: what is not a number is no motion either
    if not np.abs(state).max() <= _RUNAWAY:
        joint = int(np.argmax(~(np.abs(state) <= _RUNAWAY).all(axis=1))) % (len(state) // 2) + 1
        raise InputRejected("D17", f"the simulated arm runs away: joint {joint}, after {k * sample_time:.3g} s",
                            remedy="check the model's inertia and friction, and the gains that the log gives")
