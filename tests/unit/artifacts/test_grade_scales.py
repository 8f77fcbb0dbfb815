"""A grade keeps in its artifact which wrong scales each finding saw; artifacts from before have none."""

from robid.artifacts.artifact import Artifact, Provenance
from robid.artifacts.results import MODEL, grade_content, grade_from_artifact
from robid.results.finding import Finding
from robid.results.grade import grade_alone
from robid.results.scale import Scale

SCALES = (Scale("torque", "1000", joints=("axis_1", "axis-2")), Scale("motor_angle", "1000", inverse=True))


def kept(*findings):
    grade = grade_alone(("unusable",), (), findings)
    datasets, attributes = grade_content(grade)
    return datasets, grade_from_artifact(Artifact(MODEL, datasets, attributes, Provenance(stage="fit"))).findings


def test_scales_come_back():
    findings = (Finding("units", "seen", True, 3.0, SCALES), Finding("friction", "seen too", False, 2.0))
    assert kept(*findings)[1] == findings


def test_a_grade_without_scales_is_written_as_before():
    findings = (Finding("friction", "seen", False, 2.0),)
    datasets, found = kept(*findings)
    assert "grade/scales" not in datasets
    assert found == findings
