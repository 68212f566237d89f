"""Name every code in a few words. A code never changes its meaning.

The letters: F container, S structure and units, T time, D samples, C configuration, P process,
X security, Z internal.
"""

from __future__ import annotations

from typing import Final

from pipelines.errors import Check, Level

__all__ = ["CODES", "first_to_read", "title_of"]

_WORST_FIRST: Final[tuple[Level, ...]] = ("reject", "repair", "warn", "ok")

CODES: Final[dict[str, str]] = {
    "C01": "unknown name in a configuration or recipe",
    "C02": "value out of bounds",
    "C03": "not a TOML file",
    "C04": "no such file or shipped name",
    "C05": "output folder is not free",
    "C06": "nothing matched",
    "C07": "not a path",
    "C08": "limits that no motion keeps",
    "D01": "isolated missing samples",
    "D02": "missing channel or block",
    "D03": "infinite, huge or filler values",
    "D04": "constant channel",
    "D05": "torque saturation",
    "D06": "glitches",
    "D07": "encoder wrap or counter rollover",
    "D08": "encoder resolution",
    "D09": "insufficient excitation",
    "D10": "speed never changes sign",
    "D11": "emergency stop or lost reference",
    "D12": "limits exceeded",
    "D13": "low coherence",
    "D14": "same recording fitted and judged by",
    "D15": "not physically consistent",
    "D16": "a held joint moves",
    "D17": "the simulated arm runs away",
    "D18": "torque without its compensation",
    "D19": "the model misses held-out torque",
    "D20": "feed-forward does not help",
    "D26": "friction that changes in time",
    "F01": "empty file",
    "F02": "truncated or damaged file",
    "F03": "not closed, or the reading library failed",
    "F04": "checksum mismatch",
    "F05": "integrity",
    "F06": "not a log",
    "F07": "truncated Parquet",
    "F08": "damaged MAT file",
    "F09": "torn lines in a text file",
    "F10": "missing HDF5 filter",
    "F11": "newer format version",
    "F12": "not a regular file",
    "F13": "permission denied",
    "F14": "file changed meanwhile",
    "F15": "in use by another process",
    "F16": "text file dialect",
    "F17": "result of an earlier version",
    "P02": "disk or file system",
    "P03": "out of memory",
    "P04": "crashed",
    "P05": "out of time",
    "P06": "interrupted",
    "P08": "in use by another run",
    "P10": "stored result changed",
    "S01": "missing signal, column or attribute",
    "S02": "number of joints",
    "S03": "duplicate name",
    "S04": "no units",
    "S05": "unknown or unfit unit",
    "S06": "converted unit",
    "S07": "degrees, or motor side, taken for radians of the joint",
    "S08": "unit of time",
    "S09": "rate and period",
    "S10": "current instead of torque",
    "S11": "orientation of an array",
    "S12": "not real numbers",
    "S13": "columns mixed up",
    "S14": "sign of torque",
    "S15": "gear ratio or encoder scale",
    "S16": "reference of another run",
    "S17": "malformed URDF",
    "S18": "malformed model file",
    "S19": "not in the format",
    "S20": "attribute of a wrong kind or value",
    "S21": "two logs of one name",
    "S22": "controller not described",
    "S23": "torque without gravity",
    "S24": "gravity in another direction",
    "S25": "torque without sign",
    "T01": "time does not increase",
    "T02": "repeated time stamps",
    "T03": "dropped samples",
    "T04": "gap",
    "T05": "uneven sampling",
    "T06": "torque and position out of step",
    "T07": "shorter than one period",
    "T08": "too few samples",
    "T09": "sampled too slowly",
    "T10": "periods that are not alike",
    "X01": "external link",
    "X02": "external storage",
    "X03": "virtual data",
    "X04": "links, depth or number of members",
    "X05": "declares more than it can hold",
    "X06": "declares more than it can hold",
    "X07": "pickled objects",
    "X11": "link or name that leads elsewhere",
    "X12": "archive",
    "X13": "unsafe URDF",
    "Z70": "internal error",
}


def first_to_read(check: Check) -> tuple[bool, bool, int, int]:
    """Return what findings are sorted by, the first to read first.

    Columns in the wrong place, unit or time explain what else is found; what is said of a
    container spoils no fit.
    """
    code = check.code.removeprefix("RRID-")
    rank = 0 if code.startswith("S") or code == "T06" else 1 if code[:1] in ("T", "D") else 2
    return check.level != "reject", not check.gate, rank, _WORST_FIRST.index(check.level)


def title_of(code: str) -> str:
    """Return a few words for a code, with or without its prefix; "" for an unknown one."""
    return CODES.get(code.removeprefix("RRID-"), "")
