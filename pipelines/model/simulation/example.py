"""Logs to try things on, without a robot: the shipped arm in simulation, with something wrong at one of its joints.

    for log in example_session():
        write_log(f"logs/{log.name}.h5", log)

The arm has the rigid body of the shipped model and Coulomb and viscous friction; a PD controller moves it along three Fourier
series (Kostić et al. 2004, eq. (22)), two to fit and one to judge. Drives are noisy and encoders have steps.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pipelines.io import schema
from pipelines.io.log import Array, Controller, ExperimentLog, Signal
from pipelines.io.model_file import read_model
from pipelines.io.robot import format_robot
from pipelines.model.arm import Arm
from pipelines.model.named_cause import acting_cause
from pipelines.model.simulation.imitate import How, imitate
from pipelines.signal.fourier import FourierSeries

__all__ = ["FAULT", "example_arm", "example_session"]

FAULT: Final = "cogging:2:order=18,amplitude=0.4"  # what is wrong with the arm, unless it is said otherwise
_FRICTION: Final = ("coulomb:1:level=3", "coulomb:2:level=1.5", "coulomb:3:level=0.4",
                    "viscous:1:coefficient=1.5", "viscous:2:coefficient=0.9", "viscous:3:coefficient=0.15")
_NOISE: Final = (0.02, 0.01, 0.005)  # [N m] of the drives, std
_TIME: Final = 1e-3  # [s]
_PERIOD: Final = 8.0  # [s]
_HARMONICS: Final = 6
_SPEED: Final = 2.2  # [rad/s] the fastest of each joint
_KP, _KD = (1500.0, 1100.0, 140.0), (45.0, 32.0, 3.2)  # [N m/rad], [N m s/rad]
_GAIN: Final = np.tile([0.4156, 109.13, 14328.0], (3, 1))  # k of eq. (20)


def example_arm(*faults: str) -> Arm:
    """The arm, with `faults` as the command line writes them: "cogging:2:order=18,amplitude=0.4"."""
    shipped = Arm.from_model(read_model("rrr"))
    revolute = shipped.robot.revolute
    return replace(shipped, friction=tuple(acting_cause(text, revolute) for text in _FRICTION)).extended(
        *(acting_cause(text, revolute, command="demo") for text in faults))


def example_session(*faults: str, seed: int = 1) -> tuple[ExperimentLog, ...]:
    """Two excitations of role identify and one of role validate, as the arm with `faults` would have logged them."""
    arm = example_arm(*faults)
    found = []
    for number in range(3):
        planned = _planned(arm, number, np.random.default_rng((seed, number)))
        how = How(seed=3 * seed + number, noise=_NOISE, steps=2)
        log = imitate(planned, arm, how, planned.name, draw=False).logs[0]
        found.append(replace(log, name=planned.name, derived=None, torque="held-command"))
    return tuple(found)


def _planned(arm: Arm, number: int, rng: np.random.Generator) -> ExperimentLog:
    """One excitation as a plan: references and the controller that follows them."""
    t = _TIME * np.arange(round(_PERIOD / _TIME) + 1, dtype=np.float64)
    q, dq, ddq = np.transpose(_series(rng).at(t), (0, 2, 1))
    values = {"t": t, "q_ref": q, "dq_ref": dq, "ddq_ref": ddq}
    signals = {name: Signal(x, schema.unit_of(name), schema.SIGNALS[name][1]) for name, x in values.items()}
    controller = Controller("pd", kp=np.array(_KP), kd=np.array(_KD), velocity="observer", observer_gain=_GAIN)
    return ExperimentLog(f"excitation-{number + 1}", "excitation", "validate" if number == 2 else "identify", "planned",
                         arm.robot.name, _TIME, format_robot(arm.robot), signals, controller=controller)


def _series(rng: np.random.Generator) -> FourierSeries:
    """A motion that begins and ends at home, its fastest joint speed the same in each."""
    a, b = rng.standard_normal((2, 3, _HARMONICS)) / np.arange(1, _HARMONICS + 1)
    series = FourierSeries(_PERIOD, np.zeros(3), a, b)
    position, speed, _ = series.samples(2000)
    scale = _SPEED / np.abs(speed).max(axis=1, keepdims=True)
    start: Array = -scale[:, 0] * position[:, 0]
    return FourierSeries(_PERIOD, start, scale * a, scale * b)
