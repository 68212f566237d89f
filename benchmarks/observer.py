"""The Kalman observer and smoother beside filterpy loops. Goals: ×1000 and ×500 at 1e4 samples, 3
joints (performance.md).

    python -m benchmarks.observer [--samples 10000] [--grow 1000000] [--statsmodels]

Theirs is the loop one writes with filterpy, one joint after another: update, keep the state,
predict; for the smoother filterpy's own batch_filter and rts_smoother. They start from a known
covariance. Ours is shown in four ways:

    kept             with the matrices of the observer, and of its start, kept from the log before,
                     as for the logs of a folder; the goals are for these
    new              the gain, the matrices and the start designed from σ and R in the timed run:
                     what a first short log costs
    known start      the same start as theirs: every sample is compared
    unknown start    of a recording: compared where the start is forgotten (`Observer.settled`)

Errors are the worst of q, dq, ddq relative to the largest, ours against theirs, so theirs are zero
by definition; each is that of the very case. --statsmodels compares with that compiled one, if
installed.
"""

from __future__ import annotations

from benchmarks.side_by_side import HEADER, race, row  # isort: skip  # before numpy

import argparse
import time
import tracemalloc
from collections.abc import Callable
from functools import partial
from itertools import product

import numpy as np
from filterpy.kalman import KalmanFilter

from pipelines.estimation.chain import held_input, transition
from pipelines.estimation.state_estimation import Start, design, observe, smooth

T, STEP = 1e-3, 1e-5
SIGMA, R = np.array([200.0, 500.0, 3770.0]), STEP**2 / 12
MEAN, COVARIANCE = np.zeros(3), np.diag([1e-6, 1.0, 1e3])
START = Start(np.tile(MEAN, (3, 1)), np.tile(COVARIANCE, (3, 1, 1)))


def measured(samples: int) -> np.ndarray:
    """Three joints that swing, as encoders count it."""
    t = np.arange(samples)[:, None] * T
    hz = np.array([1.0, 2.3, 4.1])
    return np.asarray(
        np.round((np.sin(2 * np.pi * hz * t) + 0.1 * np.sin(2 * np.pi * 9.7 * t)) / STEP) * STEP
    )


def textbook(sigma: float) -> KalmanFilter:
    kalman = KalmanFilter(dim_x=3, dim_z=1)
    reach = held_input(3, np.array(T)) * sigma
    kalman.F, kalman.Q, kalman.H = transition(3, np.array(T)), np.outer(reach, reach), np.eye(3)[:1]
    kalman.R, kalman.x, kalman.P = np.array([[R]]), MEAN.copy(), COVARIANCE.copy()
    return kalman


def their_observer(y: np.ndarray) -> np.ndarray:
    out = np.empty((*y.shape, 3))
    for j, sigma in enumerate(SIGMA):
        kalman = textbook(sigma)
        for k, value in enumerate(y[:, j]):
            kalman.update(value)
            out[k, j] = kalman.x
            kalman.predict()
    return out


def their_smoother(y: np.ndarray) -> np.ndarray:
    out = np.empty((*y.shape, 3))
    for j, sigma in enumerate(SIGMA):
        kalman = textbook(sigma)
        means, covariances, _, _ = kalman.batch_filter(y[:, j], update_first=True)
        out[:, j] = kalman.rts_smoother(means, covariances)[0]
    return out


def statsmodels_smoother(y: np.ndarray) -> np.ndarray:
    from statsmodels.tsa.statespace.kalman_smoother import SMOOTHER_STATE, KalmanSmoother

    out = np.empty((*y.shape, 3))
    for j, sigma in enumerate(SIGMA):
        model = KalmanSmoother(k_endog=1, k_states=3, k_posdef=1)
        model.bind(y[:, j].copy())
        model["design"], model["transition"] = np.eye(3)[:1], transition(3, np.array(T))
        model["selection"], model["state_cov"] = (
            (held_input(3, np.array(T)) * sigma)[:, None],
            np.eye(1),
        )
        model["obs_cov"] = np.array([[R]])
        model.initialize_known(MEAN, COVARIANCE)
        model.set_smoother_output(SMOOTHER_STATE)
        out[:, j] = model.smooth().smoothed_state.T
    return out


def error(states: np.ndarray, reference: np.ndarray) -> float:
    """`states` (order, samples, joints) against (samples, joints, order): the worst, relative to
    the largest of its kind.
    """
    apart = np.abs(states.transpose(1, 2, 0) - reference).max(axis=(0, 1))
    return float((apart / np.abs(reference).max(axis=(0, 1))).max())


def compare(samples: int, with_statsmodels: bool) -> None:
    y, size = measured(samples), f"{samples:.0e} × 3"
    observer = design(T, SIGMA, R)
    for name, ours, theirs, kept in (
        ("observer", observe, their_observer, observer),
        ("smoother", smooth, their_smoother, observer),
    ):
        reference = theirs(y)
        for of, start in product((kept, None), (START, None)):

            def run(ours=ours, of=of, start=start):  # type: ignore[no-untyped-def]
                return ours(y, of or design(T, SIGMA, R), start)

            first = 0 if start else observer.settled
            apart = error(run().states[:, first:], reference[first:])
            title = f"{name}, {'kept' if of else 'new'}, {'known' if start else 'unknown'} start"
            contest = race(run, partial(theirs, y), repeats=5)
            print(row(f"{size}, {title}", contest, apart, 0.0), flush=True)
    if with_statsmodels:
        known = partial(smooth, y, observer, START)
        contest = race(known, partial(statsmodels_smoother, y), repeats=5)
        apart = error(known().states, statsmodels_smoother(y))
        print(row(f"{size}, smoother, against statsmodels", contest, apart, 0.0), flush=True)


def grow(largest: int) -> None:
    """Time and memory of ours from 1e4 samples upwards, and the exponent of the time."""
    observer = design(T, SIGMA, R)
    sizes = [n for n in (10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000) if n <= largest]
    for name, run in (
        ("observer", partial(observe, observer=observer)),
        ("smoother", partial(smooth, observer=observer)),
    ):
        seconds = []
        for n in sizes:
            y = measured(n)
            seconds.append(best(partial(run, y)))
        slope = np.polyfit(np.log(sizes), np.log(seconds), 1)[0]
        times = ", ".join(
            f"{n:.0e} in {s * 1e3:.1f} ms" for n, s in zip(sizes, seconds, strict=True)
        )
        print(f"{name}: {times}; exponent {slope:.3f}", flush=True)
        tracemalloc.start()
        run(y)
        peak = tracemalloc.get_traced_memory()[1] - y.size * 24
        tracemalloc.stop()
        print(f"{name}: {peak / 1e6:.1f} MB beside the result at {sizes[-1]:.0e} samples")


def best(run: Callable[[], object], repeats: int = 15) -> float:
    run()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, nargs="+", default=[10_000])
    parser.add_argument(
        "--grow", type=int, default=1_000_000, help="largest number of samples; 0 leaves it out"
    )
    parser.add_argument("--statsmodels", action="store_true")
    arguments = parser.parse_args()
    print(HEADER)
    for samples in arguments.samples:
        compare(samples, arguments.statsmodels)
    if arguments.grow:
        grow(arguments.grow)


if __name__ == "__main__":
    main()
