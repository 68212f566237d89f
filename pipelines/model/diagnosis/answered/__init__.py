"""What is answered: findings, doubts and limits put together.

    told        findings and what they gain, what the logs cannot show, and the sentence for a technician
    words       words that this sentence and the report share
    loud        "nothing is wrong" that holds of loud drives alone
    judgeable   the verdict "cannot-judge", and checks of the nominal model
    impossible  numbers that a cause cannot have
    unbiased    numbers less what sampling and smoothing did to them
    outcome     what the stages `diagnose` and `extend` leave
"""
