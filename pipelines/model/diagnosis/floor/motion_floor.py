"""The floor of a motion: what the arm in order would leave of these very logs.

    rms = motion_floor(model, arm, noise, motions, data, prepared, before, seed)      (joints,) [N m]

A floor hangs on the motion. Where a joint reverses with little acceleration, smoothing blunts its friction for longer, and the
ripple of a drive grows with its load: a model without any fault may leave twice as much of one log as of another, or of an arm with
a payload. The arm in order is run through the experiments with the noise of the drives, what it logs is reconstructed and laid
like the logs, and the model it was run with is subtracted: nothing is fitted, so that a wrong number of the model is no part of it.
So several times over, for noise is not twice the same.

Where there are reference logs, an arm in order also has what no law of the model has to the last, its friction say: as much as they
leave more than their own replicas do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.shared_work import shared_out
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.floor.drive_noise import drive_noise
from pipelines.model.diagnosis.floor.replay import experiment_of
from pipelines.model.diagnosis.floor.twin import imperfect, replayable, replica
from pipelines.model.diagnosis.rows.data import Data, gather
from pipelines.model.diagnosis.rows.imperfections import DriveNoise
from pipelines.model.estimation.logs import Motions, Recipe
from pipelines.model.motion import Reconstructed
from pipelines.model.simulation import Noise, Simulated, Step, choose_steps, runs_alone, simulate_together

__all__ = ["motion_floor", "noise_in"]

Indices = npt.NDArray[np.intp]

# Of each log: with one, whose reversals fall as they will, the root mean square scatters by 2 to 6 %, as that of the log itself
# does, which it is held against; a third would take off a twentieth of what both scatter. Reference logs that are a third
# longer than the others say nearly as much with one; where it costs as much as two, they have two as well.
_COPIES = 2


def motion_floor(model: Exact, arm: Arm, noise: DriveNoise, motions: Motions, data: Data, prepared: Prepared, before: Array,
                 seed: int, standing: Sequence[Acting] = (), times: Array | float = 1.0) -> Array | None:
    """(joints,) [N m] root mean square; None where a log has no controller, or the arm in order cannot be simulated.

    Args:
        model: whose rigid body and friction the arm in order has.
        arm: with all that is known of the machine, whose torque its drives carry.
        noise: of the drives.
        motions: the logs, held out or fitted; `data` their rows.
        before: (joints,) [N m] what the reference logs leave, where there are any.
        times: (joints,) times as much power of what no law has is in this motion as in the reference logs.
        standing: effects of the machine beside the model; what of its friction they are, the arm in order has too.
    """
    bare = replace(model, effects=())
    plant = bare.nominal.extended(*(one for one in standing if one.effect.friction))
    order = _InOrder(bare, plant, arm, noise, prepared.recipe, seed)
    asked = [(motions, data)]
    if prepared.reference is not None:
        asked.append((prepared.referring, prepared.reference))
    logs = [log for some, _ in asked for log, _ in some]
    if not len(replayable(logs)) == len(logs) > 0:
        return None
    try:
        pieces = [_Piece(rows, place, *one, order.copies(some, motions)) for some, rows in asked for place, one in enumerate(some)]
        steps = order.steps(logs)
        shares = _shares(pieces)
        powers = shared_out(lambda share: order.powers(share, steps), shares)
    except InputRejected:  # D15, D17, T04
        return None
    known = list(zip(chain.from_iterable(shares), chain.from_iterable(powers), strict=True))
    left = []
    for _, rows in asked:
        square, count = np.sum([power for piece, power in known if piece.rows is rows], axis=0)
        left.append(square / np.maximum(count, 1.0))
    misfit = times * np.maximum(np.square(before) - left[1], 0.0) if len(left) > 1 else 0.0
    return np.asarray(np.sqrt(left[0] + misfit))


@dataclass(frozen=True, eq=False)
class _Piece:
    """A log that is replayed."""

    rows: Data  # that it belongs to
    place: int  # in these
    log: ExperimentLog
    found: Reconstructed
    copies: int

    @property
    def cost(self) -> int:
        return self.copies * self.log.n_samples


def _shares(pieces: Sequence[_Piece]) -> list[list[_Piece]]:
    """For two processes: each log, the longest first, to the one that has less."""
    shares: tuple[list[_Piece], list[_Piece]] = ([], [])
    for piece in sorted(pieces, key=lambda piece: -piece.cost):
        min(shares, key=lambda share: sum(one.cost for one in share)).append(piece)
    return [share for share in shares if share]


@dataclass(frozen=True, eq=False)
class _InOrder:
    """An arm without a fault, and how it is looked at."""

    bare: Exact
    plant: Arm  # the same with what stands of its friction
    arm: Arm
    noise: DriveNoise
    recipe: Recipe
    seed: int

    def copies(self, some: Motions, judged: Motions) -> int:
        """Of each of `some` logs, when of those that are `judged` there are `_COPIES`."""
        if some is judged or not all(runs_alone(self.plant, experiment_of(log)) for log, _ in some):
            return _COPIES
        length, asked = (sum(log.n_samples * log.sample_time for log, _ in motions) for motions in (some, judged))
        return max(1, min(_COPIES, round(_COPIES * asked / length)))

    def steps(self, logs: Sequence[ExperimentLog]) -> dict[float, Step]:
        """Chosen in the first log of each sample time: what is a tenth of the noise there is little of it in the next."""
        first = {log.sample_time: log for log in reversed(logs)}
        return choose_steps(self.plant, [experiment_of(log) for log in first.values()], self._drives)

    def powers(self, pieces: Sequence[_Piece], steps: Mapping[float, Step]) -> list[tuple[Array, Indices]]:
        """Of each log (joints,) [N m^2] sum of squares of what the model leaves of its own replicas, and of how many rows."""
        found: dict[int, tuple[Array, Indices]] = {}
        for copies in {one.copies for one in pieces}:
            some = [one for one in pieces if one.copies == copies]
            done = simulate_together(self.plant, [experiment_of(one.log) for one in some], self._drives, self._seeds(copies), steps)
            found |= {id(one): self._power(one, simulated) for one, simulated in zip(some, done, strict=True)}
        return [found[id(one)] for one in pieces]

    def _power(self, piece: _Piece, done: Simulated) -> tuple[Array, Indices]:
        square, count = np.sum([self._power_of(piece, done, k) for k in range(piece.copies)], axis=0)
        return square, count

    def _power_of(self, piece: _Piece, done: Simulated, k: int) -> tuple[Array, Indices]:
        copy, seen = replica((piece.log, piece.found), done, k, self.recipe), piece.rows.logs[piece.place].equations.rows
        own = gather((copy,), self.bare.columns, self.recipe, [seen], piece.place)
        small = own.lay_each(imperfect(self.arm, self.noise, own, self._seeds(piece.copies), k))
        return own.power(own.y + small - own.lay(self.plant.torque))

    def _seeds(self, copies: int) -> range:
        return range(self.seed, self.seed + copies)

    @property
    def _drives(self) -> Noise:
        return Noise(self.noise.white, np.zeros_like(self.noise.white))


def noise_in(model: Exact, data: Data, left: Array, motions: Motions, recipe: Recipe, seed: int) -> DriveNoise | None:
    """`drive_noise` in the first log whose controller is known; None where there is none, or no simulation."""
    places = replayable([log for log, _ in motions])
    try:
        found = drive_noise(model, data, left, motions, recipe, places[0], seed) if places else None
        return None if found is None or not np.isfinite(found.white + found.wander).all() else found
    except InputRejected:  # D15, D17
        return None
