"""Check that torque, angles and time are in the units that their log declares."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.errors import Check, Level
from pipelines.io.units import UNITS
from pipelines.quality.config import CONFIG
from pipelines.quality.motion import peak_speed
from pipelines.quality.segments import torque_limit
from pipelines.quality.subject import NotTested, Subject

__all__ = ["TRUSTED", "UNIT_CHECKS", "degrees_or_motor"]

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
    often, peak = (
        np.quantile(tau, share, axis=0) / limit for share in (CONFIG.often, CONFIG.at_limit)
    )
    j, unit = int(np.argmax(often)), s.unit("tau", int(np.argmax(often)))
    if often[j] <= CONFIG.far:
        words = f"torque is beyond no limit by more than {CONFIG.far:g} times for long"
        return s.ok("S05", words, signal="tau")
    smaller = ("N cm", "N mm") if s.log.robot.joints[j].revolute else ("mN",)
    scaled = {name: peak.max() * UNITS[name].factor for name in smaller}
    fits = [u for u in smaller if CONFIG.small <= scaled[u] <= CONFIG.limit_slack]
    names = " or ".join(f"{u} ({1.0 / UNITS[u].factor:g} times too large)" for u in fits)
    guesses = [f"this looks like {names}"] if fits else []
    remedies = [f"write so to the file: {_to_declare(s, 'tau', fits[0])}"] if fits else []
    if ((peak >= CONFIG.small) & (peak <= 1.0)).any():  # a unit is that of all joints
        guesses += ["its controller winds up, for other joints are within their limits"]
        remedies += ["leave out the stretches in which the joint does not follow"]
    else:
        guesses += ["motor current in A was taken for it"]
        remedies += ["if it is current, import the recording anew with the torque constants"]
    remedies += ["correct the torque limits of the robot's description (--robot)"]
    words = f"tau is declared in {unit}, but a tenth of joint {j + 1}'s samples are beyond "
    words += f"{often[j]:.0f} times its limit of {limit[j]:.4g} {unit}, which no drive gives: "
    words, remedy = words + ", or ".join(guesses), "; or ".join(remedies)
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
    remedy = f"if degrees, write so to the file: {_to_declare(s, 'q', 'deg')} (likewise q_ref; dq, "
    remedy += "dq_ref: deg/s; ddq_ref: deg/s^2); if of the motor side, import the recording anew "
    remedy += "with the gear ratios; else correct the limits of the robot's description (--robot)"
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
    return found or s.ok(
        "S07", f"angles: {travel} of travel, speeds as the limits allow", signal="q"
    )


def _to_declare(s: Subject, signal: str, unit: str) -> str:
    if s.log.source.endswith(".parquet"):
        columns = f"the metadata of the columns {signal}_1, …, without the digest"
        return f'units = "{unit}" in {columns}'
    return f'attribute units = "{unit}" of /signals/{signal}, without the attribute digest of /'


def degrees_or_motor(reach: float, bounds: tuple[float, float]) -> str:
    """Return S07's remedy in a recipe, for numbers that are degrees or of the motor."""
    wide = max(abs(bounds[0]), abs(bounds[1]), bounds[1] - bounds[0])
    least = f" of at least {reach / wide:.3g}" if np.isfinite(wide) and wide > 0 else ""
    remedy = 'if degrees, declare unit = "deg" (divides by 57.3); if motor side, add [drive] '
    remedy += f"transmission = the gear ratios{least}, which multiplies torque by them as well; if "
    return remedy + "neither, pass --trust-units"


def pace(s: Subject) -> list[Check]:
    """S08: an arm recorded slower than controllers do is not slower than arms are.

    Milliseconds that are taken for seconds make every speed a thousandth, and nothing else in such
    a log contradicts itself. Where a smaller unit makes usual figures of rate and speed, the unit
    is asked about; an arm may creep.
    """
    rate = 1.0 / s.log.sample_time
    if rate > CONFIG.rare_hz or s.log.experiment == "hold" or s.travel.max() < CONFIG.moved:
        return []
    speed = peak_speed(s)
    if np.isnan(speed).all():
        return []
    j = int(np.nanargmax(speed))
    for unit, factor in (("ms", 1e3), ("us", 1e6)):
        usual = CONFIG.usual_speed[0] <= speed[j] * factor <= CONFIG.usual_speed[1]
        usual &= CONFIG.usual_hz[0] <= rate * factor <= CONFIG.usual_hz[1]
        if usual and speed[j] < CONFIG.creeps:
            words = (
                f"at {rate:.3g} Hz no joint is faster than {speed[j]:.2g} {s.unit('dq', j)}, as "
            )
            words += f"hardly any arm is: with steps in {unit}, joint {j + 1} would reach "
            words += f"{speed[j] * factor:.2g} at {rate * factor:.4g} Hz"
            remedy = f'if its time is in {unit}, declare unit = "{unit}" in [time] of its recipe '
            remedy += "and import it anew; if the arm did creep, all is right"
            return [s.say("S08", "warn", words, remedy, signal="t")]
    return s.ok(
        "S08", f"speeds up to {speed[j]:.3g} {s.unit('dq', j)}, at {rate:.3g} Hz", signal="t"
    )


UNIT_CHECKS = (pace, torque_unit, degrees)
