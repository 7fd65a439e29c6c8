"""Tests that notice: small changes to the sources, and which tests fail with them; see README.md."""
