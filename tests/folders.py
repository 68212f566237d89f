"""What a folder holds, to compare two of them."""

from __future__ import annotations

from pathlib import Path


def contents(folder: Path, *without: str) -> dict[str, bytes]:
    """Every file by its place, but those of these names."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and path.name not in without}
