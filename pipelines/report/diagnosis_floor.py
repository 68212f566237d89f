"""Words and the table of torque errors beside the noise floor of a diagnosis."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipelines.diagnosis.result import Diagnosis, ResidualRms
from pipelines.log.experiment import Array
from pipelines.report.joint_units import Units
from pipelines.report.report import Table
from pipelines.report.style import format_number, to_one_place

__all__ = [
    "floor_name",
    "floor_words",
    "held_out_words",
    "judge_words",
    "torque_errors",
    "what_stays",
]

_TURNING = Units()
# Ratio to the noise floor from which the residual of a joint is mentioned: of reference logs, and
# where the floor is the noise of the residual itself, above which healthy arms lie as well.
_MENTIONED, _MENTIONED_ABOVE_NOISE = 1.3, 10.0


def what_stays(found: Diagnosis) -> str:
    """Return the joints whose residual is still above the noise floor, in a sentence; or nothing."""
    noise = found.noise_floor_origin == "blocks"
    ratio = found.after_rms.validate / np.maximum(found.residual_rms.noise_floor, 1e-300)
    high = np.flatnonzero(ratio > (_MENTIONED_ABOVE_NOISE if noise else _MENTIONED)).tolist()
    if not high:
        return ""
    if noise:
        which = " and ".join(f"joint {j + 1}" for j in high)
        return (
            f" On held-out motion the residual of {which} is above the noise; whether it is above "
            "that of a healthy arm is not known: there are no reference logs."
        )
    each = "; ".join(f"joint {j + 1} {format_number(float(ratio[j]), 2)}" for j in high)
    return f" Ratio of the remaining held-out residual to the noise floor: {each}."


def floor_name(found: Diagnosis) -> str:
    """Return the name of the noise floor, as a heading."""
    return "noise of the residual" if found.noise_floor_origin == "blocks" else "left by reference logs"


def floor_words(found: Diagnosis) -> str:
    """Return where the noise floor comes from."""
    if found.noise_floor_origin == "blocks":
        return (
            "The noise floor is the residual of the final model on the identification logs; there are "
            "no reference logs to compare with."
        )
    return "The noise floor is the residual of the healthy model on the reference logs."


def judge_words(held_out: str) -> str:
    """Return which rows validate, within a sentence."""
    if held_out == "logs":
        return "held-out logs"
    return "blocks held out of the identification logs (none has role validate)"


def held_out_words(held_out: str) -> str:
    """Return which rows validate."""
    if held_out == "logs":
        return "Held-out errors are those of logs of role validate, to which nothing was fitted."
    return "No log has the role validate: contiguous blocks of time were held out, one after the other."


def torque_errors(
    before: ResidualRms,
    after: ResidualRms,
    rated: Sequence[float],
    floor: Array,
    name: str,
    words: str,
    units: Units = _TURNING,
) -> Table:
    """Return the held-out torque error of each joint before and after, beside the noise floor.

    Where nothing extends the model there is no column of the extended one.

    Args:
        floor: (joints,) [N m]; `name`: what it is called; `words`: where it comes from.
    """
    extended = not np.array_equal(before.validate, after.validate, equal_nan=True)
    errors = (before.validate, after.validate) if extended else (before.validate,)
    torques = to_one_place([*(float(x) for one in errors for x in one), *map(float, floor)])
    joints = len(floor)
    limits = [
        rated[j] if j < len(rated) and math.isfinite(rated[j]) else math.nan for j in range(joints)
    ]
    shares = to_one_place([100.0 * float(x[j]) / limits[j] for x in errors for j in range(joints)])
    rows = tuple((j + 1, *torques[j::joints], *shares[j::joints]) for j in range(joints))
    unit, now = units.torque, "torque error now" if extended else "torque error"
    more = (f"extended [{unit}]",) if extended else ()
    of_rated = (
        ("now [% of rated]", "extended [% of rated]") if extended else ("error [% of rated]",)
    )
    heads = ("joint", f"{now} [{unit}]", *more, f"{name} [{unit}]", *of_rated)
    return Table(heads, rows, f"Held out, root mean square. {words}".strip())
