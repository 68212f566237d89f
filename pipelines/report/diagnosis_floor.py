"""Words of what a diagnosis is judged by: the floor and where it comes from, what was held out, and errors beside both."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.answered.loud import loud_joint
from pipelines.model.diagnosis.floor.thresholds import LOUDER
from pipelines.model.diagnosis.result import Diagnosis, ResidualRms
from pipelines.report.joint_units import Units
from pipelines.report.report import Table
from pipelines.report.style import format_number, to_one_place

__all__ = ["above_in_order", "floor_name", "floor_words", "held_out_floor", "held_out_words", "judge_words", "loud_drives",
           "torque_errors", "what_stays"]

_TURNING = Units()
_FLOORS = {
    "twin": "The floor is what the simulated twin leaves: the fitted model run through the same experiment and the same analysis.",
    "reference logs": "The floor is what the reference logs leave.",
    "repetition": "The floor is what two repetitions of the same motion differ by.",
}

_FLOOR_NAMES = {"twin": "left by the twin", "reference logs": "left by reference logs", "repetition": "between repetitions",
                "blocks": "noise of the residual"}

_ORDER = 1.3  # times what an arm in order leaves: no further than that may an extended model be from it (issue 9)
# Times the floor, up to which the table calls an error in order, and times the noise, up to which nobody asks whether it is.
_STAYS, _STAYS_ABOVE_NOISE = _ORDER, 10.0
_OF_A_LAW = 0.02  # of what a joint left before: no law is that of the machine to more, least of all where it was not fitted
_LITTLE = 1.9  # the same: of 114 arms in order none left more
_HELD_OUT_FLOOR = ("An arm in order is the fitted rigid body and friction, simulated in the held-out experiments with the noise of "
                   "these drives")
_LEFT_IN_ORDER = "an arm in order leaves"
_JUDGED = (f"What is up to {_ORDER:g} times as much is in order; a little above it, up to {_LITTLE:g} times, some arms in order "
           f"have been seen; what is more than {LOUDER:g} times the error itself is no measure of it")
_AND_BEFORE = ", and what the model left of the reference logs beyond that"


def what_stays(found: Diagnosis) -> str:
    """" Joint 1 stays at 2.3 times what an arm in order leaves there, without a name."; empty where no joint stands so high.

    Above noise alone an arm in order stands too, many times: how many is no measure of a fault then, and is not told.
    """
    floor, name, _ = held_out_floor(found)
    noise = found.floor_origin == "blocks"
    times = found.after_rms.validate / np.maximum(floor, 1e-300)
    high = np.flatnonzero(times > (_STAYS_ABOVE_NOISE if noise else _STAYS)).tolist()
    if not high:
        return ""
    if noise:
        which = " and ".join(f"joint {j + 1}" for j in high)
        leave = "leave" if len(high) > 1 else "leaves"
        return (f" Held out, {which} still {leave} more than noise; whether more than an arm in order does is not known: "
                f"{_no_floor(found)}.")
    what = f"what {name}" if name == _LEFT_IN_ORDER else "its floor"
    share = found.after_rms.validate / np.maximum(found.residual_rms.validate, 1e-300)
    named = [j for j in high if share[j] <= _OF_A_LAW]

    def stays(some: Sequence[int]) -> str:
        each = "; ".join(f"joint {j + 1} stays at {format_number(float(times[j]), 2)} times {what}" for j in some)
        return f" {each.capitalize()}, held out"

    nameless = [j for j in high if j not in named]
    without = f"{stays(nameless)}, without a name." if nameless else ""
    if not named:
        return without
    most = f"{'at most ' if len(named) > 1 else ''}{format_number(100.0 * float(share[named].max()), 2)} %"
    return f"{without}{stays(named)}: {most} of what was left before, as what was found is not known to the last."


def above_in_order(found: Diagnosis) -> str:
    """" Joint 1 leaves 1.5 times …", where the table calls a joint's error above the floor; empty elsewhere."""
    floor, name, _ = held_out_floor(found)
    times = np.where(floor > 0.0, found.after_rms.validate / np.maximum(floor, 1e-300), 0.0)
    high = np.flatnonzero(times > _ORDER).tolist() if name == _LEFT_IN_ORDER else []
    if not high:
        return ""
    each = " and ".join(f"joint {j + 1} leaves {_times(float(times[j]))[:-1]} times" for j in high)
    little = ", and so little alone is no fault" if times.max() <= _LITTLE else ""
    return f" Of the held-out logs {each} what {name}: no cause was found for it{little}."


def loud_drives(noise: Array, rated: Sequence[float], units: Units = _TURNING) -> str:
    """" This holds only if its drives are as noisy as 0.35 N m at joint 3 …", where the noise that a twin was given, (joints,)
    [N m], is more than drives have: what shakes an arm, a gap say, is taken for noise, and raises the floor. Empty elsewhere."""
    if (loud := loud_joint(noise, rated)) is None:
        return ""
    size = f"{format_number(loud.noise, 2)} {units.at(loud.joint).torque}"
    return (f" This holds only if its drives are as noisy as {size} at joint {loud.joint}, "
            f"{format_number(100.0 * loud.share, 2)} % of the rated torque: so much noise hides faults, and may be one; "
            "record reference logs while the arm is known to be in order, or frequency responses.")


def floor_name(found: Diagnosis) -> str:
    """What the floor is, in a heading: what nobody calls a fault, which is more than noise where the arm was known before."""
    return _FLOOR_NAMES.get(found.floor_origin, "floor")


def held_out_floor(found: Diagnosis) -> tuple[Array, str, str]:
    """The floor beside held-out errors: (joints,) [N m], its name in a heading, and where it comes from."""
    if found.held_out_floor is None:
        return found.residual_rms.floor, floor_name(found), floor_words(found)
    more = _AND_BEFORE if found.floor_origin == "reference logs" else ""
    return found.held_out_floor, _LEFT_IN_ORDER, f"{_HELD_OUT_FLOOR}{more}. {_JUDGED}."


def floor_words(found: Diagnosis) -> str:
    """Where the floor comes from."""
    if found.floor_origin == "blocks":
        return f"The floor is the noise in the residual itself, and an arm in order leaves more than that: {_no_floor(found)}."
    return _FLOORS.get(found.floor_origin, f"The floor comes from {found.floor_origin}.")


def _no_floor(found: Diagnosis) -> str:
    """Why nobody knows a better floor than noise."""
    return (f"these logs describe their controller, but {found.no_twin}" if found.no_twin else
            "there are neither reference logs nor a known controller")


def judge_words(held_out: str) -> str:
    """What judged, within a sentence."""
    why = "for none has role validate" if held_out == "blocks" else "for what is wrong shows in those of role validate alone"
    return "held-out logs" if held_out == "logs" else f"blocks held out of the fitted logs ({why})"


def held_out_words(held_out: str) -> str:
    """What judged."""
    if held_out == "blocks of all logs":
        return ("What is wrong shows in the logs of role validate alone, so they were fitted too: contiguous blocks of time, of "
                "all logs, were held out one after the other.")
    if held_out == "logs":
        return "Held-out errors are those of logs of role validate, to which nothing was fitted."
    return "No log has the role validate: contiguous blocks of time were held out, one after the other."


def torque_errors(before: ResidualRms, after: ResidualRms, rated: Sequence[float], floor: Array, name: str, words: str,
                  units: Units = _TURNING) -> Table:
    """Joint by joint: the held-out torque error before and after, in N m and in percent of the rated torque, and the floor.

    Beside what an arm in order leaves stands whether the error is in order. Where nothing extends the model there is no column
    for what an extension would leave: it would say the same twice.

    Args:
        floor: (joints,) [N m]; `name`: what it is called; `words`: where it comes from.
    """
    extended = not np.array_equal(before.validate, after.validate, equal_nan=True)
    errors = (before.validate, after.validate) if extended else (before.validate,)
    torques = to_one_place([*(float(x) for one in errors for x in one), *map(float, floor)])
    joints = len(floor)
    limits = [rated[j] if j < len(rated) and math.isfinite(rated[j]) else math.nan for j in range(joints)]
    shares = to_one_place([100.0 * float(x[j]) / limits[j] for x in errors for j in range(joints)])
    judged = [(_judged([float(x[j]) for x in errors], float(floor[j])),) if name == _LEFT_IN_ORDER else () for j in range(joints)]
    rows = tuple((j + 1, *torques[j::joints], *judged[j], *shares[j::joints]) for j in range(joints))
    asked = ("beside it",) if name == _LEFT_IN_ORDER else ()
    unit = units.torque
    heads = (f"torque error now [{unit}]", f"extended [{unit}]", f"{name} [{unit}]", *asked, "now [% of rated]",
             "extended [% of rated]") if extended else (
        f"torque error [{unit}]", f"{name} [{unit}]", *asked, "error [% of rated]")
    return Table(("joint", *heads), rows, f"Of what was held out, root mean square. {words}".strip())


def _times(times: float) -> str:
    """On its own side of what is in order."""
    near = (times <= _ORDER) != (float(f"{times:.2g}") <= _ORDER)
    return f"{format_number(times, 3 if near else 2)}×"


def _judged(errors: Sequence[float], floor: float) -> str:
    """Whether an error is in order, and how many times what an arm in order leaves it is: now, then extended."""
    if not floor > 0.0:
        return "–"
    fine = [error <= _ORDER * floor for error in errors]
    times = [_times(error / floor) for error in errors]
    shown = " → ".join(dict.fromkeys(times[-1:] if fine[0] and fine[-1] else times))
    if errors[-1] * LOUDER < floor:
        return f"{shown}, no measure"
    return f"{shown}, {'in order' if fine[-1] else 'a little above it' if errors[-1] <= _LITTLE * floor else 'above it'}"
