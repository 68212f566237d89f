"""Choose the inputs of linear equations so that their solution will be known best."""
