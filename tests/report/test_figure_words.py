"""What figures are called in reports: causes and their parameters in words, everything else as it is."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from pipelines.effects import effect_names, find_effect
from pipelines.report.result_figures import fitted, residuals, robot_of
from pipelines.report.words import figure_in_words


@pytest.mark.parametrize(("name", "words"), [
    ("coulomb:3:level", "Coulomb friction at joint 3, level"),
    ("viscous:1:coefficient_2", "Viscous friction at joint 1, second coefficient"),
    ("estimate-bps torque_offset:2:offset", "estimate-bps: torque offset at joint 2, offset"),
    ("diagnose cogging joint 2 amplitude 3", "diagnose: cogging at joint 2, third amplitude"),
    ("extend model viscous joint 1 coefficient", "extend model: viscous friction at joint 1, coefficient"),
    ("fit-friction waist stribeck joint 1 varpro coulomb.level", "fit-friction waist: Coulomb friction at joint 1, level"),
    ("fit-friction waist stribeck joint 1 varpro gravity sine", "fit-friction waist: joint 1, gravity sine"),
    ("fit-friction waist three_sigmoid joint 1 varpro f1", "fit-friction waist: friction of three sigmoids at joint 1, f1"),
    ("fit-friction waist stribeck joint 1 varpro stribeck.speed", "fit-friction waist: Stribeck friction at joint 1, speed"),
    ("fit-friction waist three_sigmoid joint 1 varpro three sigmoid.f1",
     "fit-friction waist: friction of three sigmoids at joint 1, f1"),
    ("payload mass", "Payload at the tip, mass"),
    ("diagnose cogging joint 2 torque rms", "diagnose: cogging at joint 2, torque rms"),
    ("estimate-bps p3", "estimate-bps p3"), ("torque rms validate joint 2", "torque rms validate joint 2"), ("", "")])
def test_causes_are_told_in_words(name: str, words: str) -> None:
    assert figure_in_words(name) == words


@pytest.mark.parametrize("effect", effect_names())
def test_no_key_of_any_effect_is_left(effect: str) -> None:
    """However a result spells it: every effect, every parameter."""
    kind = find_effect(effect)
    at = "" if kind.scope == "arm" else "2"
    for q in kind.parameters:
        for name in (f"estimate-bps {effect}:{at and at + ':'}{q.name}",
                     f"extend model {effect}{at and ' joint ' + at} {q.name.replace('_', ' ')}"):
            said = figure_in_words(name)
            assert kind.words.title.lower() in said.lower()
            assert not re.search(r"\w[_:]\w", said), said


def test_every_figure_of_a_result_has_a_name_of_its_own() -> None:
    """What stands in a list without a name is called by its list and number, a letter of the writing task by its label."""
    figure = {"value": 1.0, "std": 0.1, "unit": "N m"}
    friction = {"joints": [{"joint": 1, "break_away": [{"torque": figure}, {"torque": figure}]}]}
    assert list(fitted(friction)) == ["joint 1 break away 1", "joint 1 break away 2"]
    writing = {"logs": [{"name": "w", "letters": [{"label": "letter 1, 'R'", "relative_error": [0.1]},
                                                  {"label": "letter 2, 'R'", "relative_error": [0.2]}]}]}
    assert list(residuals(writing)) == ["w letter 1, 'R' relative error joint 1", "w letter 2, 'R' relative error joint 1"]


def test_what_a_joint_is_in_its_only_posture_is_told_once() -> None:
    """Of several postures each has its own inertia."""
    inertia = {"inertia": {"value": 0.8, "std": 0.1, "unit": "kg m^2"}}
    once = {"joints": [{"joint": 1, **inertia, "postures": [inertia]}]}
    assert list(fitted(once)) == ["joint 1 inertia"]
    twice = {"joints": [{"joint": 1, **inertia, "postures": [inertia, inertia]}]}
    assert list(fitted(twice)) == ["joint 1 inertia", "joint 1 postures 1 inertia", "joint 1 postures 2 inertia"]


def test_a_joint_that_slides_has_its_own_units() -> None:
    """Newton and metres, where the robot or the result says so; what is of no joint stays as it is."""
    log: dict[str, Any] = {"name": "a", "units": ["rad", "m"], "reconstruction_error_max": [1e-5, 2e-5]}
    assert {name: unit for name, (_, unit) in residuals({"logs": [log]}).items()} == {
        "a reconstruction error max joint 1": "rad", "a reconstruction error max joint 2": "m"}
    estimate = {"torque_rms": {"validate": [0.1, 0.2]}, "relative_error": {"validate": 0.02}}
    for result, turning in (({**estimate, "torque_units": ["N m", "N"]}, ()), (estimate, (True, False))):
        assert [unit for _, unit in residuals(result, turning).values()] == ["N m", "N", "1"]
    assert [unit for _, unit in residuals(estimate).values()] == ["N m", "N m", "1"]
    doctor = {"logs": [{"name": "a"}], "previews": [{"units": ["m", "N"]}]}  # position and torque of the first joint
    assert [unit for _, unit in residuals({**estimate, "inspected": doctor}).values()] == ["N m", "N m", "1"]
    run = {"stages": [{"name": "estimate-bps", "result": {**estimate, "torque_units": ["N m", "N"]}},
                      {"name": "diagnose", "result": {"residual_rms": {"validate": [0.1, 0.2]}}}]}
    assert residuals(json.loads(json.dumps(run)))["diagnose nominal model residual rms validate joint 2"] == (0.2, "N")


def test_what_an_extension_leaves_is_not_what_the_nominal_model_left() -> None:
    """Both are there, each by its name; the noise floor is that of both, and listed once."""
    nominal, extended = ({"identify": [error], "validate": [2.0 * error], "noise_floor": [0.01]} for error in (0.3, 0.1))
    assert {name: value for name, (value, _) in residuals({"residual_rms": nominal, "after_rms": extended}).items()} == {
        "nominal model residual rms identify joint 1": 0.3, "nominal model residual rms validate joint 1": 0.6,
        "nominal model residual rms noise floor joint 1": 0.01, "extended model residual rms identify joint 1": 0.1,
        "extended model residual rms validate joint 1": 0.2}


def test_a_robot_is_a_name() -> None:
    """The one of the stage, of its logs or of those of a run; of a model file the one in its description."""
    described = {"base_parameters": [], "robot": 'name = "arm"\n[[links]]', "name": "a model of it"}
    assert robot_of(described) == "arm"
    assert robot_of({**described, "robot": "no = toml = at all"}) == ""
    model = {"model": {"robot": 'name = "arm"\n[[links]]'}}
    for result, name in (({**model, "robot": "arm"}, "arm"), ({**model, "logs": [{"robot": "arm"}]}, "arm"), (model, ""),
                         ({"stages": [{"name": "a", "result": None}, {"result": model}, {"result": {"robot": "arm"}}]}, "arm")):
        assert robot_of(result) == name
