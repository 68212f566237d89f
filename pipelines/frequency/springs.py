"""What gives way, as masses and springs: the base under the arm, and the spring between a motor and its link.

    T = ½ I ẋ² + ½ J_m (ẋ + q̇)² + ½ (J - J_m)(ẋ + q̇ + ẇ)²,    V = ½ I ω_b² x² + ½ k w²

x turns the base, q is what encoder and torque act on, w the twist of the joint; J is the joint's inertia in a posture, the
other joints held. Resonances are the modes under no torque, antiresonances those with q locked (Spong 1987, ASME J. Dyn. Syst.
109, p. 310, for the joint).

    base alone       f_r = f_b in every posture,   f_a = f_b √(I / (I + J))
                     A rotor behind a gear turns N times as fast as the joint, and hardly feels the base: of J = J_l + J_m the base
                     carries J_l,  K = I ω_b²,  ω_a² = K / (I + J_l),  ω_r² = K / (I + J_l J_m / J);  J_m is 0 where it rides along
    joint alone      f_a = √(k / (J - J_m)) / 2π moves with the posture,   f_r / f_a = √(J / J_m)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.fit.bounded import least_squares
from pipelines.frequency.modes import Pair
from pipelines.frequency.rational import Known
from pipelines.io.log import Array

__all__ = ["Explained", "explain", "predicted"]


@dataclass(frozen=True)
class SpringsConfig:
    """Numbers of the fit of masses and springs.

    Attributes:
        floor: relative deviation of a frequency, at least: that of every bin of the fit (modes.ModesConfig.floor)
        known: relative deviation of an inertia that is exactly known: a prior that holds it to nine digits
        singular: of J: a body of less is lost in the sums of the mass matrix, with 16 digits and squares of frequencies
        rotor: of the least J, at most turns behind a gear: of all of it, nothing would be left to ride on the base
        impossible: deviations that bodies which cannot exist count as
    """

    floor: float = 1e-3
    known: float = 1e-9
    singular: float = 1e-12
    rotor: float = 0.95
    impossible: float = 1e3


_CONFIG = SpringsConfig()


@dataclass(frozen=True)
class Explained:
    """A set of springs fitted to the pairs of all postures."""

    base: tuple[float, float] | None  # f_b [Hz], I [kg m^2]; the base alone has a rotor's share of J as a third number
    joint: tuple[float, float] | None  # k [N m/rad], J_m [kg m^2]
    covariance: Array  # of the logarithms of the numbers above in their order
    misfit: float  # χ², with the `slack` that frequencies are granted
    worst: float  # largest relative deviation of a frequency
    freedom: int  # numbers measured less numbers fitted

    @property
    def std(self) -> tuple[float, ...]:
        """Relative, of the numbers above in their order."""
        return tuple(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).tolist())


def predicted(inertia: float, base: tuple[float, float] | None, joint: tuple[float, float] | None,
              rotor: float = 0.0) -> tuple[Array, Array]:
    """Antiresonances and resonances [Hz], sorted, of a joint with `inertia` [kg m^2]; NaN where no such bodies exist.

    `rotor` [kg m^2] of it turns behind a gear, and does not ride on the base.
    """
    f_b, i_b = base or (1.0, 1.0)
    k, motor = joint or (1.0, 0.5 * inertia)
    link, rides = inertia - motor, inertia - rotor
    if not np.isfinite([f_b * f_b * i_b, k, link]).all() or min(link, motor, i_b, rides) <= _CONFIG.singular * inertia:
        none = np.full(int(base is not None) + int(joint is not None), np.nan)
        return none, none
    if joint is None:  # K / (I + J_l), K / (I + J_l J_m / J)
        alone = f_b * np.sqrt([i_b / (i_b + rides), i_b / (i_b + rides * rotor / inertia)])
        return alone[:1], alone[1:]
    if base is None:  # k / J_l, k J / (J_l J_m)
        alone = np.sqrt([k / link, k * inertia / (link * motor)]) / (2.0 * np.pi)
        return alone[:1], alone[1:]
    mass = np.array([[i_b + rides, rides, link], [rides, inertia, link], [link, link, link]])
    spring = np.diag([i_b * (2.0 * np.pi * f_b) ** 2, 0.0, k])

    def frequencies(rows: list[int]) -> Array:
        values = np.linalg.eigvals(np.linalg.solve(mass[np.ix_(rows, rows)], spring[np.ix_(rows, rows)]))
        return np.sort(np.sqrt(np.maximum(values.real, 0.0))) / (2.0 * np.pi)

    return frequencies([0, 2]), frequencies([0, 1, 2])[1:]


def explain(pairs: Sequence[Sequence[Pair]], inertia: Sequence[float], base: bool, joint: bool,
            slack: float = 0.008, inertia_std: Sequence[float] = (), lightest: float = 0.5) -> Explained | None:
    """Springs at the base, in the joint or both, that explain the pairs of every posture best; None where counts differ.

    Args:
        pairs: of each posture, by frequency; as many as there are springs.
        inertia: J of each posture [kg m^2].
        slack: relative deviation of a frequency that masses and springs are granted: held joints give way a little, and J is
            averaged over a turn.
        inertia_std: relative, of J in each posture; none: exactly known. J is fitted beside the springs, with this as its prior.
        lightest: of the mean inertia, what a base alone weighs at least: one of nothing, under a rotor, is a link on a spring.
    """
    springs = int(base) + int(joint)
    if not pairs or springs == 0 or any(len(own) != springs for own in pairs):
        return None
    measured = np.log([[f.value for kind in _kinds(own) for f in kind] for own in pairs])
    spread = np.array([[np.hypot(f.std / f.value, slack) for kind in _kinds(own) for f in kind] for own in pairs])

    known = np.maximum(inertia_std if len(inertia_std) else np.zeros(len(inertia)), _CONFIG.known)
    geared = base and not joint
    numbers = 2 * springs + int(geared)

    def rest(theta: Array) -> Array:
        b, k = _taken(theta[:2 * springs], base, joint)
        # 0 … `rotor` of any real number
        rotor = 0.5 * _CONFIG.rotor * (1.0 + float(np.tanh(0.5 * theta[2]))) * min(inertia) if geared else 0.0
        rows = [np.concatenate(predicted(j * float(np.exp(s * more)), b, k, rotor))
                for j, s, more in zip(inertia, known, theta[numbers:], strict=True)]
        light = [min(theta[1] - np.log(least), 0.0) / slack] if geared else []
        off = ((np.log(rows) - measured) / spread).ravel()
        return np.concatenate([np.where(np.isfinite(off), off, _CONFIG.impossible), theta[numbers:], light])

    least = lightest * float(np.mean(inertia))
    starts = [np.concatenate([start, *([[rotor]] if geared else []), np.zeros(len(inertia))])
              for start in _starts(pairs, inertia, base, joint) for rotor in ((-4.0, 0.0) if geared else (0.0,))]
    found = [least_squares(rest, start) for start in starts]
    best = min(found, key=lambda one: float(one.rest @ one.rest))
    b, k = _taken(best.x[:2 * springs], base, joint)
    alone = np.array([[np.hypot(f.std / f.value, _CONFIG.floor) for kind in _kinds(own) for f in kind] for own in pairs])
    # What is left, not what was granted, says how well the numbers are known.
    weight = np.concatenate([(spread / alone).ravel(), np.ones(len(inertia) + int(geared))])
    freedom = measured.size - numbers
    jac, left = best.slope * weight[:, None], float(((best.rest * weight) ** 2).sum()) / max(freedom, 1)
    covariance = np.linalg.pinv(jac.T @ jac)[:2 * springs, :2 * springs] * max(left, 1.0)
    return Explained(b, k, covariance, float(best.rest @ best.rest),
                     float(np.abs(best.rest[:measured.size] * spread.ravel()).max()), freedom)


def _kinds(own: Sequence[Pair]) -> tuple[list[Known], list[Known]]:
    return [p.antiresonance.frequency for p in own], [p.resonance.frequency for p in own]


def _taken(theta: Array, base: bool, joint: bool) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    with np.errstate(over="ignore"):
        values = np.exp(theta).tolist()
    return (tuple(values[:2]) if base else None), (tuple(values[-2:]) if joint else None)


def _starts(pairs: Sequence[Sequence[Pair]], inertia: Sequence[float], base: bool, joint: bool) -> list[Array]:
    """Each pair of the first posture taken for either spring."""
    def as_base(p: Pair) -> list[float]:
        return [np.log(p.resonance.frequency.value), np.log(inertia[0] / max(p.rise - 1.0, 1e-6))]

    def as_joint(p: Pair) -> list[float]:
        motor = inertia[0] / max(p.rise, 1.0 + 1e-6)
        return [np.log((inertia[0] - motor) * (2.0 * np.pi * p.antiresonance.frequency.value) ** 2), np.log(motor)]

    first = pairs[0]
    if base and joint:
        return [np.array(as_base(first[i]) + as_joint(first[1 - i])) for i in (0, 1)]
    return [np.array(as_base(first[0]) if base else as_joint(first[0]))]
