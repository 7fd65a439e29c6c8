"""Explores the real code: the driver and the firmware's PC build, in all sequences of events up to a depth."""
