"""Numbers that decide how recordings are read and what a draft of a recipe takes for sure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Names:
    """Names of columns."""

    short: int = 2  # letters of a word, words of a name: too few to be split
    longest_word: int = 40  # letters of a word that is split


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
    most_notes: int = 200
    most_keys: int = 32  # joints, servos or environments in turn
    deepest: int = 8  # levels of structures; Isaac Lab has six
    longest_name: int = 1000  # characters of a column's name
    longest_text: int = 200  # characters that are kept of a text
    longest_unit: int = 20
    largest_number: float = 1.7e308  # an integer may have hundreds of digits
    listed: int = 40  # columns that a message names
    widest: int = 64  # columns of a matrix: more joints than any arm
    clearly_longer: int = 4  # times the other side
    separate: float = 0.5  # mean step from key to key over that from row to row: 1 for noise
    rounded: float = 1e-3  # of a clock's step: what rounding may take

    def most_bytes(self, size: int) -> int:
        """Return how many bytes a file of `size` bytes may declare."""
        return min(self.budget, self.most_packed * size + self.always)


@dataclass(frozen=True)
class Text:
    """Text files."""

    sampled: int = 200  # lines that show the format
    head: int = 40  # lines above the numbers that are searched for names
    sampled_head: int = 20  # and lines of numbers that say which columns are numbers
    head_bytes: int = 8192  # in which the names of the columns are
    nul_share: float = 0.3  # of NUL bytes in UTF-16
    most_digits: int = 18  # of a row's number
    longest_unit: int = 20
    widest: int = 100_000  # cells in a line: a signal of 100 s at 1 kHz, stored along its row
    fewest_counted: int = 3  # columns that are named 0, 1, 2, …
    half_day: int = 12  # hours
    long_side: int = 4  # times the other: a table of numbers is read along it
    most_notes: int = 40  # lines above a table
    most_damaged: int = 10  # lines
    damaged_share: float = 1e-3  # of the lines
    most_messages: float = 0.1  # of the lines
    most_joints: int = 32
    longest_example: int = 40  # characters of a column of text
    longest_line: int = 20_000  # characters of a line that labels its numbers
    one_form: float = 0.9  # of the lines label their numbers alike


@dataclass(frozen=True)
class Choice:
    """Columns and files of a recording that are looked at for a draft."""

    most_columns: int = 2000  # too many to guess what each is
    most_files: int = 200  # of a folder
    most_robots: int = 9
    most_beside: int = 20  # files read to see whether they have as many columns and rows
    largest_beside: int = 1 << 30  # [B]
    most_joints: int = 16
    most_blocks: int = 6  # signals without names
    usable: float = 0.8  # of the cells of a column that is looked at
    looked_at: int = 1000  # samples in which a column must vary
    varied: int = 50  # different numbers
    far_off: float = 3.0  # ranges of other numbers between them and a lost sample's
    no_number: float = 1e20  # nanoseconds since 1970 are 2e18
    quaternion: int = 4  # numbers
    unit_norm: float = 1e-3  # error of a quaternion's norm, written with four digits or more
    follows: float = 0.2  # rms difference over standard deviation: a reference and its measurement
    alike: float = 0.99  # correlation of the same
    offset: float = 5.0  # standard deviations of the difference: another zero
    rounding: float = 1e-3  # of the standard deviation


@dataclass(frozen=True)
class Scores:
    """Scores of hypotheses, about the logarithm of a likelihood ratio.

    Of units first: a value is filled in where it has `enough`, and `margin` more than any other.
    """

    sure: float = 10.0  # a name or header says the unit; the only century that stamps count to
    stated: float = 7.0  # a line of the file, a velocity, or a counter of one turn
    fits: float = 5.0  # the only unit that fits limits, rate or the robot's links
    doubt: float = 3.0  # a motor's, a share of a range or counts as well
    plausible: float = 1.0
    enough: float = 4.0
    margin: float = 3.0
    # Of columns: the best is taken, each difference larger than the sum of those below it.
    named: float = 20.0  # a word says the quantity
    unnamed: float = 10.0  # columns of joints that no word explains
    in_order: float = 8.0  # the robot's joints are named
    current: float = 4.0  # less than torque
    measured: float = 2.0  # more than plain
    of_motor: float = 1.0  # less than the joint's
    filtered: float = 0.5  # less than raw
    command: float = 19.0  # less than a torque that was not commanded
    refuted: float = 50.0  # not this signal: a part of it, or of another number of joints


@dataclass(frozen=True)
class Clock:
    """The time of a recording."""

    slowest: float = 1.0  # [Hz] what robots are recorded at
    fastest: float = 1e5  # [Hz]
    unnamed_fastest: float = 2e4  # [Hz]
    near: float = 0.2  # a rate within a fifth of the declared one is the declared one
    same_rate: float = 0.02
    few_steps: float = 3.0  # in which a counter starts again
    epoch: float = 1e6  # [s], or recordings: stamps that start later count from a year
    from_2001: float = 1e9  # [s] since 1970
    to_2096: float = 4e9  # [s] since 1970
    slowest_pace: float = 0.02  # [1/s] fastest speed over range of motion; the unit cancels
    fastest_pace: float = 50.0  # [1/s]
    rising: float = 0.9  # of all steps; some stamps come twice, some clocks are set back
    even: float = 0.3  # standard deviation over mean of the steps of a clock without a name
    again: float = 0.1  # of its range: a fraction of a second falls by it
    rounding: float = 1e-6  # unevenness that says nothing


@dataclass(frozen=True)
class Notes:
    """Lines of text in a file."""

    longest: int = 300  # characters of a line that is read
    slowest: float = 1.0  # [Hz] what robots are recorded at
    fastest: float = 1e5  # [Hz]
    fewest_words: int = 3  # of a sentence, beside the joint's
    most_sentences: int = 3  # about single joints that a draft quotes


@dataclass(frozen=True)
class Evidence:
    """Comparisons of columns with each other."""

    # counts of encoders in one turn
    resolutions: tuple[int, ...] = (
        4096, 8192, 16384, 2048, 1024, 65536, 131072, 262144, 1048576, 4000, 10000, 20000
    )  # fmt: skip
    fewest: int = 50  # samples, different numbers
    stretches: tuple[int, ...] = (200, 60, 20)  # parts of a recording, velocity summed over each
    like: float = 0.95  # correlation over which one block is the slope of another
    same_ratio: float = 0.1  # scatter of the ratio over the joints, of jumps
    hardly_moves: float = 1e-3  # of the range of all joints
    jump: float = 0.8  # of the range: a counter starts again
    small_step: float = 0.2  # of the range: any other step
    far_start: float = 12.566370614359172  # [rad] two turns: a motor's start
    quarter_turn: float = 2e-3  # quarter turns off a whole number
    still: float = 0.4  # of the steps are zero while the position moves: held
    false_sign: float = 1e-3  # chance that a recording without friction is given a sign
    least_half: int = 6  # samples before and after a reversal
    windows: int = 200  # of a recording
    fewest_turns: int = 3  # reversals
    one_turn: float = 5e-3  # range of one recorded revolution over the resolution, less 1
    share: float = 0.02  # of a bound: what keeps 0..1 and comes near both is a share of a range
    share_above: float = 0.3  # of the range, below which it begins
    share_below: float = 0.7  # of the range of both signs, below which it begins
    counts_span: float = 2000.0  # whole numbers over more are counts
    whole_span: float = 10.0  # whole numbers over more are counts or degrees
    all_whole: float = 0.99  # of numbers
    limit_slack: float = 0.05  # of a joint's range
    one_turn_rad: float = 6.440264939859077  # [rad] 2.05 pi: a turn and a little
    twice_room: float = 2.0  # no joint moves over so many times its range
    even: float = 0.05  # of a step: the 95th percentile of an even clock
    near_rate: float = 5e-3  # of a round rate
    map_even: float = 0.2  # standard deviation over mean of a map's steps
    map_least: int = 10  # steps


@dataclass(frozen=True)
class Links:
    """The comparison of a torque with that of the robot's own links."""

    window: float = 0.1  # [s] of the local cubic (Savitzky & Golay 1964): moves take longer
    fewest: int = 5  # samples in it: a cubic has four coefficients
    changes: float = 0.1  # of the links' torque over the motion: else friction and noise dominate
    explained: float = 0.5  # of the power that friction leaves, or the torque does not follow
    most: float = 0.8  # of the links' torque is at joints they explain: not at a light wrist
    slow: float = 0.01  # of a joint's fastest speed: below, it may rest and noise gives it a sign
    alone: float = 0.99  # of the torque with its friction, a hundredth or more in any drive
    gain: float = 3.0  # a payload as heavy as the links, whose masses are roughly known
    unnamed_gain: float = 1.5  # without a unit: a share of a rated torque may be near it by chance
    better: float = 0.5  # of the residual of one unit or order is that of another that fits better
    proof: float = 0.1  # of the torque may be unexplained under the unit that is proved
    friction: float = 0.3  # correlation of the rest with the direction of motion
    samples: int = 4000  # of a recording that are compared: ten seconds of a fast one
    samples_of_orders: int = 600  # of these, for each exchange of two joints


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


@dataclass(frozen=True)
class Repair:
    """Repairs of a recording, and the log that is made of it."""

    shortest_part: float = 0.1  # of the samples of parts of equal length
    most_missing: float = 0.2  # of the samples
    finest: float = 4.0  # times the recorded rate: the highest rate of resampling
    previews: int = 3  # logs that the report draws
    preview_points: int = 150


NAMES = Names()
SCORES = Scores()
ARRAYS = Arrays()
TEXT = Text()
CHOICE = Choice()
CLOCK = Clock()
NOTES = Notes()
EVIDENCE = Evidence()
LINKS = Links()
RECIPE = Recipe()
REPAIR = Repair()
