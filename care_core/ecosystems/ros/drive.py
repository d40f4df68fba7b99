"""The model of a drive: what a ROS recording tells of its robot, each part prepared once, when first asked for."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.findings import Severity
from care_core.ecosystems.liveness import Frozen, is_part
from care_core.ecosystems.plausible import STAMP
from care_core.ecosystems.ros import bumpers, sources
from care_core.ecosystems.ros.falls import Fall, fall_of
from care_core.ecosystems.ros.goals import STATUS_TOPIC, Goal, actionlib_goals, nav2_goals
from care_core.ecosystems.ros.messages import (
    ACTION_GOAL,
    ACTION_RESULT,
    BATTERY,
    CLOUD,
    DIAGNOSTICS,
    FAULT_EVENT,
    FRAME,
    IMU,
    LOCALISED,
    MESSAGES,
    ODOMETRY,
    ROSOUT,
    SCAN,
    STATUS,
    TF,
    TWIST,
    TWIST_STAMPED,
    holds,
    plainness,
    tells_events,
    tilt_of,
    topics,
    type_of,
)
from care_core.ecosystems.ros.motion import Commands, Following, Odometry, commands_of, following, odometry_of
from care_core.ecosystems.ros.namespaces import is_of, robot_namespaces
from care_core.ecosystems.ros.node_messages import LogMessage, Report, faults, log_messages, reports
from care_core.ecosystems.ros.plugin_names import created
from care_core.ecosystems.ros.posed_goals import posed_goals, section_of
from care_core.ecosystems.ros.sensors import Battery, Scans, battery_of, scans_of
from care_core.ecosystems.ros.shown_tilt import shown_tilts
from care_core.ecosystems.spans import Span, inside
from care_core.logs.base import Channel, Table, Wanted, merge_needs
from care_core.numbers import Floats, median, quantile
from care_core.records import Record
from care_core.run import Damage, Setting

if TYPE_CHECKING:
    from care_core.logs.ros_log import RosLog

OPEN_S = 30.0
"""A goal without an answer for longer than this at the end of a recording was not being reached."""
STREAM_MESSAGES, STEADY = 10, 3.0
"""A stream has so many messages, and nine in ten of its pauses are below so many times the usual one."""
SCAN_MESSAGES = 5
"""A laser sends steadily as long as it lives: so few tell that it did, also in a recording that is thinned."""
SILENT_S, SILENT_PERIODS = 5.0, 10.0
"""A stream has ended when it is silent for so long and for so many of its periods."""
LOST_S, LOST_COMMANDS, LOST_TOGETHER_S = 2.0, 5, 4.0
"""All that a robot sends has ended where nothing came for so long while so many commands did; a link that breaks ends
all of it within the time in which a transport notices."""
DROVE_M = 1.0
"""So far no robot is pushed or drifts that is done with its goals."""
PILOTED = re.compile(r"joy|teleop|key", re.IGNORECASE)
"""In the name of a topic on which a person drives."""
CONTACT = re.compile(r"contact|collision|bumper", re.IGNORECASE)
"""In the name of a topic on which something speaks only while it touches the robot, or at times."""
_NO_CONTACT = re.compile(
    r"monitor|detector|display|object|constraint|marker|distance|check|mesh|model|map|scan|enable|param|avoid",
    re.IGNORECASE,
)
"""In the names of those that tell of what could touch it (Nav2's collision monitor, MoveIt's scene)."""
MOST_CONTACTS = 50
"""A topic that says more tells of what does not touch, too."""
LATCHED_S, SAME_CONTACT_S = 1.0, 0.5
"""What comes so early was said before the recording began; what comes so close together is one contact."""
_SIMULATED_CLOCK = "/clock"
FEWEST_COMMANDS = 3
"""Fewer commands tell of no drive."""

ODOMETRY_FIELDS = (*MESSAGES[ODOMETRY].reads, FRAME)
COMMAND_FIELDS = (*MESSAGES[TWIST].reads, *MESSAGES[TWIST_STAMPED].reads)
BATTERY_FIELDS = (*MESSAGES[BATTERY].reads, STAMP)
LOG_FIELDS = MESSAGES[ROSOUT[0]].reads
"""What is read of a topic that a profile names."""

T = TypeVar("T")
Prepare = Callable[[str, Table], "T | None"]


class Lost(Record):
    """All topics that a robot sends, when they ended, and until when commands to it went on, and how many."""

    topics: tuple[str, ...]
    at_s: float
    until_s: float
    commands: int


class Drive(RunModel):
    """A recording as a robot's drive.

    Health looks at samples of what sends often (`of`, and all that has no topic in its name), measures at every message
    of the topics that a profile names (`odometry_on`, `commands_on`, `battery_on`, `log_messages_on`).
    """

    log: RosLog

    def __init__(self, log: RosLog, robot: str | None = None) -> None:
        """`robot` is the name space of the robot that is meant, where the recording is of several."""
        super().__init__(log)
        self._robot = robot
        self.damage: tuple[Damage, ...] = ()
        """What is broken in what health looked at."""
        self._looked_at: Wanted = {}
        self._samples: dict[str, Table] = {}
        self._prepared: dict[tuple[Prepare[Any], str], Any] = {}
        self._repeats: dict[str, tuple[Span, ...]] = {}

    # The recording

    @cached_property
    def robots(self) -> tuple[str, ...]:
        """Name spaces of the robots of this recording, the one that is meant first; none where it is of one robot."""
        spaces = robot_namespaces(self.log.channels())
        return tuple(sorted(spaces, key=lambda space: space != self._robot))

    @cached_property
    def others(self) -> tuple[Drive, ...]:
        """The drives of the other robots that were recorded beside this one."""
        return tuple(Drive(self.log, space) for space in self.robots[1:]) if self._robot is None else ()

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """The topics of this robot."""
        every = self.log.channels()
        return tuple(one for one in every if is_of(one.name, self.robots[0], self.robots)) if self.robots else every

    @cached_property
    def times(self) -> Mapping[str, Floats]:
        """Record times of every topic, s; nothing is decoded for them."""
        times = self.log.times()
        return {one.name: times[one.name] for one in self.channels if one.name in times} if self.robots else times

    @property
    def duration_s(self) -> float:
        return self.log.duration_s

    @property
    def facts(self) -> Mapping[str, str]:
        return self.log.facts

    @property
    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self.log.settings()

    @cached_property
    def parameters(self) -> Mapping[str, Setting]:
        """Parameters as driven; of the files that the operator named what the recording does not hold."""
        driven = {name: history[-1] for name, history in self.settings.items()}
        ends = {name[place:] for name in driven for place in range(len(name)) if place == 0 or name[place - 1] == "/"}
        return {**{name: one for name, one in self.given.items() if name not in ends}, **driven}

    def look_at(self, types: Iterable[str]) -> None:
        """Read samples of messages of these types, in one pass with whatever else is expected to be read."""
        self._looked_at = {**topics(self.channels, types), **dict.fromkeys(self.bumper_topics, bumpers.FIELDS)}
        lacking = {name: fields for name, fields in self._expected.items() if self._lacks({name: fields})}
        self._tables |= self.decode(lacking)
        self._read = self._expected
        self.damage = self.log.damage

    def decode(self, wanted: Wanted) -> Mapping[str, Table]:
        """One pass over the log for the samples, where health asked for them, and for what is wanted whole."""
        sampled, self._looked_at = self._looked_at, {}
        if not sampled:
            return super().decode(wanted)
        known = {one.name: MESSAGES.get(type_of(one)) for one in self.channels if one.name in sampled}
        most = {name: bumpers.AT_MOST if one is None else one.at_most for name, one in known.items()}
        thinned = {name: count for name, count in most.items() if count and name not in wanted}
        tables = self.log.read(merge_needs((wanted, sampled)), thinned)
        for name in sampled.keys() & tables.keys():
            self._samples[name] = self._thinned(name, tables[name], most[name]) if name in wanted else tables[name]
        return {name: tables[name] for name in wanted if name in tables}

    def _thinned(self, topic: str, table: Table, most: int) -> Table:
        """The messages that the reader answers where it may decode so many of a topic."""
        if not most or len(table) <= most:
            return table
        return table.where(np.isin(table.t, self.log.sampled_times(topic, most)))

    def of(self, *types: str) -> Iterator[tuple[str, Table]]:
        """Topic and samples of every channel of these types that has messages."""
        for channel in self.channels:
            if type_of(channel) in types and len(self._samples.get(channel.name, ())):
                yield channel.name, self._samples[channel.name]

    def _of_topic(self, prepare: Prepare[T], topic: str, *fields: str) -> T | None:
        """What every message of a topic tells that a profile names, prepared once; None where it tells nothing."""
        if (prepare, topic) not in self._prepared:
            table = self.tables({topic: fields}).get(topic)
            self._prepared[prepare, topic] = None if table is None else prepare(topic, table)
        prepared: T | None = self._prepared[prepare, topic]
        return prepared

    # Streams

    @cached_property
    def streams(self) -> Mapping[str, float]:
        """Topics that come steadily, so that silence means something, with their usual period, s."""
        found = {}
        scans = {channel.name for channel in self.channels if type_of(channel) in (SCAN, CLOUD)}
        for topic, times in self.times.items():
            if len(times) < (SCAN_MESSAGES if topic in scans else STREAM_MESSAGES):
                continue
            pauses = np.diff(times)
            usual = float(median(pauses))
            if usual > 0 and quantile(pauses, 0.9) <= STEADY * usual:
                found[topic] = usual
        return found

    def ends_early(self, topic: str) -> tuple[float, float] | None:
        """When a stream was heard last and its period, s; None where it goes on to the end, or nothing goes on after
        it but the clock of a simulator."""
        period_s = self.streams.get(topic)
        if period_s is None:
            return None
        last_s = float(self.times[topic][-1])
        silent_s = self.duration_s - last_s
        if silent_s < max(SILENT_S, SILENT_PERIODS * period_s):
            return None
        others = (self.times[name][-1] for name in self.streams if name not in (topic, _SIMULATED_CLOCK))
        return (last_s, period_s) if any(self.duration_s - end < silent_s / 2 for end in others) else None

    @cached_property
    def regular(self) -> Mapping[str, float]:
        """Of these streams those whose silence means something: not of events, nor of commands, which end when nobody
        commands. The clock of a simulation goes on without its robot."""
        events = {one.name for one in self.channels if tells_events(one) or type_of(one) in (TWIST, TWIST_STAMPED)}
        return {name: period for name, period in self.streams.items() if name not in {*events, _SIMULATED_CLOCK}}

    def have_several_sources(self, topics: Collection[str]) -> bool:
        """Whether several nodes send them: by their names, else by several kinds of message."""
        named = self.log.publishers()
        nodes = [named.get(topic, frozenset()) for topic in topics]
        if all(nodes):
            return len(frozenset().union(*nodes)) > 1
        return len({type_of(one) for one in self.channels if one.name in topics}) > 1

    @cached_property
    def lost(self) -> Lost | None:
        """When all that the robot sends ended while commands to it go on; None where it did not."""
        often = {topic: period_s for topic, period_s in self.regular.items() if period_s <= LOST_S}
        ends = {topic: float(self.times[topic][-1]) for topic in often}
        sensed = [one.name for one in self.channels if one.name in ends and type_of(one) in (ODOMETRY, SCAN, IMU)]
        if not sensed or len(ends) < 2 or len({type_of(one) for one in self.channels if one.name in ends}) < 2:
            return None
        first_s, last_s = min(ends.values()), max(ends.values())
        sent = [self.times[topic] for topic, _ in self.of(TWIST, TWIST_STAMPED)]
        later = np.sort(np.concatenate([np.empty(0), *(t[t > last_s] for t in sent)]))
        silent_s = max(LOST_S, STEADY * max(often.values()))
        if last_s - first_s > LOST_TOGETHER_S or len(later) < LOST_COMMANDS or later[-1] - last_s < silent_s:
            return None
        return Lost(tuple(sorted(ends)), first_s, float(later[-1]), len(later))

    # Motion

    @cached_property
    def odometry(self) -> Odometry | None:
        """The odometry of the base while it lives: of several the one named so, which others are made from."""
        read = (odometry_of(topic, table) for topic, table in self.of(ODOMETRY))
        told = (one.where(~inside(self._dead(one.topic), one.recorded_s)) for one in read if one is not None)
        found = [steady for one in told if (steady := one.advancing()) is not None]
        return min(found, key=lambda one: (not one.tells_speed, *plainness(one.topic, "odom")), default=None)

    @cached_property
    def commands(self) -> Commands | None:
        """The commands to the base: the topic named `cmd_vel`, else the only one; None where it cannot be told."""
        found = (commands_of(topic, table) for topic, table in self.of(TWIST, TWIST_STAMPED))
        known = [one for one in found if one is not None]
        named = [one for one in known if one.topic.rpartition("/")[2] == "cmd_vel"] or known
        ranked = sorted((plainness(one.topic, "cmd_vel"), number) for number, one in enumerate(named))
        is_told = len(ranked) == 1 or (len(ranked) > 1 and ranked[0][0][:2] != ranked[1][0][:2])
        return named[ranked[0][1]] if is_told else None

    def odometry_on(self, topic: str) -> Odometry | None:
        """The odometry of a topic, every message of it."""
        return self._of_topic(odometry_of, topic, *ODOMETRY_FIELDS)

    def commands_on(self, topic: str) -> Commands | None:
        """The commands of a topic, every one of them."""
        return self._of_topic(commands_of, topic, *COMMAND_FIELDS)

    @cached_property
    def following(self) -> Following | None:
        """Odometry beside commands, None where either is missing or odometry tells no speed."""
        odometry, commands = self.odometry, self.commands
        if odometry is None or commands is None or len(commands.t) < FEWEST_COMMANDS or not odometry.tells_speed:
            return None
        return following(odometry, commands)

    @cached_property
    def frozen(self) -> tuple[Frozen, ...]:
        """Stretches in which a source only repeats itself while the robot drives, of the samples of every topic."""
        tables = {topic: table for kind in sources.TYPES for topic, table in self.of(kind)}
        return tuple(one for topic, table in tables.items() for one in self._frozen(topic, table, tables))

    def repeats(self, channel: str) -> tuple[Span, ...]:
        """As the base says; of every message of the topics that were read whole."""
        if channel not in self._repeats:
            tables = {**self._samples, **self._tables}
            table = tables.get(channel)
            found = () if table is None else self._frozen(channel, table, tables)
            self._repeats[channel] = tuple(one.span for one in found)
        return self._repeats[channel]

    def _dead(self, topic: str) -> list[Span]:
        """Where a topic only repeats itself, by its samples."""
        return [one.span for one in self.frozen if one.channel == topic]

    def _frozen(self, topic: str, table: Table, tables: Mapping[str, Table]) -> Iterator[Frozen]:
        types = {channel.name: type_of(channel) for channel in self.channels}
        placed = [name for name in tables if name != topic and types.get(name) in (ODOMETRY, LOCALISED)]
        own = [name for name in placed if _namespace(name) == _namespace(topic)]
        is_alone = types.get(topic) != ODOMETRY and len(set(map(_namespace, placed))) == 1
        others = {name: tables[name] for name in own or (placed if is_alone else ())}
        told: list[Frozen] = []
        for source in sources.SOURCES:
            if source.message == types.get(topic):
                told += [one for one in sources.frozen(source, topic, table, others) if not is_part(one, told)]
        yield from told

    def moved_between(self, start_s: float, end_s: float) -> float:
        """Distance that odometry went in a time, m; nan where there is none."""
        return math.nan if self.odometry is None else self.odometry.path_m(start_s, end_s)

    @cached_property
    def bumper_topics(self) -> tuple[str, ...]:
        """Topics of bumpers, by their type and, where that may be of anything, by their name."""
        return tuple(one.name for one in self.channels if one.count and bumpers.is_bumper(one))

    @cached_property
    def bumps(self) -> tuple[Span, ...]:
        """From when to when a bumper was pressed, by what its messages say."""
        tables = [self._samples[name] for name in self.bumper_topics if name in self._samples]
        return tuple(sorted(span for table in tables for span in bumpers.contacts(table, self.duration_s)))

    @cached_property
    def contact_topics(self) -> tuple[str, ...]:
        """Topics by whose names something touched the robot when they speak, which they do at times."""
        return tuple(
            one.name
            for one in self.channels
            if CONTACT.search(one.name)
            and not _NO_CONTACT.search(one.name)
            and 0 < one.count <= MOST_CONTACTS
            and one.name not in self.streams
            and one.name not in self.bumper_topics
        )

    @cached_property
    def contacts_s(self) -> Floats:
        """When something touched the robot, by topics that speak only then and by its bumpers."""
        told = [self.times[name][self.times[name] > LATCHED_S] for name in self.contact_topics]
        told.append(np.array([start for start, _ in self.bumps if start > LATCHED_S]))
        every = np.sort(np.concatenate([np.empty(0), *told]))
        return every[np.diff(every, prepend=-np.inf) > SAME_CONTACT_S]

    @cached_property
    def fall(self) -> Fall | None:
        """When the robot tipped over; None of what nobody drives, such as a camera in a hand."""
        if self.odometry is None or (self.commands is None and not self.goals):
            return None
        odometry = self.odometry
        told = fall_of(odometry.topic, odometry.t, odometry.tilt, odometry.z, odometry.path_m)
        return told or self._felt_fall() or self._shown_fall()

    def _felt_fall(self) -> Fall | None:
        """The same by an IMU, where it tells an orientation."""
        assert self.odometry is not None
        for topic, table in self.of(IMU):
            if holds(table, IMU):
                tilt = tilt_of(table, IMU, "orientation")
                return fall_of(topic, table.t, tilt, np.zeros(len(table)), self.odometry.path_m)
        return None

    def _shown_fall(self) -> Fall | None:
        """The same by the transforms of its base, of which neither says anything."""
        assert self.odometry is not None
        for topic, table in self.of(*TF):
            for t, tilt in shown_tilts(table) if holds(table, TF[0]) else ():
                found = fall_of(topic, t, tilt, np.zeros(len(t)), self.odometry.path_m)
                if found is not None:
                    return found
        return None

    # Sensors

    @cached_property
    def scans(self) -> tuple[Scans, ...]:
        return tuple(one for topic, table in self.of(SCAN) if (one := scans_of(topic, table)) is not None)

    @cached_property
    def batteries(self) -> tuple[Battery, ...]:
        """Those whose voltage is one."""
        found = (battery_of(topic, table) for topic, table in self.of(BATTERY))
        return tuple(one for one in found if one is not None and one.is_alive)

    def battery_on(self, topic: str) -> Battery | None:
        """The battery of a topic, every message of it."""
        return self._of_topic(battery_of, topic, *BATTERY_FIELDS)

    # Goals

    @cached_property
    def posed(self) -> Mapping[str, Any] | None:
        """Where goals are told that no action tells of, as a mission section."""
        return section_of(self.channels)

    @cached_property
    def goals(self) -> tuple[Goal, ...]:
        """Every goal of the recording's driving actions, in the order sent; of all its actions where none drives."""
        results = {topic.rpartition("/")[0]: table for topic, table in self.of(ACTION_RESULT)}
        sent = {topic.rpartition("/")[0]: table for topic, table in self.of(ACTION_GOAL)}
        tables = {topic: table for topic, table in self.of(STATUS) if topic.endswith(STATUS_TOPIC)}
        found = [
            goal
            for action, table in sent.items()
            for goal in actionlib_goals(action, table, results.get(action), self.duration_s)
        ]
        for topic, table in tables.items():
            found += nav2_goals({topic.removesuffix(STATUS_TOPIC): table}, self.duration_s)
        if not found and self.posed is not None:
            return posed_goals(self, self.posed)
        driving = [goal for goal in found if goal.drives]
        return tuple(sorted(driving or found, key=lambda goal: goal.sent_s))

    def goals_untold_s(self, goals: Sequence[Goal], odometry: Odometry | None) -> float | None:
        """Since when the recording tells of no goal though the robot drives on by itself; None where it does not."""
        if not goals or odometry is None:
            return None
        last_s, is_open = max((goal.end_s, not goal.outcome) for goal in goals)
        if is_open:  # its action still says how it is going, if it is recorded
            action = f"{goals[-1].action}/"
            told = (t for name, t in self.times.items() if name.startswith(action) and len(t) >= STREAM_MESSAGES)
            last_s = max((float(t[-1]) for t in told), default=math.inf)
        since_s = last_s + SILENT_S
        is_piloted = any(
            PILOTED.search(name) and len(times) and times[-1] > since_s for name, times in self.times.items()
        )
        return last_s if not is_piloted and odometry.spread_m(since_s) > DROVE_M else None

    @property
    def missed(self) -> tuple[Goal, ...]:
        """The goals that failed, or are left open at the end."""
        return tuple(one for one in self.goals if one.failed or (not one.outcome and one.time_s > OPEN_S))

    @property
    def missed_s(self) -> float:
        """When the first goal that was missed was sent; the end where none was missed."""
        return min((one.sent_s for one in self.missed), default=self.duration_s)

    def severity(self, onset_s: float, otherwise: Severity = "warning") -> Severity:
        """How much something that began then matters: critical where a goal failed afterwards, or is left open at the
        end; a warning where every later goal was reached; `otherwise` where the robot was given no goal."""
        if not self.goals:
            return otherwise
        return "critical" if any(goal.end_s >= onset_s for goal in self.missed) else "warning"

    # Messages

    @cached_property
    def log_messages(self) -> tuple[LogMessage, ...]:
        """What nodes said, in order of time; where it was recorded twice (`/rosout_agg`), once."""
        spoken = [log_messages(table, type) for type in ROSOUT for _, table in self.of(type)]
        return max(spoken, key=len, default=())

    def plugins(self) -> Mapping[str, tuple[Setting, ...]]:
        return created(self.log_messages)

    def log_messages_on(self, topics: Iterable[str]) -> tuple[LogMessage, ...] | None:
        """What nodes said on the first of these topics that the recording has; None where it has none of them."""
        read = (self._of_topic(_spoken, topic, *LOG_FIELDS) for topic in topics)
        return next((spoken for spoken in read if spoken is not None), None)

    @cached_property
    def reports(self) -> tuple[Report, ...]:
        """What diagnostics said, changes of level only."""
        return (*reports(self.of(DIAGNOSTICS)), *faults(self.of(FAULT_EVENT)))


def way_through(goals: Iterable[Goal], commands: Commands | None) -> float:
    """How far the robot must have gone to reach the goals that it reached, m: from one to the next, or as it was
    commanded on the way to them."""
    reached = [goal for goal in goals if goal.outcome == "reached"]
    apart = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(reached)]
    way_m = sum(one for one in apart if math.isfinite(one))
    return way_m if commands is None else max(way_m, sum(commands.way_m(one.sent_s, one.end_s) for one in reached))


def _spoken(topic: str, table: Table) -> tuple[LogMessage, ...] | None:
    return log_messages(table) if {"level", "name", "msg"} <= set(table.columns) else None


def _namespace(topic: str) -> str:
    """Of several robots each has its own."""
    return topic.rpartition("/")[0]
