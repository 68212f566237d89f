"""Figures of the last run, drawn again only where the stage, the drawing code or its library is another."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pipelines.io.atomic import write_file
from pipelines.io.files import PROVENANCE, hash_file
from pipelines.io.results import json_text
from pipelines.recall.code import code_of, libraries
from pipelines.recall.key import digest_of_json
from pipelines.recall.store import CACHE
from pipelines.report.report import Report
from pipelines.report.style import STYLE_FILE

__all__ = ["DRAWING", "Pictures", "pictures_of", "with_pictures", "write_drawing"]

DRAWING = "drawing.json"  # in the cache of an output: what its figures were drawn by


@dataclass(frozen=True)
class Pictures:
    """What a run may take out of the figures of the last one: file name -> SHA-256."""

    folder: Path
    known: Mapping[str, str]

    def finished(self, name: str) -> tuple[str, bytes] | None:
        """SVG and PNG of the figure called `name`, where both are there as they were written."""
        found = []
        for file in (f"{name}.svg", f"{name}.png"):
            path = self.folder / file
            if file not in self.known or not path.is_file() or hash_file(path) != self.known[file]:
                return None
            found.append(path.read_bytes())
        return found[0].decode(), found[1]


def drawing(modules: tuple[str, ...]) -> str:
    """All that the look of a figure depends on, its data apart."""
    code = {module: code_of(module) for module in modules}
    return digest_of_json([code, libraries(("matplotlib", "numpy")), hash_file(STYLE_FILE)])


def pictures_of(out: Path, modules: tuple[str, ...]) -> Pictures:
    """The figures of the run in `out`; none where they were drawn by other code."""
    try:
        same = json.loads((out / CACHE / DRAWING).read_text(encoding="utf-8"))["drawing"] == drawing(modules)
        outputs = json.loads((out / PROVENANCE).read_text(encoding="utf-8"))["outputs"] if same else {}
        known = {name.removeprefix("figures/"): str(value) for name, value in outputs.items() if name.startswith("figures/")}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        known = {}
    return Pictures(out / "figures", known)


def with_pictures(report: Report, pictures: Pictures) -> Report:
    """`report` of a stage that was taken back: its figures are those of the last run, where these are in order."""
    return dataclasses.replace(report, sections=tuple(
        dataclasses.replace(section, figures=tuple(dataclasses.replace(f, finished=pictures.finished) for f in section.figures))
        for section in report.sections))


def write_drawing(folder: Path, modules: tuple[str, ...]) -> None:
    """Note in an output what its figures were drawn by."""
    write_file(folder / CACHE / DRAWING, lambda draft: _text(draft, json_text({"drawing": drawing(modules)})))


def _text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
