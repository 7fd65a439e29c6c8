"""Claims by radio: the team's addresses and names."""

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.navigation.claims import ClaimMessage
from mrl_driver.navigation.radio_claims import MOST_ROBOTS, RadioTeam, read_radios
from mrl_driver.robot.radio import BROADCAST

ONE, TWO = 0x0013A20040000001, 0x0013A20040000002
TEAM = {"1": ONE, "2": TWO}


def test_radios_are_read():
    assert read_radios("1=0013a20040000001, 2=0013A20040000002") == TEAM


@pytest.mark.parametrize("text", ["", "1", "1=", "=5", "1=x", "1=5,1=6", "1=5,,2=6"])
def test_other_texts_are_refused(text):
    with pytest.raises(ConfigError, match="expected NAME=ADDRESS of each robot"):
        read_radios(text)


def test_message_goes_to_the_radio_of_its_receiver():
    assert RadioTeam("1", TEAM).text_to(ClaimMessage("1", 3, "2", 0)) == (TWO, "1 3 2 0")


def test_claim_is_taken_from_the_radio_of_its_sender():
    assert RadioTeam("1", TEAM).message_of(TWO, "2 4 1 3") == ClaimMessage("2", 4, "1", 3)


def test_claim_from_another_radio_is_refused_by_name():
    """Two robots with the same name might grant each other's claim and both go."""
    with pytest.raises(ConfigError, match="comes from radio 0013a20040000003, expected 0013a20040000002"):
        RadioTeam("1", TEAM).message_of(ONE + 2, "2 4 1 3")


@pytest.mark.parametrize("text", ["hello", "3 4 1 3", "2 4 1", "\\xf8H\\x00\\x01"])
def test_other_texts_of_the_radio_are_no_claims(text):
    assert RadioTeam("1", TEAM).message_of(TWO, text) is None


@pytest.mark.parametrize(
    "name, addresses, error",
    [
        ("3", TEAM, "expected 2 to 6 robots, 3 among them"),
        ("1", {"1": ONE}, "expected 2 to 6 robots"),
        ("0", {str(i): ONE + i for i in range(MOST_ROBOTS + 1)}, "expected 2 to 6 robots"),
        ("1", {"1": ONE, "2": ONE}, "0013a20040000001 cannot be used, expected one of its own"),
        ("1", {"1": ONE, "2": BROADCAST}, "000000000000ffff cannot be used"),
        ("robot1", {"robot1": ONE, "robot2": TWO}, "at most 5 characters together"),
    ],
)
def test_teams_that_cannot_talk_by_radio_are_refused(name, addresses, error):
    with pytest.raises(ConfigError, match=error):
        RadioTeam(name, addresses)
