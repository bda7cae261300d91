"""The poor log of a seed, and prior odds, that leave both effects of the pair open.

Logs are tried in a fixed order: which joints move, and what share of the motion that the limits allow. Each is fitted with the odds of the
pair's `base`, then with the expected number of one family bisected, until both effects are open. So the prior is that of an
engineer who suspects both causes. Both later fits take the same odds. An expected number is shared by all candidates of a family whose
joints move: a single one in a poor log, one per joint afterwards.
"""

from dataclasses import dataclass, field
from math import exp

OPEN = (0.2, 0.8)
FIXED_SHARE = 0.25  # of the motion that the limits allow, of the log of a world of a fixed size
LARGEST_LOGIT = 24.0
HALVINGS = 8


@dataclass(frozen=True)
class Tries:
    """What is tried for a pair."""

    fixed: tuple  # joints that move in the log of a world of a fixed size
    moves: tuple  # joints that move, in this order
    shares: tuple  # of the motion that the limits allow
    family: str  # whose odds are stated: that of the effect `effect` of the pair
    effect: int
    base: dict = field(default_factory=dict)  # expected numbers that are stated in any case


TRIES = {
    "payload": Tries((0, 1, 2), ((1,), (2,)), (0.08, 0.16, 0.32, 0.64), "payload", 0),
    "gain": Tries((1,), ((1,), (1, 2)), (0.08, 0.16, 0.32, 0.64), "payload", 1, {"gain": 0.5}),
    "spring": Tries((1,), ((1,),), (0.04, 0.06, 0.08, 0.12, 0.16), "spring", 0, {"spring": 0.2, "potential": 0.2}),
}


def is_open(pips):
    """Whether both effects are open."""
    return pips is not None and all(OPEN[0] <= pip <= OPEN[1] for pip in pips)


class Search:
    """Tries of one seed; `fit(prior)` gives the PIPs of poor.csv, with expected numbers of families stated."""

    def __init__(self, world, folder, fit):
        self.world, self.path, self.fit, self.tries = world, folder / "poor.csv", fit, TRIES[world.pair]
        self.count = 0

    def log(self, moves, share):
        """Writes the log."""
        self.world.write(self.path, self.world.fourier(0, moves, share), 0)

    def pips(self, prior):
        """PIPs of the pair; `None` where the log cannot be fitted."""
        self.count += 1
        try:
            found = self.fit(prior)
        except RuntimeError:
            return None
        return [found.get(name, 0.0) for name in self.world.effects]

    def line(self, pips, moves, share, prior):
        """What is kept of the search."""
        return {"kept": is_open(pips), "tries": self.count, "moves": moves, "share": share, "prior": prior, "before": pips}

    def fixed(self):
        """The log of a world of a fixed size, whatever it leaves open."""
        self.log(self.tries.fixed, FIXED_SHARE)
        return self.line(self.pips({}), self.tries.fixed, FIXED_SHARE, {}) | {"kept": True}

    def searched(self):
        """The first log that leaves both open."""
        logs = [(moves, share) for moves in self.tries.moves for share in self.tries.shares]
        for moves, share in logs:
            self.log(moves, share)
            pips, prior = self.bisected()
            if is_open(pips):
                return self.line(pips, moves, share, prior)
        return self.line(None, None, None, {})

    def bisected(self):
        """PIPs and prior with which the log leaves both open, or the last ones tried: the stated odds first, then others of one family."""
        prior, low, high, middle = self.tries.base, -LARGEST_LOGIT, LARGEST_LOGIT, None
        pips = self.pips(prior)
        for _ in range(HALVINGS):
            if pips is None or is_open(pips):
                break
            own, other = pips[self.tries.effect], pips[1 - self.tries.effect]
            if middle is not None:
                low, high = (low, middle) if own > OPEN[1] or (own >= OPEN[0] and other < OPEN[0]) else (middle, high)
            middle = 0.5 * (low + high)
            prior = self.tries.base | {self.tries.family: 1.0 / (1.0 + exp(-middle))}
            pips = self.pips(prior)
        return pips, prior
