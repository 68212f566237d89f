"""Nobody is sent to turn a sign or to change a scale while columns stand in each other's places."""

from __future__ import annotations

from pipelines.errors import Check
from pipelines.quality.checks import columns_first

SIGN = Check.of("S14", "warn", "the torque of joint 1 looks flipped", where="b.h5", remedy="change the sign", gate=True)
SCALE = Check.of("S15", "ok", "torque over that of the described links: 1", where="a.h5")
LATE = Check.of("T06", "warn", "torque lies behind", where="a.h5", remedy="one clock")


def test_mixed_up_columns_explain_a_sign() -> None:
    """S13 of one log speaks for the sign that another one, which moves one joint alone, seems to show."""
    swapped = Check.of("S13", "warn", "tau: columns 1,2 fit swapped", where="a.h5", remedy="correct the column map", gate=True)
    *others, sign = columns_first((LATE, swapped, SCALE, SIGN))
    assert others == [LATE, swapped, SCALE]
    assert (sign.message, sign.gate) == (SIGN.message, True)
    assert "sign" not in sign.remedy
    assert "columns" in sign.remedy


def test_without_them_every_finding_stands_as_it_is() -> None:
    lost = Check.of("S13", "warn", "joint 1's torque is not explained by its motion", where="a.h5", remedy="look")
    assert columns_first((LATE, lost, SIGN)) == (LATE, lost, SIGN)
