"""Find the window in which a push on the tip explains most of a residual.

window, other = push_of(rows, dictionary, arm, residual, config)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.diagnosis.candidates import Dictionary
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Rows
from pipelines.dynamics.arm import Arm
from pipelines.effects.base import Effect, Event
from pipelines.estimation.bootstrap import chi2_bound, upper_point
from pipelines.estimation.joint_table import Array, Indices, by_joint

__all__ = ["DIRECTIONS", "Window", "no_push", "push_of", "windows_of"]

_TOUCHED = 0.01  # numerics: of the largest effect of a push, from which a row is touched by it
DIRECTIONS = 3  # numerics: components of a force


@dataclass(frozen=True)
class Window:
    """A contact: when, in which log, with which force."""

    gain: float
    effect: Effect
    amplitudes: Array
    log: int
    touched: Indices  # of the rows of each joint, those within it
    rows: slice  # of each joint, those of its log
    push: Array  # (joints, rows of its log) what it explains there, in units of the noise
    free: float = 0.0  # gain of any torque of each joint over the same time, less what that costs


def _standing_out(
    rows: Rows, dictionary: Dictionary, arm: Arm, residual: Sequence[Array], config: DiagnosisConfig
) -> Window | None:
    """Return the best window on a residual (rows of each joint), None where it may be noise.

    An event has one moment: its window exceeds the residual at all other times of the session. The
    largest gain of m independent windows of white noise has a known law; the excess at other times
    is measured by the largest gain in each half of a log without its best window (`upper_point`).
    No model of a torque is exact: a push has to be more than a share of the torque at its moment.
    """
    best, gains = None, list[float]()
    for log, one in enumerate(rows.data.logs):
        windows = windows_of(rows, dictionary, arm, residual, log)
        if not windows:
            continue
        there = max(windows, key=lambda window: window.gain)
        best = there if best is None or there.gain > best.gain else best
        others = [w for w in windows if not np.isin(w.touched, there.touched).any()]
        middle = there.rows.start + one.rows // 2
        for half in (False, True):
            own = [w.gain for w in others if (w.touched.mean() > middle) == half]
            gains.append(max(own, default=0.0))
    if best is None:
        return None
    power = sum(float(y[best.touched] @ y[best.touched]) for y in rows.y)
    bound = chi2_bound(config.alpha / config.event_candidates, DIRECTIONS)
    usual = max(bound, upper_point(gains, config.alpha))
    if best.gain < config.relevance**2 * power or best.gain <= usual:
        return None
    return replace(best, free=_free(rows, best, residual))


def push_of(
    rows: Rows, dictionary: Dictionary, arm: Arm, residual: Sequence[Array], config: DiagnosisConfig
) -> tuple[Window | None, str]:
    """Return the push that exceeds all else, or in words an event that is not a push.

    A push on the tip acts on the joints in one proportion: where any other torque explains
    relevantly more, something else happened at that moment.
    """
    window = _standing_out(rows, dictionary, arm, residual, config)
    if window is None or window.free - window.gain < config.relevance * window.free:
        return window, ""
    return None, no_push(rows, window)


def no_push(rows: Rows, window: Window) -> str:
    """Return in words that something else than a push happened in a window."""
    log = rows.data.logs[window.log - rows.data.first].log.name
    start = getattr(window.effect, "start", 0.0)
    return f"what happened {start:.2f} s into {log} is not what a push on the tip does"


def _free(rows: Rows, window: Window, residual: Sequence[Array]) -> float:
    """Return the gain of any torque of each joint over the time of a push.

    Less what its further numbers cost (Schwarz 1978).
    """
    one = rows.data.logs[window.log - rows.data.first]
    assert isinstance(window.effect, Event)
    course = window.effect.course(one.motion.t - one.motion.t[0])
    columns = one.lay(np.repeat(course[:, None], rows.n_joints, axis=1))
    weight = by_joint(rows.weight, rows.joint, rows.n_joints)
    gain = 0.0
    for column, w, r in zip(columns, weight, residual, strict=True):
        x = column * w[window.rows]
        gain += float(x @ r[window.rows]) ** 2 / max(float(x @ x), 1e-300)
    return gain - max(rows.n_joints - DIRECTIONS, 0) * float(np.log(rows.count))


def windows_of(
    rows: Rows, dictionary: Dictionary, arm: Arm, residual: Sequence[Array], log: int
) -> list[Window]:
    """Return windows of a log in which the residual is large, with what a push explains there."""
    event = None if dictionary.event is None else dictionary.event.shapes[0]
    if not isinstance(event, Event):
        return []
    data, one = rows.data, rows.data.logs[log]
    first = sum(other.rows for other in data.logs[:log])
    weight = by_joint(rows.weight, rows.joint, rows.n_joints)
    own, here = (np.stack([v[first : first + one.rows] for v in p]) for p in (residual, weight))
    full = np.stack([np.interp(one.motion.t, one.t, v) for v in own / here], axis=1)
    found = list[Window]()
    for shape in event.promising(one.motion, arm, full):
        columns = one.lay(shape.columns(one.motion, arm)) * here
        x = columns.reshape(len(columns), -1)
        amplitudes = np.asarray(np.linalg.lstsq(x.T, own.ravel(), rcond=1e-6)[0], np.float64)
        gain = float((x @ own.ravel()) @ amplitudes)
        size = np.abs(columns).max(axis=(0, 1))
        touched = np.flatnonzero(size > _TOUCHED * size.max()) + first
        push = np.tensordot(amplitudes, columns, 1)
        place = slice(first, first + one.rows)
        if len(touched):
            found.append(Window(gain, shape, amplitudes, data.first + log, touched, place, push))
    return found
