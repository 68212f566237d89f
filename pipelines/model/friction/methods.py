"""The three ways to find the numbers of a law: variable projection, output error, the paper's extended Kalman filter."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipelines.errors import UsageError
from pipelines.model.friction.ekf import EkfStart, run_ekf
from pipelines.model.friction.equations import LawEquations
from pipelines.model.friction.fit_law import fit_law
from pipelines.model.friction.joint import JointFit, with_fit
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import law_named
from pipelines.model.friction.one_joint import OneJoint
from pipelines.model.friction.polish import polished
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.motion import encoder_resolution
from pipelines.model.rigid.body import Array

__all__ = ["METHODS", "by_method", "ekf_start", "filtered"]

METHODS = ("varpro", "output-error", "ekf")

_PASSES = 2
_SIGMOIDS = ((0.3, 100.0), (0.8, 40.0), (-0.1, 10.0))  # shares of Coulomb friction, and sharpnesses [s/rad], a filter begins with
_UNSURE = 0.5  # of Coulomb friction, and of each sharpness


def by_method(joint: JointFit, method: str) -> JointFit:
    """`joint`, which was fitted by variable projection, with the numbers of `method`.

    Raises:
        UsageError: C02, a law that the method cannot fit, or a prismatic joint for the filter, whose gravity is not a sine.
    """
    if method == "output-error":
        return with_fit(joint, polished(joint.stretches, joint.fit))
    if method == "ekf":
        resolution = max(float(encoder_resolution(found.good)[joint.logs.joint - 1]) for _, found in joint.logs.identify)
        return with_fit(joint, filtered(joint.stretches, joint.fit.joint, resolution))
    return joint


def ekf_start(coarse: LawFit, first: Stretch, resolution: float) -> EkfStart:
    """Where the filter begins: eq. (10) guessed from a fit of Coulomb and viscous friction.

    The noise of the torque is what that fit leaves, were it white from sample to sample.
    """
    level, viscous = float(coarse.amplitudes[0]), float(coarse.amplitudes[1])
    arm, _ = coarse.at(first)
    share = np.array([part for part, _ in _SIGMOIDS])
    sharp = np.array([width for _, width in _SIGMOIDS])
    mean = np.concatenate([[first.q[0], first.dq[0], 1.0 / arm.inertia, arm.gravity[0]], level * share, sharp, [viscous],
                           [arm.gravity[1]]])
    torque = 0.2 * (abs(level) + math.hypot(*arm.gravity))
    std = np.concatenate([[resolution, 0.01, 0.1 / arm.inertia, torque], np.full(3, _UNSURE * level), _UNSURE * sharp,
                          [0.5 * abs(viscous) + 0.01 * level], [torque]])
    return EkfStart(mean, std, max(coarse.found.rms, 1e-9), resolution / np.sqrt(12.0))


def filtered(stretches: tuple[Stretch, ...], joint: OneJoint, resolution: float) -> LawFit:
    """Eq. (10) and (11) by the extended Kalman filter, stretch after stretch; the constants go on from one to the next."""
    law, coarse_law = law_named("three_sigmoid"), law_named("coulomb+viscous")
    if not joint.revolute or law is None or coarse_law is None:
        raise UsageError("C02", "the filter takes gravity as c sin q + c' cos q, which a prismatic joint has not", where="--method",
                         remedy="take --method varpro")
    equations = LawEquations.of(stretches, joint)
    coarse = fit_law(equations, coarse_law)
    begun = fit_law(equations, law)
    start = ekf_start(coarse, stretches[0], resolution)
    covariance = np.diag(np.square(start.std))
    for stretch in stretches:
        mean = start.mean.copy()
        mean[:2] = stretch.q[0], stretch.dq[0]
        tau = np.where(np.isfinite(stretch.tau), stretch.tau, 0.0) - stretch.sway @ begun.at(stretch)[1]
        if not stretch.held:
            tau[:-1] = 0.5 * (tau[:-1] + tau[1:])
        step = float(np.median(np.diff(stretch.t)))
        run = run_ekf(stretch.measured, tau, step, EkfStart(mean, start.std, start.torque_noise, start.position_noise), _PASSES)
        start = EkfStart(run.mean, start.std, start.torque_noise, start.position_noise)
        covariance = run.covariance
    return _as_fit(begun, equations, start.mean, covariance)


def _as_fit(begun: LawFit, equations: LawEquations, x: Array, covariance: Array) -> LawFit:
    """The filter's constants in the form of any other fit; what the filter does not know, couplings, stays as it was."""
    sign = np.where(x[7:10] < 0.0, -1.0, 1.0)
    order = np.argsort(-np.abs(x[7:10]))
    numbers = begun.found.beta.copy()
    places = [0, 1, 2, *(begun.rigid_size * len(begun.postures) + k for k in range(4)), *(len(numbers) + k for k in range(3))]
    numbers[places[:3]] = 1.0 / x[2], x[3], x[11]
    numbers[places[3:7]] = [*(sign * x[4:7])[order], x[10]]
    theta = np.log(np.abs(x[7:10]))[order]
    # from (1/J, c, c', f, b, w) as the filter holds them to (J, c, c', f, b, ln w)
    source = [2, 3, 11, *(4 + order), 10, *(7 + order)]
    slope = np.concatenate([[-1.0 / x[2] ** 2, 1.0, 1.0], sign[order], [1.0], 1.0 / x[7:10][order]])
    spread = covariance[np.ix_(source, source)] * slope * slope[:, None]
    whole = np.zeros_like(begun.found.covariance)
    whole[np.ix_(places, places)] = spread
    found = replace(begun.found, beta=numbers, theta=theta, covariance=whole, seen=np.ones(len(whole)))
    fit = replace(begun, found=found, joint=equations.arms(numbers)[0])
    return replace(fit, found=replace(found, residual=equations.predicted(fit).residual))
