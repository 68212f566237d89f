"""Matrices in, estimates out: least squares, identifiability. No robot words."""
