"""An emulated TraxBot or StingBot on a virtual serial port; `mrl-sim` is its command."""
