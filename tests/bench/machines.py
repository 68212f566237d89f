"""Machines and short motions that several tests of the bench share."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bench.draw import machine_of
from bench.machine import Machine, coulomb_viscous
from bench.motions import Reference, times
from pipelines.io.log import Array
from pipelines.io.robot import Joint, LinkParameters, RobotDescription

CENTRE = np.array([0.3, -1.4, 0.6])  # [rad]


def sway(
    duration: float = 1.0, centre: Array = CENTRE, hz: float = 1.0, amplitude: float = 0.15
) -> Reference:
    """Every joint to and fro, each at a rate of its own, from rest: q = A (1 - cos wt)²/2, without
    acceleration at first.
    """
    t, w = times(duration), 2.0 * math.pi * hz * (1.0 + 0.3 * np.arange(len(centre)))
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    return Reference(
        t,
        centre + 0.5 * amplitude * (1 - c) ** 2,
        amplitude * w * (1 - c) * s,
        amplitude * w**2 * (s**2 + (1 - c) * c),
    )


def frictionless(machine: Machine) -> Machine:
    return replace(machine, friction=(coulomb_viscous(),) * machine.n)


def unrounded(machine: Machine) -> Machine:
    """With its noise, but neither encoder steps nor torque bits, which turn any small change into a
    whole step.
    """
    return replace(machine, encoder_resolution=(0.0,) * machine.n, quantised_torque=False)


def turntable(inertia: float = 0.8) -> Machine:
    """One joint about the vertical, without friction, noise or quantisation."""
    link = LinkParameters(2.0, (0.0, 0.0, 0.0), (inertia, inertia, inertia, 0.0, 0.0, 0.0))
    robot = RobotDescription(
        "turntable", (0.0, 0.0, -9.81), "dh", (Joint("table", torque=20.0, link=link),)
    )
    machine = machine_of(robot, nuisances=False)
    return frictionless(replace(machine, robot=robot)).ideal
