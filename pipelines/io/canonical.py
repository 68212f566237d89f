from pipelines.io.log import *  # noqa: F403
