"""What is measured: logs, robots, recipes and results on disk. The only door to h5py, pandas and pyarrow."""

import os

# Before pyarrow is imported: its other allocators reserve more address space than a guarded child may use.
os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
