"""Refine the motion of a joint about its fitted law, and fit a joint that was driven alone.

A reversal of friction is a kink of the speed. A smoother that knows nothing of it rounds it off,
and an inertia fitted to a rounded motion comes out too large. So the observer of Kostić et al.
2004, eq. (16)-(17), is given the reference it was made for: the motion that torque and fitted law
imply,

    ddq_r = (τ - c sin q - c' cos q - τ_f)/J,     e = q - q_r,     ë = white torque noise / J

and only the deviation e is smoothed, of order 2, for its acceleration is noise of the torque, held
over a sample.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.errors import InputRejected
from pipelines.estimation.state_estimation import design, smooth
from pipelines.estimation.tuning import tune
from pipelines.estimation.varpro import SeparableFit, search
from pipelines.friction.config import RefineConfig
from pipelines.friction.fit import LawEquations, LawFit, fit_law, ranked
from pipelines.friction.laws import Law, OneJoint, gravity_columns
from pipelines.friction.weak_form import Mask, Stretch

__all__ = ["fit_driven_alone", "refined"]

ORDER = 2  # numerics: of the smoother of the deviation


_CONFIG = RefineConfig()


def refined(stretch: Stretch, fit: LawFit, resolution: float, freedom: float = 1.0) -> Stretch:
    """Smooth the motion of `stretch` about that which `fit` implies, where that is possible.

    Args:
        resolution: step of the encoder [rad].
        freedom: times the torque noise that the fit shows: above one the motion is held less to
            what a rough fit implies.
    """
    if fit.inertia <= 0.0 or not stretch.rows:
        return stretch
    q, dq = _implied_motion(stretch, fit)
    deviation = stretch.measured - q
    if not np.isfinite(deviation[~stretch.spoilt]).all():
        return stretch
    step = float(stretch.t[-1] - stretch.t[0]) / (len(stretch.t) - 1)
    # Were it white by samples: what the law misses makes it look larger and is let through
    noise = freedom * max(fit.found.rms, _CONFIG.least * float(np.abs(stretch.torque).max()))
    jerk = np.array([noise * np.sqrt(stretch.window) / fit.inertia])
    # Δθ²/12, or more where second differences show it; they are 6 R + σ² T⁴/2
    second = np.diff(deviation, n=2)
    shown = (np.mean(np.square(second[np.isfinite(second)])) - 0.5 * jerk**2 * step**4) / 6.0
    observer = design(step, jerk, np.maximum(shown, resolution**2 / 12.0), ORDER)
    states = smooth(deviation[:, None], observer).states[:, :, 0]
    return replace(stretch, q=q + states[0], dq=dq + states[1])


def _implied_motion(stretch: Stretch, fit: LawFit) -> tuple[Array, Array]:
    """Return q_r and dq_r (samples,): what the fitted joint does under the measured torque.

    Friction is that along the motion so far.
    """
    arm, coupling = fit.at(stretch)
    nodes = stretch.nodes
    load = gravity_columns(nodes.q[:, 0], stretch.revolute) @ np.array(arm.gravity)
    load = load + fit.law.columns(nodes, arm, fit.theta) @ fit.amplitudes
    momentum = stretch.impulse - stretch.accumulated(load)
    if stretch.sway.shape[1]:
        momentum = momentum - stretch.swayed @ coupling
    dq = momentum / arm.inertia
    if stretch.sticks is not None:  # no law holds there: the motion is as it was seen
        change = np.diff(dq)
        rests = np.repeat(stretch.sticks, stretch.window)[:len(change)]
        change[:len(rests)][rests] = np.diff(stretch.dq)[:len(rests)][rests]
        dq = dq[0] + np.concatenate([[0.0], np.cumsum(change)])
    path = np.cumsum(0.5 * np.diff(stretch.t) * (dq[1:] + dq[:-1]))
    q = np.concatenate([[0.0], path])
    early = stretch.measured[:50] - q[:50]
    return q + (np.nanmedian(early) if np.isfinite(early).any() else 0.0), dq


def fit_driven_alone(  # noqa: PLR0913
        t: Array, q: Array, tau: Array, joint: OneJoint, law: Law, resolution: float,
        window: float = 0.02, rounds: int = 1) -> LawFit:
    """Fit `law` with inertia and gravity of a joint driven alone: the whole way in one call.

    every few samples smoothed → a rough fit → all samples smoothed about what it implies → the fit

    A rough fit needs no more of the motion than a few samples a window: what it misses at
    reversals, the motion refined about it shows again, at the rate of the log.

    Args:
        t: (samples,) [s] evenly spaced.
        q: (samples,) [rad] as the encoder gave it, NaN where it is missing.
        tau: (samples,) [N m] held until the next.
        resolution: step of the encoder [rad].
        window: of the equations [s].
        rounds: of refining the motion, one or more.

    Raises:
        InputRejected: the log is too short to be fitted or to tune a smoother on.
    """
    step = float(t[-1] - t[0]) / (len(t) - 1)
    size = max(_CONFIG.shortest, round(window / step))
    every = max(1, size // _CONFIG.share)
    if len(t) < 2.0 * _CONFIG.ends / step + _CONFIG.fewest * size:
        raise InputRejected("T08", f"{len(t)} samples are too few for a friction law",
                            remedy="record a few seconds at least")
    coarse = _smoothed(t, q, tau, resolution, every, size // every, joint.revolute)
    fit = _roughly(LawEquations.of((coarse,), joint), law)
    fine = Stretch("log", t, q, tau, np.interp(t, coarse.t, coarse.q),
                   np.interp(t, coarse.t, coarse.dq), _spoilt(t, q, tau), size, joint.revolute,
                   ())
    for _ in range(rounds):
        fine = refined(fine, fit, resolution, _CONFIG.freedom)
        equations = LawEquations.of((fine,), joint)
        fit = fit_law(equations, law, [_roughly(equations, law, fit.theta).theta])
    return fit


def _roughly(equations: LawEquations, law: Law, start: Array | None = None) -> LawFit:
    """Fit few rows in few steps, from `start` or the best of many."""
    arms = equations.arms()
    problem = equations.thinned(_CONFIG.rough).problem(law, arms)
    if start is None:
        starts = list(law.starts(equations.nodes, arms[0]))[::_CONFIG.sparse]
        best = ranked(equations.thinned(_CONFIG.glanced), law, arms, starts)[0]
        end = search(problem, best, _CONFIG.first)
    else:
        end = search(problem, start, _CONFIG.steps)
    return LawFit(law, arms[0], equations.postures, SeparableFit.rough(*end), equations.width)


def _smoothed(t: Array, q: Array, tau: Array, resolution: float, every: int, window: int,
              revolute: bool) -> Stretch:
    """Return every `every`-th sample, its torque the mean until the next, its motion smoothed."""
    whole = len(t) // every * every
    t, y = t[:whole:every], q[:whole:every]
    mean, step = tau[:whole].reshape(-1, every).mean(axis=1), float(t[1] - t[0])
    _, tuned = tune(y[:, None], step, resolution, _CONFIG.order)
    observer = design(step, tuned.jerk_std, tuned.noise_variance, _CONFIG.order)
    states = smooth(y[:, None], observer).states[..., 0]
    return Stretch("log", t, y, mean, states[0], states[1], _spoilt(t, y, mean),
                   window, revolute, ())


def _spoilt(t: Array, q: Array, tau: Array) -> Mask:
    near = (t < t[0] + _CONFIG.ends) | (t > t[-1] - _CONFIG.ends)
    return np.asarray(near | ~np.isfinite(q) | ~np.isfinite(tau))
