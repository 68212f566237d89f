"""A model that was accepted is not lost to the next extension: what that one does not make anew is named, to be kept."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from pipelines import extend


@pytest.mark.parametrize(("causes", "accepted", "named"), [
    (("spring:2",), False, "cogging-2"), (("spring:2",), True, "cogging-2"), (("cogging:2",), False, "cogging-2"),
    (("cogging:2",), True, "")])
def test_what_is_not_made_anew_is_named(causes: tuple[str, ...], accepted: bool, named: str, tmp_path: Path) -> None:
    """Other causes, or none accepted; the same ones, accepted again, replace the model as every command replaces its output."""
    (tmp_path / "result.json").write_text(json.dumps({"causes": ["cogging:2"]}))
    (tmp_path / "model.json").write_text("{}")
    bare: dict[str, Any] = {field.name: None for field in fields(extend.Extension)}
    result = extend.Extension(**(bare | {"causes": causes, "model": object() if accepted else None}))
    assert extend.STAGE.spare(result, tmp_path) == named
    (tmp_path / "model.json").unlink()
    assert extend.STAGE.spare(result, tmp_path) == ""
    assert extend.STAGE.spare(result, tmp_path / "nowhere") == ""
