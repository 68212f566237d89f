"""Estimate friction by the paper's extended Kalman filter over states and parameters at once.

Kostić et al. 2004, Section IV.B, after its [22]: the states q and dq of eq. (11) and its constants
1/J, c, f_k, w_k, b are filtered together; a further constant c' lets the equilibrium lie anywhere.
It sees each sample once and forgets nothing it was wrong about early on, so a pass ends where its
start and its noise let it: several passes are made, each from the constants that the last one
found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.errors import UsageError
from pipelines.friction.config import EkfConfig
from pipelines.friction.extended_filter import Advance, Extended, filter_extended
from pipelines.friction.fit import LawEquations, LawFit, fit_law
from pipelines.friction.laws import OneJoint, law_named
from pipelines.friction.weak_form import Stretch

__all__ = ["EKF_NAMES", "EkfStart", "filtered", "joint_step", "run_ekf"]

EKF_NAMES = ("q", "dq", "1/J", "c", "f1", "f2", "f3", "w1", "w2", "w3", "b", "c'")

CONSTANT = 11  # numerics: place of c', where the filter has it
_CONFIG = EkfConfig()
_SHARES, _SHARP = np.array(_CONFIG.shares), np.array(_CONFIG.sharp)


@dataclass(frozen=True, eq=False)
class EkfStart:
    """Where the filter begins. In the order of EKF_NAMES; without c' eleven states."""

    mean: Array
    std: Array
    torque_noise: float  # [N m] a sample
    position_noise: float  # [rad]


def joint_step(step: float) -> Advance:
    """Return one sample of eq. (11) and (10) by midpoint steps, with its derivatives."""
    h = step / _CONFIG.parts

    def acceleration(x: list[float], q: float, v: float,
                     u: float) -> tuple[float, float, float, list[float]]:
        """Return a, ∂a/∂q, ∂a/∂v, and ∂a/∂ of the constants."""
        theta, c, f1, f2, f3, w1, w2, w3, b = x[2:11]
        d = x[CONSTANT] if len(x) > CONSTANT else 0.0
        s, o = math.sin(q), math.cos(q)
        t1, t2, t3 = math.tanh(w1 * v), math.tanh(w2 * v), math.tanh(w3 * v)
        e1, e2, e3 = 1.0 - t1 * t1, 1.0 - t2 * t2, 1.0 - t3 * t3
        rest = u - c * s - d * o - f1 * t1 - f2 * t2 - f3 * t3 - b * v
        own = [rest, -theta * s, -theta * t1, -theta * t2, -theta * t3, -theta * f1 * e1 * v,
               -theta * f2 * e2 * v, -theta * f3 * e3 * v, -theta * v, -theta * o]
        return (theta * rest, theta * (d * s - c * o),
                -theta * (f1 * w1 * e1 + f2 * w2 * e2 + f3 * w3 * e3 + b), own[:len(x) - 2])

    def advance(x: Array, u: float) -> tuple[Array, Array]:
        values = x.tolist()
        q, v = values[:2]
        (dq, dv), change = np.eye(2, len(x)), np.zeros(len(x))
        for _ in range(_CONFIG.parts):
            a, aq, av, change[2:] = acceleration(values, q, v, u)
            q_mid, v_mid = q + 0.5 * h * v, v + 0.5 * h * a
            dq_mid = dq + (0.5 * h) * dv
            dv_mid = dv + (0.5 * h) * (aq * dq + av * dv + change)
            a, aq, av, change[2:] = acceleration(values, q_mid, v_mid, u)
            q, v = q + h * v_mid, v + h * a
            dq, dv = dq + h * dv_mid, dv + h * (aq * dq_mid + av * dv_mid + change)
        ahead = x.copy()
        ahead[:2] = q, v
        return ahead, np.stack([dq, dv])

    return advance


def run_ekf(y: Array, tau: Array, step: float, start: EkfStart, passes: int = 1) -> Extended:
    """Filter a log of one joint `passes` times, each from the constants of the pass before."""
    advance, begin = joint_step(step), start.mean.copy()
    reach = np.array([0.5 * step, 1.0]) * (start.torque_noise * step * start.mean[2])
    process = np.zeros((len(begin), len(begin)))
    process[:2, :2] = np.outer(reach, reach)
    for _ in range(passes):
        run = filter_extended(advance, y, tau, begin, np.diag(np.square(start.std)), process,
                              start.position_noise**2)
        begin[2:] = run.mean[2:]
    return run


def filtered(stretches: Sequence[Stretch], joint: OneJoint, resolution: float) -> LawFit:
    """Fit eq. (10) and (11) by the filter, stretch after stretch, from the constants of the last.

    Args:
        resolution: step of the encoder [rad].

    Raises:
        UsageError: C02, a prismatic joint, whose gravity is no sine.
    """
    if not joint.revolute:
        raise UsageError("C02", "the filter takes gravity as c sin q + c' cos q, which a prismatic "
                         "joint has not", where="--method", remedy="take --method varpro")
    equations = LawEquations.of(stretches, joint)
    fit = fit_law(equations, law_named("three_sigmoid"))
    start = _start(fit_law(equations, law_named("coulomb+viscous")), stretches[0], resolution)
    covariance = np.diag(np.square(start.std))
    for stretch in stretches:
        start.mean[:2] = stretch.q[0], stretch.dq[0]
        tau = stretch.known_tau - stretch.sway @ fit.at(stretch)[1]
        step = float(np.median(np.diff(stretch.t)))
        run = run_ekf(stretch.measured, tau, step, start, _CONFIG.passes)
        start, covariance = replace(start, mean=run.mean.copy()), run.covariance
    return _with_constants(fit, equations, start.mean, covariance)


def _start(coarse: LawFit, first: Stretch, resolution: float) -> EkfStart:
    """Return where the filter begins: eq. (10) guessed from Coulomb and viscous friction.

    The noise of the torque is what that fit leaves, were it white from sample to sample.
    """
    level, viscous = coarse.amplitudes.tolist()
    arm, _ = coarse.at(first)
    torque = 0.2 * (abs(level) + math.hypot(*arm.gravity))
    mean = np.array([first.q[0], first.dq[0], 1.0 / arm.inertia, arm.gravity[0], *level * _SHARES,
                     *_SHARP, viscous, arm.gravity[1]])
    std = np.array([resolution, 0.01, 0.1 / arm.inertia, torque, *[_CONFIG.unsure * level] * 3,
                    *_CONFIG.unsure * _SHARP, 0.5 * abs(viscous) + 0.01 * level, torque])
    return EkfStart(mean, std, max(coarse.found.rms, 1e-9), resolution / np.sqrt(12.0))


def _with_constants(fit: LawFit, equations: LawEquations, x: Array, covariance: Array) -> LawFit:
    """Return `fit` with the filter's constants; what the filter does not know stays as it was."""
    sign = np.where(x[7:10] < 0.0, -1.0, 1.0)
    order = np.argsort(-np.abs(x[7:10]))
    beta, count = fit.found.beta.copy(), len(fit.found.beta)
    linear = [0, 1, 2, *(fit.rigid.size + k for k in range(4))]
    beta[linear] = 1.0 / x[2], x[3], x[11], *(sign * x[4:7])[order], x[10]
    # from (1/J, c, c', f, b, w) as the filter holds them to (J, c, c', f, b, ln w)
    source = [2, 3, 11, *(4 + order), 10, *(7 + order)]
    slope = np.array([-1.0 / x[2] ** 2, 1.0, 1.0, *sign[order], 1.0, *1.0 / x[7:10][order]])
    whole = np.zeros_like(fit.found.covariance)
    numbers = np.array([*linear, *range(count, count + 3)])
    whole[np.ix_(numbers, numbers)] = covariance[np.ix_(source, source)] * np.outer(slope, slope)
    found = replace(fit.found, beta=beta, theta=np.log(np.abs(x[7:10]))[order], covariance=whole,
                    seen=np.ones(len(whole)))
    fit = replace(fit, found=found, joint=equations.arms(beta)[0])
    return replace(fit, found=replace(found, residual=equations.residual(fit)))
