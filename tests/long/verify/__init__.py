"""Verification of the stop: models and searches that go beyond single tests.  README.md says what they show."""
