"""The world around the robots: walls, maps, sources for the sensors, other robots.  Imports none of the emulator."""
