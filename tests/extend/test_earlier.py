"""A model that was accepted is not lost to the next extension: what that one does not make anew is named, to be kept."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pipelines import extend

COGGING = {"cause": "cogging", "joint": 2}
TILT = {"cause": "gravity_tilt", "joint": None}


def extension(*accepted: dict[str, Any], refused: tuple[str, ...] = ()) -> extend.Extension:
    """One that accepted some causes, and was asked for others as well."""
    bare: dict[str, Any] = {field.name: None for field in fields(extend.Extension)}
    asked = (*(f"{one['cause']}:{one['joint']}" for one in accepted), *refused)
    found = tuple(SimpleNamespace(**one) for one in accepted)
    return extend.Extension(**(bare | {"causes": asked, "findings": found, "model": object() if accepted else None}))


def left(folder: Path, *accepted: dict[str, Any]) -> Path:
    """What an earlier extension has left that accepted some causes, and was asked for a spring as well."""
    (folder / "result.json").write_text(json.dumps({"causes": ["cogging:2", "spring:2"], "findings": accepted}))
    (folder / "model.json").write_text("{}")
    return folder


@pytest.mark.parametrize(("now", "kept"), [
    (extension(refused=("spring:2",)), True), (extension(refused=("cogging:2",)), True),
    (extension({"cause": "spring", "joint": 2}), True),
    (extension({"cause": "cogging", "joint": 1}), True), (extension(COGGING, TILT), True),
    (extension(COGGING), False), (extension(COGGING, refused=("spring:2",)), False)])
def test_what_is_not_made_anew_is_named(now: extend.Extension, kept: bool, tmp_path: Path) -> None:
    """Other causes, more, or none accepted; the same ones, accepted again, replace the model as every command replaces its output,
    whatever else was asked for in vain."""
    assert extend.STAGE.spare(now, left(tmp_path, COGGING)) == (("cogging:2",) if kept else ())


def test_a_model_is_kept_from_one_that_has_less_of_what_was_asked_for(tmp_path: Path) -> None:
    """Both were accepted; asked for again with other settings, one of them was not: the model with both is kept."""
    now = extension(COGGING, refused=("gravity_tilt",))
    assert extend.STAGE.spare(now, left(tmp_path, COGGING, TILT)) == ("cogging:2", "gravity_tilt")


def test_where_no_model_was_nothing_is_named(tmp_path: Path) -> None:
    """A refused extension, a folder without a result, and one whose result nobody can read."""
    (left(tmp_path) / "model.json").unlink()
    assert extend.STAGE.spare(extension(), tmp_path) == ()
    assert extend.STAGE.spare(extension(), tmp_path / "nowhere") == ()
    (left(tmp_path) / "result.json").write_text('{"findings": 3}')
    assert extend.STAGE.spare(extension(), tmp_path) == ()
