"""Takes the examples of `robid init` from `configs/` into the wheel; all else is in pyproject.toml."""

from pathlib import Path
from shutil import copyfile

from setuptools import setup
from setuptools.command.build_py import build_py

_CONFIGS = Path("configs")
_NAMES = (
    "drive.yaml",
    "kr300.yaml",
    "kr300_rail.yaml",
    "robots/geared_drive.yaml",
    "robots/kr300.yaml",
    "robots/kr300_rail.yaml",
)


class BuildWithExamples(build_py):
    """Copies the examples; an editable install finds them where they are."""

    def run(self) -> None:
        """Builds the package."""
        super().run()
        if self.editable_mode:
            return
        for source, target in self._copies().items():
            target.parent.mkdir(parents=True, exist_ok=True)
            copyfile(source, target)

    def get_source_files(self) -> list[str]:
        """Returns what a source distribution holds."""
        return [*super().get_source_files(), *map(str, self._copies())]

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """Returns what is built."""
        made = [] if self.editable_mode else [str(target) for target in self._copies().values()]
        return [*super().get_outputs(include_bytecode), *made]

    def _copies(self) -> dict[Path, Path]:
        folder = Path(self.build_lib) / "robid" / "scaffold" / "examples"
        return {_CONFIGS / name: folder / name for name in _NAMES}


setup(cmdclass={"build_py": BuildWithExamples})
