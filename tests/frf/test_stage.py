"""`rrrid frf`: the sample arm's soft base, the fields of the contract, and bad input."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing

from pipelines import frf
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.parameter import Parameter
from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import InputRejected, NothingMatched, UsageError
from pipelines.frequency.result import Posture
from pipelines.frf import Settings
from pipelines.io.files import Opened, open_log, write_log
from pipelines.io.log import ExperimentLog, Signal
from pipelines.report.frf_figures import draw_bode
from pipelines.stage import Inputs, Outcome, Request, run_stage
from sample_logs.bench_session import controllers_model, machine
from tests.cli.commands import rrrid
from tests.frf.cases import controller_inertia
from tests.frf.linearised import linearised
from tests.frf.loops import Loop, elastic, rigid

QUICK = Settings(high=70.0)
LINK = Loop(elastic(0.2, 0.8, 8000.0, 4.0), seconds=20.0)


def computed(*logs: ExperimentLog, settings: Settings = QUICK) -> frf.Result:
    return frf.compute(Inputs(tuple(Opened(Path(f"{log.name}.h5"), "", log, ()) for log in logs), label="logs"), settings)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory, samples: Path) -> Outcome[frf.Result]:
    """Joint 1 of the sample arm in the paper's two postures; its base gives way at 28 Hz, 8 kg m²."""
    paths = (samples / "rrr-healthy/frf-1-1.h5", samples / "rrr-healthy/frf-1-2.h5")
    return run_stage(frf.STAGE, Request(paths, out=tmp_path_factory.mktemp("frf") / "out", no_report=True), QUICK)


def test_the_soft_base_of_the_sample_arm(outcome: Outcome[frf.Result]) -> None:
    """Named as the base and nothing else; frequency, damping and inertia are the bench's."""
    (one,) = outcome.result.classification
    assert (one.kind, one.joint, one.cause) == ("base", None, "base_resonance")
    assert outcome.result.undecided == ()
    assert one.parameters["frequency"].value == pytest.approx(28.0, rel=2e-3)
    assert one.parameters["damping_ratio"].value == pytest.approx(0.04, rel=0.05)
    assert one.parameters["inertia"].value == pytest.approx(8.0, rel=0.1)
    told = re.match(r"Base resonance at ([\d.]+) ± ", outcome.report.verdict)
    assert told is not None
    assert float(told.group(1)) == pytest.approx(28.0, rel=2e-3)


def test_modes_are_those_of_the_linearised_plant(outcome: Outcome[frf.Result], samples: Path) -> None:
    """Every pole and zero of MuJoCo's plant at that speed: frequency within 1 % and damping within 15 %."""
    arm = machine()
    model, default = controllers_model(arm), [r for r in outcome.result.responses if r.method == "closed-loop"]
    for name, response in zip(("frf-1-1", "frf-1-2"), default, strict=True):
        log = open_log(samples / f"rrr-healthy/{name}.h5").log
        assert log.controller is not None
        assert log.controller.kp is not None
        assert log.controller.kd is not None
        assert log.posture is not None
        truth = linearised(arm, 1, log.posture, 0.436, controller_inertia(model, log.posture),
                           (float(log.controller.kp[0]), float(log.controller.kd[0])))
        poles, zeros = truth.modes()
        for kind, values in (("resonance", poles), ("antiresonance", zeros)):
            found = [m for m in response.modes if m.kind == kind]
            assert len(found) == len(values) == 1
            assert found[0].frequency.value == pytest.approx(values[0, 0], rel=0.01)
            assert found[0].damping.value == pytest.approx(values[0, 1], rel=0.15)
        f = np.array([2.0, 5.0, 10.0, 26.0, 29.0, 60.0])
        k = [int(np.argmin(np.abs(response.curve.frequency - x))) for x in f]
        assert np.abs(response.curve.value[k] / truth.response(f) - 1.0).max() < 0.05


def test_the_fields_of_the_contract(outcome: Outcome[frf.Result]) -> None:
    """responses: joint, posture, method, coherence_below_0_7_hz, modes; classification: kind, joint, evidence."""
    result = json.loads((outcome.folder / "result.json").read_text())
    assert result["command"] == "frf"
    assert {r["method"] for r in result["responses"]} == {"direct", "indirect", "closed-loop"}
    for response in result["responses"]:
        assert response["joint"] == 1
        assert len(response["posture"]) == 3
        assert all(a <= b for a, b in response["coherence_below_0_7_hz"])
        for mode in response["modes"]:
            assert mode["kind"] in ("resonance", "antiresonance")
            assert mode["frequency"]["std"] > 0.0
            assert 0.0 < mode["damping"]["value"] < 1.0
    assert result["classification"][0]["kind"] == "base"
    assert "Hz" in result["classification"][0]["evidence"]


def test_the_rigid_body_is_expected_and_measured(outcome: Outcome[frf.Result]) -> None:
    """The controller's model is 5 % wrong at most: so is the level, and the measured inertia is the bench's within 1 %."""
    from bench.dynamics import RigidDynamics

    true = RigidDynamics(machine().robot)
    for posture in outcome.result.postures:
        assert isinstance(posture, Posture)
        assert posture.expected_level == 1.0
        assert posture.level.value == pytest.approx(1.0, abs=0.05)
        assert posture.inertia is not None
        assert posture.inertia.value == pytest.approx(true.mass_matrix(posture.posture)[0, 0], rel=0.01)


def test_a_given_model_sets_what_is_expected(samples: Path) -> None:
    """With the true links as the arm's model, the expected level is the controller's inertia over the true one."""
    from sample_logs.bench_session import arm_of

    arm = machine()
    opened = open_log(samples / "rrr-healthy/frf-1-1.h5")
    result = frf.compute(Inputs((opened,), label="logs", material=arm_of(arm.robot, ())), QUICK)
    (posture,) = result.postures
    assert posture.expected_from == "given model"
    assert posture.level.value == pytest.approx(posture.expected_level, rel=0.01)


def test_a_model_of_friction_alone_expects_nothing(outcome: Outcome[frf.Result], samples: Path) -> None:
    """Within `run`, where base parameters were refused, what is handed on has friction and no inertia: the controller's holds."""
    opened = open_log(samples / "rrr-healthy/frf-1-1.h5")
    (without,) = [one for one in outcome.result.postures if np.array_equal(one.posture, opened.log.posture)]
    body = rigid_body(opened.log.robot)
    bare = Arm("bare", body, tuple(Parameter(one.name, 0.0, None, one.unit) for one in body.parameters))
    (posture,) = frf.compute(Inputs((opened,), label="logs", material=bare), QUICK).postures
    assert (posture.expected_from, posture.expected_level) == (without.expected_from, without.expected_level)


def test_no_frf_log(samples: Path) -> None:
    """Nothing matched: exit 5, with what to record."""
    with pytest.raises(NothingMatched, match="design-excitation --experiment frf"):
        computed(open_log(samples / "rrr-closed-form/hold-1.h5").log)


def test_reference_logs_are_not_mixed_in() -> None:
    """What the robot was like before is measured only where nothing else is there."""
    now, before = LINK.log(), replace(LINK, plant=rigid(1.0)).log(name="before", role="reference")
    assert [r.logs for r in computed(now, before).responses if r.method == "direct"] == [("turned",)]
    assert [r.logs for r in computed(before).responses if r.method == "direct"] == [("before",)]


@pytest.mark.row("T05")
def test_an_uneven_clock_has_no_spectrum(tmp_path: Path) -> None:
    """Elsewhere a warning; here exit 3, with the signal and what to do."""
    log = replace(LINK, seconds=4.0).log()
    uneven = log.t + np.random.default_rng(1).uniform(-0.2, 0.2, log.n_samples) * log.sample_time
    log = replace(log, signals={**log.signals, "t": replace(log.signals["t"], values=uneven)})
    write_log(tmp_path / "turned.h5", log)
    with pytest.raises(InputRejected, match="RRID-T05 .*turned.*varies by 1[0-9]") as refused:
        run_stage(frf.STAGE, Request((tmp_path / "turned.h5",), out=tmp_path / "out"), QUICK)
    assert refused.value.exit_code == 3
    assert refused.value.remedy


@pytest.mark.row("D13")
def test_low_coherence_everywhere_is_a_gate(tmp_path: Path) -> None:
    """A thousandth of the disturbance: D13, exit 1 under --check, and what to record."""
    write_log(tmp_path / "turned.h5", replace(LINK, strength=0.002, disturbance=4.0).log())
    ended = rrrid("frf", "turned.h5", "--check", "--no-report", "--out", "out", cwd=tmp_path)
    assert ended.returncode == 1
    assert "RRID-D13" in ended.stdout + ended.stderr
    assert "xcite more strongly" in ended.stdout + ended.stderr


def test_the_direct_method_is_warned_of() -> None:
    """A strong disturbance: the report says at which frequency, by how much, with which coherence."""
    result = computed(replace(LINK, plant=rigid(1.0), disturbance=10.0, seconds=200.0).log())
    words = "".join(section.warning for section in frf.report(result).sections)
    assert "direct method is biased, though its coherence looks fine" in words


def test_what_v_does_not_excite_is_not_drawn(outcome: Outcome[frf.Result]) -> None:
    """v ends at 250 Hz, and averaged spectra of the input go on: beyond, they hold noise. No curve goes beyond the last line of v,
    and none is drawn where its own coherence is too low for the table beside it."""
    methods = {one.method: one for one in outcome.result.responses if one.posture[2] == outcome.result.postures[0].posture[2]}
    end, direct = methods["closed-loop"].curve.frequency[-1], methods["direct"].curve
    beyond = direct.frequency > end + 1.0
    assert beyond.any()  # the stored response still has it
    axes = Drawing().subplots(3)
    draw_bode(axes, outcome.result.postures[0], methods)
    for axis in axes:
        for line in axis.lines:
            drawn = np.asarray(line.get_xydata())
            drawn = drawn[np.isfinite(drawn).all(axis=1)]
            assert drawn[:, 0].max(initial=0.0) <= end + 0.2 or len(drawn) <= 2  # marks of modes and of the bound are two points
    (orange,) = [line for line in axes[0].lines if line.get_label() == "direct"]
    x, y = (np.asarray(part) for part in orange.get_data())
    assert (direct.coherence[np.isfinite(y)] >= 0.7).all()
    assert x.size == direct.frequency.size


@pytest.mark.parametrize("settings", [Settings(low=90.0, high=20.0),
                                      Settings(postures=(0,)), Settings(postures=(1, -4)), replace(QUICK, postures=(2,))])
def test_settings_that_make_no_sense(settings: Settings) -> None:
    """C02, named."""
    with pytest.raises(UsageError) as caught:
        computed(LINK.log(), settings=settings)
    assert caught.value.code == "RRID-C02"


def test_too_short_is_rejected() -> None:
    """Two seconds of a turn: T08, and how long it should be."""
    with pytest.raises(InputRejected) as caught:
        computed(replace(LINK, seconds=2.5).log())
    assert caught.value.code == "RRID-T08"


def test_an_input_of_the_wrong_sign_is_rejected() -> None:
    """Not half a turn of phase taken for a delay: S14."""
    log = LINK.log()
    with pytest.raises(InputRejected) as caught:
        computed(replace(log, signals={**log.signals, "r": Signal(-log["r"], "rad/s^2", "input")}))
    assert caught.value.code == "RRID-S14"


def test_noise_alone_names_nothing() -> None:
    """A position that answers nothing: gated by its coherence, no finding."""
    log = LINK.log()
    noise = 1e-6 * np.random.default_rng(5).standard_normal(log.q.shape)
    result = computed(replace(log, signals={**log.signals, "q": Signal(log["q_ref"] + noise, "rad", "position")}))
    assert [one.kind for one in result.classification] == []
    assert any(check.gate for check in result.data_quality)
