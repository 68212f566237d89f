"""`rrrid diagnose` on sealed cases: machines, joints, strengths and experiments drawn from the test bench.

Half a dozen short ones, without their detection limits; and as `slow` the whole campaign, some 650 cases of 52 s, whose table it
prints (pytest -s). The same by hand, in parts that can be interrupted: python -m benchmarks.hidden_effects all --out FOLDER
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from benchmarks.hidden_effects.cases import SealedCase, campaign
from benchmarks.hidden_effects.judge import by_command, by_compute, judge, scores_in, tasks
from benchmarks.hidden_effects.make import make_cases
from benchmarks.hidden_effects.score import Score
from benchmarks.hidden_effects.table import rows, table

pytestmark = pytest.mark.slow  # the short dozen takes two minutes, the campaign two hours

SEED = 30
DOZEN = {"single": 2, "healthy": 1, "outside": 1, "payload": 1, "standing": 1}  # cases of each family


def dozen() -> list[SealedCase]:
    """The first ones of each family, at full strength, as shuffled."""
    return [case for name, count in DOZEN.items()
            for case in [one for one in campaign(SEED, (name,), short=True)
                         if all(hidden.strength == 1.0 for hidden in one.hidden)][:count]]


@pytest.fixture(scope="module")
def scores(tmp_path_factory: pytest.TempPathFactory) -> list[Score]:
    out: Path = tmp_path_factory.mktemp("dozen")
    list(make_cases(dozen(), out))
    return list(judge(out, out / "verdicts.jsonl", tasks(out), by_compute))


def test_no_cause_is_named_that_is_not_there(scores: list[Score]) -> None:
    assert [(one.truth, one.named) for one in scores if one.wrong] == []


def test_single_causes_are_named_at_their_joint(scores: list[Score]) -> None:
    single = [one for one in scores if one.family == "single"]
    assert all(one.right for one in single), [(one.truth, one.verdict, one.named) for one in single]


@pytest.mark.parametrize("family", [name for name in DOZEN if name != "single"])
def test_the_others_get_the_answer_that_is_due(family: str, scores: list[Score]) -> None:
    """Nothing wrong, unknown, not testable, or how heavy the payload is."""
    assert [(one.key, one.verdict, one.named) for one in scores if one.family == family and not one.right] == []


@pytest.mark.slow
def test_the_whole_campaign_meets_every_bar(tmp_path: Path) -> None:
    """In the folder RRRID_CASES, where it is given, what has been made and judged is not done again."""
    out = Path(os.environ.get("RRRID_CASES", tmp_path))
    list(make_cases(campaign(), out))
    for taken_out in (False, True):
        list(judge(out, out / "verdicts.jsonl", tasks(out, taken_out=taken_out), by_command))
    scores = scores_in(out, out / "verdicts.jsonl")
    print(table(scores))
    assert [row.title for row in rows(scores) if row.met is False] == []
