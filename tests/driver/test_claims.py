"""Claims of a place: one robot at a time, whatever happens to the messages."""

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.navigation.claims import LATE_S, REPEAT_S, SILENT_S, Claim, ClaimMessage

NAMES = ("a", "b", "c")


class Talk:
    """Three robots and the messages between them, under way until they are delivered."""

    def __init__(self, names=NAMES):
        self.now_s = 0.0
        self.claims = {name: Claim(name, [each for each in names if each != name], -LATE_S) for name in names}
        self.under_way = []
        self.dead = set()

    def send(self):
        """All robots send what is due."""
        for name, claim in self.claims.items():
            if name not in self.dead:
                self.under_way += claim.messages(self.now_s)

    def deliver(self, message):
        if message.to not in self.dead:
            self.claims[message.to].receive(ClaimMessage.parse(message.text), self.now_s)

    def exchange(self, times=3):
        """Messages go to and fro without delay."""
        for _ in range(times):
            self.now_s += REPEAT_S
            self.send()
            under_way, self.under_way = self.under_way, []
            for message in under_way:
                self.deliver(message)

    @property
    def holders(self):
        return [name for name, claim in self.claims.items() if claim.held]


@pytest.fixture
def talk():
    made = Talk()
    made.exchange()
    return made


def test_first_claim_wins_and_the_next_follows_after_the_release(talk):
    """Release and the grant of the next claim are one message."""
    talk.claims["c"].want()
    talk.exchange(1)
    talk.claims["a"].want()
    talk.exchange()
    assert talk.holders == ["c"]
    talk.claims["c"].release()
    for message in talk.claims["c"].messages(talk.now_s):
        talk.deliver(message)
    talk.exchange(1)
    assert talk.holders == ["a"]


@pytest.mark.parametrize("dead, holders", [("c", []), ("a", ["a"])], ids=["before its answer", "as holder"])
def test_a_robot_that_vanished_blocks_the_place_and_is_named_until_it_is_heard_again(talk, dead, holders):
    if holders:
        talk.claims["a"].want()
        talk.exchange()
    talk.dead.add(dead)
    talk.claims["b"].want()
    talk.exchange(100)
    assert talk.holders == holders and talk.claims["b"].silent(talk.now_s) == (dead,)
    talk.dead.clear()
    talk.claims["a"].release()
    talk.exchange()
    assert talk.holders == ["b"]


def test_robot_is_silent_after_the_limit_and_repeats_its_messages_before():
    claim = Claim("a", ["b"], 10.0)
    assert not claim.silent(10.0 + SILENT_S) and claim.silent(10.1 + SILENT_S) == ("b",)
    claim = Claim("a", ["b"], 0.0)
    assert claim.messages(0.0) and not claim.messages(REPEAT_S - 0.1) and claim.messages(REPEAT_S)


def test_claims_at_the_same_time_are_decided_by_name(talk):
    for name in ("c", "b", "a"):
        talk.claims[name].want()
    talk.exchange()
    assert talk.holders == ["a"]


def test_robot_that_started_again_does_not_claim_by_a_message_from_before_its_start():
    """It granted the claim of a, and has forgotten that; by the late message its own claim would be better."""
    talk = Talk(("a", "b"))
    talk.exchange()
    late = ClaimMessage("a", 0, "b", 0)
    for _ in range(2):
        talk.claims["a"].want()
        talk.exchange()
        talk.claims["a"].release()
    talk.claims["a"].want()
    talk.exchange()
    talk.claims["b"] = Claim("b", ["a"], talk.now_s)
    talk.claims["b"].want()
    talk.deliver(late)
    talk.exchange(10)
    assert talk.holders == ["a"]


def test_message_that_was_overtaken_does_not_take_the_place_away(talk):
    late = ClaimMessage("b", 0, "a", 0)
    talk.claims["a"].want()
    talk.exchange()
    talk.deliver(late)
    assert talk.holders == ["a"]


def test_message_of_a_stranger_or_for_another_robot_is_ignored():
    claim = Claim("a", ["b"], 0.0)
    claim.want()
    for message in (ClaimMessage("x", 0, "a", 1), ClaimMessage("b", 0, "c", 1)):
        claim.receive(message, 0.0)
    assert claim.messages(0.0) == [ClaimMessage("a", 0, "b", 0)] and not claim.held


@pytest.mark.parametrize("text", ["", "a 1 b", "a 1 b 2 3", "a -1 b 2", "a x b 2", "a 1 b 1234567890"])
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match="expected SENDER CLAIM RECEIVER GRANTED"):
        ClaimMessage.parse(text)
    message = ClaimMessage("1", 9999, "2", 9998)
    assert ClaimMessage.parse(message.text) == message and len(message.text) <= 16


@pytest.mark.parametrize("names", [("a", "a"), ("a b", "c"), ("", "c")])
def test_names_that_messages_cannot_carry_are_refused(names):
    with pytest.raises(ConfigError, match="expected"):
        Claim(names[0], names[1:], 0.0)
