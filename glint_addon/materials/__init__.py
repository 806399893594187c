"""Materials with glints: make one, find those that have glints, and which materials an object shows."""
