"""The controller's own response, as it was sampled: what the indirect method divides by, eq. (29).

    u[k] = -k_p e[k] - k_d ė[k] + v[k]

    backward difference   C(z) = k_p + k_d (1 - z⁻¹)/T
    observer, eq. (20)    C(z) = k_p X_0(z) + k_d X_1(z),   X(z) = (1 - (1 - k c) E z⁻¹)⁻¹ k

With the continuous k_p + k_d jω the plant comes out wrong by 8.8 % at 28 Hz and 25 % at 80 Hz (k_p = 400, k_d = 28, 1 kHz).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.io.log import Array, Controller

__all__ = ["Complex", "continuous_controller", "loop_delay", "sampled_controller"]

Complex = npt.NDArray[np.complex128]


def sampled_controller(controller: Controller | None, joint: int, frequency: Array, sample_time: float) -> Complex | None:
    """C (frequencies,) at joint `joint` (1-based) and `frequency` [Hz]; None where the log does not say enough."""
    if controller is None or controller.kp is None or controller.kd is None or controller.velocity is None:
        return None
    j = joint - 1
    if controller.ki is not None and controller.ki[j] != 0.0:
        return None  # no word of the format says how the integral is sampled
    kp, kd = float(controller.kp[j]), float(controller.kd[j])
    late = np.exp(-2j * np.pi * frequency * sample_time)
    if controller.velocity == "backward-difference":
        return np.asarray(kp + kd * (1.0 - late) / sample_time)
    if controller.velocity == "observer" and controller.observer_gain is not None:
        states = _observer_states(controller.observer_gain[j], late, sample_time)
        return np.asarray(kp * states[:, 0] + kd * states[:, 1])
    return None


def _observer_states(gain: Array, late: Complex, sample_time: float) -> Complex:
    """X (frequencies, 3): position, speed and acceleration of eq. (20) from the measured position."""
    t = sample_time
    transition = np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    keep = np.eye(3)
    keep[:, 0] -= gain
    system = np.eye(3) - late[:, None, None] * (keep @ transition)
    return np.asarray(np.linalg.solve(system, gain[:, None].astype(complex))[..., 0])


def continuous_controller(controller: Controller, joint: int, frequency: Array) -> Complex | None:
    """k_p + k_d jω, what (29) must not be given; None where the log does not say the gains."""
    if controller.kp is None or controller.kd is None:
        return None
    return np.asarray(controller.kp[joint - 1] + 2j * np.pi * frequency * controller.kd[joint - 1])


def loop_delay(controller: Controller | None, quantity: str) -> tuple[int, int]:
    """Samples between what the controller read and its input to the plant as logged; and from there to the torque.

    r is logged as it is computed, and waits; τ is logged as it acts.
    """
    delay = 0 if controller is None or controller.delay is None else controller.delay
    return (0, delay) if quantity == "r" else (delay, 0)
