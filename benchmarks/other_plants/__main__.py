"""Diagnose arms that the bench did not draw, one after the other, and print how it fared.

    python -m benchmarks.other_plants                                all
    python -m benchmarks.other_plants gantry-cogging six-tanh        these
    python -m benchmarks.other_plants --count 5 --keep FOLDER        five; logs stay in FOLDER
    python -m benchmarks.other_plants --drawn 3 --count 40           forty, drawn the third time
    python -m benchmarks.other_plants --drawn 3 --pairs              with two faults each
    python -m benchmarks.other_plants --noise 10                     ten times the drives' noise
    python -m benchmarks.other_plants --part 1/2                     every second
"""

from __future__ import annotations

import argparse
import math
import shutil
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipelines.io.files import write_log

try:
    from benchmarks.hidden_effects.judge import asked
    from benchmarks.other_plants.cases import CASES, Case
    from benchmarks.other_plants.drawn import drawn, pairs
except ModuleNotFoundError as missing:
    if missing.name != "mujoco":
        raise
    raise SystemExit(
        "the plants need MuJoCo, which is not installed: pip install -e '.[bench]'"
    ) from None

_USUAL = 48


def main() -> None:
    parser = _parser()
    arguments = parser.parse_args()
    if arguments.pairs and arguments.drawn is None:
        parser.error("--pairs needs --drawn")
    draw = pairs if arguments.pairs else drawn
    cases = CASES if arguments.drawn is None else draw(arguments.count or _USUAL, arguments.drawn)
    cases = tuple(replace(case, noise=arguments.noise * case.noise) for case in cases)
    if unknown := sorted(set(arguments.names) - {case.name for case in cases}):
        parser.error(f"no such case: {', '.join(unknown)}")
    chosen = [case for case in cases if not arguments.names or case.name in arguments.names][
        : arguments.count
    ]
    which, parts = map(int, arguments.part.split("/"))
    if not 1 <= which <= parts:
        parser.error(f"no such part: {arguments.part}")
    chosen = chosen[which - 1 :: parts]
    with tempfile.TemporaryDirectory() as place:
        home = arguments.keep or Path(place)
        if arguments.noise != 1.0:
            home /= f"noise-{arguments.noise!r}"
        outcomes = [_one(case, home / case.name) for case in chosen]
    print("; ".join(f"{outcomes.count(one)} {one}" for one in sorted(set(outcomes))))
    if "crashed" in outcomes:
        raise SystemExit(1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help="; ".join(case.name for case in CASES))
    parser.add_argument("--count", type=int, help="no more than so many")
    parser.add_argument(
        "--drawn",
        type=_seed,
        metavar="SEED",
        help=f"cases drawn at random, {_USUAL} where no --count says how many",
    )
    parser.add_argument(
        "--pairs", action="store_true", help="those that are drawn have two faults each"
    )
    parser.add_argument("--noise", type=_factor, default=1.0, help="times the noise of the drives")
    parser.add_argument("--part", default="1/1", help="1/2, 2/2, …: every second of them")
    parser.add_argument("--keep", type=Path, help="where logs stay")
    return parser


def _seed(text: str) -> int:
    """From 1: numbers in the names of drawn cases begin with it, and those of the others are
    small.
    """
    if (number := int(text)) < 1:
        raise argparse.ArgumentTypeError("seeds begin at 1")
    return number


def _factor(text: str) -> float:
    if not (math.isfinite(factor := float(text)) and factor > 0.0):
        raise argparse.ArgumentTypeError("not a finite number above 0")
    return factor


def _one(case: Case, folder: Path) -> str:
    made = time.perf_counter()
    if not folder.exists():
        draft = folder.with_suffix(".draft")
        shutil.rmtree(draft, ignore_errors=True)
        draft.mkdir(parents=True)
        for log in case.logs():
            write_log(draft / f"{log.name}.h5", log)
        draft.rename(folder)
    begun = time.perf_counter()
    line = asked(folder)
    outcome, said = judged(case, line)
    print(
        f"{case.name:36} {case.loop:16} {1e3 * case.sample_time:4g} ms  {outcome:8} {said}  made "
        f"in {begun - made:.0f} s, "
        f"{line['seconds']:.0f} s, {line['cpu']:.0f} s of CPU",
        flush=True,
    )
    return outcome


def judged(case: Case, line: Mapping[str, Any]) -> tuple[str, str]:
    """ "right", "open", "wrong", "refused" or "crashed", and what was said.

    Args:
        line: as `asked` answers.

    A healthy arm is right with nothing wrong, and causes with their names at their joints and no
    other name, one of two is open; an "unknown" is open where something is wrong, and wrong where
    nothing is; "cannot-judge" is open. Friction that the nominal model lacks may be named, or not,
    but not otherwise.
    """
    for none in ("refused", "crashed"):
        if none in line:
            return none, line[none]
    answer = line["answer"]
    verdict = answer["verdict"]
    names = [(one["cause"], one["joint"]) for one in answer["findings"]]
    told = [
        [
            cause in one.answers
            and (not one.fault or joint in (None, one.joint) or one.fault == "torque_delay")
            for one in case.faults
        ]
        for cause, joint in names
    ]
    if not all(map(any, told)):
        outcome = "wrong"
    elif not case.fault:
        silent = case.answers or verdict == "cannot-judge"
        outcome = "right" if verdict == "no-fault-found" or names else "open" if silent else "wrong"
    elif case.answers:
        outcome = "right" if names and all(map(any, zip(*told, strict=True))) else "open"
    else:
        outcome = "right" if verdict == "unknown" else "open"
    found = ", ".join(cause if joint is None else f"{cause}:{joint}" for cause, joint in names)
    return outcome, f"{verdict} {found or answer.get('reason', '')} {_errors(answer)}"


def _errors(answer: Mapping[str, Any]) -> str:
    """Floor, held-out error before, and after every finding, of each joint."""
    rms = answer["residual_rms"]
    after = min(
        (one["gain"]["validate_torque_rms"]["after"] for one in answer["findings"]),
        key=lambda each: sum(map(float, each)),
        default=rms["validate"],
    )
    return "; ".join(
        f"{a:.3g}>{b:.3g}/{f:.3g}" if None not in (a, b, f) else "-"
        for a, b, f in zip(rms["validate"], after, rms["noise_floor"], strict=True)
    )


if __name__ == "__main__":
    main()
