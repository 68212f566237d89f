"""The closed-loop simulation beside the usual Pinocchio loop. Goals: ×2.5 for one robot, 25
robot-seconds a second for 32 at once.

    python -m benchmarks.simulation [--seconds 2]

Both sides do the same: the RRR arm with friction of three sigmoids under PD at 1 kHz, the torque
held, RK4 at 4 kHz, positions and torques kept. The peer is `pin.aba` in NumPy, its PD on the
backward difference. Errors are those of the position against Pinocchio in 16 steps a sample,
relative to the largest position. Many robots at once have encoders, command steps and noise of
their own.
"""

from __future__ import annotations

from benchmarks.side_by_side import HEADER, race, row  # isort: skip  # before numpy

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin

from benchmarks.regressor import rrr as rrr_model
from pipelines.io.log import Array, Controller
from pipelines.simulation import Experiment, Noise, Plant, choose_step, run
from sample_logs.make_model import FRICTION, synthetic_arm

TS = 1e-3  # [s]
KP, KD = np.array([1500.0, 1100.0, 140.0]), np.array([45.0, 32.0, 3.2])
NOISE = Noise(np.array([0.020, 0.010, 0.005]), np.zeros(3))  # [N m]
BITS = np.array([60.0, 30.0, 15.0]) * 2 / 4096  # [N m] steps of the command


def reference(samples: int) -> tuple[Array, Array, Array]:
    """q, dq, ddq (samples, 3) from rest, with reversals."""
    t = TS * np.arange(samples)[:, None]
    size, w = np.array([0.5, 0.4, 0.7]), 2 * np.pi * np.array([0.6, 0.9, 1.3])
    return (
        np.array([0.2, -1.2, 0.8]) + size * (1 - np.cos(w * t)),
        size * w * np.sin(w * t),
        size * w**2 * np.cos(w * t),
    )


def experiment(samples: int, steps: bool) -> Experiment:
    """PD on the backward difference; with `steps` encoders and command count."""
    q, dq, ddq = reference(samples)
    controller = Controller(
        "pd", KP, KD, velocity="backward-difference", torque_resolution=BITS if steps else None
    )
    return Experiment(
        TS,
        0.0,
        controller,
        q,
        dq,
        ddq,
        q[0],
        dq[0],
        np.zeros(3),
        np.full(3, 1e-5 if steps else 0.0),
    )


class Peer:
    """The loop one writes with Pinocchio and NumPy."""

    def __init__(self, samples: int) -> None:
        _, self.model = rrr_model()
        self.data, self.reference = self.model.createData(), reference(samples)
        f, w, b = (np.array(column) for column in zip(*FRICTION, strict=True))
        self.f, self.w, self.b = f, w, b

    def acceleration(self, q: Array, dq: Array, tau: Array) -> Array:
        friction = (self.f * np.tanh(self.w * dq[:, None])).sum(axis=1) + self.b * dq
        return np.asarray(pin.aba(self.model, self.data, q, dq, tau - friction))

    def run(self, steps: int) -> Array:
        q_ref, dq_ref, _ = self.reference
        q, dq, before, h = q_ref[0], dq_ref[0], np.zeros(3), TS / steps
        positions, torques = np.empty(q_ref.shape), np.empty(q_ref.shape)
        f = self.acceleration
        for k in range(len(q_ref)):
            e = q - q_ref[k]
            tau = -KP * e - KD * ((e - before) / TS)
            before, positions[k], torques[k] = e, q, tau
            for _ in range(steps):
                a = f(q, dq, tau)
                v = dq + h / 2 * a
                b = f(q + h / 2 * dq, v, tau)
                w = dq + h / 2 * b
                c = f(q + h / 2 * v, w, tau)
                x = dq + h * c
                d = f(q + h * w, x, tau)
                q, dq = q + h / 6 * (dq + 2 * v + 2 * w + x), dq + h / 6 * (a + 2 * b + 2 * c + d)
        return positions


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=2.0)
    samples = round(parser.parse_args().seconds / TS)
    seconds = samples * TS
    peer, plant = Peer(samples), Plant.of(synthetic_arm())
    calm, counted = experiment(samples, False), experiment(samples, True)
    fine = peer.run(16)
    theirs = _error(peer.run(4), fine)
    print(HEADER)
    one = race(lambda: run(plant, calm, 4), lambda: peer.run(4), 5)
    print(row("one robot, 4 kHz", one, _error(run(plant, calm, 4).true_q[0], fine), theirs))
    step = choose_step(plant, counted, NOISE)
    enough, suffices = step.per_sample, partial(run, plant, calm, step.per_sample, exact=step.exact)
    fewer, held = race(suffices, lambda: peer.run(4), 5), "" if step.exact else ", body held"
    print(row(f"one robot, {enough} kHz{held}", fewer, _error(suffices().true_q[0], fine), theirs))
    print(f"\n{'robots at once':44s}{'CPU':>11s}{'robot-seconds a second':>27s}")
    for name, count, steps in (
        ("32, 4 kHz", 32, 4),
        (f"32, {enough} kHz, which suffices", 32, enough),
        (f"10, {enough} kHz", 10, enough),
    ):
        exact = step.exact or steps != enough
        taken = _median(partial(run, plant, counted, steps, NOISE, range(count), exact))
        print(f"{name:44s}{taken:9.2f} s{count * seconds / taken:27.0f}")


def _error(q: Array, exact: Array) -> float:
    return float(np.abs(q - exact).max() / np.abs(exact).max())


def _median(work: Callable[[], object], repeats: int = 3) -> float:
    """CPU time [s]: there is no peer to share the load of the machine with."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return float(np.median(times))


if __name__ == "__main__":
    main()
