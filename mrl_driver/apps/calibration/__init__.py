"""Measures the parameters of a robot: wheels, axle, slip, sonar curve, motor gains, wiring.

Most modules are pure: counts, metres and seconds in, numbers out.  `manoeuvres` and the procedures drive the robot,
and `calibration_files`, `from_recording`, `ground_truth` and `calibration_plots` use files.
"""
