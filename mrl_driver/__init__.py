"""Host driver for TraxBot, StingBot and other robots that speak `@command,arguments...e` frames.

```python
from mrl_driver.driver import Driver

with Driver("/dev/ttyACM0") as robot:
    for _ in range(20):  # 2 s
        robot.drive(0.2, 0.0)  # m/s, rad/s; the robot stops 0.5 s after the last call
        robot.wait(0.1)
    print(robot.pose, robot.ranges)  # x y yaw [m m rad]; metres by sonar name
```
"""

from .old_names import keep

keep(
    {
        "mrl_driver.codec": "mrl_driver.protocol",
        "mrl_driver.robots": "mrl_driver.robot.models",
        "mrl_driver.stepped": "mrl_driver.driver.simulated",
        "mrl_driver.table": "mrl_driver.protocol.table",
        "mrl_driver.terminal.shown_state": "mrl_driver.view.shown_state",
        "mrl_driver.terminal.trail": "mrl_driver.view.trail",
    }
)
