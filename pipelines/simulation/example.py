"""Logs to try things on, without a robot: the shipped arm in simulation, something wrong with it.

    for log in example_session():
        write_log(f"logs/{log.name}.h5", log)

The arm has the rigid body of the shipped model and Coulomb and viscous friction; a PD controller
moves it along three Fourier series (Kostić et al. 2004, eq. (22)), two to fit and one to judge.
Drives are noisy and encoders have steps.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.named_cause import acting_cause
from pipelines.io import schema
from pipelines.io.log import Array, Controller, ExperimentLog, Signal
from pipelines.io.model_file import read_model
from pipelines.io.robot import format_robot
from pipelines.simulation.config import EXAMPLE
from pipelines.simulation.fourier_series import FourierSeries
from pipelines.simulation.imitate import How, imitate

__all__ = ["FAULT", "example_arm", "example_session"]

# what is wrong with the arm, unless it is said otherwise
FAULT: Final = "cogging:2:order=18,amplitude=0.4"
_FRICTION: Final = (
    "coulomb:1:level=3",
    "coulomb:2:level=1.5",
    "coulomb:3:level=0.4",
    "viscous:1:coefficient=1.5",
    "viscous:2:coefficient=0.9",
    "viscous:3:coefficient=0.15",
)


def example_arm(*faults: str) -> Arm:
    """Return the arm with `faults`, each as on the command line: "cogging:2:order=18,…"."""
    shipped = Arm.from_model(read_model("rrr"))
    revolute = shipped.robot.revolute
    friction = tuple(acting_cause(text, revolute) for text in _FRICTION)
    wrong = (acting_cause(text, revolute, command="demo") for text in faults)
    return replace(shipped, friction=friction).extended(*wrong)


def example_session(*faults: str, seed: int = 1) -> tuple[ExperimentLog, ...]:
    """Return two excitations of role identify and one of role validate of the arm with `faults`."""
    arm = example_arm(*faults)
    found = []
    for number, role in enumerate(("identify", "identify", "validate")):
        planned = _planned(arm, number, role, np.random.default_rng((seed, number)))
        how = How(seed=3 * seed + number, noise=EXAMPLE.noise, steps=2)
        log = imitate(planned, arm, how, planned.name, draw=False).logs[0]
        found.append(replace(log, name=planned.name, derived=None, torque="held-command"))
    return tuple(found)


def _planned(arm: Arm, number: int, role: str, rng: np.random.Generator) -> ExperimentLog:
    """Return one excitation as a plan: references and the controller that follows them."""
    time = EXAMPLE.sample_time
    t = time * np.arange(round(EXAMPLE.period / time) + 1, dtype=np.float64)
    q, dq, ddq = np.transpose(_series(rng).at(t), (0, 2, 1))
    values = {"t": t, "q_ref": q, "dq_ref": dq, "ddq_ref": ddq}
    signals = {
        name: Signal(x, schema.unit_of(name), schema.SIGNALS[name][1]) for name, x in values.items()
    }
    gains = np.array(EXAMPLE.kp), np.array(EXAMPLE.kd)
    observer = np.tile(EXAMPLE.observer_gain, (arm.n_joints, 1))
    controller = Controller("pd", *gains, velocity="observer", observer_gain=observer)
    name, robot = f"excitation-{number + 1}", format_robot(arm.robot)
    return ExperimentLog(
        name,
        "excitation",
        role,
        "planned",
        arm.robot.name,
        time,
        robot_text=robot,
        signals=signals,
        controller=controller,
    )


def _series(rng: np.random.Generator) -> FourierSeries:
    """Return a motion that begins and ends at home, its fastest joint speed the same in each."""
    harmonics, period = EXAMPLE.harmonics, EXAMPLE.period
    a, b = rng.standard_normal((2, 3, harmonics)) / np.arange(1, harmonics + 1)
    series = FourierSeries(period, np.zeros(3), a, b)
    position, speed, _ = series.samples(2000)
    scale = EXAMPLE.speed / np.abs(speed).max(axis=1, keepdims=True)
    start: Array = -scale[:, 0] * position[:, 0]
    return FourierSeries(period, start, scale * a, scale * b)
