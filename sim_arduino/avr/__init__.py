"""The real firmware image on libsimavr, with peripherals true to an Uno's timing."""
