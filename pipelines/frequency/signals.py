"""Take one "frf" log as signals for spectra: v, the plant's input, position, torque; no reversal.

    turned = turned_joint(log)
    turned.stretches[0].signals     (samples, 3 + joints): v, u, q - q_ref, τ; q - q_ref of others

Kostić et al. 2004, Section IV.D. The joint turns slowly, so that friction does not stick, and at
constant speed, so that the mean of its friction is a constant that no spectrum shows. Where it
starts, reverses and stops, friction jumps: those samples are left out, and so are the first after
them, until the loop has settled. The reference itself is subtracted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.estimation.grids import through
from pipelines.frequency.config import LinesConfig, TurningConfig
from pipelines.frequency.spectra import Array, Mask
from pipelines.io.limits import GAP_LIMIT, LARGEST_JITTER, SHORTEST, percent
from pipelines.io.log import Controller, ExperimentLog
from pipelines.quality.segments import Usable, usable

__all__ = ["INPUT", "POSITION", "TORQUE", "Stretch", "Turned", "V", "excitation_period"]
__all__ += ["turned_joint"]

V, INPUT, POSITION, TORQUE = range(4)  # channels of a stretch; behind them the other positions

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
    quantity: str  # "r" [rad/s^2] under computed torque, "tau" [N m] under PD: the plant's input
    controller: Controller | None
    revolute: bool
    speed: float  # [rad/s] at which it turned; 0: it did not
    swing: float  # [rad/s] std of its speed about that, by the excitation
    period: int | None  # [samples] of v; None: it does not repeat
    stretches: tuple[Stretch, ...]
    whole: Array  # (samples, 3 + joints) the log with its reversal
    filled: float  # share of the samples that were lost, and filled alike in all channels
    held: bool  # the input is held over a sample; False: sampled at some instant, as position is
    torque_held: bool  # the same of the torque

    @property
    def rate(self) -> float:
        """Samples a second [Hz]."""
        return 1.0 / self.sample_time

    @property
    def left_out(self) -> float:
        """Share of the samples."""
        return 1.0 - sum(len(s.signals) for s in self.stretches) / len(self.whole)

    def _ways(self, channel: int) -> list[Array]:
        """Return a channel forwards and backwards; none where the joint turned one way only."""
        ways = [
            [s.signals[:, channel] for s in self.stretches if s.direction == w] for w in (1, -1)
        ]
        return [np.concatenate(own) for own in ways] if all(ways) else []

    @property
    def friction_left(self) -> float | None:
        """Half of what the mean input differs between directions: friction not compensated."""
        ways = self._ways(INPUT)
        return 0.5 * float(ways[0].mean() - ways[1].mean()) if ways else None

    @property
    def load(self) -> float:
        """|mean torque of both directions| over its deviation: what gravity leaves; 0: unknown."""
        ways = self._ways(TORQUE)
        if not ways:
            return 0.0
        rest = np.concatenate([side - side.mean() for side in ways])
        mean = 0.5 * float(ways[0].mean() + ways[1].mean())
        return abs(mean) / max(float(np.sqrt(np.mean(rest**2))), 1e-300)

    @property
    def lines(self) -> tuple[int, ...]:
        """Harmonics of the period that v holds; none where it does not repeat."""
        if self.period is None:
            return ()
        size = np.abs(np.fft.rfft(np.nan_to_num(self.whole[: self.period, V])))
        return tuple(np.flatnonzero(size > LinesConfig().excited * size.max()).tolist())

    def settings(self) -> tuple[object, ...]:
        """Return what two logs must share to be averaged, but for their posture."""
        own = (self.joint, self.quantity, self.sample_time, self.period, self.lines)
        c = self.controller
        if c is None:
            return own
        gains = [None if k is None else float(k[self.joint - 1]) for k in (c.kp, c.kd)]
        gains = gains if None not in gains else []
        return (*own, *gains, c.delay, c.velocity, c.model or "")


def turned_joint(log: ExperimentLog) -> Turned:
    """Return the excited joint's signals at constant speed.

    Raises:
        InputRejected: S01, a signal or attribute is missing; T05, uneven sampling; T03, too many
            samples lost; D09, v does not excite; D04, input or position is constant; T08, nothing
            of it lasts at constant speed.
    """
    joint, quantity = _described(log)
    good, where, j = usable(log), log.source or log.name, joint - 1
    mended = good.log
    _refuse_silent(good, joint, quantity, where)
    position = mended.q - (mended["q_ref"] if "q_ref" in mended else _slow(mended.q))
    speed = mended["dq_ref"][:, j] if "dq_ref" in mended else mended.q[:, j]
    own = [mended["v"][:, j], mended[quantity][:, j], position[:, j], mended.tau[:, j]]
    columns = [*own, np.delete(position, j, axis=1), mended.q[:, j], speed]
    signals, inside, filled = _even(good, np.column_stack(columns), log.sample_time)
    if filled > _CONFIG.lost:
        words = f"{percent(filled)} of the samples were lost: between them no spectrum is known"
        remedy = "give the recorder more priority, or record fewer signals"
        raise InputRejected("T03", words, where, remedy=remedy)
    signals, q, speed = signals[:, :-2], signals[:, -2], signals[:, -1]
    width = _CONFIG.plateau
    if "dq_ref" not in mended:
        speed, width = _speed(q, log.sample_time), _CONFIG.wandering
    stretches = _stretches(inside, signals, speed, width, log.sample_time)
    if "q_ref" not in mended:
        stretches = [
            replace(s, signals=_levelled(s.signals, q[s.start : s.stop])) for s in stretches
        ]
    if not stretches:
        seconds = _CONFIG.settle + _CONFIG.shortest
        words = f"joint {joint} never turns at constant speed for {seconds:g} s"
        remedy = "let it turn slowly there and back, 20 s each way or more"
        raise InputRejected("T08", words, where, remedy=remedy)
    top = float(np.nanmax(np.abs(speed)))
    posture = np.nanmedian(mended.q, axis=0) if log.posture is None else log.posture
    recorded_v = np.full(len(signals), np.nan)
    recorded_v[_places(good, log.sample_time)] = mended["v"][:, j]
    return Turned(
        name=log.name,
        joint=joint,
        posture=np.asarray(posture),
        sample_time=log.sample_time,
        quantity=quantity,
        controller=log.controller,
        revolute=log.robot.joints[j].revolute,
        speed=top if top > _CONFIG.still else 0.0,
        swing=_swing(stretches, log.sample_time),
        period=excitation_period(recorded_v, log.period, log.sample_time),
        stretches=tuple(stretches),
        whole=signals,
        filled=filled,
        held=quantity == "r" or log.torque != "measured",
        torque_held=log.torque != "measured",
    )


def _described(log: ExperimentLog) -> tuple[int, str]:
    """Return the joint, and which signal is the input of its plant."""

    def missing(words: str, remedy: str) -> InputRejected:
        return InputRejected("S01", words, where=log.source or log.name, remedy=remedy)

    if log.joint is None:
        raise missing("the log does not say which joint was excited", "set attribute joint")
    if "v" not in log:
        raise missing("an frf log without its excitation v", "record v")
    law = log.controller.law if log.controller is not None else "unknown"
    if law.startswith("pd"):
        return log.joint, "tau"
    if "r" not in log:
        remedy = "record r, the acceleration asked of the model (Kostić et al. 2004, eq. (25)-(27))"
        remedy += "; under PD say so in /controller, torque is the input then"
        raise missing(f"an frf log under '{law}' without r, the input of the plant", remedy)
    return log.joint, "r"


def _refuse_silent(good: Usable, joint: int, quantity: str, where: str) -> None:
    """Refuse uneven sampling, T05, v that does not excite, D09, and a constant signal, D04."""
    if good.time.jitter > LARGEST_JITTER:
        jitter = percent(good.time.jitter)
        words = f"the sampling interval varies by {jitter} rms: a spectrum needs even sampling"
        raise InputRejected("T05", words, where, remedy="sample by a timer and record again")
    if _constant(good.log["v"][:, joint - 1]):
        remedy = "inject a multisine or noise at that joint (design-excitation --experiment frf "
        words = f"v does not excite joint {joint}"
        raise InputRejected("D09", words, where, remedy=f"{remedy}plans it)")
    for name in (quantity, "q"):
        if _constant(good.log[name][:, joint - 1]):
            words = f"{name} of joint {joint} is constant while v excites it"
            raise InputRejected("D04", words, where, remedy="look at this channel in the recording")


def _constant(channel: Array) -> bool:
    return not np.isfinite(channel).any() or float(np.nanstd(channel)) <= 0.0


def _slow(q: Array) -> Array:
    """Return the slow part of positions (samples, joints) where no reference is known."""
    from scipy.ndimage import uniform_filter1d

    width = max(3, len(q) // 50)
    known = np.where(np.isfinite(q), q, np.nanmean(q, axis=0))
    return np.asarray(uniform_filter1d(known, 2 * width, axis=0, mode="nearest", origin=-1))


def _places(good: Usable, sample_time: float) -> npt.NDArray[np.int64]:
    """Return the even instant that each sample lies at."""
    steps = np.clip(np.rint(np.diff(good.log.t) / sample_time), 1, GAP_LIMIT + 2)
    return np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)


def _even(good: Usable, signals: Array, sample_time: float) -> tuple[Array, Mask, float]:
    """Lay samples where their stamps say; fill short gaps by a cubic spline through the stamps.

    The filling is linear, and alike in all channels: on average it filters all of them alike, and
    the quotient of two responses to v stays what it was; what it adds is noise, and shows as such.
    Samples that are laid side by side instead speed time up.

    Returns signals (instants, channels), NaN in gaps that are too long; which instants lie in a
    run; the share of those that was filled.
    """
    place = _places(good, sample_time)
    even = np.full((place[-1] + 1, signals.shape[1]), np.nan)
    even[place] = signals
    inside, filled = np.zeros(len(even), dtype=bool), 0
    # what another joint's encoder lacks is filled, too, but loses nothing of this one
    own = [*range(TORQUE + 1), -2, -1]
    for run in good.runs:
        at = np.arange(place[run.start], place[run.stop - 1] + 1)
        known = np.isfinite(even[at]).all(axis=1)
        if known.sum() < SHORTEST:
            continue
        filled += int((~np.isfinite(even[np.ix_(at, own)]).all(axis=1)).sum())
        if not known.all():
            even[at[~known]] = through(at[known], even[at[known]], at[~known])
        inside[at] = True
    return even, inside, filled / max(int(inside.sum()), 1)


def _levelled(signals: Array, q: Array) -> Array:
    """With the position less the line through it: a filter would take of the excitation, too."""
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


def _stretches(
    inside: Mask, signals: Array, speed: Array, width: float, sample_time: float
) -> list[Stretch]:
    """Find the stretches of constant speed, without the first samples of each."""
    top = float(np.nanmax(np.abs(speed)))
    none = 2  # numerics: no direction
    directions = np.zeros(len(speed), dtype=np.int8)
    if top > _CONFIG.still:
        flat = np.abs(np.abs(speed) - top) <= width * top
        directions = np.where(flat, np.sign(speed), none).astype(np.int8)
    directions[~(inside & np.isfinite(signals).all(axis=1))] = none
    edges = np.concatenate([[0], np.flatnonzero(np.diff(directions)) + 1, [len(speed)]])
    settle = round(_CONFIG.settle / sample_time)
    least = settle + round(_CONFIG.shortest / sample_time)
    return [
        Stretch(a + settle, b, int(directions[a]), signals[a + settle : b])
        for a, b in pairwise(edges.tolist())
        if directions[a] != none and b - a >= least
    ]


def excitation_period(v: Array, declared: float | None, sample_time: float) -> int | None:
    """Return the samples after which v (samples,) repeats itself; None: not in half of the log.

    The declared period [s] is believed where v keeps it; else peaks of the autocorrelation are
    tried.
    """
    if declared is not None:
        samples = round(declared / sample_time)
        whole = abs(samples * sample_time - declared) < 1e-6 * declared
        if 1 < samples <= len(v) // 2 and whole and _repeats(v, samples):
            return samples
    known = np.where(np.isfinite(v), v, 0.0)
    size = 1 << (2 * len(v) - 1).bit_length()
    spectrum = np.fft.rfft(known - known.mean(), size)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, size)[: len(v) // 2 + 1]
    overlap = (len(v) - np.arange(len(correlation))) / len(v)
    candidates = np.flatnonzero(correlation > _CONFIG.alike * overlap * correlation[0]).tolist()
    return next((k for k in candidates if k > 1 and _repeats(v, k)), None)


def _repeats(v: Array, period: int) -> bool:
    difference = np.abs(v[period:] - v[:-period])
    known = difference[np.isfinite(difference)]
    return bool(known.size and known.max() <= _CONFIG.same * np.nanmax(np.abs(v)))


def _swing(stretches: list[Stretch], sample_time: float) -> float:
    """Std of the speed by differences over four samples, which hide more of the encoder's steps."""
    positions = [s.signals[:, POSITION] for s in stretches]
    speeds = [(q[4:] - q[:-4]) / (4.0 * sample_time) for q in positions]
    return float(np.sqrt(np.mean(np.concatenate([(v - v.mean()) ** 2 for v in speeds]))))
