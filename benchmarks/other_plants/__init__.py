"""Arms that the bench did not draw: other bodies, frictions, loops and faults, for a diagnosis to
survive.
"""
