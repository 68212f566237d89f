"""Frequency responses of a slowly turning, excited joint, their modes, and what bends."""
