"""Name viscous friction that comes out negative.

    for check in negative_viscous(found, where): ...

Friction takes power, so a viscous coefficient below zero is no friction: the torque has the wrong
sign, was compensated for friction, is late behind the motion, or the model lacks a law of friction
whose torque falls with speed. It is reported where it is significant by the standard deviation
that allows for autocorrelation (`pipelines.fit.covariance`), and where the logs determine it.
"""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.errors import Check
from pipelines.model.estimation.estimate import Estimate

__all__ = ["NegativeViscousConfig", "negative_viscous"]

_REMEDY = ("look whether the logged torque of this joint has the other sign, is compensated for "
           "friction, or is late behind the position; else its friction falls with speed, and "
           "the model lacks that law")


@dataclass(frozen=True)
class NegativeViscousConfig:
    """The number that decides."""

    # Standard deviations below zero. One-sided normal: of seven joints without viscous friction,
    # one arm in a hundred is reported by chance.
    least_std: float = 3.0


def negative_viscous(found: Estimate, where: str,
                     config: NegativeViscousConfig | None = None) -> tuple[Check, ...]:
    """Return a check, D15, of every joint whose viscous friction is significantly negative."""
    least = (config or NegativeViscousConfig()).least_std
    checks = []
    for k, column in enumerate(found.columns.names):
        cause, _, place = column.name.partition(":")
        sure = bool(found.trusted[k]) and found.beta[k] < -least * found.std[k]
        if cause != "viscous" or not sure:
            continue
        joint = place.partition(":")[0]
        size = f"{found.beta[k]:.3g} ± {found.std[k]:.2g} {column.unit}"
        message = f"viscous friction of joint {joint} is negative, {size}: it would drive the joint"
        checks.append(Check.of("D15", "warn", message, where=where, gate=True, remedy=_REMEDY))
    return tuple(checks)
