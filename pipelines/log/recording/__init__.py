"""Recordings of other programs, and how they become logs: readers, recipes, repairs, and the drafting of a recipe."""
