"""What the simulation of an arm gets wrong, and why: every effect tried on what the nominal model leaves.

`diagnose` and `extend` answer one question each, without reference logs (with them the package
pipelines.diagnosis does); a folder is a part of the way there, and its docstring the map of it:

    diagnose     what the nominal model gets wrong in these logs: the whole of it in the order in which it happens
    extend       what follows for causes that somebody names
    result       what they answer with: everything found, nothing drawn
    memory       what was worked out of logs, for whoever asks the same of them again

Where to look, in the order in which it happens:

    asked        settings and logs, and what has to be in order before any physics is blamed
    rows         logs as equations: how signals become rows, and what noise these have
    fitted       the nominal model on the rows, and an arm with its effects exactly, every number at once
    given        what is settled before anything is looked for: frequency responses, laws of dry friction, the floor
    screened     every cause that could be, and how much of the residual it would take away, to first order
    floor        what an arm in order leaves, and so what a cause has to exceed
    searched     causes found one after the other, each fitted exactly beside those before it
    named        which of the causes found are named, and what is told of each
    believed     what is dropped again, and what is doubted: other time, other causes, other noise
    worth        numbers and proof of a cause, and what it is worth on what was held out
    unseen       what these logs cannot tell: what would have been found
    answered     findings, doubts and limits put together, down to the sentence for a technician

What imports what is another order: `DIAGNOSIS` in tests/test_layers.py holds it, from the bottom up.
"""
