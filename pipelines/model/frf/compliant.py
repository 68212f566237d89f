"""What gives way, as masses and springs: the base under the arm, and the spring between a motor and its link.

    T = ½ I ẋ² + ½ J_m (ẋ + q̇)² + ½ (J - J_m)(ẋ + q̇ + ẇ)²,    V = ½ I ω_b² x² + ½ k w²

x turns the base, q is what encoder and torque act on, w the twist of the joint; J is the joint's inertia in a posture, the
other joints held. Resonances are the modes under no torque, antiresonances those with q locked (Spong 1987, ASME J. Dyn. Syst.
109, p. 310, for the joint).

    base alone       f_r = f_b in every posture,   f_a = f_b √(I / (I + J))
    joint alone      f_a = √(k / (J - J_m)) / 2π moves with the posture,   f_r / f_a = √(J / J_m)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.fit.bounded import least_squares
from pipelines.fit.rational import Known
from pipelines.log.experiment import Array
from pipelines.model.frf.modes import Pair

__all__ = ["Explained", "explain", "predicted"]

_FLOOR = 1e-3  # relative deviation of a frequency, that of every bin of the fit
_LEAST = 1e-12  # of J: less is lost in the sums of the mass matrix, which is singular then


@dataclass(frozen=True)
class Explained:
    """A set of springs fitted to the pairs of all postures."""

    base: tuple[float, float] | None  # f_b [Hz], I [kg m^2]
    joint: tuple[float, float] | None  # k [N m/rad], J_m [kg m^2]
    std: tuple[float, ...]  # relative, of the numbers above in their order
    misfit: float  # χ²
    freedom: int  # numbers measured less numbers fitted


def predicted(inertia: float, base: tuple[float, float] | None, joint: tuple[float, float] | None) -> tuple[Array, Array]:
    """Antiresonances and resonances [Hz], sorted, of a joint with `inertia` [kg m^2]; NaN where no such bodies exist."""
    f_b, i_b = base or (1.0, 1.0)
    k, motor = joint or (1.0, 0.5 * inertia)
    link = inertia - motor
    kept = [i for i, there in enumerate((base is not None, True, joint is not None)) if there]
    locked = [i for i in kept if i != 1]
    if not np.isfinite([f_b * f_b * i_b, k, link]).all() or min(link, motor, i_b) <= _LEAST * inertia:
        return np.full(len(locked), np.nan), np.full(len(locked), np.nan)
    mass = np.array([[i_b + inertia, inertia, link], [inertia, inertia, link], [link, link, link]])
    spring = np.diag([i_b * (2.0 * np.pi * f_b) ** 2, 0.0, k])

    def frequencies(rows: list[int]) -> Array:
        values = np.linalg.eigvals(np.linalg.solve(mass[np.ix_(rows, rows)], spring[np.ix_(rows, rows)]))
        return np.sort(np.sqrt(np.maximum(values.real, 0.0))) / (2.0 * np.pi)

    return frequencies(locked), frequencies(kept)[1:]


def explain(pairs: Sequence[Sequence[Pair]], inertia: Sequence[float], base: bool, joint: bool,
            slack: float = 0.008, inertia_std: float = 0.0) -> Explained | None:
    """Springs at the base, in the joint or both, that explain the pairs of every posture best; None where counts differ.

    Args:
        pairs: of each posture, by frequency; as many as there are springs.
        inertia: J of each posture [kg m^2].
        slack: relative deviation of a frequency that masses and springs are granted: held joints give way a little, and J is
            averaged over a turn.
        inertia_std: relative, of all J alike: every mass and stiffness is as uncertain.
    """
    springs = int(base) + int(joint)
    if not pairs or springs == 0 or any(len(own) != springs for own in pairs):
        return None
    measured = np.log([[f.value for kind in _kinds(own) for f in kind] for own in pairs])
    spread = np.array([[np.hypot(f.std / f.value, slack) for kind in _kinds(own) for f in kind] for own in pairs])

    def rest(theta: Array) -> Array:
        b, k = _taken(theta, base, joint)
        rows = [np.concatenate(predicted(j, b, k)) for j in inertia]
        return _known(((np.log(rows) - measured) / spread).ravel())

    found = [least_squares(rest, start) for start in _starts(pairs, inertia, base, joint)]
    best = min(found, key=lambda one: float(one.rest @ one.rest))
    b, k = _taken(best.x, base, joint)
    alone = np.array([[np.hypot(f.std / f.value, _FLOOR) for kind in _kinds(own) for f in kind] for own in pairs])
    weight = (spread / alone).ravel()  # what is left, not what was granted, says how well the numbers are known
    jac, left = best.slope * weight[:, None], float(((best.rest * weight) ** 2).sum()) / max(measured.size - len(best.x), 1)
    covariance = np.linalg.pinv(jac.T @ jac) * max(left, 1.0)
    scaled = np.array([0.0, inertia_std][2 - 2 * base:] + [inertia_std, inertia_std][2 - 2 * joint:])
    return Explained(b, k, tuple(np.sqrt(np.maximum(np.diag(covariance), 0.0) + scaled**2).tolist()), float(best.rest @ best.rest),
                     measured.size - len(best.x))


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


def _known(values: Array) -> Array:
    """Bodies that cannot exist are as bad as can be."""
    return np.where(np.isfinite(values), values, 1e3)
