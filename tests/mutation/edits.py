"""Ways to damage the bytes of a file, drawn by hypothesis: flips, cuts, copies, and values that programs stumble over."""

from __future__ import annotations

import re
from dataclasses import dataclass

from hypothesis import strategies as st

__all__ = ["Edit", "damaged", "edits"]

_KINDS = ("flip", "set", "insert", "delete", "repeat", "swap", "cut", "number", "token")
_BYTES = (b"\x00", b"\xff", b"\x7f", b"\x80", b"\xff\xff\xff\xff", b"\x00" * 8, b"\xff" * 8, b"\n", b'"', b"[", b"<", b",", b"=")
_TOKENS = (b"1e308", b"-1e308", b"1e-320", b"nan", b"inf", b"-inf", b"0", b"-1", b"4294967296", b"1" + b"0" * 40, b'""', b"[]",
           b"{}", b"null", b"true", b"1e400", b"\xc3\x28", b"0x10", b"1_0", b"-0.0", b"99", b"../../x", b"\x1b[31m")
_NUMBER = re.compile(rb"-?\d+(\.\d*)?([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Edit:
    """One damage. Places and lengths are shares of the file: the same edit fits any file."""

    kind: str
    place: int  # parts in 2^20 of the file
    length: int  # [B]
    what: int

    def of(self, data: bytes) -> bytes:
        at = min(len(data) - 1, self.place * len(data) >> 20) if data else 0
        to = min(len(data), at + self.length)
        match self.kind:
            case "flip":
                return data[:at] + bytes([data[at] ^ (1 << self.what % 8)]) + data[at + 1:] if data else data
            case "set":
                put = _BYTES[self.what % len(_BYTES)]
                return data[:at] + put + data[at + len(put):]
            case "insert":
                return data[:at] + _BYTES[self.what % len(_BYTES)] + data[at:]
            case "delete":
                return data[:at] + data[to:]
            case "repeat":
                return data[:to] + data[at:to] + data[to:]
            case "swap":
                other = min(len(data), to + self.length)
                return data[:at] + data[to:other] + data[at:to] + data[other:]
            case "cut":
                return data[:at]
            case "number":  # the next number of a text becomes another
                found = _NUMBER.search(data, at)
                return data if found is None else data[:found.start()] + self._token() + data[found.end():]
            case _:
                return data[:at] + self._token() + data[to:]

    def _token(self) -> bytes:
        return _TOKENS[self.what % len(_TOKENS)]


def edits() -> st.SearchStrategy[list[Edit]]:
    """One to four of them."""
    one = st.builds(Edit, st.sampled_from(_KINDS), st.integers(0, (1 << 20) - 1), st.integers(1, 64), st.integers(0, 255))
    return st.lists(one, min_size=1, max_size=4)


def damaged(data: bytes, many: list[Edit]) -> bytes:
    for edit in many:
        data = edit.of(data)
    return data
