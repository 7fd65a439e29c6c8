"""The model of the stop in Promela, checked with spin; see the README one folder up."""
