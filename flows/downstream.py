"""The Prefect flows of the commands on lists and stores; their parameters are the options of the command line."""

from collections.abc import Callable

from prefect import get_run_logger
from prefect.states import Completed, Failed, State

from flows import commands
from flows.commands import Row, Show
from flows.flow import O, flow_of
from flows.map_options import ControlOptions, ImproveMapOptions, MosaicOptions, PhotometryOptions
from flows.options import (
    AdjustOptions,
    CheckOptions,
    ExportOptions,
    FetchOptions,
    KernelsOptions,
    ReportOptions,
)
from flows.star_options import AstrometryOptions, StarsOptions


def state_of(command: Callable[[O, Show], None], options: O) -> State[None]:
    """Do a command, its rows in the flow's log: Completed when all is well, else Failed. Raises what the command
    raises."""
    good: list[bool] = []
    logger = get_run_logger()

    def show(row: Row) -> None:
        good.append(row.good)
        for line in (row.text or "").splitlines():
            (logger.info if row.good else logger.warning)("%s", line)

    command(options, show)
    bad = good.count(False)
    return Failed(message=f"{bad} of {len(good)} not well") if bad else Completed(message="all well")


@flow_of(FetchOptions)
def fetch(options: FetchOptions) -> State[None]:
    """Get the images, labels, kernels and maps of a list."""
    return state_of(commands.fetch, options)


@flow_of(ExportOptions)
def export(options: ExportOptions) -> State[None]:
    """Export products for other tools."""
    return state_of(commands.export, options)


@flow_of(ReportOptions)
def report(options: ReportOptions) -> State[None]:
    """Write a store as static HTML."""
    return state_of(commands.report, options)


@flow_of(KernelsOptions)
def kernels(options: KernelsOptions) -> State[None]:
    """Write corrected SPICE kernels."""
    return state_of(commands.kernels, options)


@flow_of(PhotometryOptions)
def photometry(options: PhotometryOptions) -> State[None]:
    """Fit a phase function to regions of a store."""
    return state_of(commands.photometry, options)


@flow_of(MosaicOptions)
def mosaic(options: MosaicOptions) -> State[None]:
    """Combine the images of a store to a map of normalised reflectance."""
    return state_of(commands.mosaic, options)


@flow_of(ControlOptions)
def control(options: ControlOptions) -> State[None]:
    """Tie images of a store to each other and adjust all their poses."""
    return state_of(commands.control, options)


@flow_of(ImproveMapOptions)
def improve_map(options: ImproveMapOptions) -> State[None]:
    """Make a base map of a store's images, and correct their orientations against it."""
    return state_of(commands.improve_map, options)


@flow_of(AdjustOptions)
def adjust(options: AdjustOptions) -> State[None]:
    """Solve for what the images of a store share."""
    return state_of(commands.adjust, options)


@flow_of(StarsOptions)
def stars(options: StarsOptions) -> State[None]:
    """Identify the stars of images."""
    return state_of(commands.stars, options)


@flow_of(AstrometryOptions)
def astrometry(options: AstrometryOptions) -> State[None]:
    """Write where bodies are seen among the stars."""
    return state_of(commands.astrometry, options)


@flow_of(CheckOptions)
def check(options: CheckOptions) -> State[None]:
    """Check published products."""
    return state_of(commands.check, options)
