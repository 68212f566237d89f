"""The writing task: letters, the path of the tip, its speed, and the joint motion that follows it.

Kostić et al. 2004, Section III.B, eq. (9), Figs. 2 and 3.
"""
