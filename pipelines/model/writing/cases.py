"""The second validation: the writing task in six control cases, and how far the tip strays in each.

    1  PD alone, eq. (23); and with parts of the model's torque on the reference ahead of it, eq. (24):
    2  friction   3  friction, inertia   4  friction, Coriolis   5  friction, gravity   6  all of it

Kostić et al. 2004, Section IV.C.5, Table IV, Figs. 15 and 16: the standard deviation of the tip's error over the task, in x, y, z.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.io.log import Array, ExperimentLog
from pipelines.model.motion import Reconstructed
from pipelines.model.rigid.geometry import serial_chain
from pipelines.model.rigid.kinematics import tip_position
from pipelines.model.writing.recognise import pen_down

__all__ = ["CASES", "Case", "TipStd", "TipTrack", "case_of", "measured_cases", "one_task", "tip_std", "track"]

CASES: tuple[tuple[str, ...], ...] = (
    (), ("friction",), ("friction", "inertia"), ("friction", "coriolis"), ("friction", "gravity"),
    ("friction", "inertia", "coriolis", "gravity"))
_POINTS = 2000  # of a drawn path
_SAME = 1e-6  # [rad] references of one task differ by less: the rounding of a recorder
_SHARED = 0.9  # of the longer log: recorders start and stop by hand, while the arm rests


@dataclass(frozen=True)
class TipStd:
    """Standard deviation of the tip's error [m] along the base frame's axes."""

    x: float
    y: float
    z: float

    @classmethod
    def of(cls, values: Iterable[float]) -> TipStd:
        x, y, z = map(float, values)
        return cls(x, y, z)

    @property
    def values(self) -> tuple[float, float, float]:
        return self.x, self.y, self.z


@dataclass(frozen=True)
class TipTrack:
    """The tip as wanted and as executed, thinned; (points, 3) [m]."""

    wanted: Array
    executed: Array
    drawn: Array | None = None  # (points,) 1 where it writes, 0 on the way between strokes; null: the reference is no text


@dataclass(frozen=True)
class Case:
    """One of the six."""

    case: int  # 1 to 6
    feedforward: tuple[str, ...]
    tip_error_std: TipStd
    tip_error_std_spread: TipStd | None  # standard deviation of it over the models drawn; null of a measurement
    origin: str  # "measured" | "simulated"
    logs: tuple[str, ...]  # measured: which; simulated: on whose controller
    track: TipTrack | None


def case_of(log: ExperimentLog) -> int | None:
    """Which of the six cases a log's controller is; None for any other."""
    law = log.controller.law if log.controller is not None else "unknown"
    parts: tuple[str, ...] | None = None
    if law == "pd":
        parts = ()
    elif law == "pd+feedforward" and log.controller is not None and log.controller.feedforward is not None:
        parts = log.controller.feedforward
    if parts is None:
        return None
    return next((k for k, case in enumerate(CASES, start=1) if set(case) == set(parts)), None)


def tip_std(log: ExperimentLog, q: Array) -> Array:
    """Standard deviation (3,) [m] of the tip's error where the joints moved along q (samples, joints). Table IV."""
    chain = serial_chain(log.robot)
    return np.asarray(np.std(tip_position(chain, q) - tip_position(chain, log["q_ref"]), axis=0))


def track(log: ExperimentLog, q: Array) -> TipTrack:
    """The path of the tip for Fig. 16."""
    chain, rows = serial_chain(log.robot), slice(None, None, max(1, -(-log.n_samples // _POINTS)))
    wanted = tip_position(chain, log["q_ref"])
    down = pen_down(wanted)
    return TipTrack(wanted[rows], tip_position(chain, q[rows]), None if down is None else down[rows].astype(np.float64))


def one_task(logs: Sequence[ExperimentLog], like: ExperimentLog) -> list[ExperimentLog]:
    """Those of `logs` that follow the reference of `like` with its gains: only they compare."""
    return [log for log in logs if log.robot_text == like.robot_text and _same_reference(log, like) and _same_gains(log, like)]


def _same_reference(one: ExperimentLog, two: ExperimentLog) -> bool:
    """Return whether both follow one reference, counted from where it sets out."""
    if not np.isclose(one.sample_time, two.sample_time, rtol=1e-9, atol=0.0):
        return False
    (a, first), (b, second) = ((log["q_ref"], _sets_out(log["q_ref"])) for log in (one, two))
    a, b = a[max(0, first - second):], b[max(0, second - first):]
    shared = min(len(a), len(b))
    return shared >= _SHARED * max(one.n_samples, two.n_samples) and bool(np.abs(a[:shared] - b[:shared]).max() <= _SAME)


def _sets_out(q_ref: Array) -> int:
    """The first sample at which a reference (samples, joints) is not where it was."""
    return int(np.argmax((np.abs(q_ref - q_ref[0]) > _SAME).any(axis=1)))


def _same_gains(one: ExperimentLog, two: ExperimentLog) -> bool:
    a, b = one.controller, two.controller
    if a is None or b is None:
        return a is b
    pairs = ((a.kp, b.kp), (a.kd, b.kd), (a.ki, b.ki))
    return all((x is None) == (y is None) and (x is None or y is None or np.allclose(x, y, rtol=1e-9, atol=0.0)) for x, y in pairs)


def measured_cases(pairs: Sequence[tuple[ExperimentLog, Reconstructed]], draw: bool = True) -> dict[int, Case]:
    """The cases that logs of one task show; of several logs of one case the mean square."""
    found: dict[int, list[tuple[ExperimentLog, Reconstructed]]] = {}
    for log, motion in pairs:
        if (case := case_of(log)) is not None:
            found.setdefault(case, []).append((log, motion))
    return {case: _case(case, some, draw) for case, some in sorted(found.items())}


def _case(case: int, pairs: Sequence[tuple[ExperimentLog, Reconstructed]], draw: bool) -> Case:
    each = np.array([tip_std(log, motion.motion.q) for log, motion in pairs])
    log, motion = pairs[0]
    return Case(case, CASES[case - 1], TipStd.of(np.sqrt(np.mean(each**2, axis=0))), None, "measured",
                tuple(log.name for log, _ in pairs), track(log, motion.motion.q) if draw else None)
