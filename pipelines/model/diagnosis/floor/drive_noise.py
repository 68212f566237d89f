"""The noise of the drives, told from what is left of a log when all is taken away that may be a fault.

    noise = drive_noise(model, data, left, motions, recipe, place, seed)       white, and a slow wander
    rms = white(data, left)                                                    of rows whose controller nobody knows

White noise is told by what is quick: as much as makes a replica as rough as the log in its quietest windows, where neither
reversals nor any fault are. A replica without noise says what of it is counting of the encoders. A narrow low-pass leaves little
that is quick; where a replica's noise is far from enough, the next has more. Where a motion comes again, noise has not many times
the power of what differs from one period to the next (`repeated`): what repeats is none, however quick it is.

Amplifiers wander too, below a few hertz, which is what a narrow low-pass leaves most of: as much as the log has more than the
replica, and three quarters of the white noise at most, for slow is also what a fault without a name does. Of drives that wander
more the quick part grows as well: of 16 logs with up to eight times as much the floor was short by a third at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.log.shared_work import shared_out
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns, rows_of
from pipelines.model.diagnosis.floor.repeated import unrepeated
from pipelines.model.diagnosis.floor.replay import experiment_of
from pipelines.model.diagnosis.floor.twin import imperfect, replica
from pipelines.model.diagnosis.floor.waves import without_waves
from pipelines.model.diagnosis.rows.data import Data, gather
from pipelines.model.diagnosis.rows.imperfections import DriveNoise
from pipelines.model.estimation.logs import Motions, Recipe
from pipelines.model.simulation import Noise, Plant, choose_step, simulate

__all__ = ["drive_noise", "white"]

_WINDOW = 0.4  # [s] in which the noise is looked at
_QUIET = 0.3  # of the windows are taken for quiet
_LEAST = 0.25  # of the guess's power: counting of the encoders hides what is less
# Of the power of a replica's noise: where more is asked for, another is simulated with that. A guess by what is quick has been seen
# to be short by a factor of 26.
_REACH, _FARTHEST, _ROUNDS = 2.0, 10.0, 3
_WANDER = 0.75  # of the white noise, at most
# Times the power that differs from one period to the next, that noise has at most: so much its wander may take of what repeats in
# an arm in order too, a law of friction that is not its own say.
_MOST = 6.0
_FEWEST = 4  # rows of a window
_SMOOTH = 5  # rows of the moving average whose remainder is noise


@dataclass(frozen=True, eq=False)
class _Replica:
    """What a model leaves of a replica with some white noise: each (joints,) [N m^2]."""

    simulated: Array  # [N m] that noise
    rough: Array  # squared roughness
    power: Array  # mean square, without waves along an angle
    wandering: Array  # the same with as much wander as there may be


def drive_noise(model: Exact, data: Data, left: Array, motions: Motions, recipe: Recipe, place: int, seed: int) -> DriveNoise:
    """The noise of the drives in log number `place`.

    Args:
        left: (rows,) [N m] the residual, as far as possible without what a fault makes.
    """
    mine, log, own = list(data.split(left))[place], motions[place][0], data.logs[place]
    step = float(np.median(np.diff(own.t)))
    rough = np.square(_roughness(mine, step))
    guess = np.sqrt(rough * step / log.sample_time)
    experiment = experiment_of(log)
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
    times = np.square(level / np.maximum(shaken.simulated, 1e-300))
    quick, most = still.power + times * (shaken.power - still.power), times * (shaken.wandering - shaken.power)
    power = _power(Data((own,)), mine.ravel())
    slow = np.clip((power - quick) / np.maximum(most, 1e-300), 0.0, 1.0)
    wander = _WANDER * level * np.sqrt(slow)
    differs = unrepeated(Data((own,)), mine.ravel()) / np.maximum(quick - still.power + slow * most, 1e-300)
    less = np.sqrt(np.fmin(_MOST * differs, 1.0))  # one where nothing is known of periods
    return DriveNoise(less * level, less * wander)


def _share(rough: Array, still: _Replica, shaken: _Replica) -> Array:
    """(joints,) of the power of a replica's noise that makes it as rough as the log, whose squared roughness is `rough` [N m^2]."""
    return np.asarray((rough - still.rough) / np.maximum(shaken.rough - still.rough, 1e-6 * rough + 1e-300))


def _seen(model: Exact, fit: Fit, level: Array, seed: int) -> _Replica:
    rows = fit.data

    def left(wander: Array) -> Array:
        """(rows,) [N m] with what any drive in order has, which is not simulated."""
        load = rows.lay_each(imperfect(model.nominal, DriveNoise(level, wander), rows, (seed,), 0)) * fit.weights
        return np.asarray(fit.left + (load - (fit.basis @ load) @ fit.basis) / fit.weights)

    rough = np.square(_roughness(next(rows.split(fit.left)), float(np.median(np.diff(rows.logs[0].t)))))
    return _Replica(level, rough, _power(rows, left(0.0 * level)), _power(rows, left(_WANDER * level)))


def _power(data: Data, left: Array) -> Array:
    """(joints,) [N m^2]; waves are taken out of what the log has left too, which takes some of what is slow with them."""
    return np.square(data.rms(without_waves(data, left)))


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
