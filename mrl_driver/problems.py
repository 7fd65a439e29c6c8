"""What can go wrong, in words: one row for each code, with message, cause and remedy.

Errors, `mrl doctor`, `mrl review` and the reasons of stops take their codes and remedies from here.  `mrl explain CODE`
prints a row, and docs/troubleshooting.md is rendered from all of them.
"""

from typing import Dict, NamedTuple, Tuple

PLACEHOLDERS = ("PORT", "PROGRAM", "NAME", "GROUP", "SIDE", "VALUE", "ADDRESS")
"""Words of messages that stand for something that varies."""


class Problem(NamedTuple):
    """One row."""

    code: str
    """Short name, such as `sonar_dead`; the same in all versions."""
    message: str
    """The message as the user sees it, with `PLACEHOLDERS`."""
    cause: str
    """Sentences that say where it comes from."""
    remedy: str = ""
    """What to do: begins in lower case and has no full stop at its end, because messages end with it.  Empty if a new
    command or nothing is enough.
    """
    also: Tuple[str, ...] = ()
    """Other messages with this code."""

    @property
    def advice(self) -> str:
        """The remedy as sentences; empty if there is none."""
        return sentences(self.remedy)


def sentences(text: str) -> str:
    """Return words that begin in lower case and have no full stop as sentences; a command at the end gets none."""
    ends_with_command = ": mrl " in text.rpartition("; ")[2]
    return text[:1].upper() + text[1:] + ("" if ends_with_command or not text else ".")


GROUPS: Dict[str, Tuple[Problem, ...]] = {
    "Port and computer": (
        Problem(
            "port_missing",
            "PORT does not exist",
            "The board is not plugged in, has another port today, or the name is misspelt. In a virtual machine or a "
            "container, the port must be passed on. If it vanishes a second after the board was plugged in, brltty has "
            "taken its adapter for a Braille display. The port of an emulated robot is in the folder where mrl-sim was "
            "started, with the name that its --link got.",
            "list the ports with: mrl ports --probe",
            ("PORT is not a serial port", "PORT cannot be opened", "expected a serial port"),
        ),
        Problem(
            "port_denied",
            "no permission for PORT",
            "Linux lets only root and the members of a group (dialout) open serial ports.",
            "run sudo usermod -aG dialout $USER, then log out and in again",
            (
                "you may not open PORT: it belongs to group GROUP",
                "you are in group GROUP, but you logged in before you were added",
                "only root may open PORT",
                "no permission to listen on ADDRESS",
                "this container may not use PORT",
            ),
        ),
        Problem(
            "port_busy",
            "PORT is in use by PROGRAM",
            "A serial port serves one program at a time: another mrl, a ROS node, the serial monitor of the Arduino "
            "IDE, or a login prompt on a Raspberry Pi's UART (sudo raspi-config turns it off) has it open. Two "
            "programs take each other's bytes.",
            "close that program, then try again",
        ),
        Problem(
            "link_error",
            "PORT cannot be opened",
            "The device behind the port does not answer, often because its cable was pulled and its name is still "
            "there, as in a container. Or the address of a network link is wrong, or this computer has run out of "
            "descriptors, threads or memory.",
            "unplug the board and plug it in again; check the address and the baud rate",
            ("because its device does not answer", "ADDRESS cannot be listened on", "too many files open"),
        ),
        Problem(
            "link_lost",
            "PORT went away",
            "The cable was pulled, the board lost its power, or the network or radio was interrupted. The board stops "
            "the robot by its watchdog; a board with the firmware of 2013 does not.",
            "check the plug and the cable, or the radio's range",
            (
                "stopped: the connection to the robot was lost",
                "The connection to the robot was lost",
                "the port went away and is searched",
            ),
        ),
        Problem(
            "modem_manager",
            "runs, and may keep the port busy for some seconds after the board is plugged in",
            "ModemManager writes to new serial ports to find modems.",
            "run: mrl system install",
        ),
        Problem(
            "brltty",
            "runs, and takes CH340, CP210x, FTDI and PL2303 adapters for Braille displays",
            "brltty drives Braille displays. Some of them have the same chips as the adapters of robots, so it takes "
            "those too, about a second after they were plugged in, and their ports vanish.",
            "unless you use a Braille display, run mrl system install --mask-brltty as root and plug the board in",
        ),
        Problem(
            "usb_latency",
            "holds bytes back for up to VALUE ms",
            "An FTDI adapter collects bytes before it sends them on. Odometry and stops come later by this time.",
            "write 1 to the adapter's latency_timer; mrl doctor prints the command",
        ),
        Problem(
            "late_host",
            "The computer was too busy to drive the robot",
            "The program neither read nor sent anything for a while: other programs kept the processor busy, or it was "
            "suspended. The board's frames waited, and its watchdog may have stopped the robot.",
            "close busy programs, give the driver's process more priority, and do not suspend it or the computer",
            ("stopped: the computer that drives the robot was too busy",),
        ),
        Problem(
            "output_error",
            "VALUE cannot be written",
            "The disk is full, the folder is missing, or you may not write there.",
            "free disk space, or choose another folder",
        ),
        Problem(
            "recording_damaged",
            "Parts of the recording cannot be read",
            "The disk was full, or the file was copied in part.",
            "free disk space before the next recording, and copy files whole",
        ),
        Problem(
            "simulator_error",
            "the emulator cannot be built or started",
            "A compiler, a library or the firmware's binary is missing, or the world does not fit the robot.",
            "read the message; for a missing build run make firmware in the repository",
        ),
    ),
    "Board and firmware": (
        Problem(
            "not_a_robot",
            "no answer to '@29e'",
            "The board has no power or no firmware of this project, another device is on the port, or the baud rate is "
            "another one.",
            "check power and cable, then upload the firmware with: mrl flash --port PORT",
            (
                "this port sends text at another baud rate, or another device is on it",
                "the bytes that were sent come back",
            ),
        ),
        Problem(
            "wrong_robot",
            "the board is NAME, expected NAME",
            "The robot model that you named, or the only one that lists the id, is not that of the board. Distances "
            "and speeds would be wrong.",
            "name the right model with --robot, or set the board's id with: mrl set-id ID",
            (
                "The robot model is not that of the robot",
                "no packaged model lists VALUE",
                "robot id VALUE is in no packaged model",
                "robot id VALUE answers, expected VALUE",
                "the board speaks protocol VALUE",
            ),
        ),
        Problem(
            "id_unset",
            "No robot id is set",
            "A new board does not know which robot it is on.",
            "set the id with: mrl set-id ID (TraxBot 1-3, StingBot 4-5, Pioneer 6-10)",
        ),
        Problem(
            "no_watchdog",
            "1 (2013): works, but has no watchdog and no checksum",
            "The robot keeps driving when your program dies or the cable is pulled.",
            "upload the current firmware with: mrl flash --port PORT",
            (
                "the board has none: it does not stop if this computer fails",
                "board firmware NAME has no watchdog",
            ),
        ),
        Problem(
            "board_error",
            "does not answer its Arduino: check its power",
            "The Arduino answers, and the motor board or another device behind it does not.",
            "check its power, and the I2C wires on A4 (SDA) and A5 (SCL)",
        ),
        Problem(
            "board_timeout",
            "no answer to request VALUE in VALUE attempts",
            "The board answered before and does not any more: damaged data, a busy computer, or a board that restarts.",
            "try again; if it stays, run: mrl doctor --port PORT",
            ("no telemetry arrives",),
        ),
        Problem(
            "board_refused",
            "the board refused",
            "The board does not know the request or the value, has firmware of 2013, or restarted before it saved.",
            "read the message; upload the current firmware with: mrl flash --port PORT",
            (
                "the board has no parameter NAME",
                "board firmware 1 (2013) cannot store parameters or an id",
            ),
        ),
        Problem(
            "motor_board",
            "The motor board does not answer",
            "The OMNI-3MD has no power, or an I2C wire is loose. The board refuses commands until it answers.",
            "check the OMNI-3MD's power, and its I2C wires on A4 (SDA) and A5 (SCL)",
            ("stopped: the motor board did not answer",),
        ),
        Problem(
            "bus_hung",
            "The I2C bus hangs",
            "A device holds the wires of the I2C bus.",
            "check the wires on A4 (SDA) and A5 (SCL), then switch power off and on",
        ),
        Problem(
            "eeprom",
            "The EEPROM configuration was damaged",
            "The board's parameters did not fit their checksum, so the defaults of the robot's model are in force.",
            "set the parameters that must differ from the model's defaults again: mrl config set NAME VALUE",
        ),
        Problem(
            "wiring",
            "The bridge or its wiring is not set",
            "A board with an H-bridge does not know its chip or its wires, and refuses to move.",
            "set the bridge with: mrl config set bridge CHIP (such as l298n), then run: mrl calibrate wiring",
        ),
        Problem(
            "sensor",
            "An environment sensor does not answer",
            "The sensor has answered since the start, and does not any more.",
            "check the I2C wires and power of the thermopile (0x68) and the compass (0x60)",
        ),
        Problem(
            "sensor_silent",
            "no reading",
            "The board has the sensor, and has sent no reading of it.",
            "check its wires, see HARDWARE.md",
        ),
        Problem(
            "build",
            "taken as sonar: a board of 2013 does not report it",
            "Boards have sonars or environment sensors. The model and the board do not agree, or the board cannot say.",
            "if it has environment sensors, write build: environment into the robot's YAML",
        ),
        Problem(
            "parameters",
            "VALUE on the board, VALUE in the model NAME",
            "A parameter in the board's EEPROM is not that of the robot's model. The message says what follows from "
            "it.",
            "if the model is right, set the parameter with mrl config set; if the board is, correct the robot's file",
            ("set on this board, but not in the model NAME",),
        ),
        Problem(
            "brown_out",
            "The board restarted because its supply dropped",
            "The 5 V of the board fell too low, most often because of a weak USB cable, or of a load on the 5 V pin.",
            "check USB cable and hub, and every other load on the board's 5 V",
        ),
        Problem(
            "firmware_hung",
            "The board's firmware hung and restarted",
            "The watchdog of the chip restarted the firmware. This is an error of the firmware or of its memory.",
            "report it with: mrl doctor --report",
        ),
        Problem(
            "board_restart",
            "The board restarted while it was in use",
            "Somebody pressed reset, another program opened the port (which resets an Arduino Uno), or the power "
            "failed.",
            "check power and USB plug, and let no second program open the port",
            ("stopped: the robot's board restarted", "stopped: the robot's board has started"),
        ),
        Problem(
            "board_stalled",
            "The board was busy for too long",
            "The loop of the firmware stood still for 0.25 s, so the board stopped the robot.",
            "check the I2C wires and devices",
            ("stopped: the robot's board was busy for too long",),
        ),
        Problem(
            "board_silent",
            "The board sent nothing for a while",
            "The board made no telemetry, though the connection was there.",
            "check the board's power and its I2C wires; report it with: mrl doctor --report",
        ),
        Problem(
            "debug_text",
            "The board sends text between its frames",
            "Debug mode is on, or the sketch prints. Text delays telemetry and commands.",
            "turn its debug mode off with the request set_debug 0, or remove prints from the sketch",
        ),
    ),
    "Battery and motor power": (
        Problem(
            "battery_off",
            "motor power is off",
            "The motor board measures hardly any voltage: its switch is off, or the battery is not connected.",
            "switch motor power on, or connect the battery",
            ("Motor power was off", "stopped: the battery is empty or switched off"),
        ),
        Problem(
            "battery_empty",
            "The battery was empty",
            "The voltage is below the model's `empty_v`. The driver stops the robot.",
            "charge the battery",
        ),
        Problem(
            "battery_low",
            "The battery was low",
            "The voltage is below the model's `low_v`. The robot still drives.",
            "charge the battery soon",
        ),
        Problem(
            "battery_dead",
            "battery reads VALUE V",
            "The motors have no power, or the battery is too low to start.",
            "switch motor power on and charge the battery; --ignore-battery is for checks without motors",
        ),
        Problem(
            "battery_sag",
            "The battery's voltage sagged",
            "It lost a tenth of its voltage within seconds: a weak cell, or a poor contact.",
            "check the battery's plug and wires; measure its voltage while the motors run; replace a worn pack",
        ),
        Problem(
            "no_battery",
            "not measured",
            "The board has no divider at A3, so it does not know the voltage of its battery, and cannot protect it.",
            "connect its divider to A3, and set the parameter battery_divider",
        ),
        Problem(
            "undervoltage",
            "The battery fell below the parameter undervoltage",
            "The board stopped the robot to protect the battery. It refuses to move until the voltage is a sixteenth "
            "higher.",
            "charge the battery, or correct the parameter undervoltage",
            ("stopped: the battery fell below the parameter undervoltage",),
        ),
        Problem(
            "hot",
            "The motor board was hot",
            "It reached more than 60 degC.",
            "let it cool down, and check that the wheels turn freely",
        ),
    ),
    "Wheels and encoders": (
        Problem(
            "wheel_fault",
            "a wheel does not follow its command",
            "A calibration or a drive ended because a wheel or an encoder did not do what was commanded.",
            "check wheels, wires and motor power, then run: mrl doctor --drive",
            (
                "stopped: a wheel did not follow its command",
                "no wheel turned when the NAME motor output was driven",
            ),
        ),
        Problem(
            "wheel_blocked",
            "A wheel did not turn at full drive",
            "An obstacle or a cable holds the wheel, a motor wire is loose, or the battery is too small.",
            "check that the wheels turn freely, and the motor's wires",
            ("stopped: a wheel did not turn at full drive", "SIDE was blocked or without power"),
        ),
        Problem(
            "wheel_dead",
            "SIDE did not count",
            "The wheel did not turn, or its encoder did not count. A gyro would show which of the two.",
            "check that it turns freely; check the plugs of its encoder and its motor",
            ("no counter moved",),
        ),
        Problem(
            "encoder_dead",
            "An encoder was silent or counted the other direction",
            "A wire of the encoder is loose, or the wiring in the board is not that of the robot.",
            "check the encoder's wires, then run: mrl calibrate wiring",
            ("stopped: an encoder was silent or counted the other direction", "The SIDE encoder was dead"),
        ),
        Problem(
            "wheel_reversed",
            "SIDE counted against its command",
            "The wires of the motor or of its encoder are exchanged.",
            "swap the wires of its encoder or of its motor, not of both; then run: mrl doctor --drive",
            ("counts backwards",),
        ),
        Problem(
            "wheels_swapped",
            "the other wheel's counter moved",
            "The plugs of the right and the left side are exchanged.",
            "swap the plugs: right is motor and encoder 3, left is motor and encoder 1",
            (
                "its counter is right, but another wheel turned, or this one turned backwards",
                "both counters moved",
            ),
        ),
        Problem(
            "wheels_powerless",
            "No wheel turned",
            "The motors have no power.",
            "check motor power, its switch and the battery's plug",
        ),
        Problem(
            "wheels_unchecked",
            "not checked",
            "mrl doctor turns wheels only if you allow it.",
            "lift them off the ground, then run: mrl doctor --drive",
            ("only the counters were checked",),
        ),
        Problem(
            "encoder_noise",
            "An encoder's signals are disturbed",
            "Some transitions skipped a state, which no wheel does: counts are lost or added.",
            "lead the encoder's wires away from the motor's, twist or shield them, and check their plugs and ground",
            ("VALUE transitions skipped a state",),
        ),
        Problem(
            "wheel_slow",
            "The SIDE wheel is slower than asked",
            "The wheel has friction, its motor wire is poor, or the battery is weak under load.",
            "check that it turns freely, its motor's wires, and the battery under load",
        ),
        Problem(
            "speed_scale",
            "The robot does not drive as fast as asked",
            "Wheel size, gearbox or encoder counts in the board differ from those of the robot model.",
            "compare the robot's YAML with the board's parameters: mrl doctor, mrl config; then: mrl calibrate",
        ),
        Problem(
            "wheel_ratio",
            "The SIDE wheel is larger than the other one",
            "The gyro shows that the robot turns while the wheels count the same.",
            "check tyres and tracks, then run: mrl calibrate straight",
        ),
        Problem(
            "track_width",
            "The robot does not turn as far as its wheels say",
            "Wheel separation or wheel size in the model is wrong, or the wheels slip in turns.",
            "run mrl calibrate straight, then: mrl calibrate turn",
        ),
        Problem(
            "wheel_size",
            "The robot does not drive as far as its wheels say",
            "The walls that the sonars see fit together for another wheel size, or another curve of the sonars.",
            "measure a straight line: mrl calibrate straight; then the sonars: mrl calibrate sonar",
        ),
        Problem(
            "slip",
            "SIDE slipped",
            "The gyro and the wheels disagree: a wheel turned without moving the robot as far.",
            "clean the wheels and the floor, check the wheel's hub and its load, and accelerate more gently",
        ),
        Problem(
            "pushing",
            "The robot pushed against an obstacle",
            "The wheels turned, and the sonars showed that the robot stood. The pose is off by as much.",
            "stop earlier in front of obstacles, for example with protective zones",
            ("The robot did not move although its wheels turned",),
        ),
        Problem(
            "clamped",
            "The board reduced commands to its speed ceiling",
            "Commands were faster than the board's own ceilings allow.",
            "command lower speeds, or raise linear_ceiling with: mrl config set",
            ("clamped VALUE commands",),
        ),
    ),
    "Sonars": (
        Problem(
            "sonar_dead",
            "The NAME sonar gave no reading",
            "Nothing is connected, or its input is saturated.",
            "check its power (D13), the trigger chain (D12) and its output (front A0, left A1, right A2)",
        ),
        Problem(
            "sonar_stuck",
            "The NAME sonar always showed the same range",
            "The sonar does not measure, or something on the robot is in front of it.",
            "look in front of it; check its trigger (D12) and its output (front A0, left A1, right A2)",
        ),
        Problem(
            "sonar_deaf",
            "The NAME sonar saw nothing",
            "The sonar sends, and detects no echo where the others see obstacles.",
            "clean it, check that nothing absorbs its sound, and exchange it with another one to compare",
        ),
        Problem(
            "sonar_swapped",
            "the NAME sonar detected the hand",
            "The outputs of two sonars are exchanged.",
            "swap the outputs of the two sonars",
        ),
        Problem(
            "sonar_missed",
            "did not detect the hand",
            "The sonar did not see the hand, or another one saw an obstacle at the same distance.",
            "check its output wire, and clear the space around the robot",
            ("order not checked",),
        ),
        Problem(
            "no_sonars",
            "none: this firmware is the build for environment sensors",
            "The board has gas and light sensors in place of sonars.",
            "if the robot has sonars, upload the other build with: mrl flash --port PORT",
        ),
    ),
    "IMU and heading": (
        Problem(
            "imu_dead",
            "The IMU stopped",
            "The board receives no reading of the chip. The wheels alone give the heading.",
            "check the IMU's wires on A4 (SDA) and A5 (SCL), and its power",
            (
                "the board reports no IMU any more",
                "no reading of the IMU for 0.1 s",
                "The IMU has answered, and does not any more",
            ),
        ),
        Problem(
            "imu_frozen",
            "The IMU repeated the same reading",
            "The chip has stopped measuring.",
            "switch its power off and on",
            ("the IMU repeats the same reading",),
        ),
        Problem(
            "imu_wrong",
            "The IMU's readings were out of scale",
            "The chip is loose, or its supply disturbs it.",
            "check that it is screwed to the body, and its power",
            ("the IMU's reading is out of scale",),
        ),
        Problem(
            "imu_tilted",
            "The IMU is not upright",
            "Gravity is more than 30 deg from the axis that the robot's file calls vertical.",
            "enter its mounting with: mrl calibrate imu",
            ("gravity is more than 30 deg from the IMU's vertical axis",),
        ),
        Problem(
            "imu_drift",
            "The gyro drifts",
            "Its bias changed by more than its temperature explains. The heading turns as fast.",
            "let the robot stand for a second now and then; keep the IMU away from heat and vibration; replace it",
        ),
        Problem(
            "imu_learning",
            "the bias of its gyro is not known",
            "The driver learns the bias while the robot stands. Until then the wheels alone give the heading.",
            "let the robot stand still for a second",
        ),
        Problem(
            "imu_off",
            "not read, because that needs checksums and a fast serial link",
            "The board has an IMU, and the driver does not use it: checksums are off, or the link is below 57600 baud.",
            "use a link of 115200 baud, and leave checksums on",
        ),
    ),
    "Serial link, network and radio": (
        Problem(
            "bad_cable",
            "The cable or the radio link damages data",
            "Damaged frames are not used, so the robot misses telemetry and the board misses commands.",
            "use a shorter or better USB cable, away from the motor wires; bring radios closer together",
            ("VALUE frames lost, VALUE pieces of data damaged",),
        ),
        Problem(
            "noise_bursts",
            "The line was disturbed in bursts",
            "Something disturbs the cable for short times, such as a motor or a switch.",
            "find out what was switched or touched then; lead the cable away from motor wires; check its plugs",
        ),
        Problem(
            "frames_lost",
            "Frames of the board were lost",
            "A network or radio dropped them.",
            "bring robot and access point closer together, use a free channel, or a cable",
        ),
        Problem(
            "slow_telemetry",
            "VALUE frames/s",
            "Less telemetry arrived than the board was asked for.",
            "close busy programs, and connect the board without a USB hub",
        ),
        Problem(
            "slow_line",
            "The line to the robot was slow",
            "Answers took more than 50 ms. The robot answers and stops later.",
            "connect the board without a hub, at 115200 baud or more; use a faster network or radio",
            ("VALUE ms from request to answer, at worst VALUE ms",),
        ),
        Problem(
            "line_stalled",
            "The line held data back",
            "The data came at once after a pause, so the connection kept them.",
            "check USB hub, network or radio between computer and robot",
        ),
        Problem(
            "requests_lost",
            "Requests did not reach the board",
            "The board's telemetry arrived, and requests had no answer. Commands get lost too.",
            "check the wire from the computer to the board (RX of the board), the USB hub, or the radio",
        ),
        Problem(
            "requests_late",
            "Requests reached the board late",
            "The board's telemetry arrived in time, and answers came late. Commands come as late.",
            "check the wire from the computer to the board (RX of the board), the USB hub, or the radio",
        ),
        Problem(
            "refused_by_board",
            "VALUE x VALUE",
            "The board counts requests that it could not read or carry out.",
            "normal after an interrupted program; otherwise check the cable",
        ),
        Problem(
            "radio_hold",
            "another robot holds this one by radio",
            "A robot of the team has stopped this one, and has not freed it, or has fallen silent.",
            "look whether the place is free, then release it: ROS service release_hold, or Driver.radio.release_hold()",
            ("stopped: another robot holds this one by radio",),
        ),
    ),
    "The robot stopped": (
        Problem(
            "command_timeout",
            "stopped: no new command arrived in time",
            "A drive command counts for 0.5 s. Your program, your key press or your network came later.",
            also=("stopped: the robot heard no command in time",),
        ),
        Problem(
            "command_gaps",
            "Commands came too rarely",
            "The robot stops and drives on, because commands come just too late.",
            "send commands at 10 Hz or more, or raise the command timeout",
        ),
        Problem(
            "command_too_late",
            "stopped: a command arrived too late",
            "The page or the keyboard is far away: the command was old when it arrived.",
            "release the control and press it again",
        ),
        Problem(
            "not_a_number",
            "stopped: a command was not a number",
            "A program sent NaN or infinity as a speed. The driver stops the robot for it.",
            "look for a division by zero, or a missing reading, in the program",
        ),
        Problem(
            "watchdog_stop",
            "The board stopped the robot because it received nothing",
            "No frame arrived at the board for 0.25 s, and its watchdog stopped the robot.",
            "check the link to the board, and close programs that keep the computer busy",
        ),
        Problem(
            "no_telemetry",
            "stopped: no data arrived from the robot",
            "The board sends nothing, or the connection is down.",
            "check its power and its cable or radio",
        ),
        Problem(
            "may_be_moving",
            "stopped: no data arrived from the robot, and it may still be moving",
            "The driver has asked for a stop, and nothing confirms it.",
            "stop it by hand",
        ),
        Problem(
            "ended",
            "stopped: the program that drove the robot has ended",
            "A program stops its robot when it ends.",
            also=("stopped: the program that drove the robot ended its session",),
        ),
        Problem(
            "emergency_stop",
            "stopped: the emergency stop is on",
            "Somebody has pressed STOP, or called the service.",
            "release it",
        ),
        Problem(
            "motors_disabled",
            "stopped: the motors are switched off",
            "The service enable_motors has switched them off.",
            "switch them on with the service enable_motors",
        ),
        Problem(
            "protective_zone",
            "stopped: an obstacle is too close",
            "An obstacle is in the protective zone of the robot.",
            "drive away from it",
        ),
        Problem(
            "manual_mode",
            "stopped: the robot was switched to manual mode",
            "In manual mode the robot is driven by hand and takes no goals.",
        ),
        Problem(
            "commands_unpaused",
            "stopped: a program went on sending commands after a stop",
            "A program that drives, such as a planner, has not paused since a stop or since the robot's node started.",
            "end its goal, or let go of the control, and begin again after half a second",
        ),
        Problem(
            "goal_missed",
            "the goal was not reached",
            "Obstacles blocked the robot, or the time was over.",
            "clear the path, choose another goal, or allow more time",
        ),
    ),
}
PROBLEMS: Dict[str, Problem] = {row.code: row for rows in GROUPS.values() for row in rows}
"""All rows by code."""
