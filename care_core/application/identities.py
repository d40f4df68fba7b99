"""What says where a robot was, when, and whose it is, by the shape of the text: no list of such places or names exists.

Each class is one pattern: two numbers that can be a place, in whatever spelling; dates; addresses; numbers that a
label calls a serial number or a password; and names, which are what has letters and digits in one word.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

# No pattern begins inside a word, and none repeats without end but over white space, of which `squeezed` leaves two
# characters: a log may hold a text of a million digits, or of as many blanks.
_LONG_GAP = re.compile(r"(\s\s)\s+")
_POWER = r"(?:e[-+]?\d{1,2})?"
_NUMBER = rf"(?<!\d)[-+]?\d{{1,12}}(?:[.,]\d{{1,12}})?{_POWER}"
_DECIMAL = rf"(?<!\d)[-+]?\d{{1,8}}[.,]\d{{1,15}}{_POWER}"
_APART = r"(?:\s?m)?(?:\s?[,;/|]\s?|[:x]|,?\s(?:and|by|then)\s|\s)"
"""Between the two numbers of a place that words announce."""
_NO_UNIT = r"(?![\d.,]*\d|\s?(?:s|ms|min|Hz|%|deg|degC|V|A|mAh|Wh|W|rpm|cm|times)\b|\s?%)"
_DEGREE = "[\N{DEGREE SIGN}\N{MASCULINE ORDINAL INDICATOR}\N{RING ABOVE}]"
_TICKS = f"(?:{_DEGREE}|deg|['\"\u2018-\u201f\u2032\u2033:_-])"
_HEMISPHERE = r"(?:[NSEWO]|north|south|east|west)"
_ANGLE = rf"\d{{1,3}}(?:[.,]\d+)?(?:\s?{_TICKS}\s?|\s)?(?:\d{{1,2}}(?:[.,]\d+)?(?:\s?{_TICKS}{{1,2}}|\s)?\s?){{0,2}}"
PLACES = re.compile(
    rf"""
    \(\s*{_NUMBER}\s*[,;]\s*{_NUMBER}(?:\s*[,;]\s*{_NUMBER})?\s*\)                  # (4.2, 0.1)
    | \b(?:lat(?:itude)?|lng|lon(?:g|gitude)?|easting|northing|utm|mgrs|zone)\b\W{{0,3}}{_NUMBER}(?:\s*[NSEW]\b)?
    | \b[xyz]\s*[:=]\s*{_NUMBER} | \b[xyz]\s+{_DECIMAL}                           # x=4.2, x 4.2
    | \bx\W{{0,3}}{_NUMBER}\s?m?\W{{0,3}}y\W{{0,3}}{_NUMBER}                        # x 4 y 2
    | \b(?:position|pose|goal|home|location|origin|target|cell|coordinates?)\b\W{{0,3}}(?:(?:is|at|to|of)\b\W{{0,3}})?
      (?:{_DECIMAL}{_APART}{_NUMBER}|{_NUMBER}{_APART}{_DECIMAL}){_NO_UNIT}         # goal at 4.2 by 0
    | {_DECIMAL}\s*{_DEGREE}?\s*{_HEMISPHERE}?\s*(?:[,;/|:]\s*|\s)\s*{_HEMISPHERE}?\s*{_DECIMAL}(?!\s*%)
      (?:\s*{_DEGREE}?\s*{_HEMISPHERE}\b)?
    | (?<!\d)[-+]?\d{{2,3}}[.,]\d{{5,15}}                                                    # one coordinate in degrees
    | \d{{1,3}}\s*{_DEGREE}\s*\d{{1,2}}(?:[.,]\d+)?\s*(?:{_TICKS}[^,;]{{0,12}}?{_HEMISPHERE}\b)?   # 47° 23' 51" N
    | \b(?-i:[NS])\s?{_ANGLE}[,;/\s]*(?-i:[EWO])\s?{_ANGLE}                         # N47 23 51 E8 32 44
    | (?<![\w.]){_ANGLE}(?-i:[NS])\b[,;/\s]*{_ANGLE}(?-i:[EWO])\b                   # 47 23.85 N 8 32.73 E
    | \b[ns]\s?\d{{1,2}}[\s.:-]\d{{1,2}}[\d.]{{0,8}}(?:[\s.:-]\d{{1,2}}[\d.]{{0,8}})?[,;/\s]{{1,3}}
      [ewo]\s?\d{{1,3}}[\s.:-]\d{{1,2}}[\d.\s:'"-]*
    | \b\d{{4,6}}(?:\.\d+)?\s*,?\s*[NS]\b[\s,]*\d{{5,7}}(?:\.\d+)?\s*,?\s*[EW]\b    # 472351N 0083244E
    | \b\d{{4,5}}\.\d+\s*,\s*[NSEW]\b                                               # NMEA
    | \b\d{{1,2}}\s?[C-X]\s?[A-HJ-NP-Z]{{2}}\s?\d{{2,5}}\s?\d{{2,5}}\b              # MGRS
    | \b\d{{1,2}}\s?[C-X]\s+(?:\w\s)?\d{{5,7}}[\s,;/]+(?:\w\s)?\d{{6,8}}            # UTM: 32T 465123 5248765
    | \b[EN]?\s?\d{{6}}(?:\.\d+)?\s*(?:m\s?)?[EN]?[\s,;/]+[EN]?\s?\d{{6,7}}(?:\.\d+)?
    | \b[23456789CFGHJMPQRVWX]{{4,8}}\+[23456789CFGHJMPQRVWX]{{2,3}}\b              # plus code
    | ///[^\W\d_]+\.[^\W\d_]+\.[^\W\d_]+
    | \b(?:[a-r]{{2}}\d{{2}}[a-x]{{2}}(?:\d{{2}})?)\b                               # Maidenhead
    | \b(?:elevation|amsl|msl)\b\W{{0,3}}(?:set|is|at)?\W{{0,3}}{_NUMBER}           # a height above the sea
    | {_NUMBER}\s?m?\s?\b(?:amsl|msl|(?:above|over)\s(?:mean\s)?sea)\b
    """,
    re.VERBOSE | re.IGNORECASE,
)

_MONTH = r"(?:jan|feb|m[aä]r|apr|ma[iy]|jun|jul|aug|sep|o[ck]t|nov|de[cz])[a-zé]*"
_NO_MAY = r"(?:jan|feb|m[aä]r|apr|jun|jul|aug|sep|o[ck]t|nov|de[cz])[a-zé]*"
_DAY, _MONTH_NUMBER = r"(?:0?[1-9]|[12]\d|3[01])", r"(?:0?[1-9]|1[0-2])"
_TIME = r"(?:[T_,\s]{1,2}\d{1,2}[-:h.]?\d{2}(?:[-:.]?\d{2}(?:\.\d+)?)?\s?(?:Z|[ap]m|[+-]\d{2}:?\d{2})?)?"
_DOMAINS = (
    r"(?:local|lan|home|internal|corp|com|org|net|io|dev|app|info|biz|edu|gov|mil|eu|de|ch|at|fr|it|es|nl|uk|us|ca|au"
    r"|jp|cn|in)"
)
_HEX = r"[0-9a-f]"
IDENTITIES = re.compile(
    rf"""
    (?<![\w.+-])[\w.+-]{{1,64}}@[\w-]{{1,63}}(?:\.[\w-]{{1,63}}){{0,8}}                        # mail, user@host
    | (?<![\w+.-])[a-z][a-z0-9+.-]{{0,20}}://\S+                         # URL
    | (?<![\w.-])(?:[\w-]{{1,63}}\.){{1,8}}{_DOMAINS}\b(?![.(])                # host.example.com
    | \b\d{{1,3}}(?:\.\d{{1,3}}){{3}}(?::\d+|/\d+)?\b    # IPv4
    | \b(?:{_HEX}{{1,2}}[:-]){{5}}{_HEX}{{1,2}}\b | \b(?:{_HEX}{{4}}\.){{2}}{_HEX}{{4}}\b     # MAC
    | \b(?:{_HEX}{{1,4}}:){{3,7}}{_HEX}{{1,4}}\b | (?<!\w)(?:{_HEX}{{1,4}}(?::{_HEX}{{1,4}}){{0,6}})?::(?:{_HEX}{{1,4}}(?::{_HEX}{{1,4}}){{0,6}})?(?!\w)
    | \\\\[^\s\\]+(?:\\[^\s,;:'"]*)*                      # \\server\share
    | (?:~\w*|\b[a-z]:)[\\/][^\s,;:'"]*                   # ~/logs, ~name/logs, C:\logs
    | /(?:home|users|root|mnt|media|tmp|var|opt|data|srv|etc|usr|run|sdcard|fs|log|logs|volumes)/[^\s,;:'"]*
    | (?<![\w.]){_DAY}([-./]|\s[-./]\s){_MONTH_NUMBER}\1(?:\d{{4}}|\d{{2}}){_TIME}(?![\w.])    # 21.11.26
    | (?<![\w.]){_MONTH_NUMBER}([-./]){_DAY}\2(?:\d{{4}}|\d{{2}}){_TIME}(?![\w.])              # 11/21/26
    | (?<![\w.])\d{{4}}\s?[-./]\s?\d{{1,2}}\s?[-./]\s?\d{{1,2}}{_TIME} | \b\d{{4}}-?W\d{{2}}(?:-\d)?\b
    | (?<![\w.])(?:19|20)\d{{2}}(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])(?:[T_-]?\d{{4,6}})?Z?\b
    | \b{_DAY}(?:st|nd|rd|th|\.)?(?:\s+of)?[-\s./']*{_MONTH}\b\.?(?:[-,\s./']*\d{{2,4}})?{_TIME}
    | \b{_NO_MAY}\.?[-\s./']+\d{{1,2}}(?:st|nd|rd|th)?\b(?:[-,\s./']+\d{{2,4}})?{_TIME}
    | \b{_MONTH}\.?[-\s./',]+(?:\d{{1,2}}[-\s./',]+)?(?:19|20)\d{{2}}\b
    | \b(?:(?:gps\s*)?week|tow|kw)\W{{0,3}}\d{{1,7}}\b
    | \b(?:mon|tues?|wed(?:nes)?|thu(?:rs)?|fri|satur|sun)(?:day)?,?\s\d{{1,2}}[:.]\d{{2}}
    | \b(?=[0-9a-f]*\d)[0-9a-f]{{7,}}\b                 # serial numbers, hashes, seconds since 1970
    | (?<![\w.])\d{{6,}}\b(?!\s?baud\b)
    | (?<![\w-])[0-9a-f]{{2,12}}(?:-[0-9a-f]{{2,12}}){{3,8}}\b       # UUID
    | \+\d[\d ()/.-]{{7,}}\d | \(?\b0\d{{1,4}}\)?[ /-]\d{{2,}}(?:[ /-]?\d{{2,}})+\b            # telephone
    | \b(?:serial|s/n|sn|ser|asset|imei|imsi|iccid|icao|squawk|call\s?sign|tail|registration|reg|ssid|wi-?fi|wlan|hotspot|password|passwd|passphrase|pwd|psk|token|secret|api[\s_-]?key|host|hostname|user|username|login|owner|operator|customer|phone|tel|mobile|addr|address|uuid|guid|uid)\b
      [\s:=#._]*(?:(?:no|nr|num|number|id|name|key|code|is|was|of|to|mode)\b[\s:=#._]*){{0,2}}[^\s,;]+
    | \b(?:pilot|crew|team|name|driver|site|farm|club|company|unit|vehicle|robot|drone|aircraft)\s?[:=]\s?[^,;]+
    """,  # noqa: E501 - a class a line
    re.VERBOSE | re.IGNORECASE,
)
"""Of a label its number or name goes with it: "serial no 4711", "host robot7", "WiFi: Cube"."""

_TOKEN = re.compile(r"\w+")
_LETTERS = re.compile(r"[^\W\d_]+")
_UNITS = r"(?!\s?(?:mAh|mV|ms|us|Hz|rpm|baud|cm|mm)\b)"
_PRIVATE_NUMBER = re.compile(
    rf"""
    (?<![\w.])\d{{4,}}{_UNITS}(?![\w.]) | \b\d{{5,}}[a-f]\b
    | \b\d{{1,2}}:\d{{2}}(?::\d{{2}})?\b | \b\d{{2,4}}(?:[ -]\d{{2,4}}){{2,}}\b
    | (?<![\w.#]){_NUMBER}(?:\s?m)?(?:\s?[,;|x]\s?|,?\s(?:and|by|then)\s|\s){_NUMBER}{_NO_UNIT}(?!\w)
    | \b(?:sys_?id\w*|(?:vehicle|robot|unit|drone|room|dock|floor|hall|bay|building|street)
      (?:\s?(?:id|no|nr|number))?\b)\W{{0,3}}\d
    """,
    re.VERBOSE | re.IGNORECASE,
)
"""Of no use in what software wrote, and what a number plate, an identifier, a time of day, two coordinates, a robot's
number or that of a room look like."""
_ROS_NAME = re.compile(r"(?<![\w.])/[A-Za-z]\w*(?:/\w+)*")


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_GIVEN_NAMES = _words(
    "abe al alan andy art august bill bob bud carol chance chase chip chuck clay cliff dale dawn dean dee drew earl"
    " eve faith fay frank gene glen grace grant guy hank heath herb hope hunter ian ivy jack jade jay jean jerry jim"
    " joe john joy june kay ken kim lance laurel lee les lily link mark mat matt max may miles nick norm pat paul"
    " penny pete pierce ray reed rich rob robin rod rose ross roy ruby rusty sally sam sandy skip sky stew sue summer"
    " ted tom tony vic violet wade walt ward wes will woody"
)
"""English words that a team calls its robots by, where a word is a name: before a topic."""
_NUMBERED = _words(
    "a acc accel ahr ahrs air arm att b bar baro bat batt battery bcl blheli board bus c cam camera can cell "
    "ch channel cmd command compass core costmap ctun curr d dcm dshot e ek ekf esc f failsafe fence filter "
    "float flow fltmode fmt frame g gcs goal gpa gps gyr gyro h i imu ins instance int item j joint k l lane "
    "laser led lidar m mag mav mavlink mission mode mot motor n nav nkf nkq nkt ntun o out output p pid pida "
    "pidp pidr pidy pin plane point pos prx px q quad r range rangefinder rate rc rcin rcou rcout receiver "
    "relay rfnd rngfnd ros rpm s sensor serial servo sha sitl stage step t telem thr tune turtlebot u uart "
    "uavcan ubx uint usb utf v vibe vmc vmu w waypoint wp x xkf xkfs xkq xkt xkv y yaw z zip zone"
)
"""Parts of a robot that are counted: IMU1, EKF3, C4. Any other name with digits may be the robot's."""
_MOST_UNIT = 4


def has_number(text: str) -> bool:
    """Whether a text that a robot's software wrote has a number that only its own people need."""
    return _PRIVATE_NUMBER.search(text) is not None


def squeezed(text: str) -> str:
    """The text without long white space, which patterns of several gaps could share in ever more ways."""
    return _LONG_GAP.sub(r"\1", text)


def private_names(text: str, public: frozenset[str], known: frozenset[str]) -> Iterator[tuple[int, int]]:
    """Where words stand in a text that may name somebody's robot or place.

    Args:
        public: words that say nothing of that.
        known: whole names, with digits, that say nothing either: of parameters and of variables.
    """
    named = {start for match in _ROS_NAME.finditer(text) for start in _parts(match)}
    for token in _TOKEN.finditer(text):
        word = token[0].casefold()
        if word in known or word.isdigit():
            continue
        letters = [part[0].casefold() for part in _LETTERS.finditer(token[0])]
        is_name = token.start() in named and any(part in _GIVEN_NAMES for part in letters)
        if is_name or (any(c.isdigit() for c in word) and not _is_counted(word, letters)):
            yield token.span()
            continue
        for part in _LETTERS.finditer(token[0]):
            if len(part[0]) > 1 and part[0].casefold() not in public:
                yield token.start() + part.start(), token.start() + part.end()


def _parts(match: re.Match[str]) -> Iterator[int]:
    for part in _TOKEN.finditer(match[0]):
        yield match.start() + part.start()


def _is_counted(word: str, letters: list[str]) -> bool:
    """Whether a word with digits is a part with its number, or a number with its unit."""
    if word[0].isdigit():
        return len(letters) == 1 and len(letters[0]) <= _MOST_UNIT and word.endswith(letters[0])
    digits = sum(character.isdigit() for character in word)
    if len(letters) == 1:
        return letters[0] in _NUMBERED and digits <= min(3, 1 + len(letters[0]))
    return len(letters) == 2 and len(letters[0]) > 1 and letters[0] in _NUMBERED and digits <= 3
