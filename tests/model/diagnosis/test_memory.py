"""What a diagnosis has worked out of its logs is not worked out again by the extension; another question is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipelines.model.diagnosis import memory as module
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.given.change_of_sign import loosened
from pipelines.model.diagnosis.memory import Memory
from pipelines.model.effects.coulomb import Coulomb
from tests.model.diagnosis.arms import hidden


@pytest.fixture(name="calls")
def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    calls = list[str]()
    for name in ("prepare", "examined"):
        whole = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, whole=whole, name=name: (calls.append(name), whole(*given))[1])
    return calls


def test_the_same_logs_are_prepared_once(calls: list[str]) -> None:
    known, (one, other) = Memory(), (replace(hidden(seed), period=None) for seed in (1, 2))
    first = known.prepared(Logs((one,), (other,)), DiagnosisSettings(), None)
    assert known.prepared(Logs((one,), (other,)), DiagnosisSettings(replicas=3), None) is first
    assert calls == ["prepare"]
    known.examined(Logs((one,), (other,)), False)
    known.examined(Logs((one,), (other,)), False)
    assert calls == ["prepare", "examined"]


def test_other_roles_other_logs_and_other_settings_are_other_questions(calls: list[str]) -> None:
    known, one, other = Memory(), hidden(1), hidden(2)
    for logs, chosen in ((Logs((one,), (other,)), DiagnosisSettings()), (Logs((one, other)), DiagnosisSettings()),
                         (Logs((one,), (other,)), DiagnosisSettings(cutoff_hz=20.0)),
                         (Logs((replace(one),), (other,)), DiagnosisSettings())):
        known.prepared(logs, chosen, None)
    assert calls == ["prepare"] * 4


def test_the_laws_by_which_a_diagnosis_holds_are_those_of_its_extension(calls: list[str]) -> None:
    """A cause that was found once the curve of friction fitted would be refused beside another curve."""
    known, logs = Memory(), Logs((hidden(1),), (hidden(2),))
    first = known.prepared(logs, DiagnosisSettings(), None)
    known.instead(first, loosened(first))
    again = known.prepared(logs, DiagnosisSettings(), None)
    assert again.data is first.data
    assert {law.free for law in again.columns.laws if isinstance(law, Coulomb)} == {("sharpness", "roundness")}
    assert calls == ["prepare"]
