"""A spring seen over a few degrees: five powers of the angle go anywhere beyond them, and a straight line goes on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.screened.screen import screen
from pipelines.model.diagnosis.searched.case import Case, HeldOut
from pipelines.model.diagnosis.searched.hypotheses import _refitted, fitted
from pipelines.model.effects import all_effects
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden

STIFFNESS, REST = 0.6, 3.2  # [N m/rad], [rad]
SEEN = 1.2  # [s] of the fitted logs, in which joint 3 turns by a radian to both sides of the rest
CATCH = 0.3  # [N m]


def pulled(motion: Motion) -> Array:
    out = np.zeros_like(motion.q)
    out[:, 2] = STIFFNESS * (motion.q[:, 2] - REST)
    return out


def caught(motion: Motion) -> Array:
    """The same, and what a cable that catches adds while it is fitted: Legendre's third polynomial, of which no line has a part."""
    x = motion.q[:, 2] - REST
    out = pulled(motion)
    out[:, 2] += CATCH * np.where(np.abs(x) < 1.1, 2.5 * x**3 - 1.5 * x, 0.0)
    return out


def begun(log: ExperimentLog) -> ExperimentLog:
    """The first moments of it."""
    n = round(SEEN / log.sample_time)
    signals = {name: replace(one, values=one.values[:n]) for name, one in log.signals.items()}
    return replace(log, signals=signals)


def test_a_spring_that_held_out_angles_bear_out_as_a_line_alone() -> None:
    prepared = prepare(Logs((begun(hidden(1, caught)), begun(hidden(2, caught))), (hidden(3, pulled, "validate"),)),
                       DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    others = tuple(kind.name for kind in all_effects() if kind.name != "spring")
    every = families(columns.laws, whole_motion(prepared.data), model.arm, others)
    case = Case(prepared.data, prepared.judge, model, fit.weight, every, None)
    now = refine(case.model, case.data, case.weight)
    seen = next(one for one in screen(case.data, now.fit, every, case.arms(now.model)) if one.joint == 3)
    error = HeldOut.of(now, case)
    whole = _refitted(case, now, seen, seen.shape[0].full(), error)
    found = fitted(case, now, seen, error)
    values = found.done.model.effects[-1].values
    assert whole.error > 1.0
    assert found.error < 0.5
    assert values["hardening"] == 0.0
    assert abs(values["stiffness"] - STIFFNESS) < 0.3
    assert abs(values["rest_angle"] - REST) < 0.2
