"""The floor of a motion: what the arm in order would leave of these very logs.

    rms = motion_floor(model, arm, noise, motions, data, prepared, before, seed)      (joints,) [N m]

A floor hangs on the motion. Where a joint reverses with little acceleration, smoothing blunts its friction for longer, and the
ripple of a drive grows with its load: a model without any fault may leave twice as much of one log as of another, or of an arm with
a payload. The arm in order is run through the experiments with the noise of the drives, what it logs is reconstructed and laid
like the logs, and the model it was run with is subtracted: nothing is fitted, so that a wrong number of the model is no part of it.

Where there are reference logs, an arm in order also has what no law of the model has to the last, its friction say: as much as they
leave more than their own replicas do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.shared_work import shared_out
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.data import Data, gather
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.inputs import Prepared
from pipelines.model.diagnosis.twin import drive_noise, imperfect, replayable, replica
from pipelines.model.estimation.logs import Motions, Recipe
from pipelines.model.simulation import Experiment, Noise, Simulated, simulate

__all__ = ["motion_floor", "noise_in"]


def motion_floor(model: Exact, arm: Arm, noise: Array, motions: Motions, data: Data, prepared: Prepared, before: Array,
                 seed: int) -> Array | None:
    """(joints,) [N m] root mean square; None where a log has no controller, or the arm in order cannot be simulated.

    Args:
        model: whose rigid body and friction the arm in order has.
        arm: with all that is known of the machine, whose torque its drives carry.
        noise: (joints,) [N m] white noise of the drives.
        motions: the logs, held out or fitted; `data` their rows.
        before: (joints,) [N m] what the reference logs leave, where there are any.
    """
    asked = [(motions, data)]
    if prepared.reference is not None:
        asked.append((prepared.referring, prepared.reference))
    logs = [log for some, _ in asked for log, _ in some]
    if not len(replayable(logs)) == len(logs) > 0:
        return None
    bare = replace(model, effects=())

    def run(log: ExperimentLog) -> Simulated:
        return simulate(bare.nominal, Experiment.of_log(log), Noise(noise, np.zeros_like(noise)), (seed,))

    try:
        done = iter(shared_out(run, logs))
        left = [_left(bare, arm, noise, [next(done) for _ in some], some, rows, prepared.recipe, seed) for some, rows in asked]
    except InputRejected:  # D15, D17, T04
        return None
    misfit = np.maximum(np.square(before) - np.square(left[1]), 0.0) if len(left) > 1 else 0.0
    return np.asarray(np.sqrt(np.square(left[0]) + misfit))


def _left(bare: Exact, arm: Arm, noise: Array, done: Sequence[Simulated], motions: Motions, data: Data, recipe: Recipe,
          seed: int) -> Array:
    """(joints,) [N m] root mean square of what the model leaves of its own replicas of these logs."""
    parts = tuple(replica(one, simulated, 0, recipe) for one, simulated in zip(motions, done, strict=True))
    own = gather(parts, bare.columns, recipe, [one.equations.rows for one in data.logs])
    return own.rms(own.y + own.lay_each(imperfect(arm, noise, own, seed)) - bare.torque(own))


def noise_in(model: Exact, data: Data, left: Array, motions: Motions, recipe: Recipe, seed: int) -> Array | None:
    """`drive_noise` (joints,) [N m] in the first log whose controller is known; None where there is none, or no simulation."""
    places = replayable([log for log, _ in motions])
    try:
        found = drive_noise(model, data, left, motions, recipe, places[0], seed) if places else None
        return None if found is None or not np.isfinite(found).all() else found
    except InputRejected:  # D15, D17
        return None
