"""What is left of the tank's equation if some sensor has the wrong sign, or none has."""

from utank_hil.safety.monitors.noise import within


class Misfit:
    """Squares of e + k u - z, with the share k of sway and the zero z that leave the least of them.

    e is what a case does not explain of the water's motion, u what a sway of g times the slope
    takes from the water in that case. The sums fade.
    """

    __slots__ = ("_e", "_ee", "_eu", "_u", "uu", "weight")

    def __init__(self) -> None:
        self._e = self._u = self._ee = self._eu = self.uu = self.weight = 0.0

    def add(self, e: float, u: float, keep: float) -> None:
        """Fade by `keep`, then add a sample."""
        self._e = keep * self._e + e
        self._u = keep * self._u + u
        self._ee = keep * self._ee + e * e
        self._eu = keep * self._eu + e * u
        self.uu = keep * self.uu + u * u
        self.weight = keep * self.weight + 1.0

    def least(self, most_share: float, most_zero: float) -> float:
        """Return the least sum for a share from 0 to `most_share` and a zero up to `most_zero`."""
        e, u, eu, uu, weight = self._e, self._u, self._eu, self.uu, self.weight
        share = zero = 0.0
        for _ in range(2):  # u has no mean, so that they hardly depend on one another
            zero = within((e + share * u) / weight, most_zero)
            if uu > 0.0:
                share = min(max((zero * u - eu) / uu, 0.0), most_share)
        of_share = share * (2.0 * eu + share * uu)
        of_zero = zero * (weight * zero - 2.0 * (e + share * u))
        return max(self._ee + of_share + of_zero, 0.0)
