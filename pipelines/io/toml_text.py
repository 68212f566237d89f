from pipelines.io.sandbox import *  # noqa: F403
