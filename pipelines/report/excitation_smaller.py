"""By how much a designed motion was made smaller after its search, and for which limits."""

from __future__ import annotations

from pipelines.model.excitation.result import Result
from pipelines.report.style import format_number

__all__ = ["much_smaller", "smaller_words"]

_SHOWN = 5e-5  # of its size: less than that nobody sees
_MUCH = 0.01  # of its size: that belongs into the verdict


def much_smaller(result: Result) -> bool:
    """Return whether it was made smaller by more than a limit between two samples asks for."""
    return result.shrunk < 1.0 - _MUCH


def smaller_words(result: Result) -> str:
    """Empty where it is as large as the search left it."""
    less = 1.0 - result.shrunk
    if less < _SHOWN:
        return ""
    why = f", to keep within its limits ({', '.join(result.shrunk_for)})" if result.shrunk_for else ""
    return f"the motion was made {format_number(100.0 * less, 2)} % smaller than the search left it{why}"
