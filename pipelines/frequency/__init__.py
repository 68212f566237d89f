"""From logs of a slowly turning, excited joint to its frequency responses, their modes, and what bends."""
