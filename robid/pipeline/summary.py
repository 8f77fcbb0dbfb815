"""The run's numbers under flat, dotted names."""

from __future__ import annotations

from robid.pipeline.report_content import RunContent


def summarize(gathered: RunContent) -> dict[str, float]:
    """Returns everything that a run says in numbers, in SI units."""
    found: dict[str, float] = {}
    for name, design in gathered.designs.items():
        found |= {f"designs.{name}.efficiency": design.efficiency, f"designs.{name}.gap": design.gap}
        found[f"designs.{name}.average_std"] = float(design.predicted_relative_std.mean())
        if design.stability is not None:
            found[f"designs.{name}.chosen_again"] = float(design.stability.kept.mean())
    for row in gathered.excitations:
        found[f"campaigns.{row.campaign}.measuring_time_s"] = row.duration_s
        found[f"campaigns.{row.campaign}.lines"] = row.lines
    for fit in gathered.fits:
        found |= {f"fits.{fit.headline.name}.{key}": value for key, value in fit.summary.items()}
    return found | gathered.responses | gathered.comparison
