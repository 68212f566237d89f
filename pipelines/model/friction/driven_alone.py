"""One law of one joint that was driven alone, from its encoder and its torque: the whole way in one call.

    fit = fit_driven_alone(t, q, tau, OneJoint.of(robot, 3), law, resolution)

    every few samples smoothed → a rough fit → all samples smoothed about what it implies → the fit

A rough fit needs no more of the motion than a few samples a window: what it misses at reversals of friction, the motion
refined about it (refine.py) shows again, at the rate of the log.
"""

from __future__ import annotations

import numpy as np

from pipelines.errors import InputRejected
from pipelines.model.friction.equations import LawEquations
from pipelines.model.friction.fit_law import fit_law, roughly
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import Law
from pipelines.model.friction.one_joint import OneJoint
from pipelines.model.friction.refine import refined
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.rigid.body import Array
from pipelines.signal.observer import design
from pipelines.signal.smoother import smooth
from pipelines.signal.tuning import tune_smoother

__all__ = ["fit_driven_alone"]

_SHARE = 4  # samples that a window keeps for the rough fit
_SHORTEST = 4  # samples of a window
_ENDS = 0.05  # [s] at either end, where no later or earlier sample helps the smoother
_ORDER = 3
_FEWEST = 10  # windows
_FREEDOM = 2.0  # a rough fit draws the motion towards its own errors: twice the noise halves the pull


def fit_driven_alone(t: Array, q: Array, tau: Array, joint: OneJoint, law: Law, resolution: float, window: float = 0.02,
                     held: bool = True, rounds: int = 1) -> LawFit:
    """Fit `law` with the joint's inertia and gravity.

    Args:
        t: (samples,) [s] evenly spaced.
        q: (samples,) [rad] as the encoder gave it, NaN where it is missing.
        tau: (samples,) [N m].
        resolution: step of the encoder [rad].
        window: of the equations [s].
        held: the torque is a command held from sample to sample.
        rounds: of refining the motion, one or more.

    Raises:
        InputRejected: the log is too short to be fitted or to tune a smoother on.
    """
    step = float(t[-1] - t[0]) / (len(t) - 1)
    size = max(_SHORTEST, round(window / step))
    every = max(1, size // _SHARE)
    if len(t) < 2.0 * _ENDS / step + _FEWEST * size:
        raise InputRejected("T08", f"{len(t)} samples are too few for a friction law", remedy="record a few seconds at least")
    coarse = _smoothed(t, q, tau, resolution, every, size // every, held, joint.revolute)
    fit = roughly(LawEquations.of((coarse,), joint), law)
    fine = Stretch("log", t, q, tau, np.interp(t, coarse.t, coarse.q), np.interp(t, coarse.t, coarse.dq),
                   _spoilt(t, q, tau), held, size, joint.revolute, ())
    for _ in range(rounds):
        fine = refined(fine, fit, resolution, _FREEDOM)
        equations = LawEquations.of((fine,), joint)
        fit = fit_law(equations, law, [roughly(equations, law, fit.theta).theta])
    return fit


def _smoothed(t: Array, q: Array, tau: Array, resolution: float, every: int, window: int, held: bool, revolute: bool) -> Stretch:
    """Every so-manieth sample, its torque the mean of those until the next, its motion by a smoother tuned on them."""
    whole = len(t) // every * every
    t, y = t[:whole:every], q[:whole:every]
    mean = tau[:whole].reshape(-1, every).mean(axis=1)
    tuned = tune_smoother(y[:, None], float(t[1] - t[0]), resolution, _ORDER)
    states = smooth(y[:, None], design(float(t[1] - t[0]), tuned.jerk_std, tuned.noise_variance, _ORDER)).states[..., 0]
    return Stretch("log", t, y, mean, states[0], states[1], _spoilt(t, y, mean), held or every > 1, window, revolute, ())


def _spoilt(t: Array, q: Array, tau: Array) -> np.ndarray:
    near = (t < t[0] + _ENDS) | (t > t[-1] - _ENDS)
    return np.asarray(near | ~np.isfinite(q) | ~np.isfinite(tau))
