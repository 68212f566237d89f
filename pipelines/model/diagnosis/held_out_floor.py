"""The floor of the held-out logs: what the arm in order would leave of these very motions.

    rms = held_out_floor(model, arm, noise, motions, data, recipe, seed)      (joints,) [N m]

A floor hangs on the motion. Where a joint reverses with little acceleration, smoothing blunts its friction for longer, and the
ripple of a drive grows with its load: a model without any fault may leave twice as much of one log as of another. The arm in order
is run through the held-out experiments with the noise of the drives, what it logs is reconstructed and laid like the logs, and the
model it was run with is subtracted: nothing is fitted, so that a wrong number of the model is no part of the floor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.log.shared_work import shared_out
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.data import Data, gather
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.twin import drive_noise, imperfect, replayable, replica
from pipelines.model.estimation.logs import Motions, Recipe
from pipelines.model.simulation import Experiment, Noise, Simulated, simulate

__all__ = ["held_out_floor", "noise_in"]


def held_out_floor(model: Exact, arm: Arm, noise: Array, motions: Motions, data: Data, recipe: Recipe, seed: int) -> Array | None:
    """(joints,) [N m] root mean square; None where a held-out log has no controller, or the arm in order cannot be simulated.

    Args:
        model: whose rigid body and friction the arm in order has.
        arm: with all that is known of the machine, whose torque its drives carry.
        noise: (joints,) [N m] white noise of the drives.
        motions: the held-out logs; `data` their rows.
    """
    logs = [log for log, _ in motions]
    if not logs or len(replayable(logs)) < len(logs):
        return None
    bare = replace(model, effects=())

    def run(number: int) -> Simulated:
        return simulate(bare.nominal, Experiment.of_log(logs[number]), Noise(noise, np.zeros_like(noise)), (seed,))

    try:
        done = shared_out(run, range(len(logs)))
        parts = tuple(replica(one, simulated, 0, recipe) for one, simulated in zip(motions, done, strict=True))
        own = gather(parts, bare.columns, recipe, [one.equations.rows for one in data.logs])
    except InputRejected:  # D15, D17, T04
        return None
    small = own.lay_each(imperfect(arm, noise, own, seed))
    return own.rms(own.y + small - bare.torque(own))


def noise_in(model: Exact, data: Data, left: Array, motions: Motions, recipe: Recipe, seed: int) -> Array | None:
    """`drive_noise` (joints,) [N m] in the first log whose controller is known; None where there is none, or no simulation."""
    places = replayable([log for log, _ in motions])
    try:
        return drive_noise(model, data, left, motions, recipe, places[0], seed) if places else None
    except InputRejected:  # D15, D17
        return None
