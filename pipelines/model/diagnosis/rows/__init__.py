"""Logs as equations: how signals become rows, and what noise the rows have.

    data             the rows of all logs; the rest serves it
    stretch          a stretch of a log without a gap, averaged, filtered and thinned out
    sharper          motion around sharp reversals
    kept             what was laid already, and is the same whatever was fitted since
    repeated         what differs between repeated periods
    mixed            rows of torques that drives mix
    signals          what a residual can be drawn against
    whitening        rows whose noise is white
"""
