"""What each stage needs of memory, disk and time, by arithmetic on the settings, held against what the machine has.

Memory and time of simulated records were measured on a KR300 and a two-inertia drive, within a factor of two; others
follow from the sizes of their arrays. That is enough to refuse what no such machine can hold.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from robid.design.excitation.options import ArbitraryOptions, SignalOptions, TrajectoryOptions
from robid.errors import SettingsError
from robid.models.family import family_of
from robid.pipeline.progress import roughly
from robid.settings.checks.configurations import configuration_count
from robid.settings.checks.experiment import input_names, output_names, sampling_period_s
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment

_PROCESS_BYTES = 150e6  # of a process with its packages
_COPIES = 4  # of a record's samples while they are simulated, read or transformed
_DRAWN_COPIES = 6  # of an excitation's samples
_MATRICES = 40  # of the size of a response that a fit keeps: covariances, weights, slopes
_SAMPLE_S, _MOTION_S = 1e-4, 2e-5  # of a simulated sample [s]: for all motions at once, and for each motor and motion
_MOTORS = 6
_OF_A_JOINT, _USUAL_CANDIDATES = 4, 300  # parameters that are wanted, and candidates
_LONGEST_S = 90 * 86400.0
_USUAL = {"excitation.period_s": 5.0, "periods": 4, "realizations": 4, "configurations": 15, "excitation.count": 60}
_CGROUPS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


@dataclass(frozen=True)
class Estimate:
    """What a stage needs, about."""

    memory_bytes: float  # of all its tasks that run at a time
    disk_bytes: float  # of its output, while it is made
    seconds: float | None  # None where it depends on the data
    driver: str  # the setting that has most part in it, with its number


@dataclass(frozen=True)
class _Size:
    """How large a campaign's data are."""

    n_conf: int
    n_block: int  # experiments in one configuration
    n_sample: float  # of a period
    periods: float  # that are kept, of each experiment
    n_in: int
    n_out: int
    n_line: float
    n_real: int
    factors: dict[str, float]  # settings that it is proportional to

    @property
    def record_bytes(self) -> float:
        """Samples of one configuration."""
        return 8.0 * self.n_block * self.periods * self.n_sample * (self.n_in + self.n_out)

    @property
    def response_bytes(self) -> float:
        """A response of one configuration, and those of its realizations."""
        return 16.0 * self.n_line * self.n_in * self.n_out * (1 + self.n_real)


def _size(loaded: LoadedExperiment, name: str) -> _Size:
    campaign, robot = loaded.experiment.campaigns[name], loaded.robot
    step_s = sampling_period_s(campaign, robot) or 1e-3
    n_in, n_out = len(input_names(campaign, robot)), len(output_names(campaign, robot))
    # Of a log of one shot nobody knows how long it is before it is read.
    n_sample = 0.0 if campaign.is_one_shot else campaign.excitation.period_s / step_s
    n_line = _line_count(campaign)
    factors = {
        "excitation.period_s": campaign.excitation.period_s,
        "periods": campaign.periods,
        "realizations": campaign.realizations,
        "configurations": configuration_count(loaded.experiment, campaign) or 1,
        "excitation.count": n_line,
    }
    n_conf, n_real = int(factors["configurations"]), campaign.realizations
    block = n_real * campaign.block_size(n_in)
    return _Size(n_conf, block, n_sample, campaign.periods, n_in, n_out, n_line, n_real, factors)


def _line_count(campaign: Campaign) -> float:
    """Lines of a response, at most: those that are counted or listed, else all of the band."""
    excitation = campaign.excitation
    if isinstance(excitation, TrajectoryOptions):
        return float(excitation.harmonics)
    stated = getattr(excitation, "lines", None)
    if isinstance(excitation, SignalOptions) and isinstance(stated, tuple):
        return float(len(stated))
    if isinstance(excitation, SignalOptions) and stated is None and hasattr(excitation, "count"):
        return float(excitation.count)
    share = 0.5 if getattr(excitation, "grid", "full") == "odd" else 1.0
    width = excitation.high_hz - excitation.low_hz
    return max(width * excitation.period_s * (1.0 if isinstance(excitation, ArbitraryOptions) else share), 1.0)


def _driver(name: str, size: _Size, *settings: str) -> str:
    """The setting of a campaign that is largest over what is usual."""
    largest = max(settings, key=lambda key: size.factors[key] / _USUAL[key])
    return f"campaigns.{name}.{largest}: {size.factors[largest]:g}"


_OF_RECORD = ("excitation.period_s", "periods", "realizations", "configurations")


def _design(loaded: LoadedExperiment, owner: str, _workers: int) -> Estimate:
    """Information of every candidate under every draw."""
    design = loaded.experiment.designs[owner]
    campaign = loaded.experiment.campaigns[design.campaign]
    n_conf, n_param = configuration_count(loaded.experiment, campaign) or 1, _OF_A_JOINT * len(loaded.robot.joints)
    candidates = f"campaigns.{design.campaign}.configurations: {n_conf}"
    driver = f"designs.{owner}.draws: {design.draws}" if design.draws > n_conf / _USUAL_CANDIDATES else candidates
    return Estimate(8.0 * design.draws * n_conf * n_param**2, 8.0 * n_conf * n_param**2, None, driver)


def _excitation(loaded: LoadedExperiment, owner: str, _workers: int) -> Estimate:
    size = _size(loaded, owner)
    drawn = 8.0 * size.n_block * size.n_sample * size.n_in
    driver = _driver(owner, size, "excitation.period_s", "realizations")
    return Estimate(_DRAWN_COPIES * drawn, drawn / 2, None, driver)


def _record(loaded: LoadedExperiment, owner: str, workers: int) -> Estimate:
    size, campaign = _size(loaded, owner), loaded.experiment.campaigns[owner]
    tasks = max(min(workers, size.n_conf), 1)
    simulated = None if campaign.source is None else campaign.source.simulate
    seconds = None
    if simulated is not None and not campaign.moves_poses:
        samples = size.n_conf * (size.periods + simulated.transient_periods) * size.n_sample
        seconds = samples * (_SAMPLE_S + _MOTION_S * size.n_block * size.n_in / _MOTORS) / tasks
    driver = _driver(owner, size, *_OF_RECORD[: None if seconds else 3])
    return Estimate(tasks * _COPIES * size.record_bytes, size.n_conf * size.record_bytes, seconds, driver)


def _response(loaded: LoadedExperiment, owner: str, workers: int) -> Estimate:
    size = _size(loaded, owner)
    tasks = max(min(workers, size.n_conf), 1)
    memory = _COPIES * (size.record_bytes + size.response_bytes)
    driver = _driver(owner, size, *_OF_RECORD[:3], "excitation.count")
    return Estimate(tasks * memory, 2 * size.n_conf * size.response_bytes, None, driver)


def _fit(loaded: LoadedExperiment, owner: str, _workers: int) -> Estimate:
    return _read(loaded, owner, loaded.experiment.fits[owner].campaigns)


def _validation(loaded: LoadedExperiment, owner: str, _workers: int) -> Estimate:
    fit = loaded.experiment.fits[owner]
    return _read(loaded, owner, (fit.validate_on or fit.campaign,))


def _read(loaded: LoadedExperiment, owner: str, campaigns: Iterable[str]) -> Estimate:
    """What reading the records or responses of campaigns at once takes."""
    reads = family_of(loaded, owner).reads
    sizes = {name: _size(loaded, name) for name in campaigns}
    memory = {
        name: size.n_conf
        * (_COPIES * size.record_bytes * ("record" in reads) + _MATRICES * size.response_bytes * ("frf" in reads))
        for name, size in sizes.items()
    }
    largest = max(memory, key=lambda name: memory[name])
    driver = _driver(largest, sizes[largest], *_OF_RECORD, *(["excitation.count"] if "frf" in reads else []))
    return Estimate(sum(memory.values()), 0.0, None, driver)


_OF_STAGES: dict[str, Callable[[LoadedExperiment, str, int], Estimate]] = {
    "design-configs": _design,
    "design-excitation": _excitation,
    "simulate-or-acquire": _record,
    "estimate-frf": _response,
    "fit": _fit,
    "validate": _validation,
}


def estimate(loaded: LoadedExperiment, stage: str, owner: str, workers: int) -> Estimate | None:
    """Returns what a stage needs beside the process itself; None of those that need little, or whose data tell it.

    Args:
        loaded: The experiment.
        stage: Name of the stage.
        owner: The campaign or fit.
        workers: How many of its tasks run at a time.
    """
    of_stage = _OF_STAGES.get(stage)
    found = None if of_stage is None else of_stage(loaded, owner, workers)
    return None if found is None or not found.memory_bytes else found


def memory_of_machine() -> float:
    """Returns the memory that this process may have at most [bytes]."""
    found = [float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")]
    for name in _CGROUPS:
        with suppress(OSError, ValueError):
            found.append(float(Path(name).read_text(encoding="ascii")))
    return min(found)


def refuse_too_large(
    loaded: LoadedExperiment, asked: Iterable[tuple[str, str]], folder: Path, workers: int | None
) -> None:
    """Refuses stages that need more than this machine has, before any of them begins.

    Args:
        loaded: The experiment.
        asked: Name of each stage, and its campaign or fit.
        folder: The run folder, which need not be there.
        workers: How many tasks run at a time on this machine; None where others compute, whose memory nobody knows.

    Raises:
        SettingsError: With what is needed, what is there, and the setting that has most part in it.
    """
    memory = float("inf") if workers is None else memory_of_machine() - _PROCESS_BYTES
    disk = _disk_of(folder)
    for stage, owner in asked:
        needs = estimate(loaded, stage, owner, workers or 1)
        if needs is None:
            continue
        setting, _, number = needs.driver.rpartition(": ")
        problem = ""
        if needs.memory_bytes > memory:
            problem = f"needs about {size_text(needs.memory_bytes)} of memory; there are {size_text(memory)}"
        elif needs.disk_bytes > disk:
            problem = f"needs about {size_text(needs.disk_bytes)} on the disk, which has {size_text(disk)}"
        elif needs.seconds is not None and needs.seconds > _LONGEST_S:
            problem = f"takes about {time_text(needs.seconds)}, longer than anybody waits"
        if problem:
            remedy = f"{number} has most part in it: choose less; `run --dry-run` says what each stage needs"
            raise SettingsError(f"S598 `{stage}` {problem}", where=f"{loaded.path}: {setting}", remedy=remedy)


def _disk_of(folder: Path) -> float:
    """Size of the disk of a folder that need not be there."""
    for path in (folder, *folder.absolute().parents):
        with suppress(OSError):
            return float(shutil.disk_usage(path).total)
    return float("inf")


def size_text(size: float) -> str:
    """Writes a number of bytes, as in `3 GB`."""
    for power, unit in ((15, "PB"), (12, "TB"), (9, "GB"), (6, "MB")):
        if size >= 10.0**power:
            return f"{size / 10.0**power:.3g} {unit}"
    return "below 1 MB"


def time_text(seconds: float) -> str:
    """Writes a time span, also one of days and years."""
    days = seconds / 86400
    return f"{days / 365:.2g} years" if days > 365 else f"{days:.2g} days" if days > 2 else roughly(seconds)
