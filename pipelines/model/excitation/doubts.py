"""What is said against a design: a ceiling that was not reached, a rehearsal that failed or went beyond a limit."""

from __future__ import annotations

from pipelines.errors import Check
from pipelines.model.excitation.rehearse import Beyond, Rehearsal
from pipelines.model.excitation.result import Result

__all__ = ["beyond_words", "doubts"]


def doubts(result: Result) -> tuple[Check, ...]:
    """C08, the condition number that was asked for; D17, no rehearsal; D12, a limit that the rehearsal did not keep."""
    found = []
    if not result.reached:
        dear = result.dearest
        found.append(Check.of("C08", "warn", f"a condition number of {result.ceiling:g} was not reached"
                              f"{f'; the {dear} is most in the way' if dear else ''}", where=result.robot, gate=True,
                              remedy="search longer, give more harmonics, or widen that limit"))
    if result.rehearsal_failed:
        found.append(Check.of("D17", "warn", f"the rehearsal failed: {result.rehearsal_failed}", where=result.robot,
                              remedy="check the model before the robot moves"))
    motion = () if result.rehearsal is None else (("the motion", result.rehearsal),)
    found += [Check.of("D12", "warn", f"rehearsed in simulation, {name} goes beyond limits: {', '.join(words)}", where=result.robot,
                       gate=True, remedy=_remedy(rehearsal))
              for name, rehearsal in (*motion, *result.rehearsals) if (words := beyond_words(result.joints, rehearsal))]
    return tuple(found)


def _remedy(found: Rehearsal) -> str:
    ways = {"torque": "a smaller torque_share", "speed": "a smaller speed_share",
            "position": "another --home, or a position range in the robot description that leaves room"}
    named = dict.fromkeys(ways.get(one.quantity, ways["position"]) for one in found.beyond)
    return f"plan it again with {', and '.join(named)}; or make sure that your controller follows more closely"


def beyond_words(joints: tuple[str, ...], found: Rehearsal) -> list[str]:
    """What a rehearsal says against a motion, limit by limit: drives that saturate, joints beyond their speed or range."""
    return [_words(joints[one.joint], one) for one in found.beyond]


def _words(joint: str, one: Beyond) -> str:
    if one.quantity == "torque":
        return f"the drive of {joint} saturates in {100.0 * one.by:.2g} % of the samples"
    if one.quantity == "speed":
        return f"{joint} reaches {100.0 * (1.0 + one.by):.4g} % of its speed limit"
    return f"{joint} goes {one.by:.2g} {one.unit} beyond its range"
