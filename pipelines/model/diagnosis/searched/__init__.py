"""Causes found one after the other, each fitted exactly beside those before it.

    search        screen, refit the best and its rivals, keep the best, look at what is left
    case          what is diagnosed: the rows, those that judge, the nominal model, every cause that is looked for
    wanted        the shapes that causes which somebody names are fitted in
    beside        effects whose numbers are known from elsewhere

    gate          what passes before any is fitted exactly
    borne_out     where no floor says what passes: time that a cause was not chosen by
    hypotheses    one cause fitted exactly, by each of its laws
    parsimony     of those that explain nearly the same, the plainest
    barred        below its threshold, and decidedly better than what is above its own
    elsewhere     the same cause at another joint
    unnameable    what explains the most and cannot be named
    curves        by which curve friction changes its sign, beside what was found
    reweighted    the weights that follow from what was found
    ledger        every hypothesis, and why it was accepted or not
"""
