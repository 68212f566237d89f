"""From logs of a joint to its friction law: equations, fit, choice among laws, and what judges them."""
