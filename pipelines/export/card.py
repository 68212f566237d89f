"""Report what an export carries exactly, approximates and loses, with its proof."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.export.target import Cause
from pipelines.io.model_file import Validity
from pipelines.io.results import NOT_STORED
from pipelines.report.document import document
from pipelines.report.report import Cell, Report, Table, columns_table

__all__ = ["Card", "Consistency", "LinkValue", "Proof", "Replay", "card"]


@dataclass(frozen=True)
class LinkValue:
    """A standard parameter of a link, about a frame on its joint."""

    joint: str
    name: str
    value: float
    std: float | None  # null where the logs tell nothing of it, or no std is known
    unit: str
    origin: str  # "logs", "description", "assumed", or "logs and …"


@dataclass(frozen=True)
class Consistency:
    """The physical consistency of the base parameters."""

    met: bool  # they have; else the file holds the nearest ones
    distance: float  # [standard deviations] between these and the estimate
    conflicts: tuple[str, ...]  # joints whose links keep them apart; none within the uncertainty
    impossible: tuple[str, ...]  # joints whose described links no body could be
    assumed: tuple[str, ...]  # joints whose links nothing describes
    cost: Array | None  # [N m] (joints,) torque error rms of the nearest ones


@dataclass(frozen=True)
class Proof:
    """The exported text, loaded again in its target."""

    program: str
    states: int
    relative_error: float  # largest difference of torque by the joint's largest torque
    says: str  # warnings of the program


@dataclass(frozen=True)
class Replay:
    """A log under the model and under the exported file: measured minus predicted torque."""

    name: str
    torque_rms: Array  # [N m] (joints,) measured
    model_error: Array  # [N m] rms
    export_error: Array | None  # [N m] rms; null where the target is not installed
    # [rad] rms (joints,), simulated in windows of 0.1 s minus measured; null but for mjcf
    model_position_error: Array | None
    export_position_error: Array | None


@dataclass(frozen=True)
class Card:
    """An exported model: its files, what they hold, and how that was checked."""

    target: str
    model: str
    robot: str
    joints: tuple[str, ...]
    units: tuple[str, ...]  # of torque
    files: tuple[str, ...]
    causes: tuple[Cause, ...]
    consistency: Consistency
    links: tuple[LinkValue, ...]
    proof: Proof | None  # null where the target is not installed
    motion: str  # on which approximations are measured
    torque_rms: Array  # [N m] (joints,) of the model there
    torque_error: Array | None  # [N m] rms of the exported file's torque minus the model's
    replays: tuple[Replay, ...]
    notes: tuple[str, ...]  # what differs from the description
    validity: Validity | None
    texts: Mapping[str, str] = field(metadata=NOT_STORED, repr=False)
    covariance: Array = field(metadata=NOT_STORED, repr=False)
    source: str = ""  # the model.json that was taken of a folder
    gravity: float = 0.0  # [m/s^2] its size
    reader: str = ""  # which version of the target the file needs, where that matters

    def count(self, carried: str) -> int:
        """Return how many causes are carried so."""
        return sum(cause.carried == carried for cause in self.causes)


def card(result: Card) -> Report:
    """Return the card: terms, proof, links, validity."""
    proved = result.proof is not None and not result.count("lost")
    worst = None
    if result.torque_error is not None:
        worst = float(np.max(result.torque_error / np.maximum(result.torque_rms, 1e-300)))
    return document(
        "export",
        "good" if proved and not result.consistency.conflicts else "attention",
        card=result,
        worst=worst,
        unit=" or ".join(dict.fromkeys(result.units)),
        proof=_proof(result),
    )


def _proof(result: Card) -> list[tuple[Table, str]]:
    """Return the tables of the proof with their captions: on a motion, and on replayed logs."""
    shown = {"torque rms": result.torque_rms, "error of the file": result.torque_error}
    caption = f"Torque of the model on {result.motion}, and how far the file is off [N m]."
    tables = [(_by_joint(result.joints, shown), caption)]
    for one in result.replays:
        shown = {"measured, rms": one.torque_rms, "error of the model": one.model_error}
        shown["error of the file"] = one.export_error
        tables.append((_by_joint(result.joints, shown), f"The log {one.name}, replayed [N m]."))
        if one.export_position_error is not None:
            shown = {"simulated by the model": one.model_position_error}
            shown["simulated by the target"] = one.export_position_error
            caption = f"Position error of {one.name}, in windows of 0.1 s under its torque [rad]."
            tables.append((_by_joint(result.joints, shown), caption))
    return tables


def _by_joint(joints: Sequence[Cell], shown: Mapping[str, Array | None]) -> Table:
    cells = {name: values.tolist() for name, values in shown.items() if values is not None}
    return columns_table({"joint": joints, **cells})
