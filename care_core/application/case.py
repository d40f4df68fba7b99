"""The whole line from a log to its diagnosis, and the case that stays open to be asked more.

The work is imported by the function that needs it: the app draws its first frame, and `care --help` its text, before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

from care_core.application.open_run import OpenRun, Reading
from care_core.progress import Progress
from care_core.records import Record, field, force_setattr, replace

if TYPE_CHECKING:
    from care_core.application.sharing import Sharing
    from care_core.configs.loading import ConfigFile
    from care_core.diagnose.judging import Judged
    from care_core.diagnose.records import Diagnosis
    from care_core.diagnose.reference import Good
    from care_core.ecosystems.base import RunModel
    from care_core.ecosystems.findings import Health
    from care_core.ecosystems.ros.drive import Drive
    from care_core.logs.base import Log
    from care_core.logs.digest import Sha256
    from care_core.profile.store import Profile
    from care_core.run import ProfileChoice, Robot, Setting, Settings
    from care_core.variables import Variable

NO_SETTINGS: Settings = MappingProxyType({})
"""Where the operator says nothing of the configuration."""


class Request(Record):
    """What an operator asks: a log, and how to look at it. The fields are the options of `care triage`."""

    log: Path
    profile: str | None = None
    """Name or folder of the profile; the one that fits best when None."""
    configs: tuple[str | Path, ...] = ()
    """Files as the operator names them: FILE or NAMESPACE=FILE."""
    keep: tuple[str, ...] = ()
    """Options that must stay as they are."""
    thresholds: Mapping[str, float] = field(default_factory=dict)
    """The operator's own bounds, per objective."""
    top: int = 5
    """Most causes to report per fault."""
    mission: int | None = None
    """Which mission of the log, from 1; the last when None."""
    repeats: tuple[Path, ...] = ()
    """Other logs of the same configuration under the same conditions: diagnosed together, the first log reported."""
    since: Path | None = None
    """The log of a good run; what changed since then is told as evidence, and it is the reference."""
    site: Path | None = None
    """A site file with the operator's own limits; that of the user's configuration folder when None."""
    reference: Path | None = None
    """A configuration file, or a log, that the operator vouches for: the reference, even before that of `since`."""
    robot: str | None = None
    """What the operator calls the robot; by what the log says when None."""

    def __post_init__(self) -> None:
        """Take paths as texts, and refuse what only Python can give: the command line checks its words itself.

        Raises UsageError.
        """
        from care_core.errors import UsageError

        for argument in ("log", "since", "site", "reference"):
            if isinstance(given := getattr(self, argument), str):
                force_setattr(self, argument, Path(given))
        for name, bound in self.thresholds.items():
            if isinstance(bound, bool) or not isinstance(bound, (int, float)) or not math.isfinite(bound):
                hint = f"Pass thresholds={{'{name}': 120}}."
                raise UsageError(f"The threshold '{name}' is {bound!r}, not a number.", hint=hint, where="thresholds")
        for argument in ("configs", "keep", "repeats"):
            if isinstance(given := getattr(self, argument), (str, Path)):
                raise UsageError("This is one name, not several.", hint=f"Pass ({str(given)!r},).", where=argument)


class Case(OpenRun, eq=False):
    """An open run that can be reported."""

    def _repr_html_(self) -> str:
        """The answer in short, for a notebook; nothing in it is markup of a log."""
        from care_core.application.reporting import fragment_of

        return fragment_of(self)

    def report(self, format: str = "text", sharing: Sharing | None = None) -> str:
        """The fix report in one of its formats; `sharing` is what of the run goes into it, by default what suits the
        format. Raises UsageError where there is no such format."""
        from care_core.application.reporting import report_of

        return report_of(self, format, sharing)


def open_case(request: Request, progress: Progress) -> Case:
    """Log -> what happened -> choice of a profile -> judged run -> diagnosis, in this one place.

    Where no profile fits, or the log holds no mission for it, what happened is the answer.

    Raises:
        CareError: the log cannot be read, or the operator named what is not there.
    """
    from care_core.application.progress_estimate import watching
    from care_core.configs.loading import read_configs
    from care_core.ecosystems.examine import examine
    from care_core.errors import NoMissionError
    from care_core.extract.coverage import lacking_of_missions
    from care_core.run import Fit

    configs = read_configs(request.configs)
    with watching(progress) as progress, opened(request.log, progress) as (log, sha256):
        profile, choice = choose(log, request.profile, configs)
        model = _model_of(log, profile, configs)
        progress("looking at what happened", 0.1)
        health = examine(model)
        if said := _said_alone(model):
            profile, choice = choose(log, request.profile, configs, said)
        reading = None
        if profile is not None:
            try:
                reading = _read(model, profile, choice, health, request, configs, progress, sha256)
            except NoMissionError as err:
                reason = err.message[:1].lower() + err.message[1:].rstrip(".")
                if any(event.kind == "mission" for event in health.timeline):
                    reason = lacking_of_missions(log, profile.schema)
                choice = replace(choice, fit=Fit("no", (*choice.fit.reasons, reason)))
        robot = _robot(log, request)
        if reading is None:
            diagnosis = _of_robot(_plainly(model, choice, health, request, configs, sha256), robot)
            return Case(diagnosis, (), log, None, request.configs)
        diagnosis = _of_robot(_diagnose(reading, request, robot, progress), robot)
    return Case(diagnosis, reading.profile.schema.options, log, reading, request.configs)


def read_case(request: Request, progress: Progress) -> Reading:
    """The first half of the line: a judged run, whose faults nobody asked about. Raises CareError."""
    from care_core.configs.loading import read_configs
    from care_core.ecosystems.examine import examine

    configs = read_configs(request.configs)
    with opened(request.log) as (log, sha256):
        profile, choice = fitting(log, request.profile, configs)
        model = _model_of(log, profile, configs)
        health = examine(model)
        if said := _said_alone(model):
            profile, choice = fitting(log, request.profile, configs, said)
        return _read(model, profile, choice, health, request, configs, progress, sha256)


def _said_alone(model: RunModel) -> Settings:
    """What messages say that the robot is put together from, where its parameters in the log do not tell all of it."""
    said = model.plugins()
    return NO_SETTINGS if said.keys() <= model.log.settings().keys() else said


def _model_of(log: Log, profile: Profile | None, configs: Sequence[ConfigFile]) -> RunModel:
    """The model of a log's run, which decodes at once what the health checks and whoever judges will read."""
    from care_core.ecosystems.registry import run_model
    from care_core.extract.plain import plain_plans
    from care_core.extract.read import reading_plan

    model = run_model(log)
    model.given = {name: one for file in configs for name, one in file.settings.items()}
    for plan in plain_plans(log) if profile is None else (reading_plan(profile.schema),):
        model.expect(plan)
    return model


def _robot(log: Log, request: Request) -> Robot | None:
    """Whose log it is, by the operator or else by the log itself."""
    from care_core.extract.identity import identify, named

    return named(request.robot) if request.robot else identify(log)


def _of_robot(diagnosis: Diagnosis, robot: Robot | None) -> Diagnosis:
    """The diagnosis with whose run it is."""
    run = diagnosis.run
    return replace(diagnosis, run=replace(run, log=replace(run.log, robot=robot)))


@contextmanager
def opened(path: Path, progress: Progress | None = None) -> Iterator[tuple[Log, Sha256]]:
    """A log, and its digest in the making."""
    from care_core.logs.digest import hashing
    from care_core.logs.opening import open_as, sniff

    if progress is not None:
        progress("opening the log", 0.0)
    format = sniff(path)
    # Begun before anything else is imported: of a large log it takes as long as all the rest.
    with hashing(path) as sha256:
        yield open_as(format, path), sha256


def choose(
    log: Log, name: str | None = None, configs: Sequence[ConfigFile] = (), said: Settings = NO_SETTINGS
) -> tuple[Profile | None, ProfileChoice]:
    """The installed profile that fits a log best, by the names that the robot has, None where none fits; or how
    the one that was named does.

    Args:
        configs: what the operator says that the robot was configured with; what the log holds is before it.
        said: parameters that messages of the log tell.

    Raises CareError.
    """
    from care_core.extract.select import choose_profile

    profiles, known, left_out = _candidates(log, name, configs, said)
    profile, choice = choose_profile(log, profiles, known)
    if profile is None and name is not None:
        own, _ = choose(log, None, configs, said)
        choice = replace(choice, instead="" if own is None else own.schema.name)
    return profile, replace(_from(choice, profiles), reason=f"{choice.reason}{left_out}")


def fitting(
    log: Log, name: str | None = None, configs: Sequence[ConfigFile] = (), said: Settings = NO_SETTINGS
) -> tuple[Profile, ProfileChoice]:
    """As `choose`, for those who can do nothing without a profile: raises ProfileError where none fits."""
    from care_core.extract.select import fitting_profile

    profiles, known, _ = _candidates(log, name, configs, said)
    profile, choice = fitting_profile(log, profiles, known)
    return profile, _from(choice, [profile])


def _from(choice: ProfileChoice, profiles: Sequence[Profile]) -> ProfileChoice:
    """The choice with where its profile is from."""
    return replace(choice, origin=next((one.origin for one in profiles if one.schema.name == choice.name), ""))


def _candidates(
    log: Log, name: str | None, configs: Sequence[ConfigFile], said: Settings
) -> tuple[list[Profile], Settings, str]:
    """Profiles to choose from, by the names that the robot has, what is known of its parameters, and what is to be said
    of profiles that are not sound."""
    from care_core.extract.known import known_settings
    from care_core.extract.parameter_aliases import with_logged_names
    from care_core.extract.select import sound_profiles
    from care_core.profile.store import load_profile

    profiles, problems = ([load_profile(name)], ()) if name is not None else sound_profiles(log.format.name)
    left_out = "".join(f"; left out as it is not sound: {problem}" for problem in problems)
    known = known_settings(log, configs, said, [profile.schema for profile in profiles])
    return [replace(one, schema=with_logged_names(one.schema, log, known)) for one in profiles], known, left_out


def _plainly(
    model: RunModel,
    choice: ProfileChoice,
    health: Health,
    request: Request,
    configs: tuple[ConfigFile, ...],
    sha256: Sha256,
) -> Diagnosis:
    """The diagnosis of a log that no profile fits: by what its robot says of itself, where it holds a run at all."""
    from care_core.diagnose.judging import judge_plainly
    from care_core.diagnose.triage import unjudged, without_profile
    from care_core.extract.read import log_info

    judged = judge_plainly(model, mission=request.mission, sha256=sha256, health=health)
    if judged is not None:
        health = _linted(model, health.of_run(judged.run.mission.start_s), judged, configs)
        return without_profile(judged, choice, health)
    settings = {name: history[-1] for name, history in model.log.settings().items()}
    return unjudged(log_info(model, sha256()), settings, choice, health)


def _read(
    model: RunModel,
    profile: Profile,
    choice: ProfileChoice,
    health: Health,
    request: Request,
    configs: tuple[ConfigFile, ...],
    progress: Progress,
    sha256: Sha256,
) -> Reading:
    from care_core.diagnose.judging import read_and_judge, with_repeats
    from care_core.ecosystems.registry import run_model
    from care_core.errors import NoRepeatsError, ProfileError

    progress("reading the log", 0.2)
    profile = with_own_limits(profile, request.site)
    good = good_of(request.reference, profile) or _good_run(request, profile, model.log)
    judged = read_and_judge(
        model,
        profile,
        configs=configs,
        thresholds=request.thresholds,
        mission=request.mission,
        good=good,
        sha256=sha256,
        health=health,
    )
    repeats = []
    for path in request.repeats:
        with opened(path) as (other, digest):
            try:
                repeat = read_and_judge(
                    run_model(other), profile, configs=configs, thresholds=request.thresholds, good=good, sha256=digest
                )
            except ProfileError as err:  # of another robot, or without a mission
                reason = err.message[:1].lower() + err.message[1:]
                hint = "Triage them one by one."
                raise NoRepeatsError(f"The logs are no repeats: {reason}", hint=hint, where=str(path)) from err
            repeats.append(repeat)
    health = health.of_run(judged.run.mission.start_s)
    health = _linted(model, health, judged, configs, profile.schema.options, good)
    return Reading(profile, choice, configs, with_repeats(judged, repeats), health)


def _linted(
    model: RunModel,
    health: Health,
    judged: Judged,
    configs: tuple[ConfigFile, ...],
    options: Sequence[Variable] = (),
    good: Good | None = None,
) -> Health:
    """What happened, with what is wrong with the parameters of a ROS robot whose run failed."""
    from care_core.configs.driven import option_value, readable, same_value

    missed = any(result.status == "fault" for result in (*judged.results, *judged.checks))
    if model.log.format.ecosystem != "ros" or not missed:
        return health
    from care_core.diagnose.linted import with_lint

    by_parameter = {parameter: option for option in options for parameter in readable(option)}

    def usual(name: str, setting: Setting) -> bool:
        before = None if good is None else good.settings.get(name)
        if before is not None:
            return same_value(before.value, setting.value)
        option = by_parameter.get(name)
        reference = None if option is None else judged.reference.config.get(option.name)
        return option is not None and same_value(option_value(option, setting), reference)

    names = {parameter: option.name for parameter, option in by_parameter.items()}
    return with_lint(health, cast("Drive", model), configs, names, usual, is_asked=bool(judged.broken))


def with_own_limits(profile: Profile, site: Path | None) -> Profile:
    """The profile with the limits of the site file in place of its own. Raises ConfigError for one that is unsound."""
    from care_core.profile.site import load_site

    found = load_site(site)
    if found is None:
        return profile
    schema = found.applied(profile.schema)
    return profile if schema is profile.schema else replace(profile, schema=schema)


def good_of(path: Path | None, profile: Profile) -> Good | None:
    """The configuration that the operator vouches for, a file or that of a log; None where none was named. Raises
    CareError."""
    from care_core.configs.driven import readable
    from care_core.configs.loading import read_configs, resolve
    from care_core.diagnose.reference import Good, reference_as_driven
    from care_core.logs.finding import is_log

    if path is None or is_log(path):
        return _as_driven(path)
    parameters = (parameter for option in profile.schema.options for parameter in readable(option))
    return Good(resolve(read_configs((path,)), parameters), reference_as_driven(path))


def _good_run(request: Request, profile: Profile, log: Log) -> Good | None:
    """The configuration of the run that is said to be good; None where its log tells otherwise, or of another vehicle:
    then it says what changed, and no more."""
    from care_core.diagnose.since import is_good
    from care_core.logs.opening import open_log

    if request.since is None or not is_good(open_log(request.since), log, profile, request.thresholds):
        return None
    return _as_driven(request.since)


def _as_driven(path: Path | None) -> Good | None:
    """The configuration of a log, None where none was named. Raises CareError."""
    from care_core.diagnose.reference import Good, reference_as_driven
    from care_core.logs.opening import open_log

    if path is None:
        return None
    settings = {name: history[-1] for name, history in open_log(path).settings().items()}
    return Good(settings, reference_as_driven(path))


def _diagnose(reading: Reading, request: Request, robot: Robot | None, progress: Progress) -> Diagnosis:
    from care_core.application.last_good import last_good
    from care_core.diagnose.triage import triage
    from care_core.logs.opening import open_log

    progress("judging the objectives", 0.6)
    return triage(
        reading.judged,
        reading.profile,
        reading.choice,
        keep=request.keep,
        since=last_good(robot, reading.judged.run) if request.since is None else open_log(request.since),
        health=reading.health,
        top=request.top,
        progress=progress,
    )
