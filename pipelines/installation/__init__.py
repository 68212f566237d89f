"""Whether this installation can work: Python, libraries, processor, folders, and a small job whose answer is known."""
