"""Take one "frf" log as signals for spectra: v, the plant's input, position, torque; no reversal.

    turned = turned_joint(log)
    turned.stretches[0].signals     (samples, 2 + 2 joints): v, u, q - q_ref of all joints, τ of all

Kostić et al. 2004, Section IV.D. The joint turns slowly, so that friction does not stick, and at
constant speed, so that the mean of its friction is a constant that no spectrum shows. Where it
starts, reverses and stops, friction jumps: those samples are left out, and so are the first after
them, until the loop has settled. The reference itself is subtracted.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.frequency.config import TurningConfig
from pipelines.frequency.spectra import Array, Mask
from pipelines.io.limits import GAP_LIMIT, LARGEST_JITTER, SHORTEST, percent
from pipelines.io.log import Controller, ExperimentLog
from pipelines.quality.segments import Usable, usable

__all__ = ["INPUT", "Stretch", "Turned", "V", "excitation_period", "turned_joint"]

V, INPUT = 0, 1  # numerics: channels; behind them all positions, then all torques

_CONFIG = TurningConfig()


@dataclass(frozen=True, eq=False)
class Stretch:
    """Samples at constant speed, without a gap."""

    start: int  # of the log, laid on even instants
    stop: int
    direction: int  # 1, -1; 0 where the joint does not turn
    signals: Array  # (samples, 2 + 2 joints)


@dataclass(frozen=True, eq=False)
class Turned:
    """The experiment of one log."""

    name: str
    joint: int  # 1-based
    posture: Array  # (n,) [rad]; the joint's own angle is where it began, unless the log says
    stroke: tuple[float, float]  # [rad] between which the joint turns, with its angle in `posture`
    sample_time: float  # [s]
    quantity: str  # "r" [rad/s^2] under computed torque, "tau" [N m] under PD: the plant's input
    controller: Controller | None
    revolute: bool
    speed: float  # [rad/s] at which it turned; 0: it did not
    period: int | None  # [samples] of v; None: it does not repeat
    lines: tuple[int, ...]  # harmonics of the period that v holds; none where it does not repeat
    stretches: tuple[Stretch, ...]
    left_out: float  # share of the samples
    filled: float  # share of the samples that were lost, and filled alike in all channels
    held: bool  # the input is held over a sample; False: sampled at some instant, as position is

    @property
    def rate(self) -> float:
        """Samples a second [Hz]."""
        return 1.0 / self.sample_time

    @property
    def position(self) -> int:
        """Channel of the joint's position."""
        return INPUT + self.joint

    @property
    def torque(self) -> int:
        """Channel of its torque."""
        return self.position + len(self.posture)

    @property
    def swing(self) -> float:
        """Std of the speed [rad/s] about that of the turn, by the excitation.

        By differences over four samples, which hide more of the encoder's steps.
        """
        positions = [s.signals[:, self.position] for s in self.stretches]
        speeds = [(q[4:] - q[:-4]) / (4.0 * self.sample_time) for q in positions]
        return float(np.sqrt(np.mean(np.concatenate([(v - v.mean()) ** 2 for v in speeds]))))

    @property
    def load(self) -> float:
        """|mean torque of both directions| over its deviation: what gravity leaves; 0: unknown."""
        ways = [
            [s.signals[:, self.torque] for s in self.stretches if s.direction == way]
            for way in (1, -1)
        ]
        if not all(ways):
            return 0.0
        means = [np.concatenate(own).mean() for own in ways]
        rest = [x - mean for own, mean in zip(ways, means, strict=True) for x in own]
        return float(abs(np.mean(means)) / max(np.concatenate(rest).std(), 1e-300))

    def settings(self) -> tuple[object, ...]:
        """Return what two logs must share to be averaged, but for their posture."""
        own = (self.joint, self.quantity, self.sample_time, self.period, self.lines)
        c = self.controller
        if c is None or c.kp is None or c.kd is None:
            return own
        gains = (float(c.kp[self.joint - 1]), float(c.kd[self.joint - 1]))
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
    own, position = [mended["v"][:, j], mended[quantity][:, j]], mended.q - mended["q_ref"]
    columns = np.column_stack([*own, position, mended.tau, mended["dq_ref"][:, j]])
    here = [V, INPUT, INPUT + joint, INPUT + joint + log.n_joints, -1]
    signals, in_run, filled = _even(good, columns, here, log.sample_time)
    if filled > _CONFIG.lost:
        words = f"{percent(filled)} of the samples were lost: between them no spectrum is known"
        remedy = "give the recorder more priority, or record fewer signals"
        raise InputRejected("T03", words, where, remedy=remedy)
    signals, speed = signals[:, :-1], signals[:, -1]
    stretches = _stretches(in_run, signals, speed, log.sample_time)
    if not stretches:
        seconds = _CONFIG.settle + _CONFIG.shortest
        words = f"joint {joint} never turns at constant speed for {seconds:g} s"
        remedy = "let it turn slowly there and back, 20 s each way or more"
        raise InputRejected("T08", words, where, remedy=remedy)
    recorded_v = np.full(len(signals), np.nan)
    recorded_v[_places(good, log.sample_time)] = mended["v"][:, j]
    period = excitation_period(recorded_v, log.period, log.sample_time)
    lines: tuple[int, ...] = ()
    if period is not None:
        size = np.abs(np.fft.rfft(np.nan_to_num(recorded_v[:period])))
        lines = tuple(np.flatnonzero(size > _CONFIG.line * size.max()).tolist())
    top = float(np.nanmax(np.abs(speed)))
    posture = np.asarray(mended["q_ref"][0] if log.posture is None else log.posture)
    turn = np.append(mended["q_ref"][:, j], posture[j])
    return Turned(
        name=log.name,
        joint=joint,
        posture=posture,
        stroke=(float(np.nanmin(turn)), float(np.nanmax(turn))),
        sample_time=log.sample_time,
        quantity=quantity,
        controller=log.controller,
        revolute=log.robot.joints[j].revolute,
        speed=top if top > _CONFIG.still else 0.0,
        period=period,
        lines=lines,
        stretches=tuple(stretches),
        left_out=1.0 - sum(len(s.signals) for s in stretches) / len(signals),
        filled=filled,
        held=quantity == "r" or log.torque != "measured",
    )


def _described(log: ExperimentLog) -> tuple[int, str]:
    """Return the joint, and which signal is the input of its plant."""

    def missing(words: str, remedy: str) -> InputRejected:
        return InputRejected("S01", words, where=log.source or log.name, remedy=remedy)

    if log.joint is None:
        raise missing("the log does not say which joint was excited", "set attribute joint")
    if "v" not in log:
        raise missing("an frf log without its excitation v", "record v")
    if "q_ref" not in log or "dq_ref" not in log:
        raise missing("an frf log without q_ref and dq_ref, the turn", "record q_ref and dq_ref")
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
    for name in ("v", quantity, "q"):
        channel = good.log[name][:, joint - 1]
        if np.isfinite(channel).any() and float(np.nanstd(channel)) > 0.0:
            continue
        if name == "v":
            remedy = "inject a multisine or noise at that joint (design-excitation --experiment frf"
            words = f"v does not excite joint {joint}"
            raise InputRejected("D09", words, where, remedy=f"{remedy} plans it)")
        words = f"{name} of joint {joint} is constant while v excites it"
        raise InputRejected("D04", words, where, remedy="look at this channel in the recording")


def _places(good: Usable, sample_time: float) -> npt.NDArray[np.int64]:
    """Return the even instant that each sample lies at."""
    steps = np.clip(np.rint(np.diff(good.log.t) / sample_time), 1, GAP_LIMIT + 2)
    return np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)


def _even(
    good: Usable, signals: Array, own: list[int], sample_time: float
) -> tuple[Array, Mask, float]:
    """Lay samples where their stamps say; fill short gaps by a cubic spline through the stamps.

    The filling is linear, and alike in all channels: on average it filters all of them alike, and
    the quotient of two responses to v stays what it was; what it adds is noise, and shows as such.
    Samples that are laid side by side instead speed time up.

    Returns signals (instants, channels), NaN in gaps that are too long; which instants lie in a
    run; the share of those of which one of the joint's `own` channels was filled.
    """
    from scipy.interpolate import CubicSpline

    place = _places(good, sample_time)
    even = np.full((place[-1] + 1, signals.shape[1]), np.nan)
    even[place] = signals
    in_run, filled = np.zeros(len(even), dtype=bool), 0
    for run in good.runs:
        at = np.arange(place[run.start], place[run.stop - 1] + 1)
        known = np.isfinite(even[at]).all(axis=1)
        if known.sum() < SHORTEST:
            continue
        filled += int((~np.isfinite(even[at][:, own]).all(axis=1)).sum())
        if not known.all():
            even[at[~known]] = CubicSpline(at[known], even[at[known]])(at[~known])
        in_run[at] = True
    return even, in_run, filled / max(int(in_run.sum()), 1)


def _stretches(in_run: Mask, signals: Array, speed: Array, sample_time: float) -> list[Stretch]:
    """Find the stretches of constant speed, without the first samples of each."""
    top = float(np.nanmax(np.abs(speed)))
    none = 2  # numerics: no direction
    directions = np.zeros(len(speed), dtype=np.int8)
    if top > _CONFIG.still:
        flat = np.abs(np.abs(speed) - top) <= _CONFIG.plateau * top
        directions = np.where(flat, np.sign(speed), none).astype(np.int8)
    directions[~(in_run & np.isfinite(signals).all(axis=1))] = none
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

    The declared period [s] is taken where v keeps it; else peaks of the autocorrelation are tried.
    """
    known = np.where(np.isfinite(v), v, 0.0)
    size = 1 << (2 * len(v) - 1).bit_length()
    spectrum = np.fft.rfft(known - known.mean(), size)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, size)[: len(v) // 2 + 1]
    overlap = (len(v) - np.arange(len(correlation))) / len(v)
    periods = np.flatnonzero(correlation > _CONFIG.alike * overlap * correlation[0]).tolist()
    if declared is not None:
        periods.insert(0, round(declared / sample_time))
    for period in periods:
        if 1 < period <= len(v) // 2:
            difference = np.abs(v[period:] - v[:-period])
            kept = difference[np.isfinite(difference)]
            if kept.size and kept.max() <= _CONFIG.same * np.nanmax(np.abs(v)):
                return int(period)
    return None
