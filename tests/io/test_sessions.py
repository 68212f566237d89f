"""Which logs go together: one robot and one day, what was before, and what the user named."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.io.files import Opened
from pipelines.io.sessions import (
    Inputs,
    SeveralSessions,
    apart,
    of_one_session,
)
from tests.io.logs import ROBOT_TEXT, small_log

DAY, NEXT, LATER = "2026-03-02T09:00:00Z", "2026-03-03T09:00:00Z", "2026-05-18T09:00:00Z"


def opened(name: str, folder: str = "logs", **about: object) -> Opened:
    """A log of 20 samples in a file of its name; files of equal names in two folders differ."""
    path = Path(folder) / f"{name}.h5"
    return Opened(path, str(path), small_log(20, name=name, **about), ())


def together(*logs: Opened, named: tuple[Opened, ...] = ()) -> dict[str, set[str]]:
    """The names of the logs of every session."""
    return {one.name: {o.log.name for o in one.logs} for one in apart((*logs, *named), [o.path for o in named])}


def test_one_description_is_two_robots_where_they_have_two_names() -> None:
    """Two arms of one make are told apart by `robot_name` alone, and two descriptions of one name by the description."""
    found = together(opened("a", robot_name="arm-a", recorded=DAY), opened("b", robot_name="arm-b", recorded=None))
    assert found == {"arm-a 2026-03-02": {"a"}, "arm-b": {"b"}}
    other = ROBOT_TEXT.replace("9.8062", "9.81")
    assert list(together(opened("a", recorded=DAY), opened("b", recorded=DAY, robot_text=other)).values()) == [{"a"}, {"b"}]


def test_several_robots_are_refused_with_the_names_of_all() -> None:
    """The error says what is whose."""
    a, b = opened("a", robot_name="arm-a"), opened("b", "other", robot_name="arm-b")
    with pytest.raises(SeveralSessions, match=r"several robots: arm-a.* \(a\.h5\); arm-b.* \(b\.h5\)") as refused:
        of_one_session(Inputs((a, b)))
    assert [name.split()[0] for name in refused.value.names] == ["arm-a", "arm-b"]
    assert refused.value.exit_code == 2
    assert refused.value.as_dict()["sessions"] == list(refused.value.names)
    assert of_one_session(Inputs((b,))).logs == (b,)


@pytest.mark.parametrize(("hours", "sessions"), [
    (("2026-03-02T22:00", "2026-03-02T23:30", "2026-03-03T01:00"), 1),  # an afternoon in California
    (("2026-03-02T23:50", "2026-03-03T02:40", "2026-03-03T09:00"), 1),  # a morning in Japan
    (("2026-03-02T22:00", "2026-03-03T01:01"), 2),  # a pause of more than three hours
    (("2026-03-02T15:00", "2026-03-02T22:00", "2026-03-03T00:30", "2026-03-03T03:01"), 2),  # more than twelve hours
])
def test_a_session_goes_on_across_midnight(hours: tuple[str, ...], sessions: int) -> None:
    found = together(*(opened(hour, recorded=f"{hour}:00Z") for hour in hours))
    assert len(found) == sessions
    assert [day[-10:] for day in found] == ["2026-03-02", "2026-03-03"][:sessions]
