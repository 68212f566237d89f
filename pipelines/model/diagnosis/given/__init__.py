"""What is known before the search.

compliance        causes that frequency responses name
terms_apart       a friction law with no more terms than the logs determine
"""
