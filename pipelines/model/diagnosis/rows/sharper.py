"""Motion whose reversals are sharp: friction that changes sign bends it more quickly than cross-validation of the position sees.

    motions = sharpened(motions, recipe)

When a joint with dry friction F turns round, its acceleration jumps by 2 F/D. A smoother spreads this over its own time, so
that the speed passes through zero early or late, and friction, which follows its sign, is predicted early or late: a pulse in
the torque, of a height that no low-pass takes away. Cross-validation weighs this, a few hundredths of a second a reversal,
against the noise of all other samples, and of the position, which a jump of the acceleration hardly moves.

What passes the smoother above the cut-off of the equations, their low-pass takes away. So a smoother that reaches it may be
wider at no cost but in the speed that friction is looked up with, whose noise stays far below that over which friction
changes sign. One that does not reach it would let noise into the equations, and stays as it is. So does that of a joint whose slow
samples are left out: no reversal of it is among the equations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.log.derive import recording
from pipelines.log.experiment import ExperimentLog
from pipelines.model.estimation.conditioning import cutoff_at
from pipelines.model.estimation.logs import Motions, Recipe, of_each
from pipelines.model.motion import Reconstructed, reconstruct
from pipelines.signal.observer import design
from pipelines.signal.tuning import smoother_bandwidth

__all__ = ["sharpened"]

# Times the bandwidth. Over logs of the bench coupled transmission leaves 2.5 floors at 1, 1.2 at 1.8, 1.0 at 2.3,
# and hardly less at 3.2.
_WIDER = 2.3


def sharpened(motions: Motions, recipe: Recipe) -> Motions:
    """The logs with their motions reconstructed by smoothers that are `_WIDER` times as wide, joint by joint, where these reach the
    cut-off of the equations and these hold its reversals; as they are where there is no cut-off, or no smoother."""
    if recipe.cutoff_hz is None or min(recipe.min_speed) > 0.0:
        return motions
    return of_each([log for log, _ in motions], lambda place: _sharper(*motions[place], recipe))


def _sharper(log: ExperimentLog, found: Reconstructed, recipe: Recipe) -> Reconstructed:
    felt = cutoff_at(recipe.cutoff_hz, 1.0 / log.sample_time)
    if felt is None:
        return found
    if found.derived:  # by `reconstruct`, within `run`: the same motion, without the observers that made it
        log = recording(log)
        found = reconstruct(log, recipe.how, found.good)
    observers = found.observers
    if observers is None or not observers.twice:  # as asked for
        return found
    own = observers.smoothing
    wide = (smoother_bandwidth(own, twice=True) >= felt) & (np.broadcast_to(np.array(recipe.min_speed), log.n_joints) == 0.0)
    if not wide.any():
        return found
    # σ ∝ bandwidth^order: `sigma_for_bandwidth`
    sigma = own.jerk_std * np.where(wide, _WIDER**own.order, 1.0)
    wider = replace(observers, smoothing=design(own.sample_time, sigma, own.noise_variance, own.order))
    return reconstruct(log, recipe.how, found.good, wider)
