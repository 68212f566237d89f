"""The arm as equations: its geometry, its motion, and the torque that this takes."""
