"""Words of a diagnosis that several of its sections use."""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.result import Diagnosis, Value
from pipelines.model.effects import effect_names, find_effect
from pipelines.report.style import format_number, with_std

__all__ = ["cause_at", "floor_words", "held_out_words", "per_joint", "title_of", "told_value"]

_FLOORS = {
    "twin": "The floor is what the simulated twin leaves: the fitted model run through the same experiment and the same analysis.",
    "reference logs": "The floor is what the reference logs leave.",
    "repetition": "The floor is what two repetitions of the same motion differ by.",
    "blocks": "The floor is the noise in the residual itself: neither reference logs nor a known controller give a better one.",
}


def cause_at(cause: str, joint: int | None) -> str:
    """As causes are written on the command line."""
    return cause if joint is None else f"{cause}:{joint}"


def title_of(cause: str) -> str:
    """Plain words for a cause."""
    return find_effect(cause).title if cause in effect_names() else cause


def told_value(value: Value) -> str:
    """"0.102 ± 0.003", or three of them."""
    values = value.value if isinstance(value.value, tuple | list) else (value.value,)
    stds = value.std if isinstance(value.std, tuple | list) else (value.std,) * len(values)
    return ", ".join(with_std(x, s) if s is not None else format_number(x) for x, s in zip(values, stds, strict=True))


def per_joint(x: Array) -> str:
    """"0.02, 0.01, 0.005"."""
    return ", ".join(format_number(float(v), 2) for v in np.ravel(x))


def floor_words(found: Diagnosis) -> str:
    """Where the floor comes from."""
    return _FLOORS.get(found.floor_origin, f"The floor comes from {found.floor_origin}.")


def held_out_words(found: Diagnosis) -> str:
    """What judged."""
    if found.held_out == "logs":
        return "Held-out errors are those of logs of role validate, to which nothing was fitted."
    return "No log has the role validate: contiguous blocks of time were held out, one after the other."
