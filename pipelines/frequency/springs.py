"""Explain pairs of modes by masses and springs: the base under the arm, and a spring in the joint.

    T = ½ I ẋ² + ½ J_m (ẋ + q̇)² + ½ (J - J_m)(ẋ + q̇ + ẇ)²,    V = ½ I ω_b² x² + ½ k w²

x turns the base, q is what encoder and torque act on, w the twist of the joint; J is the joint's
inertia in a posture, the other joints held. Resonances are the modes under no torque,
antiresonances those with q locked (Spong 1987, ASME J. Dyn. Syst. 109, p. 310, for the joint).

    base alone       f_r = f_b in every posture,   f_a = f_b √(I / (I + J))
                     A rotor behind a gear turns N times as fast as the joint, and hardly feels the
                     base: of J = J_l + J_m the base carries J_l,  K = I ω_b²,
                     ω_a² = K / (I + J_l),  ω_r² = K / (I + J_l J_m / J); J_m = 0 if it rides along
    joint alone      f_a = √(k / (J - J_m)) / 2π moves with the posture,   f_r / f_a = √(J / J_m)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.estimation.bounded import Minimum, least_squares
from pipelines.frequency.config import ModesConfig, RationalConfig, SpringsConfig
from pipelines.frequency.modes import Pair
from pipelines.frequency.spectra import Array

__all__ = ["Explained", "explain", "predicted"]

_CONFIG = SpringsConfig()

Spring = tuple[float, float]  # f_b [Hz], I [kg m^2] of a base; k [N m/rad], J_m [kg m^2] of a joint


@dataclass(frozen=True)
class Explained:
    """A set of springs fitted to the pairs of all postures."""

    base: Spring | None
    joint: Spring | None
    covariance: Array  # of the logarithms of the numbers above in their order
    misfit: float  # χ², with the `slack` that frequencies are granted
    worst: float  # largest relative deviation of a frequency
    freedom: int  # numbers measured less numbers fitted

    @property
    def std(self) -> tuple[float, ...]:
        """Relative, of the numbers above in their order."""
        return tuple(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).tolist())


def predicted(
    inertia: float, base: Spring | None, joint: Spring | None, rotor: float = 0.0
) -> tuple[Array, Array]:
    """Antiresonances and resonances [Hz], sorted, of a joint with `inertia` [kg m^2].

    NaN where no such bodies exist. `rotor` [kg m^2] of the inertia turns behind a gear, and does
    not ride on the base.
    """
    f_b, i_b = base or (1.0, 1.0)
    k, motor = joint or (1.0, 0.5 * inertia)
    link, rides = inertia - motor, inertia - rotor
    lightest = min(link, motor, i_b, rides)
    if not np.isfinite([f_b * f_b * i_b, k]).all() or not lightest > _CONFIG.singular * inertia:
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
        own = np.ix_(rows, rows)
        values = np.linalg.eigvals(np.linalg.solve(mass[own], spring[own]))
        return np.sort(np.sqrt(np.maximum(values.real, 0.0))) / (2.0 * np.pi)

    return frequencies([0, 2]), frequencies([0, 1, 2])[1:]


def explain(
    pairs: Sequence[Sequence[Pair]],
    inertia: Sequence[float],
    springs: tuple[bool, bool],
    slack: float = ModesConfig().held_still,
    inertia_std: Sequence[float] = (),
    lightest: float = 0.5,
) -> Explained | None:
    """Return what explains the pairs of every posture best; None where counts differ.

    Args:
        pairs: of each posture, by frequency; as many as there are springs.
        inertia: J of each posture [kg m^2].
        springs: whether there is one at the base, and in the joint.
        slack: relative deviation of a frequency that masses and springs are granted.
        inertia_std: relative, of J in each posture; none: exactly known. J is fitted beside the
            springs, with this as its prior.
        lightest: of the mean inertia, what a base alone weighs at least: one of nothing, under a
            rotor, is a link on a spring.
    """
    count = sum(springs)
    if not pairs or any(len(own) != count for own in pairs):
        return None
    measured, std = _frequencies(pairs)
    spread = np.hypot(std, slack)
    known = np.maximum(inertia_std if len(inertia_std) else np.zeros(len(inertia)), _CONFIG.known)
    geared = springs == (True, False)
    least = lightest * float(np.mean(inertia))
    numbers = 2 * count + int(geared)

    def rest(theta: Array) -> Array:
        base, joint = _taken(theta, springs)
        light, rotor = [], 0.0
        if geared:
            light = [min(theta[1] - np.log(least), 0.0) / slack]
            # 0 … `rotor` of any real number
            rotor = 0.5 * _CONFIG.rotor * (1.0 + float(np.tanh(0.5 * theta[2]))) * min(inertia)
        true = np.array(inertia) * np.exp(known * theta[numbers:])
        rows = [np.concatenate(predicted(float(j), base, joint, rotor)) for j in true]
        off = ((np.log(rows) - measured) / spread).ravel()
        off = np.where(np.isfinite(off), off, _CONFIG.impossible)
        return np.concatenate([off, theta[numbers:], light])

    starts = [
        np.concatenate([start, rotor, np.zeros(len(inertia))])
        for start in _starts(pairs[0], inertia[0], springs)
        for rotor in ([[-4.0], [0.0]] if geared else [[]])
    ]
    best = min((least_squares(rest, start) for start in starts), key=_misfit)
    # the rest, not what was granted, says how well the numbers are known
    weight = np.ones(len(best.rest))
    weight[: spread.size] = (spread / np.hypot(std, RationalConfig().floor)).ravel()
    freedom = spread.size - numbers
    left = float(((best.rest * weight) ** 2).sum()) / max(freedom, 1)
    jac = best.slope * weight[:, None]
    inverse = np.linalg.pinv(jac.T @ jac)[: 2 * count, : 2 * count]
    covariance = np.asarray(inverse * max(left, 1.0), dtype=np.float64)
    worst = float(np.abs(best.rest[: spread.size] * spread.ravel()).max())
    return Explained(*_taken(best.x, springs), covariance, _misfit(best), worst, freedom)


def _misfit(found: Minimum) -> float:
    """χ²."""
    return float(found.rest @ found.rest)


def _frequencies(pairs: Sequence[Sequence[Pair]]) -> tuple[Array, Array]:
    """Logarithms of antiresonances, then resonances (postures, frequencies), and their stds."""
    found = []
    for own in pairs:
        modes = [*(p.antiresonance for p in own), *(p.resonance for p in own)]
        found.append(
            [(np.log(m.frequency.value), m.frequency.std / m.frequency.value) for m in modes]
        )
    both = np.array(found)
    return both[..., 0], both[..., 1]


def _taken(theta: Array, springs: tuple[bool, bool]) -> tuple[Spring | None, Spring | None]:
    base, joint = springs
    with np.errstate(over="ignore"):
        first, last = np.exp(theta[:2]).tolist(), np.exp(theta[2 * base : 2 * base + 2]).tolist()
    return (first[0], first[1]) if base else None, (last[0], last[1]) if joint else None


def _starts(first: Sequence[Pair], inertia: float, springs: tuple[bool, bool]) -> list[list[float]]:
    """Each pair of the first posture taken for either spring."""

    def as_base(p: Pair) -> list[float]:
        return [np.log(p.resonance.frequency.value), np.log(inertia / max(p.rise - 1.0, 1e-6))]

    def as_joint(p: Pair) -> list[float]:
        motor = inertia / max(p.rise, 1.0 + 1e-6)
        omega = 2.0 * np.pi * p.antiresonance.frequency.value
        return [np.log((inertia - motor) * omega**2), np.log(motor)]

    if all(springs):
        return [as_base(first[i]) + as_joint(first[1 - i]) for i in (0, 1)]
    return [as_base(first[0]) if springs[0] else as_joint(first[0])]
