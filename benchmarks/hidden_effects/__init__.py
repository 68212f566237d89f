"""Sealed cases: machines of the virtual test bench with hidden causes, and the table of how a
diagnosis fares on them.
"""
