"""Design experiments: the motion that determines the parameters best within an arm's limits.

Kostić et al. 2004, Section IV.C.3, eq. (22), Figs. 8 and 9; Swevers et al. 1997.
"""
