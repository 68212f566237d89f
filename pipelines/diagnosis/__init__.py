"""Diagnosis as one Gaussian model: y = N b + D s + X θ + e, one prior, one decision."""
