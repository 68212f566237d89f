"""Numbers that decide what is looked for as an effect, each with its meaning and source."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["EFFECTS", "ORDERS"]


@dataclass(frozen=True)
class EffectsConfig:
    """Where searches and refits of effects begin, and what is too little to be a cause."""

    # backlash
    flank_hz: float = 80.0  # [Hz] of the link on a closed flank: stiff beside an arm's motion
    link_share: float = 0.1  # of the inertia that a joint feels, that stays with the link at least
    tight_gap: float = 1.5e-4  # [rad] half an arc minute: precise gears have it, by data sheets
    crossings: tuple[float, ...] = (3e-3, 1e-2, 3e-2)  # [s] through the lubricant, by usual torque
    # cogging
    fewest_waves: float = 1.25  # in the travel: a fit moves one and a half; half a wave is a spring
    leads: float = 0.1  # of the largest harmonic, that the first wave has at least
    apart: float = 0.25  # of the resolution of the range, from a whole order: 45 degrees
    # concave_friction
    carreau: float = 2.0  # Carreau's knee, from which a refit starts
    bluntest: float = 0.3  # knee: with less it is another law
    # contact
    contacts: int = 8  # places in a log where a push is looked for
    # coulomb
    roundness: float = 1.5  # between tanh and the root: where a fit of it begins
    # load_friction
    half: float = 0.5  # from which the share of what rubs behind it is refitted
    # position_friction
    highest_order: float = 16.0  # of friction along the turn, that is searched for
    # presliding
    halfway: float = 0.0  # elastic share from which a refit finds Dahl's -1 and Dupont's 0.5
    other_exponent: float = 0.8  # from which a refit finds others than 1
    breakaway: float = 0.3  # from which a refit finds others, and none
    falling: float = 0.1  # of the fastest speed: over which friction is looked for to fall
    # stribeck
    over: float = 2.0  # times the speed over which friction changes its sign: by then it has
    # terms
    timing: float = 0.1  # of a sample: as well as a log tells when something was
    # three_sigmoid
    sharpnesses: int = 8  # in the grid of sigmoids: 56 ordered triples, 28 pairs
    # torque_lag
    lags: tuple[float, ...] = (0.0, 0.01, 0.03, 0.1)  # [s] of the recorder, that a search compares


@dataclass(frozen=True)
class OrdersConfig:
    """Orders of waves along a joint's angle that are looked for.

    Stops leave many joints 330 or 340 degrees, which tell waves of neighbouring whole orders apart;
    a drive with 7, 12 and 28 waves, recorded over .95 of a turn, was taken for 6.8 and its like.
    """

    nearly: float = 0.1  # of a turn, that may be missing where whole orders are looked for
    closed: float = 0.02  # the same, where what a joint does comes back to where it began
    waves: float = 1.5  # in the travel at least: fewer are the curve of a spring (causes.md)
    highest: float = 150.0  # order that is searched for; of a slide: of its whole travel
    finest: float = 1000.0  # of a slide: a wave of 6 mm, as leads of screws have them
    most: int = 200  # orders on the grid
    least: float = 1e-3  # [rad or m] of travel, that a grid is made for


EFFECTS = EffectsConfig()
ORDERS = OrdersConfig()
