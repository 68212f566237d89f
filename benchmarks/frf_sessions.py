"""Sessions of frequency responses on three plants: compliance found for any v, loop, rate and band.

    nice python -m benchmarks.frf_sessions [--seed 1] [--count 60] [--logs FOLDER] [--only NAME …]

A rigid arm, a soft base, a spring in a joint, or a gap in it, on the plants of `frf_plants`. Each
session has two postures, v as a multisine, as band-limited noise or as a periodic sweep, PD, PD
with feed-forward or computed torque, 100 Hz to 5 kHz (the bench 1 kHz), and one of three bands.
Printed: right, undecided, wrong of each plant and rate, with intervals of 95 % (Wilson 1927).
Undecided is an answer; of a gap, it is right where the gap is among the candidates. Logs stay in
FOLDER.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np

from benchmarks.frf_plants import KINDS, PLANTS, Session, recorded
from benchmarks.hidden_effects.table import wilson
from pipelines.frequency.config import GroupingConfig
from pipelines.frequency.findings import Findings, frf_findings, grouped
from pipelines.io.files import open_log, write_log
from pipelines.io.log import ExperimentLog

RATES = (100, 250, 500, 1000, 2000, 5000)  # [Hz]
_RUNAWAY = 1.0  # [rad] from the reference: a controller too fast for its rate and a light motor
BANDS = ((3.0, 80.0), (4.0, 150.0), (2.0, 220.0))  # [Hz] of v, at most .4 of the rate


def drawn(seed: int, count: int) -> list[Session]:
    """`count` sessions, equally many of each plant and kind."""
    return [_draw(seed, number) for number in range(count)]


def _draw(seed: int, number: int) -> Session:
    rng = np.random.default_rng([seed, number])
    plant = PLANTS[number % len(PLANTS)]
    rate = 1000 if plant == "bench" else int(rng.choice(RATES))
    low, high = BANDS[int(rng.integers(len(BANDS)))]
    return Session(
        f"{seed}-{number}",
        plant,
        KINDS[number // len(PLANTS) % len(KINDS)],
        str(rng.choice(["multisine", "noise", "sweep"])),
        str(rng.choice(["pd", "pd+feedforward", "computed-torque"])),
        rate,
        (low, min(high, 0.4 * rate)),
        float(rng.uniform(min(3.0, 0.016 * rate), min(8.0, 0.032 * rate))),
        int(rng.integers(1 << 30)),
    )


def logs_of(sessions: list[Session], folder: Path) -> Iterator[tuple[Session, list[ExperimentLog]]]:
    """Each session with its logs, recorded where they are not in `folder` yet."""
    folder.mkdir(parents=True, exist_ok=True)
    ordered = sorted(sessions, key=lambda s: (s.plant, s.rate))
    for (plant, _), alike in groupby(ordered, key=lambda s: (s.plant, s.rate)):
        several = list(alike)
        for part in [several] if plant == "equations" else [[s] for s in several]:
            new = [s for s in part if not (folder / f"{s.name}-2.h5").exists()]
            for session, logs in zip(new, recorded(new) if new else [], strict=True):
                for p, log in enumerate(logs, start=1):
                    write_log(folder / f"{session.name}-{p}.h5", log)
            for s in part:
                yield s, [open_log(folder / f"{s.name}-{p}.h5").log for p in (1, 2)]


def judged(session: Session, found: Findings) -> str:
    """right, undecided or wrong."""
    said = {one.kind for one in found.classification}
    if session.kind == "gap":
        if said:
            return "wrong"
        return (
            "right" if any("backlash" in one.candidates for one in found.undecided) else "undecided"
        )
    if said - {session.kind}:
        return "wrong"
    return "right" if said and not found.undecided else "undecided"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--only", nargs="*", help="names of sessions")
    parser.add_argument(
        "--logs", type=Path, default=Path(tempfile.gettempdir()) / "rrrid-frf-sessions"
    )
    given = parser.parse_args()
    sessions = [s for s in drawn(given.seed, given.count) if not given.only or s.name in given.only]
    tally: Counter[tuple[str, str]] = Counter()
    for session, logs in logs_of(sessions, given.logs):
        if not max(np.abs(log.q - log["q_ref"]).max() for log in logs) < _RUNAWAY:
            print(f"{session.name}: the loop is unstable; not counted")
            continue
        begun = time.process_time()
        found = frf_findings(logs)
        verdict = judged(session, found)
        for group in ("all", session.plant, f"{session.rate} Hz"):
            tally[group, verdict] += 1
        for share in (1.075, 1.3):
            again = Findings(found.seen, (), *grouped(found.seen, GroupingConfig(flat=share)))
            tally[f"flat {share:g}", judged(session, again)] += 1
        print(_line(session, verdict, found, time.process_time() - begun), flush=True)
    for group in dict.fromkeys(group for group, _ in sorted(tally)):
        total = sum(tally[group, v] for v in ("right", "undecided", "wrong"))
        print(
            f"{group:10}",
            *(
                "{}: {} of {}, {:.2f} to {:.2f};".format(
                    v, tally[group, v], total, *wilson(tally[group, v], total)
                )
                for v in ("right", "undecided", "wrong")
            ),
        )


def _line(s: Session, verdict: str, found: Findings, seconds: float) -> str:
    named = [
        (
            one.kind,
            one.joint,
            {name: f"{x.value:.5g} ± {x.std:.2g}" for name, x in one.parameters.items()},
        )
        for one in found.classification
    ]
    return (
        f"{s.name}: {s.plant}, {s.kind}, {s.excitation}, {s.law}, {s.rate} Hz, {s.band[0]:g} to "
        f"{s.band[1]:g} Hz: {verdict} ({seconds:.0f} s) {named} "
        f"{[one.evidence for one in found.undecided]}"
    )


if __name__ == "__main__":
    main()
