"""Which numbers a design may be asked for."""

from __future__ import annotations

import math
from typing import Protocol

from pipelines.errors import UsageError

__all__ = ["Asked", "refuse_strange"]


class Asked(Protocol):
    """The numbers among the settings of a design; None where left open."""

    @property
    def time_limit(self) -> float: ...  # [s] of the search

    @property
    def evaluations(self) -> int | None: ...

    @property
    def cond_max(self) -> float | None: ...

    @property
    def periods(self) -> int: ...

    @property
    def tip_speed(self) -> float | None: ...  # [m/s]

    @property
    def sample_time(self) -> float | None: ...  # [s]

    @property
    def torque_share(self) -> float: ...  # of the limits

    @property
    def speed_share(self) -> float: ...  # of the limits

    @property
    def mode_factor(self) -> float: ...

    @property
    def noise(self) -> tuple[float, ...] | None: ...

    @property
    def home(self) -> tuple[float, ...] | None: ...

    @property
    def tip_box(self) -> tuple[float, ...] | None: ...  # [m]

    @property
    def stop_band(self) -> tuple[float, ...]: ...  # [Hz] pairs

    @property
    def seed(self) -> int: ...


def refuse_strange(settings: Asked) -> None:
    """Refuse a number that no design can have.

    Raises:
        UsageError: C02, with the option.
    """
    positive = (("--time-limit", settings.time_limit), ("--evaluations", settings.evaluations), ("--cond-max", settings.cond_max),
                ("--periods", settings.periods), ("--tip-speed", settings.tip_speed), ("sample_time", settings.sample_time),
                ("torque_share", settings.torque_share), ("speed_share", settings.speed_share),
                ("mode_factor", settings.mode_factor), *(("noise", value) for value in settings.noise or ()))
    for where, value in positive:
        if value is not None and not 0.0 < value < math.inf:
            raise UsageError("C02", f"{value:g} is not positive and finite", where=where, remedy="give a positive number")
    if not all(map(math.isfinite, (*(settings.home or ()), *(settings.tip_box or ()), *settings.stop_band))):
        raise UsageError("C02", "a number is not finite", where="--home, --tip-box, --stop-band", remedy="give finite numbers")
    if any(not 0.0 <= low <= high for low, high in zip(settings.stop_band[::2], settings.stop_band[1::2], strict=False)):
        raise UsageError("C02", "a band begins below 0 Hz, or ends before it begins", where="--stop-band", remedy="write 5,8 [Hz]")
    for where, share in (("torque_share", settings.torque_share), ("speed_share", settings.speed_share)):
        if share > 1.0:
            raise UsageError("C02", f"{share:g} of the limits is more than there is", where=where, remedy="give 1 at most")
    if settings.seed < 0:
        raise UsageError("C02", f"the seed {settings.seed} is negative", where="--seed", remedy="give 0 or more")
