import signal
import sys

from pipelines.io.sandbox import *  # noqa: F403


def die_with_parent() -> None:
    import ctypes

    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, int(signal.SIGKILL), 0, 0, 0)
