"""Draw how figures moved from one item of a batch to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pipelines.report import style
from pipelines.report.figures import Array, Look, Mask, joint_axes
from pipelines.report.report import Figure
from pipelines.report.style import format_unit, printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_NAMED = 8  # numerics: items whose names have room below the axis
_LETTERS = 14  # numerics: of a name there


@dataclass(frozen=True)
class Panel:
    """One figure through the items."""

    name: str
    unit: str
    value: Array
    std: Array | None
    moved: Mask  # beyond the limit
    before: tuple[float, float] | None = None  # value and std of the baseline


def drift_figure(name: str, caption: str, panels: Sequence[Panel], items: Sequence[str]) -> Figure:
    """One row a panel over the items, which are those of every panel."""

    def draw(figure: Drawing) -> None:
        rows = joint_axes(figure, len(panels))
        for axes, panel in zip(rows, panels, strict=True):
            _draw_panel(axes, panel)
        _name_items(rows[-1], items)

    return Figure(name, caption, draw, size=(6.0, 0.7 + 1.15 * len(panels)))


def _draw_panel(axes: Axes, panel: Panel) -> None:
    item = np.arange(1, len(panel.value) + 1)
    if panel.before is not None:
        value, std = panel.before
        axes.axhspan(value - std, value + std, color=style.GREY, alpha=0.2, linewidth=0.0)
        axes.axhline(value, color=style.GREY, linewidth=0.8)
    axes.plot(item, panel.value, color=style.BLUE, linewidth=0.6, alpha=0.5)
    for wanted, colour in ((~panel.moved, style.BLUE), (panel.moved, style.VERMILLION)):
        if np.any(wanted):
            bars = None if panel.std is None else panel.std[wanted]
            look: Look = {"markersize": 3.0, "color": colour, "linewidth": 0.9}
            axes.errorbar(item[wanted], panel.value[wanted], bars, fmt="o", **look)
    axes.set_title(printable(panel.name, 60), pad=3.0)
    axes.set_ylabel("" if panel.unit in ("1", "") else format_unit(panel.unit))


def _name_items(axes: Axes, items: Sequence[str]) -> None:
    """Names below the axis where there is room for them, numbers else."""
    if len(items) <= _NAMED:
        short = [n if len(n) <= _LETTERS else f"…{n[-_LETTERS + 1 :]}" for n in items]
        axes.set_xticks(np.arange(1, len(items) + 1), [printable(name, 40) for name in short])
        axes.tick_params(axis="x", labelrotation=20)
    else:
        axes.set_xlabel("item, in the order of recording")
    axes.set_xlim(0.5, len(items) + 0.5)
