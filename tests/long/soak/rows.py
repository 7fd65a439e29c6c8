"""The faults that a robot must survive, by number; the soak counts how often it strikes with each."""

from typing import Dict

ROWS: Dict[int, str] = {
    1: "host dies while the robot moves",
    2: "command source dies, driver lives",
    3: "stop command behind a truncated frame",
    4: "lost bytes merge frames",
    5: "NaN, infinity, huge or sideways speeds",
    6: "flipped bits, changed and swapped bytes",
    7: "port goes away and comes back, also under another name",
    8: "I2C hangs, or the motor board vanishes",
    9: "firmware locks up",
    10: "encoder wraps",
    11: "board resets while the robot moves",
    12: "failed I2C read",
    13: "stale commands after a stall",
    14: "board silent, port open",
    15: "write blocks",
    16: "opening resets the board",
    17: "two programs on one port",
    18: "another robot at the port",
    19: "host paused",
    20: "EEPROM damaged",
    21: "Ctrl-C, SIGTERM",
    22: "junk while connecting",
    23: "probes of ModemManager",
    24: "debug text with pieces of frames",
    25: "wall clock jumps",
    26: "two publishers of cmd_vel",
    27: "close during read",
    28: "disk full, or kill -9, while recording",
    29: "master dies and is started again",
    30: "flood of garbage",
    31: "sonar missing or saturated",
    32: "millis() wraps",
    33: "a quarter of an hour and more of faults in one process",
    34: "encoder dead or reversed, wheel blocked, motor power off",
}
LEAST = 20
"""Each must strike this often in a full run, in simulated or in real time."""
