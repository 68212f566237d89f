"""Who looks for something in the diagnosis finds it on the map of its folder, and nothing else there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from pipelines.model import diagnosis

TOP = Path(diagnosis.__file__).parent
FOLDERS = {path.parent.relative_to(TOP).as_posix(): path for path in sorted(TOP.rglob("__init__.py"))}


def _entries(docstring: str) -> list[str]:
    """What the lines of a map are about: names, and two spaces or more before what is said of them."""
    return [name for line in docstring.splitlines() if (entry := re.match(r"(?: {4})?(\w+(?:, \w+)*)  ", line))
            for name in entry[1].split(", ")]


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_module_stands_on_the_map_and_none_that_is_not_there(folder: str) -> None:
    """Each once: the modules of a folder on its own map, the folders and what lies beside them on that of the whole."""
    there = {path.stem for path in FOLDERS[folder].parent.glob("*.py")} - {"__init__"}
    there |= {path.parent.name for path in FOLDERS[folder].parent.glob("*/__init__.py")}
    text = ast.get_docstring(ast.parse(FOLDERS[folder].read_text(encoding="utf-8")), clean=False) or ""
    assert sorted(_entries(text)) == sorted(there)
    elsewhere = re.findall(r"`(?!pipelines\b)(\w+)\.(\w+)`", text)
    assert [name for name in elsewhere if not (TOP / name[0] / f"{name[1]}.py").is_file()] == []


def test_a_map_is_read_line_by_line() -> None:
    """Of each entry the names, not what is said of them, nor what is said before and after."""
    lines = ("What it is.", "", "    one         the first", "    two, three  the", "                second", "", "four or more")
    assert _entries("\n".join(lines)) == ["one", "two", "three"]
