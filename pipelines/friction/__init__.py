"""Fit the friction law of a joint from its logs: equations, fit, choice among laws."""
