"""The rows of logs, and the models that are fitted to them.

data            logs as equations: how signals become rows
nominal         rigid body and friction, fitted to rows
exact           the torque of an arm with its effects, and its slopes
fit             all numbers of an exact model at once, and what a model gains on held-out rows
prepare         the logs of a diagnosis, their motions and rows
families        every cause at every joint, as columns
friction_terms  friction laws with no more terms than the logs distinguish
"""
