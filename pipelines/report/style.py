"""Format figures and numbers: colours for colour-blind readers, significant digits.

Colours: Okabe and Ito 2008, "Color Universal Design". Text in figures is drawn as outlines of the
font that matplotlib ships, so a figure looks the same on every screen and printer and no name in it
can be read as mark-up.
"""

from __future__ import annotations

import logging
import math
import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pipelines.errors import clean

if TYPE_CHECKING:
    from matplotlib.axis import Axis

STYLE_FILE: Final = Path(__file__).parent / "templates" / "report.mplstyle"
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
BLACK: Final = "#1a1f24"
GREY: Final = "#5b6670"
BLUE: Final = "#0072b2"
VERMILLION: Final = "#d55e00"
GREEN: Final = "#009e73"
ORANGE: Final = "#e69f00"
SKY: Final = "#56b4e9"
PURPLE: Final = "#cc79a7"
COLOURS: Final = (BLUE, VERMILLION, GREEN, ORANGE, SKY, PURPLE)  # in the order of their contrast


def printable(text: object, limit: int = 400) -> str:
    """Return `text` as a line that any file, browser and font can show.

    Names from a damaged file may hold halves of surrogate pairs, which UTF-8 cannot write.
    """
    return clean(str(text).encode("utf-8", "replace").decode("utf-8"), limit)


def format_unit(unit: str) -> str:
    """A unit as people read it: "rad/s^4" becomes "rad/s⁴"."""
    return re.sub(r"\^(-?[0-9]+)", lambda power: power[1].translate(_RAISED), printable(unit, 40))


def unit_in_words(unit: str) -> str:
    """A unit behind a number in a sentence: "per rev" for "1/rev", nothing for a pure number."""
    return "" if unit == "1" else f"per {unit[2:]}" if unit.startswith("1/") else format_unit(unit)


def enumerated(words: Iterable[str], word: str = "and") -> str:
    """ "a, b and c"."""
    *first, last = list(words) or [""]
    return f"{', '.join(first)} {word} {last}" if first else last


def format_number(value: float | None, digits: int = 4) -> str:
    """`value` with `digits` significant digits; a dash for none."""
    if value is None or math.isnan(value):
        return "–"
    if item := getattr(value, "item", None):  # NumPy's integers are no int
        value = item()
    if isinstance(value, bool):
        return "yes" if value else "no"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if isinstance(value, int):
        return _grouped(f"{value:d}")
    mantissa, exponent = _split(float(value), digits)
    if value != 0.0 and not -3 <= exponent <= 5:
        return f"{_trimmed(mantissa)} × 10{_raised(exponent)}"
    return _grouped(_trimmed(f"{float(value):.{max(0, digits - 1 - exponent)}f}"))


def format_decimals(value: float, decimals: int) -> str:
    """`value` with that many decimals, each of them its own: 28.974, not 28.97 and a zero."""
    return _grouped(f"{float(value):.{decimals}f}")


def with_std(value: float | None, std: float | None) -> str:
    """Value and deviation to one decimal place, the deviation with two digits: "1.930 ± 0.020"."""
    if value is None or std is None or not math.isfinite(value) or math.isnan(std) or std == 0.0:
        return format_number(value)
    if math.isinf(std):
        return f"{format_number(value)} ± ∞"
    last = _split(std, 2)[1] - 1  # decimal place of the deviation's second digit
    first = max(_split(value, 17)[1] if value else last + 1, last + 1)
    if first - last > 9 or abs(first) > 300:  # both to one place: a row of zeros, or not a number
        return f"{format_number(value, 10)} ± {format_number(std, 2)}"
    if -3 <= first <= 5:
        decimals = max(0, -last)
        return " ± ".join(_grouped(f"{round(x, -last):.{decimals}f}") for x in (value, std))
    both = " ± ".join(_grouped(f"{x / 10.0**first:.{first - last}f}") for x in (value, std))
    return f"({both}) × 10{_raised(first)}"


def _split(value: float, digits: int) -> tuple[str, int]:
    mantissa, exponent = f"{value:.{max(1, digits) - 1}e}".split("e")
    return mantissa.replace("-", "−"), int(exponent)


def _trimmed(number: str) -> str:
    return number.rstrip("0").rstrip(".") if "." in number else number


def _grouped(number: str) -> str:
    """A true minus, and thin spaces between thousands from 10 000 on."""
    whole, point, rest = number.partition(".")
    sign, whole = ("−", whole[1:]) if whole.startswith("-") else ("", whole)
    if sign and not (whole + rest).strip("0"):
        sign = ""
    if len(whole) > 4:
        whole = f"{int(whole):,}".replace(",", "\u202f")
    return sign + whole + point + rest


def _raised(exponent: int) -> str:
    return str(exponent).translate(_RAISED)


def log_ticks(axis: Axis) -> None:
    """Label a logarithmic axis in plain text; between powers of ten where few are in view."""
    from matplotlib.ticker import LogFormatter

    axis.set_major_formatter(LogFormatter())
    axis.set_minor_formatter(LogFormatter(minor_thresholds=(2.0, 0.7)))


@contextmanager
def figure_style(salt: str) -> Iterator[None]:
    """Draw in the report's style, independent of the user's matplotlib settings.

    Args:
        salt: makes the identifiers in the SVG of one figure differ from those of the next, and
            equal on every run.
    """
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # where it may not write, say
    import matplotlib

    with matplotlib.rc_context(), warnings.catch_warnings():
        # A glyph the font lacks, a panel too narrow for its labels: the reader sees it.
        warnings.simplefilter("ignore", UserWarning)
        matplotlib.rcdefaults()
        own = matplotlib.rc_params_from_file(STYLE_FILE, use_default_template=False)
        matplotlib.rcParams.update(own)
        matplotlib.rcParams["svg.hashsalt"] = salt
        yield
