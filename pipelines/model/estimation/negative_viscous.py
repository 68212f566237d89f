"""Name viscous friction that comes out negative.

    for check in negative_viscous(found, where): ...

Friction takes power, so a viscous coefficient below zero is no friction: the torque has the wrong
sign, was compensated for friction, is late behind the motion, or the model lacks a law of friction
whose torque falls with speed. It is reported where it is significant by the standard deviation
that allows for autocorrelation (`pipelines.fit.covariance`), where the logs determine it, and
where it stays so beside a second Coulomb law with the widest change of sign: at speeds within that
width, viscous friction only mends the shape of the change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipelines.effects import find_effect
from pipelines.effects.base import everywhere
from pipelines.errors import Check
from pipelines.model.estimation.estimate import Estimate, estimate
from pipelines.model.estimation.regression import LogEquations

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
    places = _significant(found, least)
    if not places:
        return ()
    sure = _significant(_with_wide_change_of_sign(found), least)
    names = found.columns.names
    checks = []
    for k in (k for k in places if k in sure):
        joint = names[k].name.split(":")[1]
        size = f"{found.beta[k]:.3g} ± {found.std[k]:.2g} {names[k].unit}"
        message = f"viscous friction of joint {joint} is negative, {size}: it would drive the joint"
        checks.append(Check.of("D15", "warn", message, where=where, gate=True, remedy=_REMEDY))
    return tuple(checks)


def _significant(found: Estimate, least: float) -> Sequence[int]:
    """Return the places of the viscous coefficients that are determined and negative."""
    below = found.trusted & (found.beta < -least * found.std)
    return [k for k, column in enumerate(found.columns.names)
            if column.name.startswith("viscous:") and below[k]]


def _with_wide_change_of_sign(found: Estimate) -> Estimate:
    """Return the estimate of the same equations with a second Coulomb law at every joint."""
    coulomb = find_effect("coulomb")
    widest = next(q.low for q in coulomb.parameters if q.name == "sharpness")
    columns = found.columns
    wide = [replace(law, sharpness=widest)  # type: ignore[call-arg]  # of the Coulomb law
            for law in everywhere(coulomb, columns.body.robot.revolute)]
    columns = replace(columns, laws=(*columns.laws, *wide))
    logs = [replace(log, columns=columns) for log in found.equations.logs
            if isinstance(log, LogEquations)]
    return estimate(logs, columns)
