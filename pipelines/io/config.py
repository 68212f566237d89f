"""Numbers that decide what is read: each with its meaning and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FORMAT", "SANDBOX", "TEXT", "URDF"]


@dataclass(frozen=True)
class SandboxConfig:
    """Limits of the child process that reads a file of unknown origin."""

    seconds: float = 10.0  # [s] a healthy file of 20 MB takes a tenth of it
    bytes_a_second: float = 5e6  # [B/s] that a larger file gets in addition
    memory: int = 1 << 30  # [B] beside what the samples need
    memory_a_byte: int = 1200  # [B] for each byte of the file: above the largest honest packing
    most_memory: int = 32 << 30  # [B]
    description: int = 16 << 20  # [B] of JSON beside the samples; a log's own has kilobytes
    description_a_byte: int = 16  # [B] of JSON for each byte of the file
    most_description: int = 256 << 20  # [B]


@dataclass(frozen=True)
class TextConfig:
    """Bounds of a TOML text: its parser may need time and memory far beyond the length."""

    size: int = 4 << 20  # [B] a description with the URDF of a thousand links has 0.4 MB
    lines: int = 20_000  # outside multi-line texts; 5,000 files of a recipe
    parts: int = 6  # names in a dotted key; a configuration has two
    key: int = 1000  # characters of a key or a bare value
    depth: int = 32  # arrays and inline tables in each other
    values: int = 200_000  # a transmission of 100 joints has 10,000


@dataclass(frozen=True)
class FormatConfig:
    """What a file may hold before it is called a log."""

    chunk: int = 65536  # samples of a chunk: log-format.md
    members: int = 64  # of a group, or attributes: a log has fewer than twenty
    attribute: int = 1 << 20  # [B] a model.json in /controller is the longest that a log carries
    metadata: int = 16 << 20  # [B] of Parquet
    # gzip packs at most to 1/1032, and `t` never repeats: no honest log comes near this
    packing: int = 1100  # times the file
    always: int = 64 << 20  # [B] that any file may declare
    # only a log in which nothing moves is packed to 1/300, and nobody records 256 MB of that
    long_packing: int = 300  # times the file
    long: int = 256 << 20  # [B]
    integer: int = 2**53  # above it a float is not exact
    result: int = 256 << 20  # [B] of a result.json; a run has less than one
    model: int = 64 << 20  # [B] of a model.json
    inline: int = 64  # numbers of an array that stand in result.json; longer ones are series
    digits: int = 300  # of an integer in a result: a longer one overflows a float


@dataclass(frozen=True)
class UrdfConfig:
    """Bounds of a URDF, a text about a few dozen links."""

    size: int = 16_000_000  # [B]
    depth: int = 100  # nested elements
    elements: int = 100_000
    links: int = 1000  # a humanoid with hands has a tenth of it
    number: float = 1e9  # squares and products of it stay finite; a limit of that size is none
    no_limit: float = 1e16  # what URDFs write for no limit
    short: float = 1e-9  # length of an axis without direction
    rounding: float = 0.01  # of the trace: an inertia of two digits has half a percent


SANDBOX = SandboxConfig()
TEXT = TextConfig()
FORMAT = FormatConfig()
URDF = UrdfConfig()
