"""A gap between a motor and its link."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.drive_apart import DriveApart
from pipelines.dynamics.gap import Gaps, followed
from pipelines.dynamics.perturbation import perturbed_by, rate_of, rigid_slopes, shifted
from pipelines.model.effects.base import (
    ArmModel,
    Hooks,
    Parameters,
    Quantity,
    Values,
    Words,
    friction_at,
)
from pipelines.model.effects.fast import Fast

__all__ = ["Backlash"]

_FLANK_HZ = 80.0  # of the link on a closed flank, the motor locked: stiff beside what an arm is moved at
_LINK = 0.1  # of the inertia that the joint feels: what stays with the link at least
_TIGHT = 1.5e-4  # [rad] half an arc minute: what precise gears have, by the data sheets of strain wave and cycloidal ones
_NOTHING = 1e-6  # [N m] that leave the link in the middle of the gap at first
_THICKEST = 1e6  # [N m s/rad], or [N s/m]
# More shapes than these share the slopes of the rigid torque, which cost less then and miss a thousandth of a gap of 6.6 mrad.
# Those of one shape moved a little, whose difference is a slope, are few: they are worked out exactly.
_SLOPES = 6
_CROSSINGS = (3e-3, 1e-2, 3e-2)  # [s] that the joint's usual torque needs to carry the link through the gap's lubricant


@dataclass(frozen=True)
class Backlash(Fast):
    """With x = q_link - q, the link's angle against the motor's, torque passes only where |x| > gap/2.

        (D - J_m) ẍ = -(τ_j - J_m q̈_j) - c ẋ - flank,    flank = k (|x| - gap/2) sign x + d ẋ, never pulling

    Torque, friction and encoder sit on the motor's side. x follows from the measured motion and the rigid torque, and with it
    τ = τ_rigid(q + x) - τ_rigid(q), J_m ẍ less on its own row. Where the gap is crossed in no time, x = -gap/2 sign(τ_j). The
    flank is 80 Hz stiff and critically damped: what rings on a stiffer one depends on the tooth and not on the gap.
    """

    gap: float = 1e-3  # [rad]
    film: float = 1.0  # c [N m s/rad]
    motor_inertia: float = 1e-3  # J_m [kg m^2]

    name = "backlash"
    parameters = Parameters(
        Quantity("gap", "rad", 0.0, 0.1, "free play, from flank to flank", shape=True),
        Quantity("film", "N m s/rad", 0.0, _THICKEST, "drag of the lubricant in the open gap", shape=True),
        Quantity("motor_inertia", "kg m^2", 0.0, 10.0, "of what turns with the motor", shape=True),
        Quantity("coefficient", "1", 0.0, 2.0, "share of its torque: 1 where the model of the gap is right", fixed=1.0),
    )
    words = Words("Backlash", size="gap",
        signature="A burst of torque each time the torque changes sign, at any speed, and a jump of the link by the gap.",
        explanation="Worn teeth, keys or couplings leave free play: motor and link part when the "
                    "torque turns round, and meet again.",
        remedy="Adjust or replace the gear; a preload, by gravity or a spring, keeps one flank closed.",
        experiment="Move the joint to and fro over small angles, once where gravity loads it and once where it does not.")
    evidence = "reversals"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.several([self], motion, arm)[0]

    def possible(self, values: Values) -> bool:
        """A gap that precise gears have is no fault."""
        return super().possible(values) and values["gap"] > _TIGHT

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """All gaps are followed at once; those of one motor share its forces."""
        tau, felt = _rigid(arm, motion), _felt(arm, motion.q, self._index)
        motors = list(dict.fromkeys(one.motor_inertia for one in shapes))
        motor = np.array(motors if len(motors) == 1 else [one.motor_inertia for one in shapes])[:, None]
        mass = np.maximum(felt - motor, _LINK * felt)
        force = motor * self.own(motion.ddq) - tau[:, self._index]
        flanks = {one: _flank(float(np.mean(np.maximum(felt - one, _LINK * felt))), one) for one in motors}
        half, film, k, d = np.array([[0.5 * one.gap, one.film, *flanks[one.motor_inertia]] for one in shapes]).T
        link = followed(motion.t, mass, force, Gaps(half, film, k, d))
        slopes = rigid_slopes(arm.body, arm.p, motion, self._index) if len(shapes) > _SLOPES else None

        def ahead(x: Array, rate: Array, second: Array) -> Array:
            """τ_rigid(q + x) - τ_rigid(q)."""
            if slopes is not None:
                return perturbed_by(slopes, x, rate, second)
            return _rigid(arm, shifted(motion, self._index, x, rate, second)) - tau

        return [one._torque(motion, x, ahead) for one, x in zip(shapes, link, strict=True)]

    def _torque(self, motion: Motion, x: Array, ahead: Callable[[Array, Array, Array], Array]) -> Array:
        """Column of a link that is x (samples,) ahead of its motor, where the rigid arm needs as much more torque."""
        rate = rate_of(x, motion.t)
        second = rate_of(rate, motion.t)
        more = ahead(x, rate, second)
        more[:, self._index] -= self.motor_inertia * second
        return np.asarray(more[..., None])

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Gaps a good third apart, for too small a gap explains nothing; lubricants a factor of three apart, for where one far too
        thin is looked for, the gap's torque comes and goes by chance; a motor of a tenth of what the joint feels."""
        motor = 0.1 * float(np.mean(_felt(arm, motion.q, self._index)))
        usual = float(np.median(np.abs(self.own(_rigid(arm, motion))))) or 1.0
        for gap in np.geomspace(3e-4, 6.6e-3, 10).tolist():
            for crossing in _CROSSINGS:
                film = min(crossing * usual / gap, _THICKEST)
                yield replace(self, gap=gap, film=film, motor_inertia=min(motor, 10.0))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """The arm is the links; angle and speed of the motor are two states, and friction acts on the motor."""
        still = np.zeros((1, arm.n_joints))
        felt = float(_felt(arm, still, self._index)[0])
        motor = max(values["motor_inertia"], 0.01 * felt)  # of a motor without inertia nothing can be integrated
        half, film = 0.5 * values["gap"], values["film"]
        k, d = _flank(max(felt - motor, _LINK * felt), motor)

        def passed(angle: Array, speed: Array) -> Array:
            over = angle - np.clip(angle, -half, half)
            push = np.where(over > 0.0, np.maximum(k * over + d * speed, 0.0), np.minimum(k * over + d * speed, 0.0))
            return np.asarray(film * speed + np.where(over == 0.0, 0.0, push))

        drive = DriveApart(self._index, motor, friction_at(arm, self._index + 1), passed,
                           lambda tau: half * np.clip(tau / _NOTHING, -1.0, 1.0) + tau / k)
        return Hooks(actuator=drive.actuator, sensor=drive.sensor, inertia=drive.taken_out(arm.n_joints), states=2,
                     settled=drive.settled, start=drive.start, rate=drive.rate)


def _flank(link: float, motor: float) -> tuple[float, float]:
    """Stiffness [N m/rad] and critical damping [N m s/rad] of a closed flank between two inertias [kg m^2]."""
    link, motor = max(link, 1e-12), max(motor, 1e-12)  # a badly determined arm may feel less than nothing
    k = link * (2.0 * pi * _FLANK_HZ) ** 2
    return k, 2.0 * sqrt(k * motor * link / (motor + link))


def _rigid(arm: ArmModel, motion: Motion) -> Array:
    """Torque of the rigid arm alone."""
    return arm.body.torque(motion.q, motion.dq, motion.ddq, arm.p)


def _felt(arm: ArmModel, q: Array, index: int) -> Array:
    """Inertia (samples,) [kg m^2] that the joint feels, the others held."""
    return arm.body.mass_matrix(q, arm.p)[:, index, index]
