"""The twin that a floor is taken from is one of an arm that could be this one; on made-up numbers."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.model.diagnosis.given import floored


@dataclass(frozen=True, eq=False)
class Model:
    """What is looked at of a fitted one."""

    model: str
    rms: np.ndarray
    weight: np.ndarray


def explored(name: str, rms: float = 0.1) -> Any:
    """A model beside some causes, and what it leaves of the log at one joint [N m]."""
    return SimpleNamespace(before=Model(name, np.array([rms]), np.ones(1)))


@pytest.mark.parametrize(("twins", "taken", "tried"), [
    ({"nominal": 0.09, "beside": 0.05}, "beside", ["beside"]),
    ({"nominal": 0.09, "beside": 0.8}, "nominal", ["beside", "nominal"]),  # a friction that hunts in simulation, and not on the arm
    ({"nominal": 0.9, "beside": 0.8}, "beside", ["beside", "nominal"]),  # the lesser of two
    ({"nominal": 0.09, "beside": None}, "nominal", ["beside", "nominal"])])  # it runs away
def test_no_floor_stands_above_what_the_log_shows(twins: dict[str, float | None], taken: str, tried: list[str],
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    """The arm beside the greatest causes comes first, for it has the least of the fault in its numbers."""
    asked: list[str] = []

    def made(model: str, *_: Any) -> Any:
        asked.append(model)
        if (left := twins[model]) is None:
            raise InputRejected("D17", "the simulated arm runs away", where="log", remedy="record more")
        return SimpleNamespace(rms=np.array([left]))

    monkeypatch.setattr(floored, "make_twin", made)
    monkeypatch.setattr(floored, "drive_noise", lambda *_: None)
    monkeypatch.setattr(floored, "clean", lambda _: None)
    data: Any = SimpleNamespace(data=None, motions=None, recipe=None)
    chosen: Any = SimpleNamespace(replicas=1, seed=1)
    model, twin = floored._likely(data, (explored("nominal"), explored("beside", 0.01)), iter(()), chosen, 0)
    assert (model, float(twin.rms[0]), asked) == (taken, twins[taken], tried)


def test_an_arm_that_nobody_can_simulate_has_no_twin(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any) -> Any:
        raise InputRejected("D17", "the simulated arm runs away", where="log", remedy="record more")

    monkeypatch.setattr(floored, "drive_noise", refused)
    monkeypatch.setattr(floored, "clean", lambda _: None)
    data: Any = SimpleNamespace(data=None, motions=None, recipe=None)
    with pytest.raises(InputRejected, match="runs away"):
        floored._likely(data, (explored("nominal"), explored("beside")), iter(()), SimpleNamespace(replicas=1, seed=1),  # type: ignore[arg-type]
                        0)


@pytest.mark.parametrize(("twins", "taken", "tried"), [
    ({"nominal": None, "beside": None, "spring": 0.05, "offset": 0.04}, "spring", ["beside", "nominal", "spring"]),
    ({"nominal": None, "beside": None, "spring": None, "offset": 0.05}, "offset", ["beside", "nominal", "spring", "offset"]),
    ({"nominal": None, "beside": 0.9, "spring": 0.05, "offset": 0.05}, "beside", ["beside", "nominal"])])
def test_where_no_arm_can_be_simulated_another_cause_is_taken_away(twins: dict[str, float | None], taken: str, tried: list[str],
                                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    """A spring that no rough look took away bends friction until nobody can simulate it: beside the spring the arm can be. Nobody
    asks for it where there is a twin already. Noise is measured in what is left beside it."""
    asked, measured = list[str](), list[str]()

    def noise(model: str, _: Any, left: str, *__: Any) -> None:
        measured.append(left)

    def made(model: str, *_: Any) -> Any:
        asked.append(model)
        if (left := twins[model]) is None:
            raise InputRejected("D17", "with 64 steps a sample the simulation still is 7.7e-05 rad off")
        return SimpleNamespace(rms=np.array([left]))

    monkeypatch.setattr(floored, "make_twin", made)
    monkeypatch.setattr(floored, "drive_noise", noise)
    monkeypatch.setattr(floored, "clean", lambda one: one.before.model)
    data: Any = SimpleNamespace(data=None, motions=None, recipe=None)
    chosen: Any = SimpleNamespace(replicas=1, seed=1)
    others = (explored(name) for name in ("spring", "offset"))
    model, _ = floored._likely(data, (explored("nominal"), explored("beside", 0.01)), others, chosen, 0)
    assert (model, asked) == (taken, tried)
    assert measured == ["beside", "beside", *tried[2:]]
    assert [one.before.model for one in others] == [name for name in ("spring", "offset") if name not in tried]


@pytest.mark.parametrize(("code", "unknown"), [("D17", True), ("D15", False)])
def test_why_there_is_no_twin_is_told(code: str, unknown: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The logs describe their controller: that none is known is not why. Whether it may be a fault is another question."""
    def refused(*_: Any) -> Any:
        raise InputRejected(code, "the simulated arm runs away")

    monkeypatch.setattr(floored, "_calibrated", refused)
    monkeypatch.setattr(floored, "clean", lambda _: None)
    monkeypatch.setattr(floored, "white", lambda *_: np.ones(1))
    some: Any = SimpleNamespace(data=None, motions=(), families=(), replicas=1)
    found = floored.floored_by(some, some, (explored("nominal"),), some, None)
    assert found.no_twin == "the arm as it was fitted cannot be simulated: the simulated arm runs away"
    assert bool(found.runs_away) == unknown


@pytest.mark.parametrize(("replicas", "controlled", "said"), [(0, True, "no twin was asked for"), (0, False, ""), (1, False, "")])
def test_who_asks_for_no_twin_is_told_so(replicas: int, controlled: bool, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(floored, "_calibrated", lambda *_: (None, None))
    monkeypatch.setattr(floored, "clean", lambda _: None)
    monkeypatch.setattr(floored, "white", lambda *_: np.ones(1))
    log = SimpleNamespace(controlled=controlled)
    some: Any = SimpleNamespace(data=None, motions=((log, None),), families=(), replicas=replicas)
    assert floored.floored_by(some, some, (explored("nominal"),), some, None).no_twin == said
