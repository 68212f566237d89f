from pipelines.io.schema import log_schema

__all__ = ["log_schema"]
