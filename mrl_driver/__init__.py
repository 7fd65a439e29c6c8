"""Host driver for TraxBot, StingBot and other robots that speak `@command,arguments...e` frames."""

from .old_names import keep

keep(
    {
        "mrl_driver.codec": "mrl_driver.protocol.codec",
        "mrl_driver.robots": "mrl_driver.robot.models",
        "mrl_driver.stepped": "mrl_driver.driver.simulated",
        "mrl_driver.table": "mrl_driver.protocol.table",
    }
)
