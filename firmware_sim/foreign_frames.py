"""Measurements in the frames of another maker's device, by its profile."""

from typing import Any

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Frame
from utank_hil.canbus.profiles.device import DevicePlan


class ForeignFrames:
    """Encodes what a device of the plan sends: values, status, counters, stamps and checksums.

    ValueError is raised if a cycle is no whole number of ticks: an emulated device has no other.
    """

    def __init__(self, plan: DevicePlan[Any]) -> None:
        for each in plan.messages:
            if each.cycle_ns % TICK_NS:
                raise ValueError(
                    f"devices.{plan.name}: a cycle of {each.cycle_ns / 1e6:g} ms can't be "
                    f"emulated, only whole multiples of {TICK_NS / 1e6:g} ms"
                )
        self._plan = plan
        self._counts = [0] * len(plan.messages)

    def frames(self, message: tuple[Any, ...], now_ns: int, tick: int) -> list[Frame]:
        """The frames that are due in this tick."""
        frames = []
        for place, each in enumerate(self._plan.messages):
            if tick % (each.cycle_ns // TICK_NS):
                continue
            word = 0
            for signal in each.signals:
                value = signal.sign * float(message[signal.place]) - signal.offset
                word = signal.field.put(word, value / signal.factor, each.length)
            for condition in each.conditions:
                word = condition.field.put(word, min(condition.allowed), each.length)
            if each.stamp is not None:
                stamp = round(now_ns / (1e3 * each.stamp_us)) % (1 << each.stamp.bits)
                word = each.stamp.put(word, stamp, each.length)
            if each.counter is not None:
                self._counts[place] = (self._counts[place] + 1) % (1 << each.counter.bits)
                word = each.counter.put(word, self._counts[place], each.length)
            data = word.to_bytes(each.length, "little")
            if each.crc is not None:
                at = each.crc.byte
                data = data[:at] + bytes([each.crc.of(data)]) + data[at + 1 :]
            frames.append(Frame(each.can_ids[-1], data))
        return frames
