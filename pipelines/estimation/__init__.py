"""What is estimated from logs, and what has to be checked before it is."""
