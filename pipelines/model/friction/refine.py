"""A better motion of a joint, once its law is known: smooth what the model does not explain, not the motion itself.

A reversal of friction is a kink of the speed. A smoother that knows nothing of it rounds it off, and an inertia fitted to a
rounded motion comes out too large. So the observer of Kostić et al. 2004, eq. (16)-(17), is given the reference it was
made for: the motion that torque and fitted law imply,

    ddq_r = (τ - c sin q - c' cos q - τ_f)/J,     e = q - q_r,     ë = white torque noise / J

and only the deviation e is smoothed, its order being 2, for its acceleration is noise of the torque, held over a sample.
"""

from __future__ import annotations

import numpy as np

from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.one_joint import gravity_columns
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.rigid.body import Array
from pipelines.signal.observer import design
from pipelines.signal.smoother import smooth

__all__ = ["reference_motion", "refined"]

_ORDER = 2
_LEAST = 1e-6  # of the torque: its noise, where a fit leaves none


def refined(stretch: Stretch, fit: LawFit, resolution: float, freedom: float = 1.0) -> Stretch:
    """`stretch` with its motion smoothed about the one that `fit` implies; itself where that cannot be done.

    Args:
        resolution: step of the encoder [rad].
        freedom: times the torque noise that the fit shows: above one the motion is held less to what a rough fit implies.
    """
    if fit.inertia <= 0.0 or not stretch.rows:
        return stretch
    q, dq = reference_motion(stretch, fit)
    deviation = (stretch.measured - q)[:, None]
    if not np.isfinite(deviation[~stretch.spoilt]).all():
        return stretch
    step = float(stretch.t[-1] - stretch.t[0]) / (len(stretch.t) - 1)
    # Torque noise, were it white from sample to sample: what the law misses makes it look larger, and is let through, not lost.
    noise = freedom * max(fit.found.rms, _LEAST * float(np.abs(stretch.torque).max()))
    jerk = np.array([noise * np.sqrt(stretch.window) / fit.inertia])
    found = smooth(deviation, design(step, jerk, _noise(deviation[:, 0], jerk, step, resolution), _ORDER)).states[:, :, 0]
    return stretch.moved(q + found[0], dq + found[1])


def _noise(deviation: Array, jerk: Array, step: float, resolution: float) -> Array:
    """Variance of position noise [rad²] (1,): Δθ²/12, or more where second differences show it; they are 6 R + σ² T⁴/2."""
    second = np.diff(deviation, n=2)
    shown = (np.mean(np.square(second[np.isfinite(second)])) - 0.5 * jerk**2 * step**4) / 6.0
    return np.maximum(shown, resolution**2 / 12.0)


def reference_motion(stretch: Stretch, fit: LawFit) -> tuple[Array, Array]:
    """q_r and dq_r (samples,): what the fitted joint does under the measured torque, friction taken along the motion so far."""
    arm, coupling = fit.at(stretch)
    nodes = stretch.nodes
    load = gravity_columns(nodes.q[:, 0], stretch.revolute) @ np.array(arm.gravity)
    load = load + fit.law.columns(nodes, arm, fit.theta) @ fit.amplitudes
    momentum = stretch.impulse - stretch.accumulated(load)
    if stretch.sway.shape[1]:
        momentum = momentum - stretch.swayed @ coupling
    dq = momentum / arm.inertia
    if stretch.sticks is not None:  # the law says nothing of these: the motion is as it was seen
        resting = np.append(np.repeat(stretch.sticks, stretch.window), np.zeros(len(dq), dtype=bool))[:len(dq) - 1]
        dq = dq[0] + np.concatenate([[0.0], np.cumsum(np.where(resting, np.diff(stretch.dq), np.diff(dq)))])
    step = np.diff(stretch.t)
    q = np.concatenate([[0.0], np.cumsum(0.5 * step * (dq[1:] + dq[:-1]))])
    shift = np.nanmedian(stretch.measured[:50] - q[:50]) if np.isfinite(stretch.measured[:50]).any() else 0.0
    return q + shift, dq
