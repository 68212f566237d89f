"""A torque of the joint's angle that a friction fit leaves: a sentence of the verdict, a section and its figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.model.friction.findings import NAMED, depends_in_words, inertia_in_words
from pipelines.model.friction.fit import Value
from pipelines.model.friction.result import JointResult
from pipelines.model.friction.ripple import Along
from pipelines.report import style
from pipelines.report.report import Figure, Section
from pipelines.report.style import format_number, format_unit, with_std

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

__all__ = ["ripple_in_words", "ripple_section"]


def _shown(value: Value) -> str:
    return f"{with_std(value.value, value.std)} {format_unit(value.unit)}"


def ripple_in_words(joint: JointResult) -> str:
    """What, how much, and how it is known to be no friction; empty where there is no ripple."""
    ripple = joint.ripple
    if ripple is None:
        return ""
    return (f"Most of what the law leaves at {joint.name} is no friction: {with_std(ripple.rms.value, ripple.rms.std)} "
            f"{ripple.rms.unit} rms of it {depends_in_words(joint, ripple)}.")


def ripple_section(joint: JointResult) -> tuple[Section, ...]:
    """Its size, what it does to the inertia, what to do, and the torque by angle."""
    ripple = joint.ripple
    if ripple is None:
        return ()
    place = "angle" if joint.revolute else "position"
    figure = ripple_figure(f"ripple-{joint.joint}", f"{joint.name}: what friction and inertia leave, by the {place} of the joint: "
                           "the same forth and back, as no friction is.", ripple.along, joint.revolute)
    inertia = inertia_in_words(joint, ripple, _shown)
    text = (f"{ripple_in_words(joint)} It explains {format_number(100.0 * ripple.share, 2)} % of the law's residual on held-out "
            f"blocks (mean square).{inertia and f' {inertia}.'}", f"{NAMED[:1].upper()}{NAMED[1:]}.")
    return (Section(f"{joint.name}: a torque of the {place}", text, (), (figure,)),)


def ripple_figure(name: str, caption: str, along: Along, revolute: bool) -> Figure:
    """What the law leaves against the angle: forth, back, and the waves that were fitted."""

    def draw(drawing: Drawing) -> None:
        axis = drawing.subplots()
        for values, color, label in ((along.forth, style.VERMILLION, "forth"), (along.back, style.GREEN, "back")):
            axis.plot(along.angle, values, ".", markersize=3.5, color=color, label=label)
        axis.plot(along.angle, along.waves, color=style.BLUE, linewidth=1.0, label="fitted waves")
        axis.set_xlabel("angle [rad]" if revolute else "position [m]")
        axis.set_ylabel("torque left [N m]" if revolute else "force left [N]")
        axis.margins(x=0.01)
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderpad=0.2)

    return Figure(name, caption, draw, size=(6.0, 3.0))
