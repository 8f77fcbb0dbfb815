"""What an elastic fit adds to page, terminal and summary."""

from __future__ import annotations

from collections.abc import Sequence

from robid.models.elastic.files import validation_from_artifact
from robid.models.elastic.judge.validating import Validation
from robid.models.elastic.page.content import FitContent
from robid.models.elastic.page.gather import fit_content
from robid.models.elastic.page.sections import fit_tables, headline, sections
from robid.models.elastic.page.summary import comparison, fit_summary
from robid.models.family import Shown
from robid.report.page import FitReport
from robid.report.parameter_section import identified_phrase
from robid.report.parameters import misfit_sentence
from robid.results.outcome import recovery_sentence


def report(shown: Shown) -> FitReport:
    """Lays out an elastic fit for page, terminal and summary."""
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    return fit_report(fit_content(shown), validation, shown.told)


def compare(every: Sequence[Shown]) -> dict[str, float]:
    """Returns the numbers that compare elastic fits, by dotted name."""
    return comparison([fit_content(shown) for shown in every])


def fit_report(fit: FitContent, validation: Validation | None = None, told: tuple[str, ...] = ()) -> FitReport:
    """Puts together all that is shown of a fit.

    Args:
        fit: The fit.
        validation: Its validation, if any.
        told: What the page warns of anyway.
    """
    return FitReport(
        headline=headline(fit),
        verdict=_verdict(fit, validation),
        grade=None if fit.grade is None else fit.grade.value,
        sections=sections(fit, told),
        parameters=fit.estimates.rows,
        summary=fit_summary(fit, validation),
        terminal=tuple(fit_tables(fit)),
    )


def _verdict(fit: FitContent, validation: Validation | None) -> str:
    """Says what is identified, whether the model holds, and what is known of the truth."""
    found = [] if fit.grade is None else [fit.grade.sentence]
    found.append(f"{identified_phrase(fit.estimates, usable=fit.usable)}.")
    if fit.usable:
        found.append(misfit_sentence(fit.estimates))
    if validation is None:
        found.append("Not validated: no campaign was named to hold it against.")
    else:
        # What fails the validation stands in the grade's sentence.
        found.append(f"The model {validation.outcome.verdict}." if validation.outcome.ok else "")
        found.append(recovery_sentence(validation.outcome.recovery))
    return " ".join(sentence for sentence in found if sentence)
