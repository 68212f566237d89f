"""Arms in closed loop whose drives answer to noise: what that looks like is no delay and no lag.

`benchmarks.other_plants` draws them: MuJoCo plants with their own friction laws and controllers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.other_plants.drawn import drawn, pairs
from pipelines import diagnose
from pipelines.io.files import write_log
from pipelines.io.results import encode
from pipelines.stage import Request
from tests.diagnosis.asking import causes, diagnosed, effects


@pytest.mark.slow
def test_a_delay_is_found_alone_and_to_a_twentieth() -> None:
    """Over 25 Hz the drive's answer to noise made 8.7 ms of 7 ms, with a lag of 5.6 ms beside it."""
    found = diagnosed(*drawn(19, 18)[-1].logs())
    assert causes(found) == [("time_delay", 1)]
    assert effects(found)[0].values["delay"] == pytest.approx(7e-3, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "number", "cause", "time"), [(52, 163, "torque_lag", 5.684e-3), (53, 108, "drive_lag", 6.538e-3)])
def test_a_filter_that_is_computed_once_a_sample_is_one_lag_of_its_length(seed: int, number: int, cause: str, time: float) -> None:
    """It acts half a sample sooner than a continuous lag, which got a second lag beside it; standing numbers, in which noise of the
    drive looks like a lag, made 7.3 ms of the first."""
    found = diagnosed(*next(case for case in drawn(number, seed) if case.number_in_name == 1000 * seed + number).logs())
    assert causes(found) == [(cause, 1)]
    (one,) = found.look.reported.model.effects
    assert one.values["time_constant"] == pytest.approx(time, rel=0.01)


@pytest.mark.slow
def test_friction_that_grows_with_load_grows_with_friction_as_it_is() -> None:
    """Friction that changes its sign by an arc tangent loads its gear too: by a hyperbolic tangent a third of it was left."""
    found = diagnosed(*next(case for case in drawn(111, 52) if case.number_in_name == 52111).logs())
    assert causes(found) == [("load_friction", 2)]
    assert effects(found)[0].values["mu"] == pytest.approx(0.14077, rel=0.01)
    assert found.look.selection.end.mean_squares.max() < 1.2


@pytest.mark.slow
def test_friction_beside_a_payload_is_found_at_a_joint_that_the_payload_moves_far_more() -> None:
    """A payload acts as the rigid body does, exactly: 0.4 % of what it explains at joint 4 is more than the error of its law."""
    found = diagnosed(*pairs(4, 61)[-1].logs())
    assert sorted(causes(found), key=str) == [("payload", None), ("position_friction", 4)]
    assert effects(found)[1].values["order"] == pytest.approx(3.0, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "number"), [(31, 4), (18, 20)])
def test_a_torque_that_hops_is_no_delay_and_no_contact(seed: int, number: int) -> None:
    """A force of constant size that changes its sign at random: no cause of the library."""
    found = diagnosed(*drawn(number, seed)[-1].logs())
    assert found.decision.verdict == "unknown"
    assert "wanders" in found.decision.reason


@pytest.mark.slow
def test_a_lag_is_as_sure_as_the_small_lags_of_healthy_joints_allow(tmp_path: Path) -> None:
    """With these taken for none, 5.065 ms of a true 5.055 ms were sure to 4 µs."""
    finding = finding_of(72079, tmp_path)
    lag = finding["parameters"]["time_constant"]
    assert finding["cause"] == "drive_lag"
    assert abs(lag["value"] - 5.0551e-3) < 2.0 * lag["std"]
    assert lag["std"] < 0.01 * lag["value"]


def finding_of(number: int, folder: Path) -> dict[str, Any]:
    """Return the one finding of a drawn machine, as it is written."""
    seed = number // 1000
    case = next(case for case in drawn(1 + number % 1000, seed) if case.number_in_name == number)
    for log in case.logs():
        write_log(folder / f"{log.name}.h5", log)
    settings = diagnose.Settings()
    found = diagnose.compute(diagnose.read(Request((folder,)), settings), settings, whole=False)
    (finding,) = encode(found)[0]["findings"]
    return finding
