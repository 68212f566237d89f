"""The contract bears what is not a sum: small effects of every kind, written here as their own files would be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import (
    ArmModel,
    Effect,
    Hooks,
    Parameters,
    Predict,
    Quantity,
    Words,
)
from sample_logs.make_closed_form import Fourier
from sample_logs.make_model import synthetic_arm

Values = Mapping[str, float]


class Said(Effect):
    """What a real effect says in words."""

    words = Words(*["For tests."] * 5)


@dataclass(frozen=True)
class LateEncoder(Said):
    """q_measured(t) = q(t - delay): an exact extension that hands on another motion."""

    name = "late_encoder"
    parameters: ClassVar[Parameters] = Parameters(Quantity("delay", "s", 0.0, 0.02, "age of a position"))

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        step = 1e-6
        return (arm.torque(self._shifted(motion, -step)) - arm.torque(self._shifted(motion, step)))[..., None] / (2 * step)

    def apply(self, motion: Motion, arm: ArmModel, values: Values, predict: Predict | None = None) -> Array:
        return (predict or nominal)(self._shifted(motion, -values["delay"]), arm)

    def _shifted(self, motion: Motion, by: float) -> Motion:
        k = self.index
        shift = {key: getattr(motion, key).copy() for key in ("q", "dq", "ddq")}
        shift["q"][:, k] += -by * motion.dq[:, k]
        shift["dq"][:, k] += -by * motion.ddq[:, k]
        return replace(motion, **shift)


@dataclass(frozen=True)
class Clipped(Said):
    """τ -> clip(τ, ±limit) on its own row: the limit is non-linear, the coefficient is 1 for a hard clip."""

    limit: float = 10.0

    name = "clipped"
    parameters: ClassVar[Parameters] = Parameters(
        Quantity("coefficient", "1", 0.0, 1.0, "part of the excess that is lost"),
        Quantity("limit", "N m", 0.0, 100.0, "largest torque", shape=True))

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        tau = self.own(arm.torque(motion))
        return self.on_own_row(arm, np.clip(tau, -self.limit, self.limit) - tau)

    def apply(self, motion: Motion, arm: ArmModel, values: Values, predict: Predict | None = None) -> Array:
        tau = (predict or nominal)(motion, arm)
        own = self.own(tau)
        tau[:, self.index] += values["coefficient"] * (np.clip(own, -values["limit"], values["limit"]) - own)
        return tau


@dataclass(frozen=True)
class Heavier(Said):
    """p -> (1 + part) p: another body, the whole arm."""

    name = "heavier"
    scope = "arm"
    parameters: ClassVar[Parameters] = Parameters(Quantity("part", "1", -1.0, 1.0, "share of mass more"))

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return arm.body.torque(motion.q, motion.dq, motion.ddq, arm.p)[..., None]

    def apply(self, motion: Motion, arm: ArmModel, values: Values, predict: Predict | None = None) -> Array:
        return (predict or nominal)(motion, arm.with_body(arm.body, (1 + values["part"]) * arm.p))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        return Hooks(arm=arm.with_body(arm.body, (1 + values["part"]) * arm.p))


@dataclass(frozen=True)
class Bristle(Said):
    """dz/dt = v - |v| z/x_c, τ = amplitude z/x_c (Dahl 1968): a state of memory, in the simulation too."""

    distance: float = 0.01

    name = "bristle"
    parameters: ClassVar[Parameters] = Parameters(
        Quantity("amplitude", "N m", 0.0, 10.0, "torque once it slides"),
        Quantity("distance", "rad", 1e-4, 0.1, "travel until it slides", shape=True))

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        z = np.zeros(len(motion.t))
        travel = np.diff(self.own(motion.q))
        for k, d in enumerate(travel):
            z[k + 1] = (z[k] + d) / (1 + abs(d) / self.distance)
        return self.on_own_row(arm, z / self.distance)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        shaped = self.at(values)
        x = shaped.distance
        return Hooks(load=lambda motion, z: shaped.on_own_row(arm, values["amplitude"] * z[:, 0] / x)[..., 0], states=1,
                     rate=lambda motion, _, z: (self.own(motion.dq) - np.abs(self.own(motion.dq)) * z[:, 0] / x)[:, None])


def nominal(motion: Motion, arm: ArmModel) -> Array:
    return arm.torque(motion)


@pytest.fixture(scope="module")
def arm() -> Arm:
    return synthetic_arm()


@pytest.fixture(scope="module")
def motion() -> Motion:
    rng = np.random.default_rng(3)
    return Fourier(np.zeros(3), rng.normal(size=(3, 4)), rng.normal(size=(3, 4)), 0.25)(np.linspace(0.0, 3.999, 4000))


@pytest.mark.parametrize(("effect", "values"), [
    (LateEncoder(2), {"delay": 1e-5}), (Clipped(2), {"coefficient": 1.0, "limit": 15.0}), (Heavier(), {"part": 0.1})])
def test_exact_and_first_order_agree(arm: Arm, motion: Motion, effect: Effect, values: dict[str, float]) -> None:
    """Warped, clipped, rebuilt: for a small cause the exact change is columns @ amplitudes."""
    effect = effect.at(values)
    change = effect.apply(motion, arm, values) - arm.torque(motion)
    first = effect.columns(motion, arm) @ effect.amplitudes(values)
    assert np.abs(change).max() > 0
    assert np.abs(change - first).max() <= 0.02 * np.abs(change).max()


def test_a_clip_comes_last(arm: Arm, motion: Motion) -> None:
    """Each effect acts around those before it: what is clipped last stays within its limit."""
    limit = {"coefficient": 1.0, "limit": 12.0}
    clip, late, heavy = (Acting.of(Clipped(2), limit), Acting.of(LateEncoder(1), {"delay": 2e-3}),
                         Acting.of(Heavier(), {"part": 0.2}))
    tau = arm.extended(late, heavy, clip).torque(motion)
    assert np.abs(tau[:, 1]).max() == pytest.approx(12.0)
    assert np.abs(arm.extended(clip, heavy).torque(motion)[:, 1]).max() == pytest.approx(12.0)
    late_and_heavy = arm.extended(late, heavy).torque(motion)
    np.testing.assert_array_equal(tau[:, [0, 2]], late_and_heavy[:, [0, 2]])
    np.testing.assert_allclose(tau[:, 1], np.clip(late_and_heavy[:, 1], -12, 12), atol=1e-12)


def test_a_state_simulates_as_it_fits(arm: Arm, motion: Motion) -> None:
    """The hooks of an effect with memory, stepped along the motion for two replicas at once, give its torque."""
    values = {"amplitude": 2.0, "distance": 0.05}
    hooks = Bristle(3).simulate(arm, values)
    assert hooks.load is not None
    assert hooks.rate is not None
    z, h, loads = np.zeros((2, hooks.states)), 1e-3, []
    for k in range(len(motion.t)):
        row = np.repeat([k], 2)
        now = Motion(motion.t[row], motion.q[row], motion.dq[row], 0 * motion.ddq[row])
        loads.append(hooks.load(now, z))
        z = z + h * hooks.rate(now, np.zeros((2, 3)), z)
    simulated = np.array(loads)
    np.testing.assert_array_equal(simulated[:, 0], simulated[:, 1])
    assert np.abs(simulated[:, 0] - Bristle(3).torque(motion, arm, values)).max() < 0.05
