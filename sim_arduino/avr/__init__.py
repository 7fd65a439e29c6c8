"""Runs the real firmware image on libsimavr; the peripherals have the timing of an Uno.  Imports world."""
