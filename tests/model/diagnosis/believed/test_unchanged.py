"""How much of what a search finds the reference logs have is asked once, and ends the search where it is all of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.believed.unchanged import Before
from pipelines.model.diagnosis.reference.stood import Share
from pipelines.model.diagnosis.searched.case import Case


def three_effects(asked: list[int], stood: float) -> tuple[Any, Any, SimpleNamespace]:
    """A model with an event, a law and a scale of torque, and a case that says how much of the law there was."""
    contact, stribeck, gain = (SimpleNamespace(needs=needs, name=name, joint=2) for name, needs in (
        ("contact", ()), ("stribeck", ()), ("torque_gain", ("known",))))
    effects = (SimpleNamespace(log=1, effect=contact), SimpleNamespace(log=None, effect=gain, possible=True),
               SimpleNamespace(log=None, effect=stribeck, possible=True))

    def before(_: Any, place: int) -> Share:
        asked.append(place)
        return Share(stood, stood, 0.01)

    data: Any = None
    case = Case(data, None, data, np.ones(3), (), None, before=before)
    return SimpleNamespace(model=SimpleNamespace(effects=effects)), case, stribeck


def test_an_event_is_never_asked() -> None:
    """Nor what no standing set may have: a scale of torque explains itself. The others once, however often it is wanted."""
    asked = list[int]()
    done, case, stribeck = three_effects(asked, 1.0)
    before = Before(case)
    assert before.ended(done)
    assert (before.stood(done), asked) == ([stribeck], [2])
    as_steady_rows_have_it: Any = SimpleNamespace(model=done.model)
    told = before.told(done).before
    assert told is not None
    assert (told(as_steady_rows_have_it, 2).stood, asked) == (True, [2])
    assert (told(as_steady_rows_have_it, 1).stood, asked) == (True, [2, 1])


def test_what_has_changed_ends_no_search() -> None:
    asked = list[int]()
    done, case, _ = three_effects(asked, 0.1)
    before = Before(case)
    assert not before.ended(done)
    assert (before.stood(done), asked) == ([], [2])


@pytest.mark.parametrize("again", [True, False])
def test_without_reference_logs_or_another_search_nothing_stood(again: bool) -> None:
    asked = list[int]()
    done, case, _ = three_effects(asked, 1.0)
    before = Before(replace(case, before=None) if again else case, again)
    assert not before.ended(done)
    assert (before.stood(done), asked) == ([], [])


def test_another_model_is_asked_for_itself() -> None:
    """What was told of one with other effects in its places says nothing of it."""
    asked = list[int]()
    done, case, stribeck = three_effects(asked, 1.0)
    told = Before(case).told(done).before
    other: Any = SimpleNamespace(model=SimpleNamespace(effects=(SimpleNamespace(effect=stribeck),)))
    assert told is not None
    assert (told(other, 0).stood, told(other, 0).stood, asked) == (True, True, [0, 0])
