"""Sentences come out of their templates as one line a paragraph, and no template holds one that nothing says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pipelines.report
from pipelines.report.sentences import sentence, template

FOLDER = Path(pipelines.report.__file__).parent
STAGES = sorted(path.stem for path in (FOLDER / "templates").glob("*.jinja"))


def test_text_from_a_log_is_no_template_and_keeps_its_signs() -> None:
    said = sentence("friction", "curve", "{{ 7 * 7 }} % if", None, "N m", False)
    assert said.startswith("{{ 7 * 7 }} % if: the fitted law")


@pytest.mark.parametrize("stage", STAGES)
def test_every_sentence_is_said_somewhere(stage: str) -> None:
    macros = {name for name in dir(template(f"{stage}.jinja").module) if not name.startswith("_")}
    texts = [path.read_text("utf-8") for path in (*FOLDER.glob("*.py"), FOLDER.parent / "export/card.py", FOLDER / "templates" / f"{stage}.jinja")]
    unused = [name for name in macros if not any(re.search(rf"['\"]{name}['\"]|(?<!macro )\b{name}[(\[]", text) for text in texts)]
    assert unused == []
