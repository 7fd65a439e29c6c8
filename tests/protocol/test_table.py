"""The command table is complete and consistent."""

from mrl_driver.protocol import table
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_CODE, BY_NAME, COMMANDS, PARAMETERS


def test_every_field_fits_int16():
    fields = [field for row in COMMANDS for field in row.request + row.reply]
    assert all(-32768 <= field.low <= field.high <= 32767 for field in fields)


def test_parameters_are_indexed_in_order():
    assert [row.number for row in PARAMETERS] == list(range(len(PARAMETERS)))
    last = PARAMETERS[-1].number
    assert all(BY_NAME[name].request[0].high == last for name in ("read_config", "write_config"))


def test_streams_repeat_a_stamped_row():
    repeated = {row.repeats for row in COMMANDS if row.repeats}
    assert repeated and all(BY_CODE[code].stamped for code in repeated)


def test_status_ranges_match_their_tables():
    ranges = {field.name: field.high for field in table.BY_NAME["read_status"].reply}
    assert (ranges["reset_cause"], ranges["stop_reason"]) == (
        len(table.RESET_CAUSES) - 1,
        len(STOP_REASONS) - 1,
    )
