"""Check that a log sampled slowly moves as arms do: milliseconds that are taken for seconds make every speed a thousandth.

Nothing else in such a log contradicts itself: its steps are even, its rate is the declared one, and the motion is resolved as well
as before. Rates of a few hertz are rare all the same, and arms that creep through their range at less than a degree a second are;
where both come together, and a smaller unit makes usual figures of either, the unit is asked about. An arm may creep.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipelines.errors import Check
from pipelines.quality.checks_motion import peak_speed
from pipelines.quality.checks_subject import Subject

__all__ = ["PACE_CHECKS"]

_RARE_HZ: Final = 10.01  # hardly any controller records that slowly; 10 kHz a thousand times slower are 10 Hz, all but rounding
_CREEPS: Final = 0.02  # [rad/s] or [m/s]: a degree a second, at the fastest joint's fastest
_TRAVELS: Final = 0.1  # [rad] or [m] of the joint that moves most: less is a joint that is held
_UNITS: Final = {"ms": 1e3, "us": 1e6}
_USUAL: Final = (0.1, 30.0)  # [rad/s] peak of the fastest joint of an arm that is identified
_USUAL_HZ: Final = (20.0, 1e5)  # rates


def pace(s: Subject) -> list[Check]:
    """S08: speeds are those of an arm, where it was recorded slower than controllers do."""
    rate = 1.0 / s.log.sample_time
    if rate > _RARE_HZ or s.log.experiment == "hold" or not s.good.time.known:
        return []
    speed = peak_speed(s)
    if np.isnan(speed).all() or s.travel.max() < _TRAVELS:
        return []
    fastest = float(np.nanmax(speed))
    place = int(np.nanargmax(speed))
    fits = [unit for unit, factor in _UNITS.items()
            if _USUAL[0] <= fastest * factor <= _USUAL[1] and _USUAL_HZ[0] <= rate * factor <= _USUAL_HZ[1]]
    unit = s.unit("dq", place)
    if fastest >= _CREEPS or not fits:
        return s.ok("S08", f"speeds up to {fastest:.3g} {unit}, at {rate:.3g} Hz", signal="t")
    factor = _UNITS[fits[0]]
    return [s.say("S08", "warn",
                  f"sampled every {s.log.sample_time:.4g} s, and no joint is faster than {fastest:.2g} {unit}; hardly any arm is "
                  f"so slow: with steps in {fits[0]}, joint {place + 1} would reach {fastest * factor:.2g} {unit} at "
                  f"{rate * factor:.4g} Hz",
                  signal="t",
                  remedy=f'if its time is in {fits[0]}, declare unit = "{fits[0]}" in [time] of its recipe and import it anew; if '
                         "the arm did creep, all is right")]


PACE_CHECKS = (pace,)
