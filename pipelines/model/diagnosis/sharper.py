"""Motion whose reversals are sharp: friction that changes sign bends it more quickly than cross-validation of the position sees.

    motions = sharpened(motions, how, cutoff_hz)

When a joint with dry friction F turns round, its acceleration jumps by 2 F/D. A smoother spreads this over its own time, so
that the speed passes through zero early or late, and friction, which follows its sign, is predicted early or late: a pulse in
the torque, of a height that no low-pass takes away. Cross-validation weighs this, a few hundredths of a second a reversal,
against the noise of all other samples, and of the position, which a jump of the acceleration hardly moves.

What passes the smoother above the cut-off of the equations, their low-pass takes away. So a smoother that reaches it may be
wider at no cost but in the speed that friction is looked up with, whose noise stays far below that over which friction
changes sign. One that does not reach it would let noise into the equations, and stays as it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.log.experiment import ExperimentLog
from pipelines.model.estimation.conditioning import cutoff_at
from pipelines.model.estimation.logs import Motions, of_each
from pipelines.model.motion import Reconstructed, Reconstruction, reconstruct
from pipelines.signal.observer import design
from pipelines.signal.tuning import smoother_bandwidth

__all__ = ["sharpened"]

# Times the bandwidth. Over logs of the bench a motor that turns with two joints leaves 2.5 floors at 1, 1.2 at 1.8, 1.0 at 2.3,
# and hardly less at 3.2.
_WIDER = 2.3


def sharpened(motions: Motions, how: Reconstruction, cutoff_hz: float | None) -> Motions:
    """The logs with their motions reconstructed by smoothers that are `_WIDER` times as wide, joint by joint, where these reach the
    `cutoff_hz` of the equations; as they are where there is none, or no smoother."""
    if cutoff_hz is None:
        return motions
    return of_each([log for log, _ in motions], lambda place: _sharper(*motions[place], how, cutoff_hz))


def _sharper(log: ExperimentLog, found: Reconstructed, how: Reconstruction, cutoff_hz: float) -> Reconstructed:
    observers, felt = found.observers, cutoff_at(cutoff_hz, 1.0 / log.sample_time)
    if felt is None or observers is None or not observers.twice:  # derived before, or as asked for
        return found
    own = observers.smoothing
    wide = smoother_bandwidth(own, twice=True) >= felt
    if not wide.any():
        return found
    # σ ∝ bandwidth^order: `sigma_for_bandwidth`
    sigma = own.jerk_std * np.where(wide, _WIDER**own.order, 1.0)
    wider = replace(observers, smoothing=design(own.sample_time, sigma, own.noise_variance, own.order))
    return reconstruct(log, how, found.good, wider)
