"""A fair judge: what is true counts, what is not does not, and a judge that cannot say no is none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.hidden_effects.cases import FAMILIES, Hidden, SealedCase, campaign
from benchmarks.hidden_effects.judge import judge, scores_in, tasks
from benchmarks.hidden_effects.make import Sealed
from benchmarks.hidden_effects.score import score
from benchmarks.hidden_effects.table import Row, rows
from benchmarks.hidden_effects.verdict import read_verdict
from tests.hidden_effects.answers import (
    Engine,
    always,
    answer,
    finding,
    oracle,
    sealed,
    written,
)


def case(cause: str, joint: int | None = 2, family: str = "single", strength: float = 1.0) -> Sealed:
    return sealed(SealedCase(family, (Hidden(cause, joint, strength, 4),), 5, 4))


def judged(truth: Sealed, said: dict[str, Any], **others: Any) -> Any:
    return score(truth, read_verdict(said), **others)


@pytest.mark.parametrize(("said", "right", "wrong"), [
    (answer(finding("cogging", 2)), True, 0),
    (answer(finding("cogging", 1)), False, 1),  # the joint belongs to the name
    (answer(finding("spring", 2)), False, 1),
    (answer(finding("cogging", 2), finding("spring", 2)), True, 1),
    (answer(finding("spring", 2), finding("cogging", 2)), False, 1),  # the strongest comes first
    (answer(verdict="unknown"), False, 0),
    (answer(), False, 0),
])
def test_a_single_cause(said: dict[str, Any], right: bool, wrong: int) -> None:
    one = judged(case("cogging"), said)
    assert (one.right, one.wrong) == (right, wrong)


@pytest.mark.parametrize(("family", "said", "right"), [
    ("paper", answer(), True), ("paper", answer(finding("stribeck", 1)), False), ("healthy", answer(), True),
    ("healthy", answer(verdict="unknown"), False), ("healthy", answer(finding("spring", 1)), False),
    ("uncentred", answer(), False), ("uncentred", answer(verdict="unknown"), True),
    ("uncentred", answer(finding("time_delay", 1)), True),
])
def test_a_healthy_arm(family: str, said: dict[str, Any], right: bool) -> None:
    assert judged(sealed(SealedCase(family, (), 5, 4)), said).right == right


def test_what_no_candidate_describes_is_unknown() -> None:
    truth = case("sticking_seal", family="outside")
    assert judged(truth, answer(verdict="unknown")).right
    assert not judged(truth, answer()).right
    assert judged(truth, answer(finding("presliding", 2))).wrong == 1


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Some of every family, answers only."""
    out: Path = tmp_path_factory.mktemp("cases")
    return written(out, [case for name in FAMILIES for case in campaign(3, (name,))[:12]])


def measured(out: Path, engine: Engine, kept: Path) -> dict[str, Row]:
    for taken_out in (False, True):
        list(judge(out, kept, tasks(out, taken_out=taken_out), engine))
    return {row.title: row for row in rows(scores_in(out, kept))}


def test_who_knows_the_answers_meets_every_bar(cases: Path, tmp_path: Path) -> None:
    found = measured(cases, oracle(cases), tmp_path / "kept.jsonl")
    assert [title for title, row in found.items() if row.met is False] == []
    assert sum(row.met is True for row in found.values()) >= 20


def test_who_is_silent_misses_every_cause(cases: Path, tmp_path: Path) -> None:
    """And raises no false alarm."""
    found = measured(cases, always(answer()), tmp_path / "kept.jsonl")
    assert not found["right cause, at full and 0.3 strength"].met
    assert not found["outside the library: \"unknown\""].met
    assert not found["able to fail, torque not centred: a healthy arm is flagged"].met
    assert found["healthy arms: alarms"].met
