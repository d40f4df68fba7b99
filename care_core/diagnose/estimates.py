"""Every number that enters a posterior beside what a profile learned and what checks declare, and where it is from.

What was estimated says from how many runs, with an interval where there is one. What is set by hand says what becomes
of the answers where it is set otherwise: of 146 failed missions whose repair is known (five sets, three robots) the
leading explanation is right in 142.
"""

from __future__ import annotations

from care_core.records import Record


class Estimate(Record):
    """A number, what it is, and where it is from."""

    value: float
    name: str
    source: str
    is_by_hand: bool = False


_declared: list[Estimate] = []


def _estimated(value: float, name: str, source: str, *, is_by_hand: bool = False) -> Estimate:
    """Declare a number that was estimated."""
    _declared.append(Estimate(value, name, source, is_by_hand))
    return _declared[-1]


def _by_hand(value: float, name: str, source: str) -> Estimate:
    """Declare a number that is set by hand; `source`: what becomes of the answers where it is another."""
    return _estimated(value, name, source, is_by_hand=True)


MISSION_LOST_CRITICAL = _by_hand(
    0.95,
    "a mission fails with what a critical finding shows, where its check does not say",
    "at 0.9 and 0.98 no leader of 146 is another, its probability moves by 0.003",
)
MISSION_LOST_WARNING = _by_hand(
    0.6,
    "a mission fails with what a warning shows, where its check does not say",
    "at 0.4 and 0.75 no leader of 146 is another, its probability moves by less than 0.001",
)
MISSION_LOST_INFO = _by_hand(
    0.05,
    "a mission fails with what is only noted",
    "no such finding explains",
)
MISSED = _by_hand(
    0.02,
    "a parameter that is off loses the mission, and training does not show it",
    "at 0.01 and 0.04 no leader of 146 is another, its probability moves by less than 0.01; at 0.06 the Brier score of "
    "resets is worse on seven of eight sets, by 0.005 at most",
)
BY_THIS_RUN = _by_hand(
    0.5,
    "weight of what an option takes from missions as this run went beside what it takes from any, where that is more",
    "at 0 and 0.25 the Brier score of 415 flown resets is 0.0502 and 0.0497 in place of 0.0499; at 0 promises to "
    "planted robots say 0.67 where 0.89 is true, with it 0.73",
)
UNMODELLED = _by_hand(
    0.02,
    "a parameter that the profile does not know loses the mission",
    "at 0.01, 0.05 and 0.1 no leader of 146 is another, its probability moves by 0.002 to 0.011",
)
UNSAID = _estimated(
    0.36,
    "an option whose value nobody told lost the mission, where none of them was told",
    "configurations with each option off at 0.15 that failed twice: 105 of 294 (a copter, move_base, three of Nav2;"
    " 0.30 to 0.41)",
)
UNTOLD = _by_hand(
    0.3,
    "what no log shows lost the mission, where no model can be asked; half where a profile fits",
    "what it leads over has less than 0.3 itself",
)
USED_UP = _by_hand(
    0.9,
    "a failsafe of the battery that is all that went wrong ended a flight that outlasted its battery",
    "nothing else that the log shows draws a pack down",
)
REFUSING = _estimated(
    0.98,
    "an option that the refusing check reads kept the vehicle from arming",
    "20 of 20 refused missions of the development sets (Jeffreys: 0.976, 0.88 to 1.0)",
)
BY_CHANCE_REFUSED = _by_hand(
    0.002,
    "a vehicle is kept from arming by chance: a check that refuses reads something",
    "only what the profile does not know stands beside it",
)
REFUSED_ITSELF = _by_hand(
    0.5,
    "what a refusal says is the reason itself, where no parameter is likely to be: no position, sensors at odds",
    "only what the profile does not know stands beside it",
)
SPOKEN_FOR = _by_hand(
    0.05,
    "what options have to lose together for a finding about the settings that names none to speak for them",
    "without such findings 2 of 7 ROS missions that failed by their configuration are led by a parameter, with them 6",
)
LATE = _by_hand(
    0.1,
    "share of its weight that a part keeps which failed when the run was failing already by how it was set",
    "at 0.05 and 0.3 no leader of 146 is another, its probability moves by less than 0.001",
)
DOUBT = _estimated(
    0.03,
    "nothing that is told holds",
    "of 121 leading explanations above 0.95 (84 of development failures, 37 of two seeds of their own) 118 were right: "
    "0.029 (Jeffreys, 0.008 to 0.065)",
)
REPEATS = _by_hand(
    0.8,
    "what went wrong by chance goes wrong again under the same conditions",
    "between 0.7 and 0.9 the Brier score of 545 flown resets moves by less than 0.0007 in each of four sets",
)
BY_CAUSES = _estimated(
    0.5,
    "weight of the noisy-OR beside the mechanisms in a promise",
    "555 resets of nine sets, flown and driven: between 0.4 and 0.7 no set's Brier score moves by more than 0.007",
)
PROMISED_MORE = _estimated(
    0.4,
    "logits that are added to what both promise of a change",
    "555 resets of nine sets: 0.4 to 0.6 are likeliest at every weight; without it 77 advised resets are "
    "said 0.70 where 0.86 were met",
)
LEARNED_WEIGHT = _by_hand(
    5.0,
    "runs at the reference that what is learned of it counts for, beside those counted",
    "with any from 1 to 50 bad luck leads 4 or 5 of the 146",
)
COST = _by_hand(
    0.02,
    "odds that one more change has to bring for the work and the doubt of making it",
    "a cost, declared",
)
WORTH = _by_hand(
    0.15,
    "odds that advice has to add to the run as driven, beyond its cost",
    "a cost, declared: of 13 changes on development failures that add as much and are less likely than not to repair "
    "the run 10 hold what repaired it, 1 does not, and 2 runs nothing repaired",
)
NECESSARY = _estimated(
    0.15,
    "share of the failures of this configuration that a change takes away where it leaves the likeliest cause",
    "of 125 changes on recorded flights those below were wrong, 110 above right",
)
CHANCY = _by_hand(
    0.75,
    "odds of the reference below which it is said that missions fail by chance too",
    "only a note depends on it",
)

ESTIMATES = tuple(_declared)
"""All of them."""
