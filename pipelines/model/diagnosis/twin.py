"""The twin: the fitted model run through the same experiments, controller, quantisation and noise, and then analysed alike.

    noise = drive_noise(...)                       of the drives, from what the log shows at rest from everything else
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
from pipelines.log.shared_work import shared_out
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.data import Data, gather
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.imperfections import small_loads
from pipelines.model.diagnosis.nominal import Fit, fit_columns, law_slopes, rows_of
from pipelines.model.estimation.logs import Motions, Recipe
from pipelines.model.estimation.regression import Columns
from pipelines.model.motion import Reconstructed, reconstruct
from pipelines.model.rigid.body import Motion
from pipelines.model.simulation import Experiment, Noise, Plant, Simulated, choose_step, simulate, simulate_together

__all__ = ["Twin", "drive_noise", "imperfect", "make_twin", "replayable", "replica", "white"]

_WINDOW = 0.4  # [s] in which the noise is looked at
_QUIET = 0.3  # of the windows are taken for quiet
_NUISANCE = 20040509
_BOUNDS = (0.25, 2.0)  # of the guess's power: counting of the encoders hides what is less
_FEWEST = 4  # rows of a window
_SMOOTH = 5  # rows of the moving average whose remainder is noise


@dataclass(frozen=True, eq=False)
class Twin:
    """Replicas of the logs that can be simulated."""

    fits: tuple[Fit, ...]  # of each replica
    places: tuple[int, ...]  # which of the logs
    noise: Array  # (joints,) [N m] of the drives

    @property
    def data(self) -> Data:
        """Motion and rows of the first replica, which stands for all: they differ by noise."""
        return self.fits[0].data

    @property
    def rms(self) -> Array:
        """(joints,) [N m] over all replicas: the floor. Of copies, which keep no basis."""
        return np.asarray(np.sqrt(np.mean(np.square([replace(one).rms for one in self.fits]), axis=0)))

    def weighted(self, weight: Array) -> tuple[Fit, Array]:
        """The fit of the first replica and the residuals (replicas, rows) of all, weighted, joints weighted like this."""
        first = self._weighted(0, weight)
        return first, np.array([first.residual, *(self._weighted(k, weight).residual for k in range(1, len(self.fits)))])

    def _weighted(self, k: int, weight: Array) -> Fit:
        """Made anew when it is asked for: each would keep a basis as large as its table, and there are many replicas."""
        one = self.fits[k]
        return fit_columns(one.data, one.table, one.y, weight)


def replayable(logs: Sequence[ExperimentLog]) -> tuple[int, ...]:
    """Places of the logs whose controller is known."""
    found = []
    for place, log in enumerate(logs):
        try:
            Experiment.of_log(log)
        except InputRejected:
            continue
        found.append(place)
    return tuple(found)


def drive_noise(model: Exact, data: Data, left: Array, motions: Motions, recipe: Recipe, place: int, seed: int) -> Array:
    """(joints,) [N m] white torque noise of the drives: as much as makes a replica as rough as log number `place`.

    Rough: quick changes of the residual in its quietest windows, where neither reversals nor any fault are. Two replicas,
    without noise and with a guess of it, tell what of it is counting of the encoders and how noise shows.

    Args:
        left: (rows,) [N m] the residual, as far as possible without what a fault makes.
    """
    mine = list(data.split(left))[place]
    step = float(np.median(np.diff(data.logs[place].t)))
    log = motions[place][0]
    rough = _roughness(mine, step)
    guess = rough * np.sqrt(step / log.sample_time)

    experiment = Experiment.of_log(log)
    steps = choose_step(Plant.of(model.nominal), experiment).per_sample  # fine enough for the noisy one too

    def of_replica(drawn: tuple[Array, int]) -> Array:
        level, own = drawn
        done = simulate(model.nominal, experiment, Noise(level, np.zeros_like(guess)), (own,), steps=steps)
        copy, found = _analysed(motions[place], done, 0, recipe, model.columns, data, place)
        return _roughness(next(found.data.split(found.left)), float(np.median(np.diff(copy.logs[0].t))))

    still, shaken = np.square(shared_out(of_replica, ((np.zeros_like(guess), seed), (guess, seed + 1))))
    share = (np.square(rough) - still) / np.maximum(shaken - still, 1e-6 * np.square(rough) + 1e-300)
    return np.asarray(guess * np.sqrt(np.clip(share, *_BOUNDS)))


def white(data: Data, left: Array) -> Array:
    """(joints,) [N m] of the residual that is white noise, from its quick changes: a floor that no model can be below."""
    share = np.sqrt(1.0 - 1.0 / _SMOOTH)
    each = [_roughness(x, float(np.median(np.diff(one.t)))) / share for one, x in zip(data.logs, data.split(left), strict=True)]
    return np.asarray(np.sqrt(np.nanmean(np.square(each), axis=0)))


def _roughness(x: Array, step: float) -> Array:
    """(joints,) of x (joints, rows): standard deviation of what a moving average leaves, in the quietest windows; NaN of fewer rows
    than a window has."""
    if x.shape[1] < _SMOOTH + _FEWEST:
        return np.full(len(x), np.nan)
    kernel = np.ones(_SMOOTH) / _SMOOTH
    rest = np.array([row[_SMOOTH // 2:len(row) - _SMOOTH // 2] - np.convolve(row, kernel, mode="valid") for row in x])
    size = min(max(_FEWEST, round(_WINDOW / step)), rest.shape[1])
    windows = rest[:, :rest.shape[1] // size * size].reshape(len(rest), -1, size)
    return np.asarray(np.sqrt(np.quantile(windows.var(axis=2), _QUIET, axis=1)))


def make_twin(model: Exact, weight: Array, data: Data, motions: Motions, recipe: Recipe, noise: Array, replicas: int,
              seed: int) -> Twin | None:
    """Replicas of every log that can be simulated; None where there is none.

    Raises:
        InputRejected: D15, D17: the fitted arm cannot be simulated.
    """
    places = replayable([log for log, _ in motions])
    if not places or replicas < 1:
        return None
    columns = model.columns
    drawn = Noise(noise, np.zeros_like(noise))
    seeds = range(seed, seed + replicas)
    every = simulate_together(model.nominal, [Experiment.of_log(motions[place][0]) for place in places], drawn, seeds)
    runs = dict(zip(places, every, strict=True))
    found = []
    for k in range(replicas):
        parts = [replica(motions[place], done, k, recipe) for place, done in runs.items()]
        rows = [data.logs[place].equations.rows for place in places]
        own = gather(tuple(parts), columns, recipe, rows)
        small = own.lay_each(imperfect(model.nominal, noise, own, seed + k))
        slopes, _ = law_slopes(own, columns, model.beta)
        found.append(fit_columns(own, np.concatenate([rows_of(own, columns), *slopes]), own.y + small, weight))
    return Twin(tuple(found), places, noise)


def imperfect(arm: Arm, noise: Array, own: Data, seed: int) -> Callable[[int, Motion], Array]:
    """Small loads (samples, joints) [N m] of a replica in each of its logs `own`, drawn by `seed`."""
    def loads(log: int, motion: Motion) -> Array:
        step = own.logs[log - own.first].log.sample_time
        return small_loads(motion, arm, noise, step, np.random.default_rng([_NUISANCE, seed]),
                           np.random.default_rng([_NUISANCE, seed, log]))

    return loads


def _analysed(real: tuple[ExperimentLog, Reconstructed], done: Simulated, k: int, recipe: Recipe, columns: Columns, data: Data,
              place: int) -> tuple[Data, Fit]:
    own = gather((replica(real, done, k, recipe),), columns, recipe, (data.logs[place].equations.rows,))
    return own, fit_columns(own, rows_of(own, columns))


def replica(real: tuple[ExperimentLog, Reconstructed], done: Simulated, k: int,
            recipe: Recipe) -> tuple[ExperimentLog, Reconstructed]:
    """Replica `k`, reconstructed as the log was: another tuning, in which ends are less certain, would be no noise of the drive."""
    log, found = real
    signals = {name: Signal(values, log.signals[name].units, log.signals[name].long_name)
               for name, values in (("t", log.t), ("q", done.q[k]), ("tau", done.tau[k]))}
    copy = replace(log, name=f"{log.name} twin {k + 1}", torque=None, signals=signals, period=None, derived=None)
    return copy, reconstruct(copy, recipe.how, observers=None if found.mean is not None else found.observers)
