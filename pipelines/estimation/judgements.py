"""Judge an estimate: whether logs can clear an arm, and whether friction comes out negative.

    why = cannot_judge(facts)                  in words, with what to record; empty where they can
    for check in negative_viscous(found, where): ...
    for finding in excited(subject): ...       D09 of a log, by the equations of `estimate-bps`
    common, differing = Repeated.of(data).parts(left)      what is noise, and what is not

"No fault found" takes a noise floor, from reference logs, or a model that leaves next to nothing on
held-out motion but what differs between repeated states; and a model that the logs determine. One
that they do not determine predicts held-out torque with a large standard deviation:

    std τ̂_j(t) = sqrt(a_j(t)ᵀ C a_j(t)),  a_j the regressor of joint j, C the covariance of β

(Draper & Smith 1998, ch. 3.1). Noise is what differs between two rows of one state: with a residual
r = f(q, dq, ddq) + e of a model error f and noise e,

    E ¼ (r₁ - r₂)² = ½ σ²        E ¼ (r₁ + r₂)² = ½ σ² + f²

(Rice 1984, difference-based variance). A viscous coefficient below zero is no friction. It is
reported where it is significant, and stays so with a second Coulomb law of the widest change of
sign: within that width viscous friction only corrects the shape of the change.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from pipelines.effects import find_effect
from pipelines.effects.base import everywhere
from pipelines.errors import Check, InputRejected
from pipelines.estimation import identifiability
from pipelines.estimation.config import FitConfig, JudgeableConfig
from pipelines.estimation.estimate import Estimate, Recipe, equations_of, estimate, with_cutoff
from pipelines.estimation.least_squares import Block, Flags, Indices
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.nominal import (
    columns_in_words,
    fit_nominal,
    nominal_columns,
    with_offsets,
)
from pipelines.estimation.regression import Columns, LogEquations
from pipelines.io.log import Array, recording
from pipelines.quality.subject import NotTested, Subject

if TYPE_CHECKING:
    from pipelines.estimation.preparation import Prepared
    from pipelines.estimation.rows import Data

_CONFIG = JudgeableConfig()
REMEDY = "move the joints concerned further and faster, in more postures, and all of them at once"
_RECORD = "record reference logs while the arm is known to be healthy, "
_RECORD += "or a motion that repeats itself"


@dataclass(frozen=True, eq=False)
class Facts:
    """Errors of a model on held-out motion, and the state of its noise floor.

    Arrays (joints,) are root mean squares [N m], of prismatic joints [N].
    """

    left: Array  # residual of the nominal model
    torque: Array  # measured
    std: Array  # of the predicted torque, by the covariance of the parameters
    unresolved: str  # parameters that the logs do not separate, in words; empty: none
    floor_known: Flags  # (joints,) whether the residual can be held against a noise floor


def unresolved(found: Estimate) -> str:
    """Return which parameters the fitted logs do not separate, in words; empty where they do."""
    return found.unresolved.told(columns_in_words(one.name for one in found.columns.names))


def one_way(found: Estimate) -> str:
    """Return which friction is linearly dependent on an offset, for its joint moves one way.

    The constant gravity of a vertical slide is an offset too, and no reason to doubt a model.
    """
    names = [one.name for one in found.columns.names]
    lost = identifiability.unresolved(found.solution, names, 0.0)
    # no base parameters
    friction = tuple(group for group in lost.confused if all(":" in name for name in group))
    return replace(lost, never_moved=(), confused=friction).told(columns_in_words(names))


def predicted_std(found: Estimate, equations: Iterable[Block]) -> Array:
    """Return the rms [N m] (joints,) of the predicted torque's deviation over `equations`.

    Parameters that the fitted logs do not determine at all have no covariance: they count as known
    here, and are listed as unresolved.
    """
    covariance = found.robust.covariance
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    variance, count = np.zeros((2, found.columns.body.robot.n_joints))
    for block in equations:
        for j, (index, values) in enumerate(zip(block.columns, block.values, strict=True)):
            variance[j] += np.sum(values * (covariance[np.ix_(index, index)] @ values))
        count += block.counts
    return np.asarray(np.sqrt(np.maximum(variance, 0.0) / np.maximum(count, 1.0)))


def cannot_judge(facts: Facts, config: JudgeableConfig = _CONFIG) -> str:
    """Return why nothing can be said of the arm, and what to record; empty where it can be."""
    limit, why = config.largest_share, []
    misfit = _large(np.where(facts.floor_known, 0.0, facts.left), facts.torque, limit)
    if misfit:
        words = "no noise floor is known, and on held-out motion the model leaves "
        why.append(f"{words}{misfit}, as a fault may and a healthy arm may; {_RECORD}")
    unsure = _large(facts.std, facts.torque, limit)
    if facts.unresolved or unsure:
        said = [facts.unresolved] if facts.unresolved else []
        if unsure:
            words = "its prediction of held-out torque has a standard deviation of"
            said.append(f"{words} {unsure}")
        why.append(f"the logs do not determine the model: {'; '.join(said)}; {REMEDY}")
    return "; and ".join(why)


def _large(part: Array, torque: Array, limit: float) -> str:
    """Return "25 % of the torque of joint 1, 12 % of joint 3": shares above the limit."""
    share = part / np.maximum(torque, 1e-300)
    joints = np.flatnonzero(share > limit).tolist()
    words = ", ".join(f"{100.0 * share[j]:.2g} % of joint {j + 1}" for j in joints)
    return words.replace(" of joint", " of the torque of joint", 1)


def negative_viscous(
    found: Estimate, where: str, config: JudgeableConfig = _CONFIG
) -> tuple[Check, ...]:
    """Return a check, D15, of every joint whose viscous friction is significantly negative."""
    places = _negative(found, config.least_std)
    if not places:
        return ()
    coulomb, columns = find_effect("coulomb"), found.columns
    widest = next(q.low for q in coulomb.parameters if q.name == "sharpness")
    laws = everywhere(coulomb, columns.body.robot.revolute)
    wide = [replace(law, sharpness=widest) for law in laws]  # type: ignore[call-arg]
    columns = replace(columns, laws=(*columns.laws, *wide))
    logs = [replace(log, columns=columns) for log in found.equations.logs]
    sure = _negative(estimate(logs, columns), config.least_std)
    checks, names = [], found.columns.names
    for k in (k for k in places if k in sure):
        joint = names[k].name.split(":")[1]
        size = f"{found.beta[k]:.3g} ± {found.std[k]:.2g} {names[k].unit}"
        words = f"viscous friction of joint {joint} is negative, {size}: it would drive the joint"
        remedy = "look whether the logged torque of this joint has the other sign, is compensated "
        remedy += "for friction, or is late behind the position; else its friction falls with "
        remedy += "speed, and the model lacks that law"
        checks.append(Check.of("D15", "warn", words, where, remedy, gate=True))
    return tuple(checks)


def _negative(found: Estimate, least: float) -> Sequence[int]:
    """Return the places of the viscous coefficients that are determined and negative."""
    below = found.trusted & (found.beta < -least * found.std)
    names = enumerate(found.columns.names)
    return [k for k, column in names if column.name.startswith("viscous:") and below[k]]


def excited(subject: Subject) -> Sequence[Check | NotTested]:
    """D09 of an "excitation" log: that every base parameter and friction shows, or what does not.

    By the equations of `estimate-bps`. What sways within its dry friction hardly moves.
    """
    if subject.log.experiment != "excitation":
        return []
    steps = np.array([step or 0.0 for step in subject.good.steps])
    still = subject.travel < np.maximum(_CONFIG.least_travel, _CONFIG.steps * steps)
    try:
        found = excitation(subject, still)
    except InputRejected as why:
        return subject.cannot_tell("D09", why.message)
    held = [str(joint) for joint in np.flatnonzero(still) + 1]
    never = [
        name
        for name in found.unresolved.never_moved
        if name.partition(":")[2].partition(":")[0] not in held
    ]
    lost = replace(found.unresolved, never_moved=tuple(never))
    words = [lost.told(columns_in_words(one.name for one in found.columns.names))]
    if held:
        joints = f"joints {', '.join(held)} hardly move"
        joints = joints if len(held) > 1 else f"joint {held[0]} hardly moves"
        words.append(f"{joints}, which shows nothing of friction")
    condition, said = found.solution.condition, "; ".join(filter(None, words))
    number = f"condition number {condition:.3g}"
    if not said:
        fine = f"every base parameter and friction shows, {number} (unit columns)"
        return subject.ok("D09", fine)
    number = f" ({number}, unit columns)" if np.isfinite(condition) else ""
    words_of = f"insufficient excitation: {said}{number}"
    return [subject.say("D09", "warn", words_of, gate=True, remedy=REMEDY)]


def excitation(subject: Subject, still: Flags | None = None) -> Estimate:
    """Return what `estimate-bps` fits to this log alone.

    Args:
        still: (joints,) those that count as held.

    Raises:
        InputRejected: T04, T05, a log of which no equations can be made.
    """
    log, how = recording(subject.log), Reconstruction()
    found = reconstruct(log, how, subject.good)
    if still is not None:
        m = found.motion
        moving = replace(m, dq=np.where(still, 0.0, m.dq), ddq=np.where(still, 0.0, m.ddq))
        found = replace(found, motion=moving, even=None)
    columns = nominal_columns(log.robot)
    motions = ((log, found),)
    return estimate(equations_of(motions, with_cutoff(Recipe(how), motions), columns), columns)


_FIT = FitConfig()
_NEIGHBOURS = 32  # numerics: that are looked at; slow motion has many next to it in time
_OTHER_LOG = 1e9  # numerics: [s] between the clocks of two logs
_FEWEST = 100  # numerics: pairs of a joint; fewer say little


@dataclass(frozen=True, eq=False)
class Repeated:
    """Pairs of rows of one state; no row is in two of them."""

    data: Data
    first: Indices  # (pairs,) among the rows of all logs, one joint
    second: Indices

    @classmethod
    def of(cls, data: Data) -> Repeated:
        """Return the pairs, nearest first."""
        logs = []
        for one in data.logs:
            m, still = one.motion, _FIT.alike
            scaled = zip((m.q, m.dq, m.ddq), still, strict=True)
            logs.append(np.hstack([one.at_rows(x) / least for x, least in scaled]))
        log = np.repeat(np.arange(len(logs)), [len(own) for own in logs])
        time = np.concatenate([one.t for one in data.logs]) + _OTHER_LOG * log
        return cls(data, *nearest_pairs(np.vstack(logs), time, _FIT.near, _FIT.apart))

    @property
    def count(self) -> Array:
        """(joints,) pairs that count."""
        return np.asarray(self._counts.sum(axis=1), dtype=np.float64)

    def parts(self, left: Array) -> tuple[Array, Array]:
        """Return the mean squares of what pairs of a residual (rows,) share, and of the rest."""
        laid = np.concatenate(list(self.data.split(left)), axis=1)  # (joints, rows of one)
        one, other = laid[:, self.first], laid[:, self.second]
        counts, number = self._counts, np.where(self.count < _FEWEST, np.nan, self.count)
        common, differing = (
            np.square(0.5 * x).sum(axis=1, where=counts) / number
            for x in (one + other, one - other)
        )
        return common, differing

    def noise(self, left: Array) -> Array:
        """Return the variance (joints,) of a residual's noise; NaN of too few pairs."""
        return 2.0 * self.parts(left)[1]

    @property
    def _counts(self) -> Flags:
        """(joints, pairs)"""
        weighed = np.concatenate([one.weighed for one in self.data.logs], axis=1)
        return np.asarray(weighed[:, self.first] & weighed[:, self.second])


def nearest_pairs(state: Array, time: Array, near: float, apart: float) -> tuple[Indices, Indices]:
    """Return pairs of rows of one state, the nearest first; no row is in two of them.

    Args:
        state: (rows, coordinates), each in units of what is no motion of it.
        time: (rows,) [s]
        near: of the standard deviation of each coordinate, by which two rows may differ, or by a
            unit.
        apart: [s] between them, at least.
    """
    from scipy.spatial import cKDTree

    if len(state) < 2:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    scaled, count = state / np.maximum(state.std(axis=0), 1.0 / near), len(state)
    tree, most = cKDTree(scaled), min(_NEIGHBOURS, count)
    distance, other = tree.query(scaled, most, p=np.inf, distance_upper_bound=near)
    own, place = np.nonzero(np.isfinite(distance))
    partner, away = other[own, place], distance[own, place]
    kept = np.abs(time[own] - time[partner]) >= apart
    own, partner, away = own[kept], partner[kept], away[kept]
    free, chosen = np.ones(count, dtype=bool), []
    for k in np.argsort(away, kind="stable"):
        if free[own[k]] and free[partner[k]]:
            free[[own[k], partner[k]]] = False
            chosen.append(k)
    return own[chosen], partner[chosen]


def nominal_estimate(prepared: Prepared) -> Estimate:
    """Return the nominal model as `estimate-bps` fits it, on prepared rows."""
    return estimate(_equations(prepared.data, prepared.columns), prepared.columns)


def facts(left: Array, known: bool, prepared: Prepared, estimated: Estimate) -> Facts:
    """Return the errors of the nominal model on held-out motion, and the state of its floor.

    Args:
        left: (joints,) [N m] rms residual on held-out motion.
        known: the floor, by reference logs.
    """
    data, columns = prepared.data, prepared.columns
    judge = data if prepared.judge is None else prepared.judge
    spread = predicted_std(estimated, chain.from_iterable(_equations(judge, columns)))
    floor, confused = np.full(len(left), known), unresolved(estimated)
    if not known:
        # noise of the residual by rows of one state; 0 without any
        _, fit = fit_nominal(data, columns)
        noise = np.sqrt(np.nan_to_num(Repeated.of(data).noise(fit.left)))
        # what is predicted is off by the noise and by the deviations of the model
        floor = left <= _FIT.above * np.hypot(noise, spread)
        if not confused:
            offset = with_offsets(columns)
            confused = one_way(estimate(_equations(data, offset), offset))
    return Facts(left, judge.rms(judge.y), spread, confused, floor)


def _equations(data: Data, columns: Columns) -> list[LogEquations]:
    """Return the equations of each log in `columns`; rows may hold more terms of a friction law."""
    return [replace(log.equations, columns=columns) for log in data.logs]
