"""One "frf" log as signals for spectra: v, the plant's input, the deviation from the reference, torque; reversal left out.

    turned = turned_joint(log)
    turned.stretches[0].signals        (samples, 3 + joints): v, u, q - q_ref, τ of the joint; q - q_ref of all others

Kostić et al. 2004, Section IV.D. The joint turns slowly, so that friction does not stick, and at constant speed, so that the
mean of its friction is a constant that no spectrum shows. Where it starts, reverses and stops, friction jumps: those samples
are left out, and so are the first after them, until the loop has settled. The reference itself is subtracted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.io.limits import GAP_LIMIT, LARGEST_JITTER, SHORTEST, percent
from pipelines.io.log import Array, Controller, ExperimentLog
from pipelines.quality.segments import Usable, usable
from pipelines.signal.resample import through

__all__ = ["INPUT", "POSITION", "TORQUE", "Stretch", "Turned", "TurningConfig", "V", "excitation_period", "turned_joint"]

V, INPUT, POSITION, TORQUE = range(4)  # channels of a stretch; behind them the positions of the other joints


@dataclass(frozen=True)
class TurningConfig:
    """Limits of constant speed and of a repeated excitation.

    Attributes:
        plateau: of the largest speed, within which a reference is constant: the ramps of a trapezoid are left out
        wandering: the same of a speed that is reconstructed, which the excitation swings
        smooth: [s] over which it is reconstructed: two periods of the lowest mode looked for (modes.BAND)
        settle: [s] after the speed has become constant: a position loop of 1 Hz is within 5 % after three time constants
        shortest: [s] of a stretch: four periods of the lowest mode, for a mean over segments
        still: [rad/s] a slower joint does not turn: a turn in two hours
        same: of the largest v, two periods are equal: rounding of a text with ten digits
        lost: of the samples; beyond, what is filled in weighs as much as what was recorded (-20 dB)
        line: of the strongest line's amplitude, below which a line does not count: -60 dB, above leakage and rounding
    """

    plateau: float = 0.02
    wandering: float = 0.2
    smooth: float = 0.5
    settle: float = 0.5
    shortest: float = 1.0
    still: float = 1e-3
    same: float = 1e-9
    lost: float = 0.1
    line: float = 1e-3


_CONFIG = TurningConfig()


@dataclass(frozen=True, eq=False)
class Stretch:
    """Samples at constant speed, without a gap."""

    start: int  # of the log
    stop: int
    direction: int  # 1, -1; 0 where the joint does not turn
    signals: Array  # (samples, 3 + joints)


@dataclass(frozen=True, eq=False)
class Turned:
    """The experiment of one log."""

    name: str
    joint: int  # 1-based
    posture: Array  # (n,) [rad]; the joint's own angle is where it began
    sample_time: float  # [s]
    quantity: str  # "r" [rad/s^2] under computed torque, "tau" [N m] under PD: the input of the plant
    controller: Controller | None
    revolute: bool
    speed: float  # [rad/s] at which it turned; 0: it did not
    swing: float  # [rad/s] std of its speed about that, by the excitation
    period: int | None  # [samples] of v; None: it does not repeat
    stretches: tuple[Stretch, ...]
    whole: Array  # (samples, 3 + joints) the log with its reversal
    left_out: float  # share of the samples
    filled: float  # share of the samples that were lost, and filled alike in all channels
    held: bool  # the input is held from one sample to the next; False: sampled at some instant between two, as position is
    torque_held: bool  # the same of the torque
    mean_input: tuple[float | None, float | None]  # of the input, forwards and backwards: what friction and load leave

    @property
    def rate(self) -> float:
        return 1.0 / self.sample_time

    @property
    def friction_left(self) -> float | None:
        """Half of what the mean input differs between the directions: friction that nothing compensated."""
        forwards, backwards = self.mean_input
        return None if forwards is None or backwards is None else 0.5 * (forwards - backwards)

    @property
    def load(self) -> float:
        """|mean torque of both directions| over its deviation from the mean of each: what gravity leaves; 0 where it is unknown."""
        ways = [[s.signals[:, TORQUE] for s in self.stretches if s.direction == way] for way in (1, -1)]
        if not all(ways):
            return 0.0
        sides = [np.concatenate(own) for own in ways]
        means = [float(side.mean()) for side in sides]
        deviation = float(np.sqrt(np.mean(np.concatenate([side - side.mean() for side in sides]) ** 2)))
        return abs(0.5 * sum(means)) / max(deviation, 1e-300)

    @property
    def lines(self) -> tuple[int, ...]:
        """Harmonics of the period that v holds; none where it does not repeat."""
        if self.period is None:
            return ()
        size = np.abs(np.fft.rfft(np.nan_to_num(self.whole[:self.period, V])))
        return tuple(np.flatnonzero(size > _CONFIG.line * size.max()).tolist())

    def settings(self) -> tuple[object, ...]:
        """What two logs must share to be averaged, but for their posture."""
        c = self.controller
        gains = () if c is None or c.kp is None or c.kd is None else (float(c.kp[self.joint - 1]), float(c.kd[self.joint - 1]))
        model = "" if c is None or c.model is None else c.model
        law = (None, None) if c is None else (c.delay, c.velocity)
        return self.joint, self.quantity, self.sample_time, self.period, gains, *law, model


def turned_joint(log: ExperimentLog) -> Turned:
    """The excited joint's signals at constant speed.

    Raises:
        InputRejected: S01, a signal or attribute is missing; T05, uneven sampling; T03, too many samples lost; D09, v does not
            excite; D04, input or position is constant; T08, nothing of it lasts at constant speed.
    """
    joint, quantity = _described(log)
    good = usable(log)
    if good.time.jitter > LARGEST_JITTER:
        raise InputRejected("T05", f"the sampling interval varies by {percent(good.time.jitter)} rms: a spectrum needs even "
                            "sampling", where=log.source or log.name, remedy="sample by a timer and record again")
    mended, j = good.log, joint - 1
    v = mended["v"][:, j]
    if not np.isfinite(v).any() or float(np.nanstd(v)) <= 0.0:
        raise InputRejected("D09", f"v does not excite joint {joint}", where=log.source or log.name,
                            remedy="inject a multisine or noise at that joint (design-excitation --experiment frf plans it)")
    for name in (quantity, "q"):
        channel = mended[name][:, j]
        if not np.isfinite(channel).any() or float(np.nanstd(channel)) <= 0.0:
            raise InputRejected("D04", f"{name} of joint {joint} is constant while v excites it", where=log.source or log.name,
                                remedy="look at this channel in the recording")
    position = mended.q - (mended["q_ref"] if "q_ref" in mended else np.column_stack([_straight(q) for q in mended.q.T]))
    signals = np.column_stack([v, mended[quantity][:, j], position[:, j], mended.tau[:, j], np.delete(position, j, axis=1),
                               mended.q[:, j], mended["dq_ref"][:, j] if "dq_ref" in mended else mended.q[:, j]])
    even = _even(good, signals, log.sample_time)
    if even.filled > _CONFIG.lost:
        raise InputRejected("T03", f"{percent(even.filled)} of the samples were lost: between them no spectrum is known",
                            where=log.source or log.name, remedy="give the recorder more priority, or record fewer signals")
    signals, q = even.signals[:, :-2], even.signals[:, -2]
    speed = even.signals[:, -1] if "dq_ref" in mended else _speed(q, log.sample_time)
    width = _CONFIG.plateau if "dq_ref" in mended else _CONFIG.wandering
    stretches = tuple(_stretches(even.inside, signals, speed, width, log.sample_time))
    if "q_ref" not in mended:
        stretches = tuple(replace(s, signals=_levelled(s.signals, q[s.start:s.stop])) for s in stretches)
    if not stretches:
        raise InputRejected("T08", f"joint {joint} never turns at constant speed for {_CONFIG.settle + _CONFIG.shortest:g} s",
                            where=log.source or log.name,
                            remedy="let it turn slowly there and back, 20 s each way or more")
    top = float(np.nanmax(np.abs(speed)))
    kept = sum(s.stop - s.start for s in stretches)
    posture = log.posture if log.posture is not None else np.asarray(np.nanmedian(mended.q, axis=0))
    return Turned(log.name, joint, posture, log.sample_time, quantity, log.controller,
                  log.robot.joints[j].revolute, top if top > _CONFIG.still else 0.0, _swing(stretches, log.sample_time),
                  excitation_period(even.recorded_v, log.period, log.sample_time), stretches, signals, 1.0 - kept / len(signals),
                  even.filled, quantity == "r" or log.torque != "measured", log.torque != "measured",
                  (_mean(stretches, 1), _mean(stretches, -1)))


@dataclass(frozen=True, eq=False)
class _Even:
    """Samples at even instants."""

    signals: Array  # (instants, channels); NaN in gaps that are too long
    inside: npt.NDArray[np.bool_]  # (instants,) in a run, short gaps filled
    recorded_v: Array  # (instants,) NaN wherever it was not recorded
    filled: float  # share of the instants inside


def _even(good: Usable, signals: Array, sample_time: float) -> _Even:
    """Samples laid where their stamps say, one in a sample time; short gaps filled by a cubic spline through the stamps.

    The filling is linear, and alike in all channels: on average it filters all of them alike, and the quotient of two responses to
    v stays what it was; what it adds is noise, and shows as such. Samples that are laid side by side instead speed time up.
    """
    steps = np.clip(np.rint(np.diff(good.log.t) / sample_time), 1, GAP_LIMIT + 2)
    place = np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)
    even = np.full((place[-1] + 1, signals.shape[1]), np.nan)
    even[place] = signals
    inside, recorded_v, filled = np.zeros(len(even), dtype=bool), even[:, V].copy(), 0
    own = [*range(TORQUE + 1), -2, -1]  # what another joint's encoder lacks is filled, too, but loses nothing of this one
    for run in good.runs:
        at = np.arange(place[run.start], place[run.stop - 1] + 1)
        known = np.isfinite(even[at]).all(axis=1)
        if known.sum() < SHORTEST:
            continue
        lost = int((~np.isfinite(even[np.ix_(at, own)]).all(axis=1)).sum())
        if not known.all():
            even[at[~known]] = through(at[known], even[at[known]], at[~known])
        inside[at], filled = True, filled + lost
    return _Even(even, inside, recorded_v, filled / max(int(inside.sum()), 1))


def _described(log: ExperimentLog) -> tuple[int, str]:
    """The joint, and which signal is the input of its plant."""
    where = log.source or log.name
    if log.joint is None:
        raise InputRejected("S01", "the log does not say which joint was excited", where=where, remedy="set attribute joint")
    if "v" not in log:
        raise InputRejected("S01", "an frf log without its excitation v", where=where, remedy="record v")
    law = log.controller.law if log.controller is not None else "unknown"
    if law.startswith("pd"):
        return log.joint, "tau"
    if "r" not in log:
        raise InputRejected("S01", f"an frf log under '{law}' without r, the input of the plant", where=where,
                            remedy="record r, the acceleration asked of the model (Kostić et al. 2004, eq. (25)-(27)); under PD "
                                   "say so in /controller, torque is the input then")
    return log.joint, "r"


def _straight(q: Array) -> Array:
    """The slow part of a position where no reference is known: for the whole log with its reversal alone."""
    width = max(3, len(q) // 50)
    known = np.where(np.isfinite(q), q, np.nanmean(q))
    padded = np.concatenate([np.full(width, known[0]), known, np.full(width, known[-1])])
    total = np.cumsum(padded)
    middle = (total[2 * width:] - total[:-2 * width]) / (2.0 * width)
    return np.asarray(middle)


def _levelled(signals: Array, q: Array) -> Array:
    """With the position less the straight line through it: a filter would take of the excitation as well."""
    t = np.linspace(-1.0, 1.0, len(q))
    out = signals.copy()
    out[:, POSITION] = q - q.mean() - t * float(t @ q / (t @ t))
    return out


def _speed(q: Array, sample_time: float) -> Array:
    """Central differences over half a second."""
    half = max(1, round(0.5 * _CONFIG.smooth / sample_time))
    index = np.arange(len(q))
    high, low = np.minimum(index + half, len(q) - 1), np.maximum(index - half, 0)
    return np.asarray((q[high] - q[low]) / ((high - low) * sample_time))


def _stretches(inside: npt.NDArray[np.bool_], signals: Array, speed: Array, width: float, sample_time: float) -> list[Stretch]:
    top = float(np.nanmax(np.abs(speed)))
    if top > _CONFIG.still:
        directions: npt.NDArray[np.int8] = np.where(np.abs(np.abs(speed) - top) <= width * top, np.sign(speed), 2).astype(np.int8)
    else:
        directions = np.zeros(len(speed), dtype=np.int8)
    directions[~(inside & np.isfinite(signals).all(axis=1))] = 2
    edges = np.concatenate([[0], np.flatnonzero(np.diff(directions)) + 1, [len(speed)]])
    settle, shortest = round(_CONFIG.settle / sample_time), round(_CONFIG.shortest / sample_time)
    return [Stretch(int(a) + settle, int(b), int(directions[a]), signals[a + settle:b])
            for a, b in pairwise(edges) if directions[a] != 2 and b - a >= settle + shortest]


def excitation_period(v: Array, declared: float | None, sample_time: float) -> int | None:
    """Samples after which v (samples,) repeats itself exactly; None where it does not within half of the log.

    The declared period is believed where v keeps it; else the peak of the autocorrelation is tried.
    """
    if declared is not None:
        samples = round(declared / sample_time)
        if 2 <= samples <= len(v) // 2 and abs(samples * sample_time - declared) < 1e-6 * declared and _repeats(v, samples):
            return samples
    known = np.where(np.isfinite(v), v, 0.0)
    size = 1 << (2 * len(v) - 1).bit_length()
    spectrum = np.fft.rfft(known - known.mean(), size)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, size)[:len(v) // 2 + 1]
    overlap = (len(v) - np.arange(len(correlation))) / len(v)
    candidates = np.flatnonzero(correlation > 0.9 * overlap * correlation[0])
    return next((int(k) for k in candidates if k >= 2 and _repeats(v, int(k))), None)


def _repeats(v: Array, period: int) -> bool:
    difference = np.abs(v[period:] - v[:-period])
    known = difference[np.isfinite(difference)]
    return bool(known.size and known.max() <= _CONFIG.same * np.nanmax(np.abs(v)))


def _swing(stretches: tuple[Stretch, ...], sample_time: float) -> float:
    """Std of the speed by differences over four samples, which lets less of the encoder's steps through."""
    speeds = [(s.signals[4:, POSITION] - s.signals[:-4, POSITION]) / (4.0 * sample_time) for s in stretches]
    return float(np.sqrt(np.mean(np.concatenate([(v - v.mean()) ** 2 for v in speeds]))))


def _mean(stretches: tuple[Stretch, ...], direction: int) -> float | None:
    own = [s.signals[:, INPUT] for s in stretches if s.direction == direction]
    return float(np.mean(np.concatenate(own))) if own else None
