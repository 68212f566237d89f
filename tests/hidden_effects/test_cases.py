"""The sealed cases: as many and as varied as the issue asks for, the same for the same seed, and no log tells what is hidden."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench import motions
from bench.control import Decentralised
from bench.experiments import Experiment
from bench.faults import find_fault
from bench.machine import Machine
from benchmarks.hidden_effects import make, sessions
from benchmarks.hidden_effects.cases import FAMILIES, Hidden, SealedCase, campaign, in_part
from benchmarks.hidden_effects.make import answers_in, make_cases
from benchmarks.hidden_effects.sessions import machine_of_case, record_case
from pipelines.errors import UsageError
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


def test_the_campaign_is_as_large_as_the_issue_asks() -> None:
    """200 cases of single causes, three strengths, five machines, joints balanced; and the other families."""
    cases = campaign(4)
    of = {name: [case for case in cases if case.family == name] for name in FAMILIES}
    scored = of["single"] + of["compliance"]
    assert len(scored) >= 200
    assert len({case.machine for case in scored}) >= 5
    assert {case.hidden[0].strength for case in scored} == {1.0, 0.3, 0.1}
    at = Counter(case.hidden[0].joint for case in scored if case.hidden[0].joint)
    assert max(at.values()) - min(at.values()) <= 0.1 * max(at.values())
    assert len(of["healthy"]) == 100
    assert len(of["outside"]) >= 30
    assert len({case.hidden[0].cause for case in of["outside"]}) >= 4
    assert len(of["pairs"]) == 60
    assert all(case.hidden[0].cause != case.hidden[1].cause for case in of["pairs"])
    assert {case.hidden[0].cause for case in of["noise"]} == {case.hidden[0].cause for case in of["single"]}


def test_machines_joints_and_sessions_do_not_go_together() -> None:
    """Which machine it is, or what was recorded, says little of the joint."""
    cases = [case for case in campaign(4, ("single",)) if case.hidden[0].joint]
    for kind in ("machine", "session"):
        counts = Counter((getattr(case, kind), case.hidden[0].joint) for case in cases)
        even = len(cases) / len({getattr(case, kind) for case in cases}) / 3
        assert max(counts.values()) < 2.0 * even, kind
        assert min(counts.values()) > 0.4 * even, kind


def test_no_single_cause_is_where_nobody_can_see_it() -> None:
    places = {(one.cause, one.joint) for case in campaign(4, ("single", "pairs", "noise")) for one in case.hidden}
    assert not places & {("rotor_inertia", 1), ("rotor_inertia", 2), ("payload", None)}
    assert all(find_fault(cause).known for cause, _ in places)


def test_a_seed_is_a_campaign() -> None:
    """The same again for the same seed; for another nothing in common, neither machines nor cases."""
    once, again, other = campaign(4), campaign(4), campaign(5)
    assert once == again
    assert len({case.key for case in once}) == len({case.seed for case in once}) == len(once)
    assert not {case.key for case in once} & {case.key for case in other}
    assert not {case.machine for case in once} & {case.machine for case in other}


def test_parts_are_the_whole() -> None:
    keys = [case.key for case in campaign(4)]
    parts = [[key for key in keys if in_part(key, f"{part}/3")] for part in (1, 2, 3)]
    assert sorted(key for part in parts for key in part) == sorted(keys)
    assert min(map(len, parts)) > 0.8 * len(keys) / 3


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


def test_a_loop_that_runs_away_stops_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is said, and leaves neither logs nor an answer."""
    def runs_away(case: SealedCase) -> sessions.Session:
        raise UsageError("C02", "the loop runs away")

    monkeypatch.setattr(make, "record_case", runs_away)
    (case, seconds), = make_cases([CASE], tmp_path)
    assert case == CASE
    assert math.isnan(seconds)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.mark.usefixtures("brief")
def test_what_was_left_half_made_is_made_again(tmp_path: Path) -> None:
    list(make_cases([CASE], tmp_path))
    next((tmp_path / "logs" / CASE.key).iterdir()).unlink()
    (tmp_path / "answers" / f"{CASE.key}.json").unlink()
    assert len(list(make_cases([CASE], tmp_path))) == 1
    assert len(list((tmp_path / "logs" / CASE.key).iterdir())) == 3


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


@pytest.mark.usefixtures("brief")
def test_what_happens_once_is_in_one_log() -> None:
    """And leaves the other causes where they are."""
    contact = replace(CONTACT, once=True)
    for hidden, expected in (((contact,), [True, False, False]), ((contact, COGGING), [True, True, True])):
        sick, well = record_case(replace(CASE, hidden=hidden)).logs, record_case(replace(CASE, hidden=())).logs
        assert [not np.array_equal(one.q, other.q) for one, other in zip(sick, well, strict=True)] == expected


@pytest.mark.usefixtures("brief")
def test_what_stands_is_in_the_reference_logs_as_well() -> None:
    case = replace(CASE, hidden=(), standing=(COGGING,), reference=True)
    sick, well = record_case(case).logs, record_case(replace(case, standing=())).logs
    assert all(not np.array_equal(one.q, other.q) for one, other in zip(sick, well, strict=True))


@pytest.mark.usefixtures("brief")
def test_a_drives_limit_is_measured_by_what_the_healthy_arm_needs() -> None:
    """0.55 of the largest torque at full strength."""
    case = replace(CASE, hidden=(Hidden("torque_saturation", 2, 1.0, 7),))
    needed = max(np.abs(log.tau[:, 1]).max() for log in record_case(replace(case, hidden=())).logs)
    limit = record_case(case).hidden[0].parameters()["limit"]
    assert limit == pytest.approx(0.55 * needed, rel=0.05)


@pytest.mark.usefixtures("brief")
def test_logs_may_claim_that_torque_was_sampled() -> None:
    assert {log.torque for log in record_case(replace(CASE, held=False)).logs} == {"measured"}
    assert {log.torque for log in record_case(CASE).logs} == {None}


def test_more_noise_is_ten_times_as_much() -> None:
    quiet, loud = (machine_of_case(replace(CASE, amplifier=factor)).amplifier_noise for factor in (1.0, 10.0))
    np.testing.assert_allclose(loud, 10.0 * np.array(quiet))


@pytest.mark.slow
def test_sessions_last_52_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each with logs to fit and logs to judge."""
    monkeypatch.setattr(motions, "within_torque", lambda machine, reference, centre: reference)  # it takes long
    machine = machine_of_case(CASE)
    for name, plans in sessions._SETS.items():
        made = plans(machine, [1, 2, 3, 4])
        seconds = sum(plan.reference.t[-1] + 1e-3 for plan in made)
        assert seconds == pytest.approx(18.0 if name == "short" else 52.0, abs=0.1), name
        assert {plan.role for plan in made} == {"identify", "validate"}, name
        assert len({plan.name for plan in made}) == len(made), name
