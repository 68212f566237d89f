"""What is settled before the search that counts, and is given to it.

    responding        what frequency responses name is subtracted first
    compliance        what gives way, named by them
    change_of_sign    by which curve dry friction changes its sign
    terms_apart       a friction law of as many terms as the logs tell apart
    floored           the floor, where it comes from, and the thresholds that follow
    clean             what is left when all that may be a fault is taken away: the noise for that floor
"""
