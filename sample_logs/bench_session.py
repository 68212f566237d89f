"""The machine of rrr-healthy and rrr-changed, the model its controllers run on, and how its logs are kept small.

Another arm of the kind of robots/rrr.toml, on the virtual test bench: links within ±10 % and friction within ±20 % of
that one's, drives and encoders with their small imperfections, on a table that gives way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np

from bench.draw import draw_machine, with_links
from bench.experiments import Experiment
from bench.faults.structure import BaseResonance
from bench.machine import Fault, Friction, Machine
from bench.motions import Reference
from bench.plan import Solid
from bench.plant import record
from pipelines.io.experiment import Array, ExperimentLog, Signal
from pipelines.io.robot import RobotDescription
from pipelines.model.arm import Acting, Arm
from pipelines.model.effects.three_sigmoid import ThreeSigmoid
from sample_logs.controller_model import ControllerModel, controller_model

__all__ = ["arm_of", "controllers_model", "machine", "recorded", "rounded"]

_SEED = 28
_TABLE = BaseResonance(None, frequency=28.0, damping_ratio=0.04, inertia=8.0)  # [Hz], [1], [kg m^2]
_LINK_ERROR, _FRICTION_ERROR = 0.05, 0.08  # of each number that the controllers' model has
# Bits behind the point that a number keeps, by its signal. What a computer computed is given to far below one step of
# the encoder; the zeros that follow take no room in a compressed file.
_BITS = {"q_ref": 34, "dq_ref": 30, "ddq_ref": 26, "r": 20, "v": 20, "tau_friction": 24, "tau_feedforward": 24,
         "q_obs": 30, "dq_obs": 24, "ddq_obs": 14}
_OBSERVED = ("q_obs", "dq_obs", "ddq_obs")
_BETWEEN = timedelta(seconds=60)  # from the end of one log to the start of the next, and what is left of a second


def machine() -> Machine:
    """The machine as it stood from its first day."""
    drawn = draw_machine(_SEED, "paper")
    return replace(drawn, standing=(*drawn.standing, _TABLE))


def arm_of(robot: RobotDescription, friction: Iterable[Friction], name: str = "rrr") -> Arm:
    """The arm whose links `robot` describes, with this friction."""
    arm = Arm.from_links(robot)
    base = tuple(replace(one, value=_digits(one.value)) for one in arm.base)
    return Arm(name, arm.body, base, tuple(_acting(joint, law) for joint, law in enumerate(friction, start=1)))


def _digits(value: float) -> float:
    """Seven of them: the last of a double depend on the processor, and the logs carry the model."""
    return float(f"{value:.7g}")


def _acting(joint: int, law: Friction) -> Acting:
    values = {"b": _digits(law.viscous)}
    ordered = sorted(zip(law.sharpnesses, law.heights, strict=True), reverse=True)
    for k, (sharpness, height) in enumerate(ordered, start=1):
        values |= {f"f{k}": _digits(height), f"w{k}": sharpness}
    return Acting.of(ThreeSigmoid(joint), values, origin="known")


def controllers_model(machine: Machine) -> ControllerModel:
    """What an earlier, hasty identification left: links within 5 % and friction within 8 % of the truth."""
    rng = np.random.default_rng([24, _SEED])
    links = [Solid.of_link(joint.link).drawn(rng, _LINK_ERROR).as_link() for joint in machine.robot.joints if joint.link]
    friction = [law.drawn(rng, _FRICTION_ERROR) for law in machine.friction]
    return controller_model(arm_of(with_links(machine.described, links), friction, "rrr-earlier"))


def recorded(machine: Machine, experiments: Iterable[Experiment], begun: datetime, faults: Sequence[Fault] = (), seed: int = 0,
             only: str | None = None) -> Iterator[tuple[str, ExperimentLog]]:
    """The log of each experiment, after the name of its file. What it says of its reference is so to the last bit.

    Args:
        begun: UTC; when the first log was recorded, the others follow minute by minute.
        seed: of the session's noise.
        only: the name of an experiment, where no other has to be recorded.
    """
    for place, one in enumerate(experiments):
        at, begun = begun, begun + _BETWEEN + timedelta(seconds=round(float(one.reference.t[-1])))
        if only not in (None, one.name):
            continue
        plan = replace(one, reference=rounded(one.reference))
        (log,) = record(machine, faults, [plan], seed=1000 * seed + place)
        yield f"{log.name}.h5", replace(_compact(log), recorded=f"{at:%Y-%m-%dT%H:%M:%SZ}")


def rounded(reference: Reference) -> Reference:
    """The same motion, its numbers as short as the log's."""
    q, dq, ddq = (_kept(getattr(reference, key), _BITS[f"{key}_ref"]) for key in ("q", "dq", "ddq"))
    return replace(reference, q=q, dq=dq, ddq=ddq)


def _kept(values: Array, bits: int) -> Array:
    return np.asarray(np.ldexp(np.rint(np.ldexp(values, bits)), -bits))


def _compact(log: ExperimentLog) -> ExperimentLog:
    """What the controller observed is kept of writing alone."""
    kept = {name: _shortened(name, signal) for name, signal in log.signals.items()
            if log.experiment == "writing" or name not in _OBSERVED}
    return replace(log, signals=kept)


def _shortened(name: str, signal: Signal) -> Signal:
    return replace(signal, values=_kept(signal.values, _BITS[name])) if name in _BITS else signal
