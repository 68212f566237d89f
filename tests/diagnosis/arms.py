"""Logs for the diagnosis: the RRR arm moved exactly along Fourier series, its torque that of inverse dynamics and of one cause.

What is hidden is written here in NumPy, apart from the effects of the library.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pipelines.dynamics.body import Motion
from pipelines.io.log import Array, ExperimentLog
from sample_logs.make_closed_form import NOISE, quantised, torque_step
from tests.estimation.experiments import arm, experiment, motion_of

SECONDS = 8.0


def hidden(seed: int, load: Callable[[Motion], Array] | None = None, role: str = "identify", factor: float = 1.0) -> ExperimentLog:
    """A log of the arm with an additional load (samples, joints) [N m]."""
    log = experiment(seed, role, duration=SECONDS)
    if load is None:
        return log
    motion = motion_of(seed)
    fine = np.arange(log.n_samples * 5, dtype=np.float64) * 2e-4 + 1e-4
    more = factor * load(motion(fine)).reshape(log.n_samples, 5, -1).mean(axis=1)
    tau = log.tau + quantised(more + 0.0 * NOISE, torque_step(log.robot))
    return replace(log, signals={**log.signals, "tau": replace(log.signals["tau"], values=tau)})


def wave(motion: Motion) -> Array:
    """0.1 N m at joint 2, eleven waves a turn."""
    out = np.zeros_like(motion.q)
    out[:, 1] = 0.1 * np.sin(11.0 * motion.q[:, 1] + 0.6)
    return out


__all__ = ["arm", "hidden", "wave"]
