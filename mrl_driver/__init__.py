"""Host driver for TraxBot, StingBot and other robots that speak `@command,arguments...e` frames.

```python
from mrl_driver.driver import Driver

with Driver("/dev/ttyACM0") as robot:  # or "ttySIM0": mrl-sim --link ttySIM0
    for _ in range(20):  # 2 s
        robot.drive(0.2, 0.0)  # m/s, rad/s; lasts 0.5 s
        robot.wait(0.1)
    print(robot.pose, robot.ranges)  # x y yaw [m m rad]; metres by sonar name
```
"""
