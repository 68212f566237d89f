"""The stages of rrrid and the toolboxes they are made of."""

__version__ = "0.1.0"  # the package's own: to ask importlib.metadata costs every run 15 ms
