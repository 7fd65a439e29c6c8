"""A 16-bit counter: a wheel's counts from a preset value on, divided by its prescaler."""

from mrl_driver.protocol.frames import to_int16


class EncoderCounter:
    """`travel` is the sum of all counts of the wheel; `prescale` of them make a step of the counter."""

    def __init__(self) -> None:
        self._count = self._travel = 0
        self.prescale = 1

    def read(self, travel: int) -> int:
        """The counter (int16)."""
        return to_int16(self._count + (travel - self._travel) // self.prescale)

    def preset(self, count: int, travel: int) -> None:
        """The counter is `count` from now on."""
        self._count, self._travel = count, travel

    def set_prescaler(self, power: int, travel: int) -> None:
        """A step of the counter takes 10^power counts; the counter stays."""
        self.preset(self.read(travel), travel)
        self.prescale = 10**power

    def travel_at(self, count: int, travel: int) -> int:
        """The travel at which the counter is `count`, the shorter way round."""
        return travel + to_int16(count - self.read(travel)) * self.prescale
