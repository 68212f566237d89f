"""`rrrid diagnose` does not say "nothing wrong" where the logs cannot show it.

The library has two causes that none of these logs holds, for speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import diagnose, import_log
from pipelines.diagnosis import engine
from pipelines.diagnosis.result import Diagnosis
from pipelines.estimation.preparation import Logs
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.results import encode
from pipelines.report.sections import CARD
from pipelines.stage import Request, run_stage
from tests.diagnose.sessions import but, healthy_again, session, written
from tests.diagnosis.asking import answered
from tests.healthy import fourier, make_log, with_signal

FEW = but("torque_offset", "torque_gain")


def undescribed(logs: Sequence[ExperimentLog]) -> list[ExperimentLog]:
    """Return the logs without their controller."""
    return [replace(log, controller=None) for log in logs]


def rubbing(logs: Sequence[ExperimentLog], size: float) -> list[ExperimentLog]:
    """Return the logs with friction of joint 3 that depends on the angle of joint 1, a law that no model here has."""
    def torque(log: ExperimentLog) -> Array:
        more = size * np.sign(np.gradient(log.q[:, 2])) * np.abs(np.sin(7.0 * log.q[:, 0]))
        return log.tau + np.column_stack([np.zeros((log.n_samples, 2)), more])

    return [with_signal(log, tau=torque(log)) for log in logs]


def asked(logs: Sequence[ExperimentLog]) -> Diagnosis:
    return answered(Logs.by_role(logs), exclude=FEW)


@pytest.fixture(scope="module")
def rubbed(tmp_path_factory: pytest.TempPathFactory) -> diagnose.Result:
    """A healthy arm of much friction that the model lacks, whose controller nobody has described."""
    folder = written(tmp_path_factory.mktemp("rubbing"), rubbing(undescribed(session()), 1.0))
    settings = diagnose.Settings(exclude=FEW, max_causes=1)
    return diagnose.compute(diagnose.read(Request((folder,)), settings), settings, whole=False)


def test_what_the_model_leaves_without_a_noise_floor_cannot_be_judged(rubbed: diagnose.Result) -> None:
    """It is said why, where, and what to record; --check ends in 1."""
    stored = encode(rubbed)[0]
    assert (stored["verdict"], stored["findings"]) == ("cannot-judge", [])
    assert (diagnose.STAGE.exit_code(rubbed, True), diagnose.STAGE.exit_code(rubbed, False)) == (1, 0)
    for words in ("no noise floor is known", "% of the torque of joint 3", "record reference logs"):
        assert words in stored["reason"]
    assert "joint 1" not in stored["reason"]


def test_what_the_logged_torque_is_comes_first(rubbed: diagnose.Result) -> None:
    assert encode(rubbed)[0]["boundary"]["sign"] == "signed"
    assert diagnose.report(rubbed).sections[0].title == CARD


@pytest.mark.slow
def test_reference_logs_are_a_noise_floor() -> None:
    """The same friction before and after: nothing has changed, however much of it no model has."""
    logs = rubbing(undescribed(session()), 1.0)
    assert engine.diagnose([*logs, *healthy_again(logs)]).decision.verdict == "no-fault-found"


@pytest.mark.parametrize(("base_hz", "verdict"), [(0.4, "no-fault-found"), (0.13, "cannot-judge")])
def test_motion_that_comes_again_is_a_noise_floor(base_hz: float, verdict: str) -> None:
    """Noise of some hundredths of the torque in a motion that comes three times, or not once: what differs is noise."""
    rng, logs = np.random.default_rng(5), []
    for k, role in enumerate(("identify", "validate")):
        log = make_log(fourier(np.random.default_rng(k), base_hz=base_hz), duration=7.5, seed=k)
        tau = log.tau + 0.3 * np.std(log.tau, axis=0) * rng.standard_normal(log.tau.shape)
        logs.append(replace(with_signal(log, tau=tau), name=role, role=role, period=None))
    assert asked(logs).verdict == verdict


def test_logs_that_do_not_determine_the_model_cannot_be_judged() -> None:
    """An arm that hardly moves: the model fits, for nearly any would."""
    logs = [replace(make_log(fourier(np.random.default_rng(5 + k), level=0.003), seed=k), name=role, role=role)
            for k, role in enumerate(("identify", "validate"))]
    found = asked(logs)
    assert found.verdict == "cannot-judge"
    assert "the logs do not determine the model" in found.reason
    assert "move the joints concerned further and faster" in found.reason
    assert found.checks == ()  # nor the sign of viscous friction


@pytest.mark.slow
def test_a_joint_that_moves_one_way_alone_cannot_be_judged(shared: Path, tmp_path: Path) -> None:
    """Case 46: Coulomb friction of joints 2 and 6 is confounded with a torque offset there, which may be any fault."""
    case = shared / "cases" / "46-panda-tip-link-remedy"
    settings = import_log.Settings(recipe=str(case / "r2.toml"), source=case)
    run_stage(import_log.STAGE, Request((), tmp_path / "imported", no_report=True), settings)
    chosen = diagnose.Settings()
    found = diagnose.compute(diagnose.read(Request((tmp_path / "imported" / "logs",)), chosen), chosen, whole=False)
    assert encode(found)[0]["verdict"] == "cannot-judge"
    assert "Coulomb friction at joint 2 and torque offset at joint 2 cannot be separated" in encode(found)[0]["reason"]
