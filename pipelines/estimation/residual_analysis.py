"""Analyse what a fitted model leaves: over time, and against all that it may depend on.

    evidence(fit, floor)              the residual over time, and against all that it may depend on
    proof(before, after, joint, …)    of the joint that shows most of a finding

A joint that goes to and fro over a part of a turn is longer at some angles than at others.
Amplitudes over the orders of an angle let every angle count alike, and less towards the ends of the
range (von Hann's window): 2 |Σ w(q) x e^(-jkq)| / Σ w(q), x less its mean.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipelines.estimation.config import ResidualConfig
from pipelines.estimation.filters import welch
from pipelines.estimation.model_fit import Refined
from pipelines.estimation.rows import Data, LogData
from pipelines.io.log import Array
from pipelines.simulation.comparison import Simulation

_CONFIG = ResidualConfig()
_ORDERS = np.arange(0.5, 80.25, 0.25)  # [1/rev]


@dataclass(frozen=True)
class Proof:
    """The figure that proves a finding: the residual before and after, and what the cause predicts.

    Of the joint that shows most of it, over the signal that the cause depends on, in bins of equal
    count, or, where it depends on none, the amplitudes of all three over frequency; and over time.
    """

    joint: int  # 1-based, whose residual is shown
    against: str  # a signal of `signals`, or "frequency"
    unit: str
    x: Array  # (bins,) middle of each
    before: Array  # (bins,) [N m] mean residual without the finding
    after: Array  # with it
    predicted: Array  # what the finding predicts of `before`
    spread: Array  # (bins,) [N m] standard error of `before`; none over frequency
    t: Array  # (samples,) [s] a stretch of time where it shows most
    before_in_time: Array
    after_in_time: Array
    predicted_in_time: Array


@dataclass(frozen=True)
class Curve:
    """The residual against one signal of its joint, in bins of equal count."""

    joint: int
    against: str
    unit: str
    x: Array  # (bins,)
    mean: Array  # [N m]
    spread: Array  # [N m] standard deviation within the bin
    explained: float  # share of the residual's power that the means hold


@dataclass(frozen=True)
class Spectrum:
    """Of one joint's residual: over time's frequency or over the orders of its angle."""

    joint: int
    over: Literal["frequency", "order"]
    unit: str  # "Hz" | "1/rev"
    x: Array  # (bins,)
    amplitude: Array  # [N m] of each line or bin


@dataclass(frozen=True)
class Evidence:
    """Residual analysis of one log."""

    log: str  # name of the log that is shown
    t: Array  # [s] (points,)
    measured: Array  # [N m] (points, joints) after the low-pass
    predicted: Array
    residual: Array
    simulated_t: Array | None  # [s] (points,)
    simulated_position_error: Array | None  # [rad] (points, joints) simulated minus measured
    curves: tuple[Curve, ...]
    spectra: tuple[Spectrum, ...]
    above_noise_floor: Array  # (joints,) share of the residual's power that is above the floor
    band: Array  # (joints, 2) [Hz] in which most of that lies
    simulated_log: str = ""  # name of the log that was simulated in closed loop
    extended_position_error: Array | None = None  # [rad] (points, joints) of the extended model


@dataclass(frozen=True, eq=False)
class Signal:
    """One signal at the moments of one joint's rows, logs one behind the other."""

    name: str
    unit: str
    values: Array  # (rows of the joint,)


@dataclass(frozen=True, eq=False)
class Binned:
    """Means of one quantity over another. Each (bins,)."""

    x: Array
    mean: Array
    spread: Array  # standard deviation within the bin
    count: Array

    @property
    def power(self) -> float:
        """The sum of squares of the means."""
        return float(np.sum(self.count * self.mean**2))


def binned(x: Array, y: Array, bins: int = _CONFIG.curve_bins) -> Binned:
    """Return `y` over `x`, in bins of equal count."""
    order = np.argsort(x, kind="stable")
    edges = np.linspace(0, len(x), min(bins, max(1, len(x) // _CONFIG.rows)) + 1).astype(int)
    first, count = edges[:-1], np.diff(edges).astype(np.float64)
    mean_x, mean, square = (np.add.reduceat(v[order], first) / count for v in (x, y, y**2))
    return Binned(mean_x, mean, np.sqrt(np.maximum(square - mean**2, 0.0)), count)


def signals(data: Data, joint: int, load: Array) -> Iterator[Signal]:
    """Return what the residual of `joint` (from 0) may depend on; `load` (rows,) is the torque."""
    revolute = data.logs[0].log.robot.revolute
    q, dq = (_at_rows(data, name) for name in ("q", "dq"))
    angle, force = ("rad", "N m") if revolute[joint] else ("m", "N")
    yield Signal("time", "s", np.concatenate([one.t - one.t[0] for one in data.logs]))
    yield Signal("position", angle, q[:, joint])
    yield Signal("speed", f"{angle}/s", dq[:, joint])
    yield Signal("load", force, load[data.joint == joint])
    travel = np.concatenate([_travel(one, joint) for one in data.logs])
    yield Signal("travel since reversal", angle, travel)
    for other, turns in enumerate(revolute):
        if other != joint:
            unit = "rad" if turns else "m"
            yield Signal(f"position of joint {other + 1}", unit, q[:, other])
            yield Signal(f"speed of joint {other + 1}", f"{unit}/s", dq[:, other])


def _at_rows(data: Data, name: str) -> Array:
    return np.concatenate([one.at_rows(getattr(one.motion, name)) for one in data.logs])


def _travel(one: LogData, joint: int) -> Array:
    """Return the signed distance from where the joint last reversed."""
    q = one.motion.q[:, joint]
    turns = np.flatnonzero(np.diff(np.sign(one.motion.dq[:, joint])) != 0) + 1
    begin = np.concatenate([[0], turns])
    which = np.searchsorted(begin, np.arange(len(q)), side="right") - 1
    return np.asarray(one.at_rows(q - q[begin[which]]))


def amplitudes(q: Array, x: Array) -> tuple[Array, Array]:
    """Return the resolved orders [1/rev] and the amplitude of each wave over the angle q in x.

    Both (rows,). None where the joint stood still.
    """
    span = float(np.ptp(q)) if len(q) else 0.0
    if span <= 0.0:
        return _ORDERS[:0], _ORDERS[:0]
    orders = _ORDERS[_CONFIG.waves * 2.0 * np.pi / span <= _ORDERS]
    along = (q - q.min()) / span
    parts = max(1, int(np.ceil(span * _ORDERS[-1] / (2.0 * np.pi * _CONFIG.part))))
    part = np.minimum((along * parts).astype(int), parts - 1)
    count = np.bincount(part, minlength=parts)[part]
    weight = np.minimum(1.0 / count, _CONFIG.rare * parts / len(q))
    weight *= np.sin(np.pi * along) ** 2
    rest = weight * (x - weight @ x / max(float(weight.sum()), 1e-300))
    size = [abs(rest @ np.exp(-1j * order * q)) for order in orders]
    return orders, 2.0 * np.asarray(size, dtype=np.float64) / max(float(weight.sum()), 1e-300)


def evidence(done: Refined, floor: Array) -> Evidence:
    """Return the residual of the nominal model over the first log, curves and spectra over all."""
    data, left, n = done.data, done.left, done.data.n_joints
    predicted = data.y - left
    measured, modelled, rest = (next(iter(data.split(x))).T for x in (data.y, predicted, left))
    curves, spectra = list[Curve](), list[Spectrum]()
    for joint in range(n):
        own = left[data.joint == joint]
        for one in signals(data, joint, predicted):
            means = binned(one.values, own)
            share = means.power / max(float(own @ own), 1e-300)
            curve = (means.x, means.mean, means.spread, share)
            curves.append(Curve(joint + 1, one.name, one.unit, *curve))
        spectra += _spectra(data, left, joint)
    every = max(1, -(-len(measured) // _CONFIG.series))
    return Evidence(
        data.logs[0].log.name,
        data.logs[0].t[::every],
        measured[::every],
        modelled[::every],
        rest[::every],
        None,
        None,
        tuple(curves),
        tuple(spectra),
        np.clip(1.0 - np.square(floor / done.rms), 0.0, 1.0),
        _bands(spectra, n),
    )


def _spectra(data: Data, left: Array, joint: int) -> list[Spectrum]:
    """Return the spectra over frequency, of the longest log, and over orders of the angle."""
    found, q = list[Spectrum](), _at_rows(data, "q")[:, joint]
    parts = [(one, x[joint]) for one, x in zip(data.logs, data.split(left), strict=True)]
    own = _over_frequency(*max(parts, key=lambda part: len(part[1])))
    if own is not None:
        found.append(Spectrum(joint + 1, "frequency", "Hz", *own))
    orders, waves = amplitudes(q, left[data.joint == joint])
    if len(orders):
        unit = "1/rev" if data.logs[0].log.robot.revolute[joint] else "1/(2 pi m)"
        found.append(Spectrum(joint + 1, "order", unit, orders, waves))
    return found


def _over_frequency(one: LogData, x: Array) -> tuple[Array, Array] | None:
    """Return frequencies [Hz] and amplitudes of bins of x (rows,); None of too short a log.

    The squares of the amplitudes add up to the mean square of x.
    """
    if len(x) < 64:
        return None
    step = float(np.median(np.diff(one.t)))
    frequency, density = welch(x[:, None], 1.0 / step, min(_CONFIG.segment, len(x) // 2))
    return frequency, np.sqrt(density[:, 0] * (frequency[1] - frequency[0]))


def _bands(spectra: list[Spectrum], joints: int) -> Array:
    """Return the bands (joints, 2) [Hz] that hold most of the residual's power."""
    out = np.full((joints, 2), np.nan)
    for one in spectra:
        if one.over == "frequency":
            power = np.square(one.amplitude)
            total = np.cumsum(power) / max(float(power.sum()), 1e-300)
            ends = np.searchsorted(total, (0.5 - 0.5 * _CONFIG.band, 0.5 + 0.5 * _CONFIG.band))
            out[one.joint - 1] = one.x[np.minimum(ends, len(one.x) - 1)]
    return out


def proof(
    before: Refined, after: Refined, joint: int | None, log: int | None = None, event: bool = False
) -> Proof:
    """Return the residual over the signal by which the cause is predicted best.

    Over frequency where no signal is: what a resonance adds is not alike along an angle or a speed.
    An event is shown over the time of its log; one that comes in every log over that of all.

    Args:
        log: place of the log it happened in, among those of the rows.
        event: whether it happened.
    """
    data = before.data
    three = (before.left, after.left, before.left - after.left)
    shown = joint - 1 if joint is not None else int(np.argmax(data.rms(three[2]) / before.rms))
    own = data.joint == shown
    parts = [x[own] for x in three]
    t, rows = _stretch(data, parts[2])
    over_time = (t, *(x[rows] for x in parts))
    if log is not None:
        there = data.log_of[own] == log
        best = Signal("time", "s", data.logs[log].t)
        return _over(best, [x[there] for x in parts], shown, over_time)
    time, *others = signals(data, shown, data.y - before.left)
    power = {one: binned(one.values, parts[2]).power for one in (time, *others)}
    # in a log that goes once through its range anything is shown over time: when, and not by what
    best = max(others, key=lambda one: power[one])
    if event or power[best] < _CONFIG.as_much * power[time]:
        best = time
    if not event and power[best] < _CONFIG.shown * float(parts[2] @ parts[2]):
        place = max(range(len(data.logs)), key=lambda k: _power_in(data, three[2], k, shown))
        lines = [
            _over_frequency(data.logs[place], list(data.split(x))[place][shown]) for x in three
        ]
        if found := [one for one in lines if one is not None]:
            hertz, none = found[0][0], np.zeros(len(found[0][0]))
            without, with_it, predicted = (lines for _, lines in found)
            curves = (hertz, without, with_it, predicted, none)
            return Proof(shown + 1, "frequency", "Hz", *curves, *over_time)
    return _over(best, parts, shown, over_time)


def _power_in(data: Data, x: Array, log: int, joint: int) -> float:
    return float(np.sum(np.square(list(data.split(x))[log][joint])))


def _over(
    signal: Signal, parts: list[Array], joint: int, over_time: tuple[Array, Array, Array, Array]
) -> Proof:
    """Return `parts`, without the finding, with it and what it predicts, over a signal."""
    before, after, predicted = (binned(signal.values, x, _CONFIG.bins) for x in parts)
    curves = (before.x, before.mean, after.mean, predicted.mean)
    spread = before.spread / np.sqrt(before.count)
    return Proof(joint + 1, signal.name, signal.unit, *curves, spread, *over_time)


def _stretch(data: Data, predicted: Array) -> tuple[Array, slice]:
    """Return time and rows of the stretch in which the predicted part varies most.

    The variance, not the power: a joint at rest shows a constant, which proves nothing.
    """
    first, best, found = 0, -1.0, slice(0, 0)
    times = np.concatenate([one.t for one in data.logs])
    for one in data.logs:
        step = float(np.median(np.diff(one.t))) if one.rows > 1 else 1.0
        size = max(2, min(one.rows, round(_CONFIG.stretch / step)))
        for start in range(first, first + one.rows - size + 1, max(1, size // 2)):
            power = float(np.var(predicted[start : start + size]))
            if power > best:
                best, found = power, slice(start, start + size)
        first += one.rows
    return times[found], found


def with_simulation(one: Evidence, nominal: Simulation, extended: Simulation) -> Evidence:
    """Return the analysis with the position errors of both arms, where both ran in closed loop."""
    if nominal.first is None or extended.first is None:
        return one
    first, other = nominal.first, extended.first.error
    samples = int(np.searchsorted(first.t, _CONFIG.seconds))
    shown = slice(0, samples, max(1, samples // _CONFIG.points))
    return replace(
        one,
        simulated_t=first.t[shown],
        simulated_position_error=first.error[shown],
        simulated_log=first.log,
        extended_position_error=other[shown],
    )
