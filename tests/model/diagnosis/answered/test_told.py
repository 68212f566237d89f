"""The sentence for a technician: what is wrong, where, and how much, in the unit of the joint."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.answered.loud import only_if_loud
from pipelines.model.diagnosis.answered.told import sentence
from pipelines.model.diagnosis.named.verdict import Ruling
from pipelines.model.diagnosis.result import Value
from pipelines.model.effects import find_effect


@pytest.mark.parametrize(("joint", "words"), [
    (1, "Cogging at joint 1: 0.25 N m rms of torque."),
    (2, "Cogging at joint 2: 0.25 N rms of force."),
    (None, "Cogging: 0.25 N m rms of torque or N rms of force.")])
def test_what_a_slide_lacks_is_a_force(joint: int | None, words: str) -> None:
    finding: Any = SimpleNamespace(cause="cogging", title="Cogging", joint=joint, torque_rms=0.25, parameters={})
    assert sentence(Ruling("cause", (0,), ""), (finding,), (True, False), np.array([0.3, 0.3])) == words


def test_what_the_model_hid_and_the_other_joint_are_told() -> None:
    """4.6 N m at a joint whose model was only 1.6 N m off: friction had taken in the rest."""
    finding: Any = SimpleNamespace(cause="transmission_coupling", title="A motor that turns with two joints", joint=1,
                                   torque_rms=4.6, parameters={"with_joint": Value(2, None, "1")})
    assert sentence(Ruling("cause", (0,), ""), (finding,), (True, True), np.array([1.6, 1.6])) == (
        "A motor that turns with two joints at joint 1 (with joint 2): 4.6 N m rms of torque, most of which the nominal model had "
        "taken in.")


@pytest.mark.parametrize(("others", "words"), [
    (1, "; and a torque that is logged late (122 ms) at joint 1"),
    (2, "; a torque that is logged late (122 ms) at joint 1 and Stribeck friction at joint 2"),
    (4, "; a torque that is logged late (122 ms) at joint 1, Stribeck friction at joint 2 and 2 more")])
def test_what_was_found_beside_is_named(others: int, words: str) -> None:
    """A lag of 122 ms is not to be missed because a ripple takes more."""
    lag: Any = SimpleNamespace(cause="torque_lag", title=find_effect("torque_lag").title, joint=1, torque_rms=0.02,
                               parameters={find_effect("torque_lag").size: Value(0.1215, 0.006, "s")})
    hump: Any = SimpleNamespace(cause="stribeck", title="Stribeck friction", joint=2, torque_rms=0.01, parameters={})
    ripple: Any = SimpleNamespace(cause="cogging", title="Cogging", joint=1, torque_rms=0.25, parameters={})
    named = (ripple, lag, hump, hump, hump)[:1 + others]
    assert sentence(Ruling("cause", (0,), ""), named, (True, True), np.array([0.3, 0.3])) == (
        f"Cogging at joint 1: 0.25 N m rms of torque{words}.")


@pytest.mark.parametrize(("noise", "doubt"), [
    (0.35,
     ", and only if its drives are as noisy as 0.35 N m at joint 2 (2.3 % of the rated torque), which may be a fault"), (0.1, "")])
def test_nothing_wrong_says_in_one_breath_where_only_loud_drives_would_leave_so_much(noise: float, doubt: str) -> None:
    """A gap shakes its twin as well. Who reads the sentence alone is not told that all is well; nor is a healthy arm called ill."""
    told = only_if_loud(np.array([0.1, noise]), (60.0, 15.0), (True, True))
    assert told == doubt
    assert sentence(Ruling("nothing-wrong", (), ""), (), (True, True), np.ones(2), told) == (
        f"Nothing is wrong with this arm, as far as these logs can tell{doubt}.")


def test_noise_that_nobody_knows_is_not_loud() -> None:
    """Nor is any of a joint that is not rated; a slide's is a force."""
    assert not only_if_loud(np.full(2, np.nan), (60.0, 15.0), (True, True))
    assert not only_if_loud(np.full(2, 9.0), (np.inf, np.inf), (True, True))
    assert " 9 N at joint 1 " in only_if_loud(np.full(1, 9.0), (60.0,), (False,))
