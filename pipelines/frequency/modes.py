"""Fit the modes of a response: where it leaves the rigid body, with frequency and damping.

    modes = fitted_modes(measured)

The response over the sampled double integrator is the acceleration beside that of a rigid body that
the controller's model describes: 1 where that model is right, under any hold. A rational
function is fitted to it. An antiresonance with a resonance above it is a compliant part; what
it carries drops out above it, and the level rises by (f_r / f_a)².
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pipelines.frequency.config import ModesConfig, RationalConfig
from pipelines.frequency.controller import double_integrator, loop_delay
from pipelines.frequency.rational import FEWEST, Known, Mode, Rational, fit_rational
from pipelines.frequency.responses import Measured
from pipelines.frequency.spectra import Array, Complex, FrequencyResponse, inside

__all__ = [
    "BAND",
    "Modes",
    "Pair",
    "fitted_modes",
    "informative",
    "relative_acceleration",
    "with_enough_bins",
]

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

    modes: tuple[Mode, ...]  # by frequency
    pairs: tuple[Pair, ...]
    single: tuple[Mode, ...]  # that have no partner
    level: Known  # of the rigid body above friction and below the modes: 1 if its inertia is right
    delay: Known  # [s], beside the hold and the controller's own delay
    flat: float  # largest deviation from `level` beside the modes, as a ratio ≥ 1
    inertia: Known | None  # [kg m^2] that the torque moves below the modes
    misfit: float  # 1 where the rational function explains all but the noise
    scatter: float  # two of it hold 95 % of the bins about the fit, as a share of the response
    hidden: float  # two of it hold 95 % of their means over as much as a mode is wide
    band: tuple[float, float]  # [Hz] of the fit
    relative: FrequencyResponse  # acceleration per input
    fit: Rational


def relative_acceleration(measured: Measured) -> FrequencyResponse:
    """Return the plant's response over the double integrator, sampled and late as the loop was."""
    first, plant = measured.first, measured.held or measured.plant
    _, delay = loop_delay(first.controller, first.quantity)
    rigid = double_integrator(plant.frequency, first.sample_time, delay, first.held)
    return plant.times(np.asarray(1.0 / rigid))


def informative(measured: Measured, band: tuple[float, float] = BAND) -> bool:
    """Return whether enough of `band` [Hz] is excited for a fit, and nothing has folded into it."""
    count = len(_in_band(measured, measured.plant, band).frequency)
    return not measured.aliased and count >= FEWEST


def with_enough_bins(measured: Measured, band: tuple[float, float] = BAND) -> Measured:
    """Return `measured` without the response `held` where that has too few bins for a fit."""
    held = measured.held
    if held is None or len(_in_band(measured, held, band).frequency) >= FEWEST:
        return measured
    return replace(measured, held=None)


def _in_band(
    measured: Measured, response: FrequencyResponse, band: tuple[float, float]
) -> FrequencyResponse:
    """Return the bins of `band` [Hz] that are excited, and sampled well enough."""
    part = response.within(band[0], min(band[1], _CONFIG.of_rate * measured.first.rate))
    return part.where(inside(measured.excited, part.frequency))


def fitted_modes(measured: Measured, band: tuple[float, float] = BAND) -> Modes:
    """Return the modes of the plant within `band` [Hz].

    Raises:
        InputRejected: T08, too few frequencies in the band.
    """
    relative = relative_acceleration(measured)
    part = _in_band(measured, relative, band)
    fit = _fitted(part)
    modes = tuple(
        replace(mode, damping=_of_friction(mode.damping))
        for mode in fit.modes()
        if mode.damping.value < _CONFIG.stiffest
        and mode.frequency.std < _CONFIG.sure * mode.frequency.value
        and inside(measured.excited, np.array(mode.frequency.value))
    )
    pairs, single = _paired(modes)
    level, delay = _level_and_delay(part, fit, _carried(modes, part.frequency))
    smooth = np.arange(_CONFIG.straight[0], min(_CONFIG.straight[1], part.frequency[-1]), 1.0)
    size = np.abs(fit.response(smooth) / _carried(modes, smooth)) / level.value
    scatter, hidden = _scatter(fit, part)
    inertia = None
    if measured.torque_per_input is not None:
        value = measured.torque_per_input / level.value
        inertia = Known(value, abs(value) * level.std / level.value)
    return Modes(
        modes=modes,
        pairs=pairs,
        single=single,
        level=level,
        delay=delay,
        flat=float(max(size.max(), 1.0 / size.min())),
        inertia=inertia,
        misfit=fit.misfit,
        scatter=scatter,
        hidden=hidden,
        band=(float(part.frequency[0]), float(part.frequency[-1])),
        relative=relative,
        fit=fit,
    )


def _fitted(part: FrequencyResponse) -> Rational:
    """Fit the rational function; where the search got stuck, without a delay if that is better."""

    def fit(with_delay: bool) -> Rational:
        return fit_rational(
            part.frequency,
            part.response,
            part.variance,
            with_delay=with_delay,
            correlated=part.correlated,
            freedom=part.freedom,
        )

    first = fit(True)
    if first.misfit < _CONFIG.stuck:
        return first
    return min(first, fit(False), key=lambda one: one.description)


def _carried(modes: tuple[Mode, ...], frequency: Array) -> Complex:
    """Π (1 + 2ζ s/ω + s²/ω²) of antiresonances over that of resonances, 1 far below them all."""
    value = np.ones(len(frequency), dtype=np.complex128)
    for mode in modes:
        s = 1j * frequency / mode.frequency.value  # over ω
        section = 1.0 + 2.0 * mode.damping.value * s + s**2
        value = value * section if mode.kind == "antiresonance" else value / section
    return value


def _level_and_delay(
    part: FrequencyResponse, fit: Rational, carried: Complex
) -> tuple[Known, Known]:
    """Mean size of the rest beside the modes, and the slope of its phase beside friction's 1/ω.

    By weighted least squares; deviations hold what scatters in fact, were that more than the noise.
    """
    rest = part.times(1.0 / carried).within(*_CONFIG.straight)
    relative = 0.5 * rest.variance / np.abs(rest.response) ** 2
    rest, relative = rest.where(relative < _CONFIG.vague), relative[relative < _CONFIG.vague]
    if len(rest.frequency) < _CONFIG.fewest:
        size = float(np.median(np.abs(part.response / carried)))
        return Known(size, np.inf), Known(0.0, np.inf)
    weight = 1.0 / np.maximum(relative, RationalConfig().floor ** 2)
    omega = 2.0 * np.pi * rest.frequency
    straight = rest.response * np.exp(1j * omega * fit.delay)
    middle = np.sum(weight * straight / np.abs(straight))
    phase = np.angle(straight / middle) + np.angle(middle)
    ones = np.ones((len(omega), 1))
    log_level = _weighted(ones, np.log(np.abs(straight)), weight, part.correlated)
    slope = _weighted(np.column_stack([-omega, 1.0 / omega]), phase, weight, part.correlated)
    level = float(np.exp(log_level.value))
    return Known(level, level * log_level.std), Known(fit.delay + slope.value, slope.std)


def _weighted(columns: Array, y: Array, weight: Array, correlated: float) -> Known:
    """Return the number of the first column."""
    scale = np.sqrt((columns**2 * weight[:, None]).sum(axis=0))
    unit = columns / scale
    inverse = np.linalg.inv((unit * weight[:, None]).T @ unit)
    found = inverse @ (unit.T @ (weight * y))
    misfit = float(weight @ (y - unit @ found) ** 2) / max(len(y) - len(found), 1)
    std = np.sqrt(inverse[0, 0] * correlated * max(misfit, 1.0)) / scale[0]
    return Known(float(found[0] / scale[0]), float(std))


def _scatter(fit: Rational, part: FrequencyResponse) -> tuple[float, float]:
    """Half of the deviation that 95 % of bins, or of their local means, have at most.

    By what the fit leaves or by noise. A mode that noise hides is narrower than such a mean.
    """
    rest = part.within(*_CONFIG.straight)
    f, share = rest.frequency, 0.95  # numerics: two deviations
    left = np.abs(rest.response / fit.response(f) - 1.0) ** 2
    spread = np.maximum(left, rest.variance / np.abs(rest.response) ** 2)
    spacing = part.correlated * float(np.median(np.diff(part.frequency)))
    bins = np.maximum(_CONFIG.seen_over * f / spacing, 1.0)
    of_bins, of_means = np.sqrt(np.quantile([spread, spread / bins], share, axis=1))
    return 0.5 * float(of_bins), 0.5 * float(of_means)


def _of_friction(damping: Known) -> Known:
    """Return the damping as uncertain as friction makes it where v swings the speed."""
    return replace(damping, std=float(np.hypot(damping.std, _CONFIG.by_friction * damping.value)))


def _paired(modes: tuple[Mode, ...]) -> tuple[tuple[Pair, ...], tuple[Mode, ...]]:
    """Each antiresonance with the resonance that follows it; and what has no partner."""
    pairs = tuple(
        Pair(a, b) for a, b in pairwise(modes) if (a.kind, b.kind) == ("antiresonance", "resonance")
    )
    partners = {id(mode) for pair in pairs for mode in (pair.antiresonance, pair.resonance)}
    return pairs, tuple(mode for mode in modes if id(mode) not in partners)
