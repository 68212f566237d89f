"""Who looks for something in the folder of the diagnosis finds it on its map, and nothing else there."""

from __future__ import annotations

import re
from pathlib import Path

from pipelines.model import diagnosis


def test_every_module_stands_on_the_map_and_none_that_is_not_there() -> None:
    folder = Path(diagnosis.__file__).parent
    there = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    text, entries = str(diagnosis.__doc__), str(diagnosis.__doc__).partition("in that order:")[2]
    missing = sorted(name for name in there if not re.search(rf"\b{name}\b", text))
    assert not missing, f"not on the map: {missing}"
    gone = set(re.findall(r"\b[a-z]+(?:_[a-z]+)+\b", entries)) - there
    assert not gone, f"on the map, but not in the folder: {sorted(gone)}"
