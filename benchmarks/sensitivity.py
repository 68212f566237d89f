"""Vary each deciding number of the diagnosis by ½ and 2, and count the verdicts that change.

    python -m benchmarks.sensitivity --count 12 --seed 21              all numbers, a table
    python -m benchmarks.sensitivity --numbers misfit share            some of them

Cases are drawn machines of `benchmarks.other_plants`. A verdict is the kind and the causes named;
it is right where the causes named are those of the case, or none where it has none.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

from benchmarks.other_plants.cases import Case
from benchmarks.other_plants.drawn import drawn
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import diagnose

_FACTORS = (0.5, 2.0)


@dataclass(frozen=True)
class Row:
    """One number, at one factor."""

    number: str
    factor: float
    right: int
    wrong: int  # a cause named that the machine has not
    changed: int  # verdicts that differ from those of the config as it is


def varied(config: DiagnosisConfig, number: str, factor: float) -> DiagnosisConfig:
    """Return the config with one number multiplied; whole numbers stay whole and at least 1."""
    value = getattr(config, number)
    other = max(1, round(value * factor)) if isinstance(value, int) else value * factor
    return replace(config, **{number: other})


def _named(case: Case, config: DiagnosisConfig) -> tuple[str, ...]:
    decision = diagnose(list(case.logs()), config).decision
    if decision.verdict != "cause":
        return (decision.verdict,)
    return tuple(sorted(cause.key[0] for cause in decision.causes))


def rows(cases: Sequence[Case], numbers: Sequence[str]) -> Iterator[Row]:
    """Yield the row of the config as it is, and two of each number."""
    config = DiagnosisConfig()
    usual = [_named(case, config) for case in cases]
    yield _row("as it is", 1.0, cases, usual, usual)
    for number in numbers:
        for factor in _FACTORS:
            found = [_named(case, varied(config, number, factor)) for case in cases]
            yield _row(number, factor, cases, found, usual)


def _row(
    number: str,
    factor: float,
    cases: Sequence[Case],
    found: Sequence[tuple[str, ...]],
    usual: Sequence[tuple[str, ...]],
) -> Row:
    quiet = {"no-fault-found", "unknown"}
    right = wrong = 0
    for case, names in zip(cases, found, strict=True):
        causes = set(names) - quiet
        faulty = bool(case.fault and case.answers)
        right += (bool(causes) and causes <= set(case.answers)) if faulty else not causes
        wrong += not causes <= set(case.answers)
    changed = sum(a != b for a, b in zip(found, usual, strict=True))
    return Row(number, factor, right, wrong, changed)


def main() -> None:
    """Print the table."""
    usual = DiagnosisConfig()
    every = [one.name for one in fields(usual) if getattr(usual, one.name) is not None]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--numbers", nargs="*", default=every, choices=every)
    given = parser.parse_args()
    cases = drawn(given.count, given.seed)
    print(f"{'number':20s} {'×':>4s} {'right':>6s} {'wrong':>6s} {'changed':>8s} of {len(cases)}")
    for row in rows(cases, given.numbers):
        told = f"{row.number:20s} {row.factor:4g} {row.right:6d} {row.wrong:6d} {row.changed:8d}"
        print(told, flush=True)


if __name__ == "__main__":
    main()
