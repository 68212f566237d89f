"""Every cause that could be, and how much of the residual it would take away: to first order, before any is fitted exactly.

    candidates    each effect at every place, in every shape worth trying
    wanted        causes that somebody names, and why a model cannot take one up
    arms_alike    arms for which columns are laid already, where they are nearly the same
    screen        what its columns gain beside the refitted model
    through       what all torque of a joint passes through, a lag, fitted whole
    blocked       what a cause gains on blocks of time that did not choose it
"""
