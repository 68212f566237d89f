"""The virtual test bench: a MuJoCo plant with hidden faults, which shares only log/ and errors with
the rest.
"""
