"""Sentences come out of their templates as one line a paragraph, and no template holds one that nothing says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pipelines.report
from pipelines.report.sentences import as_sentence, paragraphs, sentence, template

FOLDER = Path(pipelines.report.__file__).parent
STAGES = sorted(path.stem for path in (FOLDER / "templates").glob("*.jinja"))


def test_a_blank_line_of_the_template_ends_a_paragraph() -> None:
    assert len(paragraphs("simulation", "log", type("Log", (), {"simulation": "closed-loop", "law": "", "replicas": 1, "steps": 2,
                                                               "units": ("rad",)}), None, 1e-3)) == 2


def test_text_from_a_log_is_no_template_and_keeps_its_signs() -> None:
    said = sentence("friction", "curve", "{{ 7 * 7 }} % if", None, "N m", False, False)
    assert said.startswith("{{ 7 * 7 }} % if: the fitted law")


@pytest.mark.parametrize(("text", "said"), [("a word", "A word."), ("Done!", "Done!"), ("", "")])
def test_a_sentence_begins_large_and_ends_in_a_stop(text: str, said: str) -> None:
    assert as_sentence(text) == said


@pytest.mark.parametrize("stage", STAGES)
def test_every_sentence_is_said_somewhere(stage: str) -> None:
    macros = {name for name in dir(template(f"{stage}.jinja").module) if not name.startswith("_")}
    texts = [path.read_text("utf-8") for path in (*FOLDER.glob("*.py"), FOLDER.parent / "export/card.py", FOLDER / "templates" / f"{stage}.jinja")]
    unused = [name for name in macros if not any(re.search(rf"['\"]{name}['\"]|(?<!macro )\b{name}[(\[]", text) for text in texts)]
    assert unused == []


@pytest.mark.parametrize("stage", STAGES)
def test_no_line_of_a_template_is_much_wider_than_the_code(stage: str) -> None:
    text = (FOLDER / "templates" / f"{stage}.jinja").read_text("utf-8")
    assert [line for line in text.splitlines() if len(line) > 110] == []
