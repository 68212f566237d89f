"""Arms in closed loop whose drives answer to noise: what that looks like is no delay and no lag.

`benchmarks.other_plants` draws them: MuJoCo plants with their own friction laws and controllers.
"""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.other_plants.drawn import drawn
from pipelines.model.estimation.conditioning import wanted_cutoff
from pipelines.model.estimation.logs import Recipe, motions_of, with_cutoff
from pipelines.model.motion import Reconstruction
from tests.diagnosis.arms import hidden
from tests.diagnosis.asking import causes, diagnosed, effects


@pytest.mark.parametrize(("orders", "lowest", "highest", "band"), [
    (100, 0.0, np.inf, "ripple"), (100, 0.0, 25.0, "highest"), (0, 40.0, np.inf, "lowest"), (0, 0.0, np.inf, "motion")])
def test_the_band_of_rows_is_that_of_motion_and_ripple(orders: int, lowest: float, highest: float, band: str) -> None:
    """100 periods a turn at ω rad/s are 100 ω / 2π Hz."""
    recipe = Recipe(orders=orders, lowest_hz=lowest, highest_hz=highest)
    motions = motions_of([hidden(1)], Reconstruction())
    log, found = motions[0]
    wanted = {"ripple": 100.0 * np.abs(found.motion.dq).max() / (2.0 * np.pi), "highest": 25.0, "lowest": 40.0,
              "motion": wanted_cutoff(found.motion, 1.0 / log.sample_time)}
    assert with_cutoff(recipe, motions).cutoff_hz == pytest.approx(wanted[band])


@pytest.mark.slow
def test_a_delay_is_found_alone_and_to_a_twentieth() -> None:
    """Over 25 Hz the drive's answer to noise made 8.7 ms of 7 ms, with a lag of 5.6 ms beside it."""
    found = diagnosed(*drawn(19, 18)[-1].logs())
    assert causes(found) == [("time_delay", 1)]
    assert effects(found)[0].values["delay"] == pytest.approx(7e-3, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "number"), [(31, 4), (18, 20)])
def test_a_torque_that_hops_is_no_delay_and_no_contact(seed: int, number: int) -> None:
    """A force of constant size that changes its sign at random: no cause of the library."""
    found = diagnosed(*drawn(number, seed)[-1].logs())
    assert found.decision.verdict == "unknown"
    assert "wanders" in found.decision.reason


@pytest.mark.slow
def test_no_law_of_friction_stands_beside_friction_of_another_joint() -> None:
    """A healthy joint 1 got "concave friction" beside the position-dependent friction of joint 6."""
    assert causes(diagnosed(*drawn(6, 31)[-1].logs())) == [("position_friction", 6)]
