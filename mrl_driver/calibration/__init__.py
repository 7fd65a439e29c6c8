"""Finding a robot's own numbers: wheels, axle, slip, sonar curve, motor gains, wiring.

Everything but `driving`, `measure` and `store` is pure: counts, metres and seconds in, numbers out.
"""
