"""Measures the parameters of a robot: wheels, axle, slip, sonar curve, motor gains, wiring, IMU.

`fit`, `gains`, `imu_fit`, `trial` and `wiring_check` are pure: counts, metres and seconds in, numbers out.
The procedures drive the robot by `manoeuvres`, and are the commands; `calibration_files`, `from_recording` and
`ground_truth` use files.
"""
