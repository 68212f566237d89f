from pipelines.io.model_file import read_covariance, write_covariance

__all__ = ["read_covariance", "write_covariance"]
