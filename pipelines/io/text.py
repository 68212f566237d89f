"""Read a small text that a user names: a robot, a recipe, a configuration. Never a pipe, never a device, never gigabytes."""

from __future__ import annotations

import os
from pathlib import Path

from pipelines.errors import UsageError
from pipelines.io.atomic import fault_of
from pipelines.io.files import regular_file

__all__ = ["read_small_text"]

_LIMIT = 4 << 20  # [B] a URDF of a thousand links is a tenth of it


def read_small_text(path: Path, limit: int = _LIMIT, *, what: str = "a TOML file") -> str:
    """The text in `path`, which must be a regular file of at most `limit` bytes in UTF-8.

    Args:
        what: what belongs there, for the remedy.

    Raises:
        UsageError: C04 no such file, C02 too long or not a text. InputRejected: F12, not a regular file.
        EnvironmentFault: F13, no permission.
    """
    if regular_file(path, what=what, empty=True).st_size > limit:
        raise _too_long(path, limit, what)
    try:
        # The path may have become a pipe since it was looked at: without O_NONBLOCK opening it would wait for ever.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            data = file.read(limit + 1)
    except OSError as problem:
        raise fault_of(problem, path) from None
    if len(data) > limit:
        raise _too_long(path, limit, what)
    try:
        return data.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError as problem:
        raise UsageError("C02", f"not a text in UTF-8: byte {problem.start} is {data[problem.start]:#04x}", where=path,
                         remedy=f"give {what}, saved as UTF-8") from None


def _too_long(path: Path, limit: int, what: str) -> UsageError:
    return UsageError("C02", f"longer than the {limit} bytes that such a text may have", where=path, remedy=f"give {what}")
