"""Respond as a sampled controller does, and as a rigid body under a held input.

    u[k] = -k_p e[k] - k_d ė[k] + v[k]

    backward difference   C(z) = k_p + k_d (1 - z⁻¹)/T
    observer, eq. (20)    C(z) = k_p X_0(z) + k_d X_1(z),   X(z) = (1 - (1 - k c) E z⁻¹)⁻¹ k

C is what the indirect method divides by, eq. (29) of Kostić et al. 2004.
"""

from __future__ import annotations

import numpy as np

from pipelines.frequency.spectra import Array, Complex
from pipelines.io.log import Controller

__all__ = ["double_integrator", "loop_delay", "sampled_controller"]


def sampled_controller(
    controller: Controller | None, joint: int, frequency: Array, sample_time: float
) -> Complex | None:
    """C (frequencies,) at joint (1-based) and frequency [Hz]; None: the log does not say enough."""
    c, j = controller, joint - 1
    if c is None or c.kp is None or c.kd is None:
        return None
    if c.ki is not None and c.ki[j] != 0.0:
        return None  # no word of the format says how the integral is sampled
    kp, kd, t = float(c.kp[j]), float(c.kd[j]), sample_time
    late = np.exp(-2j * np.pi * frequency * t)
    if c.velocity == "backward-difference":
        return np.asarray(kp + kd * (1.0 - late) / t)
    if c.velocity != "observer" or c.observer_gain is None:
        return None
    gain = c.observer_gain[j]
    transition = np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    keep = np.eye(3)
    keep[:, 0] -= gain
    system = np.eye(3) - late[:, None, None] * (keep @ transition)
    position, speed, _ = np.linalg.solve(system, gain[:, None].astype(complex))[..., 0].T
    return np.asarray(kp * position + kd * speed)


def loop_delay(controller: Controller | None, quantity: str) -> tuple[int, int]:
    """Return samples from what the controller read to its input as logged, and on to the torque.

    r is logged as it is computed, and waits; τ is logged as it acts.
    """
    delay = 0 if controller is None or controller.delay is None else controller.delay
    return (0, delay) if quantity == "r" else (delay, 0)


def double_integrator(
    frequency: Array, sample_time: float, delay: int = 0, held: bool = True
) -> Complex:
    """(z + 1) T²/(2 (z - 1)²) z^-delay (frequencies,): unit inertia, torque held over a sample.

    Not `held`, 1/s²: a torque that was measured when position was.
    """
    if not held:
        return np.asarray(-1.0 / (2.0 * np.pi * np.asarray(frequency)) ** 2 + 0j)
    z = np.exp(2j * np.pi * np.asarray(frequency) * sample_time)
    value = sample_time**2 * (z + 1.0) / (2.0 * (z - 1.0) ** 2)
    return np.asarray(value * z ** -float(delay))
