"""Diagnose a session by one Gaussian model, y = N b + D s + X θ + e, and one decision."""
