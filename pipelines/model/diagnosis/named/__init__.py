"""Which of the causes found are named, and what is told of each.

    verdict     which are named, and why not the others
    findings    from the steps of a search to findings
    joined      found several times at one place, it is one finding
    chain       what each is worth in the order in which they are told
"""
