"""What moved from item to item is told, and what only scattered is not."""

from __future__ import annotations

import json
from collections.abc import Iterable

import jsonschema
import numpy as np
import pytest

from pipelines.batch import result_of
from pipelines.estimation.drift import DriftFigure, Session, drift_of, from_others
from pipelines.executor import Record
from pipelines.io.results import result_schema
from pipelines.report.batch_report import DoneItem, Result, batch_report
from pipelines.report.report import Report
from pipelines.report.result_figures import fitted, residuals
from tests.batch.conftest import Lay, obey
from tests.batch.records import STD, item_of


def _records(values: np.ndarray) -> list[Session]:
    """Items recorded one a day, in an order that is not that of their names."""
    order = np.random.default_rng(0).permutation(len(values))
    return [item_of(f"item {order[i]:03d}", figures={"p1": (float(value), STD, "kg m^2")}, robot="arm",
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


def test_a_phase_that_scatters_about_half_a_turn_has_not_moved() -> None:
    """3.1, -3.1, … rad are next to each other; one a radian on has moved, and the values stand as they were written."""
    def course(values: list[float], name: str = "extend model cogging joint 2 phase") -> DriftFigure:
        records = [item_of(str(k), figures={name: (value, 0.05, "rad")}, robot="arm") for k, value in enumerate(values)]
        return drift_of(records)[0].figures[0]

    near = course([3.1, -3.13, 3.14, -3.1, 3.12])
    assert (near.moved, list(near.value)) == ((), [3.1, -3.13, 3.14, -3.1, 3.12])
    assert near.probability is not None
    assert near.probability > 0.1
    assert abs(near.trend) < 3.0
    assert course([3.1, -3.13, 3.14, -2.1, 3.12]).moved == ("3",)
    assert course([3.1, -3.13, 3.14, -3.1, 3.12], "model spring joint 2 rest angle").moved


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
        records = [item_of(str(i), residuals={"torque rms": (value, "N m")}, robot="arm")
                   for i, value in enumerate(values)]
        return drift_of(records)[0].residuals[0].moved

    assert course([0.10, 0.11, 0.09, 1.0, 0.105, 0.095]) == ("3",)
    assert course([0.10, 0.11, 0.09, 1.0]) == ()


def test_robots_are_not_mixed() -> None:
    """Two arms differ by nature."""
    records = [item_of(f"{robot}{i}", figures={"p1": (value, STD, "kg m^2")}, robot=robot)
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


def test_the_page_says_figures_in_words_and_the_file_has_their_keys() -> None:
    """coulomb:3:level is "Coulomb friction at joint 3, level" for who reads; what moved beyond chance is worth a look, what
    scatters is in order."""
    rng = np.random.default_rng(6)
    for step, tone in ((0.0, "good"), (8.0, "attention")):
        values = 1.0 + STD * rng.normal(size=8)
        values[3] += step * STD
        records = tuple(item_of(f"day {k}", figures={"coulomb:3:level": (float(x), STD, "N m")}, robot="arm")
                        for k, x in enumerate(values))
        drifts = drift_of(records)
        page = _page(records)
        (table,) = next(section.tables for section in page.sections if section.title == "Drift of arm")
        assert (page.tone, table.rows[0][0]) == (tone, "Coulomb friction at joint 3, level")
        assert drifts[0].figures[0].name == "coulomb:3:level"
        assert ("Coulomb friction at joint 3, level: " in page.verdict) is (step > 0.0)


def _page(sessions: Iterable[Session], figures: bool = True) -> Report:
    """Of a batch of these sessions."""
    records = [Record(DoneItem(one.name, "ok", None, "", 0, one.robot, None, None), one.name, one.figures) for one in sessions]
    return batch_report(result_of("estimate-bps", records, []), figures=figures)


def _tone(values: np.ndarray) -> str:
    """Of the page of a batch whose items have these values."""
    records = tuple(item_of(f"{k:03d}", figures={"p1": (float(x), STD, "kg m^2")}, robot="arm") for k, x in enumerate(values))
    return _page(records, figures=False).tone


def test_one_item_among_hundreds_is_not_lost_in_them() -> None:
    """One of 50 at 6 std, of 200 at 10: χ² of the whole course hardly sees it, and the batch is no less worth a look."""
    rng = np.random.default_rng(7)
    for count, step in ((50, 6.0), (200, 10.0)):
        values = 1.0 + STD * rng.normal(size=count)
        values[count // 3] += step * STD
        assert _tone(values) == "attention"


def test_hundreds_of_items_that_scatter_are_in_order() -> None:
    """One of 200 is beyond 3 std by chance in four batches of ten; the page calls something moved in one of a hundred."""
    rng = np.random.default_rng(8)
    tones = [_tone(1.0 + STD * rng.normal(size=200)) for _ in range(100)]
    assert tones.count("attention") <= 4  # of 100 with 0.01 each, more come once in 300 times


def test_a_little_in_every_item_is_not_lost_either() -> None:
    """Every item 1.7 std to one side or the other, and one at 3.7, as there may be among so many: together they have moved."""
    values = 1.0 + 1.7 * STD * np.resize([1.0, -1.0], 200)
    values[0] += 2.0 * STD
    assert _tone(values) == "attention"


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
