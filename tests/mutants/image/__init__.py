"""Mutants of the hardware layer (hal_*_avr.cpp), tried on the firmware's image on the simulated chip."""
