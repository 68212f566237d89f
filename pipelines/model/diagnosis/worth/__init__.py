"""Numbers and proof of a cause, and what it is worth on what was held out.

    numbers         its numbers and how sure they are
    evidence        the picture of what is wrong
    orders          amplitudes over the orders of a joint's angle, as far as its range tells them apart
    proof           the figure that proves a finding
    held_out        what a model leaves of rows that it was not fitted to
    gains           what a finding is worth: torque, simulated position, tip
    extended        the model extended by causes, with the deviations of all its numbers
    closed_loop     arms moved by the controllers of logs
    simulated       measured over simulated, in closed loop
"""
