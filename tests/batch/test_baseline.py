"""Held against a known model, an item is found for what is new or has changed; what cannot be held against it is said."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from pipelines.batch.baseline import against, unheld
from pipelines.batch.drift import drift_of
from pipelines.batch.parts import part_of
from pipelines.batch.record import Record, Status
from pipelines.io.model_file import ModelFile, StoredEffect, StoredParameter, StoredValue
from tests.batch.conftest import Lay, obey
from tests.batch.records import STD, item_of


def _baseline() -> ModelFile:
    cogging = StoredEffect("cogging", 2, {"amplitude": StoredValue(0.5, 0.01, "N m", "fitted")})
    return ModelFile("known", "", (StoredParameter("p1", 1.0, STD, "kg m^2", True, "fitted", "J"),), effects=(cogging,))


def _found(amplitude: float, joint: int = 2, p1: float = 1.0, accepts: bool = True) -> Record:
    finding = {"cause": "cogging", "joint": joint, "parameters": {"amplitude": {"value": amplitude, "std": 0.01, "unit": "N m"}}}
    return item_of("a", "found", accepts, figures={"p1": (p1, STD, "kg m^2")}, findings=(finding,), diagnosed=True)


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
    assert record.part is not None
    return dataclasses.replace(record, part=dataclasses.replace(record.part, **more))


def test_friction_is_held_against_the_baseline_by_any_name() -> None:
    """A run says "extend model viscous joint 1 …", estimate-bps "viscous:1:…": moved, it is found, and told once."""
    viscous = StoredEffect("viscous", 1, {"coefficient_2": StoredValue(0.6, 0.01, "N m s/rad", "fitted")})
    baseline = dataclasses.replace(_baseline(), friction=(viscous,))
    for name in ("viscous:1:coefficient_2", "extend model viscous joint 1 coefficient 2"):
        for value, status in ((0.61, "ok"), (0.9, "found")):
            record = item_of("a", figures={"estimate-bps p1": (9.0, STD, ""), "extend p1": (1.0, STD, "kg m^2"),
                                           name: (value, 0.01, "N m s/rad")})
            judged = against(record, baseline)
            assert judged.status == status
            assert judged.verdict.count("coefficient") == (status == "found")
    stronger = _found(0.6).part
    assert stronger is not None
    told = _known(_found(0.6), figures={**stronger.figures, "extend model cogging joint 2 amplitude": (0.6, 0.01, "N m")})
    assert against(told, baseline).verdict.count("amplitude") == 1


def test_what_no_item_can_be_held_against_is_said() -> None:
    """A diagnosis names causes, and gives no base parameters and no friction; estimate-bps no effects: silence is no agreement."""
    viscous = StoredEffect("viscous", 1, {"coefficient": StoredValue(0.6, 0.01, "N m s/rad", "fitted")})
    baseline = dataclasses.replace(_baseline(), friction=(viscous,))
    diagnosed = item_of("a", robot="arm", diagnosed=True)
    (said,) = unheld("diagnose", [diagnosed], baseline)
    assert (said.level, said.where, said.gate) == ("warn", "--baseline", False)
    assert "of the baseline, base parameters and friction met nothing to be held against: diagnose names none" in said.message
    figures = {"p1": (1.0, STD, "kg m^2")}
    estimated = item_of("b", figures=figures, robot="arm")
    (said,) = unheld("estimate-bps", [estimated], baseline)
    assert ("baseline, friction and effects met" in said.message, said.gate) == (True, False)
    assert ["baseline, friction met" in one.message for one in unheld("run", [diagnosed, estimated], baseline)] == [True]
    whole = _known(estimated, figures=figures | {"viscous:1:coefficient": (0.6, 0.01, "N m s/rad")})
    assert unheld("run", [whole, diagnosed], baseline) == ()
    extended = _known(whole, figures={**whole.part.figures, "cogging joint 2 amplitude": (0.5, 0.01, "N m")})
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
    alone = item_of("a", figures=figures)
    assert against(alone, baseline) == alone
    (said,) = unheld("estimate-bps", [alone], baseline)
    assert not said.gate
    assert "the friction of joint 1 follows other laws: it has Stribeck friction, and estimate-bps fits none" in said.message
    both = _known(alone, figures=figures | {"stribeck:1:amplitude": (1.06, 0.02, "N m")})
    assert against(both, baseline).status == "found"
    assert unheld("run", [both], baseline) == ()


def test_a_level_beside_a_law_that_the_baseline_lacks_is_not_the_same_level() -> None:
    """The other way round: a baseline of Coulomb friction alone, 3.93 N m, and Stribeck friction beside it in what is held to it.
    Not where another stage alone has fitted that law, or the baseline has it as an effect; a law that was found is told as new."""
    coulomb = StoredEffect("coulomb", 1, {"level": StoredValue(3.93, 0.014, "N m", "fitted")})
    stribeck = StoredEffect("stribeck", 1, {"amplitude": StoredValue(1.06, 0.02, "N m", "fitted")})
    baseline = dataclasses.replace(_baseline(), friction=(coulomb,), effects=())
    for level, law in (("coulomb:1:level", "stribeck:1:amplitude"),
                       ("extend model coulomb joint 1 level", "extend model stribeck joint 1 amplitude")):
        figures = {"p1": (1.0, STD, "kg m^2"), level: (3.65, 0.01, "N m")}
        both = item_of("a", figures=figures | {law: (1.06, 0.02, "N m")})
        assert against(both, baseline) == both
        (said,) = unheld("run", [both], baseline)
        assert "the friction of joint 1 follows other laws: run fits Stribeck friction, and it has none" in said.message
        finding = {"cause": "stribeck", "joint": 1, "parameters": {}}
        for other, model in ((item_of("a", figures=figures), baseline),
                             (_known(both, findings=(finding,)), baseline),
                             (both, dataclasses.replace(baseline, effects=(stribeck,))),
                             (item_of("a", figures=figures | {"fit-friction j stribeck joint 1 amplitude": (1.06, 0.02, "N m")}),
                              baseline)):
            assert "level 3.65 N m, 3.93 before" in against(other, model).verdict
            assert not any("other laws" in one.message for one in unheld("run", [other], model))


def test_a_baseline_that_meets_nothing_is_a_gate() -> None:
    """Another robot's, a stage without figures, a model without uncertainties: what was asked for cannot be done at all."""
    baseline = dataclasses.replace(_baseline(), robot='name = "arm"')
    mine, other = (item_of(name, figures={"p1": (1.0, STD, "kg m^2")}, robot=name, diagnosed=True)
                   for name in ("arm", "another"))
    silent = item_of("silent", robot="arm")
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
    other = item_of("another", figures={"p1": (1.0, STD, "kg m^2")}, robot="another", diagnosed=True)
    (said,) = unheld("run", [other], baseline, sharded=True)
    assert (said.gate, "no item of this shard is" in said.message, "--resume" in said.remedy) == (False, True, True)
    (said,) = unheld("inspect", [item_of("silent", robot="arm")], baseline, sharded=True)
    assert said.gate  # no shard's items would be held against it: the stage names nothing of it


def test_a_known_cause_that_is_gone_is_told() -> None:
    """Where so strong a one would have been found, it is a change; where these logs would not show it, it is said. One that the
    reference logs show as well is there."""
    baseline = _baseline()  # cogging at joint 2 with 0.5 N m, known to 0.01
    quiet = item_of("a", figures={"p1": (1.0, STD, "kg m^2")}, diagnosed=True, detection_limits={"cogging:2": ("amplitude", 0.04)})
    judged = against(quiet, baseline)
    assert judged.status == "found"
    assert "cogging:2 is not found any more: amplitude 0.5 N m before, and from 0.04 N m on" in judged.verdict
    for least in (0.48, 0.6):  # 0.5 less 3 std is 0.47
        deaf = against(_known(quiet, detection_limits={"cogging:2": ("amplitude", least)}), baseline)
        assert deaf.status == "ok"
        assert "cogging:2 is not found, and might be there" in deaf.verdict
    assert against(_known(quiet, baseline_effects=("cogging:2",)), baseline) == _known(quiet, baseline_effects=("cogging:2",))
    assert against(_known(quiet, diagnosed=False), baseline).verdict == ""


def test_what_the_baseline_cannot_tell_from_nothing_is_not_missed() -> None:
    """An offset of 0.22 ± 0.11 N m, which estimate-bps fits with the rest, is no cause that could go; one of 0.22 ± 0.01 is."""
    for std, status in ((0.11, "ok"), (0.01, "found")):
        offset = StoredEffect("torque_offset", 2, {"offset": StoredValue(0.22, std, "N m", "fitted")})
        baseline = dataclasses.replace(_baseline(), effects=(offset,))
        silent = item_of("a", figures={"p1": (1.0, STD, "kg m^2")}, diagnosed=True,
                         detection_limits={"torque_offset:2": ("offset", 0.025)})
        assert against(silent, baseline).status == status
        deaf = _known(silent, detection_limits={})
        assert ("torque_offset:2" in against(deaf, baseline).verdict) is (status == "found")


def test_where_something_has_no_name_no_cause_is_gone() -> None:
    """A diagnosis that names nothing, for what it met is none of the causes, does not say that one is over; that something is wrong
    stands first, with changes and without."""
    said = "Something is wrong that has no name."
    unnamed = dataclasses.replace(
        item_of("a", "found", figures={"p1": (1.0, STD, "kg m^2")}, diagnosed=True, verdict="unknown",
                detection_limits={"cogging:2": ("amplitude", 0.04)}), verdict=said)
    judged = against(unnamed, _baseline())
    assert judged.status == "found"
    assert judged.verdict.startswith(f"{said} Of the baseline: cogging:2 is not found, and might be there")
    moved = against(_known(unnamed, figures={"p1": (1.2, STD, "kg m^2")}), _baseline())
    assert moved.verdict.startswith(f"{said} Beyond the baseline: p1 1.2 kg m²")
    assert "not found any more" not in judged.verdict + moved.verdict
    unknown = {"verdict": "unknown", "findings": [], "detection_limits": []}
    assert part_of(unknown, "arm", "2026-01-01").verdict == "unknown"


def _run(amplitude: float | None, p1: float = 1.0) -> dict[str, Any]:
    """What result.json has of a run: a cause or none, and a fitted figure."""
    finding = {"cause": "cogging", "joint": 2, "parameters": {"amplitude": {"value": amplitude, "std": 0.01, "unit": "N m"}}}
    findings = [] if amplitude is None else [finding]
    least = [{"cause": "cogging", "joint": 2, "parameter": "amplitude", "minimum": {"value": 0.04, "std": None, "unit": "N m"}}]
    figure = {"name": "p1", "value": p1, "std": STD, "unit": "kg m^2"}
    estimated = {"name": "estimate-bps", "exit": 0, "result": {"parameters": [figure]}}
    return {"stages": [estimated], "verdict": "cause" if findings else "no-fault-found", "findings": findings,
            "baseline_effects": [], "detection_limits": least}


def test_only_items_of_the_baselines_robot_are_held_against_it() -> None:
    """What a run of that robot says is judged, day by day; another robot's is not."""
    baseline = dataclasses.replace(_baseline(), robot='name = "arm"')

    def item(name: str, run: dict[str, Any], robot: str = "arm", recorded: str = "") -> Record:
        status: Status = "found" if run["findings"] else "ok"
        return Record(name, name, status, 1, part=part_of(run, robot, recorded), accepts=True)

    known, other = item("a: arm", _run(0.5), recorded="2026-01-05"), item("a: other", _run(0.5), "other")
    assert against(known, baseline).status == "ok"
    assert against(other, baseline) == other  # nobody knows that cause of the other one
    (said,) = unheld("run", [known, other], baseline)
    assert said.message == "1 of 2 items are of another robot than the baseline, and not held against it: a: other"
    for run, says in ((_run(0.6), "cogging:2 amplitude 0.6 N m"), (_run(0.5, 1.2), "estimate-bps p1 1.2"),
                      (_run(None), "cogging:2 is not found any more")):
        judged = against(item("a", run), baseline)
        assert judged.status == "found"
        assert judged.verdict.startswith(f"Beyond the baseline: {says}")
    days = drift_of([known, item("b", _run(None, 1.5), recorded="2026-01-04"), item("c", _run(None), recorded="2026-01-03"), other])
    assert [(one.robot, one.figures[0].items) for one in days] == [("arm", ("c", "b", "a: arm"))]


def test_a_phase_is_the_same_after_a_whole_turn() -> None:
    """3.1 rad and -3.1 rad are 0.08 rad apart."""
    effect = StoredEffect("cogging", 2, {"phase": StoredValue(3.1, 0.05, "rad", "fitted")})
    finding = {"cause": "cogging", "joint": 2, "parameters": {"phase": {"value": -3.1, "std": 0.05, "unit": "rad"}}}
    record = item_of("a", "found", True, findings=(finding,), diagnosed=True)
    baseline = dataclasses.replace(_baseline(), effects=(effect,))
    assert against(record, baseline).status == "ok"
    other = {"cause": "cogging", "joint": 2, "parameters": {"phase": {"value": -2.0, "std": 0.05, "unit": "rad"}}}
    assert against(_known(record, findings=(other,)), baseline).status == "found"


def test_a_run_against_a_baseline_fails_for_changes_alone(lay: Lay, tmp_path: Path) -> None:
    """--check with --baseline: 0 while every figure is within its uncertainty, 1 when one item's is beyond."""
    from pipelines.io.model_file import write_model

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
