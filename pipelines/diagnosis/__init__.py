"""Diagnose a session by one Gaussian model, y = N b + D s + X θ + e, and one decision.

`pipelines.model.diagnosis`, which `rrrid diagnose` uses, is to be replaced by it. It asks what has
changed since reference logs. Its rows, exact models and frequency responses are still those of that
engine; they move here with its removal.
"""
