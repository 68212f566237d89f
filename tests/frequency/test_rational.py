"""Rational fits: modes, plateaus and delays that are known come back, inside what the fit says of itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from pipelines.errors import InputRejected
from pipelines.frequency.controller import double_integrator
from pipelines.frequency.rational import Known, Rational, fit_rational
from pipelines.frequency.responses import averaged_responses
from pipelines.frequency.spectra import closed_loop
from tests.frequency.loops import Plant, T, closed_loop_record

FREQUENCY = np.arange(3.0, 180.0, 0.5)
DELAY = 2.1e-3


def _fit(frequency: np.ndarray, response: np.ndarray, variance: np.ndarray, integrators: np.ndarray | None = None,
         **more: float) -> Rational:
    """Of the response over that of the `integrators` that are known to be there; none: of two."""
    known = (2j * np.pi * frequency) ** -2 if integrators is None else integrators
    return fit_rational(frequency, response / known, variance / np.abs(known) ** 2, **more)


def _plateaus(found: Rational) -> tuple[Known, Known, Known]:
    """Gain below all modes, and above them where there are as many zeros as poles, else none; the delay [s]."""
    sign = np.repeat([1.0, -1.0], [found.zeros, found.poles])
    below, above = np.zeros((2, len(found.parameters)))
    below[0], above[0], above[3::2] = 1.0, 1.0, sign
    low, high = (Known(float(np.exp(g @ found.parameters)), float(np.exp(g @ found.parameters) * np.sqrt(g @ found.covariance @ g)))
                 for g in (below, above))
    delay = Known(float(found.parameters[1] / found.unit), float(np.sqrt(found.covariance[1, 1]) / found.unit))
    return low, high if found.zeros == found.poles else Known(0.0, 0.0), delay


def _truth(delay: float = DELAY) -> np.ndarray:
    """.8/s² with antiresonances at 26.5, 60 Hz and resonances at 28, 85 Hz, by scipy.signal."""
    def section(hertz: float, damping: float) -> list[float]:
        w = 2.0 * np.pi * hertz
        return [1.0 / w**2, 2.0 * damping / w, 1.0]

    up = np.polymul(section(26.5, 0.06), section(60.0, 0.03))
    down = np.polymul(section(28.0, 0.07), section(85.0, 0.025))
    _, flat = signal.freqs(up, down, 2.0 * np.pi * FREQUENCY)
    s = 2j * np.pi * FREQUENCY
    return np.asarray(0.8 / s**2 * flat * np.exp(-s * delay))


def _noisy(truth: np.ndarray, relative: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    std = relative * np.abs(truth)
    return truth + std / np.sqrt(2.0) * (rng.standard_normal(len(truth)) + 1j * rng.standard_normal(len(truth))), std**2


def test_four_modes_a_delay_and_two_plateaus_are_found() -> None:
    """3 seeds of 2 % noise: every number within four deviations, mean square deviation about one, and no mode that is not there."""
    deviations = []
    known = [("antiresonance", 26.5, 0.06), ("resonance", 28.0, 0.07), ("antiresonance", 60.0, 0.03), ("resonance", 85.0, 0.025)]
    for seed in range(3):
        found = _fit(FREQUENCY, *_noisy(_truth(), 0.02, np.random.default_rng(seed)))
        modes = found.modes()
        assert [m.kind for m in modes] == [kind for kind, _, _ in known]
        for mode, (_, hertz, damping) in zip(modes, known, strict=True):
            deviations += [(mode.frequency.value - hertz) / mode.frequency.std, (mode.damping.value - damping) / mode.damping.std]
        high = 0.8 * (28.0 / 26.5) ** 2 * (85.0 / 60.0) ** 2
        for one, value in zip(_plateaus(found), (0.8, high, DELAY), strict=True):
            deviations.append((one.value - value) / one.std)
        assert found.misfit == pytest.approx(1.0, abs=0.2)
    assert np.max(np.abs(deviations)) < 4.0
    assert np.mean(np.square(deviations)) == pytest.approx(1.0, abs=0.5)


@pytest.mark.parametrize("delay", [0.0, -5e-4, 4e-3])
def test_a_rigid_plant_has_no_modes(delay: float) -> None:
    """A held and sampled double integrator, late or not, as scipy samples it: gain, delay and nothing else, at any noise."""
    s = 2j * np.pi * FREQUENCY
    for seed, relative in enumerate((0.1, 0.01, 1e-4)):
        truth = Plant((), 0.5).response(FREQUENCY) * np.exp(-s * delay)
        found = _fit(FREQUENCY, *_noisy(truth, relative, np.random.default_rng(seed)), double_integrator(FREQUENCY, T))
        low, high, late = _plateaus(found)
        assert found.modes() == ()
        assert low.value == pytest.approx(0.5, abs=max(4.0 * low.std, 1e-4))
        assert late.value == pytest.approx(delay, abs=max(4.0 * late.std, 1e-7))
        assert high.value == low.value


def test_a_resonance_without_its_antiresonance() -> None:
    """Poles in the band, no zeros: seen from the far side of a spring."""
    w = 2.0 * np.pi * 70.0
    _, truth = signal.freqs([2.0], [1.0 / w**2, 0.04 / w, 1.0], 2.0 * np.pi * FREQUENCY)
    found = fit_rational(FREQUENCY, *_noisy(truth, 0.01, np.random.default_rng(1)), with_delay=False)
    mode, = found.modes()
    assert (mode.kind, found.parameters[1]) == ("resonance", 0.0)
    assert mode.frequency.value == pytest.approx(70.0, rel=1e-3)
    assert mode.damping.value == pytest.approx(0.02, rel=0.05)


def test_a_band_may_begin_between_an_antiresonance_and_its_resonance() -> None:
    """There the response is turned round: it is not of the other sign, and the resonance above is found."""
    f, w = np.arange(25.0, 325.0), 2.0 * np.pi * np.array([24.0, 40.0])
    _, truth = signal.freqs([1.0 / w[0]**2, 0.06 / w[0], 1.0], [1.0 / w[1]**2, 0.08 / w[1], 1.0], 2.0 * np.pi * f)
    found = fit_rational(f, truth, (0.01 * np.abs(truth)) ** 2)
    mode, = found.modes()
    assert (mode.kind, mode.frequency.value) == ("resonance", pytest.approx(40.0, rel=1e-3))


def test_a_variance_that_is_estimated_adds_no_modes() -> None:
    """Variances with four degrees of freedom: taken for known they fake pairs of poles, taken for what they are hardly any."""
    known, estimated = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        response, variance = _noisy(_truth(), 0.05, rng)
        variance = variance * rng.gamma(4.0, 0.25, len(variance))
        known.append(_fit(FREQUENCY, response, variance).poles - 2)
        estimated.append(_fit(FREQUENCY, response, variance, freedom=4.0).poles - 2)
    assert min(estimated) == 0
    assert sum(estimated) <= 1
    assert sum(known) >= 3


def _nearest(found: Rational, kind: str, hertz: float) -> tuple[float, float, float, float]:
    """Relative error of frequency and damping [value] and both stds of the nearest mode of a kind."""
    mode = min((m for m in found.modes() if m.kind == kind), key=lambda m: abs(m.frequency.value - hertz))
    return mode.frequency.value, mode.frequency.std, mode.damping.value, mode.damping.std


def _campaign(seeds: range) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors and deviations (modes, 2) of machines with two modes in a loop, noise and multisines."""
    errors, deviations = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        plant = Plant(((rng.uniform(24, 32), rng.uniform(0.02, 0.08), rng.uniform(0.05, 0.3)),
                       (rng.uniform(40, 120), rng.uniform(0.01, 0.04), rng.uniform(0.3, 1.5))))
        samples, period = 56_000, 4000
        spectrum = np.zeros(period // 2 + 1, dtype=complex)
        spectrum[4:1000] = np.exp(2j * np.pi * rng.random(996))
        one = np.fft.irfft(spectrum, period)
        periodic = seed % 2 == 0
        v = 10.0 * (np.resize(one / one.std(), samples) if periodic else rng.standard_normal(samples))
        drift = np.cumsum(rng.standard_normal(samples))
        d = 3.0 * drift / drift.std() + 2.0 * rng.standard_normal(samples)
        x = closed_loop_record(plant, v, d, 2e-6 * rng.standard_normal(samples), 400.0, 28.0)
        halves = (x[:samples // 2], x[samples // 2:])
        several = averaged_responses(halves, 1.0 / T, *((2 * period, 2) if periodic else (samples // 5, 1)))
        p = closed_loop(several).within(2.0, 200.0)
        found = _fit(p.frequency, p.response, p.variance, double_integrator(p.frequency, T), correlated=p.correlated, freedom=p.freedom)
        truth = [("antiresonance", *z) for z in plant.antiresonances()] + [("resonance", f, z) for f, z, _ in plant.modes]
        for kind, hertz, damping in truth:
            f, f_std, z, z_std = _nearest(found, kind, hertz)
            errors.append((abs(f / hertz - 1.0), abs(z / damping - 1.0)))
            deviations.append(((f - hertz) / f_std, (z - damping) / z_std))
    return np.array(errors), np.array(deviations)


def test_modes_of_plants_in_a_loop() -> None:
    """Four machines: frequencies within 1 %, damping within 15 %, none beyond four deviations."""
    errors, deviations = _campaign(range(2))
    assert (errors < np.array([0.01, 0.15])).all()
    assert np.abs(deviations).max() < 4.0


@pytest.mark.slow
def test_modes_of_many_plants_lie_in_their_bands() -> None:
    """Sixty machines: as above, and at least 90 % inside the 95 % bands."""
    errors, deviations = _campaign(range(100, 160))
    assert (errors < np.array([0.01, 0.15])).all()
    assert (np.abs(deviations) < 1.96).mean(axis=0).min() >= 0.9


def test_too_little_to_fit_is_said() -> None:
    """Few bins, or none with a response."""
    unknown = np.full(50, np.nan)
    for frequency, response, variance, code in ((FREQUENCY[:10], _truth()[:10], np.ones(10), "T08"),
                                                (FREQUENCY[:50], unknown, np.full(50, np.inf), "D09")):
        with pytest.raises(InputRejected) as refused:
            fit_rational(frequency, response, variance)
        assert refused.value.code == f"RRID-{code}"


@pytest.mark.parametrize("kind", ["noise", "exact ones", "hardly damped", "wandering", "late, with holes"])
def test_any_response_ends_in_finite_numbers(kind: str) -> None:
    """Noise, constants, poles next to a bin, bins that are unknown: no warning, and every number with its deviation."""
    rng = np.random.default_rng(9)
    f = np.sort(rng.uniform(0.5, 300.0, 120))
    noise = rng.standard_normal(120) + 1j * rng.standard_normal(120)
    response, variance = {
        "noise": (noise, np.full(120, 1e-30)), "exact ones": (np.ones(120) + 0j, np.zeros(120)),
        "hardly damped": (1.0 / (1.0 - (f / 50.0) ** 2 + 2e-5j * f), np.full(120, 1e-8)),
        "wandering": (np.cumsum(noise), 10.0 ** rng.uniform(-8.0, 3.0, 120)),
        "late, with holes": (np.where(np.arange(120) % 7 == 0, np.nan, np.exp(-0.2j * f) * (1.0 + 0.2 * noise)),
                             np.full(120, 0.04)),
    }[kind]
    found = _fit(f, response, variance, T / np.expm1(2j * np.pi * f * T), freedom=5.0, correlated=3.0)
    numbers = [n for k in (*_plateaus(found), *(x for m in found.modes() for x in (m.frequency, m.damping)))
               for n in (k.value, k.std)]
    assert np.isfinite(numbers).all()
    assert np.isfinite(found.response(f)).all()
    assert np.isfinite(found.covariance).all()
