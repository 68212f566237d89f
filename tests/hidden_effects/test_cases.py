"""The sealed cases: as many and as varied as the issue asks for, the same for the same seed, and no log tells what is hidden."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from bench.control import Decentralised
from bench.experiments import Experiment
from bench.machine import Machine
from benchmarks.hidden_effects import sessions
from benchmarks.hidden_effects.cases import Hidden, SealedCase, campaign
from benchmarks.hidden_effects.make import answers_in, make_cases
from benchmarks.hidden_effects.sessions import record_case
from pipelines.io.files import open_log
from pipelines.io.log import digest_of
from tests.bench.machines import sway
from tests.seeds import rarely

COGGING, CONTACT = Hidden("cogging", 2, 1.0, 7), Hidden("contact", None, 1.0, 7)
CASE = SealedCase("single", (COGGING,), 5, 7, "short")


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every session sways for a quarter of a second, twice to fit and once to judge."""
    def plans(machine: Machine, seeds: list[int]) -> list[Experiment]:
        first, second, third = (Experiment("", "excitation", sway(0.25, hz=hz), Decentralised()) for hz in (2.0, 3.0, 4.0))
        return [first, second, third.judging()]

    monkeypatch.setattr(sessions, "_SETS", dict.fromkeys(("mixed", "periodic", "friction", "long", "short"), plans))
    monkeypatch.setattr(sessions, "_SHORTEST", {False: 0.25, True: 0.25})


def test_a_seed_is_a_campaign() -> None:
    """The same again for the same seed; for another nothing in common, neither machines nor cases."""
    once, again, other = campaign(4), campaign(4), campaign(5)
    assert once == again
    assert len({case.key for case in once}) == len({case.seed for case in once}) == len(once)
    assert not {case.key for case in once} & {case.key for case in other}
    assert not {case.machine for case in once} & {case.machine for case in other}


@pytest.mark.usefixtures("brief")
def test_a_case_is_made_once_and_always_the_same(tmp_path: Path) -> None:
    cases = [CASE, SealedCase("healthy", (), 5, 8, "short")]
    for out in (tmp_path / "one", tmp_path / "two"):
        assert len(list(make_cases(cases, out))) == 2
        assert list(make_cases(cases, out)) == []
    for key in (case.key for case in cases):
        one, two = ({path.name: digest_of(open_log(path).log) for path in (tmp_path / out / "logs" / key).iterdir()}
                    for out in ("one", "two"))
        assert one == two
        assert len(one) == 3


@pytest.mark.usefixtures("brief")
def test_answers_are_apart_from_logs(tmp_path: Path) -> None:
    """Cause, joint and parameters, named as a finding names them; in the folder of logs are logs."""
    list(make_cases([CASE], tmp_path))
    truth, = answers_in(tmp_path)
    assert (truth.key, truth.verdict, truth.strength) == (CASE.key, "cause", 1.0)
    assert (truth.findings[0]["cause"], truth.findings[0]["joint"]) == ("cogging", 2)
    assert {"order", "amplitude", "phase"} <= set(truth.findings[0]["parameters"])
    assert {path.suffix for path in (tmp_path / "logs").rglob("*") if path.is_file()} == {".h5"}
    assert not any("cogging" in part for path in (tmp_path / "logs").rglob("*") for part in path.parts[-2:])


@pytest.mark.usefixtures("brief")
@pytest.mark.parametrize(("hidden", "reference"), [
    ((replace(COGGING, cause="torque_saturation"),), False), *rarely(
        ((COGGING,), True), ((replace(COGGING, cause="joint_elasticity"),), False)),
    ((replace(COGGING, cause="time_delay", strength=0.1),), False),
    ((COGGING, replace(COGGING, cause="spring", joint=3)), True)])
def test_no_log_tells_what_is_hidden(hidden: tuple[Hidden, ...], reference: bool) -> None:
    """But for the samples, the logs are those of the same machine in order; the reference logs are so to the last sample."""
    case = replace(CASE, hidden=hidden, reference=reference)
    sick, well = record_case(case).logs, record_case(replace(case, hidden=())).logs
    assert len(sick) == len(well) == (5 if reference else 3)
    for one, other in zip(sick, well, strict=True):
        assert replace(one, signals=other.signals) == other
        assert (one == other) == (one.role == "reference")
        assert str(case.seed) not in one.name
