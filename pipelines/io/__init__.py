"""Logs, robots, models and results on disk: the only door to h5py, pandas and pyarrow."""
