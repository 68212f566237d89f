"""Design the writing task and validate a model on it.

    letters, path, timing, task    the task and its joint motion
    control_cases, validation      a model on held-out logs

Kostić et al. 2004, Sections III.B and IV.C.5.
"""
