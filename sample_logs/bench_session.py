"""The machine of rrr-healthy and rrr-changed, the model its controllers use, and its logs kept
small.

Another arm of the kind of robots/rrr.toml, on the virtual test bench: links within ±10 % and
friction within ±20 % of that one's, drives and encoders with their small imperfections, on a soft
table.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import NamedTuple

import numpy as np

from bench.draw import draw_machine, with_links
from bench.experiments import Experiment
from bench.faults.structure import BaseResonance
from bench.machine import Fault, Friction, Machine
from bench.motions import Reference
from bench.plan import Solid
from bench.plant import record
from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion
from pipelines.effects.friction import ThreeSigmoid
from pipelines.io.log import Array, ExperimentLog, Signal
from pipelines.io.model_file import model_text
from pipelines.io.robot import RobotDescription

SEED = 28  # numerics: of the machine and of its controllers' model
# Bits behind the point that a number keeps, by its signal. What a computer computed is given to far
# below one step of the encoder; the zeros that follow take no room in a compressed file.
BITS = {
    "q_ref": 34,
    "dq_ref": 30,
    "ddq_ref": 26,
    "r": 20,
    "v": 20,
    "tau_friction": 24,
    "tau_feedforward": 24,
    "q_obs": 30,
    "dq_obs": 24,
    "ddq_obs": 14,
}


class Parts(NamedTuple):
    """The torque of a model for one sample, split. Each (joints,) [N m]."""

    friction: list[float]
    inertia: list[float]
    coriolis: list[float]
    gravity: list[float]


@dataclass(frozen=True)
class ControllerModel:
    """A model as a controller of the bench uses it, one sample at a time."""

    text: str  # model.json, for the log
    arm: Arm

    def parts(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> Parts:
        """Return friction, inertia, Coriolis and gravity [N m], each a list of n."""
        each = self.along(*(np.array([x], dtype=float) for x in (q, dq, ddq)))
        return Parts(*(part[0].tolist() for part in each))

    def along(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the same of a whole motion (4, samples, n)."""
        rigid = self.arm.body.torque_parts(q, dq, ddq, self.arm.p)
        friction = self.arm.friction_torque(Motion(np.zeros(len(q)), q, dq, ddq))
        return np.array([friction, rigid.inertia, rigid.coriolis, rigid.gravity])

    def inertia_times(self, q: Sequence[float], r: Sequence[float]) -> list[float]:
        """Return D(q) r [N m], a list of n."""
        mass = self.arm.body.mass_matrix(np.array([q], dtype=float), self.arm.p)[0]
        product: list[float] = (mass @ r).tolist()
        return product


def controller_model(arm: Arm) -> ControllerModel:
    """Return the model of `arm` for a controller of the bench."""
    return ControllerModel(model_text(arm.to_model()), arm)


def machine() -> Machine:
    """Return the machine as on its first day, on its table."""
    drawn = draw_machine(SEED, "paper")
    table = BaseResonance(None, frequency=28.0, damping_ratio=0.04, inertia=8.0)
    return replace(drawn, standing=(*drawn.standing, table))


def arm_of(robot: RobotDescription, friction: Iterable[Friction], name: str = "rrr") -> Arm:
    """Return the arm whose links `robot` describes, with this friction.

    Its numbers have seven digits: the last of a double depend on the processor, and logs carry it.
    """
    arm = Arm.from_links(robot)
    base = tuple(replace(one, value=_digits(one.value)) for one in arm.base)
    laws = tuple(_acting(joint, law) for joint, law in enumerate(friction, start=1))
    return Arm(name, arm.body, base, laws)


def _digits(value: float) -> float:
    return float(f"{value:.7g}")


def _acting(joint: int, law: Friction) -> Acting:
    values = {"b": _digits(law.viscous)}
    ordered = sorted(zip(law.sharpnesses, law.heights, strict=True), reverse=True)
    for k, (sharpness, height) in enumerate(ordered, start=1):
        values |= {f"f{k}": _digits(height), f"w{k}": sharpness}
    return Acting.of(ThreeSigmoid(joint), values, origin="known")


def controllers_model(machine: Machine) -> ControllerModel:
    """Return an earlier, hasty identification: links within 5 % and friction within 8 % of the
    truth.
    """
    rng = np.random.default_rng([24, SEED])
    bodies = [Solid.of_link(joint.link) for joint in machine.robot.joints if joint.link]
    links = [body.drawn(rng, 0.05).as_link() for body in bodies]
    friction = [law.drawn(rng, 0.08) for law in machine.friction]
    robot = with_links(machine.described, links)
    return controller_model(arm_of(robot, friction, "rrr-earlier"))


def recorded(
    machine: Machine,
    experiments: Iterable[Experiment],
    begun: datetime,
    faults: Sequence[Fault] = (),
    seed: int = 0,
    only: str | None = None,
) -> Iterator[tuple[str, ExperimentLog]]:
    """Record the log of each experiment, after the name of its file, its reference exactly as
    followed.

    Args:
        machine: that is recorded.
        experiments: of the session.
        begun: UTC; when the first log was recorded, the others follow a minute after each other.
        faults: of the machine, beside its own.
        seed: of the session's noise.
        only: the name of an experiment, where no other has to be recorded.
    """
    for place, one in enumerate(experiments):
        lasting = round(float(one.reference.t[-1]))
        at, begun = begun, begun + timedelta(seconds=60 + lasting)
        if only not in (None, one.name):
            continue
        plan = replace(one, reference=rounded(one.reference))
        (log,) = record(machine, faults, [plan], seed=1000 * seed + place)
        # Of writing alone, what the controller observed is kept.
        signals = {
            name: _shortened(name, signal)
            for name, signal in log.signals.items()
            if log.experiment == "writing" or not name.endswith("_obs")
        }
        yield f"{log.name}.h5", replace(log, signals=signals, recorded=f"{at:%Y-%m-%dT%H:%M:%SZ}")


def rounded(reference: Reference) -> Reference:
    """Return the same motion, its numbers as short as the log's."""
    paths = {key: _kept(getattr(reference, key), BITS[f"{key}_ref"]) for key in ("q", "dq", "ddq")}
    return replace(reference, **paths)


def _kept(values: Array, bits: int) -> Array:
    return np.asarray(np.ldexp(np.rint(np.ldexp(values, bits)), -bits))


def _shortened(name: str, signal: Signal) -> Signal:
    return replace(signal, values=_kept(signal.values, BITS[name])) if name in BITS else signal
