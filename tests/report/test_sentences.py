"""Templates say what a report says: text of a log stays text, a statement ends where its line does, and every macro is used."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pipelines.report
from pipelines.report import document
from pipelines.report.document import sentence

FOLDER = Path(pipelines.report.__file__).parent
TEMPLATES = sorted((FOLDER / "templates").glob("*.jinja"))


def test_text_from_a_log_is_no_template_and_keeps_its_signs() -> None:
    said = sentence("cause", "{{ 7 * 7 }} % if", "\n## at joint 2", "", None)
    assert said == "{{ 7 * 7 }} % if ## at joint 2"


def test_text_from_a_log_opens_no_section(monkeypatch: pytest.MonkeyPatch) -> None:
    source = "# {{ name }}\n\nA {{ name }}.\n\n## One\n\nSaid {{ name }}.\n% do table('a')\n% do row(name)\n"
    monkeypatch.setattr(document, "_read", lambda name: source)
    name = "x\n\n## Two\n\n> check \x1d\x1e\x1c#"
    report = document.document("made-up", name=name)
    assert (report.title, report.verdict, report.advice) == ("x ## Two > check #", "A x ## Two > check #.", ())
    assert [(one.title, one.text) for one in report.sections] == [("One", ("Said x ## Two > check #.",))]


def test_what_has_no_content_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    source = "# T\n\nV.\n\n## Empty\n\n% do table('a')\n\n### Folded\n\n! Care.\n\n% if false\nNo.\n% endif\n"
    monkeypatch.setattr(document, "_read", lambda name: source)
    (only,) = document.document("made-up-2").sections
    assert (only.title, only.folded, only.warning, only.text, only.tables) == ("Folded", True, "Care.", (), ())


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: path.stem)
def test_every_macro_is_used(path: Path) -> None:
    text = path.read_text("utf-8")
    texts = [text, *(one.read_text("utf-8") for one in FOLDER.glob("*.py"))]
    names = re.findall(r"^% macro (\w+)", text, flags=re.MULTILINE)
    unused = [n for n in names if not any(re.search(rf"sentence\(\s*\"{n}\"|(?<!macro )\b{n}\(", one) for one in texts)]
    assert unused == []
