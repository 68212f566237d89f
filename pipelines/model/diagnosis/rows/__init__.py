"""Logs as equations: how signals become rows, and what noise the rows have.

    data             the rows of all logs; the rest serves it
    stretch          a stretch of a log without a gap, averaged, filtered and thinned out
    sharper          motion around sharp reversals
    kept             what was laid already, and is the same whatever was fitted since
    mixed            rows of torques that drives mix
    signals          what a residual can be drawn against
    imperfections    what any drive in order has
    ripple           the ripple of torque constants, as noise of the rows
    whitening        rows whose noise is white
"""
