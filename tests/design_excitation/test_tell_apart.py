"""`design-excitation --discriminate`: causes that look alike in a plain design can be told in this one, within the same limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import design_excitation
from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import UsageError
from pipelines.io.files import open_log
from pipelines.io.log import Array, ExperimentLog
from pipelines.report.excitation_report import excitation_report
from pipelines.stage import Outcome, Request, run_stage

Result = design_excitation.Result
NOISE = 0.05  # [N m] rms


def designed(out: Path, *causes: str, **more: object) -> Outcome[Result]:
    settings = design_excitation.Settings(robot="rrr", harmonics=(8,), discriminate=causes,
                                          **{"evaluations": 300, "rehearse": False, **more})  # type: ignore[arg-type]
    return run_stage(design_excitation.STAGE, Request((), out=out, no_report=True), settings)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outcome[Result]]:
    """A plain design, and one that tells a spring at joint 2 from a torque offset there."""
    out = tmp_path_factory.mktemp("apart")
    return {"plain": designed(out / "plain"), "apart": designed(out / "apart", "spring:2", "torque_offset:2")}


def trajectory(outcome: Outcome[Result]) -> ExperimentLog:
    return open_log(outcome.folder / "trajectory.h5").log


def missed(log: ExperimentLog) -> float:
    """What an offset at joint 2 leaves of the torque of a spring there, fitted with base parameters and friction, in N m rms: by
    NumPy's least squares, apart from everything that made the design."""
    q, dq, ddq = log["q_ref"], log["dq_ref"], log["ddq_ref"]
    regressor = rigid_body(log.robot).regressor(q, dq, ddq)
    own = np.zeros((len(q), 3, 7))
    for j in range(3):
        own[:, j, 2 * j], own[:, j, 2 * j + 1] = np.tanh(200.0 * dq[:, j]), dq[:, j]
    own[:, 1, 6] = 1.0
    table: Array = np.concatenate([regressor, own], axis=2).reshape(3 * len(q), -1)
    spring = np.zeros((len(q), 3))
    spring[:, 1] = 2.5 * 0.7 * q[:, 1]  # full strength of causes.md
    table = table / np.maximum(np.linalg.norm(table, axis=0), 1e-12)
    left = spring.ravel() - table @ np.linalg.lstsq(table, spring.ravel(), rcond=1e-10)[0]
    return float(np.sqrt(np.mean(left.reshape(-1, 3)[:, 1] ** 2)))


def test_the_two_look_less_alike(both: dict[str, Outcome[Result]]) -> None:
    found = both["apart"].result.apart
    assert found is not None
    assert found.causes == ("spring:2", "torque_offset:2")
    assert found.after.similarity < 0.95 * found.before.similarity
    assert both["plain"].result.apart is None
    assert "spring at joint 2 and torque offset at joint 2 look alike by" in both["apart"].report.verdict


@pytest.mark.parametrize(("similarity", "shown", "tone"), [
    (0.81, "0.81", "attention"), (0.8004, "0.8004", "attention"), (0.797, "0.797", "good"), (0.004, "0.004", "good")])
def test_a_design_that_leaves_rivals_is_not_called_good(both: dict[str, Outcome[Result]], similarity: float, shown: str,
                                                        tone: str) -> None:
    """What diagnose would still call alternatives was not told apart; rounding puts no figure on the other side of 0.8."""
    result = both["apart"].result
    assert result.apart is not None
    apart = replace(result.apart, after=replace(result.apart.after, similarity=similarity))
    report = excitation_report(replace(result, apart=apart))
    assert report.tone == tone
    assert f"look alike by {shown} " in report.verdict
    assert ("still call them alternatives" in report.verdict) == (tone == "attention")


def test_a_robot_that_nobody_named_is_said_with_the_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The shipped one where no robot.toml is here; nothing of the kind for one that was named."""
    monkeypatch.chdir(tmp_path)
    for robot, said in ((None, True), ("rrr", False)):
        settings = design_excitation.Settings(robot=robot, experiment="hold", rehearse=False)
        report = run_stage(design_excitation.STAGE, Request((), out=tmp_path / f"{robot}", no_report=True), settings).report
        assert ("no robot.toml is here: the shipped rrr" in " ".join(report.basis)) == said


def test_what_one_leaves_of_the_other_stands_above_the_noise(both: dict[str, Outcome[Result]]) -> None:
    """More of it than in the plain design, and a multiple of what ten seconds of noise make of a torque."""
    assert missed(trajectory(both["apart"])) > missed(trajectory(both["plain"]))
    assert missed(trajectory(both["apart"])) > 3.0 * NOISE


@pytest.mark.parametrize(("shrunk", "verdict", "limits"), [(1.0, False, False), (0.9987, False, True), (0.792, True, True)])
def test_how_much_smaller_a_motion_was_made_is_said(both: dict[str, Outcome[Result]], shrunk: float, verdict: bool,
                                                    limits: bool) -> None:
    """By how much, and for which limit: beside the limits wherever it was; in the verdict where it is more than a trifle."""
    result = replace(both["apart"].result, shrunk=shrunk, shrunk_for=("torque of joint 2",) if limits else ())
    report = excitation_report(result)
    (section,) = [one for one in report.sections if one.title == "Limits"]
    words = "smaller than the search left it, to keep within its limits (torque of joint 2)"
    assert (words in report.verdict) == verdict
    assert (words in " ".join(section.text)) == limits


def test_a_plain_design_that_was_kept_is_called_so(both: dict[str, Outcome[Result]]) -> None:
    result = both["apart"].result
    assert result.apart is not None
    kept = replace(result, apart=replace(result.apart, after=result.apart.before, changed=False))
    report = excitation_report(kept)
    assert "this is the design for the parameters alone" in report.verdict
    (section,) = [one for one in report.sections if one.title.startswith("Telling")]
    assert [row[0] for row in section.tables[0].rows] == ["this design"]


def test_a_wave_is_told_from_a_spring(tmp_path: Path) -> None:
    """Of a wave of no given order gravity has the first one: that one nobody has found, and the others can be told."""
    found = designed(tmp_path / "out", "spring:2", "cogging:2", evaluations=20).result.apart
    assert found is not None
    assert min(found.after.identifiability) > 0.01
    assert 0.0 < found.after.similarity < 1.0


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


def test_equal_causes_are_refused_before_the_search(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One wave is not another: only what is the same, or holds the same, is refused."""
    monkeypatch.setattr(design_excitation, "refuse_hidden", lambda *given: pytest.fail("was not refused at once"))
    with pytest.raises(UsageError) as refused:
        designed(tmp_path / "out", "spring:2", "spring:2")
    assert refused.value.code == "RRID-C02"
    monkeypatch.undo()
    assert designed(tmp_path / "waves", "cogging:2:order=7", "cogging:2:order=12", evaluations=2).result.apart is not None


@pytest.mark.slow
def test_a_plan_that_tells_apart_and_a_plain_one_lie_beside_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither takes the default folder of the other, in whichever order they are made."""
    monkeypatch.chdir(tmp_path)
    folders = []
    for causes in ((), ("spring:2", "torque_offset:2"), ("spring:2", "cogging:2:order=7")):
        settings = design_excitation.Settings(robot="rrr", harmonics=(8,), evaluations=2, rehearse=False, discriminate=causes)
        folders.append(run_stage(design_excitation.STAGE, Request((), no_report=True), settings).folder)
    assert [str(one) for one in folders[:2]] == ["runs/rrr-tue/excitation/design-excitation",
                                                 "runs/rrr-tue/excitation-spring-2-torque_offset-2/design-excitation"]
    assert len(set(folders)) == 3
    assert all((one / "trajectory.h5").is_file() for one in folders)


def test_a_log_names_the_robot_that_it_is_of(both: dict[str, Outcome[Result]], tmp_path: Path) -> None:
    """What was imported is described nowhere else."""
    plan = both["plain"].folder / "trajectory.h5"
    settings = design_excitation.Settings(robot=str(plan), experiment="hold", rehearse=False)
    found = run_stage(design_excitation.STAGE, Request((), out=tmp_path / "out", no_report=True), settings)
    log = open_log(next((found.folder / "logs").glob("*.h5"))).log
    assert log.robot == open_log(plan).log.robot
