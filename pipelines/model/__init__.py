"""What we believe: the physics of an arm, as NumPy functions of its motion."""
