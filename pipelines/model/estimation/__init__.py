"""From logs to parameters: the equations, the fit, what it can show, and what checks it."""
