"""The stages of rrrid and the toolboxes they are made of."""
