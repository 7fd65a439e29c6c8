"""The live view and the keyboard.  Imports driver and the layers below it."""
