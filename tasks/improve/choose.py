"""The command's options as settings."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from catalog.basemap import BaseMap, map_of_target, read_map
from catalog.errors import RefusedError, WrongOptionError
from catalog.reasons import Reason
from catalog.target import Target
from tasks.improve.frame import feature_of
from tasks.improve.improve import Improved, improve_map
from tasks.improve.settings import ImproveSettings, usual_patches
from tasks.mosaic.settings import MosaicSettings
from tasks.photometry.laws import LAWS


def improve_with(store: Path, options: Mapping[str, Any], say: Callable[[str], None]) -> Improved:
    """`improve_map` with options by their names. Raises WrongOptionError for a law, frame, feature or resolution that
    is none, RefusedError for a base map that cannot be read, and as `improve_map`."""
    if options["law"] not in LAWS:
        raise WrongOptionError("law", f"there is no {options['law']}.", f"Known are {', '.join(LAWS)}.")
    known = ("law", "resolution", "max_incidence_deg", "max_emission_deg", "doubtful")
    settings = ImproveSettings(
        mosaic=MosaicSettings(**{name: options[name] for name in known}),
        patches=usual_patches(options["points"], options["least_correlation"]),
        rounds=options["rounds"],
        still=options["still"],
        hold_frame=options["hold_frame"],
        features=tuple(feature_of(text) for text in options["feature"]),
    )
    path, left_edge_deg = options["map"], options["map_left_edge_deg"]

    def old_map(target: Target) -> BaseMap:
        if path is None and not target.basemap:
            raise RefusedError(Reason.MAP_MISSING, f"the catalog has no base map of {target.name}.", "Give --map FILE.")
        return read_map(path, left_edge_deg) if path else map_of_target(target)

    return improve_map(store, old_map, settings, say)
