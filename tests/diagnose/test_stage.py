"""`rrrid diagnose` on short sessions of the test bench: the contract of its result, its verdicts, its exit codes.

The library is cut down to a few causes, for speed; with all of them it is asked in test_hidden_effects.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from bench.draw import draw_machine
from bench.faults import make
from pipelines import diagnose
from pipelines.errors import UsageError
from pipelines.stage import Outcome, Request, run_stage
from tests.diagnose.sessions import but, healthy_again, session, written

FEW = but("cogging", "torque_offset", "quadratic_drag", "torque_gain")
TOP = {"verdict", "findings", "baseline_effects", "rejected", "detection_limits", "not_identifiable", "residual_rms"}
FINDING = {"cause", "joint", "parameters", "explained", "identifiability", "alternatives", "experiment", "gain"}
GAIN = {"validate_torque_rms", "simulated_position_rms", "simulation", "simulated_span", "tip_error_rms"}


def asked(folder: Path, out: Path, **settings: object) -> Outcome[diagnose.Result]:
    """The stage, its library cut down."""
    chosen = diagnose.Settings(**({"exclude": FEW, "max_causes": 1} | settings))  # type: ignore[arg-type]
    return run_stage(diagnose.STAGE, Request((folder,), out=out, no_report=True, check=True), chosen)


@pytest.fixture(scope="module")
def rippled(tmp_path_factory: pytest.TempPathFactory) -> Outcome[diagnose.Result]:
    """Cogging at joint 2, since reference logs."""
    place = tmp_path_factory.mktemp("cogging")
    logs = (*healthy_again(session()), *session("cogging", 2))
    return asked(written(place / "logs", logs), place / "out", exclude=but("cogging", "torque_offset"))


@pytest.mark.slow
def test_the_result_holds_what_the_contract_says(rippled: Outcome[diagnose.Result]) -> None:
    """Names and nesting of cli-contract.md, in the file itself."""
    stored = json.loads((rippled.folder / "result.json").read_text())
    assert set(stored) >= TOP
    assert stored["verdict"] == "cause"
    finding = stored["findings"][0]
    assert set(finding) >= FINDING
    assert set(finding["gain"]) == GAIN
    assert set(finding["gain"]["validate_torque_rms"]) == {"before", "after", "ci95"}
    assert [len(finding["gain"]["validate_torque_rms"][name]) for name in ("before", "after", "ci95")] == [3, 3, 3]
    assert {len(pair) for pair in finding["gain"]["validate_torque_rms"]["ci95"]} == {2}
    assert set(finding["gain"]["tip_error_rms"]) == {"before", "after"}
    assert all(isinstance(x, float) for x in finding["gain"]["tip_error_rms"].values())
    assert finding["gain"]["simulation"] == "closed-loop"
    assert all(set(one) == {"value", "std", "unit"} for one in finding["parameters"].values())
    assert set(stored["residual_rms"]) == {"identify", "validate", "noise_floor"}
    assert all(set(one) >= {"cause", "joint", "minimum"} for one in stored["detection_limits"])
    assert all(set(one["minimum"]) >= {"value", "unit"} for one in stored["detection_limits"])
    assert all(set(one) >= {"cause", "reason"} for one in (*stored["not_identifiable"], *stored["rejected"]))


def test_a_cause_is_named_with_its_joint_and_its_numbers(rippled: Outcome[diagnose.Result]) -> None:
    """Exit 1 under --check; the extended model is better on the held-out log, and the simulated arm nearer."""
    finding = rippled.result.findings[0]
    assert (finding.cause, finding.joint, rippled.exit_code) == ("cogging", 2, 1)
    truth = make("cogging", draw_machine(7, "fault"), 2, 1, 1.0).parameters()
    assert finding.parameters["order"].value == pytest.approx(truth["order"], rel=0.01)
    turned = finding.parameters["phase"].value - truth["phase"]
    assert math.remainder(turned, 2.0 * math.pi) == pytest.approx(0.0, abs=0.05)
    assert finding.parameters["amplitude"].value == pytest.approx(0.28, rel=0.05)  # 0.4 N m, joint factor 0.7
    gain = finding.gain
    assert gain.validate_torque_rms.ci95[1][1] < 0.0
    assert gain.tip_error_rms is not None
    assert gain.tip_error_rms.after < gain.tip_error_rms.before


@pytest.mark.slow
def test_a_cause_is_named_without_reference_logs(tmp_path: Path) -> None:
    """Of two logs of ten seconds, blocks of which are held out."""
    found = asked(written(tmp_path / "logs", session("cogging", 2, 10.0)), tmp_path / "out")
    assert [(one.cause, one.joint) for one in found.result.findings] == [("cogging", 2)]
    assert found.result.findings[0].parameters["amplitude"].value == pytest.approx(0.28, rel=0.05)


@pytest.mark.slow
def test_an_arm_in_order_has_nothing_wrong(tmp_path: Path) -> None:
    """Exit 0, and it is said what would have been found."""
    outcome = asked(written(tmp_path / "logs", session()), tmp_path / "out")
    assert (outcome.result.verdict, outcome.result.findings, outcome.exit_code) == ("no-fault-found", (), 0)
    assert {one.cause for one in outcome.result.detection_limits} >= {"cogging", "torque_offset"}
    assert outcome.result.noise_floor_origin == "blocks"


def test_what_the_user_excludes_is_not_named(tmp_path: Path) -> None:
    """--exclude cogging: the ripple then has no name, and certainly not that one."""
    outcome = asked(written(tmp_path / "logs", session("cogging", 2)), tmp_path / "out", exclude=(*FEW, "cogging"))
    assert "cogging" not in {one.cause for one in outcome.result.findings}
    _, said, causes = outcome.report.verdict.partition("Not looked for, because you said so: ")
    assert said
    assert "cogging" in causes.rstrip(".").split(", ")


@pytest.mark.slow
def test_paths_go_before_what_logs_say_of_themselves(tmp_path: Path) -> None:
    """Two logs of role identify, one of them named to judge: it judges. The same one cannot do both."""
    logs = session("torque_offset", 3)
    folder = written(tmp_path / "logs", logs)
    one, other = (str(folder / f"excitation-{k}.h5") for k in (1, 2))
    turned = asked(folder, tmp_path / "out", identify=(other,), validate=(one,))
    assert turned.result.held_out == "logs"
    assert [(found.cause, found.joint) for found in turned.result.findings] == [("torque_offset", 3)]
    with pytest.raises(UsageError, match="named for identify and for validate"):
        asked(folder, tmp_path / "out", identify=(str(folder),), validate=(one,))


@pytest.mark.parametrize(("settings", "words"), [
    ({"exclude": ("cogs",)}, "cogging"), ({"blocks": 1}, "1 block"),
    ({"max_causes": 0}, "findings"), ({"min_speed": (0.1, 0.2)}, "--min-speed: 2 values for 3 joints"),
    ({"decimate": 0}, "--decimate"), ({"cutoff_hz": 450.0}, "sampled at 1000 Hz")])
def test_settings_that_make_no_sense_are_refused(settings: dict[str, object], words: str, tmp_path: Path,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    """Before any log is examined, let alone simulated."""
    monkeypatch.setattr(diagnose, "examined", lambda *given: pytest.fail("was not refused at once"))
    folder = written(tmp_path / "logs", session())
    with pytest.raises(UsageError) as refused:
        asked(folder, tmp_path / "out", **settings)
    assert words in str(refused.value)
