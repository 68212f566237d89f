"""What is wrong with one log: its clock, its samples, its motion; and which stretches of it can be used."""
