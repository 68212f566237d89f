"""What the simulation of an arm gets wrong, and why: every effect tried on what the nominal model leaves."""
