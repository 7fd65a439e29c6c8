"""The live view and the keyboard.  Imports driver and what is below it."""
