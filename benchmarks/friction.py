"""The friction fit of one joint beside a filterpy extended Kalman filter. Goal: ×100 at 20 s (performance.md).

    python -m benchmarks.friction [--seeds 6] [--repeats 3]

Both take position and torque of one joint, 20 s at 1 kHz, friction of three sigmoids, and give inertia, gravity and friction
(ten numbers). Theirs is the paper's filter: filterpy's ExtendedKalmanFilter over q, dq and the ten, one pass, started 15 % off
the truth and told the true noise of torque and encoder; its model and derivatives are plain scalar arithmetic, faster than
arrays of one. Ours is told neither: it tunes a smoother on 8 s, makes the equations, scans for starts and solves them; refined
smooths again about what was fitted, once or twice. Errors are of the friction curve over the driven speeds, rms over its rms,
medians over the seeds.
"""

from __future__ import annotations

from benchmarks.side_by_side import HEADER, race, row  # isort: skip  # before numpy

import argparse
import statistics

import numpy as np

from pipelines.model.friction.ekf import joint_step
from pipelines.model.friction.equations import LawEquations
from pipelines.model.friction.fit_law import fit_law
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import law_named
from pipelines.model.friction.one_joint import OneJoint
from pipelines.model.friction.refine import refined
from pipelines.model.friction.weak_form import Stretch
from pipelines.signal.kalman import ExtendedTextbook
from pipelines.signal.observer import design
from pipelines.signal.smoother import smooth
from pipelines.signal.tuning import tune_jerk, tune_smoother
from tests.model.friction.one_joint import ENCODER, INERTIA, JOINT, SINE, STEP, TRUTHS, driven_speeds, recorded, relative

NAMES = ("plain", "refined", "refined twice")
TUNED = 8192  # samples that the smoother is tuned on
ROWS = 240  # of the first fit, which is only where refining begins
STATES = np.array([0.0, 0.0, 1.0 / INERTIA, SINE, 0.4, 1.2, -0.4, 120.0, 60.0, 12.0, 0.12, 0.35])
STD = np.array([ENCODER, 0.01, 2.0, 0.4, 0.3, 0.4, 0.2, 30.0, 20.0, 5.0, 0.05, 0.2])


def ours(y: np.ndarray, tau: np.ndarray, rounds: int) -> LawFit:
    resolution, middle = np.array([ENCODER]), slice(len(y) // 2 - TUNED // 2, len(y) // 2 + TUNED // 2)
    causal = tune_jerk(y[middle, None], STEP, resolution, 3)
    jerk = np.minimum(tune_smoother(y[middle, None], STEP, resolution, 3).jerk_std, causal.jerk_std)
    states = smooth(y[:, None], design(STEP, jerk, causal.noise_variance, 3)).states[..., 0]
    spoilt = np.zeros(len(y), dtype=bool)
    spoilt[:50] = spoilt[-50:] = True
    stretch = Stretch("log", np.arange(len(y)) * STEP, y, tau, states[0], states[1], spoilt, True, 20, True, ())
    joint, law = OneJoint.of(recorded("three_sigmoid", 0).robot, JOINT), law_named("three_sigmoid")
    assert law is not None
    first = LawEquations.of((stretch,), joint)
    fit = fit_law(first.thinned(ROWS) if rounds else first, law)
    for _ in range(rounds):
        stretch = refined(stretch, fit, ENCODER)
        fit = fit_law(LawEquations.of((stretch,), joint), law, [fit.theta])
    return fit


def theirs(y: np.ndarray, tau: np.ndarray) -> np.ndarray:
    off = np.where(np.arange(12) < 2, 0.0, np.where(np.arange(12) % 2, 0.85, 1.15))
    reach = np.array([0.5 * STEP, 1.0]) * 0.02 * STEP / INERTIA
    process = np.zeros((12, 12))
    process[:2, :2] = np.outer(reach, reach)
    book = ExtendedTextbook(joint_step(STEP), process, ENCODER**2 / 12.0)
    return book.filter(y, tau, STATES * off, np.diag(np.square(STD))).states[-1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    errors: dict[str, list[float]] = {name: [] for name in (*NAMES, "theirs")}
    for seed in range(arguments.seeds):
        log = recorded("three_sigmoid", seed)
        y, tau, speed = log.q[:, JOINT - 1], log.tau[:, JOINT - 1], driven_speeds(log)
        truth = TRUTHS["three_sigmoid"].curve(speed)
        for rounds, name in enumerate(NAMES):
            errors[name].append(relative(ours(y, tau, rounds).curve(speed), truth))
        x = theirs(y, tau)
        errors["theirs"].append(relative(np.tanh(np.outer(speed, x[7:10])) @ x[4:7] + x[10] * speed, truth))
    median = {name: statistics.median(values) for name, values in errors.items()}
    print(HEADER)
    log = recorded("three_sigmoid", 0)
    y, tau = log.q[:, JOINT - 1].copy(), log.tau[:, JOINT - 1].copy()
    for rounds, name in enumerate(NAMES):
        print(row(f"20 s, {name}", race(lambda rounds=rounds: ours(y, tau, rounds), lambda: theirs(y, tau), arguments.repeats),
                  median[name], median["theirs"]), flush=True)


if __name__ == "__main__":
    main()
