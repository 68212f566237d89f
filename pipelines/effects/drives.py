"""Drives and recorders: what all torque of a joint comes through."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.first_order import continuous, held_mean, lagging, later, rate_of_change
from pipelines.dynamics.functions import ARRAYS, Functions
from pipelines.effects.base import ArmModel, Effect, FrictionLaw, Hooks, Values, predicted
from pipelines.effects.config import EFFECTS

__all__ = [
    "DriveLag",
    "LoadFriction",
    "TorqueCrosstalk",
    "TorqueGain",
    "TorqueLag",
    "TorqueSaturation",
]

_LEAST = 1e-6  # numerics: of the torque that arrives
_LONG = 4.0  # numerics: samples


@dataclass(frozen=True)
class _InDrive(Effect):
    """An effect on the torque of its joint, other effects included."""

    @abstractmethod
    def asked(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        """Return what the log shows of its joint (samples,), of all torque (samples, joints)."""

    def passed(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        tau[:, self.index] = self.asked(tau, motion, arm, values)
        return tau


@dataclass(frozen=True)
class TorqueGain(_InDrive):
    """Applied torque = (1 + ε) logged torque: the log shows τ/(1 + ε), c = 1/(1 + ε) - 1."""

    name = "torque_gain"
    acts_on = "drive"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, self.own(predicted(arm, motion)))

    def amplitudes(self, values: Values) -> Array:
        return np.array([1.0 / (1.0 + values["gain_error"]) - 1.0])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        return {"gain_error": 1.0 / max(1.0 + float(amplitudes[0]), _LEAST) - 1.0}

    def asked(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        return self.own(tau) / (1.0 + values["gain_error"])

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        own, gain = self.index, 1.0 + values["gain_error"]
        return Hooks(drive=(own, lambda command, _, m: command[own] * gain))


@dataclass(frozen=True)
class TorqueCrosstalk(_InDrive):
    """Applied torque of joint j = u_j - c u_i: the log shows u_j = τ_j + c τ_i."""

    from_joint: float = 0.0  # i, 1-based

    name = "torque_crosstalk"
    acts_on = "drive"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, predicted(arm, motion)[:, int(self.from_joint) - 1])

    def asked(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        other = tau[:, int(values["from_joint"]) - 1]
        return np.asarray(self.own(tau) + values["coefficient"] * other)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        own, other, share = self.index, int(values["from_joint"]) - 1, values["coefficient"]
        return Hooks(drive=(own, lambda command, _, m: command[own] - share * command[other]))


@dataclass(frozen=True)
class TorqueSaturation(_InDrive):
    """Applied torque = u - e, e = sign(u) max(|u| - L, 0), u the logged torque.

    Motion tells the torque that came out: u is `Motion.tau`, or else the predicted torque. Held
    over each sample, e_k is the average of e over it; the column is e at t_k: (7 (e_k + e_{k-1}) -
    e_{k+1} - e_{k-2})/12, Colella & Woodward 1984, eq. (1.9) with even steps.
    """

    limit: float = 10.0  # L [N m]

    name = "torque_saturation"
    acts_on = "drive"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, self._excess(motion, self._command(motion, arm), self.limit))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Parts of the largest torque that is asked for."""
        peak = max(float(np.abs(self._command(motion, arm)).max()), 1e-3)
        for share in (0.45, 0.55, 0.65, 0.75, 0.82, 0.88, 0.94):
            yield replace(self, limit=self.within("limit", share * peak))

    def asked(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        command = self.own(tau if motion.tau is None else motion.tau)
        excess = self._excess(motion, command, values["limit"])
        return np.asarray(self.own(tau) + values["coefficient"] * excess)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        index, limit, share = self.index, values["limit"], values["coefficient"]

        def applied(command: Sequence[Any], _: Sequence[Any], m: Functions) -> Any:
            asked = command[index]
            return asked - share * (asked - m.smaller(m.larger(asked, -limit), limit))

        return Hooks(drive=(index, applied))

    def _command(self, motion: Motion, arm: ArmModel) -> Array:
        return self.own(predicted(arm, motion) if motion.tau is None else motion.tau)

    def _excess(self, motion: Motion, asked: Array, limit: float) -> Array:
        excess = asked - np.clip(asked, -limit, limit)
        if motion.tau is None or len(excess) < 4:  # noqa: PLR2004
            return excess
        between = 0.5 * (excess[1:] + excess[:-1])
        between[1:-1] = (7.0 * (excess[2:-1] + excess[1:-2]) - excess[3:] - excess[:-3]) / 12.0
        return np.concatenate([excess[:1], between])


@dataclass(frozen=True)
class LoadFriction(_InDrive, FrictionLaw):
    """τ = µ |τ_l| tanh(w v)/(1 - i µ c), c = sign(τ_l) tanh(w v), τ_l what the joint transmits.

    τ_l is its torque without friction, but for the share s of it that rubs behind the gear; and a
    gear that loses a part of what goes in has the share i of the loss in its load.
    """

    sharpness: float = 100.0  # w [s/rad]
    behind: float = 0.0  # s, held where it is 0
    input_side: float = 0.0  # i, held where it is 0

    name = "load_friction"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        before = (1.0 - self.behind) * self.own(arm.friction_torque(motion))
        load = self.own(predicted(arm, motion)) - before
        return self.on_own_row(arm, np.abs(load) * np.tanh(self.sharpness * self.own(motion.dq)))

    def forms(self) -> tuple[Self, ...]:
        behind = replace(self, behind=EFFECTS.half)
        return self, behind, replace(behind, input_side=EFFECTS.half)

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Under the load that the joint carries at rest, and what rubs behind it."""
        still = np.zeros((len(dq), arm.n_joints))
        resting = Motion(np.zeros(len(dq)), still, still, still)
        moving = replace(resting, dq=self.on_own_row(arm, dq)[..., 0])
        rubs = self.own(arm.friction_torque(moving))
        load = self.own(arm.torque(resting)) + values.get("behind", 0.0) * rubs
        return _lost(load, np.tanh(values["sharpness"] * dq), values)

    def asked(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        """Count as load all inside it but for friction before it."""
        own, side = self.own(tau), np.tanh(values["sharpness"] * self.own(motion.dq))
        load = own - (1.0 - values.get("behind", 0.0)) * self.own(arm.friction_torque(motion))
        return np.asarray(own + _lost(load, side, values))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the load of the drive's torque τ: τ is friction before it f, τ_l and its friction.

            τ_l = (τ - f)(1 - i µ c)/(1 + (1 - i) µ c),   c = sign(τ - f) tanh(w v)
        """
        index, curves = self.index, arm.friction_curves(self.index + 1)
        known = self.parameters.complete(values)
        mu, w, behind, into = (known[name] for name in ("mu", "sharpness", "behind", "input_side"))

        def reached(asked: Any, before: Any, v: Any, m: Functions) -> Any:
            friction = (1.0 - behind) * before
            passed = asked - friction
            lost = mu * m.sign(passed) * m.tanh(w * v)
            return friction + passed * (1.0 - into * lost) / (1.0 + (1.0 - into) * lost)

        def drive(command: Sequence[Any], speed: Sequence[Any], m: Functions) -> Any:
            v = speed[index]
            return reached(command[index], sum(curve.of(v, m) for curve in curves or ()), v, m)

        def actuator(command: Array, motion: Motion, _: Array) -> Array:
            left = command.copy()
            left[..., index] = reached(
                self.own(command),
                self.own(arm.friction_torque(motion)),
                self.own(motion.dq),
                ARRAYS,
            )
            return left

        return Hooks(actuator=actuator) if curves is None else Hooks(drive=(index, drive))


def _lost(load: Array, side: Array, values: Values) -> Array:
    """Return what a load (…) costs where the joint moves to one `side` (…) [-1, 1]."""
    into = values.get("input_side", 0.0) * values["mu"] * np.sign(load) * side
    return np.asarray(values["mu"] * np.abs(load) * side / (1.0 - into))


@dataclass(frozen=True)
class _Lag(_InDrive):
    """A first-order low-pass; one that is computed once a sample h acts half a sample sooner."""

    sample_time: float = 0.0  # h [s]; 0: not computed once a sample
    step: float = 0.0  # [s] of the logs

    def forms(self) -> tuple[Self, ...]:
        """Return the lag of any length, and that of a digital filter."""
        plain = replace(self, sample_time=0.0)
        return plain, replace(plain, sample_time=self.step)


@dataclass(frozen=True)
class DriveLag(_Lag):
    """T dτ/dt = u - τ: the log, which holds the command, shows u = τ + T dτ/dt.

    A filter that is computed once a sample h acts half a sample earlier: τ_k = a τ_{k-1} + (1 - a)
    u_k, a = exp(-h/T).
    """

    name = "drive_lag"
    acts_on = "drive"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, rate_of_change(self.own(predicted(arm, motion)), motion.t))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        yield replace(self, step=motion.sample_time)

    def asked(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        own = self.own(tau)
        time, sooner = continuous(values["time_constant"], values.get("sample_time", 0.0))
        return later(own + time * rate_of_change(own, motion.t), motion.t, -sooner)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Exact while a command is held: τ = u + (τ_k - u) e^(-(t - t_k)/T).

        The memory is τ_k, t_k and u; the drive has settled at the first command.
        """
        time, digital = max(values["time_constant"], 1e-9), values.get("sample_time", 0.0) > 0.0

        def reached(states: Array, t: Array, command: Array) -> Array:
            kept = np.exp(-np.maximum(t - states[:, 1], 0.0) / time)
            return np.asarray(command + (states[:, 0] - command) * kept)

        def update(motion: Motion, command: Array, states: Array) -> Array:
            now = self.own(command)
            moved = reached(states, motion.t, now if digital else states[:, 2])
            moved = np.where(np.isnan(states[:, 0]), now, moved)
            return np.stack([moved, motion.t, now], axis=1)

        def applied(command: Array, motion: Motion, states: Array) -> Array:
            late = command.copy()
            at_once = states[:, 0] if digital else reached(states, motion.t, self.own(command))
            late[..., self.index] = at_once
            return late

        def start(motion: Motion, tau: Array) -> Array:
            return np.full((len(motion.t), 3), np.nan)

        return Hooks(actuator=applied, states=3, start=start, update=update)


@dataclass(frozen=True)
class TorqueLag(_Lag):
    """T dy/dt = τ - y, y the logged torque: y = τ - T dτ/dt to first order.

    A filter that is computed once a sample h acts half a sample earlier: y_k = a y_{k-1} + (1 - a)
    τ_k, a = exp(-h/T).
    """

    # [s] the lag whose columns a search compares; 0: their limit for a small one
    looked_for: float = 0.0

    name = "torque_lag"
    acts_on = "record"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        """(H_T τ - τ) / T, at T = 0 -dτ/dt."""
        tau, time = self.own(predicted(arm, motion)), self.looked_for
        if time > 0.0:
            return self.on_own_row(arm, (self._behind(tau, motion, time) - tau) / time)
        return self.on_own_row(arm, -rate_of_change(tau, motion.t))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Return the limit, and lags in which a torque turns."""
        for time in EFFECTS.lags:
            yield replace(self, looked_for=time, step=motion.sample_time)

    def forms(self) -> tuple[Self, ...]:
        return tuple(replace(form, looked_for=0.0) for form in super().forms())

    def _behind(self, tau: Array, motion: Motion, time: float) -> Array:
        """Return H τ from the torque that the log shows first, where it was measured."""
        start = None if motion.logged is None else float(self.own(motion.logged))
        return lagging(tau, motion.t, time, start, motion.since)

    def asked(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        """Return y = H τ = τ - T H dτ/dt: all torque goes through the low-pass H.

        The first form where the lag is longer than some samples; the second keeps its slope at T =
        0.
        """
        own, t = self.own(tau), motion.t
        time, sooner = continuous(values["time_constant"], values.get("sample_time", 0.0))
        if len(t) > 1 and time > _LONG * float(np.median(np.diff(t))):
            lagged = self._behind(own, motion, time)
        else:
            lagged = own - time * lagging(rate_of_change(own, t), t, time)
        return later(lagged, t, sooner)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return a change of the log alone: the arm moves as without it."""
        time, digital = values["time_constant"], values.get("sample_time", 0.0) > 0.0

        def record(t: Array, command: Array) -> Array:
            logged, own = command.copy(), self.own(command)
            if digital:
                logged[:, self.index] = lagging(own, t, time, digital=True)
            else:
                logged[:, self.index] = held_mean(own, float(np.median(np.diff(t))), time)
            return logged

        return Hooks(record=record)
