"""What shows in held-out logs alone is looked for in them, and named where nothing else is left."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.hidden_effects.cases import SealedCase, campaign
from benchmarks.hidden_effects.sessions import record_case
from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.model.diagnosis import diagnose as asking
from pipelines.model.diagnosis import extend as extending
from pipelines.model.diagnosis.asked.fitted_too import at_floor, fitted_too, of_those_held_out, only_held_out, share_held_out
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.result import ResidualRms
from pipelines.model.diagnosis.screened.wanted import Wanted
from pipelines.model.effects.torque_saturation import TorqueSaturation

FLOOR, OWN = np.array([0.1, 0.2]), np.array([0.05, 0.25])  # [N m] of the fitted logs, of those held out
FITTED, JUDGING = (SimpleNamespace(name=name, n_samples=1000, sample_time=0.001) for name in ("fitted", "judging"))
LOGS = Logs((FITTED,), (JUDGING,))  # type: ignore[arg-type]


@pytest.mark.parametrize(("fitted", "held", "alone"), [(1.3, 2.6, True), (1.5, 2.6, False), (1.3, 2.4, False)])
def test_it_shows_in_held_out_logs_alone_where_the_fitted_ones_are_at_their_floor(fitted: float, held: float, alone: bool) -> None:
    assert only_held_out(np.array([1.0, fitted]) * FLOOR, FLOOR, np.array([1.0, held]) * OWN, OWN) is alone


def test_the_logs_that_show_it_come_first_and_none_judges() -> None:
    whole = fitted_too(LOGS)
    assert (whole.identify, whole.validate) == ((JUDGING, FITTED), ())
    assert at_floor(1.3 * FLOOR, FLOOR)
    assert not at_floor(np.array([1.0, 1.31]) * FLOOR, FLOOR)


def rms(fitted: Array, held: Array) -> ResidualRms:
    return ResidualRms(fitted, held, FLOOR)


def found(verdict: str, before: ResidualRms, after: Array, **others: Any) -> Any:
    """A diagnosis, or an extension: a dataclass, for it is told anew by what it was judged."""
    return asking.Diagnosis(verdict, "", (), (), (), (), (), before, "what is wrong",  # type: ignore[arg-type]
                            others.get("held_out", "logs"), others.get("origin", "twin"), "", rms(FLOOR, after), (), (), (), 0,
                            FLOOR, OWN)


@pytest.mark.parametrize(("left", "verdict", "named"), [
    (np.array([0.12, 0.3]), "cause", True),  # down to the larger of its floors
    (np.array([0.12, 0.4]), "cause", False), (np.array([0.14, 0.2]), "cause", False), (np.array([0.12, 0.3]), "unknown", False)])
def test_a_name_is_given_where_nothing_is_left_by_the_floors_of_before(left: Array, verdict: str, named: bool,
                                                                       monkeypatch: pytest.MonkeyPatch) -> None:
    """A twin of logs that show a fault may be as loud as that, and everything in order beside it."""
    asked: list[Logs] = []
    pooled = np.sqrt(0.5 * FLOOR**2 + 0.5 * left**2)  # of the fitted log, and as long a one that shows it

    def answer(logs: Logs, *_: Any) -> Any:
        asked.append(logs)
        return found(verdict, rms(3.0 * FLOOR, 3.0 * OWN), pooled, held_out="blocks") if len(asked) > 1 else found(
            "unknown", rms(FLOOR, 4.0 * OWN), 4.0 * OWN)

    monkeypatch.setattr(asking, "_asked", answer)
    told = asking.diagnose(LOGS)
    assert [logs.identify for logs in asked] == [(FITTED,), (JUDGING, FITTED)]
    assert (told.verdict, told.held_out) == (("cause", "blocks of all logs") if named else ("unknown", "logs"))


def test_many_logs_in_order_do_not_hide_the_rest_of_one_that_is_not() -> None:
    """Nine at their floor and one at 2.6 times it, pooled, are at 1.26 times."""
    pooled = np.sqrt(0.9 * FLOOR**2 + 0.1 * (2.6 * FLOOR)**2)
    assert at_floor(pooled, FLOOR)
    np.testing.assert_allclose(of_those_held_out(pooled, FLOOR, 0.1), 2.6 * FLOOR)
    assert (of_those_held_out(0.9 * FLOOR, FLOOR, 0.1) <= 0.9 * FLOOR + 1e-12).all()
    long: Any = SimpleNamespace(n_samples=9000, sample_time=0.001)
    assert share_held_out(Logs((long,), (JUDGING,))) == pytest.approx(0.1)  # type: ignore[arg-type]


def test_an_answer_outlasts_a_second_question_that_cannot_be_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(logs: Logs, *_: Any) -> Any:
        if not logs.validate:
            raise InputRejected("T08", "too few equations are left")
        return found("unknown", rms(FLOOR, 4.0 * OWN), 4.0 * OWN)

    monkeypatch.setattr(asking, "_asked", answer)
    assert asking.diagnose(LOGS).verdict == "unknown"


def extension(before: ResidualRms, after: Array, accepted: bool, reason: str = "it takes nothing off the held-out error") -> Any:
    rejected = () if accepted else (SimpleNamespace(reason=reason),)
    return extending.Extended(SimpleNamespace() if accepted else None, (), rejected, None, before,  # type: ignore[arg-type]
                              rms(FLOOR, after), "blocks" if accepted else "logs", (), (), 0)


@pytest.mark.parametrize(("reason", "held", "left", "taken"), [
    ("it takes nothing off the held-out error", 4.0, 1.2, True), ("it takes nothing off the held-out error", 4.0, 1.5, False),
    ("it takes nothing off the held-out error", 2.0, 1.2, False), ("logs do not agree on its size: 0.1 of it", 4.0, 1.2, False)])
def test_an_extension_is_asked_again_where_the_fitted_logs_show_nothing_of_it(reason: str, held: float, left: float, taken: bool,
                                                                              monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(logs: Logs, *_: Any) -> Any:
        if logs.validate:
            return extension(rms(FLOOR, held * FLOOR), held * FLOOR, False, reason)
        return extension(rms(FLOOR, FLOOR), np.sqrt(0.5 + 0.5 * left**2) * FLOOR, True)

    monkeypatch.setattr(extending, "_by_curves", answer)
    told = extending.extend(LOGS, ())
    assert (told.arm is not None, told.held_out) == ((True, "blocks of all logs") if taken else (False, "logs"))


@pytest.mark.parametrize(("verdict", "fitted", "held", "origin"), [
    ("nothing-wrong", FLOOR, 4.0 * OWN, "twin"), ("unknown", 2.0 * FLOOR, 4.0 * OWN, "twin"), ("unknown", FLOOR, 2.0 * OWN, "twin"),
    ("unknown", FLOOR, 4.0 * OWN, "reference logs")])
def test_nobody_asks_again_where_the_fitted_logs_show_it_or_others_tell(verdict: str, fitted: Array, held: Array, origin: str,
                                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Logs] = []

    def answer(logs: Logs, *_: Any) -> Any:
        asked.append(logs)
        return found(verdict, rms(fitted, held), held, origin=origin)

    monkeypatch.setattr(asking, "_asked", answer)
    assert asking.diagnose(LOGS).verdict == verdict
    assert len(asked) == 1


def clipping() -> SealedCase:
    """Of the campaign of seed 33: a drive of joint 1 that clips at 25.2 N m, which one of two held-out logs asks for and none of
    those that are fitted."""
    return next(one for one in campaign(33, ("compliance",)) if one.key == "98f0545b59")


@pytest.mark.slow
def test_a_drive_that_clips_in_a_held_out_log_alone_is_named_and_extended_by() -> None:
    logs = Logs.by_role(record_case(clipping()).logs)
    chosen = DiagnosisSettings(evidence=False, limits=False)
    told = asking.diagnose(logs, chosen)
    assert [(one.cause, one.joint) for one in told.findings] == [("torque_saturation", 1)]
    assert told.held_out == "blocks of all logs"
    limit = told.findings[0].parameters["limit"]
    assert limit.std is not None
    assert abs(limit.value - 25.204) < 3.0 * limit.std  # type: ignore[operator]
    unnamed = asking.diagnose(logs, DiagnosisSettings(evidence=False, limits=False, without=("torque_saturation",)))
    assert (unnamed.verdict, unnamed.held_out) == ("unknown", "logs")
    found = extending.extend(logs, (Wanted(TorqueSaturation(1)),), chosen)
    assert [(one.cause, one.joint) for one in found.findings] == [("torque_saturation", 1)]
    assert found.held_out == "blocks of all logs"
