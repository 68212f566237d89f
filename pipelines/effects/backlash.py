"""A gap between a motor and its link."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.perturbation import (
    perturbed_by,
    rate_of,
    rigid_slopes,
    rigid_torque,
    shifted,
)
from pipelines.effects.base import ArmModel, Effect, Hooks, Values, friction_at
from pipelines.effects.config import EFFECTS
from pipelines.effects.hooks import DriveApart

__all__ = ["Backlash", "Gaps", "followed"]

_NOTHING = 1e-6  # numerics: [N m] that leave the link in the middle of the gap at first
# More shapes than these share the slopes of the rigid torque, which cost less then and miss a
# thousandth of a gap of 6.6 mrad. Those of one shape moved a little, whose difference is a slope,
# are few: they are worked out exactly.
_SLOPES = 6  # numerics: shapes worked out exactly at most
_LENGTH = 600  # numerics: samples of a stretch
_FEW, _SHORT = 4, 300  # numerics: gaps whose arrays cost hardly more than a call; samples then
# Two stretches may differ by this share of the gap; a speed counts as a way in this time [s].
_SEAM, _TICK = 1e-12, 1e-3  # numerics: rounding; [s]


@dataclass(frozen=True)
class Backlash(Effect):
    """Torque passes only where |x| > gap/2, with x = q_link - q, the link against the motor.

        (D - J_m) ẍ = -(τ_j - J_m q̈_j) - c ẋ - flank,    flank = k (|x| - gap/2) sign x + d ẋ

    The flank, 80 Hz stiff and critically damped, never pulls. Torque, friction and encoder sit on
    the motor's side: τ = τ_rigid(q + x) - τ_rigid(q), J_m ẍ less on its own row.
    """

    gap: float = 1e-3  # [rad]
    film: float = 1.0  # c [N m s/rad]
    motor_inertia: float = 1e-3  # J_m [kg m^2]

    name = "backlash"
    evidence = "reversals"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.several([self], motion, arm)[0]

    def possible(self, values: Values) -> bool:
        """Return whether it is more than the gap of precise gears, which is no fault."""
        return super().possible(values) and values["gap"] > EFFECTS.tight_gap

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """All gaps are followed at once; those of one motor share its forces."""
        tau, felt = rigid_torque(arm.body, arm.p, motion), _felt(arm, motion.q, self.index)
        motors = list(dict.fromkeys(one.motor_inertia for one in shapes))
        if len(motors) > 1:
            motors = [one.motor_inertia for one in shapes]
        motor = np.array(motors)[:, None]
        mass = np.maximum(felt - motor, EFFECTS.link_share * felt)
        force = motor * self.own(motion.ddq) - self.own(tau)
        flanks = {
            one: _flank(float(np.mean(link)), one) for one, link in zip(motors, mass, strict=True)
        }
        half, film, k, d = np.array(
            [[0.5 * one.gap, one.film, *flanks[one.motor_inertia]] for one in shapes]
        ).T
        slopes = None
        if len(shapes) > _SLOPES:
            slopes = rigid_slopes(arm.body, arm.p, motion, self.index)
        found = []
        for one, x in zip(
            shapes, followed(motion.t, mass, force, Gaps(half, film, k, d)), strict=True
        ):
            rate = rate_of(x, motion.t)
            second = rate_of(rate, motion.t)
            if slopes is not None:
                more = perturbed_by(slopes, x, rate, second)
            else:
                there = shifted(motion, self.index, x, rate, second)
                more = rigid_torque(arm.body, arm.p, there) - tau
            more[:, self.index] -= one.motor_inertia * second
            found.append(more[..., None])
        return found

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Gaps a good third apart, lubricants a factor of three, a motor of a tenth of the
        joint."""
        motor = 0.1 * float(np.mean(_felt(arm, motion.q, self.index)))
        tau = self.own(rigid_torque(arm.body, arm.p, motion))
        usual = float(np.median(np.abs(tau))) or 1.0
        for gap in np.geomspace(3e-4, 6.6e-3, 10).tolist():
            for crossing in EFFECTS.crossings:
                yield replace(
                    self,
                    gap=gap,
                    film=self.within("film", crossing * usual / gap),
                    motor_inertia=min(motor, 10.0),
                )

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the hooks of an arm that is the links; the motor is two states, with friction."""
        still = np.zeros((1, arm.n_joints))
        felt = float(_felt(arm, still, self.index)[0])
        # of a motor without inertia nothing can be integrated
        motor = max(values["motor_inertia"], 0.01 * felt)
        half, film = 0.5 * values["gap"], values["film"]
        k, d = _flank(max(felt - motor, EFFECTS.link_share * felt), motor)

        def passed(angle: Array, speed: Array) -> Array:
            over = angle - np.clip(angle, -half, half)
            push = np.where(
                over > 0.0,
                np.maximum(k * over + d * speed, 0.0),
                np.minimum(k * over + d * speed, 0.0),
            )
            return np.asarray(film * speed + np.where(over == 0.0, 0.0, push))

        drive = DriveApart(
            self.index,
            motor,
            friction_at(arm, self.index + 1),
            passed,
            lambda tau: half * np.clip(tau / _NOTHING, -1.0, 1.0) + tau / k,
        )
        return drive.hooks(arm.n_joints)


def _flank(link: float, motor: float) -> tuple[float, float]:
    """Return stiffness and critical damping of a closed flank between two inertias [kg m^2]."""
    # a badly determined arm may feel less than nothing
    link, motor = max(link, 1e-12), max(motor, 1e-12)
    k = link * (2.0 * pi * EFFECTS.flank_hz) ** 2
    return k, 2.0 * sqrt(k * motor * link / (motor + link))


def _felt(arm: ArmModel, q: Array, index: int) -> Array:
    """Inertia (samples,) [kg m^2] that the joint feels, the others held."""
    return arm.body.mass_matrix(q, arm.p)[:, index, index]


@dataclass(frozen=True, eq=False)
class Gaps:
    """Several gaps of one joint."""

    half: Array  # [rad] (gaps,) half the play
    film: Array  # [N m s/rad] (gaps,) drag of the lubricant
    stiffness: Array  # k [N m/rad] (gaps,) of a flank
    damping: Array  # d [N m s/rad] (gaps,)


def followed(t: Array, mass: Array, force: Array, gaps: Gaps) -> Array:
    """x (gaps, samples) [rad] of the link against its motor.

    Of t (samples,), mass [kg m^2] and force [N m] (gaps, samples), or (1, samples) where they are
    those of all gaps. Over a sample, trapezoids; flank and film implicit. Stretches are followed
    side by side, each settled at first on the flank that is pressed; those whose start then is not
    where the one before ended are followed again from there.
    """
    length = _SHORT if len(gaps.half) <= _FEW else _LENGTH
    steps, count = len(t) - 1, max(1, -(-(len(t) - 1) // length))
    rest = count * length - steps  # behind the log no time goes by

    def stretched(x: Array, fill: float) -> Array:
        """x (rows, steps) as (length, rows, stretches)."""
        padded = np.concatenate([x, np.full((len(x), rest), fill)], axis=1)
        return np.ascontiguousarray(padded.reshape(len(x), count, length).transpose(2, 0, 1))

    h = stretched(np.diff(t)[None], 0.0)
    m, f = (stretched(0.5 * (x[:, 1:] + x[:, :-1]), 1.0) for x in (mass, force))
    first = np.arange(count) * length
    x = gaps.half[:, None] * np.sign(force[:, first]) + force[:, first] / gaps.stiffness[:, None]
    v, out = np.zeros_like(x), np.empty((length + 1, *x.shape))
    ends, some = np.zeros((2, *x.shape)), np.arange(count)
    while len(some):
        own = h[..., some], m[..., some], f[..., some]
        out[..., some], ends[1][:, some] = _moved(*own, x[:, some], v[:, some], gaps)
        ends[0] = out[-1]
        off = np.abs(ends[0, :, :-1] - x[:, 1:]) + _TICK * np.abs(ends[1, :, :-1] - v[:, 1:])
        some = 1 + np.flatnonzero((off > _SEAM * gaps.half[:, None]).any(axis=0))
        x[:, some], v[:, some] = ends[:, :, some - 1]
    along = out[1:].transpose(1, 2, 0).reshape(len(x), -1)
    return np.concatenate([out[0, :, :1], along], axis=1)[:, : len(t)]


def _moved(h: Array, m: Array, f: Array, x: Array, v: Array, gaps: Gaps) -> tuple[Array, Array]:
    """x (steps + 1, gaps, stretches), and v (gaps, stretches) at the end, from x and v.

    Of h (steps, 1, stretches), m and f (steps, gaps, stretches), or one for all gaps.
    """
    k, d, half = gaps.stiffness[:, None], gaps.damping[:, None], gaps.half[:, None]
    out = np.empty((len(h) + 1, *x.shape))
    out[0] = x
    drag, more = 0.5 * h * gaps.film[:, None], 0.5 * h * d + 0.25 * h * h * k
    given, push, half_step = h * f, h * k, 0.5 * h
    for i in range(len(h)):
        over = x - np.minimum(np.maximum(x, -half), half)
        over *= (k * over + d * v) * over > 0.0  # what is not closed does not push
        slowing = drag[i] + more[i] * (over != 0.0)
        after = (v * (m[i] - slowing) + given[i] - push[i] * over) / (m[i] + slowing)
        x = x + half_step[i] * (v + after)
        v = after
        out[i + 1] = x
    return out, v
