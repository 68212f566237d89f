"""The virtual test bench: a MuJoCo plant with faults that shares only pipelines.io."""
