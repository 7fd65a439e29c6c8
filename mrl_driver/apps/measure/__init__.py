"""Measures a board or a robot, and compares it with the emulated figures of the project: `mrl measure`.

`line` measures on the bare link, `host` with the driver, `course` drives manoeuvres; each gives `rows`, which know what
is expected, how far a sound board may be off, and the likely cause.  All work in simulated time too.
"""
