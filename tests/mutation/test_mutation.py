"""Damaged bytes, whatever they say: every reader takes them or refuses them in words, in bounded time and memory.

In CI each reader meets 15; the campaign is `pytest -m slow tests/mutation -s -k hdf5`, ten thousand a reader.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.mutation.contained import Contained, Outcome
from tests.mutation.edits import Edit, damaged, edits
from tests.mutation.readers import READERS, Reader

_SECONDS, _BYTES = 10.0, 1e9
FEW, MANY = 15, int(os.environ.get("RRRID_MUTATIONS", "10000"))


def _outcomes(reader: Reader, folder: Path, examples: int) -> list[Outcome]:
    """Every example's outcome; the bytes of each bad one are kept in the folder."""
    place = folder / "data" / f"a{reader.ending}"
    place.parent.mkdir()
    seeds = reader.seeds(folder)
    found: list[Outcome] = []

    def work(data: bytes) -> None:
        place.write_bytes(data)
        reader.work(place)

    with Contained(work) as child:
        for seed in seeds:
            assert (good := child.run(seed)).exit == 0, good

        @settings(max_examples=examples, deadline=None, database=None, derandomize=True, phases=[Phase.generate],
                  suppress_health_check=list(HealthCheck))
        @given(st.integers(0, len(seeds) - 1), edits())
        def meet(which: int, many: list[Edit]) -> None:
            data = damaged(seeds[which], many)
            outcome = _alone(child, data)
            if outcome.exit not in reader.exits or outcome.seconds > _SECONDS or outcome.words.startswith("INCOMPLETE"):
                (folder / f"bad-{len(found)}{reader.ending}").write_bytes(data)
            found.append(outcome)

        meet()
    return found


def _alone(child: Contained, data: bytes) -> Outcome:
    """The worst outcome with the time that the input needs: what took too long is timed twice more, and a machine that stood still
    for a while is not the file's. One that hangs or crashes, be it once of three times, has hung or crashed."""
    met = [child.run(data)]
    while len(met) < 3 and met[-1].exit >= 0 and min(one.seconds for one in met) > _SECONDS:
        met.append(child.run(data))
    worst = max(met, key=lambda one: (one.exit < 0, one.exit, one.words.startswith("INCOMPLETE")))
    return replace(worst, seconds=min(one.seconds for one in met), memory=max(one.memory for one in met), again=len(met) - 1)


def _table(reader: Reader, found: list[Outcome]) -> str:
    """A line of the campaign's table, and every kind of outcome that breaks a bar."""
    exits = Counter(outcome.exit for outcome in found)
    crashes = sum("crashed" in outcome.words for outcome in found)
    hangs = sum("did not end" in outcome.words for outcome in found)
    bad = Counter((o.exit, o.code, o.words[:160]) for o in found if o.exit not in reader.exits or o.words.startswith("INCOMPLETE"))
    lines = [f"{reader.name}: {len(found)} inputs, exits {dict(sorted(exits.items()))}, library crashed {crashes}, hung {hangs}, "
             f"worst {max(o.seconds for o in found):.2f} s, {max(o.memory for o in found) / 1e6:.0f} MB, "
             f"timed again {sum(o.again > 0 for o in found)}"]
    return "\n".join([*lines, *(f"  {count} x {kind}" for kind, count in bad.most_common())])


def _hold(reader: Reader, found: list[Outcome]) -> None:
    said = _table(reader, found)
    print(said)
    assert {outcome.exit for outcome in found} <= reader.exits, said
    assert not any(outcome.words.startswith("INCOMPLETE") for outcome in found), said
    assert max(outcome.seconds for outcome in found) <= _SECONDS, said
    assert max(outcome.memory for outcome in found) <= _BYTES, said
    # A campaign of which nothing was refused has damaged nothing.
    assert sum(outcome.exit != 0 for outcome in found) > len(found) // 10, said


class _Told(Contained):
    """A child of which it is told how each run ends."""

    def __init__(self, *outcomes: Outcome) -> None:
        super().__init__(lambda _: None)
        self.outcomes = list(outcomes)

    def run(self, data: bytes) -> Outcome:
        return self.outcomes.pop(0)


@pytest.mark.parametrize(("times", "met"), [
    ([Outcome(3, "F02", "cut", 0.1)], (3, 0.1, 0)),
    ([Outcome(3, "F02", "cut", 12.0), Outcome(3, "F02", "cut", 0.1)], (3, 0.1, 1)),
    ([Outcome(0, "", "", 11.0), Outcome(0, "", "", 13.0), Outcome(0, "", "", 12.0)], (0, 11.0, 2)),
    ([Outcome(3, "F02", "cut", 11.0), Outcome(70, "KeyError", "q", 14.0), Outcome(3, "F02", "cut", 0.1)], (70, 0.1, 2)),
    ([Outcome(0, "", "", 11.0), Outcome(-9, "", "hung", 30.0)], (-9, 11.0, 1)), ([Outcome(-11, "", "", 12.0)], (-11, 12.0, 0))])
def test_what_is_timed_again_keeps_its_worst_end(times: Sequence[Outcome], met: tuple[int, float, int]) -> None:
    """The least time, and the crash of any of the three."""
    outcome = _alone(_Told(*times), b"")
    assert (outcome.exit, outcome.seconds, outcome.again) == met


@pytest.mark.parametrize("name", READERS)
def test_a_damaged_file_is_read_or_refused(name: str, tmp_path: Path) -> None:
    """Exit 0, 3 (2 for descriptions and configurations): place and remedy said, in 10 s and 1 GB; a checksummed log is itself."""
    _hold(READERS[name], _outcomes(READERS[name], tmp_path, FEW))


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_ten_thousand_damaged_files(name: str, tmp_path: Path) -> None:
    """The same, ten thousand a reader."""
    _hold(READERS[name], _outcomes(READERS[name], tmp_path, MANY))
