"""Numbers of frames: which are new, which were lost, which were overtaken on their way."""

import pytest

from mrl_driver.session.link_counters import Counters
from mrl_driver.session.sequence import Stream


@pytest.mark.parametrize("silent", [False, True])
@pytest.mark.parametrize("back, overtaken", [(1023, True), (1024, False)])
def test_a_number_up_to_1023_back_was_overtaken_unless_there_was_a_silence(back, overtaken, silent):
    counters = Counters()
    stream = Stream(counters)
    stream.missing(0, silent)
    lost = stream.missing(-back, silent)
    assert (lost == -1) == (overtaken and not silent)
    assert counters.overtaken == (overtaken and not silent)


def test_the_same_number_is_a_duplicate_even_after_a_silence():
    counters = Counters()
    stream = Stream(counters)
    assert [stream.missing(7, True), stream.missing(7, True)] == [0, -1]
    assert counters.duplicates == 1
