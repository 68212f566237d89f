"""Estimate arms from logs with even samples, uneven samples, noisy stamps, and both.

    python -m benchmarks.uneven_stamps --seed 100 --count 30

Random serial arms of two to six joints (Pinocchio's equations of motion), 10 s at 200 to 1000 Hz,
encoders of 1e-5 to 2e-4 rad, torque noise, torque measured at the instant or held over it. Each
arm is recorded four times: `even`; `a`, true instants uneven and stamps right; `b`, instants even
and stamps noisy; `c`, both. Printed for each: std over that of even sampling, and the share of
parameters within two standard deviations of the truth, with its Wilson interval.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.hidden_effects.table import wilson
from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.rrr import rigid_body
from pipelines.estimate_bps import Result, Settings, compute
from pipelines.io.files import Opened
from pipelines.io.log import ExperimentLog, Signal
from pipelines.io.robot import format_robot
from pipelines.stage import Inputs
from tests.dynamics.serial_arms import Arm, by_hand, physical_links, pin, table

Array = npt.NDArray[np.float64]

CASES = ("even", "a", "b", "c")
_DURATION = 10.0  # [s]
_ANGLES = (0.0, np.pi / 2, -np.pi / 2, 0.7)
_SMOOTH = 100.0  # [s/rad] of the sign of friction: the law that is fitted


@dataclass(frozen=True, eq=False)
class Drawn:
    """One arm, its motion and how it is recorded."""

    arm: Arm
    links: Array  # standard parameters
    coulomb: Array  # [N m] (joints,)
    viscous: Array  # [N m s/rad]
    sines: tuple[Array, Array, Array]  # rates [rad/s], sine and cosine amplitudes [rad]
    step: float  # [s]
    encoder: float  # [rad]
    noise: Array  # [N m] (joints,)
    jitter: float  # of a step
    held: bool

    def motion(self, t: Array) -> tuple[Array, Array, Array]:
        """Return position, speed and acceleration (samples, joints)."""
        k, a, b = self.sines
        s, c = np.sin(t[:, None] * k), np.cos(t[:, None] * k)
        va, vb = k[:, None] * a, k[:, None] * b
        return s @ a + c @ b, c @ va - s @ vb, -(s @ (k[:, None] * va)) - c @ (k[:, None] * vb)

    def torque(self, t: Array) -> Array:
        """Return the torque (samples, joints) [N m]."""
        q, dq, ddq = self.motion(t)
        data = self.arm.model.createData()
        states = zip(self.arm.offset(q), dq, ddq, strict=True)
        rigid = np.array([pin.rnea(self.arm.model, data, *state) for state in states])
        return np.asarray(rigid + self.coulomb * np.tanh(_SMOOTH * dq) + self.viscous * dq)


def draw(seed: int) -> Drawn:
    """Draw an arm and its log."""
    rng = np.random.default_rng([seed, 51])
    n = int(rng.integers(2, 7))
    rows = [
        (
            "revolute",
            float(rng.choice(_ANGLES)),
            float(rng.uniform(0.0, 0.4)),
            float(rng.uniform(0.0, 0.3)),
            float(rng.uniform(-0.5, 0.5)),
        )
        for _ in range(n)
    ]
    arm = by_hand(table(f"drawn{seed}", "dh", rows))
    links = physical_links(n, rng)
    arm.load(links)
    k = 2.0 * np.pi * rng.uniform(0.15, 0.3) * np.arange(1, 8)
    a, b = rng.standard_normal((2, len(k), n)) / k[:, None]
    one = Drawn(
        arm,
        links,
        rng.uniform(0.3, 2.0, n),
        rng.uniform(0.1, 1.0, n),
        (k, a, b),
        1.0 / float(rng.choice([200, 400, 1000])),
        float(rng.choice([1e-5, 5e-5, 2e-4])),
        np.ones(n),
        float(rng.uniform(0.05, 0.18)),
        bool(rng.random() < 0.5),
    )
    t = np.arange(0.0, _DURATION, 5e-3)
    scale = rng.uniform(1.0, 2.5) / np.abs(one.motion(t)[1]).max(axis=0)
    one = replace(one, sines=(k, a * scale, b * scale))
    return replace(one, noise=rng.uniform(0.003, 0.02) * one.torque(t).std(axis=0))


def recorded(one: Drawn, case: str, seed: int) -> ExperimentLog:
    """Return the log of a case."""
    rng = np.random.default_rng([seed, 52, CASES.index(case)])
    k = np.arange(round(_DURATION / one.step))
    share = 1.0 if case != "c" else np.sqrt(0.5)
    size = share * one.jitter * one.step
    a, b = (size * np.clip(rng.standard_normal(len(k)), -2.2, 2.2) for _ in range(2))
    taken = k * one.step + (a if case in ("a", "c") else 0.0)
    stamps = taken + (b if case in ("b", "c") else 0.0)
    ends = np.append(taken, taken[-1] + one.step)
    if one.held:  # the mean torque until the next sample
        tau = np.mean([one.torque(taken + np.diff(ends) * (i + 0.5) / 4) for i in range(4)], 0)
    else:
        tau = one.torque(taken)
    q = one.encoder * np.rint(one.motion(taken)[0] / one.encoder)
    tau = tau + one.noise * rng.standard_normal(tau.shape)
    signals = {
        "t": Signal(stamps, "s", "time"),
        "q": Signal(q, "rad", "measured joint position"),
        "tau": Signal(tau, "N m", "joint torque"),
    }
    return ExperimentLog(
        name=f"{case}-{seed}",
        experiment="excitation",
        role="identify",
        origin="measured",
        torque="commanded" if one.held else "measured",
        robot_name=one.arm.robot.name,
        sample_time=one.step,
        robot_text=format_robot(one.arm.robot),
        signals=signals,
    )


def estimated(one: Drawn, case: str, seed: int) -> Result:
    """Return the estimate from the log of a case."""
    opened = Opened(Path(case), "", recorded(one, case, seed), ())
    return compute(Inputs((opened,)), Settings())


def scores(one: Drawn, found: Result) -> tuple[Array, Array]:
    """Return (estimate - truth) / std of the parameters with a value, and the std of all."""
    body = rigid_body(one.arm.robot)
    if not isinstance(body, BaseArm):
        raise TypeError("arms of two joints and more have base parameters")
    known = dict(zip([p.name for p in body.parameters], body.base.combine @ one.links, strict=True))
    for j in range(one.arm.n):
        known[f"coulomb:{j + 1}:level"] = float(one.coulomb[j])
        known[f"viscous:{j + 1}:coefficient"] = float(one.viscous[j])
        known[f"torque_offset:{j + 1}:offset"] = 0.0
    seen = [p for p in found.parameters if p.value is not None and p.std is not None]
    value, std, truth = (
        np.array(x, dtype=np.float64)
        for x in ([p.value for p in seen], [p.std for p in seen], [known[p.name] for p in seen])
    )
    every = [np.nan if p.std is None else p.std for p in found.parameters]
    return (value - truth) / std, np.array(every, dtype=np.float64)


def main(seed: int, count: int) -> None:
    """Print a line an arm, and the summary."""
    ratio: dict[str, list[float]] = {case: [] for case in CASES}
    z: dict[str, list[float]] = {case: [] for case in CASES}
    for k in range(seed, seed + count):
        one, std = draw(k), {}
        for case in CASES:
            found = estimated(one, case, k)
            own, std[case] = scores(one, found)
            z[case] += own.tolist()
            ratio[case].append(float(np.nanmedian(std[case] / std["even"])))
        print(
            f"arm {k}: {one.arm.n} joints, {1 / one.step:.0f} Hz, jitter {one.jitter:.2f},",
            "std over even",
            {case: round(ratio[case][-1], 3) for case in CASES[1:]},
            flush=True,
        )
    for case in CASES:
        inside, total = int(np.sum(np.abs(z[case]) <= 2.0)), len(z[case])
        low, high = wilson(inside, total)
        rms = np.sqrt(np.mean(np.square(z[case])))
        print(
            f"{case:5} std over even: mean {np.mean(ratio[case]):.3f}, "
            f"largest {np.max(ratio[case]):.3f}; within 2 std {100 * inside / total:.1f} % of "
            f"{total} [{100 * low:.1f}, {100 * high:.1f}], rms z {rms:.2f}"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=30)
    main(**vars(parser.parse_args()))
