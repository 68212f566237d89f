"""A robot of one joint that slides, level."""

from __future__ import annotations

__all__ = ["SLIDE"]

SLIDE = """name = "slide"
gravity = [-9.81, 0.0, 0.0]
[kinematics]
convention = "dh"
[[joint]]
name = "carriage"
type = "prismatic"
a = 0.0
alpha = 0.0
d = 0.0
offset = 0.0
"""
