"""The world around the robots: walls, maps, things to sense, other robots."""
