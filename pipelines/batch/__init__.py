"""Many folders of logs: a stage on each of them, in processes that can die alone, and one summary of all."""
