"""Correct one image from Python, without Prefect."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, cast

from planetpose.result import Result

AnyPath = str | Path
Flip = Literal["x", "y", "rot90", "rot180", "rot270", "transpose", "antitranspose"]


def correct(
    image: AnyPath,
    store: AnyPath = "out",
    *,
    product: str | None = None,
    camera: AnyPath | None = None,
    target: AnyPath | None = None,
    pose_file: AnyPath | None = None,
    kernels: AnyPath | Sequence[AnyPath] | None = None,
    basemap: AnyPath | None = None,
    map_left_edge_deg: float = 0.0,
    shape: AnyPath | None = None,
    profile: AnyPath | dict[str, Any] | None = None,
    hold: Sequence[Literal["offset", "range", "roll", "attitude", "psf"]] = (),
    start_offset_px: tuple[float, float] | None = None,
    mask: AnyPath | None = None,
    flip: Flip | None = None,
    plane: str | None = None,
    summing: int | None = None,
    window: tuple[int, int, int, int] | None = None,
    resume: AnyPath | None = None,
    body: Sequence[str] | None = None,
    stars: AnyPath | None = None,
    cache: AnyPath | None = None,
    progress: Callable[[str, int, str], None] | None = None,
) -> Result:
    """Correct pointing, range and attitude of one image, and publish its cube in `store`/PRODUCT.

    The same steps and the same cache as the command `planetpose correct`, in this process: neither Prefect nor a server
    is needed. What is done already is not done again.

    image: VICAR, compressed Voyager .imq, FITS, PNG or TIFF. product: name of the folder in the store; the file's name
    without suffix by default. camera, target: name, or TOML file; None leaves it to the label. pose_file: predicted
    pose, JSON, or "image": found in the image itself. kernels: SPICE kernels, folders of them or meta-kernels; None
    takes PLANETPOSE_KERNELS. basemap: file, or "none"; None takes the target's. map_left_edge_deg: east longitude of
    its left edge. shape: model that planes are projected on. profile: name or file, or settings as a profile file has
    them; None takes `joint`. hold: groups of parameters that stay as predicted. start_offset_px: (x, y), added to the
    predicted centre beforehand. mask: picture of the frame's size; pixels where it is not zero are not used. flip: of
    the picture, before anything else. plane: of a file with several, its number from 1 or its name. summing: detector
    pixels along a side of an image pixel. window: (x0, y0, width, height) of the part of the detector that the file
    holds, detector pixels from 0. resume: an earlier product, or its result.json, to start from. body: names of other
    bodies in the frame, ("none",) for none; None takes all that the kernels cover. stars: catalog (gaia, hipparcos, or
    a file) whose stars are looked for. cache: folder of steps' results; None takes PLANETPOSE_CACHE.
    progress: called as progress(step, iteration, text) when a step begins (iteration 0, empty text) and iterates.

    Returns the result, see `Result`: an image that cannot be corrected is no exception, its `status` is `refused` or
    `failed` and its `reason` says why. Raises RefusedError for a profile that cannot be used, and ValueError for
    arguments that are none (a product's name that is no folder's name, an unknown flip).
    """
    from flows.one_image import one_result
    from flows.progress import Silent
    from flows.request import Request
    from tasks.objectstore.places import note_in_index
    from tasks.profile import find_profile, profile_of
    from tasks.step import run

    class Reporter(Silent):
        """Passes on what the steps say."""

        def message(self, product: str, step: str, iteration: int, text: str) -> None:  # noqa: ARG002
            """One line of a step."""
            if progress is not None:
                progress(step, iteration, text)

    named: dict[str, Any] = {
        "product": product,
        "camera": None if camera is None else str(camera),
        "target": None if target is None else str(target),
        "pose_file": pose_file,
        "basemap": basemap,
        "shape": shape,
        "start_offset_px": start_offset_px,
        "mask": mask,
        "flip": flip,
        "plane": plane,
        "summing": summing,
        "window": window,
        "resume": resume,
        "body": None if body is None else tuple(body),
        "stars": None if stars is None else str(stars),
        "cache": cache,
    }
    given = {name: value for name, value in named.items() if value is not None}
    if kernels is not None:
        given["kernels"] = (kernels,) if isinstance(kernels, str | Path) else tuple(kernels)
    if profile is not None:
        given["profile"] = profile_of(profile) if isinstance(profile, dict) else find_profile(str(profile))
    request = Request(image=Path(image), store=Path(store), map_left_edge_deg=map_left_edge_deg, **given)
    if hold:
        request = request.model_copy(update={"profile": request.profile.holding(hold)})
    result = one_result(request, Reporter(), run_step=run)
    note_in_index(request.store, result)
    return cast(Result, result)
