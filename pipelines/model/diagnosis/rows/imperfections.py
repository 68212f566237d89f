"""What any drive in order has: a torque constant that ripples with the angle, a wander of the amplifier's zero.

Replicas of the twin get them, drawn anew for each, so that thresholds know them: a ripple of a thousandth on a joint that carries
gravity looks like cogging on every arm, one of few waves a turn on a joint that rubs like friction that depends on position. A
small load shows in the torque residual as it is, whatever the controller does about it, so that it is added there and not
simulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.rigid.body import Motion

__all__ = ["RIPPLE", "DriveNoise", "DriveWaves", "drive_waves", "ripple_orders", "small_loads"]

RIPPLE = 1e-3  # of the torque
_COGGING = 2e-5  # of the largest rated torque
_ORDERS = (6, 40)  # waves a turn, and of cogging
_SLIDES = 10.0  # times as many in 2π m of a slide: magnets of linear motors, and turns of a screw, are some centimetres apart
_CORNER = (1.0, 5.0)  # [Hz]
_WAVES = 20040509  # of the seeds


@dataclass(frozen=True, eq=False)
class DriveNoise:
    """What is random in the torque of the drives, root mean square. Arrays (joints,)."""

    white: Array  # [N m] from sample to sample
    wander: Array  # [N m] of the amplifier's zero, slow


def ripple_orders(revolute: bool) -> Array:
    """All that a drive may have [1/rev], of a slide in 2π m."""
    return np.asarray(np.arange(*_ORDERS) * (1.0 if revolute else _SLIDES), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class DriveWaves:
    """Of the drives of one replica, the same in all its logs. Arrays (2, joints): of the ripple, of cogging."""

    order: Array  # [1/rev], of a slide in 2π m
    phase: Array  # [rad] at the joint's zero


def drive_waves(revolute: Sequence[bool], seeds: Sequence[int]) -> list[DriveWaves]:
    """Of joints that turn or slide, for each replica: its orders and those of the others are spread over all there may be.

    Of as many equal parts of the range each replica has one (McKay, Beckman & Conover 1979). Ten that are drawn without looking at
    each other mostly leave out the lowest, which the machine at hand may have.
    """
    rng = np.random.default_rng([_WAVES, *seeds])
    count, (low, high) = len(seeds), _ORDERS
    part = rng.permuted(np.tile(np.arange(count)[:, None, None], (1, 2, len(revolute))), axis=0)
    order = np.floor(low + (high - low) * (part + rng.random(part.shape)) / count) * np.where(revolute, 1.0, _SLIDES)
    phase = rng.uniform(-np.pi, np.pi, part.shape)
    return [DriveWaves(*one) for one in zip(order, phase, strict=True)]


def small_loads(motion: Motion, arm: Arm, wander: Array, sample_time: float, drives: DriveWaves,
                rng: np.random.Generator) -> Array:
    """(samples, joints) [N m] of one replica in one log.

    Args:
        wander: (joints,) [N m] root mean square of the amplifier's wander.
        rng: for what happens in this log.
    """
    tau = arm.torque(motion)
    largest = _largest(arm, tau)
    ripple = RIPPLE * tau * np.sin(drives.order[0] * motion.q + drives.phase[0])
    cogging = _COGGING * largest * np.sin(drives.order[1] * motion.q + drives.phase[1])
    return np.asarray(ripple + cogging + _wander(wander, len(tau), sample_time, rng))


def _largest(arm: Arm, tau: Array) -> Array:
    """(joints,) the largest rated torque [N m] of the joints that turn, for each that does, and force [N] of those that slide; the
    largest of `tau` (samples, joints) where none is rated."""
    rated, turning = np.array([joint.torque for joint in arm.robot.joints]), np.array(arm.robot.revolute)
    out = np.zeros(len(turning))
    for kind in (turning, ~turning):
        out[kind] = np.max(rated[kind & np.isfinite(rated)], initial=0.0) or np.abs(tau[:, kind]).max(initial=0.0)
    return out


def _wander(rms: Array, samples: int, sample_time: float, rng: np.random.Generator) -> Array:
    """(samples, joints): white noise through a first-order low-pass, by its spectrum."""
    corner = rng.uniform(*_CORNER, len(rms))
    left = np.exp(-2.0 * np.pi * corner * sample_time)
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(samples))
    response = np.sqrt(1.0 - left**2) / (1.0 - left * turn[:, None])
    white = np.fft.rfft(rng.standard_normal((samples, len(rms))), axis=0)
    return np.asarray(rms * np.fft.irfft(white * response, n=samples, axis=0))
