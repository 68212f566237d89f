"""Prepare the logs of a diagnosis: their roles, motions and rows.

    prepared = prepare(logs, recipe, arm)
    prepared.data, prepared.judge, prepared.reference, prepared.columns

A point-to-point motion stands for a fifth of its time, and dry friction bears whatever torque its
controller commands there. Such rows do not count where no controller is known.

Reversals: where a joint with dry friction F turns round, its acceleration jumps by 2 F/D. A
smoother spreads this over its own time, so that friction, which follows the sign of the speed, is
predicted early or late. Cross-validation of the position hardly sees that. What passes the smoother
above the cut-off of the rows, their low-pass takes away: so a smoother that reaches it is made
wider.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.effects.base import FrictionLaw
from pipelines.errors import InputRejected, NothingMatched
from pipelines.estimation.config import FitConfig
from pipelines.estimation.estimate import (
    Recipe,
    equations_of,
    motions_of,
    none_left,
    refuse_leak,
    refuse_too_few,
    with_cutoff,
)
from pipelines.estimation.motion import Motions, Reconstructed, reconstruct
from pipelines.estimation.nominal import nominal_columns, with_offsets
from pipelines.estimation.regression import Columns, cutoff_at
from pipelines.estimation.rests import moving_rows
from pipelines.estimation.rows import Data, gather
from pipelines.estimation.state_estimation import design
from pipelines.estimation.tuning import smoother_bandwidth
from pipelines.io.log import ExperimentLog, recording
from pipelines.quality.segments import Mask

_CONFIG = FitConfig()
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
    """Return the rows of fitted, judging and reference logs, None of a part without logs.

    Those do not count of a joint that is held, as it is throughout some logs: it sticks, and no law
    tells its torque; nor those at rest, where dry friction holds a joint and no controller is
    known.
    """
    motions = tuple(one for part in parts for one in part)
    speeds = [np.abs(found.motion.dq[found.good.kept]) for _, found in motions]
    fastest = np.array([speed.max(axis=0, initial=0.0) for speed in speeds])
    held = list(fastest < _CONFIG.held * fastest.max(axis=0))
    bounds = list(pairwise(np.cumsum([0, *map(len, parts)]).tolist()))
    for part, (first, last) in zip(parts, bounds, strict=True):
        _refuse_held(part, held[first:last], first == 0)
    if any(log.controlled for log, _ in motions):  # with a known controller rests count
        equations = equations_of(motions, recipe, columns)
        pairs = zip(equations, held, strict=True)
        rows = [replace(one.rows, slow=one.rows.slow | still) for one, still in pairs]
    else:
        rows = moving_rows(motions, len(parts[0]), with_offsets(columns), recipe, held=held)
    return [
        gather(part, columns, recipe, rows[first:last], first) if part else None
        for part, (first, last) in zip(parts, bounds, strict=True)
    ]


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
