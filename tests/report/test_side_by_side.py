"""Figures drawn in two processes are those drawn in one."""

from __future__ import annotations

import os
import time

import pytest

from pipelines.log import shared_work
from pipelines.report.report import Figure
from pipelines.report.side_by_side import Picture, drawn

FIGURES = {f"figure-{k}": Figure(f"figure-{k}", lambda drawing: None, "") for k in range(9)}


@pytest.fixture(autouse=True)
def two_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_work, "processors", lambda: 2)
    monkeypatch.setattr("multiprocessing.parent_process", lambda: None)


def by_process(figure: Figure, name: str) -> Picture:
    time.sleep(0.03)
    return f"{name} ä by {os.getpid()}", bytes(range(256)) * len(name)


def test_many_figures_come_from_two_processes() -> None:
    found = drawn(FIGURES, by_process)
    assert list(found) == list(FIGURES)
    assert len({svg.partition(" by ")[2] for svg, _ in found.values()}) == 2
    assert all(svg.startswith(name) and png == bytes(range(256)) * len(name) for name, (svg, png) in found.items())


def test_few_figures_are_drawn_here() -> None:
    few = dict(list(FIGURES.items())[:4])
    assert {svg.partition(" by ")[2] for svg, _ in drawn(few, by_process).values()} == {str(os.getpid())}
