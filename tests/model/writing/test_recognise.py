"""The letters of a task are read back from the path of its tip alone."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.io.robot_files import load_robot
from pipelines.model.writing.letters import CHARACTERS
from pipelines.model.writing.path import Page
from pipelines.model.writing.profile import Pace
from pipelines.model.writing.recognise import pen_down, read_letters
from pipelines.model.writing.reference import WritingReference, writing_task
from pipelines.model.writing.via_points import via_point_motion

_ALL = CHARACTERS.strip()


def reference(text: str, page: Page, pace: Pace | None = None, sample_time: float = 2e-3) -> WritingReference:
    return writing_task(load_robot("rrr"), text, page, pace).sampled(sample_time)


# all letters; prefixes of one another; ways that run straight on into the next letter; spaces
@pytest.mark.parametrize("text", [*(_ALL[k:k + 6] for k in range(0, len(_ALL), 6)), "PRBF", "IL1I", "UTVZ", "8BQ0O", "A E  T"])
def test_every_text_is_read(text: str) -> None:
    """The very text, spaces included, and each letter's samples are those that the task names, but for some around the
    standstill between two letters."""
    found = reference(text, Page(height=0.08))
    letters = read_letters(found.tip.position)
    assert "".join(" " * letter.spaces + letter.character for letter in letters) == text
    places = np.cumsum([letter.spaces + 1 for letter in letters]) - 1
    told = np.repeat(places, [letter.last - letter.first + 1 for letter in letters])
    other = told != found.letter
    assert np.count_nonzero(other) <= 8 * len(letters)
    assert (found.tip.speed[other] <= 0.01 * found.tip.speed.max()).all()


@pytest.mark.parametrize(("text", "page"), [("RRRID", Page()), ("A E  T", Page(height=0.08)), ("RAD", Page(lift=0.01))])
def test_ways_between_strokes_are_told_from_them(text: str, page: Page) -> None:
    """Within letters and between them, in the plane and lifted: as the task was laid out, but for the rounding of a standstill."""
    found = reference(text, page)
    down = pen_down(found.tip.position)
    assert down is not None
    other = down != (found.drawn > 0.0)
    assert (found.tip.speed[other] <= 0.05 * found.tip.speed.max()).all()
    assert 0.2 < down.mean() < 0.98


@pytest.mark.parametrize(("page", "pace"), [(Page(height=0.05, gap=0.5), None), (Page(height=0.12, x=0.05, z=0.5, lift=0.02), None),
                                            (Page(y=-0.45), Pace(fast=0.2, slow=0.1))])
def test_size_place_gap_lift_and_pace_do_not_matter(page: Page, pace: Pace | None) -> None:
    letters = read_letters(reference("RRD", page, pace).tip.position)
    assert "".join(letter.character for letter in letters) == "RRD"


def test_what_is_no_text_is_not_read() -> None:
    """Random via points, standing still, half a letter, a text upside down."""
    from pipelines.model.rigid.geometry import serial_chain
    from pipelines.model.rigid.kinematics import tip_position

    robot = load_robot("rrr")
    moved = via_point_motion(robot, np.random.default_rng(1), 4)
    tip = reference("RRR", Page()).tip.position
    for other in (tip_position(serial_chain(robot), moved.q), np.tile(tip[:1], (100, 1)), tip[:900], tip * [1.0, 1.0, -1.0]):
        assert read_letters(other) == ()
        assert pen_down(other) is None
