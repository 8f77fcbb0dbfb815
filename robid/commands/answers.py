"""The answers of every command with `--json`, and their JSON schemas, which only `robid schema` asks for."""

from __future__ import annotations

from typing import Any, Union

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from robid.commands.compare import CompareAnswer
from robid.commands.compare_runs import RunsAnswer
from robid.commands.doctor import DoctorAnswer
from robid.commands.dry_run import RunDryRunAnswer
from robid.commands.explain import ExplainAnswer, LettersAnswer
from robid.commands.export import ExportAnswer
from robid.commands.fit_try import TryAnswer
from robid.commands.init import InitAnswer
from robid.commands.inspect import ArtifactAnswer
from robid.commands.log_answer import LogAnswer
from robid.commands.next_visit import NextAnswer
from robid.commands.output import Answer, ErrorAnswer
from robid.commands.reprocess import BatchAnswer, DryRunAnswer, RowAnswer
from robid.commands.response_answer import ResponseAnswer
from robid.commands.run import RunAnswer, StageAnswer
from robid.commands.status import StatusAnswer
from robid.commands.study import StudyAnswer
from robid.commands.upgrade import UpgradeAnswer
from robid.errors import SettingsError
from robid.pipeline.chain import STAGES

ANSWERS: dict[str, tuple[type[Answer], ...]] = {
    **{stage.name: (StageAnswer,) for stage in STAGES},
    "design-configs": (StageAnswer, NextAnswer),
    "fit": (StageAnswer, TryAnswer),
    "run": (RunAnswer, RunDryRunAnswer),
    "reprocess": (BatchAnswer, RowAnswer, DryRunAnswer),
    "study": (StudyAnswer,),
    "export": (ExportAnswer,),
    "compare": (CompareAnswer, RunsAnswer),
    "status": (StatusAnswer,),
    "upgrade": (UpgradeAnswer,),
    "inspect": (ArtifactAnswer, LogAnswer, ResponseAnswer),
    "init": (InitAnswer,),
    "doctor": (DoctorAnswer,),
    "explain": (ExplainAnswer, LettersAnswer),
}
"""What each command prints but for errors; `schema` prints a schema."""


class _Schema(GenerateJsonSchema):
    """Schemas as answers are printed: every key is there, and a number may be null, since it may not be finite."""

    def float_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401, ARG002
        """A number, or null."""
        return {"type": ["number", "null"]}

    def field_title_should_be_set(self, schema: Any) -> bool:  # noqa: ANN401, ARG002
        """Keys have no other name."""
        return False

    def dataclass_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401
        """The keys of a class, and of an answer what it is."""
        made, cls = super().dataclass_schema(schema), schema["cls"]
        keys: dict[str, Any] = made["properties"]
        if issubclass(cls, Answer):
            keys = _identity(cls) | keys
        for key in keys.values():
            key.pop("default", None)
        return {**made, "properties": keys, "required": list(keys)}


def schema_of(command: str) -> dict[str, Any]:
    """Returns the JSON schema of what a command prints with `--json`.

    Raises:
        SettingsError: If there is no such command.
    """
    if command not in ANSWERS:
        remedy = f"name one of {', '.join(ANSWERS)}"
        raise SettingsError(f"S545 no answer with --json is that of `{command}`", where="--of", remedy=remedy)
    of_any: Any = Union[*ANSWERS[command], ErrorAnswer]
    made = TypeAdapter(of_any).json_schema(mode="serialization", schema_generator=_Schema)
    return {"$schema": _Schema.schema_dialect, "title": f"robid {command} --json", **made}


def _identity(cls: type[Answer]) -> dict[str, Any]:
    major = cls.version.partition(".")[0]
    told = f"Version of these keys, here {cls.version}: a new key raises what follows the point."
    return {
        "type": {"const": cls.type, "type": "string", "description": "What is printed."},
        "json_version": {"type": "string", "pattern": rf"^{major}\.\d+$", "description": told},
    }
