"""The table of causes, causes.toml: what each is called, said of, and which parameters it has."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

from pipelines.effects.config import EFFECTS
from pipelines.io.sandbox import parse_toml, read_small_text

__all__ = ["Cause", "Parameters", "Quantity", "Values", "Words", "causes"]

Values = Mapping[str, float]


@dataclass(frozen=True)
class Quantity:
    """One parameter of an effect: its unit, and the range it is expected in before any log."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    shape: bool = False  # non-linear: a field of the effect; otherwise an amplitude
    discrete: bool = False  # of a shape: a whole number, chosen and never moved a little
    derived: bool = False  # follows from the other parameters
    joint: bool = False  # the number of another joint of the arm, 1-based
    link: bool = False  # the number of a link with a joint beyond it, counted from the base
    unsaid: float | None = None  # where a model file does not say: the law before it was known
    grid: tuple[float, ...] = ()  # of a shape: where a search looks, on any motion
    held: float | None = None  # of a shape: a refit does not move it from here: a simpler law
    shared: bool = False  # of a shape: one number with that of the friction law at its joint
    several: bool = False  # of a shape: one joint may have the effect with several values of it
    seen: bool = False  # of a shape: end of the angles that it was fitted to
    reads_torque: bool = False  # the columns compare it with the logged torque, a held command
    revolute: bool = False  # only a joint that turns has it
    earlier: bool = False  # of `joint`: the same with the two exchanged, looked for at the later
    fixed: float | None = None  # of an amplitude: what physics gives; screening fits it
    # of an amplitude, in healthy machines: 0 none, inf any, a number up to it; None: in small
    healthy: float | None = None
    # of an angle on a circle, rad whether its joint turns or slides: so much more is the same again
    period: float | None = None

    def among(self, own: int | None, n_joints: int) -> tuple[int, ...] | None:
        """Return the joints or links that it may be of an effect at joint `own`; None: neither."""
        if self.joint:
            return tuple(k for k in range(1, n_joints + 1) if k != own)
        return tuple(range(1, n_joints)) if self.link else None

    def found_at(self, own: int | None, n_joints: int) -> bool:
        """Return whether an effect at joint `own` of `n_joints` has a joint or link for it."""
        among = self.among(own, n_joints)
        return among is None or any(not self.earlier or own is None or k < own for k in among)

    def unfit(self, value: float, own: int | None, n_joints: int) -> str:
        """Say why no arm of `n_joints` joints can have this value; nothing where it can."""
        among = self.among(own, n_joints)
        if among is None or value in among:
            return ""
        what = "is no other joint of" if self.joint else "is no link with a joint beyond it on"
        takes = f"; it takes {' or '.join(map(str, among))}" if among else ""
        return f"{self.name} = {value:g} {what} this arm, which has {n_joints}{takes}"

    def unit_at(self, revolute: bool) -> str:
        """Return its unit: a slide has m and N for rad and N m, and waves in 2π m."""
        if revolute or self.period is not None:
            return self.unit
        slide = self.unit
        for turns, slides in (
            ("N m", "N"),
            ("kg m^2", "kg"),
            ("rad", "m"),
            ("1/rev", "1/(2 pi m)"),
        ):
            slide = slide.replace(turns, slides)
        return slide


class Parameters(tuple[Quantity, ...]):
    """The parameters of an effect, in the order in which models and reports list them."""

    def __new__(cls, *quantities: Quantity) -> Self:
        return super().__new__(cls, quantities)

    def complete(self, values: Values) -> dict[str, float]:
        """Return `values`, and the default of each number that is younger and not among them."""
        return {q.name: q.unsaid for q in self if q.unsaid is not None} | dict(values)

    @property
    def fixed(self) -> tuple[float, ...] | None:
        """Amplitudes that physics gives; None where all are fitted."""
        return tuple(q.fixed for q in self if q.fixed is not None) or None

    @property
    def _first(self) -> Quantity | None:
        return next((q for q in self if not q.shape and not q.derived), None)

    @property
    def healthy(self) -> float | None:
        """As much of it as healthy machines have: `Quantity.healthy` of the first amplitude."""
        return None if self._first is None else self._first.healthy

    def slight(self, sample_time: float = 0.0) -> float:
        """Return an amplitude that surely is no cause, of a time at least a tenth of a sample."""
        timed = self._first is not None and self._first.unit == "s"
        least = EFFECTS.timing * sample_time if timed else 0.0
        known = self.healthy
        return least if known is None or math.isinf(known) else max(known, least)

    @property
    def reads_torque(self) -> bool:
        """Return whether columns hold the logged torque itself."""
        return any(q.reads_torque for q in self)


@dataclass(frozen=True)
class Words:
    """The text about an effect in a report: sentences, but for the title."""

    title: str
    signature: str  # how it shows
    explanation: str  # what it is
    remedy: str  # what to do about it
    experiment: str  # what to record to be sure
    size: str = ""  # the parameter that a verdict gives with the title, if one alone says enough
    falling: bool = False  # there is more of it the smaller that parameter is


@dataclass(frozen=True)
class Cause:
    """An entry of the table."""

    file: str  # module of this package
    words: Words
    parameters: Parameters = field(default_factory=Parameters)


@lru_cache(maxsize=1)
def causes() -> dict[str, Cause]:
    """Return the table, by the names of the causes."""
    text = read_small_text(Path(__file__).with_name("causes.toml"))
    return {name: _cause(name, entry) for name, entry in sorted(parse_toml(text).items())}


def _cause(name: str, entry: dict[str, Any]) -> Cause:
    file = entry.pop("file", name)
    quantities = []
    for own, said in entry.pop("parameters").items():
        (low, high), grid = said.pop("range"), tuple(said.pop("grid", ()))
        quantities.append(Quantity(own, low=low, high=high, grid=grid, **said))
    return Cause(file, Words(**entry), Parameters(*quantities))
