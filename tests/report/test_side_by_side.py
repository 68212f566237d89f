"""Figures drawn in two processes are those drawn in one; what the other process cannot draw is drawn, or fails, here."""

from __future__ import annotations

import os

import pytest

from pipelines.report import side_by_side
from pipelines.report.report import Figure
from pipelines.report.side_by_side import Picture, drawn

FIGURES = {f"figure-{k}": Figure(f"figure-{k}", lambda drawing: None, "") for k in range(9)}


@pytest.fixture(autouse=True)
def two_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "_processors", lambda: 2)
    monkeypatch.setattr("multiprocessing.parent_process", lambda: None)


def by_process(figure: Figure, name: str) -> Picture:
    return f"{name} ä by {os.getpid()}", bytes(range(256)) * len(name)


def test_half_of_many_figures_come_from_another_process() -> None:
    found = drawn(FIGURES, by_process)
    assert list(found) == list(FIGURES)
    assert len({svg.partition(" by ")[2] for svg, _ in found.values()}) == 2
    assert all(svg.startswith(name) and png == bytes(range(256)) * len(name) for name, (svg, png) in found.items())


def test_few_figures_are_drawn_here() -> None:
    few = dict(list(FIGURES.items())[:4])
    assert {svg.partition(" by ")[2] for svg, _ in drawn(few, by_process).values()} == {str(os.getpid())}


def test_what_the_other_process_cannot_draw_is_drawn_here() -> None:
    here = os.getpid()

    def only_here(figure: Figure, name: str) -> Picture:
        if os.getpid() != here:
            os._exit(3)
        return name, b""

    assert drawn(FIGURES, only_here) == {name: (name, b"") for name in FIGURES}


@pytest.mark.parametrize("bad", ["figure-2", "figure-3"])
def test_an_error_is_told_and_no_process_is_left(bad: str, monkeypatch: pytest.MonkeyPatch) -> None:
    started, fork = list[int](), os.fork
    monkeypatch.setattr(os, "fork", lambda: started.append(child := fork()) or child)

    def fails(figure: Figure, name: str) -> Picture:
        if name == bad:
            raise ValueError(name)
        return name, b""

    with pytest.raises(ValueError, match=bad):
        drawn(FIGURES, fails)
    assert started
    for child in started:  # not any child: other tests have theirs
        with pytest.raises(ChildProcessError):
            os.waitpid(child, os.WNOHANG)
