"""Models fitted to rows: the nominal one, and an arm with its effects exactly.

    nominal        rigid body and friction, linear, every joint weighted by its own residual
    dissipation    friction takes power out: signs that amplitudes keep
    exact          the torque of an arm as its effects act
    record         what the record makes of torque, a low-pass say
    slopes         the slopes of that torque by every number
    refit          all numbers at once
    linear         least squares around a solution: steps, and how sure numbers are
"""
