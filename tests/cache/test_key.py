"""A key is another exactly where something that goes in is another, and the words name just that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pipelines.cache import changes, code_of, digest_of_json, read_sources

KEY: dict[str, dict[str, Any]] = {
    "log": {"a.h5": "1", "b.h5": "2"}, "arrangement": {"the logs are in another order": ["a.h5", "b.h5"]},
    "unusable file": {"cut.h5": "3"}, "file": {"model.json": "8"}, "setting": {"low": 4.0, "model": None},
    "option": {"joints": []}, "code": {"frf": "abc", "model.frf.fit": "def"}, "library": {"numpy": "1.26"},
    "stage": {"reconstruct": "4", "estimate-bps": "5"}}

OTHER = {
    "low was 4.0, is 5.0": {"setting": {"low": 5.0, "model": None}},
    "b.h5 has other content": {"log": {"a.h5": "1", "b.h5": "9"}},
    "log gone: a.h5": {"log": {"b.h5": "2"}},
    "the logs are in another order": {"arrangement": {"the logs are in another order": ["b.h5", "a.h5"]}},
    "code of model.frf.fit": {"code": {"frf": "abc", "model.frf.fit": "fed"}},
    'numpy "1.26" is now "2.0"': {"library": {"numpy": "2.0"}},
    "reconstruct before it changed": {"stage": {"reconstruct": "7", "estimate-bps": "5"}},
    "model.json has other content": {"file": {"model.json": "0"}},
}


@pytest.mark.parametrize("words", OTHER)
def test_what_changed_is_said(words: str) -> None:
    """Each part by itself: another digest, and one sentence that names it."""
    other = KEY | OTHER[words]
    assert digest_of_json(other) != digest_of_json(KEY)
    assert changes(KEY, other) == words


def test_a_stage_consists_of_what_it_imports() -> None:
    """frf: its module, what that imports and the packages around; every effect, which are found by name; no drawing."""
    sources = read_sources()
    code = code_of("pipelines.frf", sources, "pipelines.report")
    for module in ("pipelines", "pipelines.frf", "pipelines.stage", "pipelines.frequency.result", "pipelines.frequency.rational",
                   "pipelines.effects.angle", "pipelines.io.results"):
        assert module in code, module
    assert not [name for name in code if name.startswith("pipelines.report")]
    assert not {"pipelines.validate_writing", "pipelines.run", "pipelines.diagnosis.selection"} & set(code)
    assert "pipelines.report.frf_report" in code_of("pipelines.frf", sources)


def test_a_table_is_part_of_its_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The words of causes stand in a table: with other words a stored diagnosis is another."""
    package = tmp_path / "pipelines" / "effects"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "cogging.py").write_text("")
    monkeypatch.setattr("pipelines.__file__", str(package.parent / "__init__.py"))
    codes = []
    for words in ("title = 'Cogging'", "title = 'Ripple'"):
        (package / "causes.toml").write_text(words)
        codes.append(code_of("pipelines.effects.cogging", read_sources()))
    assert codes[0].keys() == codes[1].keys() == {"pipelines.effects", "pipelines.effects.cogging"}
    assert codes[0] != codes[1]
