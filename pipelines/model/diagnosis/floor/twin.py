"""The twin: the fitted model run through the same experiments, controller, quantisation and noise, and then analysed alike.

    twin = make_twin(model, weight, data, ...)     replicas of every log whose controller is known
    twin.weighted(weight)                          residuals (replicas, rows) of the log's own rows

What the twin shows too is an artefact of sampling, smoothing and friction at reversals, no fault: its residual is the floor,
and what a cause gains on it is what that cause has to exceed on the log. Twins of logs that cannot be simulated do not exist.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array, ExperimentLog, Signal
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns, law_slopes, rows_of
from pipelines.model.diagnosis.floor.replay import as_recorded, experiment_of
from pipelines.model.diagnosis.rows.data import Data, gather
from pipelines.model.diagnosis.rows.imperfections import DriveNoise, drive_waves, small_loads
from pipelines.model.diagnosis.rows.whitening import Whitening
from pipelines.model.estimation.logs import Motions, Recipe
from pipelines.model.motion import Reconstructed, reconstruct
from pipelines.model.rigid.body import Motion
from pipelines.model.simulation import Noise, Simulated, simulate_together

__all__ = ["Twin", "imperfect", "make_twin", "not_replayable", "replayable", "replica"]

_NUISANCE = 20040509
_DRIVES = 10  # sets of drives, at least: a replica of which there are few is looked at with several


@dataclass(frozen=True, eq=False)
class Twin:
    """Replicas of the logs that can be simulated."""

    fits: tuple[Fit, ...]  # of each replica
    places: tuple[int, ...]  # which of the logs
    noise: DriveNoise
    replicas: int = 0  # that were simulated; with several sets of drives each where there are few

    @property
    def data(self) -> Data:
        """Motion and rows of the first replica, which stands for all: they differ by noise."""
        return self.fits[0].data

    @property
    def rms(self) -> Array:
        """(joints,) [N m] over all replicas: the floor. Of copies, which keep no basis."""
        return np.asarray(np.sqrt(np.mean(np.square([replace(one).rms for one in self.fits]), axis=0)))

    @property
    def scatter(self) -> Array:
        """(joints,) relative standard deviation of the power that a replica leaves."""
        powers = np.square([replace(one).rms for one in self.fits])
        return np.asarray(np.std(powers, axis=0, ddof=1) / np.maximum(powers.mean(axis=0), 1e-300) if len(powers) > 1 else
                          np.zeros(powers.shape[1]))

    def weighted(self, weight: Array) -> tuple[Fit, Array]:
        """The fit of the first replica and the residuals (replicas, rows) of all, weighted, joints weighted like this."""
        first = self._weighted(0, weight)
        return first, np.array([first.residual, *(self._weighted(k, weight).residual for k in range(1, len(self.fits)))])

    def through(self, whitening: Whitening, weight: Array | None = None) -> Twin:
        """The same replicas in rows that are `Data.whitened`."""
        fits = []
        for one in self.fits:
            there = one.data.whitened(whitening, weight)
            table, y = (there.clear(one.data.through(whitening, x)) for x in (one.table, one.y))
            fits.append(fit_columns(there, table, y, one.weight))
        return Twin(tuple(fits), self.places, self.noise, self.replicas)

    def _weighted(self, k: int, weight: Array) -> Fit:
        """Made anew when it is asked for: each would keep a basis as large as its table, and there are many replicas."""
        one = self.fits[k]
        return fit_columns(one.data, one.table, one.y, weight)


def replayable(logs: Sequence[ExperimentLog]) -> tuple[int, ...]:
    """Places of the logs whose controller is known."""
    found = []
    for place, log in enumerate(logs):
        try:
            experiment_of(log)
        except InputRejected:
            continue
        found.append(place)
    return tuple(found)


def not_replayable(logs: Sequence[ExperimentLog]) -> str:
    """Why the first of the logs that describe their controller cannot be replayed all the same; empty where none describes it."""
    for log in logs:
        if not log.controlled:
            continue
        try:
            experiment_of(log)
        except InputRejected as refused:
            return f"of {log.name}: {refused.message}"
    return ""


def make_twin(model: Exact, weight: Array, data: Data, motions: Motions, recipe: Recipe, noise: DriveNoise, replicas: int,
              seed: int) -> Twin:
    """Replicas of every log that can be simulated, of which there is one at least.

    What drives have is added to what was simulated: the orders of ten ripples cost little, and three would leave out most.

    Raises:
        InputRejected: D15, D17: the fitted arm cannot be simulated.
    """
    each = -(-_DRIVES // replicas)
    drives = range(seed, seed + replicas * each)
    places = replayable([log for log, _ in motions])
    columns = model.columns
    drawn = Noise(noise.white, np.zeros_like(noise.white))
    seeds = range(seed, seed + replicas)
    every = simulate_together(model.nominal, [experiment_of(motions[place][0]) for place in places], drawn, seeds)
    runs = dict(zip(places, every, strict=True))
    found = []
    for k in range(replicas):
        parts = [replica(motions[place], done, k, recipe) for place, done in runs.items()]
        rows = [data.logs[place].equations.rows for place in places]
        own = gather(tuple(parts), columns, recipe, rows)
        slopes, _ = law_slopes(own, columns, model.beta)
        table = np.concatenate([rows_of(own, columns), *slopes])
        for own_drives in range(k, len(drives), replicas):
            small = own.lay_each(imperfect(model.nominal, noise, own, drives, own_drives))
            found.append(fit_columns(own, table, own.y + small, weight))
    return Twin(tuple(found), places, noise, replicas)


def imperfect(arm: Arm, noise: DriveNoise, own: Data, seeds: Sequence[int], k: int) -> Callable[[int, Motion], Array]:
    """Small loads (samples, joints) [N m] of replica `k` of those that `seeds` draw, in each of its logs `own`."""
    waves = drive_waves(arm.robot.revolute, seeds)[k]

    def loads(log: int, motion: Motion) -> Array:
        step = own.logs[log - own.first].log.sample_time
        return small_loads(motion, arm, noise.wander, step, waves, np.random.default_rng([_NUISANCE, seeds[k], log]))

    return loads


def replica(real: tuple[ExperimentLog, Reconstructed], done: Simulated, k: int,
            recipe: Recipe) -> tuple[ExperimentLog, Reconstructed]:
    """Replica `k`, reconstructed as the log was: another tuning, in which ends are less certain, would be no noise of the drive."""
    log, found = real
    signals = {name: Signal(values, log.signals[name].units, log.signals[name].long_name)
               for name, values in (("t", log.t), ("q", as_recorded(log, done.q[k])), ("tau", as_recorded(log, done.tau[k])))}
    copy = replace(log, name=f"{log.name} twin {k + 1}", torque=None, signals=signals, period=None, derived=None)
    return copy, reconstruct(copy, recipe.how, observers=None if found.mean is not None else found.observers)
