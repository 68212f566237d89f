"""Store thresholds of one diagnosis, and take them for the logs of another.

    Calibration(origin_of(...), conditions_of(prepared), ..., bounds_of(families, gain, own), ...)
    refuse_calibration(made, prepared, families, "twin")    C02 where it is not for these logs
    thresholds_of(made, families, data, given)              for these families and so many rows
    following_of(made, prepared, given)                     of what has no name

What an arm in order shows of a cause depends on how it is driven, sampled and moved. A calibration therefore holds for the same
robot and controller at the same rate, in experiments of the same kind that move about as fast; nothing else is asked of the logs.
With reference logs it holds for these alone: what they show where nothing changed is not found again.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from pipelines import __version__
from pipelines.errors import UsageError
from pipelines.log.canonical import digest_of
from pipelines.log.derive import recording
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.model_file import Source, model_text
from pipelines.log.results import encode, json_text
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.floor.calibration import Calibration, CauseBound, Conditions, Origin
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.floor.wide import WideCause
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Family, place_of

__all__ = ["bounds_of", "conditions_of", "following_of", "origin_of", "refuse_calibration", "thresholds_of"]

_ALIKE = 1.5  # times the speed, acceleration or range of a joint
_OTHER = 1.5  # times the thresholds, for other motion: of four excitations nine of ten were less than 1.8 times the first's
_AGAIN_SAME = 1.05  # times speed, acceleration and range of a joint, within which a motion is the same again
_SAME = 0.02  # of the rate of rows and of the low-pass
_AGAIN = "diagnose without --calibration, which makes one for these logs"


def thresholds_of(made: Calibration, families: Sequence[Family], prepared: Prepared, given: bool) -> Thresholds:
    """For these families; longer logs give chance more to gain, shorter ones are taken to give as much.

    Args:
        given: whether the calibration was stored; for another motion than its own it is taken with care.
    """
    there = {(one.cause, one.joint): one for one in made.causes}
    own = [there[family.cause, family.joint] for family in families]
    longer = np.maximum(1.0, _rows(prepared.data) / made.conditions.rows)
    if given and not _same_motion(made.conditions, conditions_of(prepared)):
        longer = _OTHER * longer
    scale = np.array([longer.max() if one.joint is None else longer[one.joint - 1] for one in families])
    several, causes = _on_several(made, families)
    wide = made.wide and replace(made.wide, longer=float(longer.max()), causes=causes)
    origin = f"{made.origin.replicas} replicas of the twin{', stored by an earlier diagnosis' if given else ''}"
    return Thresholds(scale * [one.gain for one in own], scale * [one.own for one in own], origin, made.weight,
                      tuple(family.joint for family in families), wide, several)


def following_of(made: Calibration, prepared: Prepared, given: bool) -> Array | None:
    """(joints,) how far an arm in order follows the motion of its joints: in shorter logs chance follows farther, as 1/rows.

    Args:
        given: as in `thresholds_of`.
    """
    if made.following is None:
        return None
    shorter = np.maximum(1.0, made.conditions.rows / np.maximum(_rows(prepared.data), 1.0))
    other = _OTHER if given and not _same_motion(made.conditions, conditions_of(prepared)) else 1.0
    return np.asarray(other * shorter * made.following)


def _on_several(made: Calibration, families: Sequence[Family]) -> tuple[tuple[int, ...], tuple[WideCause, ...]]:
    """Which of `families` act on several joints, and what is stored of them: some may be left out since."""
    if made.wide is None:
        return (), ()
    whole = [one.cause for one in made.causes if one.joint is None]
    stored = dict(zip(whole, (one for one in made.wide.causes if one.joint is None), strict=True))
    stored |= {one.place: one for one in made.wide.causes if one.place}
    here = {place: stored[name] for place, family in enumerate(families)
            if (name := place_of(family.cause, family.joint)) in stored}
    return tuple(here), tuple(here.values())


def _same_motion(one: Conditions, other: Conditions) -> bool:
    sizes = (np.array([getattr(each, name) for name in ("speed", "acceleration", "span")]) for each in (one, other))
    before, after = sizes
    return bool(((before <= _AGAIN_SAME * after) & (after <= _AGAIN_SAME * before)).all())


def bounds_of(families: Sequence[Family], gain: Array, own: Array) -> tuple[CauseBound, ...]:
    """As they are stored; `gain`, `own` (families,)."""
    return tuple(CauseBound(one.cause, one.joint, float(a), float(b)) for one, a, b in zip(families, gain, own, strict=True))


def origin_of(kind: Literal["twin", "reference logs"], logs: Sequence[ExperimentLog], model: Arm | None,
              chosen: DiagnosisSettings) -> Origin:
    sources = tuple(Source(log.name, digest_of(recording(log)), log.experiment, log.role) for log in logs)
    digest = "" if model is None else _digest(model_text(model.to_model()))
    return Origin(kind, sources, digest, 0 if model is None else chosen.replicas, chosen.seed, tuple(sorted(chosen.without)),
                  __version__, np.__version__)


def conditions_of(prepared: Prepared) -> Conditions:
    """Of the logs that are fitted."""
    data, first = prepared.data, prepared.data.logs[0]
    logs = [one.log for one in data.logs]
    motions = [one.motion for one in data.logs]
    dq, ddq = (np.concatenate([getattr(motion, name) for motion in motions]) for name in ("dq", "ddq"))
    q = np.concatenate([motion.q for motion in motions])
    return Conditions(
        _digest(first.log.robot_text), tuple(sorted({_controller(log) for log in logs})),
        tuple(sorted({log.experiment for log in logs})), tuple(place_of(law.name, law.joint) for law in prepared.columns.laws),
        first.log.sample_time, float(np.median(np.diff(first.t))), prepared.recipe.cutoff_hz, _rows(data),
        np.sqrt(np.mean(dq**2, axis=0)), np.sqrt(np.mean(ddq**2, axis=0)), np.ptp(q, axis=0))


def _rows(data: Data) -> Array:
    """(joints,) how many count."""
    return np.asarray(np.bincount(data.joint[data.counts], minlength=data.n_joints), dtype=np.float64)


def _controller(log: ExperimentLog) -> str:
    """Its digest; of a log without one the words of that."""
    return "unknown" if log.controller is None else _digest(json_text(encode(log.controller)[0]))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def refuse_calibration(made: Calibration, prepared: Prepared, families: Sequence[Family], kind: Literal["twin", "reference logs"],
                       reference: Sequence[ExperimentLog] = ()) -> None:
    """Raise where the calibration is not for these logs.

    Raises:
        UsageError: C02, with all that differs.
    """
    if made.origin.kind != kind:
        words = {"twin": "was made without reference logs", "reference logs": "was made with reference logs"}
        raise _unfit(f"{words[made.origin.kind]}, and here {'are none' if kind == 'twin' else 'are some'}")
    if kind == "reference logs" and {one.sha256 for one in made.origin.logs} != {digest_of(recording(log)) for log in reference}:
        raise _unfit(f"is of other reference logs: {', '.join(sorted(one.name for one in made.origin.logs))}")
    known = {(one.cause, one.joint) for one in made.causes}
    missing = sorted({family.cause for family in families if (family.cause, family.joint) not in known})
    if missing and kind == "twin":
        raise _unfit(f"does not know {', '.join(missing)}", f"leave them out with --without, or {_AGAIN}")
    if differing := list(_differing(made.conditions, conditions_of(prepared), kind == "twin")):
        raise _unfit(f"is not for these logs: {'; '.join(differing)}")


def _unfit(why: str, remedy: str = _AGAIN) -> UsageError:
    return UsageError("C02", f"the calibration {why}", where="--calibration", remedy=remedy)


def _differing(then: Conditions, now: Conditions, moved: bool) -> Iterator[str]:
    """In words, what logs of now have otherwise; `moved`: how they move counts as well."""
    if then.robot != now.robot:
        yield "it is of another robot, or of another description of it"
        return  # nothing else can be compared
    if moved and then.controllers != now.controllers:
        yield "another controller"
    if moved and then.experiments != now.experiments:
        yield f"experiments {', '.join(now.experiments)}, it is of {', '.join(then.experiments)}"
    if then.laws != now.laws:
        yield "friction laws of another model"
    if not np.isclose(then.sample_time, now.sample_time, rtol=1e-6, atol=0.0):
        yield f"sampled every {1e3 * now.sample_time:g} ms, it is of {1e3 * then.sample_time:g} ms"
    before, after = (np.inf if one.cutoff_hz is None else one.cutoff_hz for one in (then, now))
    if not (before == after or (np.isfinite(before) and abs(before - after) <= _SAME * before)):
        yield f"low-pass at {after:g} Hz, its own is at {before:g} Hz (--filter {before:g})"
    elif abs(now.row_time / then.row_time - 1.0) > _SAME:
        yield f"an equation every {1e3 * now.row_time:.3g} ms, its own {1e3 * then.row_time:.3g} ms (--decimate)"
    for name, unit in (("speed", "rad/s"), ("acceleration", "rad/s^2"), ("span", "rad")) if moved else ():
        for joint, (a, b) in enumerate(zip(getattr(then, name), getattr(now, name), strict=True)):
            if not a / _ALIKE <= b <= _ALIKE * a:
                yield f"{name} of joint {joint + 1} is {b:.2g} {unit}, it is of {a:.2g} {unit}"
