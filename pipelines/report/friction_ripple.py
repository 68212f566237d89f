"""A ripple along the turn that a friction fit leaves: a sentence of the verdict, a section and its figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.model.friction.misfit import inertia_in_words, waves_in_words
from pipelines.model.friction.result import JointResult, Value
from pipelines.model.friction.ripple import Along
from pipelines.report import style
from pipelines.report.report import Figure, Section
from pipelines.report.style import format_number, format_unit, with_std

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

__all__ = ["ripple_in_words", "ripple_section"]


def _shown(value: Value) -> str:
    return f"{with_std(value.value, value.std)} {format_unit(value.unit)}"


def _turns(joint: JointResult) -> bool:
    return joint.inertia.unit == "kg m^2"


def ripple_in_words(joint: JointResult) -> str:
    """What, how much, and how it is known to be no friction; empty where there is no ripple."""
    ripple = joint.ripple
    if ripple is None:
        return ""
    return (f"Most of what the law leaves at {joint.name} is no friction: {with_std(ripple.rms.value, ripple.rms.std)} "
            f"{ripple.rms.unit} rms repeats along the {'turn' if _turns(joint) else 'travel'}, "
            f"{waves_in_words(ripple, _turns(joint))}, at all speeds and both ways, as cogging does.")


def ripple_section(joint: JointResult) -> tuple[Section, ...]:
    """Its size beside all that is left, what it does to the inertia, what to do, and the torque by angle."""
    ripple = joint.ripple
    if ripple is None:
        return ()
    figure = ripple_figure(f"ripple-{joint.joint}", f"{joint.name}: what friction and inertia leave, by the angle of the joint: "
                           "the same forth and back, as no friction is.", ripple.along, _turns(joint))
    text = (f"{ripple_in_words(joint)} It explains {format_number(100.0 * ripple.share, 2)} % of what the law leaves of blocks "
            f"that were held out (mean square). {inertia_in_words(joint, ripple, _shown)}.",
            f"'rrrid diagnose' on these logs names it; 'rrrid extend --with cogging:{joint.joint}' takes it into the model.")
    return (Section(f"{joint.name}: a ripple along the {'turn' if _turns(joint) else 'travel'}", text, (), (figure,)),)


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
