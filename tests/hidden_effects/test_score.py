"""A fair judge: what is true counts, what is not does not, and a judge that cannot say no is none."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from scipy.stats import binomtest

from benchmarks.hidden_effects.cases import FAMILIES, Hidden, SealedCase, campaign
from benchmarks.hidden_effects.judge import judge, scores_in, tasks
from benchmarks.hidden_effects.make import Sealed
from benchmarks.hidden_effects.score import score
from benchmarks.hidden_effects.table import Row, confusion, rows, table, wilson
from benchmarks.hidden_effects.verdict import read_verdict
from pipelines.errors import InputRejected
from tests.hidden_effects.answers import (
    FLOOR,
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


def test_a_coupling_has_two_joints() -> None:
    """Motor of joints 2 and 3: either may be called the joint, if the other is called the partner."""
    truth = case("transmission_coupling", 3)
    assert judged(truth, answer(finding("transmission_coupling", 3, {"with_joint": 2}))).right
    assert judged(truth, answer(finding("transmission_coupling", 2, {"with_joint": 3}))).right
    assert not judged(truth, answer(finding("transmission_coupling", 2, {"with_joint": 1}))).right


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


def test_what_nobody_can_see_is_not_testable() -> None:
    """With a reason, and no guess."""
    truth = case("payload", None, "invisible")
    assert judged(truth, answer(not_identifiable={"payload": "absorbed by p3"})).right
    assert not judged(truth, answer(not_identifiable={"payload": ""})).right
    assert not judged(truth, answer(not_identifiable={"spring": "absorbed"})).right
    assert not judged(truth, answer(finding("link_length", None), not_identifiable={"payload": "absorbed by p3"})).right


def test_a_payload_is_weighed_within_three_percent() -> None:
    truth = case("payload", None, "payload")
    for share, right in ((1.02, True), (1.04, False)):
        mass = {"mass": share * truth.findings[0]["parameters"]["mass"]}
        assert judged(truth, answer(finding("payload", None, mass, std=1.0))).right == right


def test_a_pair_is_both() -> None:
    truth = sealed(SealedCase("pairs", (Hidden("cogging", 1, 1.0, 4), Hidden("spring", 3, 0.3, 4)), 5, 4))
    both = judged(truth, answer(finding("spring", 3), finding("stribeck", 1), finding("cogging", 1)))
    assert (both.right, both.wrong) == (True, 1)
    assert not judged(truth, answer(finding("spring", 3))).right


def test_of_the_compliant_ones_the_kind_counts() -> None:
    """The joint has a row of its own."""
    one = judged(case("joint_elasticity", 1, "compliance"), answer(finding("joint_elasticity", 2)))
    assert (one.right, one.joint, one.wrong) == (True, False, 1)


@pytest.mark.parametrize(("without", "said", "right"), [
    (("cogging",), answer(verdict="unknown"), True), (("cogging",), answer(finding("payload", None)), False),
    (("cogging",), answer(), False),
])
def test_a_cause_taken_out(without: tuple[str, ...], said: dict[str, Any], right: bool) -> None:
    """Unknown; that nothing were wrong is not true."""
    assert judged(case("cogging"), said, without=without).right == right


@pytest.mark.parametrize(("factor", "std", "agrees"),
                         [(1.04, 0.0, True), (1.06, 0.0, False), (1.06, 0.01, True), (-1.0, 0.0, False)])
def test_an_offset_agrees_within_five_percent_or_three_std(factor: float, std: float, agrees: bool) -> None:
    """0.28 N m: 6 % are 17 mN m, less than three standard deviations of 10."""
    truth = case("torque_offset")
    (_, ok), = judged(truth, answer(finding("torque_offset", 2, {"offset": factor * truth.findings[0]["parameters"]["offset"]},
                                            std=std))).parameters
    assert ok == agrees


def test_a_sine_may_have_its_sign_in_the_phase() -> None:
    """A sin(kq + φ) = -A sin(kq + φ + π), and full turns do not count."""
    truth = case("cogging")
    true = truth.findings[0]["parameters"]
    turned = {"order": true["order"], "amplitude": -true["amplitude"], "phase": true["phase"] + 3.0 * math.pi}
    one = judged(truth, answer(finding("cogging", 2, turned)))
    assert [ok for _, ok in one.parameters] == [True, True]
    assert one.angles == (("cogging phase", True),)
    half = judged(truth, answer(finding("cogging", 2, turned | {"amplitude": true["amplitude"]})))
    assert half.angles == (("cogging phase", False),)


def test_the_residual_is_held_against_the_floor() -> None:
    assert judged(case("spring"), answer(finding("spring", 2, after=1.2 * FLOOR))).residual == pytest.approx(1.2)


@pytest.mark.parametrize(("count", "of"), [(0, 20), (19, 20), (57, 60), (1, 100)])
def test_wilsons_interval(count: int, of: int) -> None:
    """As scipy has it."""
    expected = binomtest(count, of).proportion_ci(0.95, "wilson")
    assert wilson(count, of) == pytest.approx((expected.low, expected.high), abs=1e-4)


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


def test_who_always_says_the_same_is_found_out(cases: Path, tmp_path: Path) -> None:
    found = measured(cases, always(answer(finding("cogging", 2))), tmp_path / "kept.jsonl")
    for title in ("right cause, at full and 0.3 strength", "joint right among the named", "healthy arms: alarms",
                  "wrong name, over everything (but the rows with a bar of their own)"):
        assert not found[title].met, title


def test_no_case_is_judged_twice(cases: Path, tmp_path: Path) -> None:
    kept = tmp_path / "kept.jsonl"
    first = list(judge(cases, kept, tasks(cases, ("healthy",)), always(answer())))
    assert len(first) == 12
    assert list(judge(cases, kept, tasks(cases, ("healthy",)), always(answer()))) == []


def test_who_refuses_or_breaks_is_counted(cases: Path, tmp_path: Path) -> None:
    """And is not right, whatever the case."""
    def refuse(folder: Path, without: tuple[str, ...]) -> dict[str, Any]:
        raise InputRejected("D05", "no") if folder.name < "8" else ZeroDivisionError

    scores = list(judge(cases, tmp_path / "kept.jsonl", tasks(cases, ("healthy", "zero")), refuse))
    assert {one.verdict for one in scores} == {"refused", "crashed"}
    assert not any(one.right for one in scores)


def test_the_confusion_matrix_counts_every_case_once(cases: Path, tmp_path: Path) -> None:
    kept = tmp_path / "kept.jsonl"
    scores = list(judge(cases, kept, tasks(cases), oracle(cases)))
    counted = sum(int(cell) for line in confusion(scores).splitlines()[2:] for cell in line.split("|")[2:-1] if cell.strip())
    assert counted == sum(one.family in ("single", "compliance", "outside", "healthy", "payload") for one in scores)
    assert table(scores).count("| what | bar |") == 1
