"""`design-excitation --discriminate`: causes that look alike in a plain design can be told in this one, within the same limits."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines import design_excitation
from pipelines.errors import UsageError
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


@pytest.mark.parametrize(("causes", "more", "words"), [
    (("spring:2",), {}, "two causes"), (("spring:2", "cogs:2"), {}, "cogging"),
    (("spring:2", "torque_offset:2"), {"experiment": "friction"}, "excitation"),
    (("spring:2", "spring:2"), {}, "spring:2 and spring:2 are one cause")])
def test_what_cannot_be_told_apart_is_refused(causes: tuple[str, ...], more: dict[str, object], words: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refused:
        designed(tmp_path / "out", *causes, **more)
    assert words in str(refused.value)
