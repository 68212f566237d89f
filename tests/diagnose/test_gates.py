"""What is wrong with the data is found before any physics is blamed, with its repair: swapped joints, a flipped sign, a gear ratio,
degrees, amperes, clocks that drift apart. A fault of the arm closes no gate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from pipelines import diagnose
from pipelines.errors import InputRejected, NothingMatched
from pipelines.estimation.checks.plausibility import examined
from pipelines.io.log import Array, ExperimentLog
from pipelines.stage import Request, run_stage
from tests.diagnose.sessions import session, written

Spoil = Callable[[ExperimentLog], ExperimentLog]


def changed(log: ExperimentLog, **values: Array) -> ExperimentLog:
    return replace(log, signals={**log.signals, **{name: replace(log.signals[name], values=x) for name, x in values.items()}})


def turned(log: ExperimentLog, factors: tuple[float, float, float]) -> ExperimentLog:
    """Angles of the encoders multiplied; what the controller was told goes with them."""
    names = [name for name in log.signals if name in ("q", "q_ref", "dq_ref", "ddq_ref", "q_obs", "dq_obs", "ddq_obs")]
    return changed(log, **{name: log[name] * np.array(factors) for name in names})


def drifting(log: ExperimentLog) -> ExperimentLog:
    """Torque recorded by a clock that gains 20 ms over the log."""
    t = log.t + 0.02 * (log.t - log.t[0]) / (log.t[-1] - log.t[0])
    return changed(log, tau=np.column_stack([np.interp(log.t, t, column) for column in log.tau.T]))


SPOILT: dict[str, tuple[Spoil, str, str]] = {
    "swapped joints": (lambda log: changed(log, tau=log.tau[:, [1, 0, 2]]), "RRID-S13", "column map"),
    "flipped sign": (lambda log: changed(log, tau=log.tau * np.array([1.0, -1.0, 1.0])), "RRID-S14", "change the sign"),
    "gear ratio": (lambda log: turned(log, (1.0, 1.0, 2.0)), "RRID-S15", "gear ratio"),
    "degrees": (lambda log: turned(log, (57.29577951308232,) * 3), "RRID-S07", "deg"),
    "clocks": (drifting, "RRID-T06", "one clock"),
}


@pytest.fixture(scope="module")
def healthy() -> ExperimentLog:
    return session("", None, 6.0, 1)[0]


@pytest.mark.slow
@pytest.mark.parametrize("what", SPOILT)
def test_data_that_are_wrong_are_refused_with_their_repair(what: str, healthy: ExperimentLog, tmp_path: Path) -> None:
    spoil, code, repair = SPOILT[what]
    folder = written(tmp_path / "logs", [spoil(healthy)])
    with pytest.raises(InputRejected) as refused:
        run_stage(diagnose.STAGE, Request((folder,), out=tmp_path / "out"), diagnose.Settings())
    assert refused.value.code == code
    assert repair in refused.value.remedy
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("cause", "joint"), [("time_delay", 1), *(
    pytest.param(*other, marks=pytest.mark.slow) for other in (("torque_crosstalk", 2), ("torque_gain", 2), ("torque_lag", 1)))])
def test_a_fault_of_the_arm_closes_no_gate(cause: str, joint: int) -> None:
    """At full strength, and of the kinds that look most like a mix-up."""
    assert [check.code for check in examined(session(cause, joint, 6.0, 1))[0] if check.gate] == []


def test_torque_in_amperes_is_refused(healthy: ExperimentLog, tmp_path: Path) -> None:
    """Its unit is a unit of current."""
    folder = written(tmp_path / "logs", [healthy])
    with h5py.File(folder / "excitation-1.h5", "r+") as file:
        file["signals/tau"].attrs["units"] = "A"
        del file.attrs["digest"]
    with pytest.raises(InputRejected) as refused:
        run_stage(diagnose.STAGE, Request((folder,), out=tmp_path / "out"), diagnose.Settings())
    assert "'A' is a unit of current; torque needs" in refused.value.message


def test_one_recording_cannot_be_fitted_and_judge(healthy: ExperimentLog, tmp_path: Path) -> None:
    folder = written(tmp_path / "logs", [healthy, replace(healthy, name="again", role="validate")])
    with pytest.raises(InputRejected) as refused:
        run_stage(diagnose.STAGE, Request((folder,), out=tmp_path / "out"), diagnose.Settings())
    assert refused.value.code == "RRID-D14"


def test_without_a_log_to_fit_it_says_what_there_is(healthy: ExperimentLog, tmp_path: Path) -> None:
    folder = written(tmp_path / "logs", [replace(healthy, role="validate")])
    with pytest.raises(NothingMatched, match=r"excitation \(validate\)"):
        run_stage(diagnose.STAGE, Request((folder,), out=tmp_path / "out"), diagnose.Settings())
