"""The drive: does it do what is commanded? It stands, it stops and goes, it is too slow, it pulls to one side."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind, Severity, SuspectKind
from care_core.ecosystems.ros.drive import FEWEST_COMMANDS, Drive
from care_core.ecosystems.ros.messages import BATTERY, COMMANDS, GOALS, ODOMETRY, reading
from care_core.ecosystems.ros.motion import (
    ANSWER_S,
    BREAKS_LOOSE_MPS,
    BREAKS_LOOSE_RADPS,
    STALE_S,
    Commands,
    Following,
    Odometry,
)
from care_core.ecosystems.ros.sensors import Battery
from care_core.ecosystems.spans import Span, seconds_in
from care_core.numbers import Bools, Floats, known_median, median, quantile
from care_core.records import replace
from care_core.text import log_time

LIMITS = Limits()
_HEALTHY = "301 healthy move_base missions"
STANDS_S = LIMITS.add("standstill against commands", 5.0, "s", f"{_HEALTHY}: 1.5 s at most")
STANDING = LIMITS.add("share of the command that counts as standing", 0.2, "", "noise of odometry at rest, slip")
ORDINARY_MPS = LIMITS.add("command that no robot is too slow for", 0.5, "m/s", "a walk is faster")
STILL = LIMITS.add("speed and turn of a standstill", 0.02, "m/s, rad/s", "noise of odometry at rest")
SLOW_S = LIMITS.add("time below the commanded speed", 5.0, "s", f"{_HEALTHY}: 1.9 s at most")
SLOW = LIMITS.add("share of the commanded speed", 0.7, "", f"{_HEALTHY}: below it for 1.9 s at most")
STOPS = LIMITS.add("standstills close together", 4, "", f"97.5% of {_HEALTHY}: at most 4")
STOPS_IN_S = LIMITS.add("time in which they lie", 20.0, "s", f"97.5% of {_HEALTHY}: at most 4 standstills")
STOPPED_S = LIMITS.add("time that they take together", 4.0, "s", f"97.5% of {_HEALTHY}: 1.6 s")
PULL_RADPM = LIMITS.add("turn beyond the commands", 0.12, "rad/m", f"none of {_HEALTHY} pulls so")
PULL_SAMPLES = int(LIMITS.add("samples that pull", 25, "", f"with 20 one of {_HEALTHY} pulls, with 15 five"))
PULL_OF_EACH = LIMITS.add("samples of commands to one side", 4, "", "fewer tell nothing of that side")
PULL_ALIKE = LIMITS.add("share of the pull on commands to the other sides", 0.33, "", "a pull knows of no command")
TURNS_RADPS = LIMITS.add("turn of a command that asks for one", 0.15, "rad/s", "less is steering straight on")
HARD_RADPM = LIMITS.add("turn beyond the commands of a hard pull", 0.45, "rad/m", f"none of {_HEALTHY} pulls so")
HARD_SAMPLES = int(LIMITS.add("samples that pull hard", 12, "", "such a robot soon gets no further"))
HARD_AGREE = LIMITS.add("share of those of a hard pull that agree", 0.95, "", f"none of {_HEALTHY} pulls so")
PULL_AGREE = LIMITS.add("share of them that agree", 0.8, "", f"none of {_HEALTHY} pulls so")
PULL_BEFORE = int(LIMITS.add("samples before that do not pull", 10, "", "a robot that always pulled is built so"))
SLOWER = LIMITS.add("share of the commanded speed while it pulls", 0.97, "", "a slow side makes the robot slower, too")
SPACED_S = LIMITS.add("time between samples of a pull", 0.2, "s", "what comes faster says the same again")
STEADY_MPS = LIMITS.add("change of a steady command", 0.15, "m/s", "a drive answers larger steps with a lag")
STEADY_RADPS = LIMITS.add("change of a steady turn", 0.3, "rad/s", "a drive answers larger steps with a lag")
PULL_MPS = LIMITS.add("commanded speed while it pulls", 0.1, "m/s", "slower, noise of the turn is more than the pull")
PULL_DRIVEN_MPS = LIMITS.add("speed while it pulls", 0.05, "m/s", "slower, noise of the turn is more than the pull")
RESTS_M = LIMITS.add("way in a standstill", 0.03, "m", "it stops and starts in it")
REPEATED = int(LIMITS.add("samples of a standstill of odometry alone", 4, "", "drivers repeat a pose 2 to 4 times"))
KEEPS_UP = LIMITS.add("share of its speed that a robot keeps over a second", 0.7, "", "a stop of 0.3 s costs as much")
GOES_ON_S = LIMITS.add("time that it drives on", 1.5, "s", "drivers stop after 0.5 s, and it takes a second to stand")
FLOOD_HZ = LIMITS.add("commands a second", 500.0, "1/s", "base drivers take 10 to 100; more is a loop without a pause")
FLOODED = LIMITS.add("share of them", 0.9, "", "else they come at a rate, and at times in bursts")
FLOOD = LIMITS.add("commands that come so", 1000, "", "two seconds of them: a burst may be what a link held back")
RHYTHM = LIMITS.add("pauses as long that came before", 2, "", "one may be an outage; two are how it is commanded")
GOES_ON = LIMITS.add("share of its speed that it keeps", 0.6, "", "less is coming to a stop")
LOST_S = LIMITS.add("pause between samples", 3.0, "s", "over a longer one nobody knows whether the robot stood")
STRAIGHT_RADPS = LIMITS.add("turn of a command to go straight on", 0.5, "rad/s", "it takes a wheel 0.1 m/s at most")
SLOW_LOST_S = LIMITS.add("pause between slow samples", 2.0, "s", "over a longer one nobody knows how fast it was")
FASTER = LIMITS.add("ratio of speeds that shows a drive was not weak", 1.3, "", "clearly more than noise of odometry")
LOAD = LIMITS.add("share of the driving current beyond idle", 0.5, "", "wheels that turn or push draw it")
CRAWLS = LIMITS.add("least share of the driving speed that is held against it", 0.2, "", "noise of the current")
IDLE = LIMITS.add("ratio of driving to idle current", 1.2, "", "a smaller one does not tell them apart")
DRIVES_MPS = LIMITS.add("speed at which current is that of driving", 0.1, "m/s", "slower, little is drawn")
RESTS = LIMITS.add("speed and turn at which current is idle", 0.01, "m/s, rad/s", "noise of odometry at rest")
SETTLES_S = LIMITS.add("time until a held drive's current is steady", 1.0, "s", "inrush of motors takes less")
CURRENTS = LIMITS.add("samples of current in each state", 3, "", "fewer are chance")
MOSTLY = LIMITS.add("share of slow samples that stand", 0.5, "", "with more of them it stands, and is not slow")
FOLLOWED = LIMITS.add("share of lower commands that it follows", 0.9, "", "a weak drive follows none")
VARIED = LIMITS.add("spread of commands that tells of a limit", 1.5, "", "a choice: of one command none is told")
LEVEL = LIMITS.add("spread of the speeds then", 1.35, "", "a weak drive gives a share of each command")
ALWAYS = LIMITS.add("share of higher commands that it never reached", 0.9, "", "a drive that failed was faster before")
LATER = LIMITS.add("samples that show a drive obeys", 10, "", "fewer are too few")
OBEYS = LIMITS.add("share of them that stand", 0.1, "", "standing still for an instant, as at each turn")


def find(drive: Drive) -> Iterator[Finding]:
    """Commands that are none, standstills against commands, short and long, weakness, and a pull to one side."""
    yield from _numberless(drive)
    yield from _flooded(drive)
    yield from _uncommanded(drive)
    motion = drive.following
    if motion is None:
        return
    stood, still = _stood(motion), standstills(drive)
    long = [(start, end) for start, end in still if end - start >= STANDS_S]
    if long:
        yield _standing(drive, motion, long)
    short = [stop for stop in still if stop not in long and _rests(motion, stop) and not _keeps_up(motion, stop)]
    yield from _stopping(drive, motion, short)
    slow = list(_slow(drive, motion, stood))
    yield from slow
    if not slow:  # a drive that does less than commanded turns otherwise than commanded, too
        yield from _pulling(drive, motion)


def standstills(drive: Drive) -> list[Span]:
    """When the robot stood against its commands, however shortly."""
    motion = drive.following
    if motion is None:
        return []
    return _unbroken(motion.odometry.t[motion.to_move], _stood(motion)[motion.to_move])


def obeys(drive: Drive, since_s: float) -> bool:
    """Whether the drive has followed its commands since then, as far as that can be seen."""
    motion = drive.following
    if motion is None:
        return False
    later = (motion.odometry.t > since_s) & motion.to_move
    return bool(np.count_nonzero(later) >= LATER) and float(_stood(motion)[later].mean()) < OBEYS


def _finding(
    drive: Drive,
    title: str,
    span: tuple[float, float],
    evidence: str,
    *,
    kind: FindingKind = "drive",
    otherwise: Severity = "warning",
    suspect: SuspectKind = "hardware",
    probability: float = 0.9,
) -> Finding:
    """What is wrong with a drive, as seen by its odometry against its commands."""
    assert drive.odometry is not None
    assert drive.commands is not None
    return Finding(
        kind=kind,
        title=title,
        onset_s=span[0],
        end_s=span[1],
        severity=drive.severity(span[0], otherwise),
        evidence=evidence,
        source=f"{drive.odometry.topic} against {drive.commands.topic}; limits: 97.5% of healthy move_base missions"
        " stay far below them",
        suspect=suspect,
        probability=probability,
    )


def _numberless(drive: Drive) -> Iterator[Finding]:
    """Commands that are no numbers: what computes them went wrong."""
    commands = drive.commands
    if commands is None or not len(commands.numberless_s):
        return
    first, count = float(commands.numberless_s[0]), len(commands.numberless_s)
    yield Finding(
        kind="commands",
        title="commands to the drive are no numbers",
        onset_s=first,
        end_s=float(commands.numberless_s[-1]),
        severity=drive.severity(first),
        evidence=f"{count} of {count + len(commands.t)} messages hold none",
        source=commands.topic,
        suspect="operation",
        probability=0.8,
    )


def _flooded(drive: Drive) -> Iterator[Finding]:
    """Commands as fast as a processor can send them: they fill queues and links, and take its time from others."""
    times = np.empty(0) if drive.commands is None else drive.times[drive.commands.topic]
    rapid = np.diff(times) < 1.0 / FLOOD_HZ
    if np.count_nonzero(rapid) < FLOOD or rapid.mean() < FLOODED:
        return
    assert drive.commands is not None
    yield Finding(
        kind="commands",
        title="commands come without a pause: a loop has no rate",
        onset_s=float(times[0]),
        end_s=float(times[-1]),
        severity="info",
        evidence=f"{len(times)} on {drive.commands.topic} in {times[-1] - times[0]:.0f} s (limit {FLOOD_HZ:g}/s)",
        source=drive.commands.topic,
        suspect="operation",
        probability=0.8,
    )


def _uncommanded(drive: Drive) -> Iterator[Finding]:
    """The robot goes on as it was last commanded to, long after that command."""
    odometry, commands = drive.odometry, drive.commands
    if odometry is None or commands is None or not odometry.tells_speed or len(commands.t) < FEWEST_COMMANDS:
        return
    last_s = float(commands.t[-1])
    if any(float(table.t[-1]) > last_s for topic, table in drive.of(*COMMANDS) if topic != commands.topic):
        return
    later = odometry.where((odometry.t > last_s + STALE_S) & (odometry.recorded_s > last_s))
    count = _goes_on(later, odometry, float(commands.speed[-1]), float(commands.turn[-1]))
    if not count or later.clock[count - 1] - later.clock[0] < GOES_ON_S - STALE_S:
        return
    end_s = float(later.t[count - 1])
    if _is_its_rhythm(commands, end_s - last_s):
        return
    went_m, turned = odometry.path_m(last_s, end_s), float(np.ptp(np.unwrap(later.yaw[:count])))
    way = f"{went_m:.1f} m" if abs(commands.speed[-1]) >= BREAKS_LOOSE_MPS else f"{np.degrees(turned):.0f} deg of turn"
    until = "to the end of the recording" if count == len(later.t) else f"until {log_time(end_s)}"
    yield Finding(
        kind="commands",
        title="it drives on without commands",
        onset_s=last_s,
        end_s=end_s,
        severity="warning",
        evidence=f"the last on {commands.topic} is of {log_time(last_s)}; it goes on for {end_s - last_s:.1f} s and"
        f" {way}, {until}: its base has no time-out for commands, or a topic that is not recorded commands it",
        source=f"{odometry.topic} against {commands.topic}",
        suspect="operation",
        probability=0.7,
    )


def _is_its_rhythm(commands: Commands, silent_s: float) -> bool:
    """Whether pauses as long came before, too, each after a command to move: a program that commands once and waits,
    of which the recording ends before the next one."""
    moves = (np.abs(commands.speed) >= BREAKS_LOOSE_MPS) | (np.abs(commands.turn) >= BREAKS_LOOSE_RADPS)
    pauses = np.diff(commands.t)[moves[:-1]]
    return bool(np.count_nonzero(pauses >= silent_s) >= RHYTHM)


def _goes_on(later: Odometry, odometry: Odometry, speed: float, turn: float) -> int:
    """Samples in a row in which it does what it was last commanded to, as far as it ever does; 0 of a stop."""
    goes_on, is_to_move = np.ones(len(later.t), bool), False
    parts = (speed, BREAKS_LOOSE_MPS, "speed"), (turn, BREAKS_LOOSE_RADPS, "turn")
    for wanted, least, name in parts:
        if abs(wanted) >= least:
            most = min(abs(wanted), quantile(np.abs(getattr(odometry, name)), 0.9))
            goes_on &= getattr(later, name) * np.sign(wanted) >= GOES_ON * max(most, least)
            is_to_move = True
    return int(np.argmin(np.append(goes_on, False))) if is_to_move else 0


def _stood(motion: Following) -> Bools:
    """Samples in which the robot stands though every command of the last second asked for motion."""
    odometry = motion.odometry
    speed, turn = np.hypot(odometry.speed, odometry.sideways), np.abs(odometry.turn)
    most = max(odometry.fastest_mps, ORDINARY_MPS)  # of a command far beyond that even full speed is a small share
    wanted, wanted_turn = np.minimum(np.abs(motion.wanted_speed), most), np.abs(motion.wanted_turn)
    stands = speed < np.maximum(STANDING * wanted, STILL)
    stands &= turn < np.maximum(STANDING * wanted_turn, STILL)
    # A robot that only turns where a curve was commanded does not drive either.
    return motion.to_move & (stands | ((wanted >= BREAKS_LOOSE_MPS) & (speed < STANDING * wanted)))


def _standing(drive: Drive, motion: Following, long: list[Span]) -> Finding:
    """Against its commands the drive stands: it failed, or something holds it, which its current tells."""
    span, total_s = (long[0][0], long[-1][1]), seconds_in(long)
    inside = (motion.odometry.t >= span[0]) & (motion.odometry.t <= long[0][1])
    wanted = float(median(np.abs(motion.wanted_speed[inside])))
    order = f"commanded {wanted:.2f} m/s" if wanted > 0 else "commanded to turn"
    evidence = f"{order} for {total_s:.0f} s, odometry stands"
    told = (currents for battery in drive.batteries if (currents := _currents(battery, motion, long)) is not None)
    currents = next(told, None)
    if currents is None:
        return _finding(drive, "the robot does not move though commanded", span, evidence, otherwise="critical")
    drawn, idle, driving = currents.standing, currents.idle, currents.driving
    evidence += f"; current {drawn:.1f} A, idle {idle:.1f} A, driving {driving:.1f} A"
    # What is told to crawl draws little, moving or held; what gets no command through draws nothing.
    asked = max(wanted / currents.speed_mps, CRAWLS) if wanted > 0 else 1.0
    if drawn - idle > LOAD * min(asked, 1.0) * (driving - idle):
        return _finding(
            drive, "something holds the robot: its motors push, it does not move", span, evidence,
            kind="blocked", otherwise="critical", suspect="world", probability=0.85,
        )  # fmt: skip
    return _finding(drive, "the drive does not answer its commands", span, evidence, otherwise="critical")


class _Currents(NamedTuple):
    """What is drawn in each state, A."""

    standing: float
    """Against commands."""
    idle: float
    driving: float
    speed_mps: float
    """At which it drives then."""


def _currents(battery: Battery, motion: Following, long: list[Span]) -> _Currents | None:
    """What is drawn standing, idle and driving; None where the recording does not tell them apart."""
    odometry = motion.odometry
    stood = np.zeros(len(battery.t), bool)
    for start, end in long:
        stood |= (battery.t >= start + SETTLES_S) & (battery.t <= end)
    speed = np.interp(battery.t, odometry.t, np.abs(odometry.speed))
    turn = np.interp(battery.t, odometry.t, np.abs(odometry.turn))
    drives, idles = (speed > DRIVES_MPS) & ~stood, (speed < RESTS) & (turn < RESTS) & ~stood
    if min(np.count_nonzero(rows) for rows in (stood, drives, idles)) < CURRENTS:
        return None
    drawn, idle, driving = (known_median(battery.drawn[rows]) for rows in (stood, idles, drives))
    return _Currents(drawn, idle, driving, float(median(speed[drives]))) if driving > IDLE * idle > 0 else None


def _unbroken(t: Floats, stood: Bools) -> list[Span]:
    """First and last time of each stretch in which every sample stands."""
    edges = np.flatnonzero(np.diff(stood.astype(int)) | (np.diff(t) > LOST_S)) + 1
    bounds = [0, *edges.tolist(), len(t)]
    spans = [(first, last - 1) for first, last in pairwise(bounds) if last - first > 1 and stood[first]]
    return [(float(t[first]), float(t[last])) for first, last in spans]


def _stopping(drive: Drive, motion: Following, still: list[Span]) -> Iterator[Finding]:
    """Many short standstills close together."""
    starts = np.array([start for start, _ in still])
    stood_s = np.array([end - start for start, end in still])
    for start in starts.tolist():
        near = (starts >= start) & (starts < start + STOPS_IN_S)
        if np.count_nonzero(near) >= STOPS and float(stood_s[near].sum()) >= STOPPED_S:
            later = starts >= start
            yield _finding(
                drive, "commands reach the drive only intermittently", (start, still[-1][1]),
                f"{np.count_nonzero(later)} standstills of {median(stood_s[later]):.1f} s while commands to move go on",
                kind="commands",
            )  # fmt: skip
            return


def _rests(motion: Following, span: tuple[float, float]) -> bool:
    """Whether the position says so too: a twist of a coarse encoder is zero in most samples of a steady drive."""
    odometry = motion.odometry
    if odometry.stands_still:
        return True
    first, last = np.searchsorted(odometry.t, span)
    low, high = max(0, int(first) - 1), min(len(odometry.t) - 1, int(last) + 1)
    went = float(np.hypot(odometry.x[high] - odometry.x[low], odometry.y[high] - odometry.y[low]))
    wanted = float(np.abs(motion.wanted_speed[first : last + 1]).max())
    return went <= max(STANDING * wanted, STILL) * float(odometry.t[high] - odometry.t[low]) + RESTS_M


def _keeps_up(motion: Following, span: tuple[float, float]) -> bool:
    """Whether it is the odometry that stands, not the robot: in a few samples it repeats itself, and over the second
    around them the robot came as far as it was commanded."""
    odometry = motion.odometry
    first, last = np.searchsorted(odometry.t, span)
    if odometry.stands_still or last - first >= REPEATED:
        return False
    half_s = max(ANSWER_S, 2 * (span[1] - span[0])) / 2
    middle = (span[0] + span[1]) / 2
    at = np.clip((middle - half_s, middle + half_s), odometry.t[0], odometry.t[-1])
    x, y, yaw = (np.interp(at, odometry.t, axis) for axis in (odometry.x, odometry.y, np.unwrap(odometry.yaw)))
    wanted = min(float(np.abs(motion.wanted_speed[first : last + 1]).max()), odometry.fastest_mps)
    if wanted >= BREAKS_LOOSE_MPS:
        return float(np.hypot(np.diff(x), np.diff(y))[0]) >= KEEPS_UP * wanted * float(np.diff(at)[0])
    turn = float(np.abs(motion.wanted_turn[first : last + 1]).max())
    return abs(float(np.diff(yaw)[0])) >= KEEPS_UP * turn * float(np.diff(at)[0])


def _slow(drive: Drive, motion: Following, stood: Bools) -> Iterator[Finding]:
    """Moves, but slower than every command of the last second, straight on: turning takes a share of its wheels."""
    odometry, wanted = motion.odometry, motion.wanted_speed
    turns = np.maximum(np.abs(motion.turn_low), np.abs(motion.turn_high))
    ordered = (np.abs(wanted) >= BREAKS_LOOSE_MPS) & (turns <= STRAIGHT_RADPS)
    share = np.divide(odometry.speed, wanted, out=np.ones(len(wanted)), where=ordered)
    slow = (share < SLOW)[ordered]
    t = odometry.t[ordered]
    found = _slow_spans(t, slow, stood[ordered])
    if not found:
        return
    rows = np.concatenate([np.arange(first, last) for first, last in found])
    speeds, demands = np.abs(odometry.speed[ordered]), np.abs(wanted[ordered])
    reached, demanded = float(median(speeds[rows])), float(median(demands[rows]))
    lower = demands < FOLLOWED * reached
    follows = np.count_nonzero(lower) >= LATER and float(median(share[ordered][lower])) > FOLLOWED
    is_level = _spread(demands[rows]) > VARIED and _spread(speeds[rows]) < LEVEL
    is_always = float(slow[demands > FASTER * reached].mean()) >= ALWAYS
    if (follows or is_level or is_always) and odometry.fastest_mps < FASTER * reached:
        yield _beyond(drive, (float(t[found[0][0]]), float(t[found[-1][1] - 1])), reached, demanded)
        return
    # It was weak since it last was clearly faster, though nobody could see that before a higher speed was commanded.
    faster = np.flatnonzero(speeds[: found[0][0]] > FASTER * reached)
    lasting = slow & np.append(slow[1:], False) & (demands > FASTER * reached)
    since = np.flatnonzero(lasting & (np.arange(len(t)) > (faster[-1] if len(faster) else -1)))
    span = float(t[min(*since[:1], found[0][0])]), float(t[found[-1][1] - 1])
    slow_s = sum(float(t[last - 1] - t[first]) for first, last in found)
    evidence = f"reaches {reached:.2f} m/s of {demanded:.2f} m/s commanded, for {slow_s:.0f} s"
    if odometry.fastest_mps < FASTER * reached:
        evidence += "; it was never faster in this recording, which may be its limit"
    yield _finding(drive, "the drive is weak: slower than commanded", span, evidence)


def _spread(values: Floats) -> float:
    """How many times the largest are the smallest, without the last tenth at either end."""
    return quantile(values, 0.9) / max(quantile(values, 0.1), STILL)


def _beyond(drive: Drive, span: tuple[float, float], reached: float, demanded: float) -> Finding:
    """It goes no faster than one speed, whatever more is commanded."""
    evidence = f"whatever is commanded, it never was faster than {reached:.2f} m/s; {demanded:.2f} m/s was commanded"
    title = "commands are beyond what the drive reaches"
    found = _finding(drive, title, span, evidence, kind="commands", suspect="operation", probability=0.8)
    return replace(found, severity="info")  # it drives as it can


def _slow_spans(t: Floats, slow: Bools, stood: Bools) -> list[tuple[int, int]]:
    """First row and the one after the last of each stretch in which the robot is slow for long, and does not stand."""
    begin = 0
    found: list[tuple[int, int]] = []
    for row in range(len(t) + 1):
        if row == len(t) or not slow[row] or (row and t[row] - t[row - 1] > SLOW_LOST_S):
            if row > begin and t[row - 1] - t[begin] >= SLOW_S and not stood[begin:row].mean() > MOSTLY:
                found.append((begin, row))
            begin = row + 1 if row < len(t) and not slow[row] else row
    return found


def _pulling(drive: Drive, motion: Following) -> Iterator[Finding]:
    """Turns to one side more than commanded, in proportion to its speed, and is slower than commanded."""
    odometry = motion.odometry
    steady = motion.commanded & (np.abs(motion.wanted_speed) > PULL_MPS) & (np.abs(odometry.speed) > PULL_DRIVEN_MPS)
    steady &= motion.speed_high - motion.speed_low < STEADY_MPS
    steady &= motion.turn_high - motion.turn_low < STEADY_RADPS
    rows = _spaced(odometry.t, np.flatnonzero(steady))
    ordered: Floats = (motion.turn_high + motion.turn_low)[rows] / 2
    pull: Floats = (odometry.turn[rows] - ordered) / odometry.speed[rows]
    driven = _Driven(odometry.t[rows], pull, odometry.speed[rows] / motion.wanted_speed[rows], ordered)
    long = _pulled(driven, PULL_SAMPLES, PULL_RADPM, PULL_AGREE)
    found = long or _pulled(driven, HARD_SAMPLES, HARD_RADPM, HARD_AGREE)
    if found is not None:
        evidence = (
            f"turns {abs(found.radpm):.2f} rad per metre beyond its commands, {found.agrees:.0%} of samples agree"
        )
        side = "left" if found.radpm > 0 else "right"
        span = found.since_s, float(driven.t[-1])
        yield _finding(drive, f"the drive pulls to the {side}", span, evidence, probability=0.8)


class _Driven(NamedTuple):
    """Samples under a steady command, each of shape (n,)."""

    t: Floats
    pull: Floats
    """Turn beyond the command, rad/m, positive to the left."""
    share: Floats
    """Of the commanded speed."""
    ordered: Floats
    """Turn of the command, rad/s."""


class _Pull(NamedTuple):
    """A pull to one side: since when, how much (rad/m, positive to the left), and how many of its samples agree."""

    since_s: float
    radpm: float
    agrees: float


def _pulled(driven: _Driven, samples: int, least: float, agreeing: float) -> _Pull | None:
    """The first pull of so many samples after some without one, None where there is none.

    Args:
        least: turn beyond the commands, rad/m. agreeing: share of the samples that are to one side.
    """
    if len(driven.t) < PULL_BEFORE + samples:
        return None
    windows = sliding_window_view(driven.pull, samples)[PULL_BEFORE:]
    middles = median(windows, axis=1)
    agrees = np.mean(np.sign(windows) == np.sign(middles)[:, None], axis=1)
    slower = median(sliding_window_view(driven.share, samples)[PULL_BEFORE:], axis=1) < SLOWER
    for number in np.flatnonzero((np.abs(middles) >= least) & (agrees >= agreeing) & slower).tolist():
        first, middle = number + PULL_BEFORE, float(middles[number])
        window, side = slice(first, first + samples), np.sign(middle)
        always = float(median(driven.pull[:first])) * side >= PULL_RADPM / 2
        if not always and not _falls_short(driven.pull[window] * side, driven.ordered[window] * side):
            # It began where the sum of what is beyond half of it turns upwards.
            above = np.cumsum(driven.pull[: first + samples] * side - abs(middle) / 2)
            return _Pull(float(driven.t[int(np.argmin(above))]), middle, float(agrees[number]))
    return None


def _falls_short(pull: Floats, ordered: Floats) -> bool:
    """Whether what seems to pull to one side only turns less than commanded: it does so against commands to turn to
    either side, or against those to the other side alone.

    Args:
        pull: turn beyond the commands, rad/m, positive to the side that it seems to pull to.
        ordered: commands to turn, rad/s, positive to that side.
    """
    sides = (pull[ordered > TURNS_RADPS], pull[ordered < -TURNS_RADPS], pull[np.abs(ordered) <= TURNS_RADPS])
    with_it, against, straight = (float(median(one)) if len(one) >= PULL_OF_EACH else np.nan for one in sides)
    pulls = [one > PULL_ALIKE * float(median(pull)) for one in (with_it, straight) if not np.isnan(one)]
    return not np.isnan(against) and not (pulls and all(pulls))


def _spaced(t: Floats, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """The first row of every fifth of a second."""
    _, first = np.unique(np.floor(t[rows] / SPACED_S), return_index=True)
    spaced: NDArray[np.intp] = rows[first]
    return spaced


READS = reading(ODOMETRY, *COMMANDS, BATTERY, *GOALS)
CHECK = Check(
    "drive",
    "commands that are none, a robot that stands, stops and goes, is slow or pulls against them",
    READS,
    LIMITS,
    find,
)
