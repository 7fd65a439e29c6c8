"""Tests of `mrl measure`."""
