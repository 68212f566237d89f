"""A key is another exactly where something that goes in is another, and the words name just that."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pipelines.recall.code import code_of
from pipelines.recall.key import Key, changes

KEY = Key("frf", {"low": 4.0, "model": None}, {"a.h5": "1" * 64, "b.h5": "2" * 64}, ("hold (identify, measured)",),
          {"cut.h5": "3" * 64}, {"joints": []}, {"pipelines.frf": "abc", "pipelines.model.frf.fit": "def"}, {"numpy": "1.26"},
          "log 1", {"reconstruct": "4" * 64}, {"estimate-bps": "5" * 64}, {"model.json": "8" * 64})

OTHER = {
    "low was 4.0, is 5.0": replace(KEY, settings={"low": 5.0, "model": None}),
    'model was unset, is "x.json"': replace(KEY, settings={"low": 4.0, "model": "x.json"}),
    "b.h5 has other content": replace(KEY, logs={"a.h5": "1" * 64, "b.h5": "9" * 64}),
    "new log c.h5": replace(KEY, logs={**KEY.logs, "c.h5": "6" * 64}),
    "log gone: a.h5": replace(KEY, logs={"b.h5": "2" * 64}),
    "the logs are in another order": replace(KEY, logs={"b.h5": "2" * 64, "a.h5": "1" * 64}),
    "there are other logs beside those it reads": replace(KEY, others=()),
    "unusable file gone: cut.h5": replace(KEY, unusable={}),
    "joints was [], is [1, 2]": replace(KEY, options={"joints": [1, 2]}),
    "code of model.frf.fit": replace(KEY, code={"pipelines.frf": "abc", "pipelines.model.frf.fit": "fed"}),
    "numpy 1.26 is now 2.0": replace(KEY, libraries={"numpy": "2.0"}),
    "format log 1 is now log 2": replace(KEY, schema="log 2"),
    "reconstruct before it changed": replace(KEY, through={"reconstruct": "7" * 64}),
    "estimate-bps before it changed": replace(KEY, upon={}),
    "model.json has other content": replace(KEY, beside={"model.json": "0" * 64}),
}


@pytest.mark.parametrize("words", OTHER)
def test_what_changed_is_said(words: str) -> None:
    """Each part by itself: another digest, and one sentence that names it."""
    assert OTHER[words].digest != KEY.digest
    assert changes(KEY.parts, OTHER[words]) == words


def test_the_same_is_the_same() -> None:
    """The order of settings, code and libraries is nothing; there is nothing to say."""
    same = replace(KEY, settings=dict(reversed(KEY.settings.items())), code=dict(reversed(KEY.code.items())))
    assert same.digest == KEY.digest
    assert changes(KEY.parts, same) == ""


def test_treatment_knows_no_log() -> None:
    """What is done to a log does not depend on the logs beside it, but on settings and code."""
    assert replace(KEY, logs={}, others=(), unusable={}, upon={}).treatment == KEY.treatment
    assert replace(KEY, settings={"low": 5.0, "model": None}).treatment != KEY.treatment


def test_a_stage_consists_of_what_it_imports() -> None:
    """frf: its module, what that imports and the packages around; every effect, which are found by name; no drawing."""
    code = code_of("pipelines.frf", ("pipelines.report",))
    for module in ("pipelines", "pipelines.frf", "pipelines.stage", "pipelines.model.frf.result", "pipelines.fit.rational_search",
                   "pipelines.model.effects.cogging", "pipelines.io.results"):
        assert module in code, module
    assert not [name for name in code if name.startswith("pipelines.report")]
    assert not {"pipelines.validate_writing", "pipelines.run", "pipelines.diagnosis.selection"} & set(code)
    assert "pipelines.report.frf_report" in code_of("pipelines.frf")


def test_no_import_is_overlooked() -> None:
    """Whatever of ours a stage has loaded when it has been imported is among its code."""
    import subprocess
    import sys

    program = ("import sys, json, pipelines.diagnose\n"
               "print(json.dumps([m for m in sys.modules if m == 'pipelines' or m.startswith('pipelines.')]))")
    repo = Path(__file__).resolve().parents[2]
    done = subprocess.run([sys.executable, "-c", program], cwd=repo, capture_output=True, text=True, check=True)
    import json

    assert set(json.loads(done.stdout)) <= set(code_of("pipelines.diagnose"))
