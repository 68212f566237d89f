"""Make sealed cases.

    python -m benchmarks.hidden_effects make --out FOLDER [--families single healthy] [--seed 0] [--part 1/4] [--short]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.hidden_effects.cases import FAMILIES, SealedCase, campaign
from benchmarks.hidden_effects.make import make_cases


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="record cases")
    make.add_argument("--out", type=Path, required=True)
    make.add_argument("--families", nargs="*", default=[], choices=list(FAMILIES))
    make.add_argument("--seed", type=int, default=0, help="another seed, other machines and motions")
    make.add_argument("--part", default="1/1", help="i/N: every N-th case")
    make.add_argument("--count", type=int, help="no more than so many")
    make.add_argument("--causes", nargs="*", default=[], help="only cases that hide one of these")
    make.add_argument("--strengths", nargs="*", type=float, default=[])
    make.add_argument("--short", action="store_true", help="three logs of six seconds instead of 52 s")
    arguments = parser.parse_args()
    chosen = [case for case in campaign(arguments.seed, arguments.families, arguments.short)
              if _wanted(case, arguments.causes, arguments.strengths)]
    which, parts = (int(number) for number in arguments.part.split("/"))
    for case, seconds in make_cases(chosen[which - 1::parts][:arguments.count], arguments.out):
        print(f"{case.key} {case.family:10} {case.session:8} {seconds:5.1f} s", flush=True)


def _wanted(case: SealedCase, causes: list[str], strengths: list[float]) -> bool:
    return ((not causes or any(one.cause in causes for one in case.hidden))
            and (not strengths or any(one.strength in strengths for one in case.hidden)))


if __name__ == "__main__":
    main()
