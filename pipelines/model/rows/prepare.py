"""Prepare the logs of a diagnosis: their roles, motions and rows.

    prepared = prepare(logs, recipe, arm)
    prepared.data, prepared.judge, prepared.reference, prepared.columns

Rests: a point-to-point motion stands for a fifth of its time, and dry friction bears whatever
torque its controller happens to ask for there. Such rows do not count where no controller is known.

Reversals: where a joint with dry friction F turns round, its acceleration jumps by 2 F/D. A smoother
spreads this over its own time, so that friction, which follows the sign of the speed, is predicted
early or late. Cross-validation of the position hardly sees that. What passes the smoother above the
cut-off of the rows, their low-pass takes away: so a smoother that reaches it is made wider.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.arm import Arm
from pipelines.effects.base import FrictionLaw
from pipelines.errors import InputRejected
from pipelines.estimation.config import EstimateConfig, RestConfig
from pipelines.estimation.estimate import (
    Recipe,
    equations_of,
    motions_of,
    none_left,
    refuse_too_few,
    with_cutoff,
)
from pipelines.estimation.motion import Motions, Reconstructed, reconstruct
from pipelines.estimation.nominal import nominal_columns, with_offsets
from pipelines.estimation.regression import Columns, cutoff_at
from pipelines.estimation.state_estimation import design
from pipelines.estimation.tuning import smoother_bandwidth
from pipelines.io.log import Array, ExperimentLog, recording
from pipelines.model.rows.data import Data, gather
from pipelines.model.rows.exact import Exact
from pipelines.model.rows.nominal import fit_nominal

__all__ = ["BLOCKS", "FewerTerms", "Logs", "Prepared", "prepare", "rests", "sharpened", "sticking"]

@dataclass(frozen=True)
class FewerTerms:
    """A friction law that was asked for, and has more terms than these logs tell apart."""

    joint: int | None
    law: str  # as asked for
    taken: tuple[str, ...]  # in its place: the same law with fewer terms
    reason: str


BLOCKS = 10  # of time, held out in turn where no log is of role "validate"


Mask = npt.NDArray[np.bool_]

_STILL = 1e-3  # of the joint's largest speed: it may creep into a rest and out of it; three decades below, it stands
_MORE = 2.0  # times what is left where the joint moves


def rests(motions: Motions, cutoff_hz: float | None, fastest: Array) -> list[Mask]:
    """(samples, joints) of each log where a joint stands for a period of the low-pass or longer, and for another one to either
    side, over which the low-pass spreads what held it: at low speed that would be a hump of friction.

    Args:
        fastest: (joints,) [rad/s] largest speed in all logs.
    """
    parts = [[np.abs(x[found.good.kept]) for x in (found.motion.dq, found.motion.ddq)] for _, found in motions]
    rms = [np.maximum(np.sqrt(np.mean(np.vstack(part) ** 2, axis=0)), 1e-300) for part in zip(*parts, strict=True)]
    return [_rests(speed, np.hypot(speed / rms[0], acceleration / rms[1]) < RestConfig().still,
                   1.0 / ((cutoff_hz or np.inf) * log.sample_time), fastest)
            for (log, _), (speed, acceleration) in zip(motions, parts, strict=True)]


def _rests(speed: Array, every_slow: Mask, least: float, fastest: Array) -> Mask:
    out, reach = np.zeros(speed.shape, dtype=bool), math.ceil(least)
    for j in range(speed.shape[1]):
        slow, still = every_slow[:, j], np.cumsum(np.append(0, speed[:, j] < _STILL * fastest[j]))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]]).astype(np.int8)))
        for start, stop in edges.reshape(-1, 2):
            if still[stop] - still[start] > least:  # slow turns, which tell friction, do not stand
                out[max(0, start - reach):stop + reach, j] = True
    return out


def sticking(every: Sequence[Data], moving: Sequence[Data], columns: Columns) -> Mask:
    """(joints,) whose rests leave more than twice what their motion does, by the nominal model with an offset, fitted to their
    motion: what is there at rest and in motion alike, of which an offset is the most, is no stiction.

    Args:
        every: rows of the fitted logs, and of others; `moving`: the same rows, of which those at rest do not count.
    """
    model = Exact.start(*fit_nominal(moving[0], with_offsets(columns)))
    power, count = np.zeros((2, every[0].n_joints)), np.zeros((2, every[0].n_joints))
    for whole, part in zip(every, moving, strict=True):
        left = np.square(whole.y - model.torque(whole))
        for k, rows in enumerate((whole.counts & ~part.counts, part.counts)):
            power[k] += np.bincount(whole.joint[rows], left[rows], whole.n_joints)
            count[k] += np.bincount(whole.joint[rows], minlength=whole.n_joints)
    rest, motion = power / np.maximum(count, 1.0)
    return np.asarray((rest > _MORE**2 * motion) & (count > 0.0).all(axis=0))


# Times the bandwidth. Over logs of the bench coupled transmission leaves 2.5 floors at 1, 1.2 at 1.8, 1.0 at 2.3,
# and hardly less at 3.2.
_WIDER = 2.3


def sharpened(motions: Motions, recipe: Recipe) -> Motions:
    """The logs with their motions reconstructed by smoothers that are `_WIDER` times as wide, joint by joint, where these reach the
    cut-off of the equations and these hold its reversals; as they are where there is no cut-off, or no smoother."""
    if recipe.cutoff_hz is None or min(recipe.min_speed) > 0.0:
        return motions
    return tuple((log, _sharper(log, found, recipe)) for log, found in motions)


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


Joints = npt.NDArray[np.bool_]

_HELD = 0.02  # of its largest speed in all logs, below which a joint is held throughout a log
_MOVING = ("excitation", "free", "writing")  # experiments in which all joints move: a joint that is held sticks, and no law tells


@dataclass(frozen=True)
class Logs:
    """Logs of one robot, by what they are for."""

    identify: tuple[ExperimentLog, ...]
    validate: tuple[ExperimentLog, ...] = ()
    reference: tuple[ExperimentLog, ...] = ()
    frf: tuple[ExperimentLog, ...] = ()
    frf_before: tuple[ExperimentLog, ...] = ()  # of role "reference"

    @property
    def every(self) -> tuple[ExperimentLog, ...]:
        """All logs that a diagnosis looks at."""
        return (*self.identify, *self.validate, *self.reference, *self.frf, *self.frf_before)

    @classmethod
    def by_role(cls, logs: Sequence[ExperimentLog]) -> Logs:
        """Chosen by what they say of themselves."""
        moving = [log for log in logs if log.experiment in _MOVING and log.origin != "planned"]
        parts = {role: tuple(log for log in moving if log.role == role) for role in ("identify", "validate", "reference")}
        return cls(parts["identify"], parts["validate"], parts["reference"],
                   *(tuple(log for log in logs if log.experiment == "frf" and (log.role == "reference") is before)
                     for before in (False, True)))


@dataclass(frozen=True, eq=False)
class Prepared:
    """Rows of every kind of logs."""

    logs: Logs
    columns: Columns  # of the nominal model, its friction laws in their first shape
    recipe: Recipe
    motions: Motions  # of the logs that are fitted
    judging: Motions
    data: Data
    judge: Data | None  # None: blocks of the fitted ones judge
    reference: Data | None
    fewer: tuple[FewerTerms, ...] = ()  # laws that gave way to plainer ones


def prepare(logs: Logs, recipe: Recipe, arm: Arm | None = None) -> Prepared:
    """Reconstruct every log, and lay its rows; the cut-off is that of the fitted logs.

    Args:
        arm: whose friction laws the nominal model takes; Coulomb and viscous friction where left out.

    Raises:
        InputRejected: S01, no log to fit; T04, a log without a stretch that can be used; D05, of which saturated torque leaves no
            row; T08, of which, or of a joint, too few equations are left.
    """
    if not logs.identify:
        raise InputRejected("S01", "no log of role 'identify' in which the arm moves", remedy="record an excitation")
    columns = _columns(logs, arm)
    parts = (logs.identify, logs.validate, logs.reference)
    motions = motions_of([log for part in parts for log in part], recipe.how)
    judged = slice(len(logs.identify), len(logs.identify) + len(logs.validate))
    recipe = with_cutoff(recipe, (*motions[:judged.start], *motions[judged.stop:]))
    sharp = iter(sharpened(motions, recipe))
    fitted, judging, referring = (tuple(islice(sharp, len(part))) for part in parts)
    prepared = _laid(logs, columns, recipe, fitted, judging, referring)
    refuse_too_few([one.equations for one in prepared.data.logs], fitted, 0)  # what so few do not tell, has no name
    return prepared


def _laid(logs: Logs, columns: Columns, recipe: Recipe, fitted: Motions, judging: Motions, referring: Motions) -> Prepared:
    fastest = [np.abs(found.motion.dq[found.good.kept]).max(axis=0, initial=0.0) for _, found in (*fitted, *judging, *referring)]
    held = list(np.array(fastest) < _HELD * np.max(fastest, axis=0))
    parts, first = (fitted, judging, referring), 0
    for part in parts:
        _refuse_held(part, held[first:first + len(part)], part is fitted)
        first += len(part)
    rows = _all_rows(parts, columns, recipe, held)
    motions = (*fitted, *judging, *referring)
    if not any(log.controlled for log, _ in motions):  # with a known controller rests count
        rows = _without_rests(parts, columns, recipe, held, rests(motions, recipe.cutoff_hz, np.max(fastest, axis=0)), rows)
    data, judge, reference = rows
    assert data is not None  # prepare refuses logs without any to fit
    for part, laid in zip(parts, (data, judge, reference), strict=True):
        for (log, found), one in zip(part, laid.logs if laid else (), strict=True):
            if not one.y.size:
                raise none_left(log, found, few=True)
    return Prepared(logs, columns, recipe, fitted, judging, data, judge, reference)


def _without_rests(parts: Sequence[Motions], columns: Columns, recipe: Recipe, held: Sequence[Joints], at_rest: Sequence[Joints],
                   rows: list[Data | None]) -> list[Data | None]:
    """The same rows, of which those do not count in which dry friction holds a joint, `at_rest` (samples, joints) of each log."""
    if not any(own.any() for own in at_rest):
        return rows
    moving = _all_rows(parts, columns, recipe, [still | own for still, own in zip(held, at_rest, strict=True)])
    if not _enough(moving):
        return rows
    stuck = sticking([one for one in rows if one], [one for one in moving if one], columns)
    if not stuck.any():
        return rows
    return _all_rows(parts, columns, recipe, [still | (own & stuck) for still, own in zip(held, at_rest, strict=True)])


def _all_rows(parts: Sequence[Motions], columns: Columns, recipe: Recipe, still: Sequence[Joints]) -> list[Data | None]:
    """Of each part, None of one without logs; those do not count in which a joint is `still`, (joints,) or (samples, joints)."""
    ends = np.cumsum([0, *map(len, parts)]).tolist()
    return [_moving(part, columns, recipe, still[first:last], first) if part else None
            for part, first, last in zip(parts, ends, ends[1:], strict=False)]


def _enough(rows: Sequence[Data | None]) -> bool:
    """Return whether every joint moves in the fitted logs for as many equations as a fit asks for."""
    data = rows[0]
    return data is not None and bool((np.bincount(data.joint[data.counts], minlength=data.n_joints) >= EstimateConfig.fewest_of_joint).all())


def _refuse_held(motions: Motions, held: Sequence[Joints], fitted: bool) -> None:
    """T08: of a joint that moves in none of the fitted logs nothing can be said; logs in which no joint does say nothing."""
    still = np.all(held, axis=0) if motions else np.zeros(1, dtype=bool)
    if not (still.any() if fitted else still.all()):
        return
    log = motions[0][0]
    which = "every joint" if still.all() else f"joint {int(np.argmax(still)) + 1}"
    raise InputRejected("T08", f"{which} is held in the logs of role '{log.role}', and moves in others",
                        where=log.source or log.name,
                        remedy=f"record an excitation of role '{log.role}' in which it moves, or leave out {log.name}")


def _moving(motions: Motions, columns: Columns, recipe: Recipe, held: Sequence[Joints], first: int) -> Data:
    """The rows of logs; those of a joint that is held, as it is throughout some, do not count: it sticks, and no law tells its
    torque."""
    if not any(still.any() for still in held):
        return gather(motions, columns, recipe, first=first)
    equations = equations_of(motions, recipe, columns)
    rows = [replace(one.rows, slow=one.rows.slow | still) for one, still in zip(equations, held, strict=True)]
    return gather(motions, columns, recipe, rows, first)


def _columns(logs: Logs, arm: Arm | None) -> Columns:
    columns = nominal_columns(logs.identify[0].robot, offset=False)
    if arm is None or not arm.friction:
        return columns
    others = tuple(law for law in columns.laws if not isinstance(law, FrictionLaw))
    return replace(columns, laws=(*(law.effect for law in arm.friction), *others))
