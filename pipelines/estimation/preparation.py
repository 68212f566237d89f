"""Prepare the logs of a diagnosis: their roles, motions and rows.

    prepared = prepare(logs, recipe, arm)
    prepared.data, prepared.judge, prepared.reference, prepared.columns

Rests: a point-to-point motion stands for a fifth of its time, and dry friction bears whatever
torque its controller commands there. Such rows do not count where no controller is known.

Reversals: where a joint with dry friction F turns round, its acceleration jumps by 2 F/D. A
smoother spreads this over its own time, so that friction, which follows the sign of the speed, is
predicted early or late. Cross-validation of the position hardly sees that. What passes the smoother
above the cut-off of the rows, their low-pass takes away: so a smoother that reaches it is made
wider.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.effects.base import FrictionLaw
from pipelines.errors import InputRejected, NothingMatched
from pipelines.estimation.config import EstimateConfig, PreparationConfig, RestConfig
from pipelines.estimation.estimate import (
    Recipe,
    equations_of,
    motions_of,
    none_left,
    refuse_leak,
    refuse_too_few,
    with_cutoff,
)
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.motion import Motions, Reconstructed, reconstruct
from pipelines.estimation.nominal import nominal_columns, with_offsets
from pipelines.estimation.nominal_fit import fit_nominal
from pipelines.estimation.regression import Columns, cutoff_at
from pipelines.estimation.rests import lasting, slowness
from pipelines.estimation.rows import Data, gather
from pipelines.estimation.state_estimation import design
from pipelines.estimation.tuning import smoother_bandwidth
from pipelines.io.log import Array, ExperimentLog, recording
from pipelines.quality.segments import Mask

_CONFIG = PreparationConfig()
BLOCKS = 10  # numerics: of time, held out in turn where no log is of role "validate"
# experiments in which all joints move: a joint that is held sticks, and no law tells
_MOVING = ("excitation", "free", "writing")


@dataclass(frozen=True)
class FewerTerms:
    """A friction law that was asked for, and has more terms than these logs distinguish."""

    joint: int | None
    law: str  # as asked for
    taken: tuple[str, ...]  # in its place: the same law with fewer terms
    reason: str


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
        """Return them by their experiment and role."""
        moving = [log for log in logs if log.experiment in _MOVING and log.origin != "planned"]
        roles = ("identify", "validate", "reference")
        parts = [tuple(log for log in moving if log.role == role) for role in roles]
        frf = [log for log in logs if log.experiment == "frf"]
        before = tuple(log for log in frf if log.role == "reference")
        after = tuple(log for log in frf if log.role != "reference")
        return cls(parts[0], parts[1], parts[2], after, before)


def logs_of_roles(logs: Sequence[ExperimentLog], label: str) -> Logs:
    """Return the logs by what they are for, without plans.

    Raises:
        NothingMatched: C06, no log to fit.
        InputRejected: D14, one recording in two roles.
    """
    known = [log for log in logs if log.origin != "planned"]
    chosen = Logs.by_role(known)
    if not chosen.identify:
        kinds = ", ".join(sorted({f"{log.experiment} ({log.role})" for log in known})) or "none"
        raise NothingMatched(
            "C06",
            f"no excitation, free or writing log of role identify; there are: {kinds}",
            where=label,
            remedy="record an excitation, or name the logs to fit: --identify PATH",
        )
    refuse_leak(chosen.identify, chosen.validate)
    refuse_leak(chosen.reference, (*chosen.identify, *chosen.validate))
    return chosen


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
    fewer: tuple[FewerTerms, ...] = ()  # laws that were replaced by plainer ones


def rests(motions: Motions, cutoff_hz: float | None, fastest: Array) -> list[Mask]:
    """Return (samples, joints) of each log where a joint stands for a period of the low-pass.

    And for another one to either side, over which the low-pass spreads what held it: at low speed
    that would be a hump of friction. It may creep into a rest and out of it.

    Args:
        fastest: (joints,) [rad/s] largest speed in all logs.
    """
    found, sizes = [], slowness([one for _, one in motions])
    for (log, one), size in zip(motions, sizes, strict=True):
        least = 1.0 / ((cutoff_hz or np.inf) * log.sample_time)
        # slow turns, which tell friction, do not stand
        deep = np.abs(one.motion.dq[one.good.kept]) < _CONFIG.still * fastest
        found.append(lasting(size < RestConfig.still, least, math.ceil(least), deep))
    return found


def sticking(every: Sequence[Data], moving: Sequence[Data], columns: Columns) -> Mask:
    """Return the joints (joints,) whose rests leave more than twice what their motion does.

    By the nominal model with an offset, fitted to their motion: what is there at rest and in motion
    alike, of which an offset is the most, is no stiction.

    Args:
        every: rows of the fitted logs, and of others.
        moving: the same rows, of which those at rest do not count.
    """
    model = Exact.start(*fit_nominal(moving[0], with_offsets(columns)))
    power, count = np.zeros((2, every[0].n_joints)), np.zeros((2, every[0].n_joints))
    for whole, part in zip(every, moving, strict=True):
        left = np.square(whole.y - model.torque(whole))
        for k, rows in enumerate((whole.counts & ~part.counts, part.counts)):
            power[k] += np.bincount(whole.joint[rows], left[rows], whole.n_joints)
            count[k] += np.bincount(whole.joint[rows], minlength=whole.n_joints)
    rest, motion = power / np.maximum(count, 1.0)
    return np.asarray((rest > RestConfig.more**2 * motion) & (count > 0.0).all(axis=0))


def sharpened(motions: Motions, recipe: Recipe) -> Motions:
    """Return the logs with motions by wider smoothers, where these reach the cut-off.

    As they are where there is no cut-off, or no smoother.
    """
    if recipe.cutoff_hz is None or min(recipe.min_speed) > 0.0:
        return motions
    return tuple((log, _sharper(log, found, recipe)) for log, found in motions)


def _sharper(log: ExperimentLog, found: Reconstructed, recipe: Recipe) -> Reconstructed:
    felt = cutoff_at(recipe.cutoff_hz, 1.0 / log.sample_time)
    if felt is None:
        return found
    if found.derived:  # within `run`: the same motion, without the observers that made it
        log = recording(log)
        found = reconstruct(log, recipe.how, found.good)
    observers = found.observers
    if observers is None or not observers.twice:  # as given
        return found
    own = observers.smoothing
    slow = np.broadcast_to(np.array(recipe.min_speed), log.n_joints) == 0.0
    wide = (smoother_bandwidth(own, twice=True) >= felt) & slow
    if not wide.any():
        return found
    # σ ∝ bandwidth^order: `sigma_for_bandwidth`
    sigma = own.jerk_std * np.where(wide, _CONFIG.wider**own.order, 1.0)
    smoothing = design(own.sample_time, sigma, own.noise_variance, own.order)
    return reconstruct(log, recipe.how, found.good, replace(observers, smoothing=smoothing))


def prepare(logs: Logs, recipe: Recipe, arm: Arm | None = None) -> Prepared:
    """Reconstruct every log, and lay its rows; the cut-off is that of the fitted logs.

    Args:
        arm: whose friction laws the nominal model takes; Coulomb and viscous where left out.

    Raises:
        InputRejected: S01, no log to fit; T04, a log without a stretch that can be used; D05, of
            which saturated torque leaves no row; T08, of which, or of a joint, too few equations
            are left.
    """
    if not logs.identify:
        words = "no log of role 'identify' in which the arm moves"
        raise InputRejected("S01", words, remedy="record an excitation")
    columns = nominal_columns(logs.identify[0].robot, offset=False)
    if arm is not None and arm.friction:
        others = (law for law in columns.laws if not isinstance(law, FrictionLaw))
        columns = replace(columns, laws=(*(law.effect for law in arm.friction), *others))
    parts = (logs.identify, logs.validate, logs.reference)
    motions = motions_of([log for part in parts for log in part], recipe.how)
    fitted = len(logs.identify)
    others_fitted = motions[fitted + len(logs.validate) :]
    recipe = with_cutoff(recipe, (*motions[:fitted], *others_fitted))
    sharp = iter(sharpened(motions, recipe))
    groups = [tuple(islice(sharp, len(part))) for part in parts]
    rows = _rows(groups, columns, recipe)
    data, judge, reference = rows
    assert data is not None  # there are logs to fit
    for part, laid in zip(groups, rows, strict=True):
        for (log, found), one in zip(part, laid.logs if laid else (), strict=True):
            if not one.y.size:
                raise none_left(log, found, few=True)
    # what so few do not tell, has no name
    refuse_too_few([one.equations for one in data.logs], groups[0], 0)
    return Prepared(logs, columns, recipe, groups[0], groups[1], data, judge, reference)


def _rows(parts: Sequence[Motions], columns: Columns, recipe: Recipe) -> list[Data | None]:
    """Return the rows of fitted, judging and reference logs.

    Those do not count of a joint that is held, as it is throughout some logs: it sticks, and no law
    tells its torque; nor those at rest, where dry friction holds a joint and no controller is
    known.
    """
    motions = [one for part in parts for one in part]
    speeds = [np.abs(found.motion.dq[found.good.kept]) for _, found in motions]
    fastest = np.array([speed.max(axis=0, initial=0.0) for speed in speeds])
    held = list(fastest < _CONFIG.held * fastest.max(axis=0))
    first = 0
    for part in parts:
        _refuse_held(part, held[first : first + len(part)], part is parts[0])
        first += len(part)
    rows = _all_rows(parts, columns, recipe, held)
    if any(log.controlled for log, _ in motions):  # with a known controller rests count
        return rows
    at_rest = rests(tuple(motions), recipe.cutoff_hz, fastest.max(axis=0))
    if not any(own.any() for own in at_rest):
        return rows
    pairs = list(zip(held, at_rest, strict=True))
    moving = _all_rows(parts, columns, recipe, [still | own for still, own in pairs])
    data = moving[0]
    assert data is not None
    left = np.bincount(data.joint[data.counts], minlength=data.n_joints)
    if (left < EstimateConfig.fewest_of_joint).any():
        return rows
    stuck = sticking([one for one in rows if one], [one for one in moving if one], columns)
    if not stuck.any():
        return rows
    return _all_rows(parts, columns, recipe, [still | (own & stuck) for still, own in pairs])


def _all_rows(
    parts: Sequence[Motions], columns: Columns, recipe: Recipe, still: Sequence[Mask]
) -> list[Data | None]:
    """Return the rows of each part, None of one without logs.

    Args:
        still: (joints,) or (samples, joints) of each log whose rows do not count.
    """
    found, first = list[Data | None](), 0
    for part in parts:
        own = still[first : first + len(part)]
        chosen = None
        if any(mask.any() for mask in own):
            pairs = zip(equations_of(part, recipe, columns), own, strict=True)
            chosen = [replace(one.rows, slow=one.rows.slow | mask) for one, mask in pairs]
        found.append(gather(part, columns, recipe, chosen, first) if part else None)
        first += len(part)
    return found


def _refuse_held(motions: Motions, held: Sequence[Mask], fitted: bool) -> None:
    """T08: of a joint that moves in no fitted log, or logs in which no joint moves."""
    still = np.all(held, axis=0) if motions else np.zeros(1, dtype=bool)
    if not (still.any() if fitted else still.all()):
        return
    log = motions[0][0]
    which = "every joint" if still.all() else f"joint {int(np.argmax(still)) + 1}"
    words = f"{which} is held in the logs of role '{log.role}', and moves in others"
    remedy = f"record an excitation of role '{log.role}' in which it moves, "
    remedy += f"or leave out {log.name}"
    raise InputRejected("T08", words, log.source or log.name, remedy)
