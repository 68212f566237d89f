"""Find what is wrong with a log, and which of its stretches can be used; no model is needed."""
