"""Check whether a rigid body can have the inertial parameters that a description states."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.io.robot import LinkParameters

__all__ = ["inconsistency", "of_link"]

Array = npt.NDArray[np.float64]


def inconsistency(mass: float, inertia: Array, tolerance: float = 0.01) -> str:
    """Return why no rigid body has this mass [kg] and inertia (3, 3) [kg m^2] about its centre of mass; "" where one has.

    A body exists where m > 0 and the second moment of its density, Σ = ½ tr(I) 1 - I, has no
    negative eigenvalue (Wensing, Kim and Slotine 2018, pseudo-inertia): with the principal
    moments A ≤ B ≤ C, that is A ≥ 0 and C ≤ A + B.

    Args:
        tolerance: violation that rounding explains, as a part of the trace; a URDF of two digits has half a percent.
    """
    smallest, middle, largest = np.linalg.eigvalsh(0.5 * (inertia + inertia.T))
    allowed = tolerance * float(np.abs([smallest, middle, largest]).sum())
    if mass <= 0.0 and largest > 0.0:
        return "an inertia without mass"
    if smallest < -allowed:
        return f"a negative moment of inertia, {smallest:.3g} kg m^2"
    if largest > smallest + middle + allowed:
        return f"a moment of inertia, {largest:.3g} kg m^2, above the sum of the two others, {smallest + middle:.3g}"
    return ""


def of_link(link: LinkParameters) -> str:
    """Return the same for a link as a description states it, its inertia about the frame's origin.

    I_c = I_o - m (|c|² 1 - c cᵀ); products of inertia are stated with the sign of +∫xy dm.
    """
    xx, yy, zz, xy, xz, yz = link.inertia
    about_origin = np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]])
    com = np.array(link.com)
    return inconsistency(link.mass, about_origin - link.mass * (com @ com * np.eye(3) - np.outer(com, com)))
