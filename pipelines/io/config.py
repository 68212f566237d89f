"""Numbers that decide what is read: each with its meaning and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta


@dataclass(frozen=True)
class SandboxConfig:
    """Limits of the child process that reads a file of unknown origin."""

    seconds: float = 10.0  # [s] a healthy file of 20 MB takes a tenth of it
    bytes_a_second: float = 5e6  # [B/s] that a larger file gets in addition
    memory: int = 1 << 30  # [B] in addition to the samples
    memory_a_byte: int = 1200  # [B] for each byte of the file: above the largest honest packing
    most_memory: int = 32 << 30  # [B]
    description: int = 16 << 20  # [B] of JSON beside the samples; a log's own has kilobytes
    description_a_byte: int = 16  # [B] of JSON for each byte of the file
    most_description: int = 256 << 20  # [B]


@dataclass(frozen=True)
class TextConfig:
    """Bounds of a TOML text: its parser may need time and memory far beyond the length."""

    size: int = 1 << 20  # [B] a description with the URDF of a thousand links has 0.4 MB
    parts: int = 64  # names in a row between dots; a key has two, a list of files a dozen
    depth: int = 12  # of tables and lists within each other; a description of links has eight


@dataclass(frozen=True)
class FormatConfig:
    """Bounds of a file that is read as a log."""

    chunk: int = 65536  # samples of a chunk: log-format.md
    members: int = 64  # of a group, or attributes: a log has fewer than twenty
    attribute: int = 1 << 20  # [B] a model.json in /controller is the longest that a log carries
    metadata: int = 16 << 20  # [B] of Parquet
    # gzip packs at most to 1/1032, and `t` never repeats: no honest log comes near this
    packing: int = 1100  # times the file
    always: int = 64 << 20  # [B] that any file may declare
    # only a log in which nothing moves is packed to 1/300, and no recording has 256 MB of that
    long_packing: int = 300  # times the file
    long: int = 256 << 20  # [B]
    integer: int = 2**53  # above it a float is not exact
    result: int = 256 << 20  # [B] of a result.json; a run has less than one
    model: int = 64 << 20  # [B] of a model.json
    inline: int = 64  # numbers of an array in result.json; longer arrays are series
    digits: int = 300  # of an integer in a result: a longer one overflows a float


@dataclass(frozen=True)
class UrdfConfig:
    """Bounds of a URDF, a text about a few dozen links."""

    size: int = 16_000_000  # [B]
    depth: int = 100  # nested elements
    number: float = 1e9  # squares and products of it stay finite; a larger limit means no limit
    short: float = 1e-9  # length of an axis without direction
    longest: float = 100.0  # [m] no arm has such a link
    rounding: float = 0.01  # of the trace: an inertia of two digits has half a percent


@dataclass(frozen=True)
class SessionsConfig:
    """Bounds of a session that goes on after midnight (UTC)."""

    pause: timedelta = timedelta(hours=3)  # at most: a meal, no night
    longest: timedelta = timedelta(hours=12)  # of such a session: a day of work


@dataclass(frozen=True)
class LimitsConfig:
    """How much may be wrong with the samples of a log."""

    fewest: int = 20  # samples; fewer have no statistics, and show no motion (T08)
    shortest: int = 100  # samples; less is over before an observer or a filter has settled (T04)
    gap: int = 10  # missing samples that an observer predicts through (T03, T04)
    lost: float = 1.5  # sample times beside the missing ones in the longest such interval
    steps: int = 5  # a clock that was set back more often is not a clock (T01)
    jitter: float = 0.05  # of the sample time (T05)
    varying: float = 0.15  # of the sample time: long intervals are then nothing special
    half: float = 0.5  # of the sample time, by which an interval is still one sample long
    absurd: float = 1e9  # no joint is there, in any SI unit (D03)
    reach: float = 10.0  # [rad, m] at least between a filler and the measurements
    shown: float = 1e-5  # a smaller share has no digits that count
    sentinels: tuple[float, ...] = (
        *(10.0**digits - 1.0 for digits in (3, 4, 5, 6)),
        *(2.0**bits - 1.0 for bits in (15, 16, 31, 32)),
        2.0**15,
        2.0**31,
    )


LIMITS = LimitsConfig()
SANDBOX = SandboxConfig()
SESSIONS = SessionsConfig()
TEXT = TextConfig()
FORMAT = FormatConfig()
URDF = UrdfConfig()
