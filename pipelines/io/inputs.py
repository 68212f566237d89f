from pipelines.io.sessions import *  # noqa: F403
