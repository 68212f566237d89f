"""Diagnose a session by one Gaussian model, y = N b + D s + X θ + e, and one decision.

The rows of logs and the models that are fitted to them are in `pipelines.estimation`.
"""
