"""Friction by the speed of its joint: laws that differ by their curve."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import Functions
from pipelines.effects.base import (
    ArmModel,
    Effect,
    FrictionLaw,
    Hooks,
    Pointwise,
    SpeedCurve,
    Values,
    predicted,
)
from pipelines.effects.config import EFFECTS
from pipelines.effects.hooks import sign_curve

__all__ = [
    "AsymmetricFriction",
    "ConcaveFriction",
    "Coulomb",
    "QuadraticDrag",
    "Stribeck",
    "ThreeSigmoid",
    "TorqueOffset",
    "TwoSigmoid",
    "Viscous",
    "ViscousDrift",
]

_NONE = 1e-6  # numerics: of a knee or a tail
_FAST = 1e3  # numerics: [rad/s] where dry friction no longer changes


@dataclass(frozen=True)
class _Curved(Pointwise):
    """A law that is a sum of `SpeedCurve`s."""

    @abstractmethod
    def curves(self) -> Sequence[SpeedCurve]:
        """Return the curve of each amplitude, per unit of it."""

    def parts(self, q: Any, v: Any, m: Functions) -> Sequence[Any]:
        return [curve.of(v, m) for curve in self.curves()]

    def speed_curve(self, values: Values) -> SpeedCurve:
        return SpeedCurve.total(self.at(values).curves(), self.amplitudes(values).tolist())


@dataclass(frozen=True)
class TorqueOffset(_Curved):
    """τ = τ0."""

    name = "torque_offset"

    def curves(self) -> Sequence[SpeedCurve]:
        return (SpeedCurve(constant=1.0),)


@dataclass(frozen=True)
class Viscous(_Curved, FrictionLaw):
    """τ = b v."""

    name = "viscous"
    evidence = "none"

    def curves(self) -> Sequence[SpeedCurve]:
        return (SpeedCurve(viscous=1.0),)


@dataclass(frozen=True)
class Coulomb(_Curved, FrictionLaw):
    """τ = Fc ((2 - r) tanh(x) + (r - 1) x/√(1 + x²)), x = w v, of roundness r up to 2.

    From r = 2 on it is Fc ((3 - r) x/√(1 + x²) + (r - 2) (2/π) arctan x).

    A jump sign(v) would leave spikes in a fit whose speed passes zero a little early, and chatter
    in a simulation: one smooth law in both. tanh (r = 1), the root (r = 2) and the arc tangent (r =
    3) are all in use (Pennestrì, Rossi, Salvini & Valentini 2016), and none is a fault: a diagnosis
    fits r beside the width 1/w; where r is 1 it is held.
    """

    sharpness: float = 100.0  # w [s/rad]
    roundness: float = 1.0  # r

    name = "coulomb"
    evidence = "none"

    def curves(self) -> Sequence[SpeedCurve]:
        return (sign_curve(1.0, self.sharpness, self.roundness),)

    def forms(self) -> tuple[Self, ...]:
        return self, replace(self, roundness=EFFECTS.roundness)


@dataclass(frozen=True)
class _Sigmoids(_Curved, FrictionLaw):
    """τ = Σ f_k tanh(w_k v) + b v; as w -> 0 a sigmoid becomes part of b."""

    evidence = "none"

    @property
    def sharpnesses(self) -> list[float]:
        """[s/rad] w_k."""
        return [getattr(self, q.name) for q in self.parameters if q.shape]

    def curves(self) -> Sequence[SpeedCurve]:
        sigmoids = [SpeedCurve(heights=(1.0,), sharpnesses=(w,)) for w in self.sharpnesses]
        return *sigmoids, SpeedCurve(viscous=1.0)

    def shape_slopes(self, motion: Motion, amplitudes: Array) -> Array:
        """∂τ/∂ln w_k = f_k w_k v (1 - tanh²(w_k v))."""
        reach = np.multiply.outer(self.sharpnesses, self.own(motion.dq))  # (sigmoids, samples)
        bend = np.tanh(reach)
        np.square(bend, out=bend)
        np.subtract(1.0, bend, out=bend)
        bend *= reach
        bend *= amplitudes[: len(reach), None]
        return bend.T

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """w1 > w2 > …, of a geometric grid between the slowest and fastest speeds."""
        speed = np.abs(self.own(motion.dq))
        moving = speed[speed > 0]
        fast, slow = (moving.max(), np.quantile(moving, 0.02)) if moving.size else (1.0, 0.01)
        grid = np.geomspace(1 / fast, 2 / max(slow, 1e-3 * fast), EFFECTS.sharpnesses)
        for found in combinations(grid[::-1].tolist(), len(self.sharpnesses)):
            shape: dict[str, Any] = {f"w{k}": w for k, w in enumerate(found, start=1)}
            yield replace(self, **shape)


@dataclass(frozen=True)
class ThreeSigmoid(_Sigmoids):
    """τ = Σ_k f_k (1 - 2/(exp(2 w_k v) + 1)) + b v = Σ_k f_k tanh(w_k v) + b v.

    Kostić et al. 2004, eq. (10). A set is one of 48 equal ones, 3! orders times 2³ signs; w1 > w2 >
    w3 > 0 names it. A dip at low speed needs f of both signs. Compare curves, not parameters.
    """

    w1: float = 100.0  # [s/rad]
    w2: float = 30.0  # [s/rad]
    w3: float = 10.0  # [s/rad]

    name = "three_sigmoid"
    plainer = (("two_sigmoid",), ("coulomb", "viscous"))

    @staticmethod
    def canonical(values: Values) -> dict[str, float]:
        """Return the one of the 48 equal sets that has w1 > w2 > w3 > 0."""
        pairs = [(values[f"f{k}"], values[f"w{k}"]) for k in (1, 2, 3)]
        positive = [(f, w) if w >= 0 else (-f, -w) for f, w in pairs]
        ordered = list(enumerate(sorted(positive, key=lambda pair: -pair[1]), start=1))
        heights, sharpnesses = (
            {f"{letter}{k}": pair[i] for k, pair in ordered} for i, letter in enumerate("fw")
        )
        return heights | sharpnesses | {"b": values["b"]}


@dataclass(frozen=True)
class TwoSigmoid(_Sigmoids):
    """τ = f_1 tanh(w_1 v) + f_2 tanh(w_2 v) + b v: eq. (10) with two terms of its three.

    A jump at zero speed, and a dip (f_2 < 0) or a slower rise (f_2 > 0) behind it.
    """

    w1: float = 60.0  # [s/rad]
    w2: float = 12.0  # [s/rad]

    name = "two_sigmoid"
    plainer = (("coulomb", "viscous"),)


@dataclass(frozen=True)
class QuadraticDrag(Pointwise, FrictionLaw):
    """τ = c v |v|."""

    name = "quadratic_drag"

    def parts(self, q: Any, v: Any, m: Functions) -> Sequence[Any]:
        return (v * abs(v),)


@dataclass(frozen=True)
class Stribeck(Pointwise, FrictionLaw):
    """τ = A (1 + (e^p - 1) |v/v_s|^n)^(-1/p) tanh(w v), beside Coulomb and viscous friction.

    As p goes to 0 it is A exp(-|v/v_s|^n) tanh(w v): Armstrong-Hélouvry, Dupont & Canudas de Wit
    1994, eq. (7); n = 1 is Tustin 1947. p = 1, n = 2 is Hess & Soom 1990.
    """

    speed: float = 0.1  # v_s [rad/s]
    sharpness: float = 100.0  # w [s/rad]
    tail: float = 0.0  # p, held where it is 0
    exponent: float = 2.0  # n, held where it is 2

    name = "stribeck"

    def parts(self, q: Any, v: Any, m: Functions) -> Sequence[Any]:
        over = abs(v / self.speed) ** self.exponent
        if self.tail < _NONE:
            left = m.exp(-over)
        else:
            left = (1.0 + math.expm1(self.tail) * over) ** (-1.0 / self.tail)
        return (left * m.tanh(self.sharpness * v),)

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """v_s from where the sign has changed to a third of the fastest speed."""
        slowest = EFFECTS.over / self.sharpness
        fastest = max(self.fastest(motion) / 3.0, 2.0 * slowest)
        for speed in np.geomspace(slowest, fastest, 8).tolist():
            yield replace(self, speed=self.within("speed", speed))

    def possible(self, values: Values) -> bool:
        """Return whether the hump lasts until friction has changed its sign: else it is no hump."""
        lasts = values["speed"] * values["sharpness"] >= EFFECTS.over - _NONE
        return super().possible(values) and lasts

    def forms(self) -> tuple[Self, ...]:
        return self, replace(self, tail=0.5), replace(self, exponent=1.5)


@dataclass(frozen=True)
class ConcaveFriction(Pointwise, FrictionLaw):
    """τ = A tanh(v/v_0), or A x (1 + |x|^a)^(-1/a), x = v/v_0, beside Coulomb and viscous friction.

    The second is the shear of a lubricant whose viscosity falls as 1/|v| far above v_0: Yasuda,
    Armstrong & Cohen 1981, with the knee a; a = 2 is Carreau 1972.
    """

    speed: float = 1.0  # v_0 [rad/s]
    knee: float = 0.0  # a, held where it is 0: tanh

    name = "concave_friction"

    def parts(self, q: Any, v: Any, m: Functions) -> Sequence[Any]:
        x = v / self.speed
        if self.knee < _NONE:
            return (m.tanh(x),)
        return (x * (1.0 + abs(x) ** self.knee) ** (-1.0 / self.knee),)

    def speed_curve(self, values: Values) -> SpeedCurve | None:
        if values["knee"] >= _NONE:
            return None
        return SpeedCurve(heights=(values["amplitude"],), sharpnesses=(1.0 / values["speed"],))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """v_0 over a decade and a half below the fastest speed: beyond it is viscous friction."""
        fast = self.fastest(motion)
        for speed in np.geomspace(fast / 30.0, fast, 8).tolist():
            yield replace(self, speed=self.within("speed", speed))

    def possible(self, values: Values) -> bool:
        return super().possible(values) and not _NONE <= values["knee"] < EFFECTS.bluntest

    def forms(self) -> tuple[Self, ...]:
        return self, replace(self, knee=EFFECTS.carreau)


@dataclass(frozen=True)
class AsymmetricFriction(Pointwise):
    """τ = ½ s (ΔFc tanh(w v) + ΔFv v), Δ the positive direction minus the negative one.

    s is sign v, or s = tanh(w v): the directions go over into each other as friction changes its
    sign. A joint that creeps about standstill, |v| < 1/w, tells the two apart.
    """

    sharpness: float = 100.0  # w [s/rad]
    gradual: float = 0.0  # 1: s = tanh(w v)

    name = "asymmetric_friction"

    def parts(self, q: Any, v: Any, m: Functions) -> Sequence[Any]:
        turned = m.tanh(self.sharpness * v)
        half = 0.5 * (turned if self.gradual else m.sign(v))
        return half * turned, half * v

    def forms(self) -> tuple[Self, ...]:
        return self, replace(self, gradual=1.0)


@dataclass(frozen=True)
class ViscousDrift(Effect):
    """τ = r Fv (1 - e^(-(t - t0)/T)) v: from viscous friction Fv to (1 + r) Fv."""

    time_constant: float = 15.0  # T [s]
    # [s] clock time at which the session began, for a joint that is warm stays warm in the next
    # log; None: each log for itself
    since: float | None = None

    name = "viscous_drift"
    clock = "session"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        start = motion.t[0] if self.since is None else self.since
        left = np.expm1(-np.maximum(motion.t - start, 0.0) / self.time_constant)
        return self.on_own_row(arm, -self._viscous(arm) * left * self.own(motion.dq))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """From a fifth to five times the duration; beyond that it is a straight line."""
        duration = max(float(np.ptp(motion.t)), 1.0)
        for share in (0.2, 0.5, 1.5, 5.0):
            yield replace(self, time_constant=self.within("time_constant", share * duration))

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Return what is added when the drift has ended."""
        return np.asarray(values["relative_change"] * self._viscous(arm) * dq)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Its memory is the time at which the log began."""
        change, time = values["relative_change"] * self._viscous(arm), values["time_constant"]

        def load(motion: Motion, states: Array) -> Array:
            grown = -np.expm1(-(motion.t - states[:, 0]) / time)
            return self.on_own_row(arm, change * grown * self.own(motion.dq))[..., 0]

        return Hooks(
            load=load,
            states=1,
            start=lambda motion, _: motion.t[:, None],
            update=lambda motion, _, states: states,
        )

    def _viscous(self, arm: ArmModel) -> float:
        """Return Fv [N m s/rad] of the model, all else at rest.

        Where f(v) = Fc + Fv v + c v |v|, far above where the sign changes: from speeds v, 2v, 3v.
        """
        still = np.zeros((6, arm.n_joints))
        speed = self.on_own_row(arm, _FAST * np.array([1.0, 2.0, 3.0, -1.0, -2.0, -3.0]))[..., 0]
        tau = self.own(predicted(arm, Motion(np.arange(6.0), still, speed, still)))
        one, two, three = 0.5 * (tau[:3] - tau[3:])
        bent = 0.5 * (three - 2.0 * two + one)
        return float((two - one - 3.0 * bent) / _FAST)
