"""The live view in a terminal, and the keyboard.  Imports view and the layers below it."""
