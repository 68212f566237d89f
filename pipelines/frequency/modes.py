"""Fit the modes of a response: where it leaves the rigid body, with frequency and damping.

    modes = fitted_modes(measured)

The response over the sampled double integrator is the acceleration beside that of a rigid body that
the controller's model describes: 1 where that model is right, under any hold. A rational
function is fitted to it. An antiresonance with a resonance above it is a compliant part; what
it carries drops out above it, and the level rises by (f_r / f_a)².

Deviations hold noise, and how far a mode moves along the turn: the inertia about a joint's own axis
is the same at every angle of that joint; what couples it to the base and to the joints before it is
not, and one number stands for all angles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.frequency.config import ModesConfig, RationalConfig
from pipelines.frequency.controller import double_integrator, loop_delay
from pipelines.frequency.rational import FEWEST, Known, Mode, Rational, fit_rational, scattered
from pipelines.frequency.responses import Measured
from pipelines.frequency.signals import INPUT, POSITION
from pipelines.frequency.spectra import Array, Complex, FrequencyResponse

__all__ = ["BAND", "Modes", "Pair", "fitted_modes", "relative_acceleration", "tells"]

_CONFIG = ModesConfig()
BAND = _CONFIG.band  # numerics: [Hz] in which modes are looked for


@dataclass(frozen=True)
class Pair:
    """An antiresonance and the resonance above it."""

    antiresonance: Mode
    resonance: Mode

    @property
    def rise(self) -> float:
        """(f_r / f_a)²: the level above over that below; 1 + dropped out over remaining inertia."""
        return (self.resonance.frequency.value / self.antiresonance.frequency.value) ** 2


@dataclass(frozen=True, eq=False)
class Modes:
    """Of one response."""

    modes: tuple[Mode, ...]  # distinct ones, by frequency
    traces: tuple[Mode, ...]  # of pairs that nearly cancel: alone they name nothing
    pairs: tuple[Pair, ...]
    single: tuple[Mode, ...]  # that have no partner
    level: Known  # of the rigid body above friction and below the modes: 1 if its inertia is right
    level_above: Known  # above all modes
    delay: Known  # [s], beside the hold and the controller's own delay
    flat: float  # largest deviation from `level` beside the modes, as a ratio ≥ 1
    inertia: Known | None  # [kg m^2] that the torque moves below the modes
    friction_below: float  # [Hz] below which friction and load change the magnitude; 0: nowhere
    misfit: float  # 1 where the rational function explains all but the noise
    left: float  # two of it hold 95 % of the bins about the fit, as a share of the response
    band: tuple[float, float]  # [Hz] of the fit
    fit: Rational
    slack: float = (
        _CONFIG.held_still
    )  # relative, of a frequency that masses and springs are granted

    @property
    def faint(self) -> tuple[Pair, ...]:
        """Pairs of the traces."""
        return _paired(self.traces)[0]


def relative_acceleration(measured: Measured) -> FrequencyResponse:
    """Return the plant's response over the double integrator, sampled and delayed as the loop was.

    The other joints are held.
    """
    response = measured.held.response if measured.held else measured.plant
    return response.times(np.asarray(1.0 / _rigid(measured, response.frequency)))


def _rigid(measured: Measured, frequency: Array) -> Complex:
    first = measured.first
    _, delay = loop_delay(first.controller, first.quantity)
    return double_integrator(frequency, first.sample_time, delay, first.held)


def tells(measured: Measured, band: tuple[float, float] = BAND) -> bool:
    """Return whether enough of `band` [Hz] is excited for a fit, and nothing has folded into it."""
    part = _in_band(measured, relative_acceleration(measured), band)
    return not measured.aliased and len(part.frequency) >= FEWEST


def _in_band(
    measured: Measured, response: FrequencyResponse, band: tuple[float, float]
) -> FrequencyResponse:
    """Return the bins of `band` [Hz] that are excited, and sampled well enough."""
    inside = response.within(band[0], min(band[1], _CONFIG.of_rate * measured.first.rate))
    return inside.where(measured.excited.holds(inside.frequency))


def fitted_modes(measured: Measured, band: tuple[float, float] = BAND) -> Modes:
    """Return the modes of the plant within `band` [Hz].

    Raises:
        InputRejected: T08, too few frequencies in the band.
    """
    relative = relative_acceleration(measured)
    part = _in_band(measured, relative, band)
    fit = _fitted(part)
    seen = [
        (own, wide)
        for own, wide in zip(fit.modes(), _as_uncertain(measured, part, fit), strict=True)
        if measured.excited.holds(np.array(own.frequency.value))
    ]
    modes = tuple(wide for own, wide in seen if own.distinct and _is_mode(own))
    traces = tuple(wide for own, wide in seen if not own.distinct and _is_trace(own))
    pairs, single = _paired(modes)
    level, delay = _level_and_delay(part.times(1.0 / _carried(modes, part.frequency)))
    rises = [
        (f.std / f.value) for p in pairs for f in (p.antiresonance.frequency, p.resonance.frequency)
    ]
    rise, rise_std = float(np.prod([p.rise for p in pairs])), 2.0 * float(np.linalg.norm(rises))
    above = level.value * rise
    smooth = np.arange(_CONFIG.straight[0], min(_CONFIG.straight[1], part.frequency[-1]), 1.0)
    size = np.abs(fit.response(smooth) / _carried(modes, smooth)) / level.value
    return Modes(
        modes=modes,
        traces=traces,
        pairs=pairs,
        single=single,
        level=level,
        level_above=Known(above, float(np.hypot(level.std * rise, above * rise_std))),
        delay=delay,
        flat=float(max(size.max(), 1.0 / size.min())),
        inertia=_inertia(measured, level),
        friction_below=_friction_below(measured, relative, level),
        misfit=fit.misfit,
        left=_left(fit, part, measured),
        band=(float(part.frequency[0]), float(part.frequency[-1])),
        fit=fit,
    )


def _fitted(part: FrequencyResponse) -> Rational:
    """Fit the rational function; where the search got stuck, without a delay if that is better."""

    def fit(with_delay: bool) -> Rational:
        weights = (part.variance, with_delay, part.correlated, part.freedom)
        return fit_rational(part.frequency, part.response, *weights)

    first = fit(True)
    if first.misfit < _CONFIG.stuck:
        return first
    return min(first, fit(False), key=lambda one: one.description)


def _left(fit: Rational, part: FrequencyResponse, measured: Measured) -> float:
    """Half of the deviation that 95 % of bins have at most, by what the fit leaves or their noise.

    The noise is that of the plant as measured: taking out other joints also takes what shakes all,
    the impacts of a gap, from what is known of the rest. What the reading of the position alone
    explains hides no mode that is as wide as `seen_over`: of that noise counts what its mean has.
    """
    inside = part.within(*_CONFIG.straight)
    f, share = inside.frequency, 0.95  # numerics: two deviations
    same = np.isin(measured.plant.frequency, f)
    plant, read = measured.plant.where(same), measured.by_sensor[same]
    rest = np.abs(inside.response / fit.response(f) - 1.0)
    off = np.maximum(rest**2, plant.variance / np.abs(plant.response) ** 2)
    spacing = part.correlated * float(np.median(np.diff(part.frequency)))
    by_reading = -np.log(1.0 - share) * read  # 95 % of |n|² of complex Gaussian noise
    averaged = by_reading / np.maximum(_CONFIG.seen_over * f / spacing, 1.0)
    own = np.maximum(off - by_reading, 0.0) + averaged
    return 0.5 * float(np.sqrt(np.quantile(own, share)))


def _carried(modes: tuple[Mode, ...], frequency: Array) -> Complex:
    """Π (1 + 2ζ s/ω + s²/ω²) of antiresonances over that of resonances, 1 far below them all."""
    value = np.ones(len(frequency), dtype=np.complex128)
    for mode in modes:
        s = 1j * frequency / mode.frequency.value  # over ω
        section = 1.0 + 2.0 * mode.damping.value * s + s**2
        value = value * section if mode.kind == "antiresonance" else value / section
    return value


def _level_and_delay(rest: FrequencyResponse) -> tuple[Known, Known]:
    """Mean size of the rest, and the slope of its phase beside the 1/ω of friction.

    By weighted least squares; deviations hold what scatters in fact, were that more than the noise.
    """
    part = rest.within(*_CONFIG.straight)
    relative = 0.5 * part.variance / np.abs(part.response) ** 2
    part = part.where(relative < _CONFIG.vague)
    if len(part.frequency) < _CONFIG.fewest:
        size = float(np.median(np.abs(rest.response)))
        return Known(size, np.inf), Known(0.0, np.inf)
    relative = np.maximum(relative[relative < _CONFIG.vague], RationalConfig().floor ** 2)
    weight, omega = 1.0 / relative, 2.0 * np.pi * part.frequency
    # the delay that lays all phases on zero best: no phase has to be unwrapped then
    tried = np.arange(-_CONFIG.longest, _CONFIG.longest, 0.5 / float(omega.max()))
    unit = weight * part.response / np.abs(part.response)
    rough = float(tried[np.argmax((np.exp(1j * np.outer(tried, omega)) @ unit).real)])
    straight = part.response * np.exp(1j * omega * rough)
    middle = np.sum(weight * straight / np.abs(straight))
    phase = np.angle(straight / middle) + np.angle(middle)
    columns = np.ones((len(omega), 1))
    level, level_std = _weighted(columns, np.log(np.abs(straight)), weight, part.correlated)
    columns = np.column_stack([-omega, 1.0 / omega])
    slope, slope_std = _weighted(columns, phase, weight, part.correlated)
    value = float(np.exp(level))
    return Known(value, value * level_std), Known(rough + slope, slope_std)


def _weighted(columns: Array, y: Array, weight: Array, correlated: float) -> tuple[float, float]:
    """Return the number of the first column, and its std."""
    normal = (columns * weight[:, None]).T @ columns
    scale = np.sqrt(np.diag(normal))
    inverse = np.linalg.inv(normal / np.outer(scale, scale)) / np.outer(scale, scale)
    found = inverse @ (columns.T @ (weight * y))
    misfit = float(weight @ (y - columns @ found) ** 2) / max(len(y) - len(found), 1)
    return float(found[0]), float(np.sqrt(inverse[0, 0] * correlated * max(misfit, 1.0)))


def _inertia(measured: Measured, level: Known) -> Known | None:
    """Inertia below the modes, as uncertain as level and coupling are."""
    ratio, drawn = measured.torque_per_input, 0.0
    if ratio is None:
        return None
    if measured.held is not None:
        f = measured.held.response.frequency
        inside = (f >= _CONFIG.straight[0]) & (f <= _CONFIG.straight[1])
        share = np.abs(measured.held.draws / measured.held.response.response)[:, inside]
        drawn = float(np.log(share).mean(axis=1).std()) if inside.any() else 0.0
    value = ratio / level.value
    return Known(value, abs(value) * float(np.hypot(level.std / level.value, drawn)))


def _is_mode(mode: Mode) -> bool:
    """One that is known."""
    f = mode.frequency
    return mode.damping.value < _CONFIG.stiffest and f.std < _CONFIG.sure * f.value


def _is_trace(mode: Mode) -> bool:
    return _is_mode(mode) and mode.damping.value > _CONFIG.seen * mode.damping.std


def _as_uncertain(measured: Measured, part: FrequencyResponse, fit: Rational) -> tuple[Mode, ...]:
    """Return the modes, as uncertain as coupling, movement along the turn and friction make them.

    Of the scatter of two periods the noise is taken off.
    """
    modes = fit.modes()
    if not modes:
        return ()
    others = []
    along = _along_turn(measured, part.frequency)
    if along is not None:
        others.append(along)
    if measured.held is not None:
        inside = np.isin(measured.held.response.frequency, part.frequency)
        others.append((measured.held.draws[:, inside], 0.0))
    spread = [np.array([(m.frequency.std, m.damping.std) for m in modes]) ** 2]
    for responses, noise in others:
        relative = responses / _rigid(measured, part.frequency)
        apart = scattered(fit, part.frequency, relative, part.variance).modes()
        own = np.array([(m.frequency.std, m.damping.std) for m in apart]) ** 2
        spread.append(np.maximum(own - noise * spread[0], 0.0))
    stds = np.sqrt(np.sum(spread, axis=0)).tolist()
    wider = []
    for mode, (frequency_std, damping_std) in zip(modes, stds, strict=True):
        value = mode.damping.value
        damping = Known(value, float(np.hypot(damping_std, _CONFIG.by_friction * abs(value))))
        frequency = Known(mode.frequency.value, frequency_std)
        wider.append(replace(mode, frequency=frequency, damping=damping))
    return tuple(wider)


def _along_turn(measured: Measured, frequency: Array) -> tuple[Complex, float] | None:
    """Responses u → q (parts, bins) of two periods at a time at lines of a multisine [Hz] (bins,).

    Hann's window keeps the lines of one period apart and the slow pull of gravity out. The second
    number is the variance of a part over that of the mean, where noise is all that differs. None of
    other excitations, and of too few periods.
    """
    period = measured.first.period
    if measured.plant.method != "multisine" or period is None:
        return None
    line = 2 * np.rint(frequency * period * measured.first.sample_time).astype(np.int64)
    window = (0.5 - 0.5 * np.cos(np.pi * np.arange(2 * period) / period))[:, None]
    parts, periods = [], 0
    for stretch in (s for one in measured.turned for s in one.stretches):
        count = len(stretch.signals) // period
        if count <= 1:
            continue
        periods += count
        whole = stretch.signals[len(stretch.signals) - count * period :, [INPUT, POSITION]]
        for first in range(0, (count - 1) * period, period):
            part = whole[first : first + 2 * period]
            u, q = np.fft.rfft((part - part.mean(axis=0)) * window, axis=0)[line].T
            if (u != 0.0).all():
                parts.append(q / u)
    return (np.array(parts), _CONFIG.hann * periods) if len(parts) >= _CONFIG.parts else None


def _paired(modes: tuple[Mode, ...]) -> tuple[tuple[Pair, ...], tuple[Mode, ...]]:
    """Each antiresonance with the resonance that follows it; and what has no partner."""
    pairs: list[Pair] = []
    single: list[Mode] = []
    waiting: list[Mode] = []  # the mode before, an antiresonance
    for mode in modes:
        if waiting and mode.kind == "resonance":
            pairs.append(Pair(waiting.pop(), mode))
        elif mode.kind == "resonance":
            single.append(mode)
        else:
            single += waiting
            waiting = [mode]
    single += waiting
    return tuple(pairs), tuple(single)


def _friction_below(measured: Measured, relative: FrequencyResponse, level: Known) -> float:
    """Up to where, from below, the magnitude is a tenth off, or the coherence too low to say."""
    low = relative.where(measured.excited.holds(relative.frequency)).within(0.0, 2.0 * BAND[0])
    size = abs(level.value)
    off = np.abs(np.abs(low.response) / size - 1.0) > _CONFIG.friction
    known = np.sqrt(low.variance) < 0.5 * _CONFIG.friction * size
    return float(low.frequency[off & known].max(initial=0.0))
