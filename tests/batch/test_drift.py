"""What moved from item to item is told, and what only scattered is not."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest

from pipelines.batch.baseline import against, unheld
from pipelines.batch.drift import drift_of, from_others
from pipelines.batch.parts import Part, parts_of
from pipelines.batch.record import Record, Status
from pipelines.batch.result import Result
from pipelines.batch.summary import Summary, summary_report
from pipelines.log.model_file import ModelFile, StoredEffect, StoredParameter, StoredValue
from pipelines.log.result_figures import fitted, residuals
from pipelines.log.result_schema import result_schema
from tests.batch.conftest import Lay, obey

STD = 0.02


def _record(name: str, status: Status = "ok", accepts: bool = False, **known: Any) -> Record:
    """An item of one robot, of which `known` is known."""
    return Record(name, name, status, int(status == "found"), parts=(Part(**known),), accepts=accepts)


def _records(values: np.ndarray) -> list[Record]:
    """Items recorded one a day, in an order that is not that of their names."""
    order = np.random.default_rng(0).permutation(len(values))
    return [_record(f"item {order[i]:03d}", figures={"p1": (float(value), STD, "kg m^2")}, robot="arm",
                    recorded=f"2026-01-{i + 1:02d}T00:00:00Z") for i, value in enumerate(values)]


def test_normal_scatter_is_no_drift() -> None:
    """400 batches of 12 items that only scatter: χ² has its mean and its quantiles, and 3 std are passed as rarely as by chance."""
    rng = np.random.default_rng(1)
    courses = [drift_of(_records(1.0 + STD * rng.normal(size=12)))[0].figures[0] for _ in range(400)]
    chi_square = np.array([course.chi_square for course in courses])
    assert courses[0].freedom == 11
    assert abs(chi_square.mean() - 11.0) < 4.0 * np.sqrt(22.0 / 400)
    assert 0.02 < np.mean([course.probability < 0.05 for course in courses]) < 0.09  # type: ignore[operator]
    assert np.mean([abs(far) > 3.0 for course in courses for far in course.away]) < 0.006


def test_a_step_is_dated() -> None:
    """Six std in one item: that one has moved, by about as much, no other is blamed for it, and χ² says that something did."""
    values = 1.0 + STD * np.random.default_rng(2).normal(size=10)
    values[6] += 6.0 * STD
    course = drift_of(_records(values))[0].figures[0]
    records = _records(values)
    assert course.moved == (records[6].name,)
    assert 4.0 < course.away[6] < 8.0
    assert course.probability is not None
    assert course.probability < 1e-3
    assert course.items == tuple(record.name for record in records)  # by the time of recording, not by name


def test_the_others_weigh_by_their_uncertainty() -> None:
    """A vague item neither accuses a sure one nor hides it; by the text book: x₁ against the weighted mean of x₂ and x₃."""
    value, std = np.array([0.3, 0.0, 9.0]), np.array([0.1, 0.1, 100.0])
    mean = (0.0 / 0.1**2 + 9.0 / 100.0**2) / (1 / 0.1**2 + 1 / 100.0**2)
    assert from_others(value, std)[0] == pytest.approx((0.3 - mean) / np.sqrt(0.1**2 + 1 / (1 / 0.1**2 + 1 / 100.0**2)), rel=1e-12)
    assert abs(from_others(value, std)[2]) < 0.1
    certain = from_others(np.array([1.0, 1.2, 1.1]), np.array([1e-12, 0.1, 0.1]))
    assert np.allclose(certain, [-0.15 / np.hypot(1e-12, 0.1 / np.sqrt(2.0)), 2.0, 1.0], rtol=1e-6)


def test_a_residual_is_judged_by_the_scatter_of_most() -> None:
    """One item with ten times the residual stands out of six; of four nobody can tell."""
    def course(values: list[float]) -> tuple[str, ...]:
        records = [_record(str(i), residuals={"torque rms": (value, "N m")}, robot="arm")
                   for i, value in enumerate(values)]
        return drift_of(records)[0].residuals[0].moved

    assert course([0.10, 0.11, 0.09, 1.0, 0.105, 0.095]) == ("3",)
    assert course([0.10, 0.11, 0.09, 1.0]) == ()


def test_robots_are_not_mixed() -> None:
    """Two arms differ by nature."""
    records = [_record(f"{robot}{i}", figures={"p1": (value, STD, "kg m^2")}, robot=robot)
               for robot, value in (("a", 1.0), ("b", 2.0)) for i in range(3)]
    assert [(drift.robot, drift.figures[0].moved) for drift in drift_of(records)] == [("a", ()), ("b", ())]


def test_figures_are_named_by_where_they_stand() -> None:
    """In any stage's result: by name, by joint, by cause; not what has no std, and no figure of a run twice."""
    figure = {"value": 1.0, "std": 0.1, "unit": "N m"}
    friction = {"joints": [{"joint": 2, "law": "coulomb", "parameters": {"level": figure, "bare": {**figure, "std": None}}}]}
    assert list(fitted(friction)) == ["coulomb joint 2 level"]
    diagnosis = {"findings": [{"cause": "cogging", "joint": 2, "parameters": {"amplitude": figure}}]}
    stages = [{"name": "estimate-bps", "exit": 0, "result": {"parameters": [{"name": "p1", **figure}], "torque_rms": {
        "validate": [0.1, 0.2]}}}, {"name": "diagnose", "exit": 1, "result": diagnosis}, {"name": "frf", "exit": 5, "result": None}]
    assert list(fitted({**diagnosis, "stages": stages})) == ["estimate-bps p1", "diagnose cogging joint 2 amplitude"]
    assert residuals({"stages": stages}) == {"estimate-bps torque rms validate joint 1": (0.1, "N m"),
                                             "estimate-bps torque rms validate joint 2": (0.2, "N m")}


def _baseline() -> ModelFile:
    cogging = StoredEffect("cogging", 2, {"amplitude": StoredValue(0.5, 0.01, "N m", "fitted")})
    return ModelFile("known", "", (StoredParameter("p1", 1.0, STD, "kg m^2", True, "fitted", "J"),), effects=(cogging,))


def _found(amplitude: float, joint: int = 2, p1: float = 1.0, accepts: bool = True) -> Record:
    finding = {"cause": "cogging", "joint": joint, "parameters": {"amplitude": {"value": amplitude, "std": 0.01, "unit": "N m"}}}
    return _record("a", "found", accepts, figures={"p1": (p1, STD, "kg m^2")}, findings=(finding,), diagnosed=True)


def test_a_baseline_accepts_what_is_known() -> None:
    """A known cause at its known strength is in order; stronger, elsewhere, beside other trouble, or moved parameters are not."""
    baseline = _baseline()
    assert against(_found(0.51), baseline).status == "ok"
    for changed, says in ((_found(0.6), "cogging:2 amplitude"), (_found(0.5, joint=3), "cogging:3"), (_found(0.5, p1=1.1), "p1")):
        judged = against(changed, baseline)
        assert judged.status == "found"
        assert says in judged.verdict
    assert against(_found(0.5, accepts=False), baseline).status == "found"
    rejected = Record("a", "a", "rejected", 3)
    assert against(rejected, baseline) is rejected
    other = dataclasses.replace(baseline, robot='name = "another"')
    assert against(_found(0.5, joint=3), other) == _found(0.5, joint=3)


def _known(record: Record, **more: Any) -> Record:
    """The same item, of which more is known."""
    return dataclasses.replace(record, parts=tuple(dataclasses.replace(part, **more) for part in record.parts))


def test_friction_is_held_against_the_baseline_by_any_name() -> None:
    """A run says "extend model viscous joint 1 …", estimate-bps "viscous:1:…": moved, it is found, and told once."""
    viscous = StoredEffect("viscous", 1, {"coefficient_2": StoredValue(0.6, 0.01, "N m s/rad", "fitted")})
    baseline = dataclasses.replace(_baseline(), friction=(viscous,))
    for name in ("viscous:1:coefficient_2", "extend model viscous joint 1 coefficient 2"):
        for value, status in ((0.61, "ok"), (0.9, "found")):
            record = _record("a", figures={"estimate-bps p1": (9.0, STD, ""), "extend p1": (1.0, STD, "kg m^2"),
                                           name: (value, 0.01, "N m s/rad")})
            judged = against(record, baseline)
            assert judged.status == status
            assert judged.verdict.count("coefficient") == (status == "found")
    (stronger,) = _found(0.6).parts
    told = _known(_found(0.6), figures={**stronger.figures, "extend model cogging joint 2 amplitude": (0.6, 0.01, "N m")})
    assert against(told, baseline).verdict.count("amplitude") == 1


def test_what_no_item_can_be_held_against_is_said() -> None:
    """A diagnosis names causes, and gives no base parameters and no friction; estimate-bps no effects: silence is no agreement."""
    viscous = StoredEffect("viscous", 1, {"coefficient": StoredValue(0.6, 0.01, "N m s/rad", "fitted")})
    baseline = dataclasses.replace(_baseline(), friction=(viscous,))
    diagnosed = _record("a", robot="arm", diagnosed=True)
    (said,) = unheld("diagnose", [diagnosed], baseline)
    assert (said.level, said.where, said.gate) == ("warn", "--baseline", False)
    assert "of the baseline, base parameters and friction met nothing to be held against: diagnose names none" in said.message
    figures = {"p1": (1.0, STD, "kg m^2")}
    estimated = _record("b", figures=figures, robot="arm")
    (said,) = unheld("estimate-bps", [estimated], baseline)
    assert ("baseline, friction and effects met" in said.message, said.gate) == (True, False)
    assert ["baseline, friction met" in one.message for one in unheld("run", [diagnosed, estimated], baseline)] == [True]
    whole = _known(estimated, figures=figures | {"viscous:1:coefficient": (0.6, 0.01, "N m s/rad")})
    assert unheld("run", [whole, diagnosed], baseline) == ()
    extended = _known(whole, figures={**whole.parts[0].figures, "cogging joint 2 amplitude": (0.5, 0.01, "N m")})
    assert unheld("simulate", [extended], baseline) == ()
    assert unheld("run", [Record("a", "a", "rejected", 3)], baseline) == ()


def test_a_level_beside_another_law_is_not_the_same_level() -> None:
    """Coulomb friction fitted with Stribeck friction and without: 3.65 and 3.93 N m of one and the same joint. It is said, and no
    change; with the same laws it is one."""
    laws = {"coulomb": ("level", 3.65), "stribeck": ("amplitude", 1.06)}
    friction = tuple(StoredEffect(law, 1, {name: StoredValue(value, 0.014, "N m", "fitted")})
                     for law, (name, value) in laws.items())
    baseline = dataclasses.replace(_baseline(), friction=friction, effects=())
    figures = {"p1": (1.0, STD, "kg m^2"), "coulomb:1:level": (3.93, 0.01, "N m")}
    alone = _record("a", figures=figures)
    assert against(alone, baseline) == alone
    (said,) = unheld("estimate-bps", [alone], baseline)
    assert not said.gate
    assert "the friction of joint 1 follows other laws: it has Stribeck friction, and estimate-bps fits none" in said.message
    both = _known(alone, figures=figures | {"stribeck:1:amplitude": (1.06, 0.02, "N m")})
    assert against(both, baseline).status == "found"
    assert unheld("run", [both], baseline) == ()


def test_a_baseline_that_meets_nothing_is_a_gate() -> None:
    """Another robot's, a stage without figures, a model without uncertainties: what was asked for cannot be done at all."""
    baseline = dataclasses.replace(_baseline(), robot='name = "arm"')
    mine, other = (_record(name, figures={"p1": (1.0, STD, "kg m^2")}, robot=name, diagnosed=True)
                   for name in ("arm", "another"))
    silent = _record("silent", robot="arm")
    given = dataclasses.replace(baseline, effects=(), base_parameters=(
        StoredParameter("p1", 1.0, None, "kg m^2", True, "given", "J"),))
    for stage, records, model, words in (
            ("run", [other], baseline, "the baseline is of arm, and no item is"),
            ("inspect", [silent], baseline, "base parameters and effects met nothing"),
            ("estimate-bps", [_known(mine, diagnosed=False)], given, "no number with an uncertainty")):
        (said,) = unheld(stage, records, model)
        assert words in said.message
        assert said.gate
    (said,) = unheld("run", [mine, other], baseline)
    assert said.message == "1 of 2 items are of another robot than the baseline, and not held against it: another"
    assert not said.gate
    assert unheld("diagnose", [_known(mine, figures={})], given) == ()


def test_a_shard_may_hold_another_robots_items_alone() -> None:
    """What the other shards hold nobody knows here: said, and no gate. Where all are looked at, it is one."""
    baseline = dataclasses.replace(_baseline(), robot='name = "arm"')
    other = _record("another", figures={"p1": (1.0, STD, "kg m^2")}, robot="another", diagnosed=True)
    (said,) = unheld("run", [other], baseline, sharded=True)
    assert (said.gate, "no item of this shard is" in said.message, "--resume" in said.remedy) == (False, True, True)
    (said,) = unheld("inspect", [_record("silent", robot="arm")], baseline, sharded=True)
    assert said.gate  # no shard's items would be held against it: the stage names nothing of it


def test_a_known_cause_that_is_gone_is_told() -> None:
    """Where so strong a one would have been found, it is a change; where these logs would not show it, it is said. One that the
    reference logs show as well is there."""
    baseline = _baseline()  # cogging at joint 2 with 0.5 N m, known to 0.01
    quiet = _record("a", figures={"p1": (1.0, STD, "kg m^2")}, diagnosed=True, detectable={"cogging:2": ("amplitude", 0.04)})
    judged = against(quiet, baseline)
    assert judged.status == "found"
    assert "cogging:2 is not found any more: amplitude 0.5 N m before, and from 0.04 N m on" in judged.verdict
    for least in (0.48, 0.6):  # 0.5 less 3 std is 0.47
        deaf = against(_known(quiet, detectable={"cogging:2": ("amplitude", least)}), baseline)
        assert deaf.status == "ok"
        assert "cogging:2 is not found, and might be there" in deaf.verdict
    assert against(_known(quiet, standing=("cogging:2",)), baseline) == _known(quiet, standing=("cogging:2",))
    assert against(_known(quiet, diagnosed=False), baseline).verdict == ""


def _run(name: str, robot: str, amplitude: float | None, p1: float = 1.0) -> dict[str, Any]:
    """What result.json has of one of several robots: a cause or none, and a fitted figure."""
    finding = {"cause": "cogging", "joint": 2, "parameters": {"amplitude": {"value": amplitude, "std": 0.01, "unit": "N m"}}}
    findings = [] if amplitude is None else [finding]
    least = [{"cause": "cogging", "joint": 2, "parameter": "amplitude", "smallest": {"value": 0.04, "std": None, "unit": "N m"}}]
    figure = {"name": "p1", "value": p1, "std": STD, "unit": "kg m^2"}
    estimated = {"name": "estimate-bps", "exit": 0, "result": {"robot": robot, "parameters": [figure]}}
    return {"name": name, "stages": [estimated], "verdict": "cause" if findings else "nothing-wrong", "findings": findings,
            "standing": [], "detectable": least}


def test_several_robots_in_one_folder_are_held_against_the_baseline() -> None:
    """What `runs` say of the baseline's robot is judged, each day by itself; another robot's is not."""
    baseline = dataclasses.replace(_baseline(), robot='name = "arm"')

    def item(*runs: dict[str, Any], accepts: bool = True) -> Record:
        status: Status = "found" if any(run["findings"] for run in runs) else "ok"
        return Record("a", "a", status, 1, parts=parts_of({"stages": [], "runs": runs}, "several", "2026-01-01"), accepts=accepts)

    known = item(_run("arm 2026-01-05", "arm", 0.5), _run("other", "other", None))
    assert [(part.robot, part.recorded, list(part.figures)) for part in known.parts] == [
        ("arm", "2026-01-05", ["estimate-bps p1"]), ("other", "2026-01-01", ["estimate-bps p1"])]
    assert against(known, baseline).status == "ok"
    (said,) = unheld("run", [known], baseline)
    assert said.message == "1 of 2 items are of another robot than the baseline, and not held against it: a: other"
    for record, says in ((item(_run("arm", "arm", 0.6), _run("other", "other", None)), "arm: cogging:2 amplitude 0.6 N m"),
                         (item(_run("arm", "arm", 0.5, 1.2)), "arm: estimate-bps p1 1.2"),
                         (item(_run("day 1", "arm", 0.5), _run("day 2", "arm", None)), "day 2: cogging:2 is not found any more")):
        judged = against(record, baseline)
        assert judged.status == "found"
        assert judged.verdict.startswith(f"Beyond the baseline: {says}")
    strange = item(_run("arm", "arm", 0.5), _run("other", "other", 0.5))
    assert against(strange, baseline) == strange  # nobody knows that cause of the other one
    days = drift_of([known, item(_run("arm 2026-01-04", "arm", None, 1.5)), item(_run("arm 2026-01-03", "arm", None))])
    assert [(one.robot, one.figures[0].items) for one in days] == [("arm", ("a: arm 2026-01-03", "a: arm 2026-01-04",
                                                                            "a: arm 2026-01-05"))]


def test_a_phase_is_the_same_after_a_whole_turn() -> None:
    """3.1 rad and -3.1 rad are 0.08 rad apart."""
    effect = StoredEffect("cogging", 2, {"phase": StoredValue(3.1, 0.05, "rad", "fitted")})
    finding = {"cause": "cogging", "joint": 2, "parameters": {"phase": {"value": -3.1, "std": 0.05, "unit": "rad"}}}
    record = _record("a", "found", True, findings=(finding,), diagnosed=True)
    baseline = dataclasses.replace(_baseline(), effects=(effect,))
    assert against(record, baseline).status == "ok"
    other = {"cause": "cogging", "joint": 2, "parameters": {"phase": {"value": -2.0, "std": 0.05, "unit": "rad"}}}
    assert against(_known(record, findings=(other,)), baseline).status == "found"


def test_a_run_against_a_baseline_fails_for_changes_alone(lay: Lay, tmp_path: Path) -> None:
    """--check with --baseline: 0 while every figure is within its uncertainty, 1 when one item's is beyond."""
    from pipelines.log.model_file import write_model

    rrr = (Path(__file__).parents[2] / "sample_logs/robots/rrr.toml").read_text()
    write_model(tmp_path / "model.json", ModelFile("known", rrr, _baseline().base_parameters))
    root = lay({f"{i}": f"value {1.0 + 0.01 * i} std {STD}" for i in range(3)})
    assert obey(root, baseline=str(tmp_path / "model.json"), check=True).exit_code == 0
    outcome = obey(lay({"1": f"value 1.3 std {STD}"}), baseline=str(tmp_path / "model.json"), check=True)
    assert outcome.json["checks"] == []
    viscous = StoredEffect("viscous", 1, {"coefficient": StoredValue(0.6, 0.01, "N m s/rad", "fitted")})
    write_model(tmp_path / "friction.json", ModelFile("known", rrr, _baseline().base_parameters, friction=(viscous,)))
    (said,) = obey(root, baseline=str(tmp_path / "friction.json")).checks
    assert said.message.startswith("of the baseline, friction met nothing")
    write_model(tmp_path / "other.json", ModelFile("other", rrr.replace("rrr-tue", "rrr-other"), _baseline().base_parameters))
    for check in (False, True):
        unmet = obey(root, baseline=str(tmp_path / "other.json"), check=check)
        assert unmet.exit_code == 5  # as where a pattern matches no log, and `compare` no figure
        assert unmet.report.verdict.startswith("Nothing was held against the baseline.")
    (case,) = [one for one in ElementTree.parse(unmet.folder / "junit.xml").iter("testcase") if one.get("name") == "--baseline"]
    assert [wrong.tag for wrong in case] == ["error"]
    assert obey(lay({"2": "reject"}), baseline=str(tmp_path / "other.json")).exit_code == 4
    assert outcome.exit_code == 1
    assert {item["name"]: item["status"] for item in outcome.json["items"]} == {"0": "ok", "1": "found", "2": "ok"}
    assert outcome.json["drift"][0]["figures"][0]["moved"] == ["1"]


def test_the_page_says_figures_in_words_and_the_file_has_their_keys() -> None:
    """coulomb:3:level is "Coulomb friction at joint 3, level" for who reads; what moved beyond chance is worth a look, what
    scatters is in order."""
    rng = np.random.default_rng(6)
    for step, tone in ((0.0, "good"), (8.0, "attention")):
        values = 1.0 + STD * rng.normal(size=8)
        values[3] += step * STD
        records = tuple(_record(f"day {k}", figures={"coulomb:3:level": (float(x), STD, "N m")}, robot="arm")
                        for k, x in enumerate(values))
        drifts = drift_of(records)
        page = summary_report(Summary("estimate-bps", records, drifts))
        (table,) = next(section.tables for section in page.sections if section.title == "Drift of arm")
        assert (page.tone, table.rows[0][0]) == (tone, "Coulomb friction at joint 3, level")
        assert drifts[0].figures[0].name == "coulomb:3:level"
        assert ("Coulomb friction at joint 3, level: " in page.verdict) is (step > 0.0)


def test_the_summary_table_holds_every_figure(lay: Lay) -> None:
    """summary.parquet, one row a figure, for whoever wants to plot it: with value, std, unit, and how far it is away."""
    import pyarrow.parquet as pq

    outcome = obey(lay({"a": "value 1 std 0.1 rms 0.3", "b": "value 2 std 0.1 rms 0.3", "c": "reject"}))
    rows = pq.read_table(outcome.folder / "summary.parquet").to_pylist()
    assert [(row["item"], row["status"], row["quantity"], row["value"], row["std"], row["unit"]) for row in rows] == [
        ("a", "ok", "p1", 1.0, 0.1, "kg m^2"), ("a", "ok", "torque rms joint 1", 0.3, None, "N m"),
        ("b", "ok", "p1", 2.0, 0.1, "kg m^2"), ("b", "ok", "torque rms joint 1", 0.3, None, "N m"),
        ("c", "rejected", None, None, None, None)]
    assert rows[0]["away"] == pytest.approx(-1.0 / np.sqrt(0.02))
    stored = json.loads((outcome.folder / "result.json").read_text())
    assert stored["counts"] == {"ok": 2, "found": 0, "rejected": 1, "failed": 0}
    jsonschema.validate(stored, result_schema(Result, "batch"))
