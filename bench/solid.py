"""A rigid body as mass, centre of mass and inertia about it: moved between frames, perturbed, taken apart."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.io.experiment import Array
from pipelines.io.robot import LinkParameters

__all__ = ["Solid", "axis_rotation"]


def axis_rotation(axis: Array, angle: float) -> Array:
    """R = 1 + sin(angle) [a]× + (1 - cos(angle)) [a]×², Rodrigues; `axis` is a unit vector (3,)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


@dataclass(frozen=True, eq=False)
class Solid:
    """One rigid body."""

    mass: float  # [kg]
    com: Array  # (3,) [m]
    inertia: Array  # (3, 3) [kg m^2] tensor about the centre of mass, products negative: I_xy = -∫ xy dm

    @classmethod
    def of_link(cls, link: LinkParameters) -> Solid:
        """From parameters about the frame's origin: I_c = I_o - m (|c|² 1 - c cᵀ), products with positive sign there."""
        xx, yy, zz, xy, xz, yz = link.inertia
        about_origin = np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]])
        c = np.array(link.com)
        return cls(link.mass, c, about_origin - link.mass * (c @ c * np.eye(3) - np.outer(c, c)))

    def as_link(self) -> LinkParameters:
        """The inverse of `of_link`."""
        c = self.com
        tensor = self.inertia + self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
        x, y, z = c.tolist()
        return LinkParameters(self.mass, (x, y, z), (xx, yy, zz, -xy, -xz, -yz))

    def seen_from(self, rotation: Array, position: Array) -> Solid:
        """The same body in the frame in which its own frame has this rotation (3, 3) and position (3,)."""
        return Solid(self.mass, rotation @ self.com + position, rotation @ self.inertia @ rotation.T)

    def about(self, point: Array, axis: Array) -> float:
        """Its inertia about the line through `point` along the unit vector `axis` [kg m^2]."""
        arm = np.cross(axis, self.com - point)
        return float(axis @ self.inertia @ axis + self.mass * arm @ arm)

    @property
    def second_moments(self) -> Array:
        """S = ∫ r rᵀ dm = ½ tr(I) 1 - I about the centre of mass: positive definite for a body that can exist."""
        return np.asarray(0.5 * np.trace(self.inertia) * np.eye(3) - self.inertia)

    @property
    def exists(self) -> bool:
        """Return whether mass could be spread so: positive mass, S positive definite (Traversaro et al. 2016)."""
        return self.mass > 0.0 and bool(np.linalg.eigvalsh(self.second_moments).min() > 0.0)

    def drawn(self, rng: np.random.Generator, share: float) -> Solid:
        """A body like this one: mass, centre and second moments each within ± `share` of its own.

        S is stretched as D S D with a diagonal D, which keeps it positive definite.
        """
        factor = 1.0 + rng.uniform(-share, share, 7)
        stretch = np.diag(np.sqrt(factor[4:]))
        moments = stretch @ self.second_moments @ stretch
        return Solid(self.mass * factor[0], self.com * factor[1:4], np.trace(moments) * np.eye(3) - moments)

    def without_disc(self, axis: Array, inertia: float) -> Solid:
        """The rest of it when a thin disc J (½ 1 + ½ a aᵀ) about the unit vector `axis` turns apart from it."""
        return replace(self, inertia=self.inertia - disc(axis, inertia))

    def largest_disc(self, axis: Array, wanted: float) -> float:
        """Inertia [kg m^2] of the disc about `axis` that can be taken out of it, at most `wanted`."""
        inertia = wanted
        while not self.without_disc(axis, inertia).exists:
            inertia *= 0.8
        return inertia


def disc(axis: Array, inertia: float) -> Array:
    """Tensor (3, 3) of a thin disc, the same however far it has turned about `axis`."""
    return np.asarray(0.5 * inertia * (np.eye(3) + np.outer(axis, axis)))
