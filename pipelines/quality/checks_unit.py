"""Check that torque is in the unit its log declares, and say how a file is told the unit that its numbers are in.

A torque at its limit is clipped. One that stays far beyond a limit shows that unit or limit is not what the log says: no drive
follows commands of many times what it can give.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.errors import Check
from pipelines.io.experiment import Array
from pipelines.io.units import UNITS
from pipelines.quality.checks_subject import NotTested, Subject
from pipelines.quality.faults import torque_limit

__all__ = ["TRUSTED", "UNIT_CHECKS", "angles_in_file", "torque_in_recipe"]

TRUSTED = ("RRID-S05", "RRID-S07")  # what is not asked where somebody vouches for the units

_OFTEN, _FAR = 0.9, 5.0  # quantile of a joint's |torque|, and times its limit: a controller that winds up gets there for moments
_PEAK, _SLACK = 0.999, 1.1  # quantile, so that no glitch counts; times the limit, which a joint may pass a little
_SMALL = 0.02  # of the limit: no arm uses less of its drives in all joints
_SMALLER = {True: ("N cm", "N mm"), False: ("mN",)}  # units that give larger numbers, where a joint turns, and where it slides


def torque_unit(s: Subject) -> Sequence[Check | NotTested]:
    """S05: torques declared in N m are in N m. Only limits of torque can tell."""
    limit = torque_limit(s.log)
    if "tau" not in s.log or not np.isfinite(limit).any():
        return s.cannot_tell("S05", "the robot's description has no limits of torque", signal="tau")
    often = _quantile(s.good.log.tau, _OFTEN) / limit
    peak = _quantile(s.good.log.tau, _PEAK) / limit
    if not (often > _FAR).any():
        return s.ok("S05", "torque is beyond its limits, but not by as much as in another unit" if (peak > 1.0).any() else
                    "torque is of the size that its limits allow", signal="tau")
    j = int(np.argmax(often))
    fitting = [unit for unit in _SMALLER[s.log.robot.joints[j].revolute]
               if _SMALL <= float(np.nanmax(peak)) * UNITS[unit].factor <= _SLACK]
    factors = " or ".join(f"{unit} ({1.0 / UNITS[unit].factor:g} times too large)" for unit in fitting)
    declared = s.unit("tau", j)
    others = bool(((peak >= _SMALL) & (peak <= 1.0)).any())  # in a smaller unit every joint's is too large, unless it hardly moves
    guesses, remedies = [f"this looks like {factors}"] if fitting else [], []
    if not others:
        guesses.append("motor current in A was taken for it")
    if fitting and not others:
        remedies.append(f"write so to the file: {_to_declare(s, 'tau', fitting[0])}")
    if others:
        guesses.append("its controller winds up, for other joints are within theirs")
        remedies += [f"if of joint {j + 1} alone, divide its column of tau by that factor"] if fitting else []
        remedies += [f"if of all joints, {_to_declare(s, 'tau', fitting[0])}"] if fitting else []
        remedies.append("leave out the stretches in which the joint does not follow")
    else:
        remedies.append("if it is current, import the recording anew with the torque constants")
    guess = ", or ".join(guesses)
    told = "; or ".join((*remedies, "correct the torque limits of the robot's description (--robot)"))
    return [s.say("S05", "warn" if s.log.torque == "measured" else "reject",
                  f"tau is declared in {declared}, but a tenth of joint {j + 1}'s samples are beyond "
                  f"{often[j]:.0f} times its limit of {limit[j]:.4g} {declared}, which no drive gives: "
                  f"{guess}", signal="tau", joint=j, gate=True, remedy=told)]


def torque_in_recipe() -> str:
    """S05's remedy where a recipe makes the log."""
    return 'declare the unit of tau that its numbers are in, such as unit = "N mm", or correct the torque limits of the robot'


def angles_in_file(s: Subject) -> str:
    """S07's remedy for the file of a log."""
    return (f"if degrees, write so to the file: {_to_declare(s, 'q', 'deg')} (likewise q_ref; dq, dq_ref: deg/s; ddq_ref: "
            "deg/s^2); if of the motor side, import the recording anew with the gear ratios; if neither, correct the limits of the "
            "robot's description (--robot)")


def _to_declare(s: Subject, signal: str, unit: str) -> str:
    if s.log.source.endswith(".parquet"):
        return f'units = "{unit}" in the metadata of the columns {signal}_1, …, without the digest'
    return f'attribute units = "{unit}" of /signals/{signal}, without the attribute digest of /'


def _quantile(tau: Array, share: float) -> Array:
    """(joints,) quantile of |tau|; zero where there is no sample."""
    size = np.sort(np.where(np.isfinite(tau), np.abs(tau), 0.0), axis=0)
    return np.asarray(size[round(share * (len(size) - 1))]) if len(size) else np.zeros(tau.shape[1])


UNIT_CHECKS = (torque_unit,)
