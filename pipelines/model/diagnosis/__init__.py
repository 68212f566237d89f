"""Rows, exact models and the results that the diagnosis (`pipelines.diagnosis`) works with.

asked       settings and logs, and the checks that come before any physics
rows        logs as equations: how signals become rows
fitted      the nominal model on the rows, and an arm with its effects fitted exactly
given       frequency responses, and friction laws with no more terms than the logs determine
screened    every cause at every joint in every shape, as columns
worth       numbers and proof of a cause, and its gain on held-out rows
answered    the result, its words, and the verdict "cannot-judge"
result      the fields of the result
"""
