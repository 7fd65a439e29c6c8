"""Robot model files, packaged and new ones: what is right loads, and what is wrong is said in one line."""

import math
import os

import pytest
import yaml

from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import BRIDGES
from mrl_driver.robot import models, wiring, wirings
from mrl_driver.robot.models import kit
from mrl_driver.robot.models.kit import Kit
from tests.models import four_wheel_kit, four_wheels


def packaged(name, changes=()):
    """The data of a packaged model with changes."""
    with open(os.path.join(os.path.dirname(models.__file__), f"{name}.yaml"), encoding="utf-8") as file:
        return changed(yaml.safe_load(file), changes)


def changed(data, changes):
    """The data with new values by dotted key, or None for one that is taken out."""
    for path, value in dict(changes).items():
        *sections, key = path.split(".")
        place = data
        for section in sections:
            place = place.setdefault(section, {})
        place[key] = value
        if value is None:
            del place[key]
    return data


def load(tmp_path, data):
    path = tmp_path / "robot.yaml"
    path.write_text(data if isinstance(data, str) else yaml.safe_dump(data))
    return models.load(str(path))


def test_packaged_models_load():
    names = models.packaged()
    assert [models.load_packaged(name).name for name in names] == names
    assert {"duo", "omni", "pioneer", "stingbot", "traxbot"} <= set(names)


@pytest.mark.parametrize("name, radius_m", [("traxbot", 0.0390), ("stingbot", 0.0327)])
def test_metres_per_count_gives_the_wheel_radius(name, radius_m):
    """2796.8 counts a turn."""
    per_turn_m = models.load(name).drive.metres_per_count * 2796.8
    assert per_turn_m / (2 * math.pi) == pytest.approx(radius_m, abs=1e-4)


def test_metres_per_count_of_duo_gives_its_wheel():
    """1496.0 counts a turn of a wheel of 65 mm."""
    model = models.load("duo")
    counts = model.board["gearbox"] * model.board["encoder_counts"] / 100
    assert counts == 1496.0
    assert model.drive.metres_per_count * counts / math.pi == pytest.approx(0.065, abs=1e-6)


def test_no_id_belongs_to_two_models():
    ids = [each for name in models.packaged() for each in models.load_packaged(name).ids]
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize("name, why", [("traxbt", " is unknown"), ("t.yaml", ": No such file or directory")])
def test_unknown_name_lists_the_known(name, why):
    known = ", ".join(models.packaged())
    with pytest.raises(ConfigError, match=f"robot '{name}'{why}, expected {known} or the path"):
        models.load(name)


WRONG = {
    "traxbot": [
        ({"name": "lab/one"}, "name is 'lab/one', expected a name of printable characters without /"),
        ({"name": "one\nline"}, r"name is 'one\\nline', expected a name of printable characters"),
        ({"drive.wheel_separation_m": "wide"}, "drive.wheel_separation_m is 'wide', expected a number from"),
        ({"drive.wheel_separation_m": 180}, "is 180, expected a number from 0.02 to 5 "),
        (
            {"drive.wheel_separation_m": 0.4},
            r"is 0.4, expected about 0.174, to fit board.axis_radius \[0.01 mm\]",
        ),
        ({"drive.wheel_separation_m": "0,18"}, "is '0,18', expected .*; write 0.18 "),
        ({"drive.wheel_separation_m": True}, "drive.wheel_separation_m is True"),
        ({"drive.wheel_seperation_m": 0.2}, "key drive.wheel_seperation_m is unknown"),
        ({"drive.metres_per_count": "1e-4"}, "is '1e-4', expected .*; write 0.0001 "),
        ({"drive.metres_per_count": 0.00875}, "expected about 6.07e-05, to fit board.wheel_radius"),
        ({"drive.metres_per_count": 0}, "drive.metres_per_count is 0"),
        ({"drive.metres_per_count": math.nan}, "drive.metres_per_count is nan"),
        ({"drive.metres_per_count": None}, "key drive.metres_per_count is missing"),
        ({"board.wheel_radius": 7800}, "expected about 0.000175, to fit board.wheel_radius"),
        ({"drive.wheel_offset": 0.3}, "drive.wheel_offset is 0.3, expected a number from -0.2 to 0.2"),
        ({"drive.turn_slip": 1.0}, "drive.turn_slip is 1.0, expected a number from -0.5 to 0.9"),
        ({"drive.kind": "tracked"}, "key drive.turn_slip is missing, tracked drives need it"),
        (
            {"drive.kind": "tracked", "drive.turn_slip": 0.1, "body.tracks": False},
            "body.tracks is False, expected true for a tracked drive",
        ),
        ({"body.tracks": 1}, "body.tracks is 1, expected true or false"),
        ({"body.width_m": 2.04}, "body.width_m is 2.04, expected about 0.18, to fit the wheels"),
        ({"sonars.front.x_m": 10}, "sonars.front.x_m is 10.0, expected at most 0.45"),
        (
            {"sonars.back": {"x_m": 0, "y_m": 0, "yaw_deg": 180}},
            "sonars.back is on the input 'back', expected input: front, left",
        ),
        (
            {"body.mass_kg": 1200},
            "body.mass_kg is 1200.0, expected at most 69.8 for a body of this size, in kg",
        ),
        ({"board.kp": 700.5}, "board.kp is 700.5, expected a whole number from 1 to 32767"),
        ({"board.kp": 40000}, "board.kp is 40000"),
        ({"board.kp": 0}, "board.kp is 0"),
        (
            {"board.linear_ceiling": 6500},
            "board.linear_ceiling is 6500, expected a whole number from 1 to 5000",
        ),
        ({"imu.gyro_scale": -1.0}, "imu.gyro_scale is -1.0, expected a number from 0.8 to 1.25"),
        ({"imu.gyro_scale_sd": 0.0}, "imu.gyro_scale_sd is 0.0, expected a number from 1e-05 to 0.25"),
        ({"imu.roll_deg": 181}, "imu.roll_deg is 181, expected a number from -180 to 180"),
        ({"imu.z_m": "high"}, "imu.z_m is 'high', expected a number from -10 to 10"),
        ({"imu.chip": "MPU-6050"}, "key imu.chip is unknown, expected x_m, y_m, z_m, roll_deg"),
        ({"laser.yaw_deg": 181}, "laser.yaw_deg is 181, expected a number from -180 to 180"),
        (
            {"battery.full_v": 8.5},
            "battery is .*8.5.*, expected full_v above low_v above empty_v above off_v",
        ),
        ({"battery.low_v": 14.0}, "battery is"),
        ({"battery.empty_v": 9.0}, "battery is"),
        ({"battery.off_v": 8.5}, "battery is"),
        (
            {"limits.linear_m_s": 0.66},
            "limits.linear_m_s is 0.66, expected at most 0.65, the board.linear_ceiling",
        ),
        ({"limits.angular_rad_s": 5.1}, "limits.angular_rad_s is 5.1, expected at most 5, the"),
        (
            {"limits.lateral_m_s": 0.1},
            "limits.lateral_m_s is 0.1, expected 0: only a base with omni or mecanum",
        ),
        ({"ids": [7, 8, 7]}, r"ids is \[7, 8, 7\], expected each id once"),
    ],
    "omni": [
        (
            {"drive.kind": "omnni"},
            "drive.kind is 'omnni', expected differential, tracked, omni, skid, mecanum",
        ),
        ({"drive.kind": ["omni"]}, r"drive.kind is \['omni'\], expected differential, "),
        ({"drive.radius_m": None}, r"key drive.radius_m is missing \(kind omni\)"),
        (
            {"drive.wheel_separation_m": 0.2},
            r"wheel_separation_m is unknown, expected radius_m, .*\(kind omni\)",
        ),
        (
            {"drive.kind": None},
            r"angles_deg is unknown, expected wheel_separation_m, .*\(kind differential\)",
        ),
        ({"drive.angles_deg": [0, 90, 180]}, r"is \[0, 90, 180\], expected three angles, each 120 deg on"),
        ({"drive.angles_deg": [60, 180]}, "expected three angles"),
        (
            {"drive.angles_deg": [60, "left", 300]},
            "drive.angles_deg is 'left', expected a number from -360 to 360",
        ),
        ({"drive.full_speed_m_s": 0}, "drive.full_speed_m_s is 0"),
        ({"board.bridge": "tb6612"}, "drive.kind is 'omni', expected differential, tracked, skid or mecanum"),
    ],
    "duo": [
        *(
            ({"board.bridge": bridge}, f"board.bridge is {bridge!r}, expected vnh5019, cytron, l298n, ")
            for bridge in ("l293d", "unset", 0, len(BRIDGES), True, 3.0)
        ),
        ({"board.encoder_counts": 0}, "board.encoder_counts is 0, expected a whole number from 1"),
        ({"board.gearbox": 0}, "board.gearbox is 0, expected a whole number from 1"),
        (
            {"board.gearbox": 9, "board.encoder_counts": 11},
            "encoder_counts and full_speed give 3 counts/s at most, expected 51 to 25600: the board cannot control",
        ),
        ({"board.encoder_counts": 32000, "board.gearbox": 3000}, "give 2[0-9]* counts/s at most"),
        (
            {"wiring.left_encoder_b": None},
            "wiring has right_encoder_b, but not left_encoder_b, expected all or none, because .* gives half of the "
            "counts: connect left_encoder_b, or leave out right_encoder_b",
        ),
        (
            {"wiring.sonar_front": None},
            "sonars.front is on the input front, which has no pins: add to the section wiring sonar_front",
        ),
        (
            {"sonars.front.farthest_m": 0.1},
            "sonars.front.nearest_m is 0.15, expected less than farthest_m, 0.1",
        ),
        ({"board.full_speed": 18}, "wheel_radius and full_speed give 61 mm/s at most, expected at least 65"),
        (
            {"board.full_speed": 20, "board.axis_radius": 7500},
            "give 908 mrad/s at most, expected at least 1030",
        ),
        ({"build": "environment"}, "build is 'environment', expected sonar: .* pins that the board.bridge"),
    ],
    "pioneer": [
        ({"limits.linear_m_s": 0.3}, "key limits is unknown, expected name, ids, drive, build"),
        ({"sonars": {}}, "key sonars is unknown, expected name, ids, drive, build"),
        ({"build": "sonar"}, "build is 'sonar', expected environment for a board without motors"),
        ({"drive": "nothing"}, "key board is missing"),
    ],
}


@pytest.mark.parametrize(
    "name, changes, message", [(name, *row) for name, rows in WRONG.items() for row in rows], ids=str
)
def test_wrong_value_names_key_value_and_range(tmp_path, name, changes, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load(tmp_path, packaged(name, changes))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "5", "- a"])
def test_what_is_no_mapping_is_refused(tmp_path, text):
    with pytest.raises(ConfigError, match="expected a mapping"):
        load(tmp_path, text)


REAR = {"x_m": -0.1, "y_m": 0.0, "yaw_deg": 180}


@pytest.mark.parametrize(
    ("mount", "words"),
    [
        (
            REAR,
            "sonars.rear is on the input 'rear', expected input: front, left, right, or range_1 to range_3",
        ),
        ({**REAR, "input": "range_4"}, "or range_1 to range_3 of the wiring on the Uno or Nano"),
        ({**REAR, "input": "left"}, "sonars.rear is on the input left, as sonars.left"),
        (
            {**REAR, "input": "range_1"},
            "has no pins: add to the section wiring range_1_trigger and range_1_echo",
        ),
    ],
)
def test_a_sonar_without_an_input_of_its_own_is_refused_with_what_to_do(tmp_path, mount, words):
    with pytest.raises(ConfigError, match=f"robot.yaml: .*{words}"):
        load(tmp_path, packaged("traxbot", {"sonars.rear": mount}))


@pytest.mark.parametrize(
    ("given", "trigger", "kind", "words"),
    [
        ("range_1", True, "GP2Y0A21", "GP2Y0A21, expected HC-SR04: the input range_1 has a trigger"),
        (
            "range_1",
            False,
            "HC-SR04",
            "HC-SR04, expected GP2Y0A21 or GP2Y0A02: the input range_1 has an echo without a trigger",
        ),
        ("range_1", False, None, "missing, expected GP2Y0A21 or GP2Y0A02: the input range_1 has an echo"),
        ("right", False, "GP2Y0A02", "GP2Y0A02, expected MB1300: the input right has the curve of an MB1300"),
    ],
)
def test_a_type_that_contradicts_the_wiring_is_refused(tmp_path, given, trigger, kind, words):
    wires = {} if given == "right" else {"wiring.sonar_right": None, "wiring.range_1_echo": "A2"}
    wires.update({"wiring.battery": None, "wiring.range_1_trigger": "A3"} if trigger else {})
    mount = {**REAR, "input": given, **({"type": kind} if kind else {})}
    with pytest.raises(ConfigError, match=f"robot.yaml: sonars.right.type is {words}"):
        load(tmp_path, packaged("duo", {**wires, "sonars.right": mount}))


@pytest.mark.parametrize("use", [models.require_supported, lambda model: Driver("/dev/null", model)])
def test_fourth_sonar_of_a_model_made_in_a_program_is_refused(use):
    model = models.load("traxbot")
    with pytest.raises(
        ConfigError, match="robot traxbot: sonars.rear is on the input front, as sonars.front"
    ):
        use(model._replace(sonars={**model.sonars, "rear": model.sonars["front"]}))


@pytest.mark.parametrize("ask", [lambda model: model.base, lambda model: model.differential])
def test_what_needs_wheels_refuses_a_board_without_motors(ask):
    with pytest.raises(ConfigError, match="robot pioneer is a board without motors .drive: none.: it has"):
        ask(models.load("pioneer"))


@pytest.mark.parametrize("tracks, noise", [(True, models.ON_TRACKS), (False, models.ON_WHEELS)])
def test_noise_of_a_model_without_one_is_that_of_its_wheels_or_tracks(tmp_path, tracks, noise):
    assert load(tmp_path, packaged("traxbot", {"body.tracks": tracks})).noise == noise


def test_calibrated_keys_are_read(tmp_path):
    noise = {"wheel_m2_per_m": 2e-5, "turn_rad2_per_rad": 0.001}
    changes = {"drive.wheel_offset": -0.01, "drive.turn_slip": 0.1, "noise": noise}
    model = load(tmp_path, packaged("traxbot", changes))
    assert model.noise == models.ON_TRACKS._replace(**noise)
    assert model.drive.right_m_per_count / model.drive.left_m_per_count == pytest.approx(0.995 / 1.005)
    assert model.drive.turning_separation_m == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("angles", "turned"),
    [
        ({"roll_deg": 90}, (1, -3, 2)),
        ({"pitch_deg": 90}, (3, 2, -1)),
        ({"yaw_deg": 90}, (-2, 1, 3)),
        ({"roll_deg": 90, "yaw_deg": 90}, (3, 1, 2)),
        ({"roll_deg": 90, "pitch_deg": 90}, (2, -3, -1)),
        ({"roll_deg": 180}, (1, -2, -3)),
    ],
)
def test_an_imu_is_turned_about_fixed_axes_by_roll_then_pitch_then_yaw(angles, turned):
    assert models.ImuMount(**angles).rotate((1.0, 2.0, 3.0)) == pytest.approx(turned)


def test_a_drive_says_its_kind_or_is_differential(tmp_path):
    traxbot, omni = packaged("traxbot"), packaged("omni")
    drives = [
        traxbot["drive"],
        {"kind": "differential", **traxbot["drive"]},
        {"kind": "tracked", "turn_slip": 0.1, **traxbot["drive"]},
        {key: value for key, value in omni["drive"].items() if key != "angles_deg"},
    ]
    kinds = [models.kind_of(load(tmp_path, {**traxbot, "drive": drive}).drive) for drive in drives]
    kinds += [models.kind_of(four_wheels(kind).drive) for kind in ("skid", "mecanum")]
    assert kinds == ["differential", "differential", "tracked", "omni", "skid", "mecanum"]


@pytest.mark.parametrize("bridge", ["L298N", "l298n", 3])
def test_a_bridge_is_named_by_its_chip_or_number(tmp_path, bridge):
    model = load(tmp_path, packaged("duo", {"board.bridge": bridge}))
    assert model.board["bridge"] == BRIDGES.index("l298n") == 3


def test_the_firmware_gives_no_bridge_by_default():
    """A board without a bridge and a wiring of its own refuses to move."""
    for model in models.driven_models():
        defaults = models.firmware_defaults(model)
        assert (defaults["bridge"], defaults["wiring"]) == (0, 0)


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The user's folder for models."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    folder = tmp_path / "mrl-driver" / "robots"
    folder.mkdir(parents=True)
    return folder


def test_a_broken_file_in_the_users_folder_is_logged_and_skipped_unless_it_is_named(own, caplog):
    (own / "mine.yaml").write_text("ids: [!!int x]\n")
    assert [models.by_id(1), models.by_id(5), models.by_id(77)] == ["traxbot", "stingbot", ""]
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert f"{own / 'mine.yaml'}: line 1" in caplog.text
    with pytest.raises(ConfigError, match="mine.yaml: line 1"):
        models.load("mine")


def test_a_broken_file_with_the_name_of_the_robots_model_is_an_error(own):
    """Its measured numbers are not replaced by the packaged ones."""
    (own / "traxbot.yaml").write_text("ids: [!!int x]\n")
    assert models.by_id(5) == "stingbot"
    with pytest.raises(ConfigError, match="traxbot.yaml: line 1"):
        models.by_id(1)


def test_an_id_that_two_files_of_the_user_list_is_an_error(own):
    """Programs would take one robot for the other."""
    for name in ("rover", "twin"):
        (own / f"{name}.yaml").write_text(kit.text_of(ROVER._replace(name=name)))
    with pytest.raises(ConfigError, match="robot id 11 is listed by the models rover and twin, expected one"):
        models.by_id(11)


ROVER = Kit("rover", 11, 65.0, 150.0, 1496.0, "tb6612", wirings.load("mrl_duo").pins)


def test_the_file_is_a_model():
    model = kit.model_of(ROVER)
    assert (model.name, model.ids) == ("rover", (11,))
    assert model.drive.wheel_separation_m == 0.15
    assert model.drive.metres_per_count == pytest.approx(math.pi * 0.065 / 1496, rel=1e-6)
    assert BRIDGES[model.board["bridge"]] == "tb6612"
    assert model.board["axis_radius"] == 7500 and model.board["wheel_radius"] == 3250


def test_a_new_robot_has_no_wiring():
    """Its board must not move before the wiring is known."""
    assert "wiring" not in kit.model_of(ROVER).board


@pytest.mark.parametrize("bridge", BRIDGES[1:])
def test_each_bridge_makes_a_model_with_the_wiring(bridge):
    board = kit.model_of(ROVER._replace(bridge=bridge)).board
    assert board["bridge"] == BRIDGES.index(bridge) and wiring.of_board(board) == ROVER.pins


@pytest.mark.parametrize(("counts", "full_speed"), [(1496, 170), (9600, 160), (16, 192)])
def test_a_new_robot_has_an_assumed_speed_that_its_board_can_control(counts, full_speed):
    assert kit.model_of(ROVER._replace(counts_per_turn=counts)).board["full_speed"] == full_speed


WITH_SERVOS = ROVER._replace(
    bridge="cytron", pins={**wirings.load("pwm_d5_d6_dir_d4_d7").pins, "pin_servo_1": 9, "pin_servo_2": 10}
)


def test_a_new_robot_with_two_servos_pans_and_tilts():
    servos = kit.model_of(WITH_SERVOS).servos
    assert [(name, each.servo, each.tilts, each.parent) for name, each in servos.items()] == [
        ("pan", 1, False, ""),
        ("tilt", 2, True, "pan"),
    ]
    assert servos["pan"].pulse_us(0.0) == 1500 and servos["pan"].angle_rad(1000) == -0.785


def test_only_a_mega_has_more_than_three_ranges(tmp_path):
    uno = {"wiring.range_4_trigger": 12, "wiring.range_4_echo": 13}
    with pytest.raises(
        ConfigError, match="wiring.range_4_trigger is '12', expected nothing: the Uno or Nano does not"
    ):
        load(tmp_path, packaged("duo", uno))
    mega = {
        "wiring.range_6_trigger": 30,
        "wiring.range_6_echo": 18,
        "sonars": {"rear": {**REAR, "input": "range_6"}},
    }
    model = load(tmp_path, changed(yaml.safe_load(kit.text_of(four_wheel_kit("skid"))), mega))
    assert model.sonars["rear"].input == "range_6" and model.board["pin_range_6_echo"] == 18


def test_range_sensors_of_a_new_robot_look_outwards_from_its_outline():
    """What is too near for them is inside the body, or as near to that as can be."""
    pins = {
        **ROVER.pins,
        "pin_sonar_front": -1,
        "pin_sonar_left": -1,
        "pin_range_1_echo": 14,
        "pin_range_2_echo": 15,
    }
    made = ROVER._replace(
        pins=pins, sonars={"front": ("range_1", "GP2Y0A02"), "left": ("range_2", "GP2Y0A21")}
    )
    model = kit.model_of(made)
    assert [(name, mount.type, mount.yaw_deg) for name, mount in model.sonars.items()] == [
        ("front", "GP2Y0A02", 0.0),
        ("left", "GP2Y0A21", 45.0),
    ]
    front, left = model.sonars.values()
    assert front.x_m == -model.body.length_m / 2
    reach_m = 0.1 * math.sqrt(0.5)
    assert (left.x_m, left.y_m) == (
        pytest.approx(model.body.length_m / 2 - reach_m, abs=1e-3),
        pytest.approx(model.body.width_m / 2 - reach_m, abs=1e-3),
    )


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"servos.pan.servo": 7}, "servos.pan.servo is 7, expected a whole number from 1 to 6"),
        ({"servos.pan.high_rad": -0.8}, "servos.pan.low_rad is -0.785, expected less than high_rad"),
        ({"servos.tilt.high_us": 1000}, "servos.tilt.high_us is 1000.0, expected another length than low_us"),
        ({"servos.tilt.high_us": 2600}, "servos.tilt.high_us is 2600, expected a number from 500 to 2500"),
        (
            {"servos.tilt.parent": "head"},
            "servos.tilt.parent is 'head', expected a servo above it in the file",
        ),
        ({"servos.Pan": {}}, "servos is 'Pan', expected names of lower-case letters"),
        ({"servos.tilt.servo": 1}, "servos.tilt.servo is 1, expected another one: servos.pan has it"),
        ({"wiring.servo_2": None}, "servos.tilt.servo is 2, expected one with a pin: wiring.servo_2"),
    ],
)
def test_a_servo_that_is_wrong_is_named(tmp_path, change, error):
    with pytest.raises(ConfigError, match=error):
        load(tmp_path, changed(yaml.safe_load(kit.text_of(WITH_SERVOS)), change))


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("wheel_diameter_mm", 0, "wheel diameter .mm. is 0, expected a number from 10 to 650"),
        ("wheel_separation_mm", 700, "wheel separation .mm. is 700, expected a number from 30 to 650"),
        ("counts_per_turn", 0, "counts of a wheel turn is 0, expected a number from 4 to 100000"),
        ("counts_per_turn", math.nan, "counts of a wheel turn is nan"),
        ("bridge", "l293d", "bridge is 'l293d', expected vnh5019, cytron"),
        ("bridge", "unset", "bridge is 'unset', expected vnh5019"),
    ],
)
def test_what_no_robot_has_is_refused(field, value, words):
    with pytest.raises(ConfigError, match=words):
        kit.model_of(ROVER._replace(**{field: value}))


@pytest.mark.parametrize("kind", kit.FOUR_WHEELS)
def test_a_base_that_is_too_wide_in_turns_is_named_by_what_was_entered(kind):
    wide = ROVER._replace(kind=kind, wheel_separation_mm=640, wheelbase_mm=120)
    with pytest.raises(ConfigError, match="wheel separation with wheelbase or slip .mm. is"):
        kit.model_of(wide)


@pytest.mark.parametrize("text", ["", "0", "11x", "a x 4", "nan", "inf", "-4", "1000001"])
def test_other_counts_are_refused(text):
    with pytest.raises(
        ConfigError, match="expected a number from 4 to 100000, or a product such as 11 x 4 x 34"
    ):
        kit.parse_counts(text)


@pytest.mark.parametrize("counts", [4.0, 40.0, 979.62, 1496.0, 3276.7, 3276.8, 12000.0, 99999.9])
def test_gearbox_and_encoder_give_the_counts(counts):
    """Within half of the smallest step of both parameters."""
    gearbox, encoder = kit.gearbox_and_counts(counts)
    assert gearbox <= 32767 and encoder <= 32767
    assert gearbox * encoder / 100 == pytest.approx(counts, abs=gearbox / 200)


def test_a_new_robot_gets_the_lowest_free_id(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    folder = tmp_path / "mrl-driver" / "robots"
    folder.mkdir(parents=True)
    assert kit.free_id() == 11
    (folder / "rover.yaml").write_text(kit.text_of(ROVER))
    (folder / "broken.yaml").write_text("ids: [12]\n")
    assert kit.free_id() == 12 and models.by_id(11) == "rover"
