"""`mrl measure` on boards with one known fault and on sound ones, in simulated time."""
