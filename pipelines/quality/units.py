"""Check the units of a log: whether torques declared in N m and angles in rad can be in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.errors import Check, Level
from pipelines.io.units import UNITS
from pipelines.quality.config import CONFIG
from pipelines.quality.motion import peak_speed
from pipelines.quality.segments import torque_limit
from pipelines.quality.subject import NotTested, Subject

# S07's remedy in a recipe, for numbers that are degrees or of the motor
DEGREES_OR_MOTOR = (
    'if degrees, declare unit = "deg" (divides by 57.3); if motor side, add [drive] transmission = '
    "the gear ratios, which multiplies torque by them as well; if neither, pass --trust-units"
)
TRUSTED = ("RRID-S05", "RRID-S07")  # not checked where the user vouches for the units


def torque_unit(s: Subject) -> Sequence[Check | NotTested]:
    """S05: torques declared in N m are in N m. Only limits of torque can tell.

    A torque at its limit is clipped. One that is far beyond for a tenth of the time shows that unit
    or limit is wrong: no drive follows commands of many times what it can give.
    """
    limit = torque_limit(s.log)
    if not np.isfinite(limit).any():
        return s.cannot_tell("S05", "the robot's description has no torque limits", signal="tau")
    tau = np.nan_to_num(np.abs(s.good.log.tau))
    often, peak = (np.quantile(tau, q, axis=0) / limit for q in (CONFIG.often, CONFIG.at_limit))
    j = int(np.argmax(often))
    unit = s.unit("tau", j)
    if often[j] <= CONFIG.far:
        words = f"torque is beyond no limit by more than {CONFIG.far:g} times for long"
        return s.ok("S05", words, signal="tau")
    words = f"tau is declared in {unit}, but a tenth of joint {j + 1}'s samples are beyond "
    words += f"{often[j]:.0f} times its limit of {limit[j]:.4g} {unit}, which no drive gives"
    remedy = "if it is current, import the recording with the torque constants; or correct the "
    remedy += "torque limits of the robot's description (--robot)"
    for smaller in ("N cm", "N mm") if s.log.robot.joints[j].revolute else ("mN",):
        factor = UNITS[smaller].factor
        if CONFIG.small <= peak.max() * factor <= CONFIG.limit_slack:
            words += f"; this looks like {smaller} ({1.0 / factor:g} times too large)"
            remedy = f"write so to the file: {_written('tau', smaller)}; {remedy}"
    level: Level = "warn" if s.log.torque == "measured" else "reject"
    return [s.say("S05", level, words, remedy, True, signal="tau", joint=j)]


def degrees(s: Subject) -> Sequence[Check | NotTested]:
    """S07: angles declared in rad are not degrees. Only limits of position and speed can tell."""
    joints = s.log.robot.joints
    if not np.isfinite([(*joint.position, joint.velocity) for joint in joints]).any():
        words = "the robot's description has no limits of position or speed"
        return s.cannot_tell("S07", words, signal="q")
    found, speed = [], peak_speed(s)
    reach = np.maximum(np.nanmax(np.abs(s.position), axis=0, initial=0.0), s.travel)
    remedy = f"if degrees, write so to the file: {_written('q', 'deg')} (likewise deg/s, deg/s^2); "
    remedy += "if of the motor side, import the recording anew with the gear ratios; else correct "
    remedy += "the limits of the robot's description (--robot)"
    for j, joint in enumerate(joints):
        bound = max(map(abs, joint.position)) if np.isfinite(joint.position).all() else np.inf
        times = np.array([reach[j] / bound, speed[j] / joint.velocity])
        beyond = bool((times > (2.0, 3.0)).any())
        fits = not (np.deg2rad(times) > CONFIG.limit_slack).any()
        if joint.revolute and s.travel[j] > 0 and reach[j] > CONFIG.degrees and beyond and fits:
            words = f"q of joint {j + 1} is declared in rad, but looks like degrees or the motor "
            words += f"side: {reach[j]:.4g} at {speed[j]:.4g} a second is beyond the limits in rad"
            found.append(s.say("S07", "reject", words, remedy, signal="q", joint=j))
    travel = s.with_units("q", s.travel.tolist())
    words = f"angles: {travel} of travel, speeds as the limits allow"
    return found or s.ok("S07", words, signal="q")


def _written(signal: str, unit: str) -> str:
    places = f"/signals/{signal} (HDF5) or the columns {signal}_1, {signal}_2, … (Parquet)"
    return f'units = "{unit}" of {places}, without the attribute digest'


UNIT_CHECKS = (torque_unit, degrees)
