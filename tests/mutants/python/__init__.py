"""Mutants of Python: one process has imported the nearest tests, and a fork of it runs each mutant."""
