"""Frequency responses: averaged segments beside scipy and pyFRF, modes of plants in a loop.

    python -m benchmarks.spectra [--samples 60000 600000] [--modes 24]

Goals (performance.md): ≥ ×5 four scipy calls, ≥ ×1.5 pyFRF, linear in N; equal to scipy to 1e-12.
Modes: frequency within 1 %, damping within 15 %, inside the 95 % bands in 90 %.

Ours gives all six spectra of v, r, q and from them both responses, their coherence and their
covariance. The four scipy calls are csd of v with r and with q, welch of v, and coherence of v with
q. pyFRF gives both responses and both coherences; its segments are transformed once too, on every
core there is; its window is symmetric, hence the small difference. Errors are relative to scipy's.
"CPU" is the smallest processor time of many runs: on a machine that others use as well it spreads
less than the clock.
"""

from __future__ import annotations

from benchmarks.side_by_side import HEADER, race, row  # isort: skip  # before numpy

import argparse
import gc
import time
from collections.abc import Callable, Sequence

import numpy as np
from scipy import signal

from pipelines.frequency.controller import double_integrator
from pipelines.frequency.rational import Mode, fit_rational
from pipelines.frequency.responses import averaged_responses
from pipelines.frequency.spectra import closed_loop, cross_spectra
from tests.frequency.loops import Plant, T, closed_loop_record, welch_responses

RATE, SEGMENT = 1000, 4000


def record(samples: int) -> np.ndarray:
    """v, r, q of a plant with a mode in a loop (samples, 3)."""
    rng = np.random.default_rng(3)
    v, d, n = (scale * rng.standard_normal(samples) for scale in (10.0, 2.0, 2e-6))
    return closed_loop_record(Plant(((28.0, 0.05, 0.3),)), v, d, n, 400.0, 28.0)


def scipys(x: np.ndarray) -> tuple[np.ndarray, ...]:
    v, r, q = x.T
    options = {"fs": float(RATE), "nperseg": SEGMENT}
    return (
        signal.csd(v, r, **options)[1],
        signal.csd(v, q, **options)[1],
        signal.welch(v, **options)[1],
        signal.coherence(v, q, **options)[1],
    )


def compare(samples: int) -> list[str]:
    x = record(samples)
    found, (vr, vq, vv, coherence) = cross_spectra((x,), RATE, SEGMENT), scipys(x)
    pairs = (
        (found.density[:, 0, 1], vr),
        (found.density[:, 0, 2], vq),
        (found.density[:, 0, 0], vv),
        (found.coherence(0, 2), coherence),
    )
    error_ours = max(np.abs(a - b).max() / np.abs(b).max() for a, b in pairs)

    def ours() -> object:
        return welch_responses((x,), RATE, SEGMENT)

    repeats = 25 if samples <= 100_000 else 9
    lines = [
        row(
            f"four scipy calls, {samples:.0e} samples",
            race(ours, lambda: scipys(x), repeats),
            error_ours,
            0.0,
        )
    ]
    try:
        import pyFRF
    except ImportError:
        return [*lines, "pyFRF is not installed"]

    def theirs() -> tuple[np.ndarray, np.ndarray]:
        made = pyFRF.FRF(
            RATE,
            exc=x.T[None, :1].copy(),
            resp=x.T[None, 1:].copy(),
            exc_type="f",
            resp_type="d",
            window="hann",
            fft_len=SEGMENT,
            nperseg=SEGMENT,
            noverlap=SEGMENT // 2,
            copy=False,
        )
        return made.get_H1(), made.get_coherence()

    response = vr[1:] / vv[1:]
    error = np.abs(theirs()[0][0, 0, 1:] - response).max() / np.abs(response).max()
    mine, scipy_cpu, pyfrf_cpu = _cpu(ours), _cpu(lambda: scipys(x)), _cpu(theirs)
    return [
        *lines,
        row(f"pyFRF, {samples:.0e} samples", race(ours, theirs, repeats), error_ours, error),
        f"  CPU: ours {1e3 * mine:.2f} ms, scipy ×{scipy_cpu / mine:.1f}, pyFRF "
        f"×{pyfrf_cpu / mine:.1f}",
    ]


def _cpu(work: Callable[[], object], repeats: int = 25) -> float:
    """Smallest processor time [s] of several runs, of all threads."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def growth(counts: tuple[int, ...] = (40_000, 200_000, 1_000_000)) -> str:
    """Exponent of time over samples, in turn."""
    times: dict[int, list[float]] = {n: [] for n in counts}
    records = {n: record(n) for n in counts}
    for _ in range(7):
        for n, x in records.items():
            gc.collect()
            start = time.process_time()
            for _ in range(max(1, 400_000 // n)):
                cross_spectra((x,), RATE, SEGMENT)
            times[n].append((time.process_time() - start) / max(1, 400_000 // n))
    slope = np.polyfit(np.log(counts), np.log([np.median(times[n]) for n in counts]), 1)[0]
    return f"CPU grows with samples to the power {slope:.2f}: " + ", ".join(
        f"{n:.0e} {1e9 * np.median(times[n]) / n:.0f} ns/sample" for n in counts
    )


def _in_a_loop(plant: Plant, multisine: bool, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Record the plant for 56 s in a loop with disturbances."""
    spectrum = np.zeros(2001, dtype=complex)
    spectrum[4:1000] = np.exp(2j * np.pi * rng.random(996))
    if multisine:
        v = np.resize(np.fft.irfft(spectrum, 4000), 56_000)
    else:
        v = rng.standard_normal(56_000)
    drift = np.cumsum(rng.standard_normal(len(v)))
    disturbance = 3.0 * drift / drift.std() + 2.0 * rng.standard_normal(len(v))
    noise = 2e-6 * rng.standard_normal(len(v))
    return closed_loop_record(plant, 10.0 * v / v.std(), disturbance, noise, 400.0, 28.0)


def _beside_the_truth(
    plant: Plant, fitted: Sequence[Mode]
) -> list[tuple[float, float, bool, bool]]:
    """Return errors of frequency and damping of each true mode, and whether within 95 %."""
    rows = []
    truth = [("antiresonance", *z) for z in plant.antiresonances()]
    truth += [("resonance", f, z) for f, z, _ in plant.modes]
    for kind, hertz, damping in truth:
        alike = [mode for mode in fitted if mode.kind == kind]
        one = min(alike, key=lambda mode, f=hertz: abs(mode.frequency.value - f))
        f, z = one.frequency, one.damping
        off, damped = abs(f.value - hertz), abs(z.value - damping)
        rows.append((off / hertz, damped / damping, off < 1.96 * f.std, damped < 1.96 * z.std))
    return rows


def modes(plants: int) -> str:
    """Fit base at 24-32 Hz and joint at 40-120 Hz in a loop with disturbances; four modes each."""
    found: dict[str, list[tuple[float, float, bool, bool]]] = {
        "random": [],
        "multisine": [],
    }
    extra, seconds = 0, 0.0
    for seed in range(plants):
        for way, rows in found.items():
            rng = np.random.default_rng(seed)
            plant = Plant(
                (
                    (rng.uniform(24, 32), rng.uniform(0.02, 0.08), rng.uniform(0.05, 0.3)),
                    (rng.uniform(40, 120), rng.uniform(0.01, 0.04), rng.uniform(0.3, 1.5)),
                )
            )
            x, multisine = _in_a_loop(plant, way == "multisine", rng), way == "multisine"
            start = time.process_time()
            stretches = (x[:28_000], x[28_000:])
            segment = (8000, 2) if multisine else (11_000, 1)
            several = averaged_responses(stretches, RATE, *segment)
            p = closed_loop(several).within(2.0, 200.0)
            p = p.times(1.0 / double_integrator(p.frequency, T))
            fitted = fit_rational(
                p.frequency, p.response, p.variance, correlated=p.correlated, freedom=p.freedom
            )
            seconds += time.process_time() - start
            extra += max(len(fitted.modes()) - 4, 0)
            rows += _beside_the_truth(plant, fitted.modes())
    lines = [
        f"modes, {plants} plants, two excitations: {extra} that are not there, "
        f"{seconds / plants / 2:.2f} s of CPU each"
    ]
    for way, rows in found.items():
        table = np.array(rows, dtype=np.float64)
        worst, inside = 100.0 * table[:, :2].max(axis=0), 100.0 * table[:, 2:].mean(axis=0)
        lines.append(
            f"  {way}: frequency, largest error {worst[0]:.2f} %, inside 95 % bands "
            f"{inside[0]:.0f} %; "
            f"damping, largest {worst[1]:.1f} %, inside {inside[1]:.0f} %"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, nargs="+", default=[60_000, 600_000])
    parser.add_argument("--modes", type=int, default=24)
    given = parser.parse_args()
    print(HEADER)
    for samples in given.samples:
        print("\n".join(compare(samples)), flush=True)
    print(growth(), flush=True)
    print(modes(given.modes))


if __name__ == "__main__":
    main()
