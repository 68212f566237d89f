from pipelines.io.results import *  # noqa: F403
