"""Numbers that decide how recordings are read and what a draft of a recipe takes for sure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Arrays:
    """Files of arrays and documents."""

    largest_file: int = 2 << 30  # [B]
    largest_json: int = 200_000_000  # [B]; parsed, JSON takes about ten times its size
    budget: int = 4 << 30  # [B] declared; ten minutes of seven joints at 5 kHz have 0.5 GB
    most_packed: int = 1100  # to 1, what deflate reaches at most
    always: int = 64 << 20  # [B] that any file may declare
    longest_header: int = 65_536  # [B] of NPY
    mat4_header: int = 20  # [B]
    most_members: int = 2000  # of a file
    most_columns: int = 2000
    most_notes: int = 40
    deepest: int = 8  # levels of structures; Isaac Lab has six
    longest_name: int = 1000  # characters of a column's name
    longest_text: int = 1000  # characters that are kept of a text
    longest_unit: int = 20
    listed: int = 40  # columns that a message names
    widest: int = 64  # columns of a matrix: more joints than any arm
    clearly_longer: int = 4  # times the other side
    rounded: float = 1e-3  # of a clock's step: what rounding may take

    def most_bytes(self, size: int) -> int:
        """Return how many bytes a file of `size` bytes may declare."""
        return min(self.budget, self.most_packed * size + self.always)


@dataclass(frozen=True)
class Text:
    """Text files."""

    sampled: int = 200  # lines that show the format
    chunk: int = 20_000  # lines that pandas reads at a time
    head: int = 40  # lines above the numbers that are searched for names
    head_bytes: int = 8192  # in which NUL bytes show UTF-16
    nul_share: float = 0.3  # of NUL bytes in UTF-16
    widest: int = 100_000  # cells in a line: a signal of 100 s at 1 kHz, stored along its row
    long_side: int = 4  # times the other: a table of numbers is read along it
    fewest_long: int = 20  # cells of such a line
    most_damaged: int = 10  # lines
    damaged_share: float = 1e-3  # of the lines
    fewest_counted: int = 3  # columns that are named 0, 1, 2, …
    numeric: float = 0.5  # of the cells of a column of numbers
    decimals: int = 1  # to which shares of numeric cells are compared: one torn line is nothing


@dataclass(frozen=True)
class Guessing:
    """Drafts of recipes."""

    most_columns: int = 2000  # too many to guess what each is
    least: int = 2  # columns beside a clock without a name
    most_robots: int = 9
    most_joints: int = 16
    most_blocks: int = 6  # signals without names
    quoted: int = 5  # lines of the file
    shown: int = 8  # candidates
    only_offered: int = 9  # rank of a signal that is never taken
    usable: float = 0.8  # of the cells of a column that is looked at
    no_number: float = 1e20  # nanoseconds since 1970 are 2e18
    slowest: float = 10.0  # [Hz] rates of a clock without a unit
    fastest: float = 2e4  # [Hz]
    rising: float = 0.9  # of all steps; some stamps come twice
    set_back: int = 3  # times that a clock may be set back
    fraction: float = 2e-3  # [s] largest unit of a fraction of a second
    even: float = 0.3  # standard deviation over mean of the steps of a clock without a name
    stretches: int = 200  # of a recording, over which a velocity is summed
    like: float = 0.95  # correlation over which one block is the slope of another
    same_ratio: float = 0.1  # scatter of a ratio over the joints
    twice_room: float = 2.0  # no joint moves over so many times its range
    window: float = 0.1  # [s] of the local cubic (Savitzky & Golay 1964): moves take longer
    cubic: int = 5  # samples in it, at least
    samples: int = 4000  # of a recording that are compared: ten seconds of a fast one
    uneven: float = 0.5  # of a step: a clock without gaps
    slow: float = 0.01  # of a joint's fastest speed: below, it may rest and noise gives it a sign
    matters: float = 0.05  # of a torque's variance is the links', or its gain says nothing
    explains: float = 0.5  # of what friction leaves is the links'
    proves: float = 0.1  # of the torque may be unexplained under a unit that is proved
    refutes: float = 0.15  # of the torque unexplained: it is not that of this motion
    better: float = 0.5  # of the residual of another unit is that of the one that is proved
    gain: float = 1.7  # under a named unit: masses are known, a payload is light beside the links
    unnamed_gain: float = 1.5  # without a unit: a share of a rated torque may be near it by chance
    round_rates: tuple[float, ...] = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)


@dataclass(frozen=True)
class Clock:
    """The time of a recording."""

    slowest: float = 1.0  # [Hz] what robots are recorded at
    fastest: float = 1e5  # [Hz]
    near: float = 0.2  # a rate within a fifth of the declared one is the declared one
    epoch: float = 1e6  # recordings: stamps that start later count from a year
    from_2001: float = 1e9  # [s] since 1970
    to_2096: float = 4e9  # [s] since 1970


@dataclass(frozen=True)
class Recipe:
    """Recipes, and the files that their patterns match."""

    largest: float = 1e12  # of any number
    singular: float = 1e-12  # determinant of a transmission
    most_files: int = 100_000  # below the folder of the recordings
    longest_pattern: int = 500  # characters
    simple: int = 2  # wildcards: a name of 255 characters is tried 255^2 times at most
    seconds: float = 3.0  # [s] for all patterns of a recipe on all names
    memory: int = 256 << 20  # [B] for them
    named: int = 5  # files that a message names
    turn_ratio: float = 0.1  # of a turn: how near to it a step is a rollover
    beyond: float = 2.0  # times its range no joint moves


@dataclass(frozen=True)
class Repair:
    """Repairs of a recording, and the log that is made of it."""

    shortest_part: float = 0.1  # of the samples of parts of equal length
    most_missing: float = 0.2  # of the samples
    finest: float = 4.0  # times the recorded rate: the highest rate of resampling
    lengths: float = 1e-3  # of the samples: files of one recording may differ by so many


ARRAYS = Arrays()
TEXT = Text()
GUESS = Guessing()
CLOCK = Clock()
RECIPE = Recipe()
REPAIR = Repair()
