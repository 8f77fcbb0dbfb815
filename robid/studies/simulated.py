"""Simulated campaigns and elastic fits inside a study's tasks, and how estimates scatter over individuals."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from scipy.stats import gmean, norm
from scipy.stats import t as student

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact, Dataset, Provenance
from robid.artifacts.kinds import EXCITATION, FRF, TASK, excitation_from_artifact, frf_from_artifact, frf_to_artifact
from robid.artifacts.store import read_artifact
from robid.design.excitation.excitation import CampaignExcitation
from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.frf.options import EstimateOptions
from robid.models.elastic.files import solution_content, solution_from_artifact
from robid.models.elastic.fit.solution import ElasticSolution
from robid.pipeline.estimate_frf import stated_laws
from robid.pipeline.graph import Run
from robid.pipeline.simulate_or_acquire import simulated_experiment
from robid.robot.friction import TorqueLaw
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import plain_settings, robot_settings
from robid.settings.robot_sections import given
from robid.settings.sources import SimulateSettings
from robid.signals.record import Record
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.studies.study import Content, Task

REFUSAL = "refusal"  # Attribute that says why a configuration has no response, or a robot no fit


@dataclass(frozen=True)
class Estimator:
    """One way to estimate, with what it reads from the robot file."""

    options: EstimateOptions
    laws: tuple[TorqueLaw, ...] | None
    delay_s: float

    def estimate(self, record: Record) -> Frf:
        """Estimates the response of a record."""
        return estimate_frf(record, self.options, self.laws, self.delay_s)


def make_estimator(loaded: LoadedExperiment, campaign: Campaign, options: EstimateOptions) -> Estimator:
    """Returns an estimator with what these options read from the robot file."""
    return Estimator(options, *stated_laws(loaded, campaign, options))


def simulate_options(campaign: Campaign) -> SimulateSettings:
    """Returns how a campaign that the settings' checks let pass as simulated is simulated."""
    return given(given(campaign.source).simulate)


def played(run: Run, campaign: str) -> CampaignExcitation:
    """Reads what a campaign plays, and where."""
    return excitation_from_artifact(read_artifact(run.path(f"{campaign}/excitation.h5"), EXCITATION))


def threads_of(run: Run) -> int:
    """Returns the threads of one simulation: all workers where tasks are done one after the other."""
    return run.workers if run.backend == "serial" else 1


def simulation_settings(loaded: LoadedExperiment, campaign: Campaign) -> dict[str, Any]:
    """Returns what decides, beside the excitation, what a campaign's simulation and estimate give."""
    return {
        "source": plain_settings(campaign.source),
        "periods": campaign.periods,
        "payload_kg": campaign.payload_kg,
        **robot_settings(loaded, "mechanics", "motor_limits", "friction", "friction_std", "controller"),
    }


def response_settings(
    loaded: LoadedExperiment, campaign: Campaign, options: SimulateSettings, experiment: SimulatedExperiment
) -> dict[str, Any]:
    """Returns what decides the responses of a campaign that is simulated with these options, but for the places."""
    reference = hashlib.sha256(np.ascontiguousarray(experiment.reference).tobytes()).hexdigest()
    lines = {key: getattr(experiment, key).tolist() for key in ("excited_lines", "detection_lines")}
    own = {"source": plain_settings(options), "reference": reference, "estimate": plain_settings(campaign.estimate)}
    return {**simulation_settings(loaded, campaign), **own, **lines}


def measurements(
    loaded: LoadedExperiment,
    campaign: Campaign,
    options: SimulateSettings,
    content: CampaignExcitation,
    name: str,
    threads: int,
) -> Iterator[Task]:
    """Yields the tasks `<name>_<number>` that measure a campaign, one for each configuration."""
    experiment = simulated_experiment(loaded, campaign, options, content)
    estimator = make_estimator(loaded, campaign, campaign.estimate)
    decides = response_settings(loaded, campaign, options, experiment)
    for index, configuration in enumerate(content.configurations):
        place = {"index": index, "configuration": configuration.tolist()}
        arguments = experiment, configuration, index, estimator, threads
        yield Task(f"{name}_{index + 1}", {**decides, **place}, arguments)


def measure(
    experiment: SimulatedExperiment, configuration: FloatArray, index: int, estimator: Estimator, threads: int
) -> Content:
    """Simulates a configuration (n_joint,) and estimates its response; the record is not kept."""
    return response_content(estimator.estimate(simulate(experiment, configuration, index, threads)))


def measure_or_refuse(*arguments: Any) -> Content:  # noqa: ANN401
    """Measures a configuration, or says why it has no response."""
    return kept_or_refused(lambda: measure(*arguments))


def response_content(frf: Frf) -> Content:
    """Returns what a task keeps of a response."""
    held = frf_to_artifact(frf, Provenance(stage="study"))
    return Content(held.datasets, held.attributes)


def response_from(held: Artifact, prefix: str = "") -> Frf:
    """Returns a response that a task kept, its names behind a prefix.

    Raises:
        DataError: With what refused it.
    """
    refusal = held.attributes.get(f"{prefix}{REFUSAL}")
    if refusal is not None:
        raise DataError(str(refusal), where=prefix.strip("/").rpartition("/")[2] or "all places")
    datasets, attributes = (
        {name.removeprefix(prefix): value for name, value in named.items() if name.startswith(prefix)}
        for named in (dict[str, Any](held.datasets), dict[str, Any](held.attributes))
    )
    return frf_from_artifact(Artifact(FRF, datasets, attributes, held.provenance))


def read_responses(paths: Sequence[Path]) -> Frf:
    """Reads the responses of some configurations as one; those that were refused are left out.

    Raises:
        DataError: If none is left.
    """
    held = [read_artifact(path, TASK) for path in paths]
    parts = [response_from(each) for each in held if REFUSAL not in each.attributes]
    return join(parts, [str(number) for number, _ in enumerate(parts, 1)]) if parts else response_from(held[0])


def kept_or_refused(make: Callable[[], Content | ElasticSolution]) -> Content:
    """Returns what a task keeps of a measurement or a fit, or of why that was refused."""
    try:
        made = make()
    except DataError as error:
        return Content({}, {REFUSAL: str(error)})
    return made if isinstance(made, Content) else Content(*solution_content(made))


def kept_solution(held: Artifact) -> ElasticSolution:
    """Returns the fit that a task kept.

    Raises:
        DataError: With what refused it.
    """
    if REFUSAL in held.attributes:
        raise DataError(str(held.attributes[REFUSAL]))
    return solution_from_artifact(held)


def with_truth(content: Content, truth: dict[str, float]) -> Content:
    """Returns what a task keeps, with the true values by name."""
    names = Dataset(np.array(list(truth)), "1", ("truth",))
    values = Dataset(np.array(list(truth.values())), "SI", ("truth",), "True values by name")
    return Content({**content.datasets, "truth_names": names, "truth": values}, content.attributes)


def kept_truth(held: Artifact) -> dict[str, float]:
    """Returns the true values that a task kept, by name."""
    return dict(zip(*(held.datasets[key].values.tolist() for key in ("truth_names", "truth")), strict=True))


def ratio_interval(one: FloatArray, other: FloatArray) -> tuple[float, float]:
    """The 95 % interval of the geometric mean ratio of two figures (n_seed,) over the individuals that both share.

    Its ends are by the t distribution; 0 and infinity with one individual.
    """
    ratio = np.log(one / other)
    if ratio.size < 2:
        return 0.0, float("inf")
    reach = student.ppf(0.5 + 0.5 * _LEVEL, ratio.size - 1) * ratio.std(ddof=1) / np.sqrt(ratio.size)
    return float(np.exp(ratio.mean() - reach)), float(np.exp(ratio.mean() + reach))


def differs(one: FloatArray, other: FloatArray) -> bool:
    """Tells whether two figures (n_seed,) differ by more than chance over the individuals, see `ratio_interval`."""
    low, high = ratio_interval(one, other)
    return low > 1 or high < 1


def stated_std(lower: FloatArray, upper: FloatArray, confidence: float) -> FloatArray:
    """Deviation (n_param,) of each parameter's logarithm whose normal interval is as wide as a fit's at its level.

    The ends (n_param,) need not lie around the estimated values; NaN where the interval does not lie above 0.
    """
    ratio = np.divide(upper, lower, out=np.full(lower.shape, np.nan), where=lower > 0)
    return np.asarray(np.log(ratio) / (2 * norm.ppf(0.5 + 0.5 * confidence)))


Mean: TypeAlias = Literal["average", "typical"]
"""Arithmetic or geometric mean over springs: a spring that no data can tell outweighs all others in the first."""

_LEVEL = 0.95


def over_springs(values: FloatArray, mean: Mean) -> FloatArray:
    """Mean (...) of figures (..., n_param) over the parameters."""
    return np.asarray(values.mean(axis=-1) if mean == "average" else gmean(values, axis=-1))


def scatter(error: FloatArray, mean: Mean) -> float:
    """Standard deviation of each parameter's error over all samples, mean over the parameters; NaN of a single sample.

    Errors (n_seed, n_set, n_param) are the logarithms of estimate over truth of each individual, from each of the sets
    of configurations that the model may have.
    """
    samples = error.reshape(-1, error.shape[-1])
    return float(over_springs(samples.std(axis=0, ddof=1), mean)) if len(samples) > 1 else float("nan")


def scatter_error(error: FloatArray, mean: Mean) -> float:
    """Standard error of the logarithm of the scatter, by leaving out one individual after the other.

    Errors (n_seed, n_set, n_param) are as for `scatter`; NaN of fewer than three individuals.
    """
    return _jackknife(lambda part: np.log(scatter(part[0], mean)), error)


def _jackknife(figure: Callable[[list[FloatArray]], float], *errors: FloatArray) -> float:
    """Standard error of a figure of errors (n_seed, ...), by leaving out one individual after the other."""
    count = len(errors[0])
    if count < 3:
        return float("nan")
    left = np.array([figure([np.delete(error, out, axis=0) for error in errors]) for out in range(count)])
    return float(np.sqrt((count - 1) * left.var()))


def scatters_differ(one: FloatArray, other: FloatArray, mean: Mean) -> bool:
    """Tells whether two models' errors (n_seed, n_set, n_param) scatter differently by more than chance.

    That is whether 0 lies outside the 95 % interval of the logarithm of their ratio over the individuals, which both
    share; never of fewer than three.
    """

    def log_ratio(pair: Sequence[FloatArray]) -> float:
        return float(np.log(scatter(pair[0], mean) / scatter(pair[1], mean)))

    if len(one) < 3:
        return False
    reach = student.ppf(0.5 + 0.5 * _LEVEL, len(one) - 1) * _jackknife(log_ratio, one, other)
    return bool(abs(log_ratio((one, other))) > reach)
