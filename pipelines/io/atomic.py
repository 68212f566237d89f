from pipelines.io.output import *  # noqa: F403
