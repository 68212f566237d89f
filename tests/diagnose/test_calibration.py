"""Thresholds are stored with where they come from, give the same answer again without a twin, and are refused for other logs."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from pipelines import diagnose, run
from pipelines.errors import InputRejected, RrridError, UsageError
from pipelines.log.files import hash_file
from pipelines.log.model_file import read_model, write_model
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.floor.calibrated import refuse_calibration
from pipelines.model.diagnosis.floor.calibration import Calibration
from pipelines.model.diagnosis.floor.calibration_file import calibration_schema, read_calibration, write_calibration
from pipelines.model.effects.coulomb import Coulomb
from pipelines.stage import Inputs, Outcome, Request, run_stage
from rrrid_cli.settings import make_settings
from tests.diagnose.sessions import but, session, written

STAGES = tuple(module.replace("_", "-") for module in run.STEPS)
FEW = but("cogging", "torque_offset", "gravity_tilt", "encoder_eccentricity")  # the last two act on several joints


def asked(folder: Path, out: Path, **settings: object) -> Outcome[diagnose.Result]:
    chosen = diagnose.Settings(**({"without": FEW, "replicas": 2, "most": 1} | settings))  # type: ignore[arg-type]
    return run_stage(diagnose.STAGE, Request((folder,), out=out, no_report=True), chosen)


def without_origin(value: Any) -> Any:
    """A result without the words of where its thresholds come from."""
    if isinstance(value, dict):
        return {key: without_origin(one) for key, one in value.items() if key not in ("origin", "calibrated_with")}
    return [without_origin(one) for one in value] if isinstance(value, list) else value


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of an arm with cogging at joint 2, and their diagnosis with a twin."""
    place = tmp_path_factory.mktemp("calibration")
    asked(written(place / "logs", session("cogging", 2)), place / "first")
    return place


@pytest.fixture(scope="module")
def again(place: Path) -> Outcome[diagnose.Result]:
    """The same logs by the thresholds that the first diagnosis has stored."""
    return asked(place / "logs", place / "again", calibration=str(place / "first"))


@pytest.mark.slow
def test_stored_thresholds_give_the_same_answer(place: Path, again: Outcome[diagnose.Result]) -> None:
    """Every figure and every series, the origin apart; and the calibration is handed on as it is."""
    first, second = (json.loads((place / name / "result.json").read_text()) for name in ("first", "again"))
    assert without_origin(first) == without_origin(second)
    for name in ("result.h5", "calibration.json", "calibration.h5"):
        assert hash_file(place / "first" / name) == hash_file(place / "again" / name)
    assert again.result.calibrated_with == ("excitation-1",)
    assert {one.origin for one in again.result.thresholds} == {"2 replicas of the twin, stored by an earlier diagnosis"}
    said = [text for section in again.report.sections for text in section.text]
    assert any("An earlier diagnosis has stored them" in text for text in said)


@pytest.mark.slow
def test_a_cause_of_the_whole_arm_may_be_left_out_later(place: Path, again: Outcome[diagnose.Result]) -> None:
    """The others are held against what they were held against with it."""
    fewer = asked(place / "logs", place / "fewer", calibration=str(place / "first"), without=(*FEW, "gravity_tilt"))
    kept = {(one.cause, one.joint): one.gain for one in again.result.thresholds if one.cause != "gravity_tilt"}
    assert {(one.cause, one.joint): one.gain for one in fewer.result.thresholds} == kept
    assert [one.cause for one in fewer.result.findings] == ["cogging"]


def test_the_file_says_where_thresholds_come_from(place: Path) -> None:
    """Logs by their digests, model, replicas, seed and versions; and it is what its schema says."""
    stored = json.loads((place / "first/calibration.json").read_text())
    jsonschema.validate(stored, calibration_schema())
    older = {name: item for name, item in stored.items() if name != "following"}
    (place / "older").mkdir()
    (place / "older/calibration.json").write_text(json.dumps(older))
    shutil.copy(place / "first/calibration.h5", place / "older")
    assert read_calibration(place / "older").following is None
    jsonschema.validate(older, calibration_schema())
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({name: item for name, item in stored.items() if name != "floor"}, calibration_schema())
    origin = stored["origin"]
    assert (origin["kind"], origin["replicas"], origin["seed"]) == ("twin", 2, 1)
    assert [len(log["sha256"]) for log in origin["logs"]] == [64]
    assert len(origin["model"]) == 64
    assert {"version", "numpy", "without"} <= set(origin)
    assert {one["cause"] for one in stored["causes"]} == {"cogging", "torque_offset", "gravity_tilt", "encoder_eccentricity"}
    provenance = json.loads((place / "first/provenance.json").read_text())
    assert provenance["outputs"]["calibration.json"] == hash_file(place / "first/calibration.json")


def test_reading_gives_back_what_was_written(place: Path, tmp_path: Path) -> None:
    made = read_calibration(place / "first")
    write_calibration(tmp_path, made)
    assert (tmp_path / "calibration.json").read_bytes() == (place / "first/calibration.json").read_bytes()
    assert made.wide is not None
    own = [(f"encoder_eccentricity:{joint}", joint) for joint in (1, 2, 3)]
    assert [(one.place, one.joint) for one in made.wide.causes] == [("", None), *own]


@pytest.mark.slow
def test_one_of_an_older_version_knows_causes_of_the_whole_arm_alone(place: Path, again: Outcome[diagnose.Result],
                                                                     tmp_path: Path) -> None:
    """It is read, and the others are held against what grows with the weight of their joint, as they were then."""
    stored = json.loads((place / "first/calibration.json").read_text())
    of_arm = [one for one in stored["wide"]["causes"] if one["joint"] is None]
    causes = [{name: item for name, item in one.items() if name not in ("place", "joint")} for one in of_arm]
    older = stored | {"wide": stored["wide"] | {"causes": causes}}
    jsonschema.validate(older, calibration_schema())
    (tmp_path / "older").mkdir()
    (tmp_path / "older/calibration.json").write_text(json.dumps(older))
    shutil.copy(place / "first/calibration.h5", tmp_path / "older")
    found = asked(place / "logs", tmp_path / "out", calibration=str(tmp_path / "older")).result
    assert [(one.cause, one.joint) for one in found.findings] == [("cogging", 2)]
    same = {(one.cause, one.joint): one.gain == other.gain
            for one, other in zip(found.thresholds, again.result.thresholds, strict=True)}
    assert {name for (name, _), alike in same.items() if not alike} == {"encoder_eccentricity"}


@pytest.mark.slow
def test_other_logs_of_the_arm_need_no_twin(place: Path, tmp_path: Path) -> None:
    """A fault found with the thresholds of other logs: torque offset at joint 3, where the calibrated arm had cogging."""
    folder = written(tmp_path / "logs", session("torque_offset", 3))
    found = asked(folder, tmp_path / "out", calibration=str(place / "first/calibration.json")).result
    assert [(one.cause, one.joint) for one in found.findings] == [("torque_offset", 3)]


@pytest.mark.slow
@pytest.mark.parametrize(("changed", "words"), [
    ({"robot": "0" * 64}, "another robot"), ({"controllers": ("0" * 64,)}, "another controller"),
    ({"experiments": ("free",)}, "experiments excitation"), ({"sample_time": 2e-3}, "sampled every 1 ms"),
    ({"cutoff_hz": 7.0}, "--filter 7"), ({"laws": ()}, "friction laws"), ({"row_time": 0.5}, "an equation every"),
    ({"speed": np.full(3, 0.01)}, "speed of joint 1"), ({"acceleration": np.full(3, 1e4)}, "acceleration of joint 2"),
    ({"span": np.full(3, 50.0)}, "span of joint 3")])
def test_it_is_refused_for_other_logs(changed: dict[str, Any], words: str, place: Path) -> None:
    """C02, and what differs is named."""
    made = read_calibration(place / "first")
    made = replace(made, conditions=replace(made.conditions, **changed))
    prepared = prepare(Logs.by_role(session("cogging", 2)), DiagnosisSettings())
    with pytest.raises(UsageError, match=words) as refused:
        refuse_calibration(made, prepared, (), "twin")
    assert refused.value.code == "RRID-C02"


def test_a_cause_that_it_does_not_know_is_asked_to_be_left_out(place: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not know quadratic_drag"):
        asked(place / "logs", tmp_path / "out", without=but("cogging", "quadratic_drag"), calibration=str(place / "first"))


@pytest.mark.slow
def test_a_run_takes_it_as_diagnose_does(place: Path, again: Outcome[diagnose.Result], tmp_path: Path) -> None:
    """The same causes against the same thresholds, and no twin; taken back as long as the file is the same, and refused in an
    output folder of its own."""
    home = tmp_path / "stored"
    shutil.copytree(place / "first", home)
    own = diagnose.Settings(without=FEW, replicas=2, most=1, calibration=str(home))
    settings = run.Settings({"diagnose": own}, tuple(name for name in STAGES if name not in ("inspect", "diagnose")))
    request = Request((place / "logs",), out=tmp_path / "run", no_report=True)
    found = run_stage(run.STAGE, request, settings).result.stages[-1].result
    alone = again.result
    assert found.calibrated_with == alone.calibrated_with == ("excitation-1",)
    assert [(one.cause, one.joint) for one in found.findings] == [(one.cause, one.joint) for one in alone.findings]
    assert found.thresholds == alone.thresholds
    listed = json.loads((tmp_path / "run/provenance.json").read_text())["inputs"]
    assert {"calibration.json", "calibration.h5"} <= {Path(name).name for name in listed}
    assert not [one.why for one in run.plan(request, settings) if one.computed]
    (home / "provenance.json").unlink()
    (home / "calibration.json").write_text((home / "calibration.json").read_text() + "\n")
    assert [(one.stage, one.why) for one in run.plan(request, settings) if one.computed] == [
        ("diagnose", f"{home / 'calibration.json'} has other content")]
    with pytest.raises(RrridError):
        run_stage(run.STAGE, replace(request, out=home), settings)


@pytest.mark.slow
def test_a_run_takes_the_friction_laws_of_a_model(place: Path, tmp_path: Path) -> None:
    """--set diagnose.model leaves what diagnose --model leaves, which without viscous friction is not what is left with it."""
    model, arm = tmp_path / "model.json", Arm.from_model(read_model("rrr"))
    dry = tuple(Acting.of(Coulomb(j), {"level": 1.0, "sharpness": 100.0}, origin="known") for j in (1, 2, 3))
    write_model(model, replace(arm, friction=dry).to_model())
    sets = [f"diagnose.model={model}", "diagnose.replicas=0", "diagnose.most=1", f"diagnose.without={list(FEW)}"]
    skipped = [name for name in STAGES if name not in ("inspect", "diagnose")]
    settings = make_settings(run.Settings, "run", (*STAGES, "run"), None, [*sets, f"run.skip={skipped}"], {})
    request = Request((place / "logs",), out=tmp_path / "run", no_report=True)
    found = run_stage(run.STAGE, request, settings).result.stages[-1].result
    alone, usual = (asked(place / "logs", tmp_path / name, replicas=0, model=laws).result
                    for name, laws in (("alone", str(model)), ("usual", None)))
    np.testing.assert_array_equal(found.residual_rms.identify, alone.residual_rms.identify)
    assert not np.allclose(found.residual_rms.identify, usual.residual_rms.identify, rtol=1e-3)
    assert found.fewer_terms == usual.fewer_terms == ()


@pytest.mark.slow
def test_three_sigmoids_where_friction_has_one_leave_what_one_leaves(place: Path, tmp_path: Path) -> None:
    """Asked for by --model rrr: result.json and the report say where one stands in their place, and the cogging is found."""
    given, usual = (asked(place / "logs", tmp_path / name, replicas=0, model=laws)
                    for name, laws in (("given", "rrr"), ("usual", None)))
    np.testing.assert_allclose(given.result.residual_rms.identify, usual.result.residual_rms.identify, rtol=1e-3)
    assert [(one.cause, one.joint) for one in given.result.findings] == [("cogging", 2)]
    stored = json.loads((tmp_path / "given/result.json").read_text())["fewer_terms"]
    assert [(one["joint"], one["law"], one["taken"]) for one in stored] == [(j, "three_sigmoid", ["coulomb", "viscous"])
                                                                            for j in (1, 2, 3)]
    assert any("are not told apart at joint 1" in text for text in given.report.basis)


def test_one_that_was_not_read_is_not_passed_over(place: Path) -> None:
    with pytest.raises(UsageError, match="was not read"):
        diagnose.compute(Inputs(), diagnose.Settings(calibration=str(place / "first")))


@pytest.mark.parametrize(("spoil", "code", "words"), [
    (lambda stored: "{", "RRID-S19", "not complete JSON"), (lambda stored: "[]", "RRID-S19", "format"),
    (lambda stored: json.dumps(stored | {"format_version": 2}), "RRID-F11", "version 2"),
    (lambda stored: json.dumps({key: value for key, value in stored.items() if key != "weight"}), "RRID-S19", "weight"),
    (lambda stored: json.dumps(stored | {"weight": [1.0, -1.0, 1.0]}), "RRID-S19", "no positive numbers"),
    (lambda stored: json.dumps(stored | {"floor": [1.0]}), "RRID-S19", "numbers of joints"),
    (lambda stored: json.dumps(stored | {"wide": None}), "RRID-S19", "whole arm are missing"),
    (lambda stored: json.dumps(stored | {"causes": [stored["causes"][0] | {"own": None}]}), "RRID-S19", "no number")])
def test_what_is_no_calibration_is_rejected(spoil: Any, code: str, words: str, place: Path, tmp_path: Path) -> None:
    stored = json.loads((place / "first/calibration.json").read_text())
    (tmp_path / "calibration.json").write_text(spoil(stored))
    (tmp_path / "calibration.h5").write_bytes((place / "first/calibration.h5").read_bytes())
    with pytest.raises(InputRejected, match=words) as refused:
        read_calibration(tmp_path)
    assert refused.value.code == code


@pytest.mark.slow
@pytest.mark.parametrize(("of", "name"), [
    ("wide", "weight"), ("wide", "model"), ("wide", "left"), ("wide", "usual"), ("wide", "rest"), ("wide", "longer"),
    ("cause", "columns"), ("cause", "model"), ("cause", "left"), ("conditions", "speed"),
    ("conditions", "row_time"), ("", "floor")])
def test_what_is_no_number_is_rejected(of: str, name: str, place: Path, tmp_path: Path) -> None:
    """S19: with one NaN in the sums, no gain of a cause of the whole arm would ever exceed its threshold, and nobody would know."""
    made = read_calibration(place / "first")
    assert made.wide is not None
    owner: Any = {"wide": made.wide, "cause": made.wide.causes[-1], "conditions": made.conditions, "": made}[of]
    value = np.array(getattr(owner, name), dtype=float)
    value.reshape(-1)[-1] = np.nan
    spoilt: Any = replace(owner, **{name: value if value.ndim else float(value)})
    parts: dict[str, Any] = {"wide": {"wide": spoilt}, "conditions": {"conditions": spoilt},
                             "cause": {"wide": replace(made.wide, causes=(*made.wide.causes[:-1], spoilt))}}.get(of, {})
    write_calibration(tmp_path, replace(made, **parts) if of else spoilt)
    with pytest.raises(InputRejected, match="no numbers|no positive numbers") as refused:
        read_calibration(tmp_path)
    assert refused.value.code == "RRID-S19"


def test_one_that_is_missing_or_was_changed_is_told(place: Path, tmp_path: Path) -> None:
    with pytest.raises(RrridError) as missing:
        read_calibration(tmp_path)
    assert missing.value.code == "RRID-C04"
    for name in ("calibration.json", "calibration.h5", "provenance.json"):
        (tmp_path / name).write_bytes((place / "first" / name).read_bytes())
    assert isinstance(read_calibration(tmp_path), Calibration)
    (tmp_path / "calibration.json").write_text((place / "first/calibration.json").read_text() + "\n")
    with pytest.raises(RrridError) as changed:
        read_calibration(tmp_path)
    assert changed.value.code == "RRID-F05"
