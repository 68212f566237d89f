"""Make sealed cases, let a diagnosis judge them, print the table of issue 9.

    python -m benchmarks.hidden_effects make  --out FOLDER [--families single healthy] [--short]
    python -m benchmarks.hidden_effects judge --out FOLDER [--families single] [--taken-out]
    python -m benchmarks.hidden_effects table --out FOLDER
    python -m benchmarks.hidden_effects all   --out FOLDER [--part 1/4]

`all` does one after the other, with causes taken out too.

Cases and answers that exist are not made again, so each of them can be interrupted, and parts can
run beside each other. All of it is some 650 cases of 52 s: more than two hours to make on one core,
and as long as the diagnosis takes to judge.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

try:
    from benchmarks.hidden_effects.cases import FAMILIES, campaign, in_part
    from benchmarks.hidden_effects.judge import by_command, by_compute, judge, scores_in, tasks
    from benchmarks.hidden_effects.make import make_cases
    from benchmarks.hidden_effects.table import table
except ModuleNotFoundError as missing:
    if missing.name != "mujoco":
        raise
    raise SystemExit(
        "the bench needs MuJoCo, which is not installed: pip install -e '.[bench]'"
    ) from None


def main() -> None:
    arguments = _parser().parse_args()
    kept = arguments.verdicts or arguments.out / "verdicts.jsonl"
    if arguments.command in ("make", "all"):
        _make(arguments)
    if arguments.command in ("judge", "all"):
        _judge(arguments, kept, arguments.taken_out)
    if arguments.command == "all":
        _judge(arguments, kept, True)
    if arguments.command in ("table", "all"):
        print(table(scores_in(arguments.out, kept)))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=("make", "judge", "table", "all"))
    parser.add_argument("--out", type=Path, required=True, help="folder of the cases")
    parser.add_argument("--families", nargs="*", default=[], choices=list(FAMILIES))
    parser.add_argument(
        "--part", default="1/1", help="i/N: about one case in N, always the same ones"
    )
    parser.add_argument("--count", type=int, help="no more than so many")
    parser.add_argument(
        "--seed", type=int, default=0, help="another seed, other machines and motions"
    )
    parser.add_argument(
        "--short", action="store_true", help="make three logs of six seconds instead of 52 s"
    )
    parser.add_argument(
        "--verdicts", type=Path, help="file of the answers; default: verdicts.jsonl among the cases"
    )
    parser.add_argument(
        "--taken-out", action="store_true", help="judge with the true cause left out of the library"
    )
    parser.add_argument(
        "--quick", action="store_true", help="judge without figures and detection limits"
    )
    return parser


def _make(arguments: argparse.Namespace) -> None:
    chosen = [
        case
        for case in campaign(arguments.seed, arguments.families, arguments.short)
        if in_part(case.key, arguments.part)
    ]
    for case, seconds in make_cases(chosen[: arguments.count], arguments.out):
        outcome = "runs away, left out" if math.isnan(seconds) else f"{seconds:5.1f} s"
        print(f"{case.key} {case.family:10} {case.session:8} {outcome}", flush=True)


def _judge(arguments: argparse.Namespace, kept: Path, taken_out: bool) -> None:
    chosen = [
        task
        for task in tasks(arguments.out, arguments.families, taken_out)
        if in_part(task[0].key, arguments.part)
    ]
    engine = by_compute if arguments.quick else by_command
    for score in judge(arguments.out, kept, chosen[: arguments.count], engine):
        outcome = "right" if score.right else "wrong" if score.wrong else "open"
        print(
            f"{score.key} {score.family:10} {'+'.join(score.truth) or '-':40} "
            f"{score.strength or 0:4g} -> {score.verdict}: "
            f"{', '.join(score.named) or '-':30} {outcome:5} {score.seconds:5.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
