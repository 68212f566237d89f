"""Every cause that could be, as columns.

candidates    each effect at every joint, in every shape
wanted        causes that a user names, and why a model cannot take one up
"""
