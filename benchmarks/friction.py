"""The friction fit of one joint beside a filterpy extended Kalman filter. Goal: ×100 at 20 s
(performance.md).

    python -m benchmarks.friction [--seeds 6] [--repeats 3]

Both take position and torque of one joint, 20 s at 1 kHz, friction of three sigmoids, and give
inertia, gravity and friction (ten numbers). Theirs is the paper's filter: filterpy's
ExtendedKalmanFilter over q, dq and the ten, one pass, started 15 % off the truth and given the true
noise of torque and encoder; its model and derivatives are plain scalar arithmetic, faster than
arrays of one. Ours is what `rrrid fit-friction` does with a given law, and is given neither, nor a
start: only the step of the encoder. It smooths the motion, fits, refines the motion about that once
or twice, fits again and gives the covariance. Errors are of the friction curve over the
driven speeds, rms over its rms, medians over the seeds.
"""

from __future__ import annotations

from benchmarks.side_by_side import HEADER, race, row  # isort: skip  # before numpy

import argparse
import math
import statistics
from collections.abc import Callable

import numpy as np

from benchmarks.textbook_kalman import ExtendedTextbook
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.friction.fit import Equations, LawFit, fit_law
from pipelines.friction.joint import refined
from pipelines.friction.laws import OneJoint, law_named
from pipelines.friction.weak_form import stretches_of
from tests.friction.one_joint import (
    ENCODER,
    INERTIA,
    JOINT,
    SINE,
    STEP,
    TRUTHS,
    as_log,
    driven_speeds,
    recorded,
    relative,
)

PARTS = 2  # midpoint steps a sample
CONSTANT = 11  # place of c'
Advance = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]

ROUNDS = {"refined once": 1, "refined twice": 2}
STATES = np.array([0.0, 0.0, 1.0 / INERTIA, SINE, 0.4, 1.2, -0.4, 120.0, 60.0, 12.0, 0.12, 0.35])
STD = np.array([ENCODER, 0.01, 2.0, 0.4, 0.3, 0.4, 0.2, 30.0, 20.0, 5.0, 0.05, 0.2])


def joint_step(step: float) -> Advance:
    """Return one sample of eq. (11) and (10) by midpoint steps, with its derivatives."""
    h = step / PARTS

    def acceleration(
        x: list[float], q: float, v: float, u: float
    ) -> tuple[float, float, float, list[float]]:
        """Return a, ∂a/∂q, ∂a/∂v, and ∂a/∂ of the constants."""
        theta, c, f1, f2, f3, w1, w2, w3, b = x[2:11]
        d = x[CONSTANT] if len(x) > CONSTANT else 0.0
        s, o = math.sin(q), math.cos(q)
        t1, t2, t3 = math.tanh(w1 * v), math.tanh(w2 * v), math.tanh(w3 * v)
        e1, e2, e3 = 1.0 - t1 * t1, 1.0 - t2 * t2, 1.0 - t3 * t3
        rest = u - c * s - d * o - f1 * t1 - f2 * t2 - f3 * t3 - b * v
        own = [
            rest,
            -theta * s,
            -theta * t1,
            -theta * t2,
            -theta * t3,
            -theta * f1 * e1 * v,
            -theta * f2 * e2 * v,
            -theta * f3 * e3 * v,
            -theta * v,
            -theta * o,
        ]
        return (
            theta * rest,
            theta * (d * s - c * o),
            -theta * (f1 * w1 * e1 + f2 * w2 * e2 + f3 * w3 * e3 + b),
            own[: len(x) - 2],
        )

    def advance(x: np.ndarray, u: float) -> tuple[np.ndarray, np.ndarray]:
        values = x.tolist()
        q, v = values[:2]
        (dq, dv), change = np.eye(2, len(x)), np.zeros(len(x))
        for _ in range(PARTS):
            a, aq, av, change[2:] = acceleration(values, q, v, u)
            q_mid, v_mid = q + 0.5 * h * v, v + 0.5 * h * a
            dq_mid = dq + (0.5 * h) * dv
            dv_mid = dv + (0.5 * h) * (aq * dq + av * dv + change)
            a, aq, av, change[2:] = acceleration(values, q_mid, v_mid, u)
            q, v = q + h * v_mid, v + h * a
            dq, dv = dq + h * dv_mid, dv + h * (aq * dq_mid + av * dv_mid + change)
        ahead = x.copy()
        ahead[:2] = q, v
        return ahead, np.stack([dq, dv])

    return advance


def ours(y: np.ndarray, tau: np.ndarray, rounds: int) -> LawFit:
    log, law = as_log(y, tau, "joint"), law_named("three_sigmoid")
    joint = OneJoint.of(log.robot, JOINT)
    stretches = stretches_of(log, JOINT, reconstruct(log, Reconstruction()), 0.02)
    fit = fit_law(Equations(stretches, joint), law)
    for _ in range(rounds):
        stretches = tuple(refined(stretch, fit, ENCODER) for stretch in stretches)
        fit = fit_law(Equations(stretches, joint), law, [fit.theta])
    return fit


def theirs(y: np.ndarray, tau: np.ndarray) -> np.ndarray:
    off = np.where(np.arange(12) < 2, 0.0, np.where(np.arange(12) % 2, 0.85, 1.15))
    reach = np.array([0.5 * STEP, 1.0]) * 0.02 * STEP / INERTIA
    process = np.zeros((12, 12))
    process[:2, :2] = np.outer(reach, reach)
    book = ExtendedTextbook(joint_step(STEP), process, ENCODER**2 / 12.0)
    return book.filter(y, tau, STATES * off, np.diag(np.square(STD))).states[-1]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    errors: dict[str, list[float]] = {name: [] for name in (*ROUNDS, "theirs")}
    for seed in range(arguments.seeds):
        log = recorded("three_sigmoid", seed)
        y, tau, speed = log.q[:, JOINT - 1], log.tau[:, JOINT - 1], driven_speeds(log)
        truth = TRUTHS["three_sigmoid"].curve(speed)
        for name, rounds in ROUNDS.items():
            errors[name].append(relative(ours(y, tau, rounds).curve(speed), truth))
        x = theirs(y, tau)
        errors["theirs"].append(
            relative(np.tanh(np.outer(speed, x[7:10])) @ x[4:7] + x[10] * speed, truth)
        )
    median = {name: statistics.median(values) for name, values in errors.items()}
    print(HEADER)
    log = recorded("three_sigmoid", 0)
    y, tau = log.q[:, JOINT - 1].copy(), log.tau[:, JOINT - 1].copy()
    for name, rounds in ROUNDS.items():
        print(
            row(
                f"20 s, {name}",
                race(
                    lambda rounds=rounds: ours(y, tau, rounds),
                    lambda: theirs(y, tau),
                    arguments.repeats,
                ),
                median[name],
                median["theirs"],
            ),
            flush=True,
        )


if __name__ == "__main__":
    main()
