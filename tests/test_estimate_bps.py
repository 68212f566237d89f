"""From logs to parameters as a user meets it: equal whatever the container, honest about what logs do not show."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import estimate_bps, reconstruct
from pipelines.errors import InputRejected, NothingMatched, UsageError
from pipelines.log.doctor.checks import check_log
from pipelines.log.experiment import ExperimentLog
from pipelines.log.files import Opened, open_log, write_log
from pipelines.log.model_file import model_text, read_model
from pipelines.log.results import read_series
from pipelines.log.robot import format_robot
from pipelines.model.estimation.compare import Compared
from pipelines.report.bps_report import bps_report
from pipelines.stage import Inputs, Outcome, Request, run_stage
from tests.cli.test_cli import rrrid
from tests.fault_table import FAULTS
from tests.faulty import dropped, spiky
from tests.healthy import changed, good_log, with_signal
from tests.model.estimation.experiments import arm, experiment, truth

Settings = estimate_bps.Settings
Result = estimate_bps.Result
SYMMETRIC = Settings(symmetric=True, compare=False)


@pytest.fixture(scope="module")
def good() -> ExperimentLog:
    return experiment(0)


@pytest.fixture(scope="module")
def held_out() -> ExperimentLog:
    return experiment(1, role="validate")


def stage(folder: Path, *logs: ExperimentLog, settings: Settings = SYMMETRIC, check: bool = False,
          suffix: str = "h5") -> Outcome[Result]:
    for log in logs:
        write_log(folder / f"logs/{log.name}.{suffix}", log)
    request = Request((folder / "logs",), out=folder / "out", no_report=True, check=check)
    return run_stage(estimate_bps.STAGE, request, settings)


def contents(folder: Path) -> dict[str, object]:
    """What a run says: the result as printed, its series and the model, bit for bit."""
    series = read_series(folder / "result.h5")
    return {"result": (folder / "result.json").read_bytes(), "model": (folder / "model.json").read_bytes(),
            "series": {name: (np.asarray(values).dtype.str, np.asarray(values).tobytes()) for name, values in series.items()}}


# --- equal, bit for bit -------------------------------------------------------------------------------------------------


def test_derived_logs_give_what_recordings_give(good: ExperimentLog, held_out: ExperimentLog, tmp_path: Path) -> None:
    """`reconstruct` and then `estimate-bps` on its logs: the same result, series and model, in either container and mixed."""
    settings = replace(SYMMETRIC, compare=True)
    direct = contents(stage(tmp_path / "h5", good, held_out, settings=settings).folder)
    assert contents(stage(tmp_path / "parquet", good, held_out, settings=settings, suffix="parquet").folder) == direct
    for container in ("h5", "parquet"):
        request = Request((tmp_path / "h5/logs",), out=tmp_path / container / "motion", no_report=True, format=container)
        motion = run_stage(reconstruct.STAGE, request, settings.reconstruction)
        again = Request((motion.folder,), out=tmp_path / container / "again", no_report=True)
        assert contents(run_stage(estimate_bps.STAGE, again, settings).folder) == direct
    write_log(tmp_path / "mixed/logs/one.h5", open_log(next((tmp_path / "h5/motion/logs").glob("*-0.h5"))).log)
    write_log(tmp_path / "mixed/logs/two.parquet", held_out)
    mixed = Request((tmp_path / "mixed/logs",), out=tmp_path / "mixed/out", no_report=True)
    assert contents(run_stage(estimate_bps.STAGE, mixed, settings).folder) == direct


def test_its_own_logs_give_the_same_again(good: ExperimentLog, tmp_path: Path) -> None:
    first = stage(tmp_path, good)
    again = Request((first.folder,), out=tmp_path / "again", no_report=True)
    assert contents(run_stage(estimate_bps.STAGE, again, SYMMETRIC).folder) == contents(first.folder)


def test_derived_torques_add_up(good: ExperimentLog, tmp_path: Path) -> None:
    """tau_model is the sum of its parts, and tau_residual what the recording has beside it: the noise of the amplifier."""
    out = stage(tmp_path, good)
    log = open_log(next((out.folder / "logs").iterdir())).log
    parts = sum(log[name] for name in ("tau_inertia", "tau_coriolis", "tau_gravity", "tau_friction_model", "tau_effects"))
    np.testing.assert_allclose(parts, log["tau_model"], atol=1e-12)
    np.testing.assert_allclose(log["tau_model"] + log["tau_residual"], log.tau, atol=1e-12)
    middle = log["tau_residual"][1000:-1000]
    np.testing.assert_allclose(np.median(np.abs(middle), axis=0) / 0.6745, [0.020, 0.010, 0.005], rtol=0.25)


# --- what the logs do not show ------------------------------------------------------------------------------------------


def _of_elbow(log: ExperimentLog) -> ExperimentLog:
    """A free motion: of an excitation every joint has to move, and an encoder that does not is dead, D04."""
    return replace(log, experiment="free")


def test_a_log_of_one_joint_names_what_it_cannot_show(tmp_path: Path) -> None:
    """D09: only the elbow moves. No number for what is not seen, gate 1, and the same again as null in the JSON."""
    only = np.array([0.0, 0.0, 1.0])
    out = stage(tmp_path, _of_elbow(experiment(0, moving=only)), check=True)
    assert out.exit_code == 1
    assert any(check.code == "RRID-D09" and check.gate for check in out.checks)
    printed = {p["name"]: p for p in json.loads((out.folder / "result.json").read_text())["parameters"]}
    lost = {name for name, p in printed.items() if p["value"] is None}
    # what turns with the waist, the shoulder's own inertia and gravity, and the friction of both need those joints to move
    assert {"p1", "p2", "p5", "p6", "p7", "p12", "p14", "coulomb:1:level", "viscous:1:coefficient", "coulomb:2:level"} <= lost
    assert all(printed[name]["std"] is None and not printed[name]["visible"] for name in lost)
    assert not lost & {"p3", "p13", "coulomb:3:level", "viscous:3:coefficient"}  # the elbow's weight and inertia show
    assert all(name in out.result.unresolved for name in lost)
    for name in set(printed) - lost:
        assert abs(printed[name]["value"] - truth([name])[0]) < 4.0 * printed[name]["std"], name
    stored = read_model(out.folder / "model.json")
    assert {p.name for p in stored.base_parameters if p.std is None} == {n for n in lost if ":" not in n} | {"p4", "p15"}
    assert out.result.physically_consistent is None


def test_an_inconsistent_estimate_names_the_link(good: ExperimentLog, tmp_path: Path) -> None:
    """D15: an elbow torque of the wrong sign asks for an elbow of negative inertia."""
    wrong = with_signal(good, tau=good.tau * np.array([1.0, 1.0, -1.0]))
    out = stage(tmp_path, wrong, check=True)
    assert out.exit_code == 1
    (check,) = [c for c in out.checks if c.code == "RRID-D15"]
    assert check.gate
    assert good.robot.joints[2].name in check.message
    assert out.result.physically_consistent is False


def test_a_healthy_log_passes_every_gate(good: ExperimentLog, tmp_path: Path) -> None:
    out = stage(tmp_path, good, check=True)
    assert out.exit_code == 0
    assert out.result.physically_consistent is True
    assert out.result.unresolved == ""


# --- bad input ----------------------------------------------------------------------------------------------------------


def _saturated(log: ExperimentLog) -> ExperimentLog:
    """Torque clipped in the busiest hundredth of the samples of the shoulder."""
    limit = np.array([60.0, 30.0, 15.0])
    at = np.sort(np.argsort(-np.abs(log.tau[:, 1]))[:100])
    tau = log.tau.copy()
    tau[at, 1] = np.sign(tau[at, 1]) * limit[1]
    return with_signal(log, tau=tau)


SPOILT: dict[str, Callable[[ExperimentLog], ExperimentLog]] = {
    "T03 dropped": lambda log: dropped(log, lambda k: np.delete(k, np.arange(500, 9500, 97))),
    "T04 gap": lambda log: dropped(log, lambda k: np.delete(k, np.arange(4000, 4600))),
    "D01 q": lambda log: changed(log, "q", (np.arange(700, 9000, 331), 1), np.nan),
    "D01 tau": lambda log: changed(log, "tau", (np.arange(700, 9000, 331), 0), np.nan),
    "D02 block": lambda log: changed(log, "tau", (slice(3000, 3500), 2), np.nan),
    "D06 q": lambda log: spiky(log, "q", 1, 0.3),
    "D06 tau": lambda log: spiky(log, "tau", 0, 200.0),
    "D05": _saturated,
}


@pytest.mark.parametrize("fault", SPOILT)
def test_what_is_spoilt_is_left_out(fault: str, good: ExperimentLog, tmp_path: Path) -> None:
    """Gaps, missing samples, spikes and saturation: the truth stays within the standard deviations.

    Of 22 parameters the largest deviation stays below 4; their root mean square is about 1.
    """
    found = stage(tmp_path, SPOILT[fault](good)).result
    z = np.array([(p.value - truth([p.name])[0]) / p.std for p in found.parameters])  # type: ignore[operator]
    assert np.abs(z).max() < 4.0, dict(zip([p.name for p in found.parameters], z.round(1), strict=True))
    assert np.sqrt(np.mean(z**2)) < 1.6


def test_nothing_to_fit_is_said_so(held_out: ExperimentLog, tmp_path: Path) -> None:
    with pytest.raises(NothingMatched) as refused:
        stage(tmp_path, held_out)
    assert refused.value.exit_code == 5


def test_several_robots_are_refused(good: ExperimentLog, held_out: ExperimentLog, tmp_path: Path) -> None:
    other = replace(held_out.robot, gravity=(0.0, 0.0, -9.7))
    with pytest.raises(UsageError, match="several robots") as refused:
        stage(tmp_path, good, replace(held_out, robot_text=format_robot(other)))
    assert refused.value.exit_code == 2


def test_too_short_for_the_low_pass_is_rejected(good: ExperimentLog, tmp_path: Path) -> None:
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path, with_rows(good, 80), settings=replace(SYMMETRIC, filter=2.0))
    assert refused.value.exit_code == 3
    assert refused.value.remedy


def with_rows(log: ExperimentLog, count: int) -> ExperimentLog:
    return replace(log, signals={k: replace(s, values=s.values[:count]) for k, s in log.signals.items()})


def test_one_recording_does_not_judge_itself(good: ExperimentLog, tmp_path: Path) -> None:
    """D14: the same samples in both roles are refused, in whatever container, unless --allow-same."""
    copy = replace(good, name="copy", role="validate")
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path / "a", good, copy)
    assert (refused.value.code, refused.value.exit_code) == ("RRID-D14", 3)
    allowed = stage(tmp_path / "b", good, copy, settings=replace(SYMMETRIC, allow_same=True)).result
    assert allowed.relative_error["validate"] == pytest.approx(allowed.relative_error["identify"])


# --- judges -------------------------------------------------------------------------------------------------------------


def test_the_balance_of_power_agrees_on_healthy_logs(tmp_path: Path) -> None:
    for seed in range(5):
        balance = stage(tmp_path / str(seed), experiment(seed)).result.balance
        assert balance is not None
        assert balance.agree, (seed, balance.apart)


def test_the_balance_of_power_finds_a_late_position(good: ExperimentLog, tmp_path: Path) -> None:
    """Position three samples late beside the torque: the torque fit and the balance then differ."""
    late = with_signal(good, q=np.vstack([np.repeat(good.q[:1], 3, axis=0), good.q[:-3]]))
    balance = stage(tmp_path, late).result.balance
    assert balance is not None
    assert not balance.agree


def test_the_balance_of_power_finds_a_spoilt_acceleration(good: ExperimentLog, tmp_path: Path) -> None:
    """An observer of 3 Hz takes acceleration away that the torque has; position and speed hardly suffer."""
    balance = stage(tmp_path, good, settings=replace(SYMMETRIC, method="observer", bandwidth=(3.0,))).result.balance
    assert balance is not None
    assert not balance.agree


def test_the_default_wins_held_out(samples: Path, tmp_path: Path) -> None:
    """The table of four ways to reconstruct: none explains the held-out sample log better than the default, but for a trifle."""
    request = Request((samples / "rrr-closed-form",), out=tmp_path / "out", no_report=True)
    result = run_stage(estimate_bps.STAGE, request, Settings()).result
    assert [c.method for c in result.comparison if c.used] == ["smoother"]
    errors = {c.method: c.validate for c in result.comparison}
    assert errors["smoother"] < 1.01 * min(errors.values()), errors
    assert errors["smoother"] < 0.5 * errors["observer"]
    assert result.held_out == "logs"


def test_slow_samples_of_one_joint_leave_the_others_alone(good: ExperimentLog, tmp_path: Path) -> None:
    """--min-speed: each joint keeps the equations where it moves; its residual is the noise it had, not less."""
    every = stage(tmp_path / "a", good).result
    moving = stage(tmp_path / "b", good, settings=replace(SYMMETRIC, min_speed=(0.0, 1.5, 0.0))).result
    assert moving.equations[0] == every.equations[0] == every.equations[1]
    assert 0.1 * every.equations[1] < moving.equations[1] < 0.8 * every.equations[1]
    np.testing.assert_allclose(moving.torque_rms["identify"], every.torque_rms["identify"], rtol=0.15)
    z = [(p.value - truth([p.name])[0]) / p.std for p in moving.parameters]  # type: ignore[operator]
    assert np.abs(z).max() < 4.0


def test_a_given_friction_is_subtracted(good: ExperimentLog, held_out: ExperimentLog, tmp_path: Path) -> None:
    """--model: the true friction given, none is fitted; the rigid body comes out right, and surer than with it."""
    (tmp_path / "given.json").write_text(model_text(arm().to_model()), encoding="utf-8")
    fitted = stage(tmp_path / "a", good, held_out).result
    given = stage(tmp_path / "b", good, held_out, settings=replace(SYMMETRIC, model=str(tmp_path / "given.json"))).result
    assert (fitted.friction, given.friction) == ("fitted", "given")
    assert not any(p.name.startswith(("coulomb", "viscous")) for p in given.parameters)
    known = {p.name: p for p in fitted.parameters}
    for p in given.parameters:
        assert p.value is not None
        assert p.std is not None
        assert abs(p.value - truth([p.name])[0]) < 4.0 * p.std, p.name
        assert p.std < 1.1 * (known[p.name].std or 0.0), p.name
    assert given.relative_error["validate"] < 1.05 * fitted.relative_error["validate"]
    kept = {f"{law.effect}:{law.joint}": law for law in given.model.friction}
    assert kept["coulomb:1"].parameters["level"].value == 4.8


def test_a_model_of_another_robot_is_refused(good: ExperimentLog, tmp_path: Path) -> None:
    model = arm().to_model()
    robot = replace(arm().robot, joints=arm().robot.joints[:2])
    small = replace(model, robot=format_robot(robot))
    (tmp_path / "small.json").write_text(model_text(small), encoding="utf-8")
    with pytest.raises((UsageError, InputRejected)):
        stage(tmp_path, good, settings=replace(SYMMETRIC, model=str(tmp_path / "small.json")))


def test_the_command_line(good: ExperimentLog, held_out: ExperimentLog, tmp_path: Path) -> None:
    """Exit 5 without a log to fit, 1 with --check where a gate failed; --model and --json; nothing but JSON on stdout."""
    write_log(tmp_path / "judge/a.h5", held_out)
    nothing = rrrid("estimate-bps", "judge", "--out", "o", cwd=tmp_path)
    assert (nothing.returncode, "RRID-C06" in nothing.stderr, nothing.stdout) == (5, True, "")
    write_log(tmp_path / "still/a.h5", _of_elbow(experiment(0, moving=np.array([0.0, 0.0, 1.0]))))
    gate = rrrid("estimate-bps", "still", "--out", "o1", "--no-report", "--check", cwd=tmp_path)
    assert gate.returncode == 1
    assert "no sample shows p1" in gate.stdout
    write_log(tmp_path / "good/a.h5", good)
    (tmp_path / "given.json").write_text(model_text(arm().to_model()), encoding="utf-8")
    given = rrrid("estimate-bps", "good", "--out", "o2", "--no-report", "--json", "--model", "given.json", cwd=tmp_path)
    assert given.returncode == 0
    assert json.loads(given.stdout)["friction"] == "given"
    missing = rrrid("estimate-bps", "good", "--out", "o3", "--model", "nowhere.json", cwd=tmp_path)
    assert (missing.returncode, "RRID-C04" in missing.stderr) == (2, True)


# --- what the doctor says -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("row", [fault.row for fault in FAULTS])
def test_every_fault_ends_in_words(row: str, tmp_path: Path) -> None:
    """Whatever the doctor can meet: an estimate, a gate under --check, or a rejection; never a crash."""
    fault = next(fault for fault in FAULTS if fault.row == row)
    log = replace(fault.make(good_log()), role="identify")
    if retold := log.experiment not in estimate_bps.FITTED:  # what is wrong with a friction log may be right of an excitation
        log = replace(log, experiment="excitation")
    opened = Opened(tmp_path / "a.h5", "", log, ())
    result = None
    with contextlib.suppress(InputRejected):  # which ends in exit 3; anything else fails here
        result = estimate_bps.compute(Inputs((opened,), label="logs"), Settings(compare=False))
    if result is not None:
        assert fault.level != "reject" or retold
        assert estimate_bps.STAGE.exit_code(result, False) == 0
        gates = [check for check in check_log(log) if check.gate and check.code != "RRID-D09"]  # D09 is for all logs together
        assert {(check.code, check.message) for check in gates} <= {(c.code, c.message) for c in estimate_bps.STAGE.checks(result)}
        assert estimate_bps.STAGE.exit_code(result, True) == 1 or not gates


def test_the_doctor_is_asked(good: ExperimentLog, tmp_path: Path) -> None:
    """T07, less than a period: rejected. D05, a flat top: said, and exit 1 under --check."""
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path / "short", replace(good, period=20.0))
    assert refused.value.code == "RRID-T07"
    (limited,) = [fault.make(good_log()) for fault in FAULTS if fault.row == "D05 limit"]
    clipped = stage(tmp_path / "clipped", limited, check=True)
    assert any(check.code == "RRID-D05" and check.gate for check in clipped.checks)
    assert clipped.exit_code == 1
    assert stage(tmp_path / "clipped", limited).exit_code == 0
    constant = changed(good, "tau", (slice(None), 1), 0.3)
    with pytest.raises(InputRejected, match="constant"):
        stage(tmp_path / "constant", constant)


def test_torque_that_saturates_throughout_is_rejected(good: ExperimentLog, tmp_path: Path) -> None:
    """D05: no equation is left where the filter spreads clipped samples over everything."""
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path, with_signal(good, tau=np.clip(good.tau, -0.5, 0.5)))
    assert refused.value.exit_code == 3


# --- settings -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("settings", "where"), [
    ({"min_speed": (0.1, 0.2)}, "--min-speed"), ({"min_speed": (-1.0,)}, "--min-speed"),
    ({"min_speed": (math.nan,)}, "--min-speed"), ({"min_speed": (math.inf,)}, "--min-speed"),
    ({"decimate": 0}, "--decimate"), ({"decimate": -3}, "--decimate"), ({"filter": 0.0}, "--filter"),
    ({"filter": -1.0}, "--filter"), ({"filter": 500.0}, "--filter"), ({"filter": math.nan}, "--filter"),
    ({"blocks": 1}, "--blocks"), ({"blocks": 0}, "--blocks"), ({"order": 7}, "--order")])
def test_settings_have_bounds(settings: dict[str, object], where: str, good: ExperimentLog, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refused:
        stage(tmp_path, good, settings=replace(SYMMETRIC, **settings))  # type: ignore[arg-type]
    assert (refused.value.code, refused.value.where, refused.value.exit_code) == ("RRID-C02", where, 2)


@pytest.mark.parametrize("settings", [{"decimate": 500}, {"decimate": 100000}, {"filter": 0.01}, {"min_speed": (100.0,)}])
def test_too_few_equations_are_rejected(settings: dict[str, object], good: ExperimentLog, tmp_path: Path) -> None:
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path, good, settings=replace(SYMMETRIC, **settings))  # type: ignore[arg-type]
    assert refused.value.code in ("RRID-T04", "RRID-T08")
    assert refused.value.remedy


def test_options_of_the_observer(good: ExperimentLog, tmp_path: Path) -> None:
    """--order, --jerk-std and --bandwidth reach the reconstruction, as with `reconstruct`."""
    write_log(tmp_path / "logs/a.h5", good)
    for number, options in enumerate((["--order", "3", "--bandwidth", "30,40,50"], ["--jerk-std", "1000"])):
        made = rrrid("estimate-bps", "logs", "--out", f"o{number}", "--no-report", *options, cwd=tmp_path)
        assert made.returncode == 0, made.stderr
    about = [json.loads((tmp_path / f"o{number}/provenance.json").read_text())["settings"] for number in (0, 1)]
    assert (about[0]["order"], about[0]["bandwidth"], about[1]["jerk_std"]) == (3, [30, 40, 50], [1000])
    wrong = rrrid("estimate-bps", "logs", "--out", "o", "--bandwidth", "1,2", cwd=tmp_path)
    assert (wrong.returncode, "RRID-C02" in wrong.stderr) == (2, True)


# --- side by side -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("min_speed", [0.0, 0.5])
@pytest.mark.parametrize("alone", [True, False])
def test_all_ways_are_judged_by_the_same_equations(alone: bool, min_speed: float, good: ExperimentLog, held_out: ExperimentLog,
                                                   tmp_path: Path) -> None:
    settings = replace(SYMMETRIC, compare=True, min_speed=(min_speed,))
    result = stage(tmp_path, *((good,) if alone else (good, held_out)), settings=settings).result
    assert len({c.equations for c in result.comparison}) == 1
    assert result.comparison[0].equations > 0


def _compared(**errors: float) -> tuple[Compared, ...]:
    return tuple(Compared(name, False, error, error, 9, (1.0,), (0.1,), "") for name, error in errors.items())


def test_the_report_names_the_best_way(good: ExperimentLog, tmp_path: Path) -> None:
    result = stage(tmp_path, good).result

    def said(**errors: float) -> str:
        section = bps_report(replace(result, comparison=_compared(**errors))).sections[-1]
        assert section.text[0] in section.tables[0].caption
        return section.text[0]

    assert "observer explains the torque best" in said(smoother=0.05, observer=0.04)
    assert said(smoother=0.0401, observer=0.04) == "Held out, there is no difference worth speaking of."
    assert "between observer and smoother" in said(smoother=0.0401, observer=0.04, other=0.05)


def test_the_verdict_names_the_worst_joint_and_what_is_small(good: ExperimentLog, tmp_path: Path) -> None:
    result = stage(tmp_path, good).result
    plain = replace(result, relative_error={"identify": 0.05, "validate": 0.05},
                    torque_rms={**result.torque_rms, "validate": (1.0, 1.0, 1.0)},
                    torque_signal_rms={**result.torque_signal_rms, "validate": (20.0, 20.0, 20.0)})
    assert bps_report(plain).tone == "good"
    assert "worst joint" not in bps_report(plain).verdict
    bad = replace(plain, torque_rms={**plain.torque_rms, "validate": (1.0, 1.0, 12.2)})
    assert f"{result.joints[2]} 61 %" in bps_report(bad).verdict
    assert bps_report(bad).tone == "attention"
    small = tuple(replace(p, value=0.5, std=1.0, visible=True) if k < 2 else replace(p, value=10.0, std=1.0, visible=True)
                  for k, p in enumerate(result.parameters))
    report = bps_report(replace(plain, parameters=small))
    assert f"{len(small) - 2} of {len(small)} parameters are clearly visible, 2 known to be small" in report.verdict
    assert [row[3] for row in report.sections[0].tables[0].rows][:3] == ["known to be small", "known to be small", "clearly"]
