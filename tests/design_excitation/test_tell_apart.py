"""`design-excitation --discriminate`: causes that look alike in a plain design can be told in this one, within the same limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines import design_excitation
from pipelines.errors import UsageError
from pipelines.io.files import open_log
from pipelines.io.log import ExperimentLog
from pipelines.stage import Outcome, Request, run_stage

Result = design_excitation.Result


def designed(out: Path, *causes: str, **more: object) -> Outcome[Result]:
    settings = design_excitation.Settings(robot="rrr", harmonics=(8,), discriminate=causes,
                                          **{"evaluations": 300, **more})  # type: ignore[arg-type]
    return run_stage(design_excitation.STAGE, Request((), out=out, no_report=True), settings)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outcome[Result]]:
    """A plain design, and one that tells a spring at joint 2 from a torque offset there."""
    out = tmp_path_factory.mktemp("apart")
    return {"plain": designed(out / "plain"), "apart": designed(out / "apart", "spring:2", "torque_offset:2")}


def trajectory(outcome: Outcome[Result]) -> ExperimentLog:
    return open_log(outcome.folder / "trajectory.h5").log


def test_the_two_look_less_alike(both: dict[str, Outcome[Result]]) -> None:
    found = both["apart"].result.apart
    assert found is not None
    assert found.causes == ("spring:2", "torque_offset:2")
    assert found.after.similarity < 0.95 * found.before.similarity
    assert both["plain"].result.apart is None
    assert "spring at joint 2 and torque offset at joint 2 look alike by" in both["apart"].report.verdict


def test_what_shows_in_no_motion_is_named_before_the_search(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rotor inertia at joint 1 of this arm is a part of its base parameters, however it moves."""
    monkeypatch.setattr(design_excitation, "best", None)
    with pytest.raises(UsageError, match=": rotor_inertia:1 shows in no motion") as told:
        designed(tmp_path / "out", "spring:2", "rotor_inertia:1")
    assert "'What these logs cannot tell'" in told.value.remedy  # the section's name, not the field's
    assert told.value.code == "RRID-C02"
    assert not (tmp_path / "out").exists()


def test_limits_and_ceiling_are_kept(both: dict[str, Outcome[Result]]) -> None:
    """As in any design: a condition number of 3 where that was reached, and no limit broken."""
    result = both["apart"].result
    assert result.condition_number is not None
    assert result.condition_number <= 3.0 * (1.0 + 1e-6)
    assert result.reached
    assert all(one.share <= 1.0 for one in result.limits)


def test_a_seed_and_a_number_of_evaluations_give_it_again(both: dict[str, Outcome[Result]], tmp_path: Path) -> None:
    again = designed(tmp_path / "again", "spring:2", "torque_offset:2")
    np.testing.assert_array_equal(trajectory(again)["q_ref"], trajectory(both["apart"])["q_ref"])


@pytest.mark.parametrize(("causes", "more", "words"), [
    (("spring:2",), {}, "two causes"), (("spring:2", "cogs:2"), {}, "cogging"), (("spring:2", "torque_offset:7"), {}, "1 to 3"),
    (("spring:2", "torque_offset:2"), {"experiment": "hold"}, "excitation"),
    (("spring:2", "torque_offset:2"), {"rest": False}, "at rest"),
    (("spring:2", "rotor_inertia:1"), {}, "no motion"),
    (("spring:2", "spring:2"), {}, "spring:2 and spring:2 are one cause"),
    (("cogging:2:order=7", "cogging:2"), {}, "one is the other with a number given")])
def test_what_cannot_be_told_apart_is_refused(causes: tuple[str, ...], more: dict[str, object], words: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refused:
        designed(tmp_path / "out", *causes, **more)
    assert words in str(refused.value)


@pytest.mark.slow
def test_a_plan_that_tells_apart_and_a_plain_one_lie_beside_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither takes the default folder of the other, in whichever order they are made."""
    monkeypatch.chdir(tmp_path)
    folders = []
    for causes in ((), ("spring:2", "torque_offset:2"), ("spring:2", "cogging:2:order=7")):
        settings = design_excitation.Settings(robot="rrr", harmonics=(8,), evaluations=2, discriminate=causes)
        folders.append(run_stage(design_excitation.STAGE, Request((), no_report=True), settings).folder)
    assert [str(one) for one in folders[:2]] == ["runs/rrr-tue/excitation/design-excitation",
                                                 "runs/rrr-tue/excitation-spring-2-torque_offset-2/design-excitation"]
    assert len(set(folders)) == 3
    assert all((one / "trajectory.h5").is_file() for one in folders)
