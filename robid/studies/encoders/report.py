"""The study of gears with two encoders: its tasks, its figures, and its page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.artifact import Artifact
from robid.fleet.population import Trait, find_outliers, populations
from robid.models.transmission.settings import transmission_fit
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Section
from robid.results.grade import TRUST
from robid.settings.experiment import payload_kg
from robid.settings.robot_parts import plain_settings, require_controller, robot_settings
from robid.settings.robot_sections import given
from robid.studies.encoders.robots import Defect, Individual
from robid.studies.encoders.trials import COLUMNS, GRADE, REFUSED, SENTENCE, Trial, try_robot
from robid.studies.page import CHOOSING, Asked, PartFound, table
from robid.studies.settings.encoders import EncodersStudy
from robid.studies.simulated import simulate_options
from robid.studies.study import Part, Results, Task

_ENOUGH = 0.2  # of the rated torque
_TAILS = (0.025, 0.975)
_CLOSE_S = 5e-5
_ASKED = {
    "encoders.coverage": Asked(lower=0.92, upper=0.99),
    "encoders.error": Asked(upper=0.03),
    "encoders.lag": Asked(lower=0.95),
    "encoders.lost_motion": Asked(lower=0.90),
    "encoders.agreement": Asked(lower=0.90),
    "encoders.width_ratio": Asked(upper=2.0),
    "encoders.trusted": Asked(lower=0.8),
    "encoders.worn_found": Asked(lower=26 / 30),
    "encoders.worn_false": Asked(upper=4 / 70),
    "encoders.let_through": Asked(upper=0.0),
}
_KINDS: tuple[Defect, ...] = get_args(Defect)


@dataclass(frozen=True)
class Gears:
    """What was found of some robots."""

    grade: FloatArray  # (n_robot,)
    sentence: tuple[str, ...]
    values: FloatArray  # (n_robot, n_gear, n_column), NaN where the data were refused

    def column(self, name: str) -> FloatArray:
        """One of the columns (n_robot, n_gear)."""
        return self.values[..., COLUMNS.index(name)]

    def inside(self, name: str) -> BoolArray:
        """Whether the truth lies in the interval (n_robot, n_gear); refusals count as misses."""
        true = self.column(f"{name}_true")
        return np.asarray((self.column(f"{name}_lower") <= true) & (true <= self.column(f"{name}_upper")), bool)


def _tasks(run: Run, study: EncodersStudy, _earlier: Mapping[str, Results]) -> list[Task]:
    loaded, campaign = run.loaded, run.loaded.experiment.campaigns[study.campaign]
    robot = loaded.robot.to_robot(payload_kg(campaign, loaded.robot))
    options, flaws = transmission_fit(loaded.experiment, study.fit).options(), simulate_options(campaign).imperfections
    configuration = np.deg2rad(np.array(given(given(campaign.configurations).list_deg)[0]))
    decides = {
        "study": plain_settings(replace_seeds(study)),
        "flaws": plain_settings(flaws),
        "options": plain_settings(options),
        "configuration": configuration.tolist(),
        **robot_settings(loaded, "mechanics", "motor_limits", "friction", "controller", "doubts"),
    }
    hinge = None if study.hinge is None else study.hinge.spring(loaded.robot.joints)
    tasks = []
    for defect, count in counts(study).items():
        for number in range(count):
            seed = study.seeds[study.use] + 1000 * _KINDS.index(defect) + number
            one = Individual(
                robot,
                require_controller(loaded),
                configuration,
                campaign.outputs[1:],
                flaws,
                study,
                seed,
                defect,
                hinge,
            )
            name = f"{defect or 'sound'}_{seed}"
            tasks.append(Task(name, {**decides, "seed": seed, "defect": defect}, (Trial(one, options),)))
    return tasks


def replace_seeds(study: EncodersStudy) -> EncodersStudy:
    """Returns the study without what only says how many robots there are, and which."""
    counted = ("robots", "further", "doubled", "defective")
    return study.model_copy(update={**dict.fromkeys(counted, 1), "seeds": {}, "use": "judge"})


def counts(study: EncodersStudy) -> dict[Defect, int]:
    """How many robots of each kind there are."""
    few = study.defective
    return {"": study.robots + study.further, "doubled": study.doubled, "loose": few, "behind": few}


def _gears(results: Results, prefix: str) -> Gears:
    chosen: list[Artifact] = [
        results[index] for index, path in enumerate(results.paths) if path.name.startswith(f"{prefix}_")
    ]
    tables = [one.datasets["gears"].values if one.datasets else None for one in chosen]
    shape = next((each.shape for each in tables if each is not None), (1, len(COLUMNS)))
    rows = [np.full(shape, np.nan) if each is None else each for each in tables]
    return Gears(
        grade=np.array([float(str(one.attributes[GRADE])) for one in chosen]),
        sentence=tuple(str(one.attributes[SENTENCE]) for one in chosen),
        values=np.array(rows).reshape(len(rows), *shape),
    )


def figures_of(
    sound: Gears, n_fleet: int, doubled: Gears, defective: Mapping[str, Gears], bent: slice | None = None
) -> dict[str, float]:
    """Returns the study's figures by their name in summary.json; `bent` are gears with a compliance behind them."""
    main = Gears(sound.grade[:n_fleet], sound.sentence[:n_fleet], sound.values[:n_fleet])
    error = main.column("stiffness") / main.column("stiffness_true") - 1
    half = 0.5 * np.log(main.column("stiffness_upper") / main.column("stiffness_lower"))
    enough = main.column("reached") >= _ENOUGH
    agreement = main.column("agreement")
    close = np.abs(main.column("lag_s") - main.column("lag_true_s")) <= _CLOSE_S
    trusted = (main.grade == TRUST)[:, None] & (main.column("determined") > 0)
    found = {
        "encoders.joints": float(error.size),
        "encoders.refused": float(np.mean(main.grade == REFUSED)),
        "encoders.coverage": float(main.inside("stiffness").mean()),
        "encoders.error": float(np.nanmedian(np.abs(error)[enough])) if enough.any() else float("nan"),
        "encoders.enough_torque": float(enough.mean()),
        "encoders.lag": float(close.mean()),
        "encoders.lag_error_ms": float(1e3 * np.nanmax(np.abs(main.column("lag_s") - main.column("lag_true_s")))),
        "encoders.lost_motion": float(main.inside("lost").mean()),
        "encoders.lost_motion_identified": float(np.nanmean(main.column("lost_identified"))),
        "encoders.hysteresis": float(main.inside("width").mean()),
        "encoders.agreement": float(np.mean((agreement > _TAILS[0]) & (agreement < _TAILS[1]))),
        "encoders.width_ratio": float(np.nanmedian(half) / np.nanquantile(np.abs(error), 0.95)),
        "encoders.half_width": float(np.nanmedian(half)),
        "encoders.trusted": float(trusted.mean()),
    }
    found |= _worn(sound, doubled)
    for name, gears in defective.items():
        inside, graded = gears.inside("stiffness"), (gears.grade == TRUST)[:, None]
        inside = inside[:, bent] if name == "behind" and bent is not None else inside
        found[f"encoders.{name}.coverage"] = float(inside.mean())
        found[f"encoders.{name}.trusted"] = float(np.mean(gears.grade == TRUST))
        found[f"encoders.{name}.let_through"] = float(np.mean(graded & ~inside))
    through = [found[f"encoders.{name}.let_through"] for name in defective]
    found["encoders.let_through"] = max(through, default=float("nan"))
    return found


def _worn(sound: Gears, doubled: Gears) -> dict[str, float]:
    """Which robots of the fleet are on the list of outliers by a lost motion: all gears at once, and the worst gear."""
    fleet = np.concatenate([sound.values, doubled.values])
    is_worn = np.arange(len(fleet)) >= len(sound.values)
    traits = []
    for gear in range(fleet.shape[1]):
        rows = fleet[:, gear]
        value, lower, upper, known = (
            rows[:, COLUMNS.index(name)] for name in ("lost", "lost_lower", "lost_upper", "lost_identified")
        )
        kept = np.flatnonzero((known > 0) & np.isfinite(value))
        traits.append(Trait(kept, value[kept], ((upper - lower) / 3.92)[kept], only_large=True))
    outliers = find_outliers(traits, populations(traits, np.arange(len(fleet))))
    named: set[tuple[int, int]] = {(each.row, each.trait) for each in outliers if each.away > 0}
    robots = {row for row, _ in named}
    by_gear = [
        np.mean([(row, gear) in named for row in np.flatnonzero(is_worn).tolist()]) for gear in range(fleet.shape[1])
    ]
    accused = {each.row for each in outliers}
    return {
        "encoders.worn_found": float(np.mean([row in robots for row in np.flatnonzero(is_worn)])),
        "encoders.worn_found_worst_gear": float(min(by_gear)),
        "encoders.worn_false": float(np.mean([row in accused for row in np.flatnonzero(~is_worn)])),
    }


def _conclude(run: Run, study: EncodersStudy, results: Results) -> PartFound:
    sound, doubled = _gears(results, "sound"), _gears(results, "doubled")
    defective = {name: _gears(results, name) for name in ("loose", "behind")} if study.defective else {}
    names = [name.removesuffix(".arm") for name in run.loaded.experiment.campaigns[study.campaign].outputs[1:]]
    at = None if study.hinge is None or study.hinge.joint not in names else names.index(study.hinge.joint)
    figures = figures_of(sound, study.robots, doubled, defective, None if at is None else slice(at, at + 1))

    def of_gear(values: FloatArray | BoolArray) -> list[float]:
        return [float(each) for each in np.nanmean(values[: study.robots], axis=0)]

    error = np.abs(sound.column("stiffness") / sound.column("stiffness_true") - 1)
    columns: dict[str, Sequence[str]] = {
        "Stiffness in its interval": [percent(each) for each in of_gear(sound.inside("stiffness"))],
        "mean error": [percent(each) for each in of_gear(error)],
        "Lost motion in its interval": [percent(each) for each in of_gear(sound.inside("lost"))],
        "identified": [percent(each) for each in of_gear(sound.column("lost_identified"))],
        "Hysteresis in its interval": [percent(each) for each in of_gear(sound.inside("width"))],
        "Torque reached, of rated": [significant(each) for each in of_gear(sound.column("reached"))],
    }
    rows = dict(zip(names, zip(*columns.values(), strict=True), strict=True))
    heads = [(head, lambda name, at=at: rows[name][at]) for at, head in enumerate(columns)]
    lead = (
        "Gears of robots that differ from their file in masses, torque constants, springs and friction, with"
        " hysteresis, stiffening, transmission error, and encoders that lag and are not centred. The truth is known."
    )
    section = Section("Sound gears", lead, (table(heads, names),))
    warnings = (CHOOSING,) if study.use == "choose" else ()
    return PartFound(figures, _ASKED, (section, _told(sound, doubled, defective)), warnings)


def _told(sound: Gears, doubled: Gears, defective: Mapping[str, Gears]) -> Section:
    """Tabulates what is said of robots with a defect, and of sound ones that are not trusted."""
    every = {"sound": sound, "doubled": doubled, **defective}
    rows = [
        (kind, sentence)
        for kind, gears in every.items()
        for grade, sentence in zip(gears.grade.tolist(), gears.sentence, strict=True)
        if kind != "sound" or grade < TRUST
    ]
    numbered = [str(index) for index in range(min(len(rows), 60))]
    columns: list[tuple[str, Any]] = [
        ("Robot", lambda at: rows[int(at)][0]),
        ("What is said", lambda at: rows[int(at)][1]),
    ]
    return Section(
        "What is said", "Of robots with a defect, and of sound ones not trusted.", (table(columns, numbered),)
    )


GEARS = Part("gears", _conclude, _tasks, try_robot, field="")
