"""What these logs cannot tell: which causes would have been found, how small, and which never.

    limits                 the smallest cause that would have been found, and what the model absorbs
    injection              by hiding it in the logs that were diagnosed
    injection_of_shapes    where a non-linear number alone says how much of it there is
    without_limit          causes that have neither a finding nor a size to tell
"""
