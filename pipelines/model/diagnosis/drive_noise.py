"""The noise of the drives, told from what is left of a log when all is taken away that may be a fault.

    noise = drive_noise(model, data, left, motions, recipe, place, seed)       white, and a slow wander
    rms = white(data, left)                                                    of rows whose controller nobody knows

White noise is told by what is quick: as much as makes a replica as rough as the log in its quietest windows, where neither
reversals nor any fault are. A replica without noise says what of it is counting of the encoders. A narrow low-pass leaves little
that is quick; where a replica's noise is far from enough, the next has more.

Amplifiers wander too, below a few hertz, which is what a narrow low-pass leaves most of: as much as the log has more than the
replica, and half the white noise at most, for slow is also what a fault without a name does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.log.shared_work import shared_out
from pipelines.model.diagnosis.data import Data, gather
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.imperfections import DriveNoise
from pipelines.model.diagnosis.nominal import Fit, fit_columns, rows_of
from pipelines.model.diagnosis.twin import imperfect, replica
from pipelines.model.estimation.logs import Motions, Recipe
from pipelines.model.simulation import Experiment, Noise, Plant, choose_step, simulate

__all__ = ["drive_noise", "white"]

_WINDOW = 0.4  # [s] in which the noise is looked at
_QUIET = 0.3  # of the windows are taken for quiet
_LEAST = 0.25  # of the guess's power: counting of the encoders hides what is less
# Of the power of a replica's noise: where more is asked for, another is simulated with that. A guess by what is quick has been seen
# to be short by a factor of 26.
_REACH, _FARTHEST, _ROUNDS = 2.0, 10.0, 3
_WANDER = 0.5  # of the white noise, at most
_FEWEST = 4  # rows of a window
_SMOOTH = 5  # rows of the moving average whose remainder is noise


@dataclass(frozen=True, eq=False)
class _Replica:
    """What a model leaves of a replica with some white noise: each (joints,) [N m^2]."""

    simulated: Array  # [N m] that noise
    rough: Array  # squared roughness
    power: Array
    drives: Array  # power of the ripple that any drive has, which is not simulated
    wander: Array  # power of a wander of one N m


def drive_noise(model: Exact, data: Data, left: Array, motions: Motions, recipe: Recipe, place: int, seed: int) -> DriveNoise:
    """The noise of the drives in log number `place`.

    Args:
        left: (rows,) [N m] the residual, as far as possible without what a fault makes.
    """
    mine, log, own = list(data.split(left))[place], motions[place][0], data.logs[place]
    step = float(np.median(np.diff(own.t)))
    rough = np.square(_roughness(mine, step))
    guess = np.sqrt(rough * step / log.sample_time)
    experiment = Experiment.of_log(log)
    chosen = choose_step(Plant.of(model.nominal), experiment)  # fine enough for the noisy one too

    def simulated(drawn: tuple[Array, int]) -> _Replica:
        level, number = drawn
        done = simulate(model.nominal, experiment, Noise(level, np.zeros_like(guess)), (number,), step=chosen)
        rows = gather((replica(motions[place], done, 0, recipe),), model.columns, recipe, (own.equations.rows,))
        return _seen(model, fit_columns(rows, rows_of(rows, model.columns)), level, seed)

    still, shaken = shared_out(simulated, ((np.zeros_like(guess), seed), (guess, seed + 1)))
    least = np.sqrt(_LEAST) * guess
    share = _share(rough, still, shaken)
    for _ in range(_ROUNDS):
        if not (share > _REACH).any():
            break
        shaken = simulated((np.maximum(shaken.simulated * np.sqrt(np.clip(share, 0.0, _FARTHEST)), least), seed + 1))
        share = _share(rough, still, shaken)
    level = np.maximum(shaken.simulated * np.sqrt(np.clip(share, 0.0, _REACH)), least)
    quick = still.power + np.square(level / np.maximum(shaken.simulated, 1e-300)) * (shaken.power - still.power)
    power = np.mean(np.square(mine), axis=1, where=own.weighed)
    more = (power - quick - shaken.drives) / np.maximum(shaken.wander, 1e-300)
    return DriveNoise(level, np.minimum(np.sqrt(np.maximum(more, 0.0)), _WANDER * level))


def _share(rough: Array, still: _Replica, shaken: _Replica) -> Array:
    """(joints,) of the power of a replica's noise that makes it as rough as the log, whose squared roughness is `rough` [N m^2]."""
    return np.asarray((rough - still.rough) / np.maximum(shaken.rough - still.rough, 1e-6 * rough + 1e-300))


def _seen(model: Exact, fit: Fit, level: Array, seed: int) -> _Replica:
    rows, none = fit.data, np.zeros(fit.data.n_joints)
    drives, both = (rows.lay_each(imperfect(model.nominal, DriveNoise(none, rms), rows, seed)) for rms in (none, none + 1.0))

    def shown(load: Array) -> Array:
        """Of a load (rows,) [N m] what the fit does not take."""
        weighted = load * fit.weights
        return np.square(rows.rms((weighted - (fit.basis @ weighted) @ fit.basis) / fit.weights))

    rough = np.square(_roughness(next(rows.split(fit.left)), float(np.median(np.diff(rows.logs[0].t)))))
    return _Replica(level, rough, np.square(fit.rms), shown(drives), shown(both - drives))


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
