"""Simulate experiments in closed loop: arms in continuous time, controllers sample by sample.

    simulated = run(plant, Experiment.of_log(log), steps, noise, seeds=range(10))
    simulated.q[3], simulated.tau[3]             what replica 3 would have logged

What a drive adds to the command is white torque noise, held over each sample; encoders count steps
of their resolution. A few RRR arms whose controller and effects need no arrays move one after the
other in plain numbers, all others side by side in arrays.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from pipelines.io.log import Array
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.controller import Controlling, Feedback, ahead_of
from pipelines.simulation.experiment import Experiment
from pipelines.simulation.integrate import OneArm, RungeKutta
from pipelines.simulation.plant import Plant, refuse_runaway

__all__ = ["Noise", "Simulated", "run", "run_together", "runs_alone"]

_CHUNK = 2048  # numerics: samples whose noise is drawn, or that are Python numbers, at once
_LOOKS = 64  # numerics: samples between two looks at whether an arm runs away


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
    """The simulated signals. Each array (replicas, samples, joints)."""

    t: Array  # [s] (samples,)
    q: Array  # [rad] as the encoders counted it
    tau: Array  # [N m] as it was commanded, or as the recorder passed it on
    true_q: Array  # [rad]
    true_dq: Array  # [rad/s]
    steps: int  # of the integrator, a sample


def run(
    plant: Plant,
    experiment: Experiment,
    steps: int,
    noise: Noise | None = None,
    seeds: Iterable[int] = (0,),
    exact: bool = True,
) -> Simulated:
    """Run one replica for each seed, with `steps` steps of the integrator a sample.

    Args:
        exact: with a rigid body that is nowhere held.

    Raises:
        InputRejected: D15, the model's inertia matrix is singular or worse; D17, the simulated arm
            runs away.
    """
    return run_together(plant, (experiment,), steps, noise, seeds, exact)[0]


def run_together(
    plant: Plant,
    experiments: Sequence[Experiment],
    steps: int,
    noise: Noise | None = None,
    seeds: Iterable[int] = (0,),
    exact: bool = True,
) -> list[Simulated]:
    """`run` several experiments at once, which costs hardly more than the longest alone."""
    drawn = tuple(seeds)
    lanes = [_Lane(plant, one, noise or Noise.none(one.n_joints), drawn) for one in experiments]
    few = len(lanes) * len(drawn) <= SIMULATION.few
    for time in dict.fromkeys(one.sample_time for one in experiments):
        same = [lane for lane in lanes if lane.experiment.sample_time == time]
        if few and all(runs_alone(plant, lane.experiment) for lane in same):
            for lane, replica in itertools.product(same, range(len(drawn))):
                _run_alone(OneArm(plant, time, steps, not exact), lane, replica)
        else:
            _advance(plant, same, steps, exact)
    return [lane.simulated(steps) for lane in lanes]


def runs_alone(plant: Plant, experiment: Experiment) -> bool:
    """Return whether plain numbers are enough: torque hangs on reference and error alone."""
    alike = experiment.v is None or experiment.v.ndim == experiment.q_ref.ndim
    return alike and experiment.controller.law != "computed-torque" and OneArm.fits(plant)


class _Lane:
    """One experiment on the way: where its replicas start, and what they would have logged."""

    def __init__(
        self, plant: Plant, experiment: Experiment, noise: Noise, seeds: tuple[int, ...]
    ) -> None:
        postures = max(1, experiment.n_samples // SIMULATION.postures)
        plant.refuse_unphysical(experiment.q_ref[::postures])
        replicas, n, samples = len(seeds), experiment.n_joints, experiment.n_samples
        self.plant, self.experiment, self.noise, self.seeds = plant, experiment, noise, seeds
        self.t = np.full(replicas, experiment.start_time)
        q, dq = (np.repeat(x[:, None], replicas, axis=1) for x in (experiment.q0, experiment.dq0))
        self.state, self.states = plant.prepared(replicas).begin(self.t, q, dq)
        self.counted, self.commanded = np.empty((2, samples, n, replicas))
        self.motion = np.empty((samples, 2 * n, replicas))
        self.draws = _draws(noise, seeds, samples)
        self.control = Controlling(experiment, replicas)

    def applied(self, k: int, state: Array, seen: Array) -> Array:
        """Return the torque (joints, replicas) from sample k on, of an arm in `state`."""
        extra_torque, extra_position = next(self.draws)
        self.motion[k] = state
        self.counted[k] = self.control.counted(seen + extra_position)
        self.commanded[k] = command = self.control.command(k, self.counted[k])
        return command + extra_torque

    def simulated(self, steps: int) -> Simulated:
        t, n = self.experiment.t, self.experiment.n_joints
        logged = self.counted, self.commanded, self.motion
        q, tau, moved = (np.ascontiguousarray(np.moveaxis(x, 2, 0)) for x in logged)
        if self.plant.records:
            tau = np.stack([self.plant.logged(t, one) for one in tau])
        return Simulated(t, q, tau, moved[..., :n], moved[..., n:], steps)


@np.errstate(all="ignore")  # numbers of an arm that runs away are not finite before it is refused
def _advance(plant: Plant, lanes: Sequence[_Lane], steps: int, exact: bool) -> None:
    """Move all lanes side by side to the end of the longest; an ended one keeps its torque."""
    width, time, n = len(lanes[0].t), lanes[0].experiment.sample_time, plant.n_joints
    moving = plant.prepared(width * len(lanes))
    integrator = RungeKutta(moving, time, steps, not exact)
    t = np.concatenate([lane.t for lane in lanes])
    state = np.concatenate([lane.state for lane in lanes], axis=1)
    states = np.concatenate([lane.states for lane in lanes])
    parts = [(lane, slice(i * width, (i + 1) * width)) for i, lane in enumerate(lanes)]
    applied = np.zeros((n, len(t)))
    for k in range(max(lane.experiment.n_samples for lane in lanes)):
        seen = moving.measured(state[:n], states)
        running = [(lane, part) for lane, part in parts if k < lane.experiment.n_samples]
        for lane, part in running:
            applied[:, part] = lane.applied(k, state[:, part], seen[:, part])
        states = moving.updated(t, state[:n], state[n:], states, applied)
        states = integrator.advance(t, state, states, applied)
        t += time
        for lane, part in running:
            if k + 1 == lane.experiment.n_samples or k % _LOOKS == 0:
                refuse_runaway(state[:, part], k, time)


def _run_alone(arm: OneArm, lane: _Lane, replica: int) -> None:
    """Move one replica from the first to the last sample, the same law joint by joint."""
    experiment, time = lane.experiment, lane.experiment.sample_time
    laws = [Feedback(experiment, joint) for joint in range(experiment.n_joints)]
    draws = _draws(lane.noise, (lane.seeds[replica],), experiment.n_samples)
    x: list[float] = [*lane.state[:, replica].tolist(), *lane.states[replica].tolist()]
    wanted, more = _listed(experiment.q_ref), _listed(ahead_of(experiment))
    noise = _listed(np.array([np.concatenate(drawn)[:, 0] for drawn in draws]))
    for k, (reference, ahead, drawn) in enumerate(zip(wanted, more, noise, strict=True)):
        lane.motion[k, :, replica] = x[:6]
        seen, said, applied = [], [], []
        try:
            for j, law in enumerate(laws):
                angle = x[j] + drawn[3 + j]
                q = angle if law.counts is None else law.counts(angle)
                seen.append(q)
                said.append(law.delayed(law.limited(law(q - reference[j], ahead[j]))))
                applied.append(said[j] + drawn[j])
        except (ValueError, OverflowError):  # of an infinite number there is no count
            x = [nan] * len(x)
        if k % _LOOKS == 0 or x[0] != x[0]:
            refuse_runaway(np.array(x[:6])[:, None], k, time)
        lane.counted[k, :, replica], lane.commanded[k, :, replica] = seen, said
        x = arm.moved(x, applied)
    refuse_runaway(np.array(x[:6])[:, None], experiment.n_samples, time)


def _listed(x: Array) -> Iterator[list[float]]:
    """Yield the rows of `x` as lists; all at once would take ten times the room."""
    for first in range(0, len(x), _CHUNK):
        yield from x[first : first + _CHUNK].tolist()


def _draws(noise: Noise, seeds: tuple[int, ...], samples: int) -> Iterator[tuple[Array, Array]]:
    """Yield torque and position noise (joints, replicas) of each sample.

    Every replica has a generator of its own, so that it does the same alone and among others.
    """
    size, n = np.concatenate([noise.torque, noise.position]), len(noise.torque)
    generators = [np.random.default_rng(seed) for seed in seeds]
    for first in range(0, samples, _CHUNK):
        shape = (min(_CHUNK, samples - first), len(size))
        drawn = [generator.standard_normal(shape) * size for generator in generators]
        yield from ((row[:n], row[n:]) for row in np.stack(drawn, axis=-1))
