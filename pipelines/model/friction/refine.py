"""A better motion of a joint, once its law is known: smooth what the model does not explain, not the motion itself.

A reversal of friction is a kink of the speed. A smoother that knows nothing of it rounds it off, and an inertia fitted to a
rounded motion comes out too large. So the observer of Kostić et al. 2004, eq. (16)-(17), is given the reference it was
made for: the motion that torque and fitted law imply,

    ddq_r = (τ - c sin q - c' cos q - τ_f)/J,     e = q - q_r,     ë = white torque noise / J

and only the deviation e is smoothed, its order being 2, for its acceleration is noise of the torque, held over a sample.
"""

from __future__ import annotations

import numpy as np

from pipelines.errors import InputRejected
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.one_joint import gravity_columns
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.rigid.body import Array
from pipelines.signal.observer import design
from pipelines.signal.smoother import smooth
from pipelines.signal.tuning import tune_jerk

__all__ = ["reference_motion", "refined"]

_ORDER = 2


def refined(stretch: Stretch, fit: LawFit, resolution: float) -> Stretch:
    """`stretch` with its motion smoothed about the one that `fit` implies; itself where that cannot be done.

    Args:
        resolution: step of the encoder [rad].
    """
    if fit.inertia <= 0.0:
        return stretch
    q, dq = reference_motion(stretch, fit)
    deviation = (stretch.measured - q)[:, None]
    if not np.isfinite(deviation[~stretch.spoilt]).all():
        return stretch
    step = float(np.median(np.diff(stretch.t)))
    try:
        tuned = tune_jerk(deviation, step, np.array([resolution]), _ORDER)
    except InputRejected:
        return stretch
    found = smooth(deviation, design(step, tuned.jerk_std, tuned.noise_variance, _ORDER)).states[:, :, 0]
    return stretch.moved(q + found[0], dq + found[1])


def reference_motion(stretch: Stretch, fit: LawFit) -> tuple[Array, Array]:
    """q_r and dq_r (samples,): what the fitted joint does under the measured torque, friction taken along the motion so far."""
    arm, coupling = fit.at(stretch)
    nodes = stretch.nodes
    load = gravity_columns(nodes.q[:, 0], stretch.revolute) @ np.array(arm.gravity)
    load = load + fit.law.columns(nodes, arm, fit.theta) @ fit.amplitudes
    dq = (stretch.impulse - stretch.accumulated(load) - stretch.swayed @ coupling) / arm.inertia
    step = np.diff(stretch.t)
    q = np.concatenate([[0.0], np.cumsum(0.5 * step * (dq[1:] + dq[:-1]))])
    shift = np.nanmedian(stretch.measured[:50] - q[:50]) if np.isfinite(stretch.measured[:50]).any() else 0.0
    return q + shift, dq
