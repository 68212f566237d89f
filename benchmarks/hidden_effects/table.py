"""The table of issue 9 out of many scores, and the confusion matrix; shares with Wilson's (1927)
interval of 95 %.

print(table(scores))
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.score import Score

# Where wrong names have a row of their own, or are the point.
_APART = ("pairs", "noise", "taken out", "uncentred", "paper", "elsewhere", "unlike")
_FLOOR = 1.3
_QUICK, _SLOW = 10.0, 90.0  # [s] with reference logs, without
_SHUFFLES = 200
_STRONG = 0.3  # and above: strengths of the first row
_SPURIOUS = 0.3  # wrong names a pair


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    title: str
    bar: str
    figure: str
    cases: int
    met: bool | None  # None: no bar, or no case


def wilson(count: int, of: int, z: float = 1.96) -> tuple[float, float]:
    """Interval in which a share lies of which `count` in `of` were seen: Wilson 1927, solved for
    the share.

    (p + z²/2n ± z √(p(1 - p)/n + z²/4n²))/(1 + z²/n)
    """
    if of == 0:
        return 0.0, 1.0
    p, u = count / of, z * z / of
    middle, half = p + 0.5 * u, z * math.sqrt(p * (1.0 - p) / of + 0.25 * u / of)
    return (middle - half) / (1.0 + u), (middle + half) / (1.0 + u)


def table(scores: Sequence[Score]) -> str:
    """Everything as Markdown."""
    lines = ["| what | bar | figure | cases | |", "|---|---|---|---|---|"]
    for row in rows(scores):
        sign = {True: "met", False: "**not met**", None: ""}[row.met]
        lines.append(f"| {row.title} | {row.bar} | {row.figure} | {row.cases} | {sign} |")
    return "\n".join([*lines, "", by_cause(scores), "", confusion(scores), ""])


def rows(scores: Sequence[Score]) -> list[Row]:
    """One row of the issue's table after the other."""

    def family(*names: str) -> list[Score]:
        return [one for name in names for one in scores if one.family == name]

    def right(title: str, bar: float | None, *names: str) -> Row:
        return _counted(title, [one.right for one in family(*names)], bar)

    def wrong(title: str, bar: float | None, *names: str) -> Row:
        return _most(title, family(*names), bar)

    strong = [one.right for one in family("single") if (one.strength or 0.0) >= _STRONG]
    weak = [one.right for one in family("single") if (one.strength or 0.0) < _STRONG]
    named = [one for one in family("single", "compliance", "payload") if one.true]
    everything = [one for one in scores if one.family not in _APART]
    placed = [one for one in family("single", "compliance", "noise") if one.joint is not None]
    numbers = [ok for one in scores if not _taken(one) for _, ok in one.parameters]
    angles = [ok for one in scores if not _taken(one) for _, ok in one.angles]
    residuals = [(one.residual or math.inf) <= _FLOOR for one in named]
    simulated = [one.simulated is True for one in named]
    compliance = "right class: elasticity, base, backlash, saturation, with FRF logs"
    with_reference = [one for one in scores if one.case.get("reference")]
    without = [one for one in scores if not one.case.get("reference")]
    everywhere = "wrong name, over everything (but the rows with a bar of their own)"
    uncentred = "able to fail, torque not centred: a healthy arm is flagged"
    return [
        _counted("right cause, at full and 0.3 strength", strong, 0.95),
        _counted("right cause, at 0.1", weak, 0.90),
        right(compliance, 0.85, "compliance"),
        _counted("joint right among the named", [bool(one.joint) for one in placed], 0.98),
        _most(everywhere, everything, 0.02),
        _alarms(family("healthy")),
        right('outside the library: "unknown"', 0.95, "outside"),
        right('taken out of the library: "unknown"', 0.95, "taken out"),
        right('invisible: "not testable" with the reason', 1.0, "invisible"),
        right("payload with reference logs: named, mass within 3 %", 1.0, "payload"),
        right("pairs: both found", 0.85, "pairs"),
        _spurious(family("pairs")),
        _counted("named parameter within 5 % or 3 std", numbers, 0.90),
        _counted("phase or direction within 0.05 rad or 3 std", angles, None),
        _counted("held-out residual ≤ 1.3 of the noise floor after extension", residuals, 0.90),
        _counted("simulated position error smaller", simulated, 1.0),
        right("ten times the amplifier's noise: right", 0.75, "noise"),
        wrong("ten times the amplifier's noise: wrong name", 0.04, "noise"),
        right('standing since the reference logs: "nothing wrong"', None, "standing"),
        right("friction of three sigmoids, with reference logs: right", None, "paper"),
        wrong("friction of three sigmoids: wrong name", None, "paper"),
        right("reference logs of another motion: right", None, "unlike"),
        wrong("reference logs of another motion: wrong name", None, "unlike"),
        right("other arms and loops: right", None, "elsewhere"),
        wrong("other arms and loops: wrong name", None, "elsewhere"),
        _shuffled(family("single")),
        right('able to fail, strength zero: "nothing wrong"', 1.0, "zero"),
        right(uncentred, 1.0, "uncentred"),
        _time("seconds, with reference logs", with_reference, _QUICK),
        _time("seconds, without reference logs", without, _SLOW),
        Row("refused or crashed", "", str(_without_answer(scores)), len(scores), None),
    ]


def _taken(one: Score) -> bool:
    return one.family == "taken out"


def _counted(title: str, outcomes: Sequence[bool], bar: float | None) -> Row:
    count, of = sum(outcomes), len(outcomes)
    met = count >= bar * of - 1e-9 if of and bar is not None else None
    return Row(
        title,
        "" if bar is None else "all" if bar == 1.0 else f"≥ {bar:.2f}",
        _share(count, of),
        of,
        met,
    )


def _most(title: str, cases: Sequence[Score], bar: float | None) -> Row:
    """Count the cases with a wrong name."""
    count, of = sum(one.wrong > 0 for one in cases), len(cases)
    met = count <= bar * of + 1e-9 if of and bar is not None else None
    limit = "" if bar is None else f"≤ {100.0 * bar:.0f} %"
    return Row(title, limit, _share(count, of), of, met)


def _share(count: int, of: int) -> str:
    if not of:
        return "–"
    low, high = wilson(count, of)
    return f"{count / of:.3f} ({count} of {of}; {low:.2f} to {high:.2f})"


def _spurious(pairs: Sequence[Score]) -> Row:
    """Count the wrong names of each pair."""
    title, bar = "pairs: spurious names a case", "≤ 0.3"
    if not pairs:
        return Row(title, bar, "–", 0, None)
    share = sum(one.wrong for one in pairs) / len(pairs)
    return Row(title, bar, f"{share:.2f}", len(pairs), share <= _SPURIOUS)


def _alarms(cases: Sequence[Score]) -> Row:
    alarms = sum(not one.right for one in cases)
    return Row(
        "healthy arms: alarms",
        "≤ 2 of 100",
        _share(alarms, len(cases)),
        len(cases),
        alarms <= 0.02 * len(cases) if cases else None,
    )


def _shuffled(cases: Sequence[Score]) -> Row:
    """Right answers where each case gets the label of another: about one in the number of causes,
    whatever is said.
    """
    named = [one for one in cases if one.right]
    if len(named) < 2:
        return Row(
            "able to fail, labels shuffled: right", "about one in the causes", "–", len(named), None
        )
    rng, said = np.random.default_rng(9), np.array([one.truth[0] for one in named])
    share = float(np.mean([np.mean(said == rng.permutation(said)) for _ in range(_SHUFFLES)]))
    chance = float(np.sum((np.unique(said, return_counts=True)[1] / len(said)) ** 2))
    return Row(
        "able to fail, labels shuffled: right",
        f"about {chance:.3f}",
        f"{share:.3f}",
        len(named),
        share <= 2.0 * chance,
    )


def _time(title: str, cases: Sequence[Score], limit: float) -> Row:
    taken = [one.seconds for one in cases if math.isfinite(one.seconds)]
    if not taken:
        return Row(title, f"≤ {limit:.0f}", "–", 0, None)
    return Row(
        title,
        f"≤ {limit:.0f}",
        f"{np.median(taken):.1f}, at most {max(taken):.1f}",
        len(taken),
        max(taken) <= limit,
    )


def _without_answer(scores: Iterable[Score]) -> int:
    return sum(one.verdict in ("refused", "crashed") for one in scores)


def by_cause(scores: Iterable[Score]) -> str:
    """Of single causes, how many were right, wrong, and left open, at each strength."""
    counts: dict[str, dict[float, Counter[str]]] = {}
    for one in scores:
        if one.family in ("single", "compliance") and one.strength is not None:
            outcome = "right" if one.right and not one.wrong else "wrong" if one.wrong else "open"
            counts.setdefault(one.truth[0], {}).setdefault(one.strength, Counter())[outcome] += 1
    strengths = sorted({strength for row in counts.values() for strength in row}, reverse=True)
    lines = [
        "| cause: right / wrong / neither | "
        + " | ".join(f"× {strength:g}" for strength in strengths)
        + " |",
        "|---|" + "---|" * len(strengths),
    ]
    for cause, row in sorted(counts.items()):
        cells = [
            " / ".join(
                str(row.get(s, Counter())[outcome]) for outcome in ("right", "wrong", "open")
            )
            for s in strengths
        ]
        lines.append(f"| {cause} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def confusion(scores: Iterable[Score]) -> str:
    """Truth down, first answer across; a column is known by the number of its row, or of the list
    below the rows.
    """
    pairs = Counter(
        (_truth(one), one.named[0] if one.named else one.verdict)
        for one in scores
        if one.family in ("single", "compliance", "outside", "healthy", "payload")
    )
    truths = sorted({truth for truth, _ in pairs})
    answers = [*truths, *sorted({answer for _, answer in pairs} - set(truths))]
    seen = [answer for answer in answers if any(said == answer for _, said in pairs)]
    number = {answer: place for place, answer in enumerate(answers, start=1)}
    head = [f"{number[answer]}" if answer in truths else answer for answer in seen]
    lines = ["| truth | " + " | ".join(head) + " |", "|---|" + "---|" * len(seen)]
    lines += [
        f"| {number[truth]} {truth} | "
        + " | ".join(str(pairs[truth, answer] or "") for answer in seen)
        + " |"
        for truth in truths
    ]
    return "\n".join(lines)


def _truth(one: Score) -> str:
    return one.truth[0] if one.truth else "healthy"
