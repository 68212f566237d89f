"""What is measured: logs, robots, recipes and results on disk. The only door to h5py, pandas and pyarrow."""
