"""The wirings of docs/wirings.md that drive: on the firmware's image, and those of a Mega on the Python board."""

import math
from pathlib import Path

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.host.firmware_images import image_path
from mrl_driver.robot import models
from mrl_driver.robot.chips import ATMEGA328P
from sim_arduino.board import PythonBoard
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve import factory
from sim_arduino.world.world import World
from tests.models import bridged
from tests.wirings import rows

STEP_S, BOOT_S, PAUSE_S = 0.02, 0.3, 0.4
SIDE_MM_S, SIDE_S, TURN_MRAD_S, TURN_S = 200, 2.0, 1000, math.pi / 2
CLOSED_M, CLOSED_RAD = 0.05, 0.15
"""Most after a round of 1.6 m that nothing corrects, with the gains for another bridge."""
ROWS = [row for row in rows() if row.verdict in ("drives", "later: Mega")]


@pytest.mark.parametrize("row", ROWS, ids=[row.name for row in ROWS])
def test_a_wiring_drives_a_closed_square(row, close_later):
    model = bridged(row.bridge, **row.pins)._replace(chip=row.chip.name)
    plant = Plant(model, World(), (0.0, 0.0, 0.0), footprint="none")
    is_uno = row.chip == ATMEGA328P
    robot_id = model.ids[0]
    board = close_later(
        AvrEngine(plant, image_path("hbridge"), robot_id) if is_uno else PythonBoard(plant, robot_id)
    )
    now_s, places = BOOT_S, []
    board.advance(now_s)
    for linear, angular, seconds in 4 * (
        (SIDE_MM_S, 0, SIDE_S), (0, 0, PAUSE_S), (0, TURN_MRAD_S, TURN_S), (0, 0, PAUSE_S),
    ):  # fmt: skip
        for _ in range(round(seconds / STEP_S)):
            board.receive(b"@11,%d,%de" % (linear, angular))
            now_s += STEP_S
            board.advance(now_s)
        places.append(plant.true_pose)
    end = places[-1]
    assert math.hypot(end.x_m, end.y_m) < CLOSED_M and abs(end.yaw_rad) < CLOSED_RAD
    assert math.hypot(places[4].x_m, places[4].y_m) > 1.3 * SIDE_MM_S * SIDE_S / 1000


def test_a_robot_with_a_mega_has_no_image_to_emulate(tmp_path):
    path = tmp_path / "mega.yaml"
    text = Path(models.path_of("duo")).read_text(encoding="utf-8")
    path.write_text(
        text.replace("encoder_a: 8", "encoder_a: 18").replace("wiring:", "wiring:\n  chip: atmega2560")
    )
    with pytest.raises(ConfigError, match="duo has an atmega2560, for which there is no firmware binary"):
        factory.make(factory.Options(robot=str(path), engine="avr"))
