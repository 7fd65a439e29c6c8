"""What can go wrong, in words: one row for each code, with message, cause and remedy.

Errors, `mrl doctor`, `mrl review` and the reasons of stops take their codes and remedies from here.  `mrl explain CODE`
prints a row, and docs/troubleshooting.md is rendered from all of them.
"""

import re
from typing import Dict, List, NamedTuple, Tuple

PLACEHOLDERS = ("PORT", "PROGRAM", "NAME", "GROUP", "SIDE", "VALUE", "ADDRESS")
"""Words of messages that stand for something that varies."""
_TEXT = """
# Port and computer
port_missing: PORT does not exist
  also: PORT is not a serial port
  also: PORT cannot be opened
  also: expected a serial port
  cause: The board is not plugged in, has another port today, or the name is misspelt. Its cable may have no wires for
    data, and some boards with USB-C need a cable with USB-A at the computer. In a virtual machine, a container or
    WSL (by usbipd), the port must be passed on. If it vanishes a second after the board was plugged in, brltty has
    taken its adapter for a Braille display. The port of an emulated robot is in the folder where mrl-sim was started,
    with the name that its --link got.
  remedy: list the ports with: mrl ports --probe
port_denied: no permission for PORT
  also: you may not open PORT: it belongs to group GROUP
  also: you are in group GROUP, but you logged in before you were added
  also: only root may open PORT
  also: no permission to listen on ADDRESS
  also: this container may not use PORT
  cause: Linux lets only root and the members of a group (dialout) open serial ports.
  remedy: run sudo usermod -aG dialout $USER, then log out and in again
port_busy: PORT is in use by PROGRAM
  cause: A serial port serves one program at a time: another mrl, a ROS node, the serial monitor of the Arduino IDE,
    or a login prompt on a Raspberry Pi's UART (sudo raspi-config turns it off) has it open. Two programs take each
    other's bytes.
  remedy: close that program, then try again
link_error: PORT cannot be opened
  also: because its device does not answer
  also: ADDRESS cannot be listened on
  also: too many files open
  cause: The device behind the port does not answer, often because its cable was pulled and its name is still there,
    as in a container. Or the address of a network link is wrong, or this computer has run out of descriptors, threads
    or memory.
  remedy: unplug the board and plug it in again; check the address and the baud rate
link_lost: PORT went away
  also: stopped: the connection to the robot was lost
  also: The connection to the robot was lost
  also: the port went away and is searched
  cause: The cable was pulled, the board lost its power, motors disturbed its USB so that the computer dropped it (dmesg
    says EMI), or the network or radio was interrupted. The board stops the robot by its watchdog; a board with the
    firmware of 2013 does not.
  remedy: check the plug and the cable, or the radio's range; if it happens when motors start, solder 100 nF across each
    motor and keep the cable away from their wires
not_found: mrl: command not found
  also: mrl-sim: command not found
  also: sudo: mrl: command not found
  cause: mrl and mrl-sim are in a virtual environment. Each new terminal must activate it, and sudo does not search it.
  remedy: run . ~/mrl-venv/bin/activate, or . .venv/bin/activate in a clone; after sudo, write "$(which mrl)" for mrl
no_ros: [sim.launch] is neither a launch file in package [mrl_robots] nor is [mrl_robots] a launch file name
  also: package 'mrl_robots' not found
  also: roslaunch: command not found
  also: rosrun: command not found
  also: No module named 'rospy'
  cause: ROS does not know the clone, a package of ROS is missing, or the Python of a virtual environment runs a
    program of ROS.
  remedy: run export ROS_PACKAGE_PATH=$PWD:$ROS_PACKAGE_PATH in the clone, in each terminal; install ROS with make run,
    and rosrun with sudo apt install rosbash; run programs of ROS with /usr/bin/python3
modem_manager: runs, and may keep the port busy for some seconds after the board is plugged in
  cause: ModemManager writes to new serial ports to find modems.
  remedy: run sudo "$(which mrl)" system install
brltty: runs, and takes CH340, CP210x, FTDI and PL2303 adapters for Braille displays
  cause: brltty drives Braille displays. Some of them have the same chips as the adapters of robots, so it takes those
    too, about a second after they were plugged in, and their ports vanish.
  remedy: unless you use a Braille display, run sudo "$(which mrl)" system install --mask-brltty
    and plug the board in
usb_latency: holds bytes back for up to VALUE ms
  cause: An FTDI adapter collects bytes before it sends them on. Odometry and stops come later by this time.
  remedy: write 1 to the adapter's latency_timer; mrl doctor prints the command
late_host: The computer was too busy to drive the robot
  also: stopped: the computer that drives the robot was too busy
  cause: The program neither read nor sent anything for a while: other programs kept the processor busy, or it was
    suspended. The board's frames waited, and its watchdog may have stopped the robot.
  remedy: close busy programs, give the driver's process more priority, and do not suspend it or the computer
output_error: VALUE cannot be written
  cause: The disk is full, the folder is missing, or you may not write there.
  remedy: free disk space, or choose another folder
recording_damaged: Parts of the recording cannot be read
  cause: The disk was full, or the file was copied in part.
  remedy: free disk space before the next recording, and copy files whole
recording_breaks_off: The recording ends while the robot drives
  cause: The program was killed, the computer lost its power or hung, the disk stayed full, or the file was copied in
    part. The board stops the robot by its watchdog; a board with the firmware of 2013 drives on.
  remedy: check the supply of the computer and the free space on its disk, and end programs with Ctrl-C instead of
    killing them
simulator_error: the emulator cannot be built or started
  cause: A compiler, a library or the firmware's binary is missing, or the world does not fit the robot.
  remedy: read the message; for a missing build run make firmware in the repository
# Board and firmware
not_a_robot: no answer to '@29e'
  also: this port sends text at another baud rate, or another device is on it
  also: the bytes that were sent come back
  cause: The board has no power or no firmware of this project, another device is on the port, or the baud rate is
    another one. A Nano or Mega with an old bootloader hangs after its watchdog has restarted it.
  remedy: check the cable, switch power off and on, then upload the firmware with: mrl flash --port PORT
wrong_robot: the board is NAME, expected NAME
  also: The robot model is not that of the robot
  also: no packaged model lists VALUE
  also: robot id VALUE is in no packaged model
  also: robot id VALUE answers, expected VALUE
  also: the robot on this port is VALUE, expected VALUE
  also: the board speaks protocol VALUE
  cause: The robot model that you named, or the only one that lists the id, is not that of the board. Distances and
    speeds would be wrong. Or the board calculates its robot (mrl flash --build virtual), and a real one is expected.
  remedy: name the right model with --robot, or set the board's id with: mrl set-id ID --port PORT
virtual: the robot is virtual: the board calculates it
  cause: The board has the firmware build virtual. It drives in a room that it calculates, and no motor turns.
  remedy: for motors on this board upload another build with: mrl flash --build hbridge --port PORT
id_unset: No robot id is set
  cause: A new board does not know which robot it is on.
  remedy: set the id with: mrl set-id ID --port PORT (TraxBot 1-3, StingBot 4-5, Pioneer 6-10)
no_watchdog: 1 (2013): works, but has no watchdog and no checksum
  also: the board has none: it does not stop if this computer fails
  also: board firmware NAME has no watchdog
  cause: The robot keeps driving when your program dies or the cable is pulled.
  remedy: upload the current firmware with: mrl flash --port PORT
board_error: does not answer its Arduino: check its power
  cause: The Arduino answers, and the motor board or another device behind it does not.
  remedy: check its power, and the I2C wires on A4 (SDA) and A5 (SCL)
board_timeout: no answer to request VALUE in VALUE attempts
  also: no telemetry arrives
  cause: The board answered before and does not any more: damaged data, a busy computer, or a board that restarts.
  remedy: try again; if it stays, run: mrl doctor --port PORT
board_refused: the board refused
  also: the board has no parameter NAME
  also: board firmware 1 (2013) cannot store parameters or an id
  cause: The board does not know the request or the value, has firmware of 2013, or restarted before it saved.
  remedy: read the message; upload the current firmware with: mrl flash --port PORT
motor_board: The motor board does not answer
  also: stopped: the motor board did not answer
  cause: The OMNI-3MD has no power, or an I2C wire is loose. The board refuses commands until it answers.
  remedy: check the OMNI-3MD's power, and its I2C wires on A4 (SDA) and A5 (SCL)
bus_hung: The I2C bus hangs
  cause: A device holds the wires of the I2C bus.
  remedy: check the wires on A4 (SDA) and A5 (SCL), then switch power off and on
eeprom: The EEPROM configuration was damaged
  cause: The board's parameters did not fit their checksum, so the defaults of the robot's model are in force.
  remedy: set the parameters that must differ from the model's defaults again:
    mrl config set NAME VALUE --port PORT
wiring: The bridge or its wiring is not set
  cause: A board with an H-bridge does not know its bridge, pins or wires, or a pin cannot do what it is for, or the
    wheels are too slow, or have too few or too many counts, for its control.
  remedy: store the robot's file with: mrl flash --robot FILE --port PORT, and
    mrl set-id ID --robot FILE --port PORT; then run mrl calibrate wiring --port PORT
sensor: An environment sensor does not answer
  also: the echo of an HC-SR04 is held high
  cause: The sensor has answered since the start, and does not any more; or an HC-SR04 hangs, has no 5 V, or its echo
    touches another wire.
  remedy: check the I2C wires and power of the thermopile (0x68) and the compass (0x60), or the 5 V and the wires of the
    HC-SR04; switch power off and on
sensor_silent: no reading
  cause: The board has the sensor, and has sent no reading of it.
  remedy: check its wires, see HARDWARE.md
build: taken as sonar: a board of 2013 does not report it
  cause: Boards have sonars or environment sensors. The model and the board do not agree, or the board cannot say.
  remedy: if it has environment sensors, write build: environment into the robot's YAML
parameters: VALUE on the board, VALUE in the model NAME
  also: set on this board, but not in the model NAME
  cause: A parameter in the board's EEPROM is not that of the robot's model. The message says what follows from it.
  remedy: if the model is right, run mrl config set NAME VALUE --port PORT; if the board is, correct
    the robot's file
brown_out: The board restarted because its supply dropped
  cause: The 5 V of the board fell too low, most often because of a weak USB cable, or of a load on the 5 V pin.
  remedy: check USB cable and hub, and every other load on the board's 5 V
firmware_hung: The board's firmware hung and restarted
  cause: The watchdog of the chip restarted the firmware. This is an error of the firmware or of its memory.
  remedy: report it with: mrl doctor --report --port PORT
board_restart: The board restarted while it was in use
  also: stopped: the robot's board restarted
  also: stopped: the robot's board has started
  cause: Somebody pressed reset, another program opened the port (which resets an Arduino Uno), or the power failed.
  remedy: check power and USB plug, and let no second program open the port
board_stalled: The board was busy for too long
  also: stopped: the robot's board was busy for too long
  cause: The loop of the firmware stood still for 0.25 s, so the board stopped the robot.
  remedy: check the I2C wires and devices; if the board has none, report it with:
    mrl doctor --report --port PORT
board_silent: The board sent nothing for a while
  also: The board fell silent, and stayed silent
  cause: The board made no telemetry, though the connection was there. If it stayed silent, the board has lost its power
    or hangs, or the line carries nothing more.
  remedy: check the board's power, the cable, and the I2C wires if it has any; report it with:
    mrl doctor --report --port PORT
debug_text: The board sends text between its frames
  cause: Debug mode is on, or the sketch prints. Text delays telemetry and commands.
  remedy: connect again, which turns debug mode off; if text stays, remove prints from the sketch
# Battery and motor power
battery_off: motor power is off
  also: Motor power was off
  also: stopped: the battery is empty or switched off
  cause: The motor board measures hardly any voltage: its switch is off, or the battery is not connected.
  remedy: switch motor power on, or connect the battery
battery_empty: The battery was empty
  cause: The voltage is below the model's `empty_v`. The driver stops the robot.
  remedy: charge the battery
battery_low: The battery was low
  cause: The voltage is below the model's `low_v`. The robot still drives.
  remedy: charge the battery soon
battery_dead: battery reads VALUE V
  cause: The motors have no power, or the battery is too low to start.
  remedy: switch motor power on and charge the battery; --ignore-battery is for checks without motors
battery_sag: The battery's voltage sagged
  cause: It lost a tenth of its voltage within seconds: a weak cell, or a poor contact.
  remedy: check the battery's plug and wires; measure its voltage while the motors run; replace a worn pack
no_battery: not measured
  cause: The board has no voltage divider at its battery, so it neither knows the voltage nor protects the battery.
  remedy: connect a divider to the pin battery of the robot's file, and set the parameter battery_divider
no_odometry: none: the motors have no encoders
  cause: The robot's file says so (`wiring.no_encoders`). Its motors turn by their duty alone, and nobody knows how far.
    The robot stops as any other, but no wheel is watched.
  remedy: fit encoders, name their pins in the robot's file, and store them with:
    mrl flash --robot FILE --port PORT
undervoltage: The battery fell below the parameter undervoltage
  also: stopped: the battery fell below the parameter undervoltage
  cause: The board stopped the robot to protect the battery. It refuses to move until the voltage is a sixteenth
    higher.
  remedy: charge the battery, or correct the parameter undervoltage
hot: The motor board was hot
  cause: It reached more than 60 degC.
  remedy: let it cool down, and check that the wheels turn freely
# Wheels and encoders
wheel_fault: a wheel does not follow its command
  also: stopped: a wheel did not follow its command
  also: no wheel turned when the NAME was driven
  cause: A calibration or a drive ended because a wheel or an encoder did not do what was commanded.
  remedy: check wheels, wires and motor power, then run: mrl doctor --drive --port PORT
wheel_blocked: A wheel did not turn at full drive
  also: stopped: a wheel did not turn at full drive
  also: SIDE was blocked or without power
  cause: An obstacle or a cable holds the wheel, a motor wire is loose, or the battery is too small.
  remedy: check that the wheels turn freely, and the motor's wires
wheel_dead: SIDE did not count
  also: no counter moved
  cause: The wheel did not turn, or its encoder did not count. A gyro would show which of the two.
  remedy: check that it turns freely; check the plugs of its encoder and its motor
encoder_dead: An encoder was silent or counted the other direction
  also: stopped: an encoder was silent or counted the other direction
  also: The SIDE encoder was dead
  cause: A wire of the encoder is loose, the wheel was held from the start, or the board's wiring is not the robot's.
  remedy: check the encoder's wires and that the wheel turns freely, then run: mrl calibrate wiring --port PORT
wheel_reversed: SIDE counted against its command
  also: counts backwards
  cause: The wires of the motor or of its encoder are exchanged.
  remedy: swap the wires of its encoder or of its motor, not of both; then run: mrl doctor --drive --port PORT
wheels_swapped: the other wheel's counter moved
  also: its counter is right, but another wheel turned, or this one turned backwards
  also: both counters moved
  cause: The plugs of the right and the left side are exchanged.
  remedy: swap the plugs: right is motor and encoder 3, left is motor and encoder 1
wheels_powerless: No wheel turned
  cause: The motors have no power.
  remedy: check motor power, its switch and the battery's plug
wheels_unchecked: not checked
  also: only the counters were checked
  cause: mrl doctor turns wheels only if you allow it.
  remedy: lift them off the ground, then run: mrl doctor --drive --port PORT
encoder_noise: An encoder's signals are disturbed
  also: VALUE transitions skipped a state
  cause: Some transitions skipped a state, which no wheel does: counts are lost or added.
  remedy: lead the encoder's wires away from the motor's, twist or shield them, and check their plugs and ground
wheel_slow: The SIDE wheel is slower than asked
  cause: The wheel has friction, its motor wire is poor, or the battery is weak under load.
  remedy: check that it turns freely, its motor's wires, and the battery under load
speed_scale: The robot does not drive as fast as asked
  cause: Wheel size, gearbox or encoder counts in the board differ from those of the robot model.
  remedy: compare the robot's YAML with the board's parameters with: mrl doctor --port PORT
wheel_ratio: The SIDE wheel is larger than the other one
  cause: The gyro shows that the robot turns while the wheels count the same.
  remedy: check tyres and tracks, then run: mrl calibrate straight --port PORT
track_width: The robot does not turn as far as its wheels say
  cause: Wheel separation or wheel size in the model is wrong, or the wheels slip in turns.
  remedy: run mrl calibrate straight --port PORT, then: mrl calibrate turn --robot FILE --port PORT
wheel_size: The robot does not drive as far as its wheels say
  cause: The walls that the sonars see fit together for another wheel size, or another curve of the sonars.
  remedy: measure a straight line: mrl calibrate straight --port PORT; then the sonars:
    mrl calibrate sonar --robot FILE --port PORT
slip: SIDE slipped
  cause: The gyro and the wheels disagree: a wheel turned without moving the robot as far.
  remedy: clean the wheels and the floor, check the wheel's hub and its load, and accelerate more gently
pushing: The robot pushed against an obstacle
  also: The robot did not move although its wheels turned
  cause: The wheels turned, and the sonars showed that the robot stood. The pose is off by as much.
  remedy: stop earlier in front of obstacles, for example with protective zones
clamped: The board reduced commands to its speed ceiling
  also: clamped VALUE commands
  cause: Commands were faster than the board's own ceilings allow.
  remedy: command lower speeds, or raise linear_ceiling with:
    mrl config set linear_ceiling VALUE --port PORT
# Sonars
sonar_dead: The NAME sonar gave no reading
  cause: Nothing is connected, or its input is saturated.
  remedy: check its power (D13), the trigger chain (D12) and its output (front A0, left A1, right A2), or supply and
    pins as in the robot's file
sonar_stuck: The NAME sonar always showed the same range
  cause: The sonar does not measure, or something on the robot is in front of it.
  remedy: look in front of it; check its trigger (D12) and its output (front A0, left A1, right A2)
sonar_deaf: The NAME sonar saw nothing
  cause: The sonar sends, and detects no echo where the others see obstacles.
  remedy: clean it, check that nothing absorbs its sound, and exchange it with another one to compare
sonar_swapped: the NAME sonar detected the hand
  cause: The outputs of two sonars are exchanged.
  remedy: swap the outputs of the two sonars
sonar_missed: did not detect the hand
  also: order not checked
  cause: The sonar did not see the hand, or another one saw an obstacle at the same distance.
  remedy: check its output wire, and clear the space around the robot
no_sonars: none: this firmware is the build for environment sensors
  cause: The board has gas and light sensors in place of sonars.
  remedy: if the robot has sonars, upload the other build with: mrl flash --port PORT
# IMU and heading
imu_dead: The IMU stopped
  also: the board reports no IMU any more
  also: no reading of the IMU for 0.1 s
  also: The IMU has answered, and does not any more
  cause: The board receives no reading of the chip. The wheels alone give the heading.
  remedy: check the IMU's wires on A4 (SDA) and A5 (SCL), and its power
imu_frozen: The IMU repeated the same reading
  also: the IMU repeats the same reading
  cause: The chip has stopped measuring.
  remedy: switch its power off and on
imu_wrong: The IMU's readings were out of scale
  also: the IMU's reading is out of scale
  cause: The chip is loose, or its supply disturbs it.
  remedy: check that it is screwed to the body, and its power
imu_tilted: The IMU is not upright
  also: gravity is more than 30 deg from the IMU's vertical axis
  cause: Gravity is more than 30 deg from the axis that the robot's file calls vertical.
  remedy: enter its mounting with: mrl calibrate imu --port PORT
imu_drift: The gyro drifts
  cause: Its bias changed by more than its temperature explains. The heading turns as fast.
  remedy: let the robot stand for a second now and then; keep the IMU away from heat and vibration; replace it
imu_learning: the bias of its gyro is not known
  cause: The driver learns the bias while the robot stands. Until then the wheels alone give the heading.
  remedy: let the robot stand still for a second
imu_off: not read, because that needs checksums and a fast serial link
  cause: The board has an IMU, and the driver does not use it: checksums are off, or the link is below 57600 baud.
  remedy: use a link of 115200 baud, and leave checksums on
# Serial link, network and radio
bad_cable: The cable or the radio link damages data
  also: VALUE frames lost, VALUE pieces of data damaged
  cause: Damaged frames are not used, so the robot misses telemetry and the board misses commands.
  remedy: use a shorter or better USB cable, away from the motor wires; bring radios closer together
noise_bursts: The line was disturbed in bursts
  cause: Something disturbs the cable for short times, such as a motor or a switch.
  remedy: find out what was switched or touched then; lead the cable away from motor wires; check its plugs
frames_lost: Frames of the board were lost
  cause: A network or radio dropped them.
  remedy: bring robot and access point closer together, use a free channel, or a cable
slow_telemetry: VALUE frames/s
  cause: Less telemetry arrived than the board was asked for.
  remedy: close busy programs, and connect the board without a USB hub
slow_line: The line to the robot was slow
  also: VALUE ms from request to answer, at worst VALUE ms
  cause: Answers took more than 50 ms. The robot answers and stops later.
  remedy: connect the board without a hub, at 115200 baud or more; use a faster network or radio
line_stalled: The line held data back
  cause: The data came at once after a pause, so the connection kept them.
  remedy: check USB hub, network or radio between computer and robot
requests_lost: Requests did not reach the board
  cause: The board's telemetry arrived, and requests had no answer. Commands get lost too.
  remedy: check the wire from the computer to the board (RX of the board), the USB hub, or the radio
requests_late: Requests reached the board late
  cause: The board's telemetry arrived in time, and answers came late. Commands come as late.
  remedy: check the wire from the computer to the board (RX of the board), the USB hub, or the radio
refused_by_board: VALUE x VALUE
  cause: The board counts requests that it could not read or carry out.
  remedy: normal after an interrupted program; otherwise check the cable
radio_hold: another robot holds this one by radio
  also: stopped: another robot holds this one by radio
  cause: A robot of the team has stopped this one, and has not freed it, or has fallen silent.
  remedy: look whether the place is free, then release it: ROS service release_hold, or Driver.radio.release_hold()
# The robot stopped
command_timeout: stopped: no new command arrived in time
  also: stopped: the robot heard no command in time
  cause: A drive command counts for 0.5 s. Your program, your key press or your network came later.
command_gaps: Commands came too rarely
  cause: The robot stops and drives on, because commands come just too late.
  remedy: send commands at 10 Hz or more, or raise the command timeout
command_too_late: stopped: a command arrived too late
  cause: The computer or the network is too slow: the command was old when it arrived.
  remedy: release the control and press it again; close busy programs if it happens often
not_a_number: stopped: a command was not a number
  cause: A program sent NaN or infinity as a speed. The driver stops the robot for it.
  remedy: look for a division by zero, or a missing reading, in the program
watchdog_stop: The board stopped the robot because it received nothing
  cause: No frame arrived at the board for 0.25 s, and its watchdog stopped the robot.
  remedy: check the link to the board, and close programs that keep the computer busy
no_telemetry: stopped: no data arrived from the robot
  cause: The board sends nothing, or the connection is down.
  remedy: check its power and its cable or radio
may_be_moving: stopped: no data arrived from the robot, and it may still be moving
  cause: The driver has asked for a stop, and nothing confirms it.
  remedy: stop it by hand
ended: stopped: the program that drove the robot has ended
  also: stopped: the program that drove the robot ended its session
  cause: A program stops its robot when it ends.
emergency_stop: stopped: the emergency stop is on
  cause: Somebody has pressed STOP, or called the service, or the board's input was pressed or its wire is broken. This
    input is not a safety device: a real emergency stop (E-stop) cuts the motors' power.
  remedy: release it: first the button at the robot, then r in mrl drive, the page of mrl web, the ROS service
    release_stop, or Driver.release_emergency()
bumper_hit: stopped: a bumper was hit
  cause: The board has stopped the robot, and refuses to turn a wheel towards an active bumper.
  remedy: drive away from the side that was hit; if nothing touches it, check its switch and wire
cliff: stopped: a cliff sensor sees no floor
  cause: The board has stopped the robot, and refuses to turn a wheel forward.
  remedy: drive backward; if there is floor, check the sensor, its wire and the parameter cliffs_low
motors_disabled: stopped: the motors are switched off
  cause: The service enable_motors has switched them off.
  remedy: switch them on with the service enable_motors
protective_zone: stopped: an obstacle is too close
  cause: An obstacle is in the protective zone of the robot.
  remedy: drive away from it
manual_mode: stopped: the robot was switched to manual mode
  cause: In manual mode the robot is driven by hand and takes no goals.
commands_unpaused: stopped: a program went on sending commands after a stop
  cause: A program that drives, such as a planner, has not paused since a stop or since the robot's node started.
  remedy: end its goal, or let go of the control, and begin again after half a second
goal_missed: the goal was not reached
  cause: Obstacles blocked the robot, or the time was over.
  remedy: clear the path, choose another goal, or allow more time
"""
"""The rows, in groups.  A row begins with its code, which is the same in all versions, and the message as the user sees
it.  `also` is another message with this code; `cause` has sentences that say where it comes from.  `remedy` says what
to do: it begins in lower case and has no full stop at its end, because messages end with it; it is left out if a new
command or nothing is enough.  A field goes on in lines that begin with four spaces."""


class Problem(NamedTuple):
    """One row."""

    code: str
    message: str
    cause: str
    remedy: str
    also: Tuple[str, ...]

    @property
    def advice(self) -> str:
        """The remedy as sentences; empty if there is none.  A command at the end gets no full stop."""
        text = self.remedy[:1].upper() + self.remedy[1:]
        ends_with_command = ": mrl " in text.rpartition("; ")[2]
        return text if ends_with_command or not text else f"{text}."


def _group_of(text: str) -> Tuple[str, Tuple[Problem, ...]]:
    title, *rows = re.split(r"\n(?! )", text)
    return title, tuple(map(_row_of, rows))


def _row_of(text: str) -> Problem:
    (code, message), *fields = (field.split(": ", 1) for field in re.split(r"\n  ", text))
    found: Dict[str, List[str]] = {"also": [], "cause": [], "remedy": []}
    for name, words in fields:
        found[name].append(words)
    (cause,), remedy = found["cause"], "".join(found["remedy"])
    return Problem(code, message, cause, remedy, tuple(found["also"]))


GROUPS = dict(map(_group_of, re.sub("\n    ", " ", _TEXT.strip())[2:].split("\n# ")))
PROBLEMS: Dict[str, Problem] = {row.code: row for rows in GROUPS.values() for row in rows}  # all rows by code
