"""The wire format, declared once: every command, refusal reason and board parameter is one row here.

The decoder, the encoder, the driver and the emulator read these rows.  `mrl_driver.generate` turns them into the
firmware's `protocol.h` and into `firmware/PROTOCOL.md`.  Codes 1 to 28 belong to the 2013 boards (firmware of January
and August 2013); codes from 29 on belong to this project.
"""
from typing import Dict, Iterable, List, NamedTuple, Optional, Tuple

INT16_MIN, INT16_MAX = -32768, 32767
PROTOCOL_VERSION = 2
"""Version that `read_protocol` reports.  2013 boards do not have this command; they count as protocol 1."""

TICK_S = 64e-6
"""Unit of the board's time stamp [s]: Timer1 of the ATmega328P at 16 MHz / 1024.  The 16 bits wrap every 4.194 s."""

STOP_CODE = 13
"""`stop`, the only request that never needs a checksum."""

WRAP = 1 << 16
"""Added to the code of each request to a board of 2013.

Such a board has no checksums and reads numbers as 16 bits (`atoi` of the ATmega), so `@65549e` is a stop as `@13e` is.
No single byte that is lost, doubled or swapped with its neighbour, and no single wrong bit, makes a motor command of
such a request, except of a move.  A lost byte makes `@1e` of `@13e`: `calibrate`.  Other boards refuse these codes."""

SONAR_INVALID = -1
"""Wire value of a sonar that has no reading: not ready yet, missing or saturated."""
SONAR_NOTHING = 645
"""Wire value [cm] of a sonar that sees nothing: the MB1300's range.  The curve gives it for no ADC count."""
RANGES = 6
"""Number of range sensors in a reply; an Uno has pins for three of them."""
RANGE_INVALID, RANGE_HELD, RANGE_NOTHING = -1, -2, 32767
"""Wire values of a range sensor: it did not answer, or there is none; its echo is held high; nothing is in range.  One
that has an echo and no trigger is analog: its values are counts of the converter, or the first of these."""


class Field(NamedTuple):
    """One argument on the wire: a signed decimal between `low` and `high`, both included."""

    name: str
    low: int
    high: int
    unit: str
    text: str

    @property
    def scale(self) -> float:
        """Value of one wire count in `base_unit`: 0.01 for the unit "0.01 degC", else 1."""
        number = self.unit.partition(" ")[0]
        return float(number) if number[:1].isdigit() else 1.0

    @property
    def base_unit(self) -> str:
        """The unit without its factor: "degC" for "0.01 degC"."""
        number, _, rest = self.unit.partition(" ")
        return rest if number[:1].isdigit() else self.unit


class Command(NamedTuple):
    """One command: a row of the table.

    The last `optional` request fields and the last `optional_reply` reply fields may be absent.  A `guarded` request
    always carries a checksum; one that `turns` motors carries one from the host's first `set_check` 1 to its
    `set_check` 0.  A `stamped` reply gets a sequence number and board time while checksums are on.  `repeats` is the
    code of the frames that a stream sends.  A board without `capability` refuses the request as unavailable.
    """

    code: int
    name: str
    text: str
    request: Tuple[Field, ...] = ()
    reply: Tuple[Field, ...] = ()
    optional: int = 0
    optional_reply: int = 0
    guarded: bool = False
    stamped: bool = False
    repeats: int = 0
    turns: bool = False
    capability: str = ""


class I2c(NamedTuple):
    """Registers of a sensor on the I2C bus.  From `register` on there is one number of `width` bytes for each field of
    its row, high byte first, with `per_unit` counts per base unit.  It is signed if the field may be negative."""

    address: int
    register: int
    width: int
    per_unit: float


class Sensor(NamedTuple):
    """A sensor and its command `read_<name>`, which answers with `fields`.

    `usual` is the emulated sensor's value far from everything, in the fields' base unit.  `capability` names the
    firmware build that has the sensor; without it every build supports the sensor, which may be absent.  Without `i2c`
    the sensor uses the Uno's own pins.  The host requests it every `period_ms`.
    """

    code: int
    name: str
    text: str
    fields: Tuple[Field, ...]
    usual: float
    capability: str = ""
    i2c: Optional[I2c] = None
    period_ms: int = 500

    @property
    def command(self) -> Command:
        """The sensor's row among the commands."""
        return Command(self.code, f"read_{self.name}", self.text, (), self.fields, capability=self.capability)


class Reason(NamedTuple):
    """A reason to refuse bytes.  The board counts each reason; `read_counters` returns the counts in this order."""

    name: str
    text: str


class Parameter(NamedTuple):
    """One value of the board's EEPROM configuration, read and written by number.

    `capability` names the boards that use the parameter; others may refuse its number.  Without it all boards have the
    parameter.
    """

    number: int
    name: str
    low: int
    high: int
    unit: str
    text: str
    capability: str = ""


def _int16(name: str, unit: str, text: str) -> Field:
    return Field(name, INT16_MIN, INT16_MAX, unit, text)


def _flag(name: str, text: str) -> Field:
    return Field(name, 0, 1, "", text)


def _count(name: str, text: str) -> Field:
    return Field(name, 0, INT16_MAX, "", text)


_ENCODERS = (
    _int16("right", "count", "Right wheel's counter, encoder 3 of the motor board; wraps at 16 bits."),
    _int16("left", "count", "Left wheel's counter, encoder 1 of the motor board; wraps at 16 bits."),
)
BAUDS = (115200, 250000, 500000, 1000000)
"""Baud rates of the serial link; all but the first are exact on the Uno."""
BAUD = BAUDS[0]
"""Baud rate of each board after a reset, and the default of everything that opens a port."""
_BAUD = Field("rate", 0, 3, "", "Baud rate: 0 is 115200, 1 is 250000, 2 is 500000, 3 is 1000000.")
_REAR = _int16("rear", "count", "Third wheel's counter, encoder 2 of the motor board; wraps at 16 bits.")
_SONARS = tuple(
    Field(name, SONAR_INVALID, 1250, "cm", f"{name.capitalize()} sonar; -1 no reading, 645 nothing in range.")
    for name in ("front", "left", "right")
)
WHEELS = ("left", "right", "rear_left", "rear_right")
"""Motors and encoders of an H-bridge board, in the order of its wiring; the last two only with four wheels."""
_WHEELS = tuple(_int16(name, "count", f"Counter of the {name.replace('_', ' ')} wheel since the start; wraps at 16 "
                                      "bits; 0 without one. 3, 4 and 14 do not change it.") for name in WHEELS) + (
    Field("inputs", 0, INT16_MAX, "bits", "Inputs that are active."),) + tuple(
    Field(f"range_{i}", -2, INT16_MAX, "mm", "As in the reply of 61.") for i in range(1, RANGES + 1))
_PERCENT = "Share of full speed; positive is forward."
_MOTORS = (Field("motor_1", -100, 100, "%", "Left motor. " + _PERCENT),
           Field("motor_3", -100, 100, "%", "Right motor. " + _PERCENT))
_PERIOD = (Field("period", 0, 10000, "ms", "Time between frames; absent or 0: as fast as the serial link allows."),)
_ALCOHOL = Field("alcohol", 0, 1023, "count", "1023 minus the ADC count of the MQ303A.")
_DUST = _int16("dust", "pcs/l", "Particles of 1 um and larger per litre, PPD42NS; larger values read 32767.  2013 "
                                "boards wrap: add 65536 to a negative value.")
_HOTTEST = Field("hottest", 0, 255, "degC", "Hottest of the TPA81's eight pixels.")
_LDR = Field("ldr", 0, 1023, "count", "ADC count of the light sensor.")
_BEARING = Field("bearing", 0, 359, "deg", "Clockwise from north, CMPS10.")
_CHECKED = _flag("checked", "1: every frame in both directions carries a checksum.")
_GYRO = tuple(_int16(f"gyro_{axis}", "0.000266462 rad/s", f"Angular rate about the chip's {axis} axis; 65.5 counts per "
                                                         "deg/s.") for axis in "xyz")
_ACCEL = tuple(_int16(f"accel_{axis}", "0.000598551 m/s2", f"Acceleration along the chip's {axis} axis, +1 g if it "
                                                          "points up; 16384 counts per g.") for axis in "xyz")
_INDEX = Field("index", 0, 86, "", "Row of the parameter table; H-bridge builds alone have rows above 28, and only on "
                                   "a Mega those above 66.")
_ROW = Field("parameter", -1, _INDEX.high, "", "Parameter with the problem; -1: none.")
_SERVO = Field("servo", 1, 6, "", "Servo, by its parameter; an Uno has two, a Mega six.")
_VALUE = _int16("value", "", "The parameter's value in the unit of its row.")
INPUTS: Tuple[str, ...] = (
    "bumper_left", "bumper_right", "bumper_rear", "cliff_left", "cliff_right", "emergency_stop",
)
"""Inputs that stop the robot: bits of `read_inputs`."""
_INPUT_BITS = Field("active", 0, (1 << len(INPUTS)) - 1, "bits", "Sum of the rows of the input table that are active: "
                                                                "hit, over no floor, pressed.")
_ADDRESS = tuple(_int16(f"address_{i}", "", f"Bits {16 * i + 15} to {16 * i} of the XBee's 64-bit address.")
                 for i in (3, 2, 1, 0))
_TEXT = (Field("length", 1, 16, "byte", "Length of the text."),) + tuple(
    _int16(f"text_{i}", "", f"Bytes {2 * i} (high) and {2 * i + 1} (low) of the text.") for i in range(8))

SENSORS: Tuple[Sensor, ...] = (
    Sensor(20, "alcohol", "Read the alcohol sensor.", (_ALCOHOL,), 123, "environment"),
    Sensor(21, "dust", "Read the dust sensor.", (_DUST,), 300, "environment"),
    Sensor(22, "thermopile", "Read the thermopile array.", tuple(
        Field(f"pixel_{i}", 0, 255, "degC", f"Pixel {i} of the TPA81.") for i in range(1, 9)),
        22, "environment", I2c(0x68, 2, 1, 1)),
    Sensor(41, "light", "Read the light sensor.", (_LDR,), 500, "environment"),
    Sensor(42, "compass", "Read the compass.", (_BEARING,), 0, "environment", I2c(0x60, 2, 2, 10), 100),
)
"""Sensors.  A new sensor needs one row here and one function in the firmware, see firmware/SENSORS.md."""

_OTHERS: Tuple[Command, ...] = (
    Command(1, "calibrate", "Motor board finds its PID working points; the wheels turn.", guarded=True,
            turns=True),
    Command(2, "set_pid_gains", "Set the gains of the motor board's speed control.", (
        _count("kp", "Proportional gain."), _count("ki", "Integral gain."), _count("kd", "Derivative gain."))),
    Command(3, "set_encoder_prescaler", "Set how many pulses make one count.", (
        Field("encoder", 1, 3, "", "Encoder of the motor board."),
        Field("prescaler", 0, 4, "", "Counts per 1, 10, 100, 1000 or 10000 pulses."))),
    Command(4, "preset_encoder", "Set one counter.", (
        Field("encoder", 1, 3, "", "Encoder of the motor board."), _int16("count", "count", "New value."))),
    Command(5, "robot_info", "Robot, firmware and battery.", (), (
        _int16("temperature", "0.01 degC", "Motor board's temperature."),
        _count("motor_board_version", "Motor board's firmware times 100."),
        Field("battery", 0, INT16_MAX, "0.01 V", "Battery voltage at the motor board."),
        _count("version", "Board firmware; 1 is 2013, 2 and up is ours."),
        _count("robot_id", "TraxBot 1-3, StingBot 4-5, Pioneer 6-10, others from 11; 0 is not set."))),
    Command(6, "read_encoders", "Read both counters.", (), _ENCODERS, stamped=True),
    Command(7, "read_sonars", "Read the sonars.", (), _SONARS),
    Command(8, "read_encoders_and_sonars", "Read counters and sonars.", (), _ENCODERS + _SONARS, stamped=True),
    Command(9, "move_motors_pid", "Turn the motors, speed controlled.", _MOTORS, turns=True),
    Command(10, "move_motors", "Turn the motors without speed control.", _MOTORS, turns=True),
    Command(11, "move_differential", "Drive; clamped to the board's ceiling.", (
        _int16("linear", "mm/s", "Forward speed."), _int16("angular", "mrad/s", "Yaw rate, counter-clockwise.")),
            turns=True),
    Command(12, "move_to_position", "Turn one motor to a count and hold it with torque.", (
        Field("motor", 1, 3, "", "Motor of the motor board."), Field("speed", -100, 100, "%", _PERCENT),
        _int16("position", "count", "Encoder count to reach.")), turns=True),
    Command(13, "stop", "Stop the motors at once; accepted without a checksum in every state."),
    Command(14, "reset_encoders", "Set all counters to 0; the firmware of 2013 leaves them."),
    Command(15, "get_debug", "Is free text printed?", (), (_flag("debug", "1: yes."),)),
    Command(16, "set_debug", "Print free text, or not.", (_flag("debug", "1: yes."),)),
    Command(17, "get_stream", "Is a stream running, other than the IMU's?", (), (_flag("stream", "1: yes."),)),
    Command(18, "start_stream", "Repeat the reply of 8 until stopped.", _PERIOD, optional=1, repeats=8),
    Command(19, "stop_stream", "End the stream of 18 or 44."),
    Command(23, "start_sensor_stream", "Repeat encoders and sensors.", _PERIOD,
            _ENCODERS + (_ALCOHOL, _DUST, _HOTTEST), optional=1, stamped=True, repeats=23, capability="environment"),
    Command(24, "stop_sensor_stream", "End the sensor stream."),
    Command(25, "start_sensor_ldr_stream", "Repeat encoders, sensors and light.", _PERIOD,
            _ENCODERS + (_ALCOHOL, _DUST, _HOTTEST, _LDR), optional=1, stamped=True, repeats=25,
            capability="environment"),
    Command(26, "stop_sensor_ldr_stream", "End the sensor and light stream."),
    Command(27, "start_compass_stream", "Repeat the compass bearing.", _PERIOD, (_BEARING,),
            optional=1, stamped=True, repeats=27, capability="environment"),
    Command(28, "stop_compass_stream", "End the compass stream."),
    Command(29, "read_protocol", "Protocol version and capabilities of the board.", (), (
        Field("protocol", 2, INT16_MAX, "", "Protocol version."),
        Field("capabilities", INT16_MIN, INT16_MAX, "bits", "Sum of the rows of the capability table, as 16 bits."))),
    Command(30, "read_status", "State of the board: uptime, stops, faults.", (), (
        _count("uptime_high", "Time since reset in units of 32768 s."),
        Field("uptime", 0, INT16_MAX, "s", "Remainder of the time since reset."),
        Field("reset_cause", 0, 4, "", "Row of the reset cause table."),
        Field("stop_reason", 0, 13, "", "Row of the stop reason table: why motors stopped; none while they turn."),
        Field("faults", 0, INT16_MAX, "bits", "Sum of the rows of the fault table."),
        _count("clamped", "Commands above the speed ceiling."),
        _count("impossible", "Encoder transitions that skip a state; only from H-bridge builds.")), optional_reply=1),
    Command(31, "read_counters", "Number of refusals by reason; each counter stops at 32767.", (), tuple(
        _count(name, text) for name, text in (
            ("noise", "Runs of bytes outside a frame."), ("restarted", "Frames cut short by '@'."),
            ("too_long", "Frames beyond the longest row."), ("not_integer", "Arguments that are not integers."),
            ("beyond_int16", "Arguments outside -32768..32767."), ("unknown_command", "Codes without a row."),
            ("argument_count", "Frames with too few or too many arguments."),
            ("argument_range", "Arguments outside the row's range."),
            ("bad_check", "Checksum wrong or absent."),
            ("unavailable", "Commands to hardware that does not answer, and moves after the board's own stop."),
            ("overrun", "Bytes lost before they were read."),
            ("held", "Moves refused because the radio holds the robot; only with parameter 26."))), optional_reply=1),
    Command(32, "set_check", "Turn the checksum on or off in both directions.", (_CHECKED,), (_CHECKED,), guarded=True),
    Command(33, "set_watchdog", "Stop the motors if no valid frame arrives for this long.",
            (Field("period", 0, 10000, "ms", "0 turns it off."),),
            (Field("period", 0, 10000, "ms", "The period in force."),), guarded=True),
    Command(34, "read_config", "Read one board parameter.", (_INDEX,), (_INDEX, _VALUE)),
    Command(35, "write_config", "Set one board parameter, in force at once, kept when saved.",
            (_INDEX, _VALUE), (_INDEX, _VALUE), guarded=True),
    Command(36, "save_config", "Write the parameters to EEPROM.", (),
            (_flag("saved", "1: written and read back equal."),), guarded=True),
    Command(37, "default_config", "Set all parameters but the id to the model's defaults, kept when saved.", (),
            (_flag("done", "1: done."),), guarded=True),
    Command(38, "send_xbee", "Send a text by radio.", _ADDRESS + _TEXT, optional=7, capability="xbee"),
    Command(39, "xbee_text", "A text received by radio; the board sends it without a request.", (),
            _ADDRESS + _TEXT, optional_reply=7),
    Command(40, "discover_xbee", "Search for radio nodes; one reply for each node.", (),
            _ADDRESS + (_int16("network", "", "The node's 16-bit address."),), capability="xbee"),
    Command(43, "move_omni", "Move a robot with three omni wheels in any direction while it turns; clamped "
                             "to the board's ceiling.", (
        Field("speed", 0, 100, "%", "Share of full speed; if a wheel would have to turn faster, all slow down."),
        Field("rotation", -100, 100, "%", "Share of full speed of all wheels, counter-clockwise."),
        Field("direction", 0, 359, "deg", "Of the translation, counter-clockwise from forward.")), turns=True),
    Command(44, "start_omni_stream", "Repeat three counters and the sonars until stopped.", _PERIOD,
            _ENCODERS + (_REAR,) + _SONARS, optional=1, stamped=True, repeats=44),
    Command(45, "set_baud", "Change the baud rate after the reply is sent; it returns to 115200 after 1 s "
                            "without a valid frame.", (_BAUD,), (_BAUD,), guarded=True),
    Command(46, "read_imu", "Read the gyro and the accelerometer.", (), _GYRO + _ACCEL, stamped=True, capability="imu"),
    Command(47, "start_imu_stream", "Repeat the reply of 46 until stopped; another stream may run too.", (
        Field("period", 10, 10000, "ms", "Time between frames."),), repeats=46, capability="imu"),
    Command(48, "stop_imu_stream", "End the stream of 47."),
    Command(49, "read_radio", "Does the radio hold the robot? After the first request, the board also sends the reply "
                              "at each change of the state, and when a text was not delivered.", (), (
        Field("state", 0, 4, "", "Row of the hold state table."),
        Field("holders", 0, 4, "", "Number of robots that hold this one."),
        _count("ignored", "Hold texts without effect: too old, too many holders, or not from a holder."),
        _count("undelivered", "Texts of 38 that reached no radio.")) + tuple(
            f._replace(text=f.text.replace("the XBee's", "a holder's") + " The holder silent for longest; 0 without "
                                                                        "holders.") for f in _ADDRESS),
            capability="hold"),
    Command(50, "release_hold", "Drop the silent holders. The host decides this; time alone never ends a hold.", (),
            (_flag("held", "1: another robot still holds this one."),), guarded=True, capability="hold"),
    Command(51, "read_wiring", "First problem of the wiring in parameters 19, 20 and from 29 on.", (), (
        Field("problem", 0, 11, "", "Row of the wiring problem table."), _ROW,
        _ROW._replace(name="other", text="Second parameter that the problem is about; -1: none.")),
            capability="wiring"),
    Command(52, "set_servo", "Move a servo, from where it is at this speed; the first time at once.", (
        _SERVO, Field("pulse", 500, 2500, "us", "Length of its pulses at the end."),
        Field("speed", 0, INT16_MAX, "us/s", "Change of the length of its pulses; 0: at once.")), (
        _SERVO, Field("pulse", 0, 2500, "us", "Length of its pulses now; 0: it has none.")),
            guarded=True, capability="wiring"),
    Command(53, "read_board", "Chip, and what its wiring connects.", (), (
        Field("chip", 328, 2560, "", "328: ATmega328P of an Uno or Nano; 2560: ATmega2560 of a Mega."),
        Field("motors", 0, 4, "", "Motors of the wiring in force: 0, 2 or 4."),
        Field("encoders", 0, 2, "", "Channels of each encoder; 0: none.")) + tuple(
            Field(name, 0, INT16_MAX, "bits", f"Those {name} that are connected.") for name in (
                "ranges", "inputs", "servos")), capability="wiring"),
    Command(54, "read_wheels", "Read the counter of each wheel, the inputs and the ranges.", (), _WHEELS, stamped=True,
            capability="wiring"),
    Command(55, "start_wheel_stream", "Repeat the reply of 54 until stopped.", _PERIOD, optional=1, repeats=54,
            capability="wiring"),
    Command(56, "stop_wheel_stream", "End the stream of 55."),
    Command(57, "move_twist", "Drive in any direction; clamped to the board's ceiling. Only mecanum wheels move "
                              "sideways.", (
        _int16("forward", "mm/s", "Forward speed."), _int16("left", "mm/s", "Speed to the left."),
        _int16("angular", "mrad/s", "Yaw rate, counter-clockwise.")), turns=True, capability="wiring"),
    Command(58, "move_wheels", "Turn each motor without speed control, on boards with four.", tuple(
        Field(name, -100, 100, "%", _PERCENT) for name in WHEELS), turns=True, capability="wiring"),
    Command(59, "read_inputs", "Bumpers, cliff sensors, and the input of an emergency stop.", (), (
        _INPUT_BITS, _flag("latched", "1: the emergency stop was active, and has not been released."),
        _INPUT_BITS._replace(name="connected", text="Those that have a pin.")),
            capability="wiring"),
    Command(60, "release_emergency", "Release the emergency stop, unless its input is still active.", (),
            (_flag("latched", "1: it is still latched."),), guarded=True, capability="wiring"),
    Command(61, "read_ranges", "Read the range sensors.", (), tuple(
        Field(f"range_{i}", RANGE_HELD, RANGE_NOTHING, "mm", f"Distance by the HC-SR04 at pins range_{i}; -1 no echo "
              "or not connected, -2 echo held high, 32767 nothing in range. Without a trigger: ADC count of an analog "
              "sensor, 0 to 1023, or -1.") for i in range(1, RANGES + 1)), capability="wiring"),
    Command(62, "read_virtual_pose", "Where the calculated robot is in its room.", (), (
        _int16("x", "mm", "From the left wall."), _int16("y", "mm", "From the lower wall."),
        _int16("heading", "mrad", "Counter-clockwise from x, -3142 to 3142.")), capability="virtual"),
)
COMMANDS: Tuple[Command, ...] = tuple(sorted(_OTHERS + tuple(row.command for row in SENSORS)))

BY_CODE: Dict[int, Command] = {row.code: row for row in COMMANDS}
BY_NAME: Dict[str, Command] = {row.name: row for row in COMMANDS}
SENSOR_BY_NAME: Dict[str, Sensor] = {row.name: row for row in SENSORS}

STAMP: Tuple[Field, ...] = (
    _int16("sequence", "", "One more in each stamped frame; wraps at 16 bits."),
    _int16("time", "64 us", "Board time at which the counters or the IMU were read; wraps every 4.194 s, a longer gap "
                            "needs the host's clock."),
)
CHECK = _int16("check", "", "CRC-16 (0x1021, 0xFFFF, unreflected) from '@' up to the comma before this argument, the "
                         "comma excluded.")

REASONS: Tuple[Reason, ...] = tuple(Reason(f.name, f.text) for f in BY_NAME["read_counters"].reply)

CAPABILITIES: Tuple[Tuple[str, str], ...] = (
    ("check", "Checksum, sequence number and board time (32)."),
    ("watchdog", "Link watchdog (33)."),
    ("period", "Streams with a settable period (18)."),
    ("config", "EEPROM configuration (34 to 37)."),
    ("sonars", "Sonar build: 7, 8 and 18 have sonars."),
    ("environment", "Environment-sensor build: 20 to 28 have sensors."),
    ("xbee", "Radio build (38 to 40)."),
    ("omni", "Three omni wheels (43, 44)."),
    ("baud", "Faster serial link (45)."),
    ("bridge", "H-bridge build: motors and encoders on the Arduino's pins; refuses 1 and 43."),
    ("no_battery", "The battery's voltage is not measured; 5 reports 0."),
    ("no_temperature", "The motors' temperature is not measured; 5 reports 0."),
    ("imu", "An IMU has answered since the start (46 to 48)."),
    ("hold", "Other robots can hold this one by radio (49, 50)."),
    ("wiring", "Pins are parameters (51), servos (52), each wheel, a twist (53 to 58), inputs, ranges (59 to 61)."),
    ("virtual", "No robot: the board calculates one that drives in a room (62)."),
)
VIRTUAL_FAULTS: Tuple[Tuple[str, str], ...] = (
    ("left_slips", "The left wheels turn, and the robot does not follow them."),
    ("right_slips", "The same on the right."),
    ("left_blocked", "The left wheels do not turn."),
    ("right_blocked", "The same on the right."),
    ("left_encoder_silent", "The left encoders do not count."),
    ("right_encoder_silent", "The same on the right."),
    ("front_sonar_dead", "The front sonar measures nothing."),
    ("left_sonar_dead", "The same of the left one."),
    ("right_sonar_dead", "The same of the right one."),
    ("battery_sags", "The battery has 9 V."),
)
FAULTS: Tuple[Tuple[str, str], ...] = (
    ("motor_board", "The motor board does not answer."),
    ("bus_hung", "The I2C bus hangs."),
    ("eeprom", "The EEPROM configuration was damaged; the model's defaults are in force."),
    ("id_unset", "No robot id is set."),
    ("sensor", "An environment sensor does not answer, or the echo of an HC-SR04 is held high."),
    ("wiring", "The bridge or its wiring is not set; the board refuses to move."),
    ("imu", "The IMU has answered, and does not any more."),
)
BRIDGES: Tuple[str, ...] = ("unset", "vnh5019", "cytron", "l298n", "tb6612", "drv8833", "bts7960", "l298n_enable",
                            "l298p", "l298p_brake")
"""Bridge chips of parameter 19; l298n has PWM on its inputs, l298n_enable and shields with an L298P on its enable."""
WIRING: Tuple[Tuple[str, str], ...] = (
    ("set", "The wiring is known; without this bit the board refuses to move."),
    ("motors_swapped", "Motor output 1 drives the right wheel, and 3 the left one."),
    ("left_motor_reversed", "The left wheel's motor turns backward when it is driven forward."),
    ("right_motor_reversed", "The same for the right wheel's motor."),
    ("encoders_swapped", "Encoder input 1 belongs to the right wheel, and 3 to the left one."),
    ("left_encoder_reversed", "The left wheel's encoder counts down when the wheel turns forward."),
    ("right_encoder_reversed", "The same for the right wheel's encoder."),
    ("single_channel", "The encoders have channel A only; the direction is that of the command."),
    ("rear_left_motor_reversed", "The rear left wheel's motor turns backward when it is driven forward."),
    ("rear_right_motor_reversed", "The same for the rear right wheel's motor."),
    ("rear_left_encoder_reversed", "The rear left wheel's encoder counts down when the wheel turns forward."),
    ("rear_right_encoder_reversed", "The same for the rear right wheel's encoder."),
)
"""Bits of parameter 20.  Each wheel's bits apply after the swaps: they belong to what drives or measures that wheel.
Motors and encoders of four wheels are swapped by their pins instead."""
WIRING_PROBLEMS: Tuple[Tuple[str, str], ...] = (
    ("none", "The board accepts the wiring."),
    ("not_connected", "The bridge, the encoder or the HC-SR04 needs this pin."),
    ("no_such_pin", "The chip does not have this pin."),
    ("serial_pin", "The serial link has D0 and D1."),
    ("pin_used_twice", "Another function has the same pin."),
    ("no_pwm", "The function needs PWM, and no timer makes it on this pin."),
    ("led_pin", "The bootloader moves this pin, with the LED: a motor could turn, a switch or sensor would short it."),
    ("no_interrupt", "An encoder needs a pin with an interrupt; an echo needs one, too."),
    ("no_analog", "The function needs an analog input, as a range without a trigger does."),
    ("bus_pin", "The I2C bus is in use and has this pin."),
    ("no_servo", "Servo pulses need an output of a 16-bit timer that makes no PWM for a motor."),
    ("no_clock", "The board's clock needs the timer of this pin."),
)
"""Problems of a wiring, in the order of their tests.  The board reports the first one and refuses every motion."""
RESET_CAUSES: Tuple[str, ...] = ("unknown", "power_on", "external", "brown_out", "watchdog")
HOLD_STATES: Tuple[Tuple[str, str], ...] = (
    ("off", "Parameter 26 is 0; hold texts reach the host as other texts do."),
    ("free", "The robot may move."),
    ("listening", "The board has started and refuses moves for the time of parameter 26: a holder may be speaking."),
    ("held", "Moves are refused until each holder has freed the robot."),
    ("silent", "The same, and a holder was not heard for the time of parameter 26."),
)
HOLD_MARK = 0xF8
"""First byte of a hold text.  No ASCII text has it."""
HOLD_TEXTS: Tuple[Tuple[str, str, str], ...] = (
    ("hold", "H", "To a board: stop, and refuse moves."),
    ("free", "F", "To a board: the hold with this number, or an older one, has ended."),
    ("held", "h", "From a board: it is held; the number of the hold in force."),
    ("freed", "f", "From a board: the sender does not hold it. A new hold needs a larger number than this."),
)
"""Texts between a holder and a board: name, second byte, meaning.  Each has 4 bytes: `HOLD_MARK`, this letter, and a
number, high byte first, that is larger in each new hold of a holder.  Numbers wrap at 16 bits."""
MOST_HOLDERS = BY_NAME["read_radio"].reply[1].high
"""A board accepts this many holders at a time."""

SETTINGS: Tuple[Parameter, ...] = (
    Parameter(0, "robot_id", 0, INT16_MAX, "", "Robot id; 0 is not set."),
    Parameter(1, "axis_radius", 1, INT16_MAX, "0.01 mm", "Half the axle, as fitted for the motor board."),
    Parameter(2, "wheel_radius", 1, INT16_MAX, "0.01 mm", "Wheel radius, as fitted for the motor board."),
    Parameter(3, "gearbox", 1, INT16_MAX, "0.1", "Motor turns per wheel turn."),
    Parameter(4, "encoder_counts", 1, INT16_MAX, "0.1", "Encoder counts per motor turn."),
    Parameter(5, "kp", 0, INT16_MAX, "", "Proportional gain; H-bridge: 0.001 of full duty per error of full speed."),
    Parameter(6, "ki", 0, INT16_MAX, "", "Integral gain; H-bridge: 0.001 /s of full duty per error of full speed."),
    Parameter(7, "kd", 0, INT16_MAX, "", "Derivative gain; not used by H-bridge builds."),
    Parameter(8, "ramp_time", 0, INT16_MAX, "ms", "Time from standstill to full speed."),
    Parameter(9, "ramp_gain", 0, INT16_MAX, "", "Take-off gain of the ramp."),
    Parameter(10, "linear_ceiling", 1, INT16_MAX, "mm/s", "Larger forward speeds are clamped to this."),
    Parameter(11, "angular_ceiling", 1, INT16_MAX, "mrad/s", "Larger yaw rates are clamped to this."),
    Parameter(12, "motor_timeout", 1, 255, "100 ms", "The motor board stops after this time without I2C traffic."),
    Parameter(13, "sonar_a", 1, INT16_MAX, "1e-4", "Factor a of range_cm = a s^b + c."),
    Parameter(14, "sonar_b", 1, 20000, "1e-4", "Exponent b."),
    Parameter(15, "sonar_c", INT16_MIN, INT16_MAX, "1e-4 cm", "Offset c."),
    Parameter(16, "bus_speed", 100, 400, "kHz", "I2C clock towards the motor board."),
    Parameter(17, "bus_stop", 0, 1, "", "1: stop and start between the register and the read, for old motor boards."),
    Parameter(18, "full_speed", 1, 1000, "1/min", "Turns of a wheel at 100 %; applies the ceilings to 43."),
    Parameter(19, "bridge", 0, len(BRIDGES) - 1, "", "Row of the bridge table; 0 is not set.", "bridge"),
    Parameter(20, "wiring", 0, 4095, "bits", "Sum of the rows of the wiring table; 0 is not set.", "bridge"),
    Parameter(21, "stop_mode", 0, 1, "", "How the H-bridge stops: 0 brakes, 1 lets the wheels coast.", "bridge"),
    Parameter(22, "reversal_pause", 0, 1000, "ms", "Time without drive before a wheel changes direction.", "bridge"),
    Parameter(23, "friction_duty", 0, 500, "0.1 %", "Duty at which a wheel begins to turn.", "bridge"),
    Parameter(24, "battery_divider", 0, INT16_MAX, "0.001", "Battery voltage per volt at its pin; 0: not measured.",
              "bridge"),
    Parameter(25, "undervoltage", 0, INT16_MAX, "0.01 V", "The motors stop below this voltage; 0 turns it off.",
              "bridge"),
    Parameter(26, "radio_hold", 0, 300, "100 ms", "Time after which a holder counts as silent; 0: no hold by radio.",
              "hold"),
    Parameter(27, "plain_calibrate", 0, 1, "", "1: until the host turns checksums on, 1 needs none, as in 2013. One "
                                               "damaged byte of 5, 13 or 19 may then become 1.", "omni"),
    Parameter(28, "virtual_faults", 0, 1023, "bits", "Sum of the rows of the table of virtual faults.", "virtual"),
)
"""The parameters that every build stores."""
NOT_CONNECTED = -1
"""Value of a pin that leads nowhere."""


def _pins(rows: Iterable[Tuple[str, str]]) -> Tuple[Tuple[str, int, int, str], ...]:
    return tuple((f"pin_{name}", NOT_CONNECTED, 69, f"Arduino pin of {text}; -1: not connected.")
                 for name, text in rows)


def _motor_pins(side: str, number: int) -> List[Tuple[str, str]]:
    return [(f"{side}_{wire.lower()}", f"{wire} of motor {number}") for wire in ("PWM_A", "PWM_B", "LOGIC")]


def _encoder_pins(side: str, number: int) -> List[Tuple[str, str]]:
    return [(f"{side}_encoder_{each.lower()}", f"channel {each} of encoder {number}") for each in "AB"]


def _range_pins(*numbers: int) -> List[Tuple[str, str]]:
    texts = {"trigger": "the trigger of HC-SR04 {}", "echo": "the echo of HC-SR04 {0}, or of analog range sensor {0}"}
    return [(f"range_{i}_{pin}", text.format(i)) for i in numbers for pin, text in texts.items()]


_ON_BOTH_CHIPS = (
    *_pins((
        *_motor_pins("left", 1), *_motor_pins("right", 3), *_encoder_pins("left", 1), *_encoder_pins("right", 3),
        ("sonar_front", "the front sonar's output"), ("sonar_left", "the left sonar's output"),
        ("sonar_right", "the right sonar's output"), ("sonar_trigger", "the sonars' trigger"),
        ("sonar_power", "the sonars' power switch"), ("battery", "the battery's divider"),
        ("enable_1", "an enable, such as STBY of a TB6612"), ("enable_2", "a second enable"),
    )),
    ("i2c", 0, 1, "1: the I2C bus has its two pins."),
    *_pins((("servo_1", "servo 1"), ("servo_2", "servo 2"))),
    ("servo_release", 0, 1, "What servos do after 2 s without a frame of the host; 0: they stay where they "
                            "are, 1: they get no pulses."),
    ("no_encoders", 0, 1, "1: the motors have no encoders, and turn by their duty alone."),
    *_pins((
        ("bumper_left", "the bumper at the front left"), ("bumper_right", "the bumper at the front right"),
        ("bumper_rear", "the bumper at the rear"), ("cliff_left", "the cliff sensor at the front left"),
        ("cliff_right", "the cliff sensor at the front right"),
        ("emergency_stop", "the emergency stop, closed to ground until it is pressed"),
    )),
    ("bumpers_high", 0, 1, "1: bumpers read high when they are hit, 0: low."),
    ("cliffs_low", 0, 1, "1: cliff sensors read low where there is no floor, 0: high."),
    *_pins(_range_pins(1, 2, 3)),
    ("air_temperature", -40, 60, "Air temperature [degC]; sound has 331.3 + 0.606 T m/s."),
)
_ON_THE_MEGA = _pins((
    *_motor_pins("rear_left", 2), *_motor_pins("rear_right", 4),
    *_encoder_pins("rear_left", 2), *_encoder_pins("rear_right", 4),
    *((f"servo_{number}", f"servo {number}") for number in range(3, 7)), *_range_pins(4, 5, 6),
))
PINS: Tuple[Parameter, ...] = tuple(
    Parameter(len(SETTINGS) + i, name, low, high, "", text, "bridge")
    for i, (name, low, high, text) in enumerate((*_ON_BOTH_CHIPS, *_ON_THE_MEGA))
)
"""The parameters of the wiring, which H-bridge builds store apart from the others.  A0 is 14 on the Uno and 54 on the
Mega."""
PINS_328P = len(_ON_BOTH_CHIPS)
"""Number of the first rows of `PINS` that the ATmega328P has; the ATmega2560 has all."""
PARAMETERS: Tuple[Parameter, ...] = SETTINGS + PINS
PARAMETER_BY_NAME: Dict[str, Parameter] = {row.name: row for row in PARAMETERS}

MAX_ARGUMENTS = max(max(len(row.request), len(row.reply) + (len(STAMP) if row.stamped else 0))
                    for row in COMMANDS) + 1
"""Largest number of arguments of any frame, including the checksum."""


def longest_frame() -> int:
    """Return the length of the longest frame that the rows allow, from '@' to 'e' [byte]."""
    def width(fields: Tuple[Field, ...]) -> int:
        return sum(1 + max(len(str(f.low)), len(str(f.high))) for f in fields)
    return max(2 + len(str(row.code)) + width((CHECK,)) + max(
        width(row.request), width(row.reply + (STAMP if row.stamped else ()))) for row in COMMANDS)


MAX_FRAME = longest_frame()
MAX_NOISE = 64
"""A run of bytes outside a frame is reported when it reaches this length [byte]."""
