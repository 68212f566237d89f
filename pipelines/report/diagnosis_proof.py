"""The figure that proves a finding: the residual before and after, over what the cause depends on, beside what it predicts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from pipelines.diagnosis.result import Finding
from pipelines.model.rows.residual_analysis import Proof
from pipelines.report import style
from pipelines.report.figures import broken_at_gaps
from pipelines.report.joint_units import Units
from pipelines.report.report import Figure
from pipelines.report.style import format_number, format_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_proof", "draw_proof_in_time", "proof_figures"]

_TURNING = Units()
_LITTLE = 0.3  # of the means without the finding: less is little
_MUCH = 0.8  # more is most of them
_DRAWN = {False: "means in bins", True: "amplitudes in the log that shows most of it"}


def proof_figures(number: int, one: Finding, units: Units = _TURNING) -> Iterator[Figure]:
    """Over the signal that tells it, and over a stretch of time."""
    proof = one.proof
    if proof is None:
        return
    torque = units.at(proof.joint).torque
    against = f"the time of {one.log}" if one.log else proof.against
    over = f"Residual of joint {proof.joint} over {against}, {_DRAWN[_in_waves(proof)]}"
    yield Figure(f"proof-{number}", f"{over}: {_shown(proof, torque)}.",
                 lambda drawing: draw_proof(drawing.subplots(), proof, torque), (6.0, 3.2))
    yield Figure(f"proof-{number}-in-time", f"The same residual of joint {proof.joint} where the finding shows most, over time.",
                 lambda drawing: draw_proof_in_time(drawing.subplots(), proof, torque), (6.0, 2.6))


def _shown(proof: Proof, torque: str) -> str:
    """What the drawn means say: how large they are without and with the finding, and whether that is little."""
    # Squared amplitudes add up to the mean square of the residual, squared means of bins are averaged.
    over = np.nansum if _in_waves(proof) else np.nanmean
    before, after = (float(np.sqrt(over(np.square(shown)))) for shown in (proof.before, proof.after))
    sizes = f"{format_number(before, 2)} {torque} rms without the finding, {format_number(after, 2)} {torque} with it"
    if after <= _LITTLE * before:
        return f"{sizes}; the residual without it follows what it predicts"
    if after <= _MUCH * before:
        return f"{sizes}; part of the residual without it follows what it predicts"
    alike = "like this" if _in_waves(proof) else "averaged like this"
    return f"{sizes}; {alike} most of it stays, and the gain in numbers has to prove it"


def _in_waves(proof: Proof) -> bool:
    return proof.against == "frequency"


def draw_proof(axes: Axes, proof: Proof, torque: str = "N m") -> None:
    """Means in bins with their standard errors, or amplitudes over frequency."""
    axes.fill_between(proof.x, proof.before - 2.0 * proof.spread, proof.before + 2.0 * proof.spread, color=style.SKY, alpha=0.35,
                      linewidth=0.0)
    axes.plot(proof.x, proof.before, color=style.BLUE, linewidth=1.6, label="without the finding")
    axes.plot(proof.x, proof.predicted, color=style.ORANGE, linestyle=(0, (5, 1.5)), linewidth=1.4,
              label="what the finding predicts")
    axes.plot(proof.x, proof.after, color=style.VERMILLION, linewidth=1.0, label="left with it")
    _finish(axes, f"{proof.against} [{format_unit(proof.unit)}]", torque)


def draw_proof_in_time(axes: Axes, proof: Proof, torque: str = "N m") -> None:
    """A stretch of time; where nothing counts, for a drive was at its limit say, no line is drawn."""
    t = np.asarray(proof.t)
    axes.plot(*broken_at_gaps(t, proof.before_in_time), color=style.SKY, linewidth=2.4, label="without the finding")
    axes.plot(*broken_at_gaps(t, proof.predicted_in_time), color=style.ORANGE, linestyle=(0, (5, 1.5)), linewidth=1.2,
              label="what the finding predicts")
    axes.plot(*broken_at_gaps(t, proof.after_in_time), color=style.VERMILLION, linewidth=0.9, label="left with it")
    _finish(axes, "time [s]", torque)


def _finish(axes: Axes, x: str, torque: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(f"residual torque [{torque}]")
    axes.margins(x=0.01, y=0.1)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0, ncols=3)
