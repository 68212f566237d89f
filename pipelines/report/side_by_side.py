"""Draw many figures in two processes: half of the time of a long report is theirs.

    pictures = drawn({"friction": figure, ...}, draw)       the same bytes as one after the other
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from pipelines.log.shared_work import shared_out
from pipelines.report.report import Figure
from pipelines.report.style import prepare_matplotlib

__all__ = ["Picture", "drawn"]

Picture = tuple[str, bytes]  # SVG and PNG

_MANY = 8  # figures, from which on a second process is worth its start


def drawn(figures: Mapping[str, Figure], draw: Callable[[Figure, str], Picture]) -> dict[str, Picture]:
    """Each figure's picture by its name; `draw` is given the figure and the name."""
    def one(name: str) -> Picture:
        return draw(figures[name], name)

    if len(figures) < _MANY:
        return {name: one(name) for name in figures}
    _load()  # once, before there are two
    return dict(zip(figures, shared_out(one, list(figures)), strict=True))


def _load() -> None:
    """Import what draws, which takes as long as two figures."""
    prepare_matplotlib()
    import matplotlib.backends.backend_agg
    import matplotlib.backends.backend_svg
    import matplotlib.figure  # noqa: F401
