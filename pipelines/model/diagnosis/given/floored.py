"""The floor of logs without reference logs, where it comes from, and the thresholds that follow from it.

    floored = floored_by(prepared, case, rough, chosen, given)
    floored.rms, floored.origin, floored.thresholds

By what an earlier diagnosis has stored; by a twin where the logs know a controller; else by the noise in what a model leaves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.own_motion import following
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.floor.calibrated import bounds_of, conditions_of, origin_of, refuse_calibration, thresholds_of
from pipelines.model.diagnosis.floor.calibration import Calibration
from pipelines.model.diagnosis.floor.drive_noise import drive_noise, white
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.floor.twin import Twin, make_twin, not_replayable, replayable
from pipelines.model.diagnosis.given.clean import clean
from pipelines.model.diagnosis.rows.imperfections import DriveNoise
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Explored, beside_another
from pipelines.model.diagnosis.worth.evidence import floors_of

__all__ = ["Floored", "floored_by"]

_RUNS_AWAY = "RRID-D17"
_UNLIKELY = 2.0  # times what the nominal model leaves of the log at some joint, that a twin of an arm in order leaves


@dataclass(frozen=True, eq=False)
class Floored:
    """The floor, where it comes from, and what follows from it."""

    rms: Array  # (joints,) [N m]
    origin: str
    thresholds: Thresholds | None
    calibration: Calibration | None
    noise: DriveNoise | None  # None where nobody knows
    reference: Array | None = None  # (joints,) [N m] what all the reference logs leave, whatever their speeds
    judging: Array | float = 1.0  # (joints,) times as much power the reference logs leave at the speeds of the logs held out
    twin: Twin | None = None  # whose replicas it is, where it was made for these logs
    runs_away: str = ""  # why there is none although the logs know their controller: no model of the arm follows it
    no_twin: str = ""  # why the noise has to do although the logs describe their controller, whatever the reason, in words


def floored_by(prepared: Prepared, case: Case, rough: tuple[Explored, ...], chosen: DiagnosisSettings,
               given: Calibration | None) -> Floored:
    """By what was stored; by the twin where a controller is known; else by the noise in the residual."""
    if given is not None:
        refuse_calibration(given, prepared, case.families, "twin")
    made, twin, why, no_twin = given, None, "", ""
    if given is None:
        try:
            made, twin = _calibrated(prepared, case, rough, chosen)
        except InputRejected as refused:
            why = refused.message if refused.code == _RUNS_AWAY else ""  # numbers of too poor a motion, D15, are no arm's fault
            no_twin = f"the arm as it was fitted cannot be simulated: {refused.message}"
    if made is None:
        return Floored(white(prepared.data, clean(rough[-1])), "blocks", None, None, None, runs_away=why,
                       no_twin=no_twin or _not_asked([log for log, _ in prepared.motions], chosen))
    return Floored(made.floor, "twin", thresholds_of(made, case.families, prepared, given is not None), made, made.drives,
                   twin=twin)


def _not_asked(logs: Sequence[ExperimentLog], chosen: DiagnosisSettings) -> str:
    """Why no twin was tried, in words; empty where no log describes its controller."""
    if not chosen.replicas:
        return "no twin was asked for" if any(log.controlled for log in logs) else ""
    return f"they cannot be replayed under it, {why}" if (why := not_replayable(logs)) else ""


def _calibrated(prepared: Prepared, case: Case, rough: tuple[Explored, ...], chosen: DiagnosisSettings,
                ) -> tuple[Calibration | None, Twin | None]:
    """Thresholds by the twin; None where the logs do not know their controller.

    Raises:
        InputRejected: D15, D17, the fitted arm cannot be simulated.
    """
    places = replayable([log for log, _ in prepared.motions])
    if not places or not chosen.replicas:
        return None, None
    model, twin = _likely(prepared, rough, beside_another(rough, case), chosen, places[0])
    weight = rough[0].before.weight
    weighted = twin.weighted(weight)
    found = Thresholds.of_twin(*weighted, case.families, model.nominal, replicas=twin.replicas)
    made = Calibration(
        origin_of("twin", [prepared.motions[place][0] for place in places], model.nominal, chosen), conditions_of(prepared), weight,
        twin.rms, twin.noise.white, bounds_of(case.families, found.gain, found.own), found.wide,
        floors_of(twin.data, twin.fits[0].left) if chosen.evidence else (),
        following(*weighted).max(axis=1), twin.noise.wander)
    return made, twin


def _likely(prepared: Prepared, rough: tuple[Explored, ...], others: Iterator[Explored], chosen: DiagnosisSettings, place: int,
            ) -> tuple[Exact, Twin]:
    """The twin of the arm beside the greatest causes; where that cannot be simulated, or leaves far more than the log itself does,
    which no floor is above, of the arm beside fewer of them, and the least of these twins where all do.

    Where none of these can be simulated, a cause that is not among them may have bent the numbers, friction say that changes its
    sign far more abruptly than the machine's: then the arm beside the first of `others` that can be.

    Raises:
        InputRejected: D15, D17, none of these arms can be simulated.
    """
    usual = np.maximum(rough[0].before.rms, 1e-300)
    made: list[tuple[float, Exact, Twin]] = []
    refusals: list[InputRejected] = []

    def beside() -> Iterator[tuple[Refined, Array]]:
        """Models, and the residual (rows,) [N m] in which noise is measured."""
        cleanest = clean(rough[-1])
        yield from ((done, cleanest) for done in dict.fromkeys(one.before for one in reversed(rough)))
        while not made and (other := next(others, None)) is not None:
            yield other.before, clean(other)

    for done, left in beside():
        try:
            noise = drive_noise(done.model, prepared.data, left, prepared.motions, prepared.recipe, place, chosen.seed)
            twin = make_twin(done.model, done.weight, prepared.data, prepared.motions, prepared.recipe, noise, chosen.replicas,
                             chosen.seed)
        except InputRejected as refused:
            refusals.append(refused)
            continue
        made.append((float(np.max(twin.rms / usual)), done.model, twin))
        if made[-1][0] <= _UNLIKELY:
            break
    if not made:
        raise refusals[0]
    _, model, least = min(made, key=lambda one: one[0])
    return model, least
