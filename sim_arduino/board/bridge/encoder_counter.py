"""A counter of the protocol: a wheel's counts from a preset value on, divided by its prescaler."""

from .integers import int16


class EncoderCounter:
    """`travel` is the sum of all counts of the wheel."""

    def __init__(self) -> None:
        self._count = self._travel = 0
        self._prescale = 1

    def read(self, travel: int) -> int:
        """The counter (int16)."""
        return int16(self._count + (travel - self._travel) // self._prescale)

    def preset(self, count: int, travel: int) -> None:
        """The counter is `count` from now on."""
        self._count, self._travel = count, travel

    def set_prescaler(self, power: int, travel: int) -> None:
        """A step of the counter takes 10^power counts; the counter stays."""
        self.preset(self.read(travel), travel)
        self._prescale = 10**power

    def travel_at(self, count: int, travel: int) -> int:
        """The travel at which the counter is `count`, the shorter way round."""
        return travel + int16(count - self.read(travel)) * self._prescale
