"""The world from above, in a terminal or as a picture.  Imports hardware and world."""
