from pipelines.io.files import refuse_unlike_format

__all__ = ["refuse_unlike_format"]
