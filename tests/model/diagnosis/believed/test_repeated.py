"""A step that did harm in one log when it was found, and does none beside what was found after it, is believed."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from pipelines.model.diagnosis.believed import repeated
from tests.model.diagnosis.believed.test_pruned import effect, left, searched


@pytest.mark.parametrize(("beside", "odd"), [("", False), ("worse in free-1", True)])
def test_what_did_harm_in_a_log_when_it_was_found_is_asked_again_beside_what_was_found_after_it(
        beside: str, odd: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second cause stood in the residual when the first was found, and one held-out log had more of it than the others."""
    found = searched(left(0.5, 0.5, 0.01), (effect("spring", 1), left(0.4, 0.5, 0.01)),
                     (effect("spring", 2), left(0.01, 0.01, 0.01)))
    for step in found.steps:
        step.best.log = None
    monkeypatch.setattr(repeated, "all_but", lambda *args: left(0.05, 0.01, 0.01))
    monkeypatch.setattr(repeated, "unlike", lambda before, after, *args: beside if after is found.final else "worse in free-1")
    case = SimpleNamespace(blocks=10)
    assert bool(repeated.at_odds(found, 0, SimpleNamespace(), case)) is odd
    assert repeated.at_odds(found, 1, SimpleNamespace(), case) == "worse in free-1"  # nothing was found after it
