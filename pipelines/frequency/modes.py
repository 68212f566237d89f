"""The modes of a response: where it leaves the rigid body, with frequency, damping and their deviations.

    modes = fitted_modes(measured)

The response over the sampled double integrator is the acceleration beside that of a rigid body that the controller's model
describes: 1 where that model is right, whatever the hold does. A rational function is fitted to it. Deviations hold noise, and
how far a mode moves along the turn (along.py). An antiresonance with a
resonance above it is a part that gives way; what it carries drops out above it, and the level rises by (f_r / f_a)².
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.frequency.along import along_turn
from pipelines.frequency.controller import Complex, loop_delay
from pipelines.frequency.frequency_response import FrequencyResponse
from pipelines.frequency.rational import Known, Mode, Rational
from pipelines.frequency.rational_search import FEWEST, fit_rational, scattered
from pipelines.frequency.responses import Measured, double_integrator
from pipelines.io.log import Array

__all__ = ["BAND", "Modes", "Pair", "fitted_modes", "relative_acceleration", "tells"]

BAND = (4.0, 250.0)  # [Hz] below it friction and gravity are at work, above it hardly any log has signal


@dataclass(frozen=True)
class ModesConfig:
    """Numbers of the modes.

    Attributes:
        of_rate: highest frequency of a mode, of the rate
        stiffest: damping ratio beyond which a pair is no mode
        sure: relative std of a frequency that is known at all
        by_friction: relative std of a damping beside noise: the slope of friction, the joint's and that of held joints, depends on
            how far the speed swings. On the bench, with swings of a tenth of the turn, it changes damping by 2 to 6 %
        straight: [Hz] over which level and delay are taken
        floor: relative deviation that every bin has at least
        fewest: bins
        stuck: misfit that a search which found the modes hardly leaves
        seen: standard deviations of its damping that a trace is more than nothing
        longest: [s] no delay is longer
        friction: of the magnitude, what friction has to change to be said
        held_still: relative deviation of a frequency that masses and springs are granted: held joints give way a little, and J is
            averaged over a turn
        seen_over: share of the frequency over which noise of the reading is averaged
    """

    of_rate: float = 0.3
    stiffest: float = 0.35
    sure: float = 0.05
    by_friction: float = 0.03
    straight: tuple[float, float] = (8.0, 150.0)
    floor: float = 1e-3
    fewest: int = 12
    stuck: float = 3.0
    seen: float = 3.0
    longest: float = 0.05
    friction: float = 0.1
    held_still: float = 0.008
    seen_over: float = 0.15


_CONFIG = ModesConfig()


@dataclass(frozen=True)
class Pair:
    """An antiresonance and the resonance above it."""

    antiresonance: Mode
    resonance: Mode

    @property
    def rise(self) -> float:
        """(f_r / f_a)²: the level above over the level below; 1 + what dropped out over what is left."""
        return (self.resonance.frequency.value / self.antiresonance.frequency.value) ** 2


@dataclass(frozen=True, eq=False)
class Modes:
    """Of one response."""

    modes: tuple[Mode, ...]  # distinct ones, by frequency
    traces: tuple[Mode, ...]  # of pairs that nearly cancel: alone they name nothing
    pairs: tuple[Pair, ...]
    single: tuple[Mode, ...]  # that have no partner
    level: Known  # of the rigid body above friction and below the modes, beside the model's: 1 where its inertia is right
    level_above: Known  # above all modes
    delay: Known  # [s], beside the hold and the controller's own delay
    flat: float  # largest deviation from `level` of what the fit has beside the modes, as a ratio ≥ 1
    inertia: Known | None  # [kg m^2] that the torque moves below the modes
    friction_below: float  # [Hz] below which friction and load change the magnitude by more than a tenth; 0: nowhere
    misfit: float  # 1 where the rational function explains all but the noise
    left: float  # two of it hold 95 % of the bins about the fit, as a share of the response
    band: tuple[float, float]  # [Hz] of the fit
    fit: Rational
    slack: float = _CONFIG.held_still  # relative deviation of a frequency that masses and springs are granted

    @property
    def faint(self) -> tuple[Pair, ...]:
        """Pairs of the traces."""
        return _paired(self.traces)[0]


def relative_acceleration(measured: Measured) -> FrequencyResponse:
    """Return the plant's response over the double integrator, sampled and delayed as the loop was, the other joints held."""
    response = measured.held.response if measured.held else measured.plant
    return response.times(np.asarray(1.0 / _rigid(measured, response.frequency)))


def _rigid(measured: Measured, frequency: Array) -> Complex:
    first = measured.first
    _, delay = loop_delay(first.controller, first.quantity)
    return np.asarray(double_integrator(frequency, first.sample_time, delay, first.held), dtype=np.complex128)


def tells(measured: Measured, band: tuple[float, float] = BAND) -> bool:
    """Return whether enough of `band` [Hz] is excited for a fit, and nothing has folded into it."""
    return not measured.aliased and len(_in_band(measured, relative_acceleration(measured), band).frequency) >= FEWEST


def _in_band(measured: Measured, response: FrequencyResponse, band: tuple[float, float]) -> FrequencyResponse:
    """What is excited of `band` [Hz], and sampled well enough."""
    inside = response.within(band[0], min(band[1], _CONFIG.of_rate * measured.first.rate))
    return inside.where(measured.excited.holds(inside.frequency))


def fitted_modes(measured: Measured, band: tuple[float, float] = BAND) -> Modes:
    """Modes of the plant within `band` [Hz].

    Raises:
        InputRejected: T08, too few frequencies in the band.
    """
    relative = relative_acceleration(measured)
    part = _in_band(measured, relative, band)
    relative = relative.where(measured.excited.holds(relative.frequency))
    fit = _fitted(part)
    moving = [(m, to) for m, to in _moving(measured, part, fit) if measured.excited.holds(np.array(m.frequency.value))]
    modes = tuple(_with_friction(to) for m, to in moving if _is_mode(m))
    traces = tuple(_with_friction(to) for m, to in moving if not m.distinct and _is_trace(m))
    pairs, single = _paired(modes)
    rest = part.times(1.0 / _carried(modes, part.frequency))
    level, delay = _level_and_delay(rest)
    rise = float(np.prod([p.rise for p in pairs])) if pairs else 1.0
    above = Known(level.value * rise, float(np.hypot(level.std * rise, level.value * rise * _rise_std(pairs))))
    ratio = measured.torque_per_input
    inertia = None if ratio is None else Known(ratio / level.value, abs(ratio / level.value) *
                                               float(np.hypot(level.std / level.value, _level_drawn(measured))))
    smooth = np.arange(_CONFIG.straight[0], min(_CONFIG.straight[1], part.frequency[-1]), 1.0)
    size = np.abs(fit.response(smooth) / _carried(modes, smooth)) / level.value
    return Modes(modes, traces, pairs, single, level, above, delay, float(max(size.max(), 1.0 / size.min())),
                 inertia, _friction_below(relative, level), fit.misfit, _left(fit, part, measured),
                 (float(part.frequency[0]), float(part.frequency[-1])), fit)


def _fitted(part: FrequencyResponse) -> Rational:
    """The rational function; where the search got stuck, that without a delay if it is better."""
    def fit(with_delay: bool) -> Rational:
        return fit_rational(part.frequency, part.response, part.variance, correlated=part.correlated, freedom=part.freedom,
                            with_delay=with_delay)

    first = fit(True)
    return first if first.misfit < _CONFIG.stuck else min(first, fit(False), key=lambda one: one.description)


def _left(fit: Rational, part: FrequencyResponse, measured: Measured) -> float:
    """Half of the deviation that 95 % of bins have at most, by what the fit leaves or by their noise.

    The noise is that of the plant as measured: taking out other joints also takes what shakes all,
    the impacts of a gap, from what is known of the rest. What the reading of the position alone
    explains hides no mode that is as wide as `seen_over`: of that noise counts what its mean has.
    """
    inside = part.within(*_CONFIG.straight)
    same = np.isin(measured.plant.frequency, inside.frequency)
    plant, read = measured.plant.where(same), measured.by_sensor[same]
    rest = np.abs(inside.response / fit.response(inside.frequency) - 1.0)
    off = np.maximum(rest**2, plant.variance / np.abs(plant.response) ** 2)
    alike = _CONFIG.seen_over * inside.frequency / (part.correlated * float(np.median(np.diff(part.frequency))))
    by_reading = -np.log(0.05) * read  # 95 % of |n|² of complex Gaussian noise
    return 0.5 * float(np.sqrt(np.quantile(np.maximum(off - by_reading, 0.0) + by_reading / np.maximum(alike, 1.0), 0.95)))


def _carried(modes: tuple[Mode, ...], frequency: Array) -> Complex:
    """Π (1 + 2ζ s/ω + s²/ω²) of antiresonances over that of resonances, 1 far below them all."""
    s = 2j * np.pi * np.asarray(frequency)
    value = np.ones(len(s), dtype=np.complex128)
    for mode in modes:
        omega = 2.0 * np.pi * mode.frequency.value
        section = 1.0 + 2.0 * mode.damping.value * s / omega + (s / omega) ** 2
        value = value * section if mode.kind == "antiresonance" else value / section
    return value


def _level_and_delay(rest: FrequencyResponse) -> tuple[Known, Known]:
    """What the modes leave: its mean size, and the slope of its phase beside the 1/ω of friction, by weighted least squares.

    Deviations hold what scatters in fact, were that more than the noise.
    """
    part = rest.within(*_CONFIG.straight)
    relative = np.maximum(part.variance / 2.0 / np.abs(part.response) ** 2, _CONFIG.floor**2)
    good = np.isfinite(relative) & (relative < 0.1)
    weight, omega = 1.0 / relative[good], 2.0 * np.pi * part.frequency[good]
    if good.sum() < _CONFIG.fewest:
        return Known(float(np.median(np.abs(rest.response))), np.inf), Known(0.0, np.inf)
    rough = _rough_delay(part.response[good], weight, omega)
    straight = part.response[good] * np.exp(1j * omega * rough)
    size, phase = np.log(np.abs(straight)), np.angle(straight / np.sum(weight * straight / np.abs(straight)))
    level, level_std = _weighted(np.ones((len(size), 1)), size, weight, part.correlated)
    phase += float(np.angle(np.sum(weight * straight / np.abs(straight))))
    slope, slope_std = _weighted(np.column_stack([-omega, 1.0 / omega]), phase, weight, part.correlated)
    value = float(np.exp(level[0]))
    return Known(value, value * float(level_std[0])), Known(rough + float(slope[0]), float(slope_std[0]))


def _level_drawn(measured: Measured) -> float:
    """Relative std of the level by what is known of the coupling."""
    if measured.held is None:
        return 0.0
    f = measured.held.response.frequency
    inside = (f >= _CONFIG.straight[0]) & (f <= _CONFIG.straight[1])
    ratio = np.abs(measured.held.draws[:, inside] / measured.held.response.response[inside])
    return float(np.log(ratio).mean(axis=1).std()) if inside.any() else 0.0


def _rough_delay(response: Complex, weight: Array, omega: Array) -> float:
    """The delay [s] that lays all phases on zero best: no phase has to be unwrapped then."""
    tried = np.arange(-_CONFIG.longest, _CONFIG.longest, 0.5 / float(omega.max()))
    unit = weight * response / np.abs(response)
    return float(tried[np.argmax((np.exp(1j * np.outer(tried, omega)) @ unit).real)])


def _weighted(columns: Array, y: Array, weight: Array, correlated: float) -> tuple[Array, Array]:
    root = np.sqrt(weight)
    normal = (columns * weight[:, None]).T @ columns
    scale = np.sqrt(np.diag(normal))
    inverse = np.linalg.inv(normal / np.outer(scale, scale)) / np.outer(scale, scale)
    found = inverse @ (columns.T @ (weight * y))
    misfit = float(np.sum((root * (y - columns @ found)) ** 2)) / max(len(y) - len(found), 1)
    return np.asarray(found), np.sqrt(np.diag(inverse) * correlated * max(misfit, 1.0))


def _is_mode(mode: Mode) -> bool:
    """One that is known."""
    f, damping = mode.frequency, mode.damping.value
    return mode.distinct and damping < _CONFIG.stiffest and f.std < _CONFIG.sure * f.value


def _is_trace(mode: Mode) -> bool:
    return _is_mode(replace(mode, distinct=True)) and mode.damping.value > _CONFIG.seen * mode.damping.std


def _moving(measured: Measured, part: FrequencyResponse, fit: Rational) -> list[tuple[Mode, Mode]]:
    """Each mode as the fit has it, and as uncertain as the coupling and its movement along the turn make it."""
    modes = wider = fit.modes()
    along = along_turn(measured, part.frequency)
    if along is not None and modes:
        wider = _wider(wider, _scattered(measured, part, fit, along.response), modes, along.noise)
    if measured.held is not None and modes:
        inside = np.isin(measured.held.response.frequency, part.frequency)
        wider = _wider(wider, _scattered(measured, part, fit, measured.held.draws[:, inside]), modes, 0.0)
    return list(zip(modes, wider, strict=True))


def _scattered(measured: Measured, part: FrequencyResponse, fit: Rational, responses: Complex) -> tuple[Mode, ...]:
    """The modes of the fit with the deviations of those of `responses` u → q (parts, bins)."""
    return scattered(fit, part.frequency, responses / _rigid(measured, part.frequency), part.variance).modes()


def _wider(modes: tuple[Mode, ...], parts: tuple[Mode, ...], mean: tuple[Mode, ...], noise: float) -> tuple[Mode, ...]:
    """With what `parts` scatter beyond `noise` times the variance of the mean."""
    def wider(now: Known, part: Known, mean: Known) -> Known:
        return Known(now.value, float(np.sqrt(now.std**2 + max(part.std**2 - noise * mean.std**2, 0.0))))

    return tuple(replace(m, frequency=wider(m.frequency, p.frequency, k.frequency), damping=wider(m.damping, p.damping, k.damping))
                 for m, p, k in zip(modes, parts, mean, strict=True))


def _with_friction(mode: Mode) -> Mode:
    """Its damping as uncertain as friction makes it, beside the noise."""
    d = mode.damping
    return replace(mode, damping=Known(d.value, float(np.hypot(d.std, _CONFIG.by_friction * abs(d.value)))))


def _paired(modes: tuple[Mode, ...]) -> tuple[tuple[Pair, ...], tuple[Mode, ...]]:
    """Each antiresonance with the resonance that follows it."""
    pairs, single, k = [], [], 0
    while k < len(modes):
        here, after = modes[k], modes[k + 1] if k + 1 < len(modes) else None
        if after is not None and here.kind == "antiresonance" and after.kind == "resonance":
            pairs.append(Pair(here, after))
            k += 2
        else:
            single.append(here)
            k += 1
    return tuple(pairs), tuple(single)


def _rise_std(pairs: tuple[Pair, ...]) -> float:
    """Relative, of the product of all rises."""
    parts = [2.0 * f.std / f.value for p in pairs for f in (p.antiresonance.frequency, p.resonance.frequency)]
    return float(np.sqrt(np.sum(np.square(parts))))


def _friction_below(relative: FrequencyResponse, level: Known) -> float:
    """Up to where, from below, the magnitude is a tenth off, or the coherence too low to say."""
    low = relative.within(0.0, 2.0 * BAND[0])
    off = np.abs(np.abs(low.response) / abs(level.value) - 1.0) > _CONFIG.friction
    beyond = np.flatnonzero(off & (np.sqrt(low.variance) < 0.5 * _CONFIG.friction * abs(level.value)))
    return float(low.frequency[beyond[-1]]) if len(beyond) else 0.0
