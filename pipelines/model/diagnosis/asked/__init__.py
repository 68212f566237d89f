"""What is asked, of which logs, and whether they can be asked that: before any cause is looked for.

    settings     what can be chosen
    inputs       the logs, prepared: to fit, to judge, to refer to
    at_rest      rows in which dry friction holds a joint, where no controller is known: they do not count
    gates        columns, signs, scales and clocks mixed up, and the doctor's checks
    unasked      what is said though nobody asked: causes without a size to tell, laws that gave way to plainer ones
"""
