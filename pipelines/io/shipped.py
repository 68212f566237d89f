from pipelines.io.robot import shipped, shipped_names

__all__ = ["shipped", "shipped_names"]
