"""Checks of what a log holds, made before a model of the arm is fitted."""
